/* state.h - the table of shared states: what the scene consists of once equal subtrees are one.
 *
 * A state is (symbol, live parameter values, random key if a draw is reachable): all that a subtree's geometry depends
 * on. Its items are the leaves of one application of the symbol's production, in path order: primitives, meshes and
 * other states, each below a list of transformations. State 0 is the scene itself (symbol UINT32_MAX).
 *
 *     pl_states states;
 *     if (!pl_states_build(&states, program, meshes, &options, error)) …
 *     const pl_state *root = &states.list[0];        root->primitives, root->bounds->box, root->items[i].state …
 *     pl_states_free(&states);
 *
 * Fig 2.1's tree has 2,049 cylinders and 13 states. Boxes are exact bottom-up unions in each state's own frame; counts
 * saturate at UINT64_MAX. States that contain themselves are legal where every way round contracts: their boxes hold
 * the whole limit set (endless.c), and a cut-off ends them (cut.h). Otherwise they are an error. */
#ifndef PL_STATE_H
#define PL_STATE_H

#include "box.h"
#include "derive.h"
#include "reach.h"
#include "shapes/mesh.h"

/* Where an item stands within its application. It is the same for items of the same path in all states of a symbol,
 * and compared byte by byte: nothing of it is padding. */
typedef struct pl_site {
    int32_t rule;    /* the innermost rule, -1: none */
    int32_t texture; /* the innermost texture node, -1: none … */
    uint16_t texture_transforms; /* … below so many of the item's transformations … */
    uint16_t texture_code;       /* … with values to be computed from parameters: 0 or 1 */
    uint32_t term_count;
    uint32_t terms[]; /* union terms */
} pl_site;

typedef struct pl_item {
    uint32_t kind : 7;      /* PL_NODE_PRIMITIVE, PL_NODE_MESH or PL_NODE_ENTER */
    uint32_t no_shadow : 1; /* below no_shadow within this application */
    uint32_t transform_count : 24; /* no more than there are nodes */
    uint32_t what;          /* shape id, mesh index, or state index */
    const pl_transform *const *transforms; /* outermost first */
    const pl_site *site;
    uint64_t first; /* primitives of this state before this item */
    union {
        double arguments[PL_SHAPE_ARGUMENTS]; /* of a primitive */
        const pl_transform *only; /* of what is entered, once packed: may be its list of transformations */
    };
} pl_item;

/* The items on the way from the scene to a leaf. */
typedef struct pl_items {
    const pl_item **list;
    size_t count, capacity;
} pl_items;

/* What of a state is needed while structures are built over it; rays need it where there are cut-offs. */
typedef struct pl_state_bounds {
    pl_box box;      /* of the bounded primitives, in this state's frame */
    double diameter; /* of the box */
    pl_reach reach;  /* by which the boxes of its items must be widened */
    pl_reach gate;   /* by which its own box must be; differs from reach only in endless states */
    uint64_t singular;
    const uint64_t *key;
} pl_state_bounds;

typedef struct pl_state {
    uint32_t symbol; /* node; UINT32_MAX: the scene */
    uint32_t item_count;
    const pl_item *items;
    pl_state_bounds *bounds; /* once packed NULL, but for the scene and where there are cut-offs */
    uint64_t primitives;
    uint32_t depth;  /* most symbols entered below, itself included; UINT32_MAX: endless */
    bool unbounded;  /* has unbounded primitives below */
    bool endless;    /* contains itself, or a state that does */
    bool open;       /* while building: its component isn't finished */
} pl_state;

/* The union, over all instances, of a graph node's boxes in the node's own frame (paper, section 3, made conservative). */
typedef struct pl_node_box {
    pl_box box;
    pl_reach reach;
    bool unbounded;
} pl_node_box;

typedef struct pl_states {
    const pl_program *program;
    pl_mesh_tree *const *meshes;
    pl_state *list;
    uint32_t count, capacity;
    const pl_item *items; /* of all states, one after another: set when all are known */
    size_t item_count;
    uint32_t *table; /* open addressing: state + 1; 0: free */
    uint32_t table_size;
    pl_node_box *node_boxes; /* per graph node; NULL unless asked for */
    bool cuts;               /* a detail cut-off applies: every instance is passed through its gate (cut.h) */
    struct pl_coverage *coverage; /* with cuts (coverage.h) */
    struct pl_block *blocks; /* memory of items, transformations, terms and keys */
    size_t bytes, limit;
    uint32_t most;
} pl_states;

