/* extent.c - the boxes of graph nodes, tight, from the geometry through whole chains of transformations (state.h).
 *
 * The paper (section 3) carries points of each primitive's convex hull along every cyclic path and takes the least and
 * greatest coordinates. The points that matter are those of the support function, which every shape has exactly, and
 * most paths can't lead to the greatest coordinate at all: so paths are searched best first. A subtree waits in a heap
 * with an upper bound, the reach of its state's box; the highest bound is opened into the state's items; when a
 * primitive comes up, its support is the answer and no box of a box was used. Along one axis the chain of
 * transformations is one row of four numbers, not a matrix.
 *
 * A subtree's box is computed once: its state's box prunes all instances, and a node's box found so far is the floor
 * under which an instance can't widen it. When the budget is used up, the bound at hand is taken, which contains the
 * geometry but may be loose: states whose box comes from elsewhere (the Collage theorem) end that way. */
#include <string.h>

#include "state.h"

enum { HEAP = 256, OPENED = 2048, HULL_VERTICES = 4096 };

/* p -> row[0..2] · p + row[3] is the coordinate looked for, of a point p of what waits. */
typedef struct row {
    double w[4];
} row;

typedef struct waiting {
    double bound;
    row at;
    uint32_t state;
    bool exact; /* the bound is a primitive's own support */
} waiting;

typedef struct search {
    const pl_states *states;
    double floor;
    waiting heap[HEAP];
    int count;
    uint32_t opened;
} search;

static row through(const row *outer, const pl_affine *map)
{
    row inner;
    const double *w = outer->w, *m = map->m;
    for (int c = 0; c < 4; c++) inner.w[c] = w[0] * m[c] + w[1] * m[4 + c] + w[2] * m[8 + c];
    inner.w[3] += w[3];
    return inner;
}

static double support_of_box(const row *at, const pl_box *box)
{
    if (pl_box_is_empty(box)) return -INFINITY;
    double sum = at->w[3];
    for (int axis = 0; axis < 3; axis++) sum += fmax(at->w[axis] * box->lo[axis], at->w[axis] * box->hi[axis]);
    return sum;
}

static double support_of_mesh(const search *s, const row *at, uint32_t index)
{
    const pl_mesh *mesh = &s->states->program->meshes[index];
    double most = -INFINITY;
    if (mesh->vertex_count > HULL_VERTICES) return support_of_box(at, pl_mesh_box(s->states->meshes[index]));
    for (uint32_t i = 0; i < mesh->triangle_count * 3; i++) {
        const double *p = mesh->vertices + 3 * (size_t)mesh->triangles[i];
        most = fmax(most, at->w[0] * p[0] + at->w[1] * p[1] + at->w[2] * p[2] + at->w[3]);
    }
    return most;
}

/* Puts something into the heap unless it can't rise above the floor; false: there is no room. */
static bool wait_for(search *s, waiting entry)
{
    if (entry.bound <= s->floor) return true;
    if (s->count == HEAP) return false;
    int place = s->count++;
    for (; place > 0 && s->heap[(place - 1) / 2].bound < entry.bound; place = (place - 1) / 2)
        s->heap[place] = s->heap[(place - 1) / 2];
    s->heap[place] = entry;
    return true;
}

static waiting take_highest(search *s)
{
    waiting top = s->heap[0], last = s->heap[--s->count];
    int place = 0;
    for (int child; (child = 2 * place + 1) < s->count; place = child) {
        if (child + 1 < s->count && s->heap[child + 1].bound > s->heap[child].bound) child++;
        if (s->heap[child].bound <= last.bound) break;
        s->heap[place] = s->heap[child];
    }
    s->heap[place] = last;
    return top;
}

