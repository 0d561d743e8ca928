/* test_mesh.c - meshes: no ray slips through shared edges and vertices, the tree finds what brute force finds, and
 * normals are smooth where they are given. */
#include <math.h>
#include <stdlib.h>

#include "check.h"
#include "shapes/mesh.h"

enum { RINGS = 24, AROUND = 32, VERTICES = (RINGS + 1) * AROUND, TRIANGLES = 2 * RINGS * AROUND };

static double vertices[3 * VERTICES], normals[3 * VERTICES];
static uint32_t triangles[3 * TRIANGLES];
static uint64_t state = 99;

static double uniform(double lo, double hi)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return lo + (hi - lo) * (double)(state >> 11) * 0x1p-53;
}

/* A ball of bumpy radius, closed at the poles by rings of one point; far from the origin if `away` is large. */
static pl_mesh make_ball(double away, bool smooth)
{
    for (int r = 0; r <= RINGS; r++)
        for (int a = 0; a < AROUND; a++) {
            double polar = 3.141592653589793 * r / RINGS, turn = 6.283185307179586 * a / AROUND;
            double bump = r == 0 || r == RINGS ? 1.0 : 1.0 + 0.1 * sin(3.0 * turn) * sin(polar);
            double *n = normals + 3 * (r * AROUND + a), *v = vertices + 3 * (r * AROUND + a);
            n[0] = r == 0 || r == RINGS ? 0.0 : sin(polar) * cos(turn);
            n[1] = r == 0 || r == RINGS ? 0.0 : sin(polar) * sin(turn);
            n[2] = r == RINGS ? -1.0 : cos(polar);
            for (int axis = 0; axis < 3; axis++) v[axis] = bump * n[axis] + away;
        }
    uint32_t *t = triangles;
    for (uint32_t r = 0; r < RINGS; r++)
        for (uint32_t a = 0; a < AROUND; a++) {
            uint32_t b = (a + 1) % AROUND, here = r * AROUND, below = here + AROUND;
            *t++ = here + a, *t++ = below + a, *t++ = below + b;
            *t++ = here + a, *t++ = below + b, *t++ = here + b;
        }
    return (pl_mesh){.vertex_count = VERTICES,
                     .normal_count = smooth ? VERTICES : 0,
                     .triangle_count = TRIANGLES,
                     .vertices = vertices,
                     .triangles = triangles,
                     .normals = smooth ? normals : NULL,
                     .normal_triangles = smooth ? triangles : NULL};
}

static bool count_root(void *context, pl_root root)
{
    (void)root;
    ++*(int *)context;
    return true;
}

/* Rays from inside, aimed exactly at vertices and at points of edges, must leave. */
static void check_watertight(double away)
{
    pl_mesh mesh = make_ball(away, false);
    pl_mesh_tree *tree = pl_mesh_tree_build(&mesh);
    int leaks = 0;
    for (int i = 0; i < 200000; i++) {
        uint32_t triangle = (uint32_t)uniform(0, TRIANGLES), side = (uint32_t)uniform(0, 3);
        const double *p = vertices + 3 * triangles[3 * triangle + side];
        const double *q = vertices + 3 * triangles[3 * triangle + (side + 1) % 3];
        double along = i % 4 == 0 ? 0.0 : uniform(0, 1), o[3], d[3];
        pl_root root;
        for (int axis = 0; axis < 3; axis++) {
            o[axis] = away + (i % 3 ? uniform(-0.3, 0.3) : 0.0);
            d[axis] = p[axis] + along * (q[axis] - p[axis]) - o[axis];
        }
        leaks += !pl_mesh_nearest(tree, o, d, 0.0, INFINITY, &root);
    }
    CHECK(leaks == 0);
    pl_mesh_tree_free(tree);
}

/* The tree's answers are those of one-triangle trees tried one by one. */
static void check_against_brute_force(void)
{
    pl_mesh mesh = make_ball(0.0, false);
    pl_mesh_tree *tree = pl_mesh_tree_build(&mesh), *single[TRIANGLES];
    static pl_mesh parts[TRIANGLES];
    for (uint32_t i = 0; i < TRIANGLES; i++) {
        parts[i] = mesh;
        parts[i].triangle_count = 1;
        parts[i].triangles = triangles + 3 * i;
        single[i] = pl_mesh_tree_build(&parts[i]);
    }
    for (int k = 0; k < 400; k++) {
        double o[3], d[3];
        for (int axis = 0; axis < 3; axis++) o[axis] = uniform(-3, 3), d[axis] = uniform(-1, 1) - o[axis];
        if (k % 5 == 0) d[k % 3] = -0.0;
        pl_root root = {INFINITY, -1}, best = {INFINITY, -1}, one;
        int count = 0, expected = 0;
        bool hit = pl_mesh_nearest(tree, o, d, 0.0, INFINITY, &root);
        pl_mesh_each(tree, o, d, 0.0, INFINITY, count_root, &count);
        for (uint32_t i = 0; i < TRIANGLES; i++)
            if (pl_mesh_nearest(single[i], o, d, 0.0, INFINITY, &one)) {
                expected++;
                if (one.t < best.t) best = (pl_root){one.t, (int32_t)i};
            }
        CHECK(hit == (expected > 0) && count == expected);
        CHECK(!hit || (root.t == best.t && root.part == best.part));
    }
    for (uint32_t i = 0; i < TRIANGLES; i++) pl_mesh_tree_free(single[i]);
    pl_mesh_tree_free(tree);
}

static void check_normals(void)
{
    double n[3], p[3], flat[3];
    pl_mesh mesh = make_ball(0.0, true);
    pl_mesh_tree *tree = pl_mesh_tree_build(&mesh);
    int32_t triangle = TRIANGLES / 2 + 2;
    const double *corner = vertices + 3 * triangles[3 * triangle + 1];
    pl_mesh_normal(tree, triangle, corner, n);
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    const double *expected = normals + 3 * triangles[3 * triangle + 1];
    for (int axis = 0; axis < 3; axis++) CHECK(fabs(n[axis] / length - expected[axis]) < 1e-12);
    pl_mesh_tree_free(tree);

    mesh = make_ball(0.0, false);
    tree = pl_mesh_tree_build(&mesh);
    for (int axis = 0; axis < 3; axis++) p[axis] = corner[axis];
    pl_mesh_normal(tree, triangle, p, flat);
    for (int k = 1; k < 3; k++) {
        double along = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            const double *v = vertices + 3 * triangles[3 * triangle + k];
            along += flat[axis] * (v[axis] - vertices[3 * triangles[3 * triangle] + axis]);
        }
        CHECK(fabs(along) < 1e-15);
    }
    pl_mesh_tree_free(tree);
}

static void check_nothing(void)
{
    pl_mesh mesh = {0};
    pl_root root;
    pl_mesh_tree *tree = pl_mesh_tree_build(&mesh);
    CHECK(tree && pl_box_is_empty(pl_mesh_box(tree)));
    CHECK(!pl_mesh_nearest(tree, (double[]){0, 0, 0}, (double[]){0, 0, 1}, 0.0, INFINITY, &root));
    pl_mesh_tree_free(tree);
}

int main(void)
{
    check_watertight(0.0);
    check_watertight(1e3);
    check_against_brute_force();
    check_normals();
    check_nothing();
    return check_result();
}
