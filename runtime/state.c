/* state.c - exploring the shared states (state.h): depth first from the scene, each state once.
 *
 * A visit derives one application of a state's symbol, keeps the scopes of the symbols that it enters, looks those up or
 * visits them, and when all are known joins their boxes and counts. The stack of visits is on the heap. Scopes carry
 * all parameters of the first instance that reaches a state; others with equal live parameters have the same geometry. */
#include "state.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "array.h"
#include "error.h"

typedef struct visit {
    uint32_t state, next_item;
    uint32_t lowest;        /* the first open state that this one leads to (Tarjan 1972): states stand in visiting order */
    size_t scopes, cursor;  /* where its entered symbols' packed scopes begin; the next one to be taken */
} visit;

/* A state whose component isn't finished. */
typedef struct open_state {
    uint32_t state;
    size_t trails, trail_counts; /* where its items' trails and their lengths begin */
} open_state;

typedef struct builder {
    pl_states *states;
    pl_walk walk;
    pl_scope scope;
    struct pl_block *item_blocks; /* of items, until they stand one after another */
    pl_array items, chain, path, visits, open, members, scopes, trails, trail_counts, key;
    uint64_t omitted; /* bit i: the i-th symbol that the scene itself enters */
    pl_error *error;
} builder;

/* --- one application --- */

static void *keep(builder *b, const void *data, size_t bytes)
{
    void *place = pl_states_allocate(b->states, bytes ? bytes : 1, b->error);
    if (place && bytes) memcpy(place, data, bytes);
    return place;
}

/* Items have blocks of their own, so that they can be moved. */
static pl_item *keep_items(builder *b)
{
    struct pl_block *others = b->states->blocks;
    b->states->blocks = b->item_blocks;
    pl_item *items = keep(b, b->items.data, b->items.count * sizeof *items);
    b->item_blocks = b->states->blocks;
    b->states->blocks = others;
    return items;
}

static bool remember_transform(builder *b)
{
    const pl_transform *transform = b->walk.transform;
    if (transform == &b->walk.computed) {
        b->walk.computed.stretch = pl_largest_stretch(&transform->to_parent);
        if (!(transform = keep(b, transform, sizeof *transform))) return false;
    }
    b->chain.count = b->walk.at.marks[0]++;
    const pl_transform **place = pl_array_extend(&b->chain, 1);
    if (!place) return pl_fail_memory(b->error, "building the states");
    *place = transform;
    return true;
}

static bool remember_node(builder *b)
{
    b->path.count = b->walk.at.marks[1]++;
    pl_trail_node *place = pl_array_extend(&b->path, 1);
    if (!place) return pl_fail_memory(b->error, "building the states");
    *place = (pl_trail_node){b->walk.node, b->walk.at.marks[0]};
    return true;
}

/* Where the walk stands within its application. */
static const pl_site *keep_site(builder *b)
{
    const pl_walk *walk = &b->walk;
    const size_t terms = walk->at.terms * sizeof *walk->path.terms;
    pl_site *site = pl_states_allocate(b->states, sizeof *site + terms, b->error);
    if (!site) return NULL;
    *site = (pl_site){.rule = walk->at.rule,
                      .texture = (int32_t)walk->at.marks[2] - 1,
                      .texture_transforms = (uint16_t)walk->at.marks[3],
                      .texture_code = walk->at.marks[4] != 0,
                      .term_count = walk->at.terms};
    if (terms) memcpy(site->terms, walk->path.terms, terms);
    return site;
}

/* Adds the leaf at which the walk stands to the items. */
static bool add_item(builder *b, uint8_t kind, uint32_t what)
{
    pl_walk *walk = &b->walk;
    if (walk->at.marks[3] > UINT16_MAX)
        return pl_fail_at(b->error, PL_ERROR_LIMIT, walk->program, walk->node, "a texture below more than %d transformations",
                          UINT16_MAX);
    pl_item item = {.kind = kind,
                    .no_shadow = walk->at.no_shadow,
                    .what = what,
                    .transform_count = walk->at.marks[0],
                    .site = keep_site(b)};
    if (kind == PL_NODE_PRIMITIVE) memcpy(item.arguments, walk->arguments, sizeof item.arguments);
    item.transforms = keep(b, b->chain.data, item.transform_count * sizeof *item.transforms);
    if (!item.transforms || !item.site) return false;
    pl_item *place = pl_array_extend(&b->items, 1);
    uint32_t *trail_count = pl_array_extend(&b->trail_counts, 1);
    pl_trail_node *trail = pl_array_extend(&b->trails, walk->at.marks[1]);
    if (!place || !trail_count || !trail) return pl_fail_memory(b->error, "building the states");
    *place = item;
    *trail_count = walk->at.marks[1];
    if (*trail_count) memcpy(trail, b->path.data, *trail_count * sizeof *trail);
    if (kind != PL_NODE_ENTER) return true;

    uint64_t *words = pl_array_extend(&b->scopes, pl_scope_words(walk->program, &walk->scope));
    if (!words) return pl_fail_memory(b->error, "building the states");
    pl_scope_pack(walk->program, &walk->scope, words);
    pl_walk_prune(walk);
    return true;
}

