/* front.h - fronts: partially unfolded states, each with a wide tree of boxes over its items.
 *
 * A front begins with the items of one state and opens child states in place, as far as that pays. What
 * stays closed is an *instance* of that state's own front. Nothing opened is the cyclic graph itself, everything the flat scene:
 * one dial between memory and time. Paper, section 2, traces the graph; this is the modern form of its trade.
 *
 * Boxes and primitives are in single precision, in the front's *unit frame*: the state's box centred at the origin and
 * scaled to [-1, 1]. They only filter. A primitive that survives is evaluated along its own path in double (bvh.c), so
 * K and budget never show in a hit. A path through a front is told by *opened* nodes: each is a state that was opened,
 * with the item of its parent by which it was reached.
 *
 *     front_pilot.c  rays -> visits      front_plan.c, front_levels.c  visits, budget -> what is opened where
 *     front_open.c   state -> items      front_tree.c  items -> nodes      front.c  all fronts
 *     front_hull.c   boxes of instances  front_links.c  opened nodes -> lists of transformations
 *     front_improve.c, front_collapse.c  parts of front_tree.c
 *     front_pyramid.c  many rays of the eye at once
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

/* Some of a front's links. */
typedef struct pl_front_list {
    uint32_t first : 24, length : 8;
} pl_front_list;

/* A state that stands opened in a front, reached by `item` (of pl_states.items). Node 0 is the front's own state. */
typedef struct pl_opened {
    uint32_t item, parent;
    union {
        uint32_t above; /* the nearest node above this one whose item has transformations, or 0 … */
        pl_front_list list; /* … or in a front with links: those that lead there */
    };
} pl_opened;

typedef struct pl_front_primitive {
    float columns[3 * 4]; /* unit frame -> shape, column by column; one more number is read with the last */
    float stretch;        /* no less than its largest singular value */
    union {
        float argument; /* of a cone or torus; of others … */
        uint32_t leaf;  /* … which item they are (of pl_states.items) */
    };
    uint32_t opened;     /* where it stands … */
    uint32_t item;       /* … and which item it is or stands in (of pl_states.items; pl_front_leaf); | PL_NO_SHADOW */
} pl_front_primitive;

/* The composed map from a front's unit frame to that of an instance, p' = L·(p - centre), in one line of the cache. L is
 * rounded to single precision: as centre is where the middle of the instance's box comes from, that moves the points of
 * the box by some 2^-24 of its size only. */
typedef struct pl_front_instance {
    double centre[3];
    float columns[3 * 3]; /* of L */
    uint32_t front;       /* | PL_NO_SHADOW */
} pl_front_instance;

/* What the rounding of L lost. Fronts have it where an error in the unit frame of an instance would be seen in those far
 * below, which are magnified a great deal. */
typedef struct pl_front_fine {
    float columns[3 * 3];
} pl_front_fine;

/* Where an instance stands: an opened node, and an item of its state (of pl_states.items). */
typedef struct pl_front_place {
    uint32_t opened, item;
} pl_front_place;

static inline size_t pl_front_instance_bytes(bool fine)
{
    return sizeof(pl_front_instance) + sizeof(pl_front_place) + (fine ? sizeof(pl_front_fine) : 0);
}

/* How far rays' origins can lie from that of the normative ray (error), and what bounds their distance from the frame's
 * origin (distance), both in the unit frame, go down a path together; with s = stretch·√ΣL²,
 *
 *     error' = s·(error + gain·distance + base) + rough        distance' = s·(distance + |centre|) */
typedef struct pl_front_bounds {
    float stretch, gain, base, rough; /* the largest of its instances; stretch: 1/√3 where all maps keep shapes */
} pl_front_bounds;

