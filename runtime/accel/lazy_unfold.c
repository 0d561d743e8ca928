/* lazy_unfold.c - unfolding one application of a state (lazy.h): derived into growing arrays, then written to one block. */
#include <stdlib.h>
#include <string.h>

#include "../array.h"
#include "../error.h"
#include "../random.h"
#include "lazy.h"

/* Of an event of the derivation, in nodes visited by a walk over a class. */
enum { EVENT_WORK = 4 };

enum { KNOWN_BOUNDS = 64, MOST_LIVE = 8 };

/* So many items of a state have no boxes with cut-offs if they enter states: their gates are tested at once. A fork's box lets
 * nearly nine in ten rays through to a gate, and finding it takes a tenth of unfolding; among many items boxes pay. */
enum { MOST_UNBOXED = 4 };

/* What tracing needs of a computed transformation: all before to_parent (program.h). */
#define MAP_BYTES offsetof(pl_transform, to_parent)

/* Bounds of the classes that were asked for last; a place for each hash. */
typedef struct known_bounds {
    uint32_t symbol, count; /* of live parameters, + 1; 0: none */
    uint64_t live[MOST_LIVE];
    pl_bounds bounds;
    pl_gate_box gate;
} known_bounds;

/* Growing arrays of what is being unfolded; a draft refers to them by index. */
typedef struct draft {
    pl_lazy_item it;
    pl_box box;
    pl_affine map; /* the product of its transformations' to_parent … */
    double slack;  /* … and how far roundings of that may move a point */
    pl_reach reach;
    pl_gate_box gate;
    double arguments[PL_SHAPE_ARGUMENTS];
    size_t transform_first, term_first, scope_first;
} draft;

struct pl_unfolder {
    const pl_scene *scene;
    pl_walk walk;
    pl_scope scope;
    pl_array drafts, chain, transforms, computed, terms, scopes, key;
    uint64_t work;
    known_bounds known[KNOWN_BOUNDS];
    size_t primitives, gates, entered_transforms; /* what the drafts will need */
    size_t last_entered;                          /* the last draft of a state, + 1; 0: none */
};

/* A transformation of the current path: constant, or one of `computed`. */
typedef struct link_ {
    const pl_transform *constant;
    size_t computed;
} link_;

pl_unfolder *pl_unfolder_create(const pl_scene *scene, pl_error *error)
{
    pl_unfolder *u = calloc(1, sizeof *u);
    if (u) {
        u->scene = scene;
        u->drafts.element = sizeof(draft);
        u->chain.element = u->transforms.element = sizeof(link_);
        u->computed.element = sizeof(pl_transform);
        u->terms.element = sizeof(uint32_t);
        u->scopes.element = u->key.element = sizeof(uint64_t);
        u->scope.parameters = malloc((scene->program->parameter_count + 1) * sizeof(double));
    }
    if (u && u->scope.parameters && pl_walk_begin(&u->walk, scene->program, 0, NULL, error)) {
        u->walk.stretches = scene->gates != NULL;
        u->walk.memo = pl_memo_create(scene->program);
        if (u->walk.memo) return u;
    }
    pl_unfolder_free(u);
    pl_fail_memory(error, "preparing to unfold");
    return NULL;
}

void pl_unfolder_free(pl_unfolder *u)
{
    if (!u) return;
    pl_memo_free(u->walk.memo);
    pl_walk_end(&u->walk);
    free(u->scope.parameters);
    pl_array *arrays[] = {&u->drafts, &u->chain, &u->transforms, &u->computed, &u->terms, &u->scopes, &u->key};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]->data);
    free(u);
}

/* --- unfolding --- */