/* Derives the application that b->walk was restarted for into b->items. A symbol's own S-node is announced, not
 * kept: its box is the state's. */
static bool derive_items(builder *b)
{
    const pl_program *program = b->states->program;
    uint64_t omitted = b->visits.count ? 0 : b->omitted;
    b->items.count = 0;
    for (;;) {
        switch (pl_walk_next(&b->walk, b->error)) {
        case PL_EVENT_ERROR: return false;
        case PL_EVENT_END: return true;
        case PL_EVENT_NODE:
            if (program->nodes[b->walk.node].kind != PL_NODE_SYMBOL && !remember_node(b)) return false;
            break;
        case PL_EVENT_TRANSFORM:
            if (!remember_transform(b)) return false;
            break;
        case PL_EVENT_TEXTURE:
            b->walk.at.marks[2] = b->walk.node + 1;
            b->walk.at.marks[3] = b->walk.at.marks[0];
            b->walk.at.marks[4] |= program->nodes[b->walk.node].as.texture.code != 0;
            break;
        case PL_EVENT_ENTER:
            if (omitted & 1) pl_walk_prune(&b->walk);
            else if (!add_item(b, PL_NODE_ENTER, program->nodes[b->walk.node].as.enter.symbol)) return false;
            omitted >>= 1;
            break;
        case PL_EVENT_PRIMITIVE:
            if (!add_item(b, PL_NODE_PRIMITIVE, b->walk.shape)) return false;
            break;
        case PL_EVENT_MESH:
            if (!add_item(b, PL_NODE_MESH, b->walk.mesh)) return false;
            break;
        }
    }
}

/* Begins the visit of a new state; b->walk stands before its first node. */
static bool begin_visit(builder *b, uint32_t symbol, const uint64_t *key)
{
    if (b->visits.count > PL_LIMIT_DEPTH)
        return pl_fail_at(b->error, PL_ERROR_LIMIT, b->states->program, symbol,
                          "depth: %s is still being derived %d symbols deep, which is the limit; does its recursion end?",
                          b->states->program->strings[b->states->program->nodes[symbol].as.symbol.name].text,
                          PL_LIMIT_DEPTH);
    visit v = {b->states->count, 0, b->states->count, b->scopes.count, b->scopes.count};
    open_state open = {b->states->count, b->trails.count, b->trail_counts.count};
    if (!pl_states_add(b->states, symbol, key, b->error) || !derive_items(b)) return false;
    pl_item *items = keep_items(b);
    visit *place = pl_array_extend(&b->visits, 1);
    open_state *open_place = pl_array_extend(&b->open, 1);
    if (!items) return false;
    if (!place || !open_place) return pl_fail_memory(b->error, "building the states");
    *place = v;
    *open_place = open;
    pl_state *state = &b->states->list[v.state];
    state->items = items;
    state->item_count = (uint32_t)b->items.count;
    state->bounds->singular = b->walk.singular;
    return true;
}

static bool fail_endless(builder *b, uint32_t symbol, const uint64_t *key)
{
    const pl_program *program = b->states->program;
    const pl_node *node = &program->nodes[symbol];
    char values[256] = "";
    size_t used = 0;
    for (uint32_t i = 0; i < node->as.symbol.live_count && used < sizeof values - 1; i++) {
        char number[PL_NUMBER_TEXT] = "unset";
        double value;
        memcpy(&value, &key[1 + i], sizeof value);
        if (key[1 + i] != UINT64_MAX) pl_number_text(value, number);
        uint32_t slot = program->slots[node->as.symbol.live_first + i];
        int wrote = snprintf(values + used, sizeof values - used, "%s%s = %s", used ? ", " : " with ",
                             program->strings[program->parameters[slot]].text, number);
        used += wrote > 0 ? (size_t)wrote : 0;
    }
    return pl_fail_at(b->error, PL_ERROR_SCENE, program, symbol, "endless recursion: %s%s contains itself",
                      program->strings[node->as.symbol.name].text, values);
}

/* --- boxes and counts, once an application's states are known --- */

