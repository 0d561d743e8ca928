/* endless.c - boxes of states that enter each other for ever (state.h; paper, section 3: the Collage Theorem).
 *
 * A component's states s obey A(s) = own(s) ∪ ⋃ M·A(w) over the items M, w that stay in the component. Where every way
 * round contracts, there is one bounded solution (Hutchinson 1981), and any sets that hold their own images hold it.
 *
 * 1. Balls about the frames' origins: radii r with r(s) >= own(s) and r(s) >= |τ| + σ·r(w) for every item, σ the largest
 *    singular value of M and τ its translation. Iterated from below, widened a little, then *proven* by evaluating the
 *    inequalities once more. Where a single step stretches, two, four … 64 steps together are tried.
 * 2. Boxes: the support function of A(s) along the six axis directions by branch and bound: the way with the highest
 *    bound u·τ + |Mᵀu|·r(w) is extended until what is left is too small to matter. Any bound at any time is safe, so
 *    boxes that wouldn't close under |M| (a spiral turned by 45°) come out tight. */
#include <stdlib.h>
#include <string.h>

#include "error.h"
#include "state.h"

enum { SWEEPS = 20000, DOUBLINGS = 6, MOST_EDGES = 1 << 12, MOST_WAYS = 768 };

#define WIDEN 1e-7     /* of radii, before they are proven */
#define TIGHT 1e-8     /* of the radius: a support this close is close enough */
#define GATE 256.0     /* roundings that an endless state's gate allows for (cut.h) */

/* A way from member `from` to member `to`. */
typedef struct edge {
    uint32_t from, to;
    double stretch, shift;
    pl_affine map;
} edge;

typedef struct component {
    pl_states *states;
    const uint32_t *members;
    uint32_t count;
    uint32_t *number; /* of each state, UINT32_MAX: not a member */
    edge *edges;
    uint32_t edge_count;
    double *own, *radius; /* of each member */
    pl_error *error;
} component;

static pl_affine item_map(const pl_item *item)
{
    pl_affine map = pl_affine_identity();
    for (uint32_t i = 0; i < item->transform_count; i++)
        map = pl_affine_multiply(&map, &item->transforms[i]->to_parent);
    return map;
}

static edge make_edge(uint32_t from, uint32_t to, const pl_affine *map)
{
    double square = map->m[3] * map->m[3] + map->m[7] * map->m[7] + map->m[11] * map->m[11];
    return (edge){from, to, pl_largest_stretch(map), sqrt(square), *map};
}

static bool add_edge(component *c, edge **edges, uint32_t *count, uint32_t *capacity, edge e)
{
    if (*count == *capacity) {
        *capacity = *capacity ? 2 * *capacity : 64;
        edge *more = realloc(*edges, *capacity * sizeof *more);
        if (!more) return pl_fail_memory(c->error, "bounding an endless recursion");
        *edges = more;
    }
    (*edges)[(*count)++] = e;
    return true;
}

/* The edges of single items, and of each member how far what isn't of the component reaches. */
static bool gather(component *c)
{
    uint32_t capacity = 0;
    for (uint32_t i = 0; i < c->count; i++) {
        const pl_state *state = &c->states->list[c->members[i]];
        c->own[i] = 0.0;
        for (uint32_t k = 0; k < state->item_count; k++) {
            const pl_item *item = &state->items[k];
            if (item->kind == PL_NODE_ENTER && c->number[item->what] != UINT32_MAX) {
                pl_affine map = item_map(item);
                if (!add_edge(c, &c->edges, &c->edge_count, &capacity, make_edge(i, c->number[item->what], &map)))
                    return false;
                continue;
            }
            pl_reach reach;
            pl_box box = pl_item_box_tight(c->states, item, &reach);
            if (pl_item_unbounded(c->states, item))
                return pl_fail_at(c->error, PL_ERROR_SCENE, c->states->program, state->symbol,
                                  "a shape without bounds stands in a recursion without end");
            c->own[i] = fmax(c->own[i], 1.7320508075688774 * pl_box_reach(&box));
        }
    }
    return true;
}

