/* box.c - from 0 to 1 on each axis. Faces: 0 and 1 are x = 0 and x = 1, 2 and 3 those of y, 4 and 5 those of z. */
#include <stddef.h>

#include "shape.h"

static double support(const double *arguments, const double u[3])
{
    (void)arguments;
    return fmax(0.0, u[0]) + fmax(0.0, u[1]) + fmax(0.0, u[2]);
}

static int roots(const double *arguments, const double o[3], const double d[3], double t_min, double t_max,
                 pl_root out[PL_SHAPE_ROOTS])
{
    (void)arguments;
    pl_root enter = {-INFINITY, 0}, leave = {INFINITY, 0};
    for (int axis = 0; axis < 3; axis++)
        if (!pl_interval_slab(o[axis], d[axis], 0.0, 1.0, 2 * axis, 2 * axis + 1, &enter, &leave)) return 0;
    return pl_interval_roots(enter, leave, t_min, t_max, out);
}

static void normal(const double *arguments, int32_t part, const double p[3], double n[3])
{
    (void)arguments, (void)p;
    for (int axis = 0; axis < 3; axis++) n[axis] = part / 2 != axis ? 0.0 : part % 2 ? 1.0 : -1.0;
}

const pl_shape pl_box_shape = {support, roots, normal, NULL, true};
