/* front_tree.c - a wide tree over a front's boxes, top down by the surface area heuristic.
 *
 * Groups of boxes are divided in two by binned areas (Wald, "On fast construction of SAH-based bounding volume hierarchies",
 * 2007). A large group becomes a node of eight by dividing the largest of its parts again and again. A group of at most
 * BLOCK boxes is divided down to single ones, and this binary tree is collapsed into the best wide one (front_collapse.c). If
 * it is to be improved (front_improve.c), a front of at most PART boxes is one such block.
 *
 * Groups of many boxes are parts that any thread takes; nodes are numbered when all are done, so threads don't show. */
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>

#include "front_binary.h"

enum { BINS = 16, DEEP = 64, ALL_AXES = 4096, BLOCK = 512, FEW = 8, PART = 1 << 13, TOPS = 1024, MOST_THREADS = 64 };

/* What a node's memory costs, in average areas of the boxes that it is built over: fuller nodes, at most 2 % more visits. */
#define MEMORY_PRICE 7.0f

typedef struct group {
    pl_boxed *boxes;
    size_t count;
    bounds box, centres; /* centres: lo + hi of the boxes */
} group;

static inline void add(group *g, bounds box)
{
    const four centre = box.lo + box.hi;
    join(&g->box, box);
    join(&g->centres, (bounds){centre, centre});
}

static group group_of(pl_boxed *boxes, size_t count)
{
    group g = {boxes, count, NOTHING, NOTHING};
    for (size_t i = 0; i < count; i++) add(&g, bounds_of(&boxes[i]));
    return g;
}

/* --- dividing a group --- */

typedef struct plane {
    int axis, bin; /* bins below `bin` go left */
    float cost;
} plane;

typedef struct binning {
    four lo, scale; /* bin: (centre - lo) * scale */
} binning;

static inline four_ints bins_of(const binning *b, bounds box)
{
    const four at = (box.lo + box.hi - b->lo) * b->scale;
    return __builtin_convertvector(least(most(at, (four){0}), (four){BINS - 1, BINS - 1, BINS - 1, BINS - 1}), four_ints);
}

static void sweep(const bounds boxes[BINS], const uint32_t counts[BINS], size_t count, int axis, plane *best)
{
    float right_area[BINS];
    bounds left = NOTHING, right = NOTHING;
    size_t before = 0;
    for (int i = BINS - 1; i > 0; i--) {
        join(&right, boxes[i]);
        right_area[i] = area(&right);
    }
    for (int i = 1; i < BINS; i++) {
        join(&left, boxes[i - 1]);
        before += counts[i - 1];
        const float cost = area(&left) * (float)before + right_area[i] * (float)(count - before);
        if (before > 0 && before < count && cost < best->cost) *best = (plane){axis, i, cost};
    }
}

static int widest(const bounds *b)
{
    four size = b->hi - b->lo;
    return size[0] >= size[1] && size[0] >= size[2] ? 0 : size[1] >= size[2] ? 1 : 2;
}

/* The cheapest plane; cost INFINITY: none divides. */
static plane find_plane(const group *g, const binning *b)
{
    const int only = g->count > ALL_AXES ? widest(&g->centres) : -1;
    bounds boxes[3][BINS];
    uint32_t counts[3][BINS] = {{0}};
    plane best = {.cost = INFINITY};
    for (int axis = 0; axis < 3; axis++)
        for (int i = 0; i < BINS; i++) boxes[axis][i] = NOTHING;
    for (size_t i = 0; i < g->count; i++) {
        const bounds box = bounds_of(&g->boxes[i]);
        const four_ints bins = bins_of(b, box);
        if (only >= 0) {
            counts[only][bins[only]]++;
            join(&boxes[only][bins[only]], box);
            continue;
        }
#pragma GCC unroll 3
        for (int axis = 0; axis < 3; axis++) {
            counts[axis][bins[axis]]++;
            join(&boxes[axis][bins[axis]], box);
        }
    }
    for (int axis = 0; axis < 3; axis++)
        if (only < 0 || axis == only) sweep(boxes[axis], counts[axis], g->count, axis, &best);
    return best;
}

static void halve(const group *g, group *left, group *right)
{
    const size_t half = g->count / 2;
    *left = group_of(g->boxes, half);
    *right = group_of(g->boxes + half, g->count - half);
}

