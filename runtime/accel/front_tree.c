/* front_tree.c - a wide tree over a front's boxes: binned surface area heuristic, top down, eight children a node.
 *
 * Wald, "On fast construction of SAH-based bounding volume hierarchies" (2007). Groups are divided in two, the one with
 * the largest area first, until there are eight. Large groups are binned along the axis on which their centres spread
 * most, small ones along all three. */
#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "front.h"

enum { BINS = 16, DEEP = 64, ALL_AXES = 2048, PARALLEL = 1 << 15, MOST_THREADS = 64 };

typedef struct bounds {
    float lo[3], hi[3];
} bounds;

typedef struct group {
    pl_boxed *boxes;
    size_t count;
    bounds box, centres; /* centres: lo + hi of the boxes */
} group;

typedef struct building {
    pl_front_node *nodes;
    uint32_t count;
} building;

static const bounds nothing = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};

static inline void join(bounds *b, const float lo[3], const float hi[3])
{
    for (int axis = 0; axis < 3; axis++) {
        b->lo[axis] = lo[axis] < b->lo[axis] ? lo[axis] : b->lo[axis];
        b->hi[axis] = hi[axis] > b->hi[axis] ? hi[axis] : b->hi[axis];
    }
}

static inline float area(const bounds *b)
{
    float x = b->hi[0] - b->lo[0], y = b->hi[1] - b->lo[1], z = b->hi[2] - b->lo[2];
    return x >= 0.0f ? x * y + y * z + z * x : 0.0f;
}

static group group_of(pl_boxed *boxes, size_t count)
{
    group g = {boxes, count, nothing, nothing};
    for (size_t i = 0; i < count; i++) {
        float centre[3];
        for (int axis = 0; axis < 3; axis++) centre[axis] = boxes[i].lo[axis] + boxes[i].hi[axis];
        join(&g.box, boxes[i].lo, boxes[i].hi);
        join(&g.centres, centre, centre);
    }
    return g;
}

static inline int bin_of(const pl_boxed *box, int axis, float lo, float scale)
{
    int bin = (int)((box->lo[axis] + box->hi[axis] - lo) * scale);
    return bin < 0 ? 0 : bin >= BINS ? BINS - 1 : bin;
}

typedef struct plane {
    int axis, bin; /* bins below `bin` go left */
    float cost, lo, scale;
} plane;

static void try_axis(const group *g, int axis, plane *best)
{
    bounds boxes[BINS], left = nothing, right = nothing;
    size_t counts[BINS] = {0}, before = 0;
    float right_area[BINS];
    float lo = g->centres.lo[axis], scale = BINS / (g->centres.hi[axis] - lo);
    if (!(scale < INFINITY)) return;
    for (int i = 0; i < BINS; i++) boxes[i] = nothing;
    for (size_t i = 0; i < g->count; i++) {
        int bin = bin_of(&g->boxes[i], axis, lo, scale);
        counts[bin]++;
        join(&boxes[bin], g->boxes[i].lo, g->boxes[i].hi);
    }
    for (int i = BINS - 1; i > 0; i--) {
        join(&right, boxes[i].lo, boxes[i].hi);
        right_area[i] = area(&right);
    }
    for (int i = 1; i < BINS; i++) {
        join(&left, boxes[i - 1].lo, boxes[i - 1].hi);
        before += counts[i - 1];
        float cost = area(&left) * (float)before + right_area[i] * (float)(g->count - before);
        if (before > 0 && before < g->count && cost < best->cost) *best = (plane){axis, i, cost, lo, scale};
    }
}

static int widest(const bounds *b)
{
    float x = b->hi[0] - b->lo[0], y = b->hi[1] - b->lo[1], z = b->hi[2] - b->lo[2];
    return x >= y && x >= z ? 0 : y >= z ? 1 : 2;
}

/* Reorders a group and returns how many stand in its left part: the cheapest plane, or half of them where no plane divides
 * or the tree has become deep. */
static size_t divide(const group *g, int level)
{
    plane best = {.cost = INFINITY};
    if (level > DEEP) return g->count / 2;
    if (g->count > ALL_AXES) try_axis(g, widest(&g->centres), &best);
    else
        for (int axis = 0; axis < 3; axis++) try_axis(g, axis, &best);
    if (best.cost == INFINITY) return g->count / 2;
    size_t left = 0, right = g->count;
    for (;;) {
        while (left < right && bin_of(&g->boxes[left], best.axis, best.lo, best.scale) < best.bin) left++;
        while (left < right && bin_of(&g->boxes[right - 1], best.axis, best.lo, best.scale) >= best.bin) right--;
        if (left >= right) return left;
        pl_boxed swap = g->boxes[left];
        g->boxes[left++] = g->boxes[--right];
        g->boxes[right] = swap;
    }
}

/* The group with the largest area whose count is in [least, most]; -1: none. */
static int largest_of(const group groups[], int number, size_t least, size_t most)
{
    int largest = -1;
    for (int i = 0; i < number; i++)
        if (groups[i].count >= least && groups[i].count <= most &&
            (largest < 0 || area(&groups[i].box) > area(&groups[largest].box)))
            largest = i;
    return largest;
}

