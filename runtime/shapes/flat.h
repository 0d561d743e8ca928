/* flat.h - where a ray meets the plane z = 0, and the tolerance there. */
#ifndef PL_FLAT_H
#define PL_FLAT_H

#include <float.h>

#include "shape.h"

/* The point (x, y) at which the ray passes z = 0 within (t_min, t_max), and `slack`, a bound of its rounding error: a
 * flat figure is widened by it, so that rays don't slip through between figures that share an edge. */
static inline bool pl_flat_crossing(const double o[3], const double d[3], double t_min, double t_max, double *t,
                                    double *x, double *y, double *slack)
{
    *t = -o[2] / d[2];
    if (!(*t > t_min && *t < t_max)) return false;
    double along_x = *t * d[0], along_y = *t * d[1];
    *x = o[0] + along_x;
    *y = o[1] + along_y;
    *slack = 4.0 * DBL_EPSILON * (fabs(o[0]) + fabs(o[1]) + fabs(along_x) + fabs(along_y) + 1.0);
    return true;
}

static inline void pl_flat_normal(const double *arguments, int32_t part, const double p[3], double n[3])
{
    (void)arguments, (void)part, (void)p;
    n[0] = n[1] = 0.0;
    n[2] = 1.0;
}

#endif