/* A few boxes: sorted by their centres along the axis on which these spread most, and divided where it costs least. */
static void divide_few(const group *g, group *left, group *right)
{
    const int axis = widest(&g->centres);
    float right_area[FEW + 1], cost = INFINITY;
    pl_boxed *boxes = g->boxes;
    bounds side = NOTHING;
    size_t best = 1;
    for (size_t i = 1; i < g->count; i++) {
        const pl_boxed moved = boxes[i];
        const float centre = moved.lo[axis] + moved.hi[axis];
        size_t place = i;
        for (; place > 0 && boxes[place - 1].lo[axis] + boxes[place - 1].hi[axis] > centre; place--)
            boxes[place] = boxes[place - 1];
        boxes[place] = moved;
    }
    for (size_t i = g->count - 1; i > 0; i--) {
        join(&side, bounds_of(&boxes[i]));
        right_area[i] = area(&side);
    }
    side = NOTHING;
    for (size_t i = 1; i < g->count; i++) {
        join(&side, bounds_of(&boxes[i - 1]));
        const float here = area(&side) * (float)i + right_area[i] * (float)(g->count - i);
        if (here < cost) {
            cost = here;
            best = i;
        }
    }
    *left = group_of(boxes, best);
    *right = group_of(boxes + best, g->count - best);
}

/* Reorders a group and gives its two parts: by the cheapest plane, or halves where none divides or the tree has become deep. */
static void divide(const group *g, int level, group *left, group *right)
{
    if (level > DEEP) {
        halve(g, left, right);
        return;
    }
    if (g->count <= FEW) {
        divide_few(g, left, right);
        return;
    }
    const four size = g->centres.hi - g->centres.lo;
    binning b = {g->centres.lo, {0}};
    for (int axis = 0; axis < 3; axis++) {
        const float scale = BINS / size[axis];
        b.scale[axis] = scale < INFINITY ? scale : 0.0f;
    }
    const plane at = find_plane(g, &b);
    if (at.cost == INFINITY) {
        halve(g, left, right);
        return;
    }
    size_t l = 0, r = g->count;
    *left = (group){g->boxes, 0, NOTHING, NOTHING};
    *right = *left;
    while (l < r) {
        const bounds box = bounds_of(&g->boxes[l]);
        if (bins_of(&b, box)[at.axis] < at.bin) {
            add(left, box);
            l++;
            continue;
        }
        add(right, box);
        const pl_boxed swap = g->boxes[l];
        g->boxes[l] = g->boxes[--r];
        g->boxes[r] = swap;
    }
    left->count = l;
    right->boxes = g->boxes + l;
    right->count = g->count - l;
}

/* --- small groups: a binary tree, collapsed --- */

_Static_assert(2 * sizeof(pl_binary) == PL_FRONT_IMPROVING_BYTES, "as front.h says");

typedef struct building {
    pl_front_node *nodes;
    uint32_t count;
    pl_binary *binary; /* 2 * BLOCK, or for the whole front */
    uint32_t binary_count;
} building;

static uint32_t make_binary(building *b, const group *g, uint32_t parent, int level)
{
    const uint32_t index = b->binary_count++;
    pl_binary *t = &b->binary[index];
    t->box = g->box;
    t->area = area(&g->box);
    t->parent = parent;
    t->ref = g->count == 1 ? g->boxes[0].ref : PL_NOTHING;
    if (g->count == 1) return index;
    group left, right;
    divide(g, level, &left, &right);
    t->left = make_binary(b, &left, index, level + 1);
    t->right = make_binary(b, &right, index, level + 1);
    return index;
}

static pl_ref build_block(building *b, const group *g, int level, bool improve)
{
    const float price = MEMORY_PRICE * area(&g->box) / (float)g->count;
    b->binary_count = 0;
    make_binary(b, g, 0, level);
    if (improve) pl_binary_improve(b->binary, b->binary_count);
    return pl_binary_collapse(b->binary, price, b->nodes, &b->count);
}

/* --- large groups --- */

/* The group with the largest area of those that don't fit into one node; -1: none. */
static int largest_of(const group groups[], int number)
{
    int largest = -1;
    for (int i = 0; i < number; i++)
        if (groups[i].count > PL_FRONT_WIDTH && (largest < 0 || area(&groups[i].box) > area(&groups[largest].box)))
            largest = i;
    return largest;
}

