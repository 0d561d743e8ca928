/* hull.h - convex bounds: how far a set reaches in 98 directions, those to the surface of a cubic lattice.
 *
 * A box that is turned again and again grows each time, though what is in it doesn't. The support h(v), the largest
 * v · p over the points p of the set, is known here in directions whose largest component is -N or N and whose others are whole
 * numbers between, and bounded in all others: a direction is a sum of multiples of the three around it, and a support is no
 * more than the sum of those of its parts (Rockafellar, Convex Analysis, section 13). So a set can be mapped without being
 * wrapped in boxes, also by a map of which only ranges are known: h is convex, so a bound for the corners of a polytope of maps
 * is one for all maps in it. N = 1 widens a ball by up to 13 % at each step, N = 2 by 3 %.
 *
 *     pl_hull hull = pl_hull_of_box(&box);
 *     pl_hull_through(&map, &hull);                 of the set mapped
 *     pl_box smaller = pl_hull_box(&hull);
 *
 * Of bounded sets only. All bounds are rounded outward. */
#ifndef PL_HULL_H
#define PL_HULL_H

#include "box.h"
#include "interval.h"
#include "shapes/shape.h"

enum {
    PL_HULL_N = 2,
    PL_HULL_SIDE = 2 * PL_HULL_N + 1,
    PL_HULL_CELLS = PL_HULL_SIDE * PL_HULL_SIDE * PL_HULL_SIDE,
    PL_HULL_MIDDLE = PL_HULL_CELLS / 2
};

/* support[PL_HULL_MIDDLE + (x · PL_HULL_SIDE + y) · PL_HULL_SIDE + z] in direction (x, y, z); what isn't on the surface isn't used. */
typedef struct pl_hull {
    double support[PL_HULL_CELLS];
} pl_hull;

pl_hull pl_hull_empty(void);
pl_hull pl_hull_of_box(const pl_box *box);

/* A shape with a support function, in its own frame. */
pl_hull pl_hull_of_shape(const pl_shape *shape, const double *arguments);

/* Of both sets; of what is in both. */
void pl_hull_join(pl_hull *hull, const pl_hull *other);
void pl_hull_meet(pl_hull *hull, const pl_hull *other);

/* A ball about the origin. */
pl_hull pl_hull_of_ball(double radius);

void pl_hull_through(const pl_affine *to_parent, pl_hull *hull);
void pl_hull_through_range(const pl_range_map *map, pl_hull *hull);

pl_box pl_hull_box(const pl_hull *hull);

/* The support in a direction of components -1, 0 and 1. */
static inline double pl_hull_support(const pl_hull *hull, int x, int y, int z)
{
    return hull->support[PL_HULL_MIDDLE + PL_HULL_N * ((x * PL_HULL_SIDE + y) * PL_HULL_SIDE + z)] / PL_HULL_N;
}

/* The box of the set mapped. */
pl_box pl_hull_box_under(const pl_affine *to_parent, const pl_hull *hull);

#endif
