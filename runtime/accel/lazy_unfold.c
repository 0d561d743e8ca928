/* lazy_unfold.c - unfolding one application of a state (lazy.h): derived into growing arrays. */
#include "lazy_unfold.h"

#include <stdlib.h>
#include <string.h>

#include "../error.h"
#include "../random.h"

/* Of an event of the derivation, in nodes visited by a walk over a class. */
enum { EVENT_WORK = 4 };

/* So many items of a state have no boxes with cut-offs if they enter states: their gates are tested at once. A fork's box lets
 * nearly nine in ten rays through to a gate, and finding it takes a tenth of unfolding; among many items boxes pay. */
enum { MOST_UNBOXED = 4 };

pl_unfolder *pl_unfolder_create(const pl_scene *scene, pl_error *error)
{
    pl_unfolder *u = calloc(1, sizeof *u);
    if (u) {
        u->scene = scene;
        u->drafts.element = sizeof(draft);
        u->chain.element = u->links.element = sizeof(link_);
        u->computed.element = sizeof(pl_transform);
        u->terms.element = sizeof(uint32_t);
        u->draws.element = sizeof(draw_draft);
        u->parameters.element = sizeof(double);
        u->scopes.element = u->key.element = sizeof(uint64_t);
        u->sharable = calloc(scene->program->node_count, sizeof *u->sharable);
        u->patterns = calloc(KNOWN_PATTERNS, sizeof *u->patterns);
        u->scope.parameters = malloc((scene->program->parameter_count + 1) * sizeof(double));
    }
    if (u && u->scope.parameters && u->sharable && u->patterns && pl_walk_begin(&u->walk, scene->program, 0, NULL, error)) {
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
    free(u->sharable);
    free(u->patterns);
    pl_array *arrays[] = {&u->drafts, &u->chain, &u->links, &u->computed, &u->terms, &u->scopes, &u->draws, &u->parameters, &u->key};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]->data);
    free(u);
}

/* --- unfolding --- */

/* Notes how the transformation of the walk is drawn. */
static bool add_draw(pl_unfolder *u)
{
    const pl_walk *walk = &u->walk;
    const uint32_t count = walk->program->parameter_count;
    const draw_draft d = {walk->node, walk->at.terms, u->terms.count, u->parameters.count};
    uint32_t *terms = pl_array_extend(&u->terms, d.term_count);
    double *parameters = pl_array_extend(&u->parameters, count);
    draw_draft *place = pl_array_extend(&u->draws, 1);
    if (!terms || !parameters || !place) return false;
    if (d.term_count) memcpy(terms, walk->path.terms, d.term_count * sizeof *terms);
    if (count) memcpy(parameters, walk->scope.parameters, count * sizeof *parameters);
    *place = d;
    return true;
}

static bool add_transform(pl_unfolder *u)
{
    const pl_node *node = &u->scene->program->nodes[u->walk.node];
    link_ l = {.constant = u->walk.transform};
    if (l.constant == &u->walk.computed) {
        pl_transform *kept = pl_array_extend(&u->computed, 1);
        if (!kept) return false;
        *kept = u->walk.computed;
        l = (link_){.computed = u->computed.count - 1, .draw = (uint32_t)u->draws.count};
        l.drawn = u->sharing && pl_lazy_code_draws(u->scene->program, node->as.transform_code.code);
        if (l.drawn && !add_draw(u)) return false;
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
        hash = pl_quick_hash(hash, live[i]);
    }
    known_bounds *known = &u->known[pl_quick_place(hash, KNOWN_BOUNDS)];
    if (count <= MOST_LIVE && known->count == count + 1 && known->symbol == symbol &&
        (!count || memcmp(known->live, live, count * sizeof *live) == 0))
        return known;
    pl_classes_bound(classes, symbol, &u->walk.scope, &known->bounds, &u->bounding);
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
static void bring_up(pl_unfolder *u, draft *d)
{
    const link_ *links = u->chain.data;
    d->map = pl_affine_identity();
    d->slack = 0.0;
    for (size_t i = d->it.link_count; i-- > 0;) {
        const pl_transform *transform = link_transform(u, &links[i]);
        u->apart = u->apart || links[i].drawn; /* the box would be each state's own */
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

static bool add_draft(pl_unfolder *u, pl_classes *classes, uint8_t kind, uint32_t what)
{
    const pl_walk *walk = &u->walk;
    draft d = {.it = {.kind = kind,
                      .no_shadow = walk->at.no_shadow,
                      .what = what,
                      .link_count = walk->at.marks[0],
                      .term_count = walk->at.terms},
               .link_first = u->links.count,
               .term_first = u->terms.count,
               .scope_first = u->scopes.count};
    if (kind == PL_NODE_PRIMITIVE) memcpy(d.arguments, walk->arguments, sizeof d.arguments);
    bound(u, classes, &d);
    link_ *links = pl_array_extend(&u->links, d.it.link_count);
    uint32_t *terms = pl_array_extend(&u->terms, d.it.term_count);
    if (!links || !terms) return false;
    if (d.it.link_count) memcpy(links, u->chain.data, d.it.link_count * sizeof *links);
    if (d.it.term_count) memcpy(terms, walk->path.terms, d.it.term_count * sizeof *terms);
    if (kind == PL_NODE_ENTER) {
        uint64_t *words = pl_array_extend(&u->scopes, pl_scope_words(walk->program, &walk->scope) - walk->scope.draws);
        if (!words) return false;
        const draft *before = u->last_entered ? (const draft *)u->drafts.data + u->last_entered - 1 : NULL;
        u->gates += !is_gate_of(&d, before);
        u->last_entered = u->drafts.count + 1;
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

bool pl_unfolder_derive(pl_unfolder *u, uint32_t symbol, pl_classes *classes, pl_error *error)
{
    pl_array *arrays[] = {&u->drafts, &u->chain, &u->links, &u->computed, &u->terms, &u->scopes, &u->draws, &u->parameters};
    bool ok = true;
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) arrays[i]->count = 0;
    u->primitives = u->gates = u->last_entered = u->work = u->bounding = 0;
    u->apart = false;
    pl_walk_restart(&u->walk, symbol == UINT32_MAX ? 0 : symbol, symbol == UINT32_MAX ? NULL : &u->scope);
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

double pl_lazy_coverage(pl_unfolder *u, uint32_t symbol, const uint64_t *scope, const double d[3])
{
    pl_scope_unpack(u->scene->program, scope, &u->scope);
    return pl_covers_of(u->scene->covers, symbol, &u->scope, d);
}
