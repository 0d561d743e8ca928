/* front.h - fronts: partially unfolded states, each with a wide tree of boxes over its items.
 *
 * A front begins with the items of one state and opens child states, largest first, until K items stand in it. What
 * stays closed is an *instance* of that state's own front. K = 1 is the cyclic graph itself, K = everything the flat scene: one
 * dial between memory and time. Paper, section 2, traces the graph; this is the modern form of its trade.
 *
 * Boxes and primitives are in single precision, in the front's *unit frame*: the state's box centred at the origin and
 * scaled to [-1, 1]. They only filter. A primitive that survives is evaluated along its own path in double (bvh.c), so
 * K and budget never show in a hit. A path through a front is told by *opened* nodes: each is a state that was opened,
 * with the item of its parent by which it was reached.
 *
 *     front_open.c  state -> items          front_tree.c  items -> nodes          front.c  K, budget, all fronts
 *
 * References (pl_ref) name a node, a primitive or an instance of a front: kind in the top 4 bits, index below. */
#ifndef PL_FRONT_H
#define PL_FRONT_H

#include "accel.h"

typedef uint32_t pl_ref;

enum {
    PL_FRONT_WIDTH = 8,
    PL_REF_SHIFT = 28,
    PL_REF_INDEX = (1 << PL_REF_SHIFT) - 1,
    /* Kinds: 0 a node, PL_SHAPE_… a primitive of that shape, and these. */
    PL_KIND_NODE = 0,
    PL_KIND_MESH = 12,
    PL_KIND_INSTANCE = 13,
    PL_KIND_RETURN = 14, /* of the traversal's stack: the end of an instance */
    PL_NO_SHADOW = 1u << 31
};

static inline pl_ref pl_ref_of(uint32_t kind, uint32_t index)
{
    return kind << PL_REF_SHIFT | index;
}

/* planes[axis] are the children's low planes, planes[3 + axis] their high ones; a missing child has an empty box. */
typedef struct pl_front_node {
    _Alignas(32) float planes[6][PL_FRONT_WIDTH];
    pl_ref child[PL_FRONT_WIDTH];
} pl_front_node;

/* A state that stands opened in a front. Node 0 is the front's own state. */
typedef struct pl_opened {
    const pl_item *item; /* of the parent's state, and leading to this one; NULL: node 0 */
    uint32_t parent;
    uint32_t moved; /* the nearest node from this one up whose item has transformations, or 0 */
} pl_opened;

typedef struct pl_front_primitive {
    float columns[3 * 4]; /* unit frame -> shape, column by column; one more number is read with the last */
    float stretch;        /* no less than its largest singular value */
    float argument;
    uint32_t opened;     /* where it stands … */
    uint32_t item;       /* … and which item of that state; | PL_NO_SHADOW */
} pl_front_primitive;

/* How far rays' origins can lie from that of the normative ray (error), and what bounds their distance from the frame's
 * origin (distance), both in the unit frame, go down a path together:
 *
 *     error' = stretch * error + gain * distance + base        distance' = stretch * distance + offset */
typedef struct pl_front_instance {
    double columns[3 * 4]; /* composed map of points, front's unit frame -> instance's, column by column; what follows is
                              read with the last */
    float stretch, gain, base, offset;
    uint32_t front, opened;
    uint32_t item; /* | PL_NO_SHADOW */
} pl_front_instance;

typedef struct pl_front {
    const pl_front_node *nodes;
    const pl_front_primitive *primitives;
    const pl_front_instance *instances;
    const pl_opened *opened;
    const pl_ref *unbounded; /* without bounds: always visited */
    uint32_t unbounded_count, instance_count;
    pl_ref root;             /* PL_NOTHING: no bounded items */
    uint32_t state;
    bool framed;             /* its box is finite; else all items are unbounded */
    double centre[4], scale; /* unit frame: (p - centre) * scale */
    float half[4];           /* of the box in the unit frame */
    float slack_gain, slack_base; /* no normative hit lies farther outside its box, there, than gain * distance + base */
    pl_box box;              /* of the bounded items, in the state's frame */
    pl_reach reach;
} pl_front;

