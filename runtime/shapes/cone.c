/* cone.c - radius 1 at z = 0, radius top_radius at z = 1, closed by caps.
 *
 * The radius at z is w(z) = 1 + k·z with k = top_radius - 1; the solid is x² + y² <= w², 0 <= z <= 1. It is convex, so
 * a ray meets it in one interval: that of the nappe with w >= 0, cut by the slab 0 <= z <= 1. */
#include <stddef.h>

#include "../vector.h"
#include "shape.h"

enum { SIDE, BOTTOM, TOP };

static double support(const double *arguments, const double u[3])
{
    double across = sqrt(u[0] * u[0] + u[1] * u[1]);
    return fmax(across, arguments[0] * across + u[2]);
}

/* Narrows [enter, leave] to [first, second]. */
static bool narrow(double first, double second, pl_root *enter, pl_root *leave)
{
    if (first > enter->t) *enter = (pl_root){first, SIDE};
    if (second < leave->t) *leave = (pl_root){second, SIDE};
    return enter->t <= leave->t;
}

/* With the product xx' + yy' - ww' the cone is a·t² + 2b·t + c <= 0; its discriminant b² - ac is a sum of 2x2 minors
 * with signs, which doesn't cancel the way b² - ac does far from the cone (the cylinder is the case k = 0). */
static bool narrow_to_side(double k, const double o[3], const double d[3], pl_root *enter, pl_root *leave)
{
    double w_o = 1.0 + k * o[2], w_d = k * d[2];
    double a = d[0] * d[0] + d[1] * d[1] - w_d * w_d;
    double b = o[0] * d[0] + o[1] * d[1] - w_o * w_d;
    double c = o[0] * o[0] + o[1] * o[1] - w_o * w_o;
    double xw = o[0] * w_d - w_o * d[0], yw = o[1] * w_d - w_o * d[1], xy = o[0] * d[1] - o[1] * d[0];
    double discriminant = xw * xw + yw * yw - xy * xy;
    if (isnan(a) || isnan(b) || isnan(c)) return false;
    if (a > 0.0) {
        /* Beside the cone and nearly parallel to its side, a and the discriminant's 0 may be nothing but rounding. */
        if (!(discriminant >= 0.0) || b * b < 0.5 * a * c) return false;
        double q = -(b + copysign(sqrt(discriminant), b));
        double t0 = q / a, t1 = q == 0.0 ? t0 : c / q;
        return narrow(t0 < t1 ? t0 : t1, t0 < t1 ? t1 : t0, enter, leave);
    }
    /* Steeper than the side: inside before the first root or after the second, on different nappes. The nappe with
     * w >= 0 lies where w grows. A ray parallel to the side has its other root at infinity, where a -> -0 leads; in a
     * plane that touches the cone it has none. Outside (c > 0) the discriminant is -ac at least, however it rounds. */
    if (w_d == 0.0) return c <= 0.0;
    double q = -(b + copysign(sqrt(fmax(discriminant, fmax(-a * c, 0.0))), b));
    if (q == 0.0) {
        if (c > 0.0) return false;
        return w_d > 0.0 ? narrow(0.0, INFINITY, enter, leave) : narrow(-INFINITY, 0.0, enter, leave);
    }
    double t0 = a == 0.0 ? -copysign(INFINITY, q) : q / a, t1 = c / q;
    if (w_d > 0.0) return narrow(fmax(t0, t1), INFINITY, enter, leave);
    return narrow(-INFINITY, fmin(t0, t1), enter, leave);
}

/* From afar c is lost in the squares that it is the difference of, and with it where a ray that is nearly parallel to the side
 * meets it. So the ray begins at its point nearest to the origin. */
static bool narrow_from_afar(double k, const double o[3], const double d[3], pl_root *enter, pl_root *leave)
{
    const double s = -pl_dot(o, d) / pl_dot(d, d);
    const double near[3] = {o[0] + s * d[0], o[1] + s * d[1], o[2] + s * d[2]};
    pl_root first = {-INFINITY, SIDE}, second = {INFINITY, SIDE};
    return narrow_to_side(k, near, d, &first, &second) && narrow(first.t + s, second.t + s, enter, leave);
}

static int roots(const double *arguments, const double o[3], const double d[3], double t_min, double t_max,
                 pl_root out[PL_SHAPE_ROOTS])
{
    const double far = 0x1p10, k = arguments[0] - 1.0;
    pl_root enter = {-INFINITY, SIDE}, leave = {INFINITY, SIDE};
    if (!pl_interval_slab(o[2], d[2], 0.0, 1.0, BOTTOM, TOP, &enter, &leave)) return 0;
    if (!(pl_dot(o, o) < far * far ? narrow_to_side : narrow_from_afar)(k, o, d, &enter, &leave)) return 0;
    return pl_interval_roots(enter, leave, t_min, t_max, out);
}

static void normal(const double *arguments, int32_t part, const double p[3], double n[3])
{
    double k = arguments[0] - 1.0;
    n[0] = part == SIDE ? p[0] : 0.0;
    n[1] = part == SIDE ? p[1] : 0.0;
    n[2] = part == SIDE ? -k * (1.0 + k * p[2]) : part == TOP ? 1.0 : -1.0;
    if (n[0] == 0.0 && n[1] == 0.0 && n[2] == 0.0) n[2] = 1.0; /* the apex */
}

static const char *check(const double *arguments)
{
    return arguments[0] >= 0.0 && isfinite(arguments[0]) ? NULL : "the top radius of a cone must be 0 or more";
}

const pl_shape pl_cone = {support, roots, normal, check, true};
