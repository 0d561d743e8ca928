/* gated_build.c - builds the trees of gated.h: binned surface area heuristic, top down, collapsed to 4 children a node. */
#include "gated.h"

#include <stdlib.h>
#include <string.h>

#include "../error.h"

enum { BINS = 16, DEEP = 48 };

typedef struct entry {
    pl_box box;
    int32_t item;
} entry;

typedef struct building {
    entry *entries;
    pl_gated_node *nodes;
    uint32_t node_count;
} building;

typedef struct group {
    uint32_t first, count;
    double area;
} group;

static double centre(const entry *e, int axis)
{
    return e->box.lo[axis] + e->box.hi[axis];
}

static group group_of(const building *b, uint32_t first, uint32_t count)
{
    pl_box box = pl_box_empty();
    for (uint32_t i = 0; i < count; i++) pl_box_join(&box, &b->entries[first + i].box);
    return (group){first, count, pl_box_area(&box)};
}

static int bin_of(double at, double lo, double scale)
{
    int bin = (int)((at - lo) * scale);
    return bin < 0 ? 0 : bin >= BINS ? BINS - 1 : bin;
}

/* The cheapest of the BINS - 1 planes of an axis: how many bins stand left of it; *cost is INFINITY if none divides. */
static int best_plane(const building *b, const group *g, int axis, double lo, double scale, double *cost)
{
    pl_box boxes[BINS], left = pl_box_empty(), right = pl_box_empty();
    uint32_t counts[BINS] = {0}, before = 0;
    double right_area[BINS];
    int best = 0;
    for (int i = 0; i < BINS; i++) boxes[i] = pl_box_empty();
    for (uint32_t i = 0; i < g->count; i++) {
        const entry *e = &b->entries[g->first + i];
        int bin = bin_of(centre(e, axis), lo, scale);
        counts[bin]++;
        pl_box_join(&boxes[bin], &e->box);
    }
    for (int i = BINS - 1; i > 0; i--) {
        pl_box_join(&right, &boxes[i]);
        right_area[i] = pl_box_area(&right);
    }
    *cost = INFINITY;
    for (int i = 1; i < BINS; i++) {
        pl_box_join(&left, &boxes[i - 1]);
        before += counts[i - 1];
        double here = pl_box_area(&left) * before + right_area[i] * (g->count - before);
        if (before > 0 && before < g->count && here < *cost) {
            *cost = here;
            best = i;
        }
    }
    return best;
}

/* Reorders a group's entries and returns how many stand in its left part: the cheapest plane, or half of them where
 * no plane divides or the tree has become deep. */
static uint32_t divide(building *b, const group *g, int level)
{
    double lo[3], hi[3], best_cost = INFINITY;
    int best_axis = 0, best = 0;
    for (int axis = 0; axis < 3; axis++) {
        lo[axis] = INFINITY, hi[axis] = -INFINITY;
        for (uint32_t i = 0; i < g->count; i++) {
            double at = centre(&b->entries[g->first + i], axis);
            if (at < lo[axis]) lo[axis] = at;
            if (at > hi[axis]) hi[axis] = at;
        }
        double cost, width = hi[axis] - lo[axis], scale = BINS / width;
        if (!isfinite(scale) || !isfinite(width)) continue;
        int plane = best_plane(b, g, axis, lo[axis], scale, &cost);
        if (cost < best_cost) {
            best_cost = cost;
            best_axis = axis;
            best = plane;
        }
    }
    if (level > DEEP || best_cost == INFINITY) return g->count / 2;
    double scale = BINS / (hi[best_axis] - lo[best_axis]);
    uint32_t left = 0;
    for (uint32_t i = 0; i < g->count; i++) {
        entry *e = &b->entries[g->first + i], *place = &b->entries[g->first + left], swap = *e;
        if (bin_of(centre(e, best_axis), lo[best_axis], scale) >= best) continue;
        *e = *place;
        *place = swap;
        left++;
    }
    return left;
}

