/* class.h - what is known of states before they are unfolded: boxes of whole classes of them.
 *
 * A class is a symbol with an interval for each live parameter, whatever its random key. Its box holds every state of the class:
 * the symbol's production is followed with intervals (interval.h), both ways where a guard isn't decided, all that a draw
 * could choose. A state's class is found by widening its parameters to a coarse grid, whole numbers that count stay exact,
 * so many states share one. A box is never sampled; where nothing is known it is everything.
 *
 *     pl_bounds bounds;
 *     pl_classes_bound(classes, symbol, &scope, &bounds, &work);      of the state that the scope leads to
 *
 * Bounds are a pure function of the symbol and the live parameters, since detail cut-offs stand on them (cut.h): the work
 * for a class is counted from nothing, whatever is in the table, and of one that takes too much nothing is known. Its
 * intervals are followed on a fine grid and, where that gives nothing, on a coarse one, on which fewer classes are met.
 *
 *     class.c  the table          class_walk.c  following the graph          class_box.c  boxes below transformations
 *     class_cover.c  what a cut-off draws of a class
 *
 * Safe from any thread: one lock, held on the way to a state that isn't unfolded yet. */
#ifndef PL_CLASS_H
#define PL_CLASS_H

#include "cut.h"
#include "hull.h"
#include "interval.h"

typedef struct pl_bounds {
    pl_box box;
    pl_hull hull; /* of what stands in the box */
    pl_reach reach;
    uint64_t count; /* primitives; UINT64_MAX: draws decide, or unknown */
    uint64_t fewest; /* primitives that there are whatever is drawn */
    bool hollow; /* a state may have no primitive: this one, or one below */
    bool unbounded; /* nothing is known, or a shape has no bounds */
} pl_bounds;

typedef struct pl_classes pl_classes;

/* limit: bytes that the table may take. */
pl_classes *pl_classes_create(const pl_program *program, pl_mesh_tree *const *meshes, size_t limit, pl_error *error);
void pl_classes_free(pl_classes *classes);

/* Bounds of the state that a scope leads to at a symbol node, in its own frame. *work grows by the nodes visited. */
void pl_classes_bound(pl_classes *classes, uint32_t symbol, const pl_scope *scope, pl_bounds *bounds, uint64_t *work);

/* The same as a gate sees it. */
void pl_classes_gate(pl_classes *classes, uint32_t symbol, const pl_scope *scope, pl_gate_box *gate);
pl_gate_box pl_bounds_gate(const pl_bounds *bounds);

/* Classes in the table now, and nodes visited. */
typedef struct pl_class_counts {
    uint64_t classes, visited;
} pl_class_counts;
void pl_classes_count(pl_classes *classes, pl_class_counts *counts);

/* --- class_cover.c --- */

typedef struct pl_covers pl_covers;
pl_covers *pl_covers_create(const pl_program *program, pl_mesh_tree *const *meshes, pl_classes *classes, pl_error *error);
void pl_covers_free(pl_covers *covers);

/* The share of its box's silhouette that the state covers which a scope leads to, from a direction of its frame. */
double pl_covers_of(pl_covers *covers, uint32_t symbol, const pl_scope *scope, const double d[3]);

/* --- class_box.c --- */

pl_bounds pl_bounds_nothing(void);
pl_bounds pl_bounds_unknown(void);

/* Bounds of a leaf in its own frame: of a box; of a shape, whose arguments lie between two. */
void pl_bounds_of_box(const pl_box *box, pl_bounds *bounds);
void pl_bounds_of_shape(const pl_shape *shape, const double *low, const double *high, pl_bounds *bounds);

/* Of both, or of one of them. */
void pl_bounds_join(pl_bounds *a, const pl_bounds *b, bool alternative);

/* Bounds seen from above a transformation, known exactly or in intervals. whole: the box is to hold not only what stands in the
 * box below but all of it, as that of an instance that may be drawn as its box. */
void pl_bounds_through(const pl_transform *transform, bool whole, pl_bounds *bounds);
void pl_bounds_through_range(const pl_range_map *map, pl_bounds *bounds);

/* The box alone. */
void pl_box_through(const pl_transform *transform, pl_box *box);

/* A little wider than rounding of composing and mapping could make a box. */
void pl_box_widen(pl_box *box);

/* --- class_walk.c --- */

/* Parts of an octave that intervals are widened to: of a state's own class, on the way down, and for coverages. */
typedef enum pl_class_grid { PL_GRID_CLASS, PL_GRID_FINE, PL_GRID_COARSE, PL_GRID_COVER } pl_class_grid;

/* The live parameters of a scope (a range for each parameter), widened; live has room for the symbol's. */
void pl_class_of(const pl_program *program, uint32_t symbol, const pl_range *scope, pl_class_grid grid, pl_range *live);

/* Whether ranges are as widened as those of a state's own class. */
bool pl_class_is_of_a_state(const pl_range *live, uint32_t count);

/* A class met on the way down. */
typedef struct pl_class_found {
    uint32_t symbol;
    const pl_range *live;
    const pl_bounds *bounds; /* NULL: nothing can be known */
    uint64_t work;           /* nodes visited for it */
} pl_class_found;

typedef struct pl_class_walk pl_class_walk;
pl_class_walk *pl_class_walk_create(const pl_program *program, pl_mesh_tree *const *meshes);
void pl_class_walk_free(pl_class_walk *walk);

/* Follows the graph from a class, on a grid. known(context, symbol, live): whether it was found before that on this grid nothing
 * can be known of a class; found: what was learnt on the way. false: nothing is known. */
bool pl_class_walk_bound(pl_class_walk *walk, uint32_t symbol, const pl_range *live, pl_class_grid grid,
                         bool (*known)(void *context, uint32_t symbol, const pl_range *live),
                         void (*found)(void *context, const pl_class_found *found), void *context, pl_bounds *bounds);

/* Nodes visited so far. */
uint64_t pl_class_walk_visited(const pl_class_walk *walk);

#endif