/* Divides a group of more than BLOCK boxes into at most eight, in the order in which their boxes stand; returns their
 * number. */
static int split(const group *whole, group groups[PL_FRONT_WIDTH], int level)
{
    int number = 1;
    groups[0] = *whole;
    while (number < PL_FRONT_WIDTH) {
        const int largest = largest_of(groups, number);
        if (largest < 0) break;
        const group g = groups[largest];
        memmove(groups + largest + 2, groups + largest + 1, (size_t)(number - largest - 1) * sizeof *groups);
        divide(&g, level, &groups[largest], &groups[largest + 1]);
        number++;
    }
    return number;
}

static void set_boxes(pl_front_node *node, const group groups[], int number)
{
    clear_node(node);
    for (int i = 0; i < number; i++)
        for (int axis = 0; axis < 3; axis++) {
            node->planes[axis][i] = groups[i].box.lo[axis];
            node->planes[3 + axis][i] = groups[i].box.hi[axis];
        }
}

/* Recursion is bounded: after DEEP levels groups are halved. */
static pl_ref build(building *b, const group *g, int level)
{
    if (g->count == 1) return g->boxes[0].ref;
    if (g->count <= BLOCK) return build_block(b, g, level, false);
    group groups[PL_FRONT_WIDTH];
    const int number = split(g, groups, level);
    const uint32_t index = b->count++;
    set_boxes(&b->nodes[index], groups, number);
    for (int i = 0; i < number; i++) {
        const pl_ref child = build(b, &groups[i], level + 3);
        b->nodes[index].child[i] = child;
    }
    return pl_ref_of(PL_KIND_NODE, index);
}

/* --- parts for threads --- */

typedef struct part {
    group whole;
    int level;
    struct part *next;  /* to be done after this one */
    uint32_t nodes, count; /* of a part that was built: where its nodes begin, and their number */
    pl_ref root;           /* as if they began at 0 */
    pl_front_node top;     /* of one that was split */
    int number;            /* … into so many; 0: built */
    struct part *children[PL_FRONT_WIDTH];
} part;

/* A part's nodes go to where its boxes stand, TOPS further on: they are fewer than its boxes. */
typedef struct pool {
    pl_front_node *nodes;
    const pl_boxed *boxes;
    part *waiting;
    uint32_t unfinished, tops;
    bool failed;
    pthread_mutex_t lock;
    pthread_cond_t changed;
} pool;

static part *part_of(const group *g, int level)
{
    part *fresh = aligned_alloc(64, (sizeof *fresh + 63) & ~(size_t)63);
    if (fresh) *fresh = (part){.whole = *g, .level = level};
    return fresh;
}

static void free_part(part *p)
{
    for (int i = 0; p && i < p->number; i++) free_part(p->children[i]);
    free(p);
}

/* Builds a part, or splits it. false: no memory. */
static bool do_part(const pool *p, part *at, building *b)
{
    if (at->whole.count <= PART) {
        at->nodes = (uint32_t)(at->whole.boxes - p->boxes) + TOPS;
        b->nodes = p->nodes + at->nodes;
        b->count = 0;
        at->root = build(b, &at->whole, at->level);
        at->count = b->count;
        return true;
    }
    group groups[PL_FRONT_WIDTH];
    const int number = split(&at->whole, groups, at->level);
    set_boxes(&at->top, groups, number);
    for (; at->number < number; at->number++)
        if (!(at->children[at->number] = part_of(&groups[at->number], at->level + 3))) return false;
    return true;
}

static void *work(void *context)
{
    pool *p = context;
    building b = {.binary = aligned_alloc(64, 2 * BLOCK * sizeof *b.binary)};
    pthread_mutex_lock(&p->lock);
    if (!b.binary) p->failed = true;
    while (!p->failed && p->unfinished) {
        part *at = p->waiting;
        if (!at) {
            pthread_cond_wait(&p->changed, &p->lock);
            continue;
        }
        p->waiting = at->next;
        pthread_mutex_unlock(&p->lock);
        const bool ok = do_part(p, at, &b);
        pthread_mutex_lock(&p->lock);
        p->failed = p->failed || !ok;
        p->tops += at->number > 0;
        p->unfinished += (uint32_t)at->number;
        p->unfinished--;
        for (int i = 0; i < at->number; i++) {
            at->children[i]->next = p->waiting;
            p->waiting = at->children[i];
        }
        pthread_cond_broadcast(&p->changed);
    }
    pthread_cond_broadcast(&p->changed);
    pthread_mutex_unlock(&p->lock);
    free(b.binary);
    return NULL;
}

