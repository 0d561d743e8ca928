/* lazy_pattern.c - states from patterns (lazy.h): which may share one, and writing both to one block each.
 *
 * Where draws decide nothing but transformations, and no box depends on one, all states of a symbol with the same live
 * parameters have the same items. A state is made of such a pattern by running the code of the transformations that draw, with
 * its own random key mixed with the terms on the way to them. */
#include "lazy_unfold.h"

#include <string.h>

#include "../error.h"
#include "../random.h"
#include "../reach.h"
#include "../table.h"

/* --- which states share a pattern --- */

typedef enum sharable { NOT_LOOKED_AT, SHARABLE, ALONE } sharable;

/* Nodes of an application that are looked at before it is given up. */
enum { MOST_NODES = 512 };

static bool code_has(const pl_program *program, uint32_t code, uint8_t first, uint8_t second)
{
    if (!code) return false;
    for (const uint8_t *at = program->code + (code - 1); *at != PL_OP_END;) {
        const uint8_t opcode = *at++;
        if (opcode == first || opcode == second) return true;
        if (pl_op_row_of(opcode)->operand == PL_OPERAND_NONE) continue;
        while (*at++ & 0x80) continue;
    }
    return false;
}

bool pl_lazy_code_draws(const pl_program *program, uint32_t code)
{
    return code_has(program, code, PL_OP_RAND, PL_OP_RAND);
}

/* Whether below a node, up to states, draws decide only transformations, at most one on a path: a second one's ordinals would depend
 * on what was drawn before. *left: nodes that may still be looked at. */
static bool draws_only_maps(const pl_program *program, uint32_t node, bool drawn, int *left)
{
    const pl_node *it = &program->nodes[node];
    if (--*left < 0) return false;
    switch (it->kind) {
    case PL_NODE_EMPTY:
    case PL_NODE_ENTER:
    case PL_NODE_MESH: return true;
    case PL_NODE_PRIMITIVE: return !pl_lazy_code_draws(program, it->as.primitive.code);
    case PL_NODE_SYMBOL: return draws_only_maps(program, it->as.symbol.body, drawn, left);
    case PL_NODE_RULE: return draws_only_maps(program, it->as.rule.body, drawn, left);
    case PL_NODE_NO_SHADOW: return draws_only_maps(program, it->as.no_shadow.child, drawn, left);
    case PL_NODE_TRANSFORM: return draws_only_maps(program, it->as.transform.child, drawn, left);
    case PL_NODE_TEXTURE: return !it->as.texture.draws && draws_only_maps(program, it->as.texture.child, drawn, left);
    case PL_NODE_CALCULATE:
        return !code_has(program, it->as.calculate.code, PL_OP_RAND, PL_OP_VARIANTS) &&
               draws_only_maps(program, it->as.calculate.child, drawn, left);
    case PL_NODE_TRANSFORM_CODE: {
        const bool draws = pl_lazy_code_draws(program, it->as.transform_code.code);
        return !(draws && drawn) && !code_has(program, it->as.transform_code.code, PL_OP_STORE, PL_OP_VARIANTS) &&
               draws_only_maps(program, it->as.transform_code.child, drawn || draws, left);
    }
    case PL_NODE_BRANCH:
        return !pl_lazy_code_draws(program, it->as.branch.test) && draws_only_maps(program, it->as.branch.then, drawn, left) &&
               draws_only_maps(program, it->as.branch.otherwise, drawn, left);
    case PL_NODE_UNION:
        for (uint32_t i = 0; i < it->as.union_.children_count; i++)
            if (!draws_only_maps(program, program->children[it->as.union_.children_first + i], drawn, left)) return false;
        return true;
    default: return false;
    }
}

static bool is_sharable(pl_unfolder *u, uint32_t symbol)
{
    const pl_program *program = u->scene->program;
    int left = MOST_NODES;
    if (symbol == UINT32_MAX || !program->nodes[symbol].as.symbol.draws) return false;
    if (u->sharable[symbol] == NOT_LOOKED_AT)
        u->sharable[symbol] = program->nodes[symbol].as.symbol.live_count <= MOST_LIVE && draws_only_maps(program, symbol, false, &left)
                                  ? SHARABLE
                                  : ALONE;
    return u->sharable[symbol] == SHARABLE;
}

/* The place of the pattern for the key that was asked for last, which becomes its own. */
static known_pattern *place_of(pl_unfolder *u, uint32_t symbol, uint64_t epoch)
{
    const uint64_t *live = (const uint64_t *)u->key.data + 1;
    const size_t count = u->key.count - 1;
    uint64_t hash = symbol;
    for (size_t i = 0; i < count; i++) hash = pl_quick_hash(hash, live[i]);
    known_pattern *place = &u->patterns[pl_quick_place(hash, KNOWN_PATTERNS)];
    if (place->epoch == epoch && place->symbol == symbol && memcmp(place->live, live, count * sizeof *live) == 0) return place;
    *place = (known_pattern){.symbol = symbol};
    memcpy(place->live, live, count * sizeof *live);
    return place;
}

