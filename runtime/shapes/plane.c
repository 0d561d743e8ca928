/* plane.c - the half-space z <= 0: POV-Ray's plane { <0, 0, 1>, 0 }. It has no bounds. */
#include <stddef.h>

#include "flat.h"

static int roots(const double *arguments, const double o[3], const double d[3], double t_min, double t_max,
                 pl_root out[PL_SHAPE_ROOTS])
{
    (void)arguments;
    double t = -o[2] / d[2];
    if (!(t > t_min && t < t_max)) return 0;
    out[0] = (pl_root){t, 0};
    return 1;
}

const pl_shape pl_plane = {NULL, roots, pl_flat_normal, NULL, true};