static double needed(const component *c, const edge *e)
{
    return e->shift + e->stretch * c->radius[e->to];
}

/* Radii that hold their images; false: none were found. */
static bool find_radii(component *c)
{
    memcpy(c->radius, c->own, c->count * sizeof *c->radius);
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        double grown = 0.0;
        for (uint32_t i = 0; i < c->edge_count; i++) {
            double *radius = &c->radius[c->edges[i].from], more = needed(c, &c->edges[i]);
            if (!(more < 1e300)) return false;
            if (more > *radius) {
                grown = fmax(grown, (more - *radius) / more);
                *radius = more;
            }
        }
        if (grown < WIDEN * 1e-3) break;
    }
    /* Widening by a common factor keeps what contracts; the proof says whether it was enough. */
    double most = 0.0;
    for (uint32_t i = 0; i < c->count; i++) most = fmax(most, c->radius[i]);
    for (uint32_t i = 0; i < c->count; i++) c->radius[i] += WIDEN * (c->radius[i] + 1e-3 * most);
    for (uint32_t i = 0; i < c->edge_count; i++)
        if (!(needed(c, &c->edges[i]) * (1.0 + 1e-14) <= c->radius[c->edges[i].from])) return false;
    return true;
}

/* Edges of twice as many steps; what leaves the component on the way is added to what members hold. */
static bool double_steps(component *c, bool *too_many)
{
    edge *edges = NULL;
    uint32_t count = 0, capacity = 0;
    double *own = malloc(c->count * sizeof *own);
    bool ok = own || pl_fail_memory(c->error, "bounding an endless recursion");
    *too_many = false;
    if (ok) memcpy(own, c->own, c->count * sizeof *own);
    for (uint32_t i = 0; ok && i < c->edge_count; i++) {
        const edge *first = &c->edges[i];
        own[first->from] = fmax(own[first->from], (first->shift + first->stretch * c->own[first->to]) * (1.0 + 1e-14));
        for (uint32_t k = 0; ok && k < c->edge_count; k++) {
            if (c->edges[k].from != first->to) continue;
            pl_affine map = pl_affine_multiply(&first->map, &c->edges[k].map);
            ok = add_edge(c, &edges, &count, &capacity, make_edge(first->from, c->edges[k].to, &map));
            if (count > MOST_EDGES) *too_many = true;
        }
        if (*too_many) break;
    }
    free(c->edges);
    c->edges = edges;
    c->edge_count = count;
    if (ok) memcpy(c->own, own, c->count * sizeof *own);
    free(own);
    return ok;
}

/* --- supports --- */

/* A way into the component from a member: u in the frame at its end, and how far it has come along u. */
typedef struct way {
    double u[3], offset, bound;
    uint32_t member;
    bool done;
} way;

typedef struct search {
    way ways[MOST_WAYS];
    uint32_t count;
    double least; /* the best of what was reached for certain */
} search;

static double length(const double u[3])
{
    return sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
}

static double box_support(const pl_box *box, const double u[3])
{
    double sum = 0.0;
    if (pl_box_is_empty(box)) return -INFINITY;
    for (int axis = 0; axis < 3; axis++)
        sum += fmax(u[axis] * box->lo[axis], u[axis] * box->hi[axis]);
    return sum;
}

static double leaf_support(const pl_states *states, const pl_item *item, const double u[3])
{
    if (item->kind == PL_NODE_MESH) return box_support(pl_mesh_box(states->meshes[item->what]), u);
    if (item->kind == PL_NODE_ENTER) return box_support(&states->list[item->what].bounds->box, u);
    return pl_shape_of(item->what)->support(item->arguments, u);
}

/* Adds a way, or improves the one that is the same but for what it has come; false: no room. */
static bool add_way(search *s, const way *w)
{
    for (uint32_t i = 0; i < s->count; i++) {
        way *other = &s->ways[i];
        if (other->member != w->member || memcmp(other->u, w->u, sizeof w->u) != 0) continue;
        if (other->offset < w->offset) *other = *w;
        return true;
    }
    if (s->count == MOST_WAYS) return false;
    s->ways[s->count++] = *w;
    return true;
}