/* What a state consists of, its box aside; items in path order. */
static void count_items(pl_states *states, pl_state *state)
{
    uint64_t count = 0;
    for (uint32_t i = 0; i < state->item_count; i++) {
        pl_item *item = (pl_item *)&state->items[i];
        item->first = count;
        count = pl_add_saturating(count, pl_item_primitives(states, item));
        if (item->kind != PL_NODE_ENTER) continue;
        const pl_state *below = &states->list[item->what];
        if (!below->open) state->bounds->singular = pl_add_saturating(state->bounds->singular, below->bounds->singular);
        if (below->depth > state->depth) state->depth = below->depth;
        state->endless = state->endless || below->endless;
    }
    state->primitives = count;
    if (state->depth < UINT32_MAX) state->depth += state->symbol != UINT32_MAX;
}

/* The boxes of what a state's items hold. One in a cycle has its own box and gate already; graph nodes need no boxes where
 * there are gates. */
static void bound_items(builder *b, const open_state *open, bool in_cycle)
{
    pl_states *states = b->states;
    pl_state *state = &states->list[open->state];
    const pl_trail_node *trail = (const pl_trail_node *)b->trails.data + open->trails;
    const uint32_t *trail_counts = (const uint32_t *)b->trail_counts.data + open->trail_counts;
    for (uint32_t i = 0; i < state->item_count; i++) {
        const pl_item *item = &state->items[i];
        pl_reach reach;
        pl_box box = pl_item_box_tight(states, item, &reach);
        if (pl_item_unbounded(states, item) || !(pl_box_is_empty(&box) || pl_box_is_finite(&box)))
            state->unbounded = true;
        if (!in_cycle) pl_box_join(&state->bounds->box, &box);
        pl_reach_join(&state->bounds->reach, &reach);
        if (states->node_boxes && !state->endless) pl_join_node_boxes(states, item, trail, trail_counts[i]);
        trail += trail_counts[i];
    }
    state->bounds->reach.size = fmin(state->bounds->reach.size, 1.7320508075688774 * pl_box_reach(&state->bounds->box));
    if (!in_cycle) state->bounds->gate = state->bounds->reach;
    else pl_reach_join(&state->bounds->reach, &state->bounds->gate);
}

/* Finishes the open states from `first` on, which lead to each other: all that they enter otherwise is finished. */
static bool finish_component(builder *b, size_t first)
{
    pl_states *states = b->states;
    const open_state *open = (const open_state *)b->open.data + first;
    size_t count = b->open.count - first;
    bool cyclic = states->list[open->state].endless;
    if (cyclic) {
        b->members.count = 0;
        uint32_t *members = pl_array_extend(&b->members, count);
        if (!members) return pl_fail_memory(b->error, "building the states");
        for (size_t i = 0; i < count; i++) {
            pl_state *state = &states->list[members[i] = open[i].state];
            state->endless = true;
            state->depth = UINT32_MAX;
            state->primitives = UINT64_MAX;
        }
        int bound = pl_bound_component(states, members, (uint32_t)count, b->error);
        if (bound < 0) return false;
        if (!bound) return fail_endless(b, states->list[*members].symbol, states->list[*members].bounds->key);
    }
    for (size_t i = 0; i < count; i++) {
        pl_state *state = &states->list[open[i].state];
        count_items(states, state);
        if (cyclic) state->primitives = UINT64_MAX, state->depth = UINT32_MAX;
        bound_items(b, &open[i], cyclic);
        if (states->node_boxes && state->symbol != UINT32_MAX && !state->endless) pl_join_symbol_box(states, open[i].state);
        state->bounds->diameter = pl_box_diameter(&state->bounds->box);
    }
    for (size_t i = 0; i < count; i++) states->list[open[i].state].open = false;
    b->trails.count = open->trails;
    b->trail_counts.count = open->trail_counts;
    b->open.count = first;
    return true;
}

/* --- exploring --- */

/* Resolves the next entered symbol of a visit: known states at once, a new one by a visit of its own. */
static bool resolve_item(builder *b, visit *v)
{
    pl_states *states = b->states;
    pl_item *item = (pl_item *)&states->list[v->state].items[v->next_item++];
    if (item->kind != PL_NODE_ENTER) return true;
    uint32_t symbol = item->what;
    const uint64_t *words = (const uint64_t *)b->scopes.data + v->cursor;
    pl_scope_unpack(states->program, words, &b->scope);
    v->cursor += pl_scope_words(states->program, &b->scope);
    b->key.count = 0;
    uint64_t *wanted = pl_array_extend(&b->key, pl_states_key_words(states, symbol));
    if (!wanted) return pl_fail_memory(b->error, "building the states");
    pl_states_key(states, symbol, &b->scope, wanted);
    uint32_t slot = pl_states_slot(states, wanted);
    if (states->table[slot]) {
        item->what = states->table[slot] - 1;
        if (!states->list[item->what].open) return true;
        states->list[item->what].endless = true;
        if (item->what < v->lowest) v->lowest = item->what;
        return true;
    }
    uint64_t *key = keep(b, wanted, b->key.count * sizeof *key);
    if (!key) return false;
    item->what = states->count;
    states->table[slot] = states->count + 1;
    pl_walk_restart(&b->walk, symbol, &b->scope);
    if (!begin_visit(b, symbol, key)) return false;
    return 2 * (uint64_t)states->count < states->table_size || pl_states_grow_table(states, b->error);
}