typedef struct pl_front {
    const pl_front_node *nodes;
    const pl_front_primitive *primitives;
    const pl_front_instance *instances;
    const pl_front_place *places; /* of the instances, in the same memory … */
    const pl_front_fine *fine;    /* … as these are; NULL: not wanted */
    const pl_opened *opened;
    const pl_transform *const *maps; /* its different maps, from 1 on … */
    const uint8_t *links; /* … and which ones lead to opened nodes, the outermost first; NULL: no lists */
    const pl_ref *unbounded; /* without bounds: always visited */
    uint32_t unbounded_count, instance_count, opened_count, node_count;
    pl_ref root;             /* PL_NOTHING: no bounded items */
    uint32_t state;
    bool framed;             /* its box is finite; else all items are unbounded */
    double centre[4], scale; /* unit frame: (p - centre) * scale */
    float half[4];           /* of the box in the unit frame */
    pl_front_bounds bounds;
    float wide;              /* rays farther apart in the unit frame are soon among different items */
    bool dense;              /* rays that come to it have a candidate as a rule */
    float slack_gain, slack_base; /* no normative hit lies farther outside its box, there, than gain * distance + base */
    pl_box box;              /* of the bounded items, in the state's frame */
    pl_reach reach;
} pl_front;

#define PL_NOTHING UINT32_MAX

/* The item of a primitive, of an instance's place or of an opened node but the first. */
static inline const pl_item *pl_front_item(const pl_states *states, uint32_t item)
{
    return &states->items[item & ~PL_NO_SHADOW];
}

/* The primitive or mesh that an item is, or that the state which it enters consists of: such a state isn't opened, and has no
 * front. NULL: an instance. With cut-offs all states have gates. */
static inline const pl_item *pl_front_leaf(const pl_states *states, const pl_item *item)
{
    if (item->kind != PL_NODE_ENTER) return item;
    const pl_state *state = &states->list[item->what];
    return state->item_count == 1 && state->items->kind != PL_NODE_ENTER && !states->cuts ? state->items : NULL;
}

static inline bool pl_front_has_argument(uint32_t kind)
{
    return kind == PL_SHAPE_CONE || kind == PL_SHAPE_TORUS;
}

/* What a front's primitive is. Its number is at hand but in cones and tori: finding it by the state takes two loads more. */
static inline const pl_item *pl_front_leaf_of(const pl_states *states, const pl_front_primitive *p, uint32_t kind)
{
    return pl_front_has_argument(kind) ? pl_front_leaf(states, pl_front_item(states, p->item)) : &states->items[p->leaf];
}

/* Whether an item has primitives. */
static inline bool pl_front_occurs(const pl_states *states, const pl_item *item)
{
    return item->kind != PL_NODE_ENTER || states->list[item->what].primitives > 0;
}

/* Adds the items on the way through a front: those of the states opened down to `opened`, then `last`, then the leaf that this
 * leads to. false: no memory. */
bool pl_front_add_items(pl_items *items, const pl_states *states, const pl_front *front, uint32_t opened, const pl_item *last);

typedef struct pl_fronts {
    pl_front *list; /* 0: the scene */
    uint32_t count;
    uint64_t items, nodes, opened, instances, most_items; /* of all; of the largest */
    size_t bytes, node_bytes, item_bytes;
    uint64_t pilot_rays;
    double entries; /* instances that a ray is expected to enter */
    uint64_t flat_bytes, limit_items; /* limit_items: of fronts that are made by themselves */
    double pilot_seconds;
} pl_fronts;

/* --- front_pyramid.c --- */

/* true: no ray from the eye in a direction between these four (going round) meets anything in the front. false: one may. */
bool pl_front_misses(const pl_front *front, const double eye[3], const double (*directions)[3]);

/* --- front_open.c --- */

/* A box in the unit frame, rounded outward, and what stands in it; corners are read four numbers at once. */
typedef struct pl_boxed {
    _Alignas(16) float lo[3];
    pl_ref ref;
    _Alignas(16) float hi[3];
    float zero;
} pl_boxed;

/* A front's items, and their boxes before its tree is built. */
typedef struct pl_front_items {
    pl_front_primitive *primitives;
    pl_front_instance *instances;
    pl_front_place *places; /* behind the instances, as … */
    pl_front_fine *fine;    /* … these are; or NULL */
    pl_opened *opened;
    pl_ref *unbounded;
    pl_boxed *boxes;
    pl_front_bounds bounds;
    size_t primitive_count, instance_count, opened_count, unbounded_count, box_count;
} pl_front_items;

