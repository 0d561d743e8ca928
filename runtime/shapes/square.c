/* square.c - the flat square [0,1]² in z = 0. */
#include <stddef.h>

#include "flat.h"

static double support(const double *arguments, const double u[3])
{
    (void)arguments;
    return fmax(0.0, u[0]) + fmax(0.0, u[1]);
}

static int roots(const double *arguments, const double o[3], const double d[3], double t_min, double t_max,
                 pl_root out[PL_SHAPE_ROOTS])
{
    (void)arguments;
    double t, x, y, slack;
    if (!pl_flat_crossing(o, d, t_min, t_max, &t, &x, &y, &slack)) return 0;
    if (!(x >= -slack && y >= -slack && x <= 1.0 + slack && y <= 1.0 + slack)) return 0;
    out[0] = (pl_root){t, 0};
    return 1;
}

const pl_shape pl_square = {support, roots, pl_flat_normal, NULL, true};