static bool add_transform(pl_unfolder *u)
{
    link_ l = {u->walk.transform, 0};
    if (l.constant == &u->walk.computed) {
        pl_transform *kept = pl_array_extend(&u->computed, 1);
        if (!kept) return false;
        *kept = u->walk.computed;
        l = (link_){NULL, u->computed.count - 1};
    }
    u->chain.count = u->walk.at.marks[0]++;
    link_ *place = pl_array_extend(&u->chain, 1);
    if (place) *place = l;
    return place != NULL;
}

static const pl_transform *link_transform(const pl_unfolder *u, const link_ *l)
{
    return l->constant ? l->constant : (const pl_transform *)u->computed.data + l->computed;
}

/* What is known of the state that the walk enters. */
static const known_bounds *bounds_of(pl_unfolder *u, pl_classes *classes, uint32_t symbol)
{
    const pl_program *program = u->scene->program;
    const pl_node *node = &program->nodes[symbol];
    const uint32_t count = node->as.symbol.live_count;
    uint64_t live[MOST_LIVE], hash = symbol;
    for (uint32_t i = 0; i < count && i < MOST_LIVE; i++) {
        memcpy(&live[i], &u->walk.scope.parameters[program->slots[node->as.symbol.live_first + i]], sizeof live[i]);
        hash = (hash ^ live[i]) * UINT64_C(0x9E3779B97F4A7C15);
    }
    known_bounds *known = &u->known[(hash >> 32) % KNOWN_BOUNDS];
    if (count <= MOST_LIVE && known->count == count + 1 && known->symbol == symbol &&
        (!count || memcmp(known->live, live, count * sizeof *live) == 0))
        return known;
    pl_classes_bound(classes, symbol, &u->walk.scope, &known->bounds, &u->work);
    known->gate = pl_bounds_gate(&known->bounds);
    known->symbol = symbol;
    known->count = count <= MOST_LIVE ? count + 1 : 0;
    if (known->count) memcpy(known->live, live, count * sizeof *live);
    return known;
}

/* A bound of the largest stretch that is found at once, not much larger: items' reaches only filter. */
static double rough_stretch(const pl_affine *map)
{
    double square = 0.0;
    for (int i = 0; i < 12; i++) square += i % 4 == 3 ? 0.0 : map->m[i] * map->m[i];
    return sqrt(square) * (1.0 + 16.0 * DBL_EPSILON);
}

static pl_box widened(const pl_box *box, double slack)
{
    pl_box wide = *box;
    for (int axis = 0; axis < 3; axis++) {
        wide.lo[axis] -= slack;
        wide.hi[axis] += slack;
    }
    return wide;
}

/* The reach of a draft, which is that of its leaf or state, in the state's frame; and its map. */
static void bring_up(const pl_unfolder *u, draft *d)
{
    const link_ *links = u->chain.data;
    d->map = pl_affine_identity();
    d->slack = 0.0;
    for (size_t i = d->it.transform_count; i-- > 0;) {
        const pl_transform *transform = link_transform(u, &links[i]);
        const double m = rough_stretch(&transform->to_parent), n = rough_stretch(&transform->to_object);
        d->reach = pl_reach_with(transform, m, n, &d->reach);
        d->slack = m * d->slack + 128.0 * DBL_EPSILON * d->reach.size;
        d->map = pl_affine_multiply(&transform->to_parent, &d->map);
    }
}

static void bound_state(pl_unfolder *u, pl_classes *classes, draft *d)
{
    const known_bounds *known = bounds_of(u, classes, d->it.what);
    const pl_bounds *bounds = &known->bounds;
    const bool cuts = u->scene->gates != NULL;
    d->gate = known->gate;
    d->it.unbounded = bounds->unbounded;
    d->it.boxed = !bounds->unbounded && !(cuts && u->drafts.count < MOST_UNBOXED);
    if (!d->it.boxed) return;
    d->it.whole = cuts && bounds->hollow;
    d->reach = cuts ? d->gate.reach : bounds->reach;
    bring_up(u, d);
    d->box = bounds->box;
    if (pl_box_is_empty(&bounds->box)) return;
    d->box = d->it.whole ? pl_box_map(&d->map, &bounds->box) : pl_hull_box_under(&d->map, &bounds->hull);
}