/* --- keys and scopes --- */

const uint64_t *pl_unfolder_key(pl_unfolder *u, uint32_t symbol, const uint64_t *scope, uint32_t *words)
{
    const pl_program *program = u->scene->program;
    if (scope) pl_scope_unpack(program, scope, &u->scope);
    u->key.count = 0;
    const pl_node *node = symbol == UINT32_MAX ? NULL : &program->nodes[symbol];
    uint64_t *key = pl_array_extend(&u->key, node ? node->as.symbol.live_count + 1 : 1);
    if (!key) return NULL;
    *words = (uint32_t)u->key.count;
    key[0] = node && node->as.symbol.draws ? u->scope.key : 0;
    for (uint32_t i = 0; i + 1 < *words; i++) {
        double value = u->scope.parameters[program->slots[node->as.symbol.live_first + i]];
        key[i + 1] = isnan(value) ? UINT64_MAX : pl_bits(value);
    }
    return key;
}

/* The random key of an application below some of its terms. */
static uint64_t key_below(const pl_program *program, const pl_lazy_state *state, const uint32_t *terms, uint32_t count)
{
    const pl_node *symbol = &program->nodes[state->pattern->symbol];
    uint64_t key = pl_mix(state->key, program->strings[symbol->as.symbol.name].hash);
    for (uint32_t i = 0; i < count; i++) key = pl_term_key(key, terms[i]);
    return key;
}

void pl_lazy_scope(const pl_program *program, const pl_lazy_state *state, const pl_lazy_item *it, size_t words, uint64_t *scope)
{
    memcpy(scope, it->scope, words * sizeof *scope);
    if (state->pattern->shared) pl_scope_set_key(scope, key_below(program, state, it->terms, it->term_count));
}

/* --- writing --- */

/* The parts of a pattern's block behind its items, in this order; all sizes are multiples of 8. */
typedef struct layout {
    size_t items, computed, links, gates, scopes, live, draws, parameters, arguments, terms, total;
} layout;

static layout layout_of(const pl_unfolder *u)
{
    layout l = {.items = u->drafts.count * sizeof(pl_lazy_item),
                .computed = u->computed.count * PL_LAZY_MAP_BYTES,
                .links = u->links.count * sizeof(pl_lazy_link),
                .gates = u->gates * sizeof(pl_gate_box),
                .scopes = u->scopes.count * sizeof(uint64_t),
                .live = (u->key.count - 1) * sizeof(uint64_t),
                .draws = u->draws.count * sizeof(pl_lazy_draw),
                .parameters = u->parameters.count * sizeof(double),
                .arguments = u->primitives * PL_SHAPE_ARGUMENTS * sizeof(double),
                .terms = (u->terms.count + 1) / 2 * 2 * sizeof(uint32_t)};
    l.total = sizeof(pl_lazy_pattern) + l.items + l.computed + l.links + l.gates + l.scopes + l.live + l.draws + l.parameters +
              l.arguments + l.terms;
    return l;
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
    pl_lazy_link *links;
    pl_gate_box *gate;
    uint64_t *scopes;
    double *arguments;
    uint32_t *terms;
    const draft *before; /* the last one that entered a state */
} cursor;

static pl_lazy_link link_of(const pl_unfolder *u, const link_ *l, const char *maps)
{
    if (l->drawn) return (pl_lazy_link){.drawn = l->draw};
    if (l->constant) return (pl_lazy_link){.transform = l->constant, .stretch = l->constant->stretch};
    return (pl_lazy_link){.transform = (const pl_transform *)(maps + l->computed * PL_LAZY_MAP_BYTES),
                          .stretch = ((const pl_transform *)u->computed.data)[l->computed].stretch};
}