static bool explore(builder *b)
{
    if (!pl_states_grow_table(b->states, b->error) || !begin_visit(b, UINT32_MAX, NULL)) return false;
    while (b->visits.count) {
        visit *v = (visit *)b->visits.data + b->visits.count - 1;
        if (v->next_item < b->states->list[v->state].item_count) {
            if (!resolve_item(b, v)) return false;
            continue;
        }
        visit done = *v;
        b->scopes.count = done.scopes;
        b->visits.count--;
        if (b->visits.count && done.lowest < v[-1].lowest) v[-1].lowest = done.lowest;
        if (done.lowest < done.state) continue;
        size_t first = b->open.count - 1;
        while (((const open_state *)b->open.data)[first].state != done.state) first--;
        if (!finish_component(b, first)) return false;
    }
    return true;
}

/* Moves the items of all states into one array, in the states' order. */
static bool line_up_items(builder *b)
{
    pl_states *states = b->states;
    size_t count = 0, freed = 0;
    for (uint32_t i = 0; i < states->count; i++) count += states->list[i].item_count;
    pl_item *items = pl_states_allocate(states, (count + 1) * sizeof *items, b->error);
    if (!items) return false;
    states->items = items;
    states->item_count = count;
    for (uint32_t i = 0; i < states->count; i++) {
        pl_state *state = &states->list[i];
        memcpy(items, state->items, state->item_count * sizeof *items);
        state->items = items;
        items += state->item_count;
    }
    for (const struct pl_block *block = b->item_blocks; block; block = block->next) freed += sizeof *block + block->size;
    states->bytes -= freed;
    return true;
}

bool pl_states_build(pl_states *states, const pl_program *program, pl_mesh_tree *const *meshes, bool node_boxes,
                     size_t limit, uint32_t most, pl_error *error)
{
    return pl_states_build_without(states, 0, program, meshes, node_boxes, limit, most, error);
}

bool pl_states_build_without(pl_states *states, uint64_t omitted, const pl_program *program, pl_mesh_tree *const *meshes,
                             bool node_boxes, size_t limit, uint32_t most, pl_error *error)
{
    memset(states, 0, sizeof *states);
    states->program = program;
    states->meshes = meshes;
    states->most = most ? most : UINT32_MAX;
    states->limit = limit ? limit : PL_STATES_DEFAULT_BYTES;
    builder b = {.states = states, .error = error, .omitted = omitted};
    b.items.element = sizeof(pl_item);
    b.chain.element = sizeof(pl_transform *);
    b.path.element = b.trails.element = sizeof(pl_trail_node);
    b.visits.element = sizeof(visit);
    b.open.element = sizeof(open_state);
    b.members.element = sizeof(uint32_t);
    b.scopes.element = b.key.element = sizeof(uint64_t);
    b.trail_counts.element = sizeof(uint32_t);
    bool ok = pl_walk_begin(&b.walk, program, 0, NULL, error);
    b.walk.announce = node_boxes;
    b.scope.parameters = malloc((program->parameter_count + 1) * sizeof(double));
    if (!b.scope.parameters) ok = pl_fail_memory(error, "building the states");
    if (ok && node_boxes) {
        states->node_boxes = malloc(program->node_count * sizeof *states->node_boxes);
        if (!states->node_boxes) ok = pl_fail_memory(error, "building the states");
        else states->bytes += program->node_count * sizeof *states->node_boxes;
        for (uint32_t i = 0; ok && i < program->node_count; i++)
            states->node_boxes[i] = (pl_node_box){.box = pl_box_empty()};
    }
    ok = ok && explore(&b) && line_up_items(&b);
    pl_blocks_free(b.item_blocks);
    pl_walk_end(&b.walk);
    free(b.scope.parameters);
    pl_array *arrays[] = {&b.items, &b.chain, &b.path, &b.visits, &b.open, &b.members, &b.scopes, &b.trails, &b.trail_counts, &b.key};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]->data);
    if (!ok) pl_states_free(states);
    return ok;
}
