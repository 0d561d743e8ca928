/* box.h - axis-aligned boxes and the conservative ray-box test.
 *
 * A box is closed. The empty box has lo = +INFINITY, hi = -INFINITY and is the neutral element of pl_box_join; a box
 * that is infinite anywhere is treated as infinite everywhere.
 *
 *     pl_box box = pl_box_empty();
 *     pl_box_join(&box, &other);
 *     pl_slab slab = pl_slab_of(ray_origin, ray_direction, slack);
 *     if (pl_slab_hits(&slab, &box, t_min, t_max, &t_entry)) …
 *
 * The test filters only: it may say yes too often, never no to a hit. `slack` is the largest distance, in the box's own
 * frame, by which rounding on the way from this frame to a primitive can move a hit out of the exact box (reach.h). */
#ifndef PL_BOX_H
#define PL_BOX_H

#include <math.h>
#include <stdbool.h>

/* The nearest single on the one side of a number: a box rounded outward holds the box that it was. */
static inline float pl_round_down(double x)
{
    float f = (float)x;
    return (double)f > x ? nextafterf(f, -INFINITY) : f;
}

static inline float pl_round_up(double x)
{
    float f = (float)x;
    return (double)f < x ? nextafterf(f, INFINITY) : f;
}

typedef struct pl_box {
    double lo[3], hi[3];
} pl_box;

static inline pl_box pl_box_empty(void)
{
    return (pl_box){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
}

static inline pl_box pl_box_everything(void)
{
    return (pl_box){{-INFINITY, -INFINITY, -INFINITY}, {INFINITY, INFINITY, INFINITY}};
}

static inline bool pl_box_is_empty(const pl_box *box)
{
    return !(box->lo[0] <= box->hi[0]);
}

static inline bool pl_box_is_finite(const pl_box *box)
{
    for (int axis = 0; axis < 3; axis++)
        if (!isfinite(box->lo[axis]) || !isfinite(box->hi[axis])) return false;
    return true;
}

static inline void pl_box_join(pl_box *box, const pl_box *other)
{
    for (int axis = 0; axis < 3; axis++) {
        if (other->lo[axis] < box->lo[axis]) box->lo[axis] = other->lo[axis];
        if (other->hi[axis] > box->hi[axis]) box->hi[axis] = other->hi[axis];
    }
}

/* Half of the surface, for the surface area heuristic; 0 for an empty box. */
static inline double pl_box_area(const pl_box *box)
{
    if (pl_box_is_empty(box)) return 0.0;
    double x = box->hi[0] - box->lo[0], y = box->hi[1] - box->lo[1], z = box->hi[2] - box->lo[2];
    return x * y + y * z + z * x;
}

/* The largest absolute coordinate of a finite box; 0 for an empty one. */
static inline double pl_box_reach(const pl_box *box)
{
    double reach = 0.0;
    if (pl_box_is_empty(box)) return reach;
    for (int axis = 0; axis < 3; axis++) reach = fmax(reach, fmax(fabs(box->lo[axis]), fabs(box->hi[axis])));
    return reach;
}

/* The length of its diagonal; 0 for an empty box. */
static inline double pl_box_diameter(const pl_box *box)
{
    double square = 0.0;
    for (int axis = 0; axis < 3 && !pl_box_is_empty(box); axis++)
        square += (box->hi[axis] - box->lo[axis]) * (box->hi[axis] - box->lo[axis]);
    return sqrt(square);
}

/* A ray prepared for slab tests: per axis the origin moved by the slack for the near and the far plane. */
typedef struct pl_slab {
    double near_origin[3], far_origin[3], inverse[3];
    bool negative[3];
} pl_slab;

static inline pl_slab pl_slab_of(const double origin[3], const double direction[3], double slack)
{
    pl_slab slab;
    for (int axis = 0; axis < 3; axis++) {
        slab.negative[axis] = signbit(direction[axis]) != 0;
        slab.inverse[axis] = 1.0 / direction[axis];
        double toward = slab.negative[axis] ? -slack : slack;
        slab.near_origin[axis] = origin[axis] + toward;
        slab.far_origin[axis] = origin[axis] - toward;
    }
    return slab;
}

/* Whether the ray meets the box within [t_min, t_max]; *t_entry is a lower bound of t in the box. A ray in a slab's
 * plane gives 0 * infinity = NaN, which the comparisons below leave aside. */
static inline bool pl_slab_hits(const pl_slab *slab, const pl_box *box, double t_min, double t_max, double *t_entry)
{
    double entry = t_min, leave = t_max;
    for (int axis = 0; axis < 3; axis++) {
        double near_plane = slab->negative[axis] ? box->hi[axis] : box->lo[axis];
        double far_plane = slab->negative[axis] ? box->lo[axis] : box->hi[axis];
        double t_near = (near_plane - slab->near_origin[axis]) * slab->inverse[axis];
        double t_far = (far_plane - slab->far_origin[axis]) * slab->inverse[axis];
        entry = t_near > entry ? t_near : entry;
        leave = t_far < leave ? t_far : leave;
    }
    *t_entry = entry;
    return entry <= leave;
}

#endif