/* Divides a group into at most eight; returns their number. Nodes should be full: what fits into one node is divided
 * only when nothing larger is left, and then, where there is room, into single boxes. */
static int split(const group *whole, group groups[PL_FRONT_WIDTH], int level)
{
    int number = 1;
    groups[0] = *whole;
    while (number < PL_FRONT_WIDTH) {
        int largest = largest_of(groups, number, PL_FRONT_WIDTH + 1, SIZE_MAX);
        if (largest < 0) largest = largest_of(groups, number, 2, (size_t)(PL_FRONT_WIDTH - number + 1));
        if (largest < 0) break;
        group g = groups[largest];
        size_t left = divide(&g, level);
        groups[largest] = group_of(g.boxes, left);
        groups[number++] = group_of(g.boxes + left, g.count - left);
    }
    return number;
}

static void set_boxes(pl_front_node *node, const group groups[], int number)
{
    for (int i = 0; i < PL_FRONT_WIDTH; i++) {
        const bounds *box = i < number ? &groups[i].box : &nothing;
        for (int axis = 0; axis < 3; axis++) {
            node->planes[axis][i] = box->lo[axis];
            node->planes[3 + axis][i] = box->hi[axis];
        }
        node->child[i] = PL_NOTHING;
    }
}

/* Recursion is bounded: after DEEP levels groups are halved. */
static pl_ref build(building *b, const group *g, int level)
{
    if (g->count == 1) return g->boxes[0].ref;
    group groups[PL_FRONT_WIDTH];
    int number = split(g, groups, level);
    uint32_t index = b->count++;
    set_boxes(&b->nodes[index], groups, number);
    for (int i = 0; i < number; i++) {
        pl_ref child = build(b, &groups[i], level + 3);
        b->nodes[index].child[i] = child;
    }
    return pl_ref_of(PL_KIND_NODE, index);
}

/* --- large trees: the root's children in parallel --- */

typedef struct task {
    group *groups;
    building *buildings;
    pl_ref *roots;
    int number;
    atomic_int next;
} task;

static void *work(void *context)
{
    task *t = context;
    for (int i; (i = atomic_fetch_add(&t->next, 1)) < t->number;)
        if (t->buildings[i].nodes) t->roots[i] = build(&t->buildings[i], &t->groups[i], 3);
    return NULL;
}

static uint32_t append(pl_front_node *nodes, uint32_t count, const building *b, pl_ref *root)
{
    for (uint32_t i = 0; i < b->count; i++) {
        nodes[count + i] = b->nodes[i];
        for (int c = 0; c < PL_FRONT_WIDTH; c++)
            if (nodes[count + i].child[c] >> PL_REF_SHIFT == PL_KIND_NODE) nodes[count + i].child[c] += count;
    }
    if (*root >> PL_REF_SHIFT == PL_KIND_NODE) *root += count;
    return count + b->count;
}

static uint32_t build_parallel(const group *whole, pl_front_node *nodes, int threads)
{
    group groups[PL_FRONT_WIDTH];
    building buildings[PL_FRONT_WIDTH] = {0};
    pl_ref roots[PL_FRONT_WIDTH];
    pthread_t started[MOST_THREADS];
    task t = {.groups = groups, .buildings = buildings, .roots = roots, .number = split(whole, groups, 0)};
    int others = 0;
    for (int i = 0; i < t.number; i++)
        buildings[i].nodes = aligned_alloc(64, (groups[i].count * sizeof *nodes + 63) & ~(size_t)63);
    if (threads > PL_FRONT_WIDTH) threads = PL_FRONT_WIDTH;
    while (others < threads - 1 && pthread_create(&started[others], NULL, work, &t) == 0) others++;
    work(&t);
    for (int i = 0; i < others; i++) pthread_join(started[i], NULL);
    set_boxes(&nodes[0], groups, t.number);
    uint32_t count = 1;
    for (int i = 0; i < t.number; i++) {
        if (buildings[i].nodes) {
            count = append(nodes, count, &buildings[i], &roots[i]);
        } else { /* no memory for a part of its own: in place, after the others */
            building b = {nodes, count};
            roots[i] = build(&b, &groups[i], 3);
            count = b.count;
        }
        free(buildings[i].nodes);
        nodes[0].child[i] = roots[i];
    }
    return count;
}

size_t pl_front_most_nodes(size_t boxes)
{
    return boxes ? boxes : 1;
}

uint32_t pl_front_tree(pl_boxed *boxes, size_t count, pl_front_node *nodes, pl_ref *root, int threads)
{
    *root = PL_NOTHING;
    if (count == 0) return 0;
    group whole = group_of(boxes, count);
    building b = {nodes, 0};
    if (count < PARALLEL || threads < 2) {
        *root = build(&b, &whole, 0);
        return b.count;
    }
    *root = pl_ref_of(PL_KIND_NODE, 0);
    return build_parallel(&whole, nodes, threads);
}