/* Lets an item wait, seen from a frame above it; no bound is higher than that of what it was opened from. */
static bool wait_for_item(search *s, const pl_item *item, const row *outer, double most)
{
    row at = *outer;
    for (uint32_t i = 0; i < item->transform_count; i++) at = through(&at, &item->transforms[i]->to_parent);
    waiting entry = {.at = at, .exact = true};
    if (item->kind == PL_NODE_ENTER) {
        entry.state = item->what;
        entry.exact = false;
        entry.bound = support_of_box(&at, &s->states->list[item->what].bounds->box);
    } else if (item->kind == PL_NODE_MESH) {
        entry.bound = support_of_mesh(s, &at, item->what);
    } else {
        const pl_shape *shape = pl_shape_of(item->what);
        if (!shape->support) return true;
        entry.bound = shape->support(item->arguments, at.w) + at.w[3];
    }
    /* A composed map may overflow where the normative chain of mapped rays doesn't: no bounds are known then. */
    if (isnan(entry.bound)) entry.bound = INFINITY;
    if (!entry.exact) entry.bound = fmin(entry.bound, most);
    return wait_for(s, entry);
}

/* The greatest coordinate of what waits in the search, or the floor if nothing rises above it. */
static double greatest(search *s)
{
    while (s->count) {
        waiting top = take_highest(s);
        if (top.exact || isinf(top.bound)) return top.bound;
        const pl_state *state = &s->states->list[top.state];
        s->opened += state->item_count;
        if (s->opened > OPENED) return top.bound;
        for (uint32_t i = 0; i < state->item_count; i++)
            if (!wait_for_item(s, &state->items[i], &top.at, top.bound)) return top.bound;
    }
    return s->floor;
}

/* Widens a box by an item (NULL: the state itself) seen through a map. */
static void join(const pl_states *states, const pl_item *item, uint32_t state, const pl_affine *map, pl_box *box)
{
    search s = {.states = states};
    for (int side = 0; side < 6; side++) {
        int axis = side / 2;
        double sign = side % 2 ? -1.0 : 1.0;
        row outer;
        for (int c = 0; c < 4; c++) outer.w[c] = sign * map->m[4 * axis + c];
        s.floor = sign > 0.0 ? box->hi[axis] : -box->lo[axis];
        s.count = 0;
        s.opened = 0;
        if (item) wait_for_item(&s, item, &outer, INFINITY);
        else wait_for(&s, (waiting){support_of_box(&outer, &states->list[state].bounds->box), outer, state, false});
        double most = greatest(&s);
        if (sign > 0.0) box->hi[axis] = most;
        else box->lo[axis] = -most;
    }
}

static bool lacks_bounds(const pl_box *box)
{
    return !pl_box_is_empty(box) && !pl_box_is_finite(box);
}

void pl_join_symbol_box(pl_states *states, uint32_t state)
{
    const pl_state *it = &states->list[state];
    pl_node_box *node = &states->node_boxes[it->symbol];
    pl_affine identity = pl_affine_identity();
    join(states, NULL, state, &identity, &node->box);
    pl_reach_join(&node->reach, &it->bounds->reach);
    node->unbounded = node->unbounded || it->unbounded || lacks_bounds(&node->box);
}

void pl_join_node_boxes(pl_states *states, const pl_item *item, const pl_trail_node *trail, uint32_t count)
{
    pl_reach reach = pl_item_reach(states, item);
    pl_affine map = pl_affine_identity();
    uint32_t level = item->transform_count;
    bool unbounded = pl_item_unbounded(states, item);
    for (uint32_t i = count; i-- > 0;) {
        while (level > trail[i].transforms) {
            const pl_transform *transform = item->transforms[--level];
            map = pl_affine_multiply(&transform->to_parent, &map);
            reach = pl_reach_through(transform, &reach);
        }
        /* From the node's frame down to the item's: what `map` holds, with the item's own transformations taken off. */
        pl_item below = *item;
        below.transform_count = 0;
        pl_node_box *node = &states->node_boxes[trail[i].node];
        join(states, &below, 0, &map, &node->box);
        pl_reach_join(&node->reach, &reach);
        node->unbounded = node->unbounded || unbounded || lacks_bounds(&node->box);
    }
}
