/* test_shapes.c - each shape against its definition: roots, faces, normals and support, by sampling along rays. */
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "bytecode.h"
#include "check.h"
#include "shapes/shape.h"

static uint64_t state = 12345;

/* Uniform in [lo, hi) (xorshift). */
static double uniform(double lo, double hi)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return lo + (hi - lo) * (double)(state >> 11) * 0x1p-53;
}

/* Below 0 inside, above outside, by the shape's definition. */
static double outside(uint32_t id, double a, const double p[3])
{
    double x = p[0], y = p[1], z = p[2], across = sqrt(x * x + y * y), slab = fmax(-z, z - 1.0);
    switch (id) {
    case PL_SHAPE_SPHERE: return sqrt(x * x + y * y + z * z) - 1.0;
    case PL_SHAPE_CYLINDER: return fmax(across - 1.0, slab);
    case PL_SHAPE_CONE: return fmax(across - (1.0 + (a - 1.0) * z), slab);
    case PL_SHAPE_BOX: return fmax(slab, fmax(fmax(-x, x - 1.0), fmax(-y, y - 1.0)));
    case PL_SHAPE_TORUS: return sqrt((across - 1.0) * (across - 1.0) + z * z) - a;
    default: return z;
    }
}

static void at(const double o[3], const double d[3], double t, double p[3])
{
    for (int axis = 0; axis < 3; axis++) p[axis] = o[axis] + t * d[axis];
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void random_ray(double distance, double o[3], double d[3])
{
    double target[3];
    for (int axis = 0; axis < 3; axis++) {
        o[axis] = uniform(-1.0, 1.0) * distance;
        target[axis] = uniform(-1.3, 1.3);
        d[axis] = (target[axis] - o[axis]) * 0.37;
    }
}

/* The roots of a solid are where `outside` changes its sign: every one is on the surface, the sign changes there and
 * nowhere else, and the normal points outward. */
static void check_solid_ray(uint32_t id, double a, const double o[3], const double d[3], double scale)
{
    const pl_shape *shape = pl_shape_of(id);
    pl_root roots[PL_SHAPE_ROOTS];
    double p[3], n[3];
    int count = shape->roots(&a, o, d, -INFINITY, INFINITY, roots), samples = 400;
    for (int i = 0; i < count; i++) {
        at(o, d, roots[i].t, p);
        CHECK(fabs(outside(id, a, p)) < 1e-9 * scale);
        CHECK(i == 0 || roots[i - 1].t <= roots[i].t);
        shape->normal(&a, roots[i].part, p, n);
        double length = sqrt(dot(n, n)), beyond[3], before[3];
        CHECK(length > 0.0);
        for (int axis = 0; axis < 3; axis++) {
            beyond[axis] = p[axis] + 1e-6 * n[axis] / length;
            before[axis] = p[axis] - 1e-6 * n[axis] / length;
        }
        CHECK(outside(id, a, beyond) > 0.0);
        if (id != PL_SHAPE_TORUS || a > 1e-5) CHECK(outside(id, a, before) < 1e-7 * scale);
        if (id == PL_SHAPE_PLANE) continue;
        CHECK((dot(n, d) <= 1e-6 * length * scale) == (i % 2 == 0) || fabs(dot(n, d)) < 1e-4 * length);
    }
    CHECK(id == PL_SHAPE_PLANE || count % 2 == 0);
    /* Between two samples the number of roots has the parity of the sign changes. */
    double middle = -dot(o, d) / dot(d, d), half = 3.0 / sqrt(dot(d, d));
    double lo = middle - half;
    for (int s = 0; s < samples; s++) {
        double hi = middle - half + 2.0 * half * (s + 1) / samples, q[3];
        at(o, d, lo, p);
        at(o, d, hi, q);
        double f = outside(id, a, p), g = outside(id, a, q);
        int between = 0;
        for (int i = 0; i < count; i++) between += roots[i].t > lo && roots[i].t <= hi;
        if (fabs(f) > 1e-9 * scale && fabs(g) > 1e-9 * scale) CHECK(between % 2 == ((f < 0.0) != (g < 0.0)));
        lo = hi;
    }
}

static void check_solids(void)
{
    static const struct {
        uint32_t id;
        double argument;
    } solids[] = {{PL_SHAPE_SPHERE, 0.0}, {PL_SHAPE_CYLINDER, 0.0}, {PL_SHAPE_CONE, 0.0},    {PL_SHAPE_CONE, 0.4},
                  {PL_SHAPE_CONE, 1.0},   {PL_SHAPE_CONE, 2.5},     {PL_SHAPE_BOX, 0.0},     {PL_SHAPE_TORUS, 0.3},
                  {PL_SHAPE_TORUS, 0.01}, {PL_SHAPE_TORUS, 0.95},   {PL_SHAPE_PLANE, 0.0}};
    double o[3], d[3];
    for (size_t k = 0; k < sizeof solids / sizeof *solids; k++) {
        for (int i = 0; i < 600; i++) {
            double distance = i % 3 == 0 ? 1.0 : i % 3 == 1 ? 5.0 : 1000.0;
            random_ray(distance, o, d);
            check_solid_ray(solids[k].id, solids[k].argument, o, d, distance);
        }
        for (int i = 0; i < 300; i++) { /* parallel to an axis, with both zeros */
            random_ray(2.0, o, d);
            for (int axis = 0; axis < 3; axis++)
                d[axis] = axis == i % 3 ? uniform(0.0, 1.0) < 0.5 ? -1.5 : 0.7 : i & 4 ? -0.0 : 0.0;
            check_solid_ray(solids[k].id, solids[k].argument, o, d, 2.0);
        }
    }
}

/* Rays from afar, as good as parallel to the side of a cone. */
static void check_cones_from_afar(void)
{
    static const double tops[] = {0.0, 0.4, 2.5, 40.0};
    for (int i = 0; i < 2000; i++) {
        const double top = tops[i % 4], angle = uniform(0.0, 6.3), distance = exp(uniform(0.0, 18.0)), off = uniform(-1.0, 1.0) * 1e-9;
        const double d[3] = {(top - 1.0) * cos(angle), (top - 1.0) * sin(angle), 1.0 + (i & 4 ? off : 0.0)};
        const double way = (i & 8 ? distance : -distance) / sqrt(dot(d, d));
        double o[3];
        for (int axis = 0; axis < 3; axis++) o[axis] = uniform(-4.0, 4.0) + way * d[axis];
        check_solid_ray(PL_SHAPE_CONE, top, o, d, 1.0 + 1e-6 * distance);
    }
}

static void check_support(void)
{
    for (uint32_t id = PL_SHAPE_SPHERE; id < PL_SHAPE_PLANE; id++) {
        const pl_shape *shape = pl_shape_of(id);
        double a = 0.3, o[3], d[3], p[3], reached[16], u[16][3];
        for (int k = 0; k < 16; k++) {
            for (int axis = 0; axis < 3; axis++) u[k][axis] = k < 6 ? (k / 2 == axis) * (k % 2 ? 1 : -1) : uniform(-1, 1);
            reached[k] = -INFINITY;
        }
        for (int i = 0; i < 30000; i++) {
            pl_root roots[PL_SHAPE_ROOTS];
            random_ray(4.0, o, d);
            int count = shape->roots(&a, o, d, -INFINITY, INFINITY, roots);
            for (int r = 0; r < count; r++) {
                at(o, d, roots[r].t, p);
                for (int k = 0; k < 16; k++) reached[k] = fmax(reached[k], dot(u[k], p));
            }
        }
        for (int k = 0; k < 16; k++) {
            double limit = shape->support(&a, u[k]);
            CHECK(reached[k] <= limit + 1e-9);
            CHECK(reached[k] >= limit - 0.06);
        }
    }
    CHECK(pl_shape_of(PL_SHAPE_PLANE)->support == NULL);
}

/* How many roots a ray has; also at t > 0. */
static int roots_of(uint32_t id, double ox, double oy, double oz, double dx, double dy, double dz, double *first)
{
    pl_root roots[PL_SHAPE_ROOTS];
    double a = 0.3;
    int count = pl_shape_of(id)->roots(&a, (double[]){ox, oy, oz}, (double[]){dx, dy, dz}, 0.0, INFINITY, roots);
    if (first) *first = count ? roots[0].t : NAN;
    return count;
}

static void check_special_rays(void)
{
    double t;
    CHECK(roots_of(PL_SHAPE_SPHERE, 0, 0, 0, 0, 0, 2, &t) == 1 && t == 0.5);              /* from inside */
    CHECK(roots_of(PL_SHAPE_SPHERE, -2, 1, 0, 1, 0, 0, &t) == 2 && t == 2.0);             /* tangent: both roots */
    CHECK(roots_of(PL_SHAPE_SPHERE, -2, 1.0000001, 0, 1, 0, 0, NULL) == 0);
    CHECK(roots_of(PL_SHAPE_CYLINDER, 1, 0, 5, 0, -0.0, -1, &t) == 2 && t == 4.0);        /* along the side */
    CHECK(roots_of(PL_SHAPE_CYLINDER, 1.0000001, 0, 5, 0, 0, -1, NULL) == 0);
    CHECK(roots_of(PL_SHAPE_CYLINDER, -3, 0, 1, 1, 0, 0, &t) == 2 && t == 2.0);           /* in the cap's plane */
    CHECK(roots_of(PL_SHAPE_CYLINDER, -3, 0, 1.0000001, 1, 0, -0.0, NULL) == 0);
    CHECK(roots_of(PL_SHAPE_CYLINDER, -2, 0, -1, 1, 0, 1, &t) == 2 && t == 1.0);          /* through the rim */
    CHECK(roots_of(PL_SHAPE_BOX, -1, 0, 0, 1, -0.0, 0, &t) == 2 && t == 1.0);             /* along an edge */
    CHECK(roots_of(PL_SHAPE_BOX, 0.5, 0.5, 0.5, 1, 1, 1, &t) == 1 && t == 0.5);           /* out through a corner */
    CHECK(roots_of(PL_SHAPE_BOX, 2, 2, 2, 1, 0, 0, NULL) == 0);
    CHECK(roots_of(PL_SHAPE_CONE, 0, 0, 3, 0, 0, -1, &t) == 2 && t == 2.0);               /* down the axis */
    CHECK(roots_of(PL_SHAPE_TORUS, -5, 0, 0, 1, 0, 0, &t) == 4 && fabs(t - 3.7) < 1e-12); /* through both sides */
    CHECK(roots_of(PL_SHAPE_TORUS, 0, 0, -5, 0, 0, 1, NULL) == 0);                        /* through the hole */
    CHECK(roots_of(PL_SHAPE_TORUS, 1, 0, -5, 0, 0, 1, &t) == 2 && fabs(t - 4.7) < 1e-12);
    CHECK(roots_of(PL_SHAPE_TORUS, -5, 0, 0.2999999999, 1, 0, 0, NULL) == 4);             /* grazing its top */
    CHECK(roots_of(PL_SHAPE_TORUS, -5, 0, 0.3000000001, 1, 0, 0, NULL) == 0);
    CHECK(roots_of(PL_SHAPE_TRIANGLE, 0.5, 0.5, 2, 0, 0, -1, &t) == 1 && t == 2.0);       /* on the long edge */
    CHECK(roots_of(PL_SHAPE_TRIANGLE, 0.5, 0.51, 2, 0, 0, -1, NULL) == 0);
    CHECK(roots_of(PL_SHAPE_SQUARE, 1, 1, 2, 0, 0, -1, NULL) == 1);                       /* on a corner */
    CHECK(roots_of(PL_SHAPE_SQUARE, 0.5, 0.5, 0, 1, 0, 0, NULL) == 0);                    /* in its plane */
    CHECK(roots_of(PL_SHAPE_DISC, -1, 0, 1, 0, 0, -1, NULL) == 1);
    CHECK(roots_of(PL_SHAPE_DISC, 0.8, 0.7, 1, 0, 0, -1, NULL) == 0);
    CHECK(roots_of(PL_SHAPE_PLANE, 7, 7, 1, 0, 0, -1, &t) == 1 && t == 1.0);
    CHECK(roots_of(PL_SHAPE_PLANE, 7, 7, 1, 1, 0, 0, NULL) == 0);
}

static void check_precision(void)
{
    /* A sphere seen from 1e6 radii, 1e-7 inside its edge: |Δt| relative to what |d|² - |o x d|² can give. */
    double t, expected = 1e6 - sqrt(1.0 - (1.0 - 1e-7) * (1.0 - 1e-7));
    CHECK(roots_of(PL_SHAPE_SPHERE, -1e6, 1.0 - 1e-7, 0, 1, 0, 0, &t) == 2 && fabs(t - expected) < 1e-6);
    /* Torus roots from afar. */
    CHECK(roots_of(PL_SHAPE_TORUS, -1e6, 0, 0.1, 1, 0, 0, &t) == 4);
    CHECK(fabs(t - (1e6 - 1.0 - sqrt(0.09 - 0.01))) < 1e-9);
    /* Nothing that isn't a number is a hit. */
    for (uint32_t id = PL_SHAPE_SPHERE; id <= PL_SHAPE_PLANE; id++) {
        CHECK(roots_of(id, NAN, 0, 2, 0, 0, -1, NULL) == 0 || id == PL_SHAPE_PLANE);
        CHECK(roots_of(id, 0.1, 0.1, 2, NAN, NAN, NAN, NULL) == 0);
        CHECK(roots_of(id, 1e308, 1e308, 1e308, 1e308, -1e308, 1e308, NULL) == 0);
    }
}

static void check_arguments(void)
{
    CHECK(pl_shape_of(PL_SHAPE_CONE)->check(&(double){0.0}) == NULL);
    CHECK(pl_shape_of(PL_SHAPE_CONE)->check(&(double){-0.1}) != NULL);
    CHECK(pl_shape_of(PL_SHAPE_TORUS)->check(&(double){0.0}) != NULL);
    CHECK(pl_shape_of(PL_SHAPE_TORUS)->check(&(double){0.5}) == NULL);
    CHECK(pl_shape_of(PL_SHAPE_TORUS)->check(&(double){NAN}) != NULL);
}

/* Boxes under an affine map hold the mapped surface and touch it. */
static void check_boxes(void)
{
    static const double turn[12] = {0.6, -0.8, 0, 5, 0.8, 0.6, 0, -3, 0, 0, 2, 1};
    pl_box box = pl_shape_box(pl_shape_of(PL_SHAPE_SPHERE), NULL, turn);
    CHECK(fabs(box.lo[0] - 4) < 1e-12 && fabs(box.hi[1] + 2) < 1e-12 && fabs(box.hi[2] - 3) < 1e-12);
    box = pl_shape_box(pl_shape_of(PL_SHAPE_TRIANGLE), NULL, turn);
    CHECK(fabs(box.lo[0] - 4.2) < 1e-12 && fabs(box.hi[0] - 5.6) < 1e-12 && box.lo[2] == 1 && box.hi[2] == 1);
    box = pl_shape_box(pl_shape_of(PL_SHAPE_PLANE), NULL, turn);
    CHECK(!pl_box_is_finite(&box));
}

int main(void)
{
    check_solids();
    check_cones_from_afar();
    check_support();
    check_special_rays();
    check_precision();
    check_arguments();
    check_boxes();
    return check_result();
}
