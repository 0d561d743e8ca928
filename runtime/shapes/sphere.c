/* sphere.c - radius 1 at the origin. */
#include <stddef.h>

#include "shape.h"

static double support(const double *arguments, const double u[3])
{
    (void)arguments;
    return sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
}

/* |o + t·d|² = 1. The discriminant is taken as |d|² - |o x d|², whose error grows with the distance of the origin and
 * not with its square (b² - ac would), and the roots as q/a and c/q, which never cancel. */
static int roots(const double *arguments, const double o[3], const double d[3], double t_min, double t_max,
                 pl_root out[PL_SHAPE_ROOTS])
{
    (void)arguments;
    double a = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    double x = o[1] * d[2] - o[2] * d[1], y = o[2] * d[0] - o[0] * d[2], z = o[0] * d[1] - o[1] * d[0];
    double discriminant = a - (x * x + y * y + z * z);
    if (!(discriminant >= 0.0) || a == 0.0) return 0;
    double b = o[0] * d[0] + o[1] * d[1] + o[2] * d[2];
    double c = o[0] * o[0] + o[1] * o[1] + o[2] * o[2] - 1.0;
    double q = -(b + copysign(sqrt(discriminant), b));
    double t0 = q / a, t1 = q == 0.0 ? 0.0 : c / q;
    pl_root enter = {t0 < t1 ? t0 : t1, 0}, leave = {t0 < t1 ? t1 : t0, 0};
    return pl_interval_roots(enter, leave, t_min, t_max, out);
}

static void normal(const double *arguments, int32_t part, const double p[3], double n[3])
{
    (void)arguments, (void)part;
    for (int axis = 0; axis < 3; axis++) n[axis] = p[axis];
}

const pl_shape pl_sphere = {support, roots, normal, NULL, true};