/* Numbers a part's nodes from *count on and moves them there. Parts come in the order of their boxes, so nothing is
 * overwritten that is still to be moved, as long as there are no more tops than TOPS. */
static pl_ref gather(const part *at, const pl_front_node *from, pl_front_node *to, uint32_t *count)
{
    if (at->number == 0) {
        pl_front_node *own = to + *count;
        memmove(own, from + at->nodes, at->count * sizeof *own);
        for (uint32_t i = 0; i < at->count; i++)
            for (int c = 0; c < PL_FRONT_WIDTH; c++)
                if (own[i].child[c] >> PL_REF_SHIFT == PL_KIND_NODE) own[i].child[c] += *count;
        const pl_ref root = at->root >> PL_REF_SHIFT == PL_KIND_NODE ? at->root + *count : at->root;
        *count += at->count;
        return root;
    }
    const uint32_t index = (*count)++;
    to[index] = at->top;
    for (int i = 0; i < at->number; i++) {
        const pl_ref child = gather(at->children[i], from, to, count);
        to[index].child[i] = child;
    }
    return pl_ref_of(PL_KIND_NODE, index);
}

static pl_front_node *allocate(size_t nodes)
{
    return aligned_alloc(64, (nodes * sizeof(pl_front_node) + 63) & ~(size_t)63);
}

/* Gives back what wasn't needed. */
static pl_front_node *shrink(pl_front_node *nodes, uint32_t count)
{
    pl_front_node *kept = realloc(nodes, (count * sizeof *nodes + 64) & ~(size_t)63);
    if (!kept || (uintptr_t)kept % _Alignof(pl_front_node) == 0) return kept ? kept : nodes;
    pl_front_node *aligned = allocate(count + 1);
    if (aligned) memcpy(aligned, kept, count * sizeof *kept);
    free(kept);
    return aligned;
}

static pl_front_node *build_parts(const group *whole, uint32_t *count, pl_ref *root, int threads)
{
    pthread_t started[MOST_THREADS];
    pool p = {.nodes = allocate(whole->count + TOPS), .boxes = whole->boxes, .waiting = part_of(whole, 0), .unfinished = 1,
              .lock = PTHREAD_MUTEX_INITIALIZER, .changed = PTHREAD_COND_INITIALIZER};
    part *first = p.waiting;
    int others = 0;
    p.failed = !p.nodes || !first;
    if (threads > MOST_THREADS) threads = MOST_THREADS;
    while (others < threads - 1 && pthread_create(&started[others], NULL, work, &p) == 0) others++;
    work(&p);
    for (int i = 0; i < others; i++) pthread_join(started[i], NULL);
    *count = 0;
    pl_front_node *nodes = p.nodes;
    if (!p.failed) {
        if (p.tops > TOPS) nodes = allocate(whole->count + p.tops);
        if (nodes) *root = gather(first, p.nodes, nodes, count);
        if (nodes != p.nodes) free(p.nodes);
        nodes = nodes ? shrink(nodes, *count) : NULL;
    } else {
        free(p.nodes);
        nodes = NULL;
    }
    free_part(first);
    return nodes;
}

pl_front_node *pl_front_tree(pl_boxed *boxes, size_t count, uint32_t *node_count, pl_ref *root, int threads, bool improve)
{
    *root = PL_NOTHING;
    *node_count = 0;
    if (count == 0) return allocate(1);
    const group whole = group_of(boxes, count);
    if (count > PART) return build_parts(&whole, node_count, root, threads);
    const size_t binary = 2 * (count < BLOCK || improve ? count : BLOCK);
    building b = {.nodes = allocate(count), .binary = aligned_alloc(64, binary * sizeof *b.binary)};
    if (b.nodes && b.binary) {
        *root = improve && count > 1 ? build_block(&b, &whole, 0, true) : build(&b, &whole, 0);
        *node_count = b.count;
        b.nodes = shrink(b.nodes, b.count);
    } else {
        free(b.nodes);
        b.nodes = NULL;
    }
    free(b.binary);
    return b.nodes;
}