#define PL_NOTHING UINT32_MAX

/* The item of an opened node's state. */
static inline const pl_item *pl_front_item(const pl_states *states, const pl_front *front, uint32_t opened, uint32_t item)
{
    const pl_item *by = front->opened[opened].item;
    return &states->list[by ? by->what : front->state].items[item & ~PL_NO_SHADOW];
}

typedef struct pl_fronts {
    pl_front *list; /* 0: the scene */
    uint32_t count, capacity;
    uint32_t *of_state; /* front + 1; 0: none */
    uint64_t items, nodes, opened, instances;
    size_t bytes, node_bytes, item_bytes;
    uint64_t limit_items; /* K; UINT64_MAX: everything */
    bool flat;
} pl_fronts;

/* --- front_open.c --- */

/* A box in the unit frame, rounded outward, and what stands in it. */
typedef struct pl_boxed {
    float lo[3], hi[3];
    pl_ref ref;
} pl_boxed;

/* A front's items before its tree is built. */
typedef struct pl_front_items {
    pl_front_primitive *primitives;
    pl_front_instance *instances; /* .front is still the state */
    pl_opened *opened;
    pl_ref *unbounded;
    pl_boxed *boxes;
    size_t primitive_count, instance_count, opened_count, unbounded_count, box_count;
    size_t primitive_capacity, instance_capacity, opened_capacity, unbounded_capacity, box_capacity;
} pl_front_items;

/* What a state's items share: made once for all fronts. */
typedef struct pl_compositions pl_compositions;
pl_compositions *pl_compositions_create(const pl_states *states, pl_error *error);
void pl_compositions_free(pl_compositions *compositions);

/* Opens a state to at most `most` items and fills *items; front has its state, box and unit frame. */
bool pl_front_open(const pl_compositions *compositions, const pl_front *front, uint64_t most, pl_front_items *items,
                   pl_error *error);
void pl_front_items_free(pl_front_items *items);

/* Counts only: what pl_front_open would give, and the states of the instances (appended to *closed, which grows). */
typedef struct pl_front_counts {
    uint64_t primitives, instances, opened;
} pl_front_counts;
typedef struct pl_state_list {
    uint32_t *list;
    size_t count, capacity;
} pl_state_list;
bool pl_front_count(const pl_compositions *compositions, uint32_t state, uint64_t most, pl_front_counts *counts,
                    pl_state_list *closed, pl_error *error);

/* Sets what of a front follows from its state's box and reach: the unit frame, in which the box of the bounded items is centred
 * and scaled to [-1, 1], and the slack. */
void pl_front_set_frame(pl_front *front, const pl_states *states, uint32_t state);

/* --- front_tree.c --- */

/* Boxes (reordered) -> nodes; *root. nodes has room for pl_front_most_nodes(count). Returns their number. */
size_t pl_front_most_nodes(size_t boxes);
uint32_t pl_front_tree(pl_boxed *boxes, size_t count, pl_front_node *nodes, pl_ref *root, int threads);

/* --- front.c --- */

/* One front by itself, of a state, with at most `most` items; its instances' .front name states. sums: counts and bytes are
 * added there. Where it fails the front is to be freed as well. */
bool pl_front_make(const pl_scene *scene, const pl_compositions *compositions, uint32_t state, uint64_t most,
                   pl_fronts *sums, pl_front *front, pl_error *error);
void pl_front_free(pl_front *front);

bool pl_fronts_build(pl_scene *scene, pl_error *error);
void pl_fronts_destroy(pl_scene *scene);

/* What was built, for the statistics. */
void pl_fronts_count(const pl_scene *scene, pl_statistics *counts);

#endif