static void write_item(const pl_unfolder *u, const draft *d, cursor *c, pl_lazy_item *it)
{
    const link_ *links = (const link_ *)u->links.data + d->link_first;
    *it = d->it;
    if (it->boxed) write_box(&d->box, it->box);
    it->links = c->links;
    for (uint32_t i = 0; i < it->link_count; i++) *c->links++ = link_of(u, &links[i], c->maps);
    it->terms = c->terms + d->term_first;
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

/* Writes the application that was derived. */
static const pl_lazy_pattern *write_pattern(const pl_unfolder *u, uint32_t symbol, void *memory)
{
    const layout l = layout_of(u);
    pl_lazy_pattern *pattern = memory;
    char *at = (char *)pattern->items + l.items;
    cursor c = {.maps = at};
    c.links = (pl_lazy_link *)(at += l.computed);
    c.gate = (pl_gate_box *)(at += l.links);
    c.scopes = (uint64_t *)(at += l.gates);
    uint64_t *live = (uint64_t *)(at += l.scopes);
    pl_lazy_draw *draws = (pl_lazy_draw *)(at += l.live);
    double *parameters = (double *)(at += l.draws);
    c.arguments = (double *)(at += l.parameters);
    c.terms = (uint32_t *)(at + l.arguments);
    for (size_t i = 0; i < u->computed.count; i++)
        memcpy(c.maps + i * PL_LAZY_MAP_BYTES, (const pl_transform *)u->computed.data + i, PL_LAZY_MAP_BYTES);
    if (l.scopes) memcpy(c.scopes, u->scopes.data, l.scopes);
    if (l.live) memcpy(live, (const uint64_t *)u->key.data + 1, l.live);
    if (l.parameters) memcpy(parameters, u->parameters.data, l.parameters);
    if (u->terms.count) memcpy(c.terms, u->terms.data, u->terms.count * sizeof *c.terms);
    *pattern = (pl_lazy_pattern){.symbol = symbol, .live_count = (uint32_t)(u->key.count - 1), .item_count = (uint32_t)u->drafts.count,
                                 .draw_count = (uint32_t)u->draws.count, .shared = u->sharing, .work = u->work, .live = live,
                                 .draws = draws};
    for (uint32_t i = 0; i < pattern->draw_count; i++) {
        const draw_draft *d = (const draw_draft *)u->draws.data + i;
        draws[i] = (pl_lazy_draw){d->node, d->term_count, c.terms + d->term_first, parameters + d->parameter_first};
    }
    for (uint32_t i = 0; i < pattern->item_count; i++) {
        const draft *d = (const draft *)u->drafts.data + i;
        write_item(u, d, &c, &pattern->items[i]);
        if (d->it.boxed) pl_reach_join(&pattern->reach, &d->reach);
    }
    return pattern;
}

static size_t state_bytes(size_t items, size_t draws)
{
    return sizeof(pl_lazy_state) + items * sizeof(pl_lazy_state *) + draws * PL_LAZY_DRAWN_BYTES;
}

bool pl_unfolder_prepare(pl_unfolder *u, uint32_t symbol, pl_classes *classes, uint64_t epoch, size_t *bytes, uint64_t *work,
                         pl_error *error)
{
    u->sharing = is_sharable(u, symbol);
    u->place = u->sharing ? place_of(u, symbol, epoch) : NULL;
    u->pattern = NULL;
    if (u->place && u->place->epoch == epoch) {
        u->pattern = u->place->pattern;
        u->sharing = u->pattern != NULL;
    }
    if (u->pattern) {
        *work += u->pattern->work;
        *bytes = state_bytes(u->pattern->item_count, u->pattern->draw_count);
        return true;
    }
    bool ok = pl_unfolder_derive(u, symbol, classes, error);
    *work += u->work + u->bounding;
    if (u->place) u->place->epoch = epoch;
    if (ok && u->sharing && (u->apart || u->walk.singular)) {
        u->sharing = false;
        ok = pl_unfolder_derive(u, symbol, classes, error);
        *work += u->work + u->bounding;
    }
    *bytes = layout_of(u).total + state_bytes(u->drafts.count, u->draws.count);
    return ok;
}

/* Runs the code of a transformation that draws. */
static bool draw(pl_unfolder *u, const pl_lazy_state *state, const pl_lazy_draw *d, void *place, pl_error *error)
{
    const pl_program *program = u->scene->program;
    pl_transform transform;
    pl_scope *scope = &u->drawing;
    scope->key = key_below(program, state, d->terms, d->term_count);
    scope->symbol = state->pattern->symbol;
    scope->parameters = d->parameters;
    scope->draws = 0;
    if (!pl_run(program, d->node, program->nodes[d->node].as.transform_code.code, scope, &u->result, error)) return false;
    memset(&transform, 0, PL_LAZY_MAP_BYTES);
    pl_transform_set(&transform, &u->result.matrix);
    const double stretch = u->scene->gates ? pl_largest_stretch(&transform.to_parent) : 0.0;
    memcpy(place, &transform, PL_LAZY_MAP_BYTES);
    memcpy((char *)place + PL_LAZY_MAP_BYTES, &stretch, sizeof stretch);
    return true;
}

pl_lazy_state *pl_unfolder_write(pl_unfolder *u, uint32_t symbol, void *memory, pl_error *error)
{
    const uint64_t *key = u->key.data;
    const pl_lazy_pattern *pattern = u->pattern;
    pl_lazy_state *state = memory;
    if (!pattern) {
        pattern = write_pattern(u, symbol, (char *)memory + state_bytes(u->drafts.count, u->draws.count));
        if (u->sharing) u->place->pattern = pattern;
    }
    *state = (pl_lazy_state){.key = key[0], .pattern = pattern};
    for (uint32_t i = 0; i < pattern->item_count; i++) atomic_init(&state->below[i], NULL);
    char *drawn = (char *)&state->below[pattern->item_count];
    for (uint32_t i = 0; i < pattern->draw_count; i++, drawn += PL_LAZY_DRAWN_BYTES) {
        if (!draw(u, state, &pattern->draws[i], drawn, error)) return NULL;
        state->singular = state->singular || ((const pl_transform *)(void *)drawn)->singular;
    }
    return state;
}
