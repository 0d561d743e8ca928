/* reach.h - how far rounding can carry a normative hit out of an exact box.
 *
 * A hit is evaluated by mapping the ray down the path one transformation after another. Each mapping rounds, so the hit
 * of a ray from o may lie outside the exact box of a state, but by no more than
 *
 *     slack(o) = EPSILON · (gain · |o| + base)
 *
 * in the state's own frame. Boxes are widened by it when a ray enters the frame, so no accelerator cuts a hit off and
 * all give the same one. For a transformation M with inverse N (as computed) m = σmax(M), n = σmax(N), translation
 * τ, points within distance R of the origin outside and R' inside, and c a generous count of roundings:
 *
 *     gain = m·n·(c + gain')
 *     base = m·n·(c·(R + τ) + gain'·τ) + m·base' + c·(2·m·R' + τ) + residual
 *
 * where residual bounds (M·N - 1) on the box, which is what N, the map that rays take, lacks of being M's inverse.
 * For rotations, translations and uniform scales m·n = 1 and the slack grows linearly with depth (numerics.md). */
#ifndef PL_REACH_H
#define PL_REACH_H

#include <float.h>
#include <math.h>

#include "program.h"

#define PL_REACH_ROUNDINGS 32.0

typedef struct pl_reach {
    double gain, base;
    double size; /* R: an upper bound of the distance from this frame's origin */
} pl_reach;

/* Of a leaf in its own frame: the roots' own rounding. */
static inline pl_reach pl_reach_leaf(double size)
{
    return (pl_reach){PL_REACH_ROUNDINGS, PL_REACH_ROUNDINGS * (size + 1.0), size};
}

static inline void pl_reach_join(pl_reach *reach, const pl_reach *other)
{
    reach->gain = other->gain > reach->gain ? other->gain : reach->gain; /* none is NaN; fmax is a call */
    reach->base = other->base > reach->base ? other->base : reach->base;
    reach->size = other->size > reach->size ? other->size : reach->size;
}

static inline double pl_reach_slack(const pl_reach *reach, const double o[3])
{
    double distance = sqrt(o[0] * o[0] + o[1] * o[1] + o[2] * o[2]);
    return DBL_EPSILON * (reach->gain * distance + reach->base);
}

/* From below a transformation to above it; stretches: bounds of those of to_parent and to_object. */
pl_reach pl_reach_through(const pl_transform *transform, const pl_reach *below);
pl_reach pl_reach_with(const pl_transform *transform, double stretch, double inverse_stretch, const pl_reach *below);

/* The largest singular value of the linear part, rounded up. */
double pl_largest_stretch(const pl_affine *map);

#endif