/* Recursion is bounded: after DEEP levels groups are halved. */
static int32_t build_group(building *b, uint32_t first, uint32_t count, int level)
{
    if (count == 1) return ~b->entries[first].item;
    group groups[PL_GATED_WIDTH] = {group_of(b, first, count)};
    int number = 1;
    while (number < PL_GATED_WIDTH) {
        int widest = -1;
        for (int i = 0; i < number; i++)
            if (groups[i].count > 1 && (widest < 0 || groups[i].area > groups[widest].area)) widest = i;
        if (widest < 0) break;
        group whole = groups[widest];
        uint32_t left = divide(b, &whole, level);
        groups[widest] = group_of(b, whole.first, left);
        groups[number++] = group_of(b, whole.first + left, whole.count - left);
    }
    uint32_t index = b->node_count++;
    pl_gated_node node;
    for (int i = 0; i < PL_GATED_WIDTH; i++) {
        pl_box box = pl_box_empty();
        node.child[i] = PL_GATED_NOTHING;
        for (uint32_t k = 0; i < number && k < groups[i].count; k++)
            pl_box_join(&box, &b->entries[groups[i].first + k].box);
        for (int axis = 0; axis < 3; axis++) {
            node.planes[0][axis][i] = box.lo[axis];
            node.planes[1][axis][i] = box.hi[axis];
        }
        if (i < number) node.child[i] = build_group(b, groups[i].first, groups[i].count, level + 2);
    }
    b->nodes[index] = node;
    return (int32_t)index;
}

static bool build_tree(pl_scene *scene, const pl_state *state, building *b, pl_gated_tree *tree, pl_error *error)
{
    pl_states *states = &scene->states;
    int32_t *unbounded = NULL;
    uint32_t bounded = 0;
    tree->root = PL_GATED_NOTHING;
    tree->unbounded_count = 0;
    if (state->unbounded) {
        unbounded = pl_states_allocate(states, state->item_count * sizeof *unbounded, error);
        if (!unbounded) return false;
    }
    for (uint32_t i = 0; i < state->item_count; i++) {
        pl_reach reach;
        if (pl_item_primitives(states, &state->items[i]) == 0) continue;
        pl_box box = pl_item_box(states, &state->items[i], &reach);
        if (pl_item_unbounded(states, &state->items[i]) || !(pl_box_is_empty(&box) || pl_box_is_finite(&box)))
            unbounded[tree->unbounded_count++] = (int32_t)i;
        else if (!pl_box_is_empty(&box))
            b->entries[bounded++] = (entry){box, (int32_t)i};
    }
    tree->unbounded = unbounded;
    b->node_count = 0;
    if (bounded) tree->root = build_group(b, 0, bounded, 0);
    tree->node_count = b->node_count;
    pl_gated_node *nodes = pl_states_allocate(states, (b->node_count + 1) * sizeof *nodes, error);
    if (!nodes) return false;
    memcpy(nodes, b->nodes, b->node_count * sizeof *nodes);
    tree->nodes = nodes;
    return true;
}

bool pl_gated_build(pl_scene *scene, pl_error *error)
{
    pl_states *states = &scene->states;
    uint32_t most = 1;
    for (uint32_t i = 0; i < states->count; i++)
        if (states->list[i].item_count > most) most = states->list[i].item_count;
    building b = {malloc(most * sizeof(entry)), malloc(most * sizeof(pl_gated_node)), 0};
    pl_gated_tree *trees = pl_states_allocate(states, states->count * sizeof *trees, error);
    scene->structure = trees;
    bool ok = trees != NULL;
    if (ok && (!b.entries || !b.nodes)) ok = pl_fail_memory(error, "building the boxes");
    for (uint32_t i = 0; ok && i < states->count; i++) ok = build_tree(scene, &states->list[i], &b, &trees[i], error);
    free(b.entries);
    free(b.nodes);
    return ok;
}

/* The trees stand in the states' memory. */
void pl_gated_destroy(pl_scene *scene)
{
    scene->structure = NULL;
}