/* A composed map with bounds of what it does to errors (front_open.c). */
typedef struct pl_composition {
    pl_affine to_parent, to_object;
    double stretch, offset, gain, base;
} pl_composition;

/* The transformations of each item composed, once for all fronts: first[state] + i is item i's. */
struct pl_front_plan;
typedef struct pl_compositions {
    const pl_states *states;
    size_t *first; /* one more than there are states */
    pl_composition *list;
    struct pl_front_plan *single; /* for fronts that are made by themselves; NULL: none was yet */
} pl_compositions;
pl_compositions *pl_compositions_create(const pl_states *states, pl_error *error);
void pl_compositions_free(pl_compositions *compositions);
size_t pl_compositions_bytes(const pl_compositions *compositions);

/* Fills *items with what stands in a front, which has its state, box and unit frame. */
bool pl_front_open(const struct pl_front_plan *plan, const pl_front *front, int threads, pl_front_items *items,
                   pl_error *error);
void pl_front_items_free(pl_front_items *items);

/* --- front_pilot.c --- */

/* How often a few hundred rays visited each state and entered each item (by its composition). */
typedef struct pl_pilot {
    double *visits, *entries;
    uint64_t rays;
} pl_pilot;
bool pl_pilot_fly(pl_pilot *pilot, const pl_scene *scene, const pl_compositions *compositions, pl_error *error);
void pl_pilot_free(pl_pilot *pilot);

/* --- front_plan.c --- */

typedef struct pl_front_counts {
    uint64_t primitives, instances, opened;
    bool whole; /* nothing is left out */
} pl_front_counts;

/* A counting's working memory. */
typedef struct pl_plan_entry {
    uint32_t state;
    double reached;
} pl_plan_entry;
typedef struct pl_state_list {
    uint32_t *list;
    size_t count, capacity;
} pl_state_list;
typedef struct pl_front_counting {
    pl_plan_entry *stack;
    size_t capacity;
    pl_state_list *closed; /* where not NULL, the states of instances are appended */
} pl_front_counting;

/* Which states are opened in which fronts. A state has a front if it has visits. */
typedef struct pl_front_plan {
    const pl_compositions *compositions;
    uint32_t *order;      /* states, each before those that it enters */
    uint32_t *front_of;   /* state -> front + 1; for the builder's use */
    double *bytes;        /* of a copy of a state, less the instance that it replaces */
    bool *single;         /* of one item, or in but one place: opened always */
    bool *price_free;     /* opened always: these, and where fronts are on some levels only, the others */
    bool *fine;           /* the instances of a state's front have pl_front_fine */
    float *probability;   /* of entering an item from its state, by composition */
    double *visits;       /* of each front, a ray */
    double *threshold;    /* of each front: probability a byte */
    double estimate, entries; /* bytes; instances that a ray enters */
    pl_front_counts *counts;  /* of each front */
    pl_front_counting counting;
    struct pl_front_hulls *hulls; /* NULL: none */
    const struct pl_front_levels *levels; /* to be chosen from at each price; NULL: they are chosen */
} pl_front_plan;

/* Bytes of primitives and instances in fronts, with their shares of nodes; of fronts besides. */
double pl_front_primitive_bytes(void);
double pl_front_instance_share(bool fine);
#define PL_FRONT_BYTES (sizeof(pl_front) + 5 * 32.0)

/* pilot may be NULL. once_is_free: what occurs once is always opened. */
pl_front_plan *pl_front_plan_create(const pl_compositions *compositions, const pl_pilot *pilot, bool once_is_free,
                                    pl_error *error);
void pl_front_plan_free(pl_front_plan *plan);

/* Plans fronts for so many bytes: all of them (fill), or as long as more memory pays. *fits: false if even *floor, the bytes
 * without anything opened, is too much; the plan then is that one. */
bool pl_front_plan_budget(pl_front_plan *plan, double budget, bool fill, double *floor, bool *fits, pl_error *error);

/* What a primitive takes in a front that everything is opened in. */
double pl_front_plan_flat_bytes(void);

