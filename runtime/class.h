/* class.h - what is known of states before they are unfolded: boxes of whole classes of them.
 *
 * A class is a symbol with an interval for each live parameter, whatever its random key. Its box holds every state of the class:
 * the symbol's production is followed with intervals (interval.h), both ways where a guard isn't decided, all that a draw
 * could choose. Intervals are widened to a coarse grid, numbers that count stay exact, so many states share a class. A box is
 * never sampled; where nothing is known it is everything.
 *
 *     pl_bounds bounds;
 *     pl_classes_bound(classes, symbol, &scope, &bounds);      of the state that the scope leads to
 *
 * Safe from any thread: one lock, held on the way to a state that isn't unfolded yet. The table is emptied when it is
 * full; classes are pure functions, so that shows in nothing but time. */
#ifndef PL_CLASS_H
#define PL_CLASS_H

#include "state.h"

typedef struct pl_bounds {
    pl_box box;
    pl_reach reach;
    uint64_t count; /* primitives; UINT64_MAX: draws decide, or unknown */
    bool unbounded; /* nothing is known, or a shape has no bounds */
} pl_bounds;

typedef struct pl_classes pl_classes;

/* limit: bytes that the table may take. */
pl_classes *pl_classes_create(const pl_program *program, pl_mesh_tree *const *meshes, size_t limit, pl_error *error);
void pl_classes_free(pl_classes *classes);

/* Bounds of the state that a scope leads to at a symbol node, in its own frame. */
void pl_classes_bound(pl_classes *classes, uint32_t symbol, const pl_scope *scope, pl_bounds *bounds);

/* Bounds seen from above a transformation. */
void pl_bounds_through(const pl_transform *transform, pl_bounds *bounds);

/* Bounds of a shape in its own frame. */
void pl_bounds_of_leaf(const pl_box *box, bool unbounded, pl_bounds *bounds);

/* Classes in the table now, and how often it was emptied. */
void pl_classes_count(pl_classes *classes, uint64_t *classes_now, uint64_t *emptied);

#endif