/* limit: bytes that the table may take, 0: PL_STATES_DEFAULT_BYTES. most: states, 0: as many as fit. */
#define PL_STATES_DEFAULT_BYTES ((size_t)4 << 30)
bool pl_states_build(pl_states *states, const pl_program *program, pl_mesh_tree *const *meshes, bool node_boxes,
                     size_t limit, uint32_t most, pl_error *error);
/* The same without some of the symbols that the scene itself enters: the i-th one if bit i of omitted is set. */
bool pl_states_build_without(pl_states *states, uint64_t omitted, const pl_program *program, pl_mesh_tree *const *meshes,
                             bool node_boxes, size_t limit, uint32_t most, pl_error *error);
void pl_states_free(pl_states *states);

/* Moves what tracing needs into one block of exact size: items, terms, to_object and form of transformations (the rest of
 * pl_transform is gone). Boxes and counts stay; nothing can be looked up or built from the states afterwards. */
bool pl_states_pack(pl_states *states, pl_error *error);
/* What they will take then. */
bool pl_states_packed_bytes(const pl_states *states, size_t *bytes, pl_error *error);

/* The primitive index, in derivation order, of the leaf at a path; UINT64_MAX if the path doesn't exist. depth: 0, or
 * the number of symbols entered where the path ends at an instance of a state: then its first primitive's. */
uint64_t pl_states_locate(const pl_states *states, const pl_path *path, uint32_t depth);

/* The key of the state that a scope leads to at a symbol node, and its words: symbol · live parameters · random key. */
size_t pl_states_key_words(const pl_states *states, uint32_t symbol);
void pl_states_key(const pl_states *states, uint32_t symbol, const pl_scope *scope, uint64_t *key);
/* That state; UINT32_MAX if there is none. */
uint32_t pl_states_find(const pl_states *states, uint32_t symbol, const pl_scope *scope);
/* The slot of a key in the table: its state's or a free one. */
uint32_t pl_states_slot(const pl_states *states, const uint64_t *key);
bool pl_states_grow_table(pl_states *states, pl_error *error);
/* A new, empty state at the end of the list; the key stays the caller's. */
bool pl_states_add(pl_states *states, uint32_t symbol, const uint64_t *key, pl_error *error);

/* Boxes and gates of states that enter each other for ever (endless.c). 1: done; 0: not every way round contracts; -1: an
 * error. */
int pl_bound_component(pl_states *states, const uint32_t *members, uint32_t count, pl_error *error);

/* The box and reach of an item in its state's frame. The tight one bounds primitives; with cuts, the other also holds the
 * whole box of the item's state, which may be drawn. */
pl_box pl_item_box_tight(const pl_states *states, const pl_item *item, pl_reach *reach);
pl_box pl_item_box(const pl_states *states, const pl_item *item, pl_reach *reach);
/* Of an item in its own frame, below its transformations. */
pl_reach pl_item_reach(const pl_states *states, const pl_item *item);
/* The box of an item's bounded primitives under a map that has the item's own transformations in it. */
pl_box pl_box_under(const pl_states *states, const pl_item *item, const pl_affine *map);
bool pl_item_unbounded(const pl_states *states, const pl_item *item);
uint64_t pl_item_primitives(const pl_states *states, const pl_item *item);

/* One graph node on the way to a leaf, and how many transformations stand above it within the application. */
typedef struct pl_trail_node {
    uint32_t node, transforms;
} pl_trail_node;

/* Joins an item's box into those of the graph nodes on its trail, going outward from the leaf. */
void pl_join_node_boxes(pl_states *states, const pl_item *item, const pl_trail_node *trail, uint32_t count);

/* The same for a finished state and its S-node. */
void pl_join_symbol_box(pl_states *states, uint32_t state);

/* Memory of states: blocks, the newest first. */
struct pl_block {
    struct pl_block *next;
    size_t used, size;
    _Alignas(16) unsigned char memory[];
};
void pl_blocks_free(struct pl_block *blocks);

/* Bump allocation within the limit; freed with the states. NULL: error is set. */
void *pl_states_allocate(pl_states *states, size_t bytes, pl_error *error);

/* A box under an affine map. */
pl_box pl_box_map(const pl_affine *map, const pl_box *box);

static inline uint64_t pl_add_saturating(uint64_t a, uint64_t b)
{
    return a > UINT64_MAX - b ? UINT64_MAX : a + b;
}

#endif