static bool extend(const component *c, search *s, way from)
{
    const pl_state *state = &c->states->list[c->members[from.member]];
    for (uint32_t k = 0; k < state->item_count; k++) {
        const pl_item *item = &state->items[k];
        way w = from;
        w.done = false;
        for (uint32_t i = 0; i < item->transform_count; i++) {
            const double *m = item->transforms[i]->to_parent.m;
            w.offset += w.u[0] * m[3] + w.u[1] * m[7] + w.u[2] * m[11];
            pl_affine_normal(&item->transforms[i]->to_parent, w.u, w.u);
        }
        if (item->kind == PL_NODE_ENTER && c->number[item->what] != UINT32_MAX) {
            w.member = c->number[item->what];
            w.bound = w.offset + length(w.u) * c->radius[w.member];
            if (!add_way(s, &w)) return false;
        } else {
            s->least = fmax(s->least, w.offset + leaf_support(c->states, item, w.u));
        }
    }
    return true;
}

/* An upper bound of u·p over member's points. */
static double support(const component *c, search *s, uint32_t member, const double u[3])
{
    double tolerance = TIGHT * c->radius[member];
    way first = {{u[0], u[1], u[2]}, 0.0, length(u) * c->radius[member], member, false};
    s->count = 0;
    s->least = -INFINITY;
    add_way(s, &first);
    for (;;) {
        way *best = NULL;
        for (uint32_t i = 0; i < s->count; i++)
            if (!s->ways[i].done && (!best || s->ways[i].bound > best->bound)) best = &s->ways[i];
        if (!best || best->bound <= s->least) return s->least + tolerance;
        double bound = best->bound;
        if (bound - best->offset <= tolerance) return bound + tolerance;
        way from = *best;
        best->done = true;
        if (!extend(c, s, from)) return fmax(bound, s->least) + tolerance;
    }
}

static bool find_boxes(component *c)
{
    search *s = malloc(sizeof *s);
    if (!s) return pl_fail_memory(c->error, "bounding an endless recursion");
    for (uint32_t i = 0; i < c->count; i++) {
        pl_state *state = &c->states->list[c->members[i]];
        for (int axis = 0; axis < 3; axis++) {
            double u[3] = {0.0, 0.0, 0.0};
            u[axis] = 1.0;
            state->bounds->box.hi[axis] = support(c, s, i, u);
            u[axis] = -1.0;
            state->bounds->box.lo[axis] = -support(c, s, i, u);
        }
        double size = 1.7320508075688774 * pl_box_reach(&state->bounds->box);
        state->bounds->gate = (pl_reach){GATE, GATE * (size + 1.0), size};
    }
    free(s);
    return true;
}

int pl_bound_component(pl_states *states, const uint32_t *members, uint32_t count, pl_error *error)
{
    component c = {.states = states, .members = members, .count = count, .error = error};
    c.number = malloc(states->count * sizeof *c.number);
    c.own = malloc(count * sizeof *c.own);
    c.radius = malloc(count * sizeof *c.radius);
    bool ok = (c.number && c.own && c.radius) || pl_fail_memory(error, "bounding an endless recursion");
    for (uint32_t i = 0; ok && i < states->count; i++) c.number[i] = UINT32_MAX;
    for (uint32_t i = 0; ok && i < count; i++) c.number[members[i]] = i;
    ok = ok && gather(&c);
    bool found = ok && find_radii(&c), too_many = false;
    for (int i = 0; ok && !found && !too_many && i < DOUBLINGS; i++) {
        ok = double_steps(&c, &too_many);
        found = ok && !too_many && find_radii(&c);
    }
    if (ok && found) ok = find_boxes(&c);
    free(c.number);
    free(c.own);
    free(c.radius);
    free(c.edges);
    return !ok ? -1 : found;
}
