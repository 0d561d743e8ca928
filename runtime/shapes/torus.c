/* torus.c - major radius 1 about z, minor radius the argument.
 *
 * The ray is first moved to its point nearest to the origin and its direction made unit, so that the quartic has
 * coefficients of the torus' own size whatever the distance of the eye. Its roots are bracketed by those of its
 * derivatives: the second derivative is a quadratic, between its roots the first is monotone, between the roots of that
 * the quartic is. Each bracket holds one root, found by Newton's method kept inside by bisection. No root of odd order can be lost. */
#include <float.h>
#include <stddef.h>

#include "shape.h"

typedef struct quartic {
    double c[5]; /* c[i] of s^i */
} quartic;

/* The derivative of that order of the quartic at s. */
static double value(const quartic *q, int order, double s)
{
    const double *c = q->c;
    switch (order) {
    case 0: return (((c[4] * s + c[3]) * s + c[2]) * s + c[1]) * s + c[0];
    case 1: return ((4.0 * c[4] * s + 3.0 * c[3]) * s + 2.0 * c[2]) * s + c[1];
    default: return (12.0 * c[4] * s + 6.0 * c[3]) * s + 2.0 * c[2];
    }
}

/* The root of a monotone stretch [lo, hi] over which the sign changes. */
static double solve(const quartic *q, int order, double lo, double hi, double at_lo)
{
    double s = 0.5 * (lo + hi);
    for (int step = 0; step < 100; step++) {
        double f = value(q, order, s);
        if (f == 0.0) return s;
        if ((f < 0.0) == (at_lo < 0.0)) lo = s;
        else hi = s;
        double slope = value(q, order + 1, s), next = s - f / slope;
        if (!(next > lo && next < hi)) next = 0.5 * (lo + hi);
        if (fabs(next - s) <= DBL_EPSILON * fabs(s) || next == lo || next == hi) return next;
        s = next;
    }
    return s;
}

/* The roots in [ends[0], ends[count - 1]] of the derivative of that order, monotone between neighbours of `ends`. */
static int roots_between(const quartic *q, int order, const double *ends, int count, double *found)
{
    int number = 0;
    double before = value(q, order, ends[0]);
    for (int i = 1; i < count; i++) {
        double after = value(q, order, ends[i]);
        if (after == 0.0) found[number++] = ends[i];
        else if ((before < 0.0 && after > 0.0) || (before > 0.0 && after < 0.0))
            found[number++] = solve(q, order, ends[i - 1], ends[i], before);
        before = after;
    }
    return number;
}

/* All roots of the quartic in [-h, h], rising. */
static int quartic_roots(const quartic *q, double h, double found[4])
{
    double ends[6] = {-h}, inner[5];
    int count = 1;
    double a = 12.0 * q->c[4], b = 3.0 * q->c[3], c = 2.0 * q->c[2], discriminant = b * b - a * c;
    if (discriminant > 0.0) {
        double root = sqrt(discriminant);
        double first = (-b - root) / a, second = (-b + root) / a;
        if (first > -h && first < h) ends[count++] = first;
        if (second > -h && second < h) ends[count++] = second;
    }
    ends[count++] = h;
    int turning = roots_between(q, 1, ends, count, inner);
    count = 1;
    for (int i = 0; i < turning; i++) ends[count++] = inner[i];
    ends[count++] = h;
    return roots_between(q, 0, ends, count, found);
}

/* One Newton step on (rho - 1)² + z² - r², which near the surface is better conditioned than the quartic. */
static double polish(double r, const double o[3], const double d[3], double s)
{
    double x = o[0] + s * d[0], y = o[1] + s * d[1], z = o[2] + s * d[2];
    double rho = sqrt(x * x + y * y), out = rho - 1.0;
    double f = out * out + z * z - r * r;
    double slope = 2.0 * (out * (x * d[0] + y * d[1]) / rho + z * d[2]);
    double step = f / slope;
    return fabs(step) < 1e-6 * r ? s - step : s;
}

static double support(const double *arguments, const double u[3])
{
    double across = sqrt(u[0] * u[0] + u[1] * u[1]);
    return across + arguments[0] * sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
}

static int roots(const double *arguments, const double o[3], const double d[3], double t_min, double t_max,
                 pl_root out[PL_SHAPE_ROOTS])
{
    double r = arguments[0], length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    if (!(length > 0.0) || !isfinite(length)) return 0;
    double unit[3] = {d[0] / length, d[1] / length, d[2] / length};
    double along = -(o[0] * unit[0] + o[1] * unit[1] + o[2] * unit[2]), near[3];
    for (int axis = 0; axis < 3; axis++) near[axis] = o[axis] + along * unit[axis];
    double squared = near[0] * near[0] + near[1] * near[1] + near[2] * near[2];
    double h = (1.0 + r) * (1.0 + r) - squared;
    if (!(h >= 0.0)) return 0;
    h = sqrt(h) * (1.0 + 1e-9) + 1e-9;

    /* f(s) = (s² + 2βs + γ)² - 4·((near + s·unit)'s distance from the axis)², γ = |near|² + 1 - r². */
    double beta = near[0] * unit[0] + near[1] * unit[1] + near[2] * unit[2];
    double gamma = squared + 1.0 - r * r;
    double a = unit[0] * unit[0] + unit[1] * unit[1];
    double b = near[0] * unit[0] + near[1] * unit[1];
    double c = near[0] * near[0] + near[1] * near[1];
    quartic q = {{gamma * gamma - 4.0 * c, 4.0 * beta * gamma - 8.0 * b, 4.0 * beta * beta + 2.0 * gamma - 4.0 * a,
                  4.0 * beta, 1.0}};
    double found[4];
    int number = quartic_roots(&q, h, found), count = 0;
    for (int i = 0; i < number; i++) {
        double s = r < 1.0 ? polish(r, near, unit, found[i]) : found[i];
        double t = (along + s) / length;
        if (t > t_min && t < t_max) out[count++] = (pl_root){t, 0};
    }
    return count;
}

static void normal(const double *arguments, int32_t part, const double p[3], double n[3])
{
    (void)arguments, (void)part;
    double rho = sqrt(p[0] * p[0] + p[1] * p[1]);
    n[0] = rho == 0.0 ? 0.0 : p[0] - p[0] / rho;
    n[1] = rho == 0.0 ? 0.0 : p[1] - p[1] / rho;
    n[2] = p[2];
}

static const char *check(const double *arguments)
{
    return arguments[0] > 0.0 && isfinite(arguments[0]) ? NULL : "the minor radius of a torus must be above 0";
}

const pl_shape pl_torus = {support, roots, normal, check, false};