/* Plans fronts of at most so many items, UINT64_MAX: one of everything. */
bool pl_front_plan_items(pl_front_plan *plan, uint64_t most, pl_error *error);

/* What stands below a state that is reached with this probability in a front, itself included. false: no memory. */
bool pl_front_plan_count(const pl_front_plan *plan, pl_front_counting *counting, uint32_t front, uint32_t state,
                         double reached, pl_front_counts *counts);

/* Plans one front of a state, with at most so many items (0: nothing is opened); its instances' fronts go by their states. */
bool pl_front_plan_single(pl_front_plan *plan, uint32_t state, uint64_t most, pl_front_counts *counts, pl_error *error);

/* Whether an instance of a state that is reached with this probability in a front is opened there. threshold NaN: never. */
static inline bool pl_front_opens(const pl_front_plan *plan, double threshold, double reached, uint32_t state)
{
    return (plan->price_free[state] && threshold == threshold) || reached > threshold * plan->bytes[state];
}

/* The scale of a state's unit frame. */
double pl_front_scale(const pl_states *states, uint32_t state);

/* Sets what of a front follows from its state's box and reach: the unit frame, in which the box of the bounded items is centred
 * and scaled to [-1, 1], and the slack. */
void pl_front_set_frame(pl_front *front, const pl_states *states, uint32_t state);

/* --- front_levels.c --- */

/* What fronts of states would take that are opened from one level to another. visits: of all states, nothing opened. NULL:
 * no memory, or too many levels to choose from. */
typedef struct pl_front_levels pl_front_levels;
pl_front_levels *pl_front_levels_create(const pl_front_plan *plan);

/* Chooses levels at a price: the states of all others are price_free. */
void pl_front_levels_choose(const pl_front_levels *levels, double price, pl_front_plan *plan);

/* --- front_hull.c --- */

/* At once. */
enum { PL_FRONT_MOST_HULLS = 256 };

/* For a plan that has visits; NULL: no memory. Boxes are looser without. */
typedef struct pl_front_hulls pl_front_hulls;
pl_front_hulls *pl_front_hulls_create(const pl_front_plan *plan);
void pl_front_hulls_free(pl_front_hulls *hulls, uint32_t states);

/* No more than they take. */
size_t pl_front_hulls_bytes(const pl_states *states);

/* The box of what may be met of an instance under a map that has the item's own transformations in it. hulls: NULL: none. */
pl_box pl_front_instance_box(const pl_front_hulls *hulls, const pl_states *states, const pl_item *item, const pl_affine *to_parent);

/* --- front_tree.c --- */

/* What each box of a tree takes while that is improved. */
enum { PL_FRONT_IMPROVING_BYTES = 2 * 64 };

/* Boxes (reordered) -> nodes, to be freed by free(), and *root. The same for any number of threads. improve: takes three times
 * as long, for a tree that many rays go through; large ones aren't. NULL: no memory. */
pl_front_node *pl_front_tree(pl_boxed *boxes, size_t count, uint32_t *node_count, pl_ref *root, int threads, bool improve);

/* --- front_links.c --- */

/* Gives a front its links, where they take little beside it and no more than `room`. States must be packed. Returns their
 * bytes; 0: it has none. */
size_t pl_front_link(pl_front *front, const pl_states *states, size_t room);

/* --- front.c --- */

/* One front by itself, of a state, with at most `most` items; its instances' .front name states. sums: counts and bytes are
 * added there. Where it fails the front is to be freed as well. */
bool pl_front_make(const pl_scene *scene, pl_compositions *compositions, uint32_t state, uint64_t most, pl_fronts *sums,
                   pl_front *front, pl_error *error);
void pl_front_free(pl_front *front);

/* Counts only; the states of its instances are appended to *closed, which grows. */
bool pl_front_count(pl_compositions *compositions, uint32_t state, uint64_t most, pl_front_counts *counts,
                    pl_state_list *closed, pl_error *error);

bool pl_fronts_build(pl_scene *scene, pl_error *error);
void pl_fronts_destroy(pl_scene *scene);

/* What was built, for the statistics. */
void pl_fronts_count(const pl_scene *scene, pl_statistics *counts);

#endif