static void bound_leaf(pl_unfolder *u, draft *d)
{
    const pl_shape *shape = d->it.kind == PL_NODE_PRIMITIVE ? pl_shape_of(d->it.what) : NULL;
    pl_box box = pl_box_everything();
    if (!shape) box = *pl_mesh_box(u->scene->meshes[d->it.what]);
    else if (shape->support) box = pl_shape_box(shape, d->arguments, NULL);
    d->it.unbounded = !pl_box_is_empty(&box) && !pl_box_is_finite(&box);
    d->it.boxed = !d->it.unbounded;
    d->it.whole = true;
    d->reach = pl_reach_leaf(d->it.unbounded ? 0.0 : 1.7320508075688774 * pl_box_reach(&box));
    bring_up(u, d);
    d->box = box;
    if (d->it.unbounded || pl_box_is_empty(&box)) return;
    d->box = shape ? pl_shape_box(shape, d->arguments, d->map.m) : pl_box_map(&d->map, &box);
}

/* The bounds of a draft in the state's frame. */
static void bound(pl_unfolder *u, pl_classes *classes, draft *d)
{
    if (d->it.kind == PL_NODE_ENTER) bound_state(u, classes, d);
    else bound_leaf(u, d);
    if (!d->it.boxed || pl_box_is_empty(&d->box)) return;
    d->box = widened(&d->box, d->slack);
    if (pl_box_is_finite(&d->box)) return;
    d->box = pl_box_everything();
    d->it.boxed = false;
    d->it.unbounded = true;
}

/* Whether both enter states of the same bounds: then they share them. */
static bool is_gate_of(const draft *d, const draft *before)
{
    return before && memcmp(&d->gate, &before->gate, sizeof d->gate) == 0;
}

static bool add_draft(pl_unfolder *u, pl_classes *classes, uint8_t kind, uint32_t what)
{
    const pl_walk *walk = &u->walk;
    draft d = {.it = {.kind = kind,
                      .no_shadow = walk->at.no_shadow,
                      .what = what,
                      .transform_count = walk->at.marks[0],
                      .term_count = walk->at.terms},
               .transform_first = u->transforms.count,
               .term_first = u->terms.count,
               .scope_first = u->scopes.count};
    if (kind == PL_NODE_PRIMITIVE) memcpy(d.arguments, walk->arguments, sizeof d.arguments);
    bound(u, classes, &d);
    link_ *transforms = pl_array_extend(&u->transforms, d.it.transform_count);
    uint32_t *terms = pl_array_extend(&u->terms, d.it.term_count);
    if (!transforms || !terms) return false;
    if (d.it.transform_count) memcpy(transforms, u->chain.data, d.it.transform_count * sizeof *transforms);
    if (d.it.term_count) memcpy(terms, walk->path.terms, d.it.term_count * sizeof *terms);
    if (kind == PL_NODE_ENTER) {
        uint64_t *words = pl_array_extend(&u->scopes, pl_scope_words(walk->program, &walk->scope) - walk->scope.draws);
        if (!words) return false;
        const draft *before = u->last_entered ? (const draft *)u->drafts.data + u->last_entered - 1 : NULL;
        u->gates += !is_gate_of(&d, before);
        u->last_entered = u->drafts.count + 1;
        u->entered_transforms += d.it.transform_count;
        /* Draws end with the application. */
        const uint32_t draws = u->walk.scope.draws;
        u->walk.scope.draws = 0;
        pl_scope_pack(walk->program, &walk->scope, words);
        u->walk.scope.draws = draws;
    }
    u->primitives += kind == PL_NODE_PRIMITIVE;
    draft *place = pl_array_extend(&u->drafts, 1);
    if (place) *place = d;
    return place != NULL;
}

