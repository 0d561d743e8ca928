/* cylinder.c - radius 1 about z, from z = 0 to z = 1, closed by caps. */
#include <stddef.h>

#include "shape.h"

enum { SIDE, BOTTOM, TOP };

static double support(const double *arguments, const double u[3])
{
    (void)arguments;
    return sqrt(u[0] * u[0] + u[1] * u[1]) + fmax(0.0, u[2]);
}

/* Narrows [enter, leave] to the infinite cylinder x² + y² <= 1; false when nothing is left. Same forms as sphere.c, in
 * the plane: discriminant |d|² - (o x d)². */
static bool narrow_to_side(const double o[3], const double d[3], pl_root *enter, pl_root *leave)
{
    double a = d[0] * d[0] + d[1] * d[1];
    double c = o[0] * o[0] + o[1] * o[1] - 1.0;
    if (a == 0.0) return c <= 0.0;
    double cross = o[0] * d[1] - o[1] * d[0];
    double discriminant = a - cross * cross;
    if (!(discriminant >= 0.0)) return false;
    double b = o[0] * d[0] + o[1] * d[1];
    double q = -(b + copysign(sqrt(discriminant), b));
    double t0 = q / a, t1 = q == 0.0 ? 0.0 : c / q;
    double first = t0 < t1 ? t0 : t1, second = t0 < t1 ? t1 : t0;
    if (first > enter->t) *enter = (pl_root){first, SIDE};
    if (second < leave->t) *leave = (pl_root){second, SIDE};
    return enter->t <= leave->t;
}

static int roots(const double *arguments, const double o[3], const double d[3], double t_min, double t_max,
                 pl_root out[PL_SHAPE_ROOTS])
{
    (void)arguments;
    pl_root enter = {-INFINITY, SIDE}, leave = {INFINITY, SIDE};
    if (!narrow_to_side(o, d, &enter, &leave)) return 0;
    if (!pl_interval_slab(o[2], d[2], 0.0, 1.0, BOTTOM, TOP, &enter, &leave)) return 0;
    return pl_interval_roots(enter, leave, t_min, t_max, out);
}

static void normal(const double *arguments, int32_t part, const double p[3], double n[3])
{
    (void)arguments;
    n[0] = part == SIDE ? p[0] : 0.0;
    n[1] = part == SIDE ? p[1] : 0.0;
    n[2] = part == SIDE ? 0.0 : part == TOP ? 1.0 : -1.0;
}

const pl_shape pl_cylinder = {support, roots, normal, NULL, true};