static bool derive(pl_unfolder *u, pl_classes *classes, pl_error *error)
{
    bool ok = true;
    u->primitives = u->gates = u->entered_transforms = u->last_entered = u->drafts.count = u->chain.count = u->transforms.count = u->computed.count = u->terms.count = u->scopes.count = 0;
    while (ok) {
        u->work += EVENT_WORK;
        switch (pl_walk_next(&u->walk, error)) {
        case PL_EVENT_ERROR: return false;
        case PL_EVENT_END: return true;
        case PL_EVENT_TRANSFORM: ok = add_transform(u); break;
        case PL_EVENT_ENTER:
            ok = add_draft(u, classes, PL_NODE_ENTER, u->scene->program->nodes[u->walk.node].as.enter.symbol);
            pl_walk_prune(&u->walk);
            break;
        case PL_EVENT_PRIMITIVE: ok = add_draft(u, classes, PL_NODE_PRIMITIVE, u->walk.shape); break;
        case PL_EVENT_MESH: ok = add_draft(u, classes, PL_NODE_MESH, u->walk.mesh); break;
        default: break;
        }
    }
    return pl_fail_memory(error, "unfolding a state");
}

/* The parts of a state's block, in this order; all sizes are multiples of 8. */
typedef struct layout {
    size_t items, computed, transforms, gates, scopes, key, arguments, terms, total;
} layout;

static layout layout_of(const pl_unfolder *u)
{
    layout l = {.items = u->drafts.count * sizeof(pl_lazy_item),
                .computed = u->computed.count * MAP_BYTES,
                .transforms = u->transforms.count * sizeof(pl_transform *),
                .gates = u->gates * sizeof(pl_gate_box),
                .scopes = u->scopes.count * sizeof(uint64_t),
                .key = u->key.count * sizeof(uint64_t),
                .arguments = u->primitives * PL_SHAPE_ARGUMENTS * sizeof(double),
                .terms = (u->terms.count + 1) / 2 * 2 * sizeof(uint32_t)};
    if (u->scene->gates) l.transforms += u->entered_transforms * sizeof(double);
    l.total = sizeof(pl_lazy_state) + l.items + l.computed + l.transforms + l.gates + l.scopes + l.key + l.arguments + l.terms;
    return l;
}

bool pl_unfolder_derive(pl_unfolder *u, uint32_t symbol, pl_classes *classes, size_t *bytes, uint64_t *work, pl_error *error)
{
    pl_walk_restart(&u->walk, symbol == UINT32_MAX ? 0 : symbol, symbol == UINT32_MAX ? NULL : &u->scope);
    u->work = 0;
    const bool ok = derive(u, classes, error);
    *work += u->work;
    *bytes = layout_of(u).total;
    return ok;
}

static void write_box(const pl_box *box, float planes[6])
{
    for (int axis = 0; axis < 3; axis++) {
        planes[axis] = pl_round_down(box->lo[axis]);
        planes[3 + axis] = pl_round_up(box->hi[axis]);
    }
}

/* Where the next of each kind goes. */
typedef struct cursor {
    char *maps;
    const pl_transform **transforms;
    pl_gate_box *gate;
    uint64_t *scopes;
    double *arguments;
    uint32_t *terms;
    const draft *before; /* the last one that entered a state */
} cursor;

/* An item's transformations and, of an enter item with cut-offs, their stretches. */
static void write_transforms(const pl_unfolder *u, const draft *d, cursor *c, pl_lazy_item *it)
{
    const link_ *links = (const link_ *)u->transforms.data + d->transform_first;
    it->transforms = c->transforms;
    for (uint32_t i = 0; i < it->transform_count; i++)
        *c->transforms++ = links[i].constant ? links[i].constant : (const pl_transform *)(c->maps + links[i].computed * MAP_BYTES);
    if (it->kind != PL_NODE_ENTER || !u->scene->gates) return;
    double *stretches = (double *)c->transforms;
    for (uint32_t i = 0; i < it->transform_count; i++) *stretches++ = link_transform(u, &links[i])->stretch;
    c->transforms = (const pl_transform **)stretches;
}

static void write_item(const pl_unfolder *u, const draft *d, cursor *c, pl_lazy_item *it)
{
    *it = d->it;
    if (it->boxed) write_box(&d->box, it->box);
    write_transforms(u, d, c, it);
    it->terms = c->terms + d->term_first;
    atomic_init(&it->state, NULL);
    if (it->kind == PL_NODE_PRIMITIVE) {
        memcpy(c->arguments, d->arguments, sizeof d->arguments);
        it->arguments = c->arguments;
        c->arguments += PL_SHAPE_ARGUMENTS;
    } else if (it->kind == PL_NODE_ENTER) {
        if (!is_gate_of(d, c->before)) *c->gate++ = d->gate;
        it->gate = c->gate - 1;
        it->scope = c->scopes + d->scope_first;
        c->before = d;
    }
}

pl_lazy_state *pl_unfolder_write(pl_unfolder *u, uint32_t symbol, uint64_t hash, void *memory)
{
    const layout l = layout_of(u);
    pl_lazy_state *state = memory;
    char *at = (char *)state->items + l.items;
    cursor c = {.maps = at};
    c.transforms = (const pl_transform **)(at += l.computed);
    c.gate = (pl_gate_box *)(at += l.transforms);
    c.scopes = (uint64_t *)(at += l.gates);
    uint64_t *key = (uint64_t *)(at += l.scopes);
    c.arguments = (double *)(at += l.key);
    c.terms = (uint32_t *)(at + l.arguments);
    for (size_t i = 0; i < u->computed.count; i++)
        memcpy(c.maps + i * MAP_BYTES, (const pl_transform *)u->computed.data + i, MAP_BYTES);
    if (l.scopes) memcpy(c.scopes, u->scopes.data, l.scopes);
    if (l.key) memcpy(key, u->key.data, l.key);
    if (u->terms.count) memcpy(c.terms, u->terms.data, u->terms.count * sizeof *c.terms);
    *state = (pl_lazy_state){.hash = hash, .symbol = symbol, .key_words = (uint32_t)u->key.count,
                             .item_count = (uint32_t)u->drafts.count, .key = key};
    for (uint32_t i = 0; i < state->item_count; i++) {
        const draft *d = (const draft *)u->drafts.data + i;
        write_item(u, d, &c, &state->items[i]);
        if (d->it.boxed) pl_reach_join(&state->reach, &d->reach);
    }
    return state;
}

double pl_lazy_coverage(pl_unfolder *u, uint32_t symbol, const uint64_t *scope, const double d[3])
{
    pl_scope_unpack(u->scene->program, scope, &u->scope);
    return pl_covers_of(u->scene->covers, symbol, &u->scope, d);
}

const uint64_t *pl_unfolder_key(pl_unfolder *u, uint32_t symbol, const uint64_t *scope, uint32_t *words)
{
    const pl_program *program = u->scene->program;
    if (scope) pl_scope_unpack(program, scope, &u->scope);
    u->key.count = 0;
    const pl_node *node = symbol == UINT32_MAX ? NULL : &program->nodes[symbol];
    uint64_t *key = pl_array_extend(&u->key, node ? node->as.symbol.live_count + 1 : 0);
    if (!key) return NULL;
    *words = (uint32_t)u->key.count;
    if (!node) return key;
    key[0] = node->as.symbol.draws ? u->scope.key : 0;
    for (uint32_t i = 0; i < node->as.symbol.live_count; i++) {
        double value = u->scope.parameters[program->slots[node->as.symbol.live_first + i]];
        key[i + 1] = isnan(value) ? UINT64_MAX : pl_bits(value);
    }
    return key;
}
