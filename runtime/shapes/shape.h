/* shape.h - the contract of a shape: bounds, roots, normal.
 *
 * A shape is a unit solid or flat figure in its own frame (sphere: radius 1 at the origin; cylinder: radius 1, z from 0
 * to 1 …; runtime/bytecode.toml has the rows). The derivation places it; the ray comes here already mapped, with a
 * direction that is not unit length, so that t is the same number in every frame.
 *
 * support(arguments, u)  the largest u · p over the points p of the shape; from it come exact boxes under any affine map.
 *                        NULL for a shape without bounds.
 * roots(…)               all t with t_min < t < t_max at which the ray passes the surface, rising, with the face that it
 *                        passes there. A solid gives its entries and exits: it is closed, so the roots of a ray from
 *                        outside come in pairs, also where it runs through an edge. NaN never counts as a root.
 * normal(…)              the outward normal at a root's point (any positive length); flat shapes: +z.
 * convex                 a ray that leaves it doesn't meet it again.
 * check(arguments)       NULL if the arguments are legal, else what was expected.
 *
 * To add a shape: a row in bytecode.toml, a file here with its `const pl_shape`, a line in the table of shape.c. */
#ifndef PL_SHAPE_H
#define PL_SHAPE_H

#include <stdbool.h>
#include <stdint.h>

#include "../box.h"

enum { PL_SHAPE_ROOTS = 4 };

typedef struct pl_root {
    double t;
    int32_t part; /* face of the shape; triangle of a mesh */
} pl_root;

typedef struct pl_shape {
    double (*support)(const double *arguments, const double u[3]);
    int (*roots)(const double *arguments, const double o[3], const double d[3], double t_min, double t_max,
                 pl_root roots[PL_SHAPE_ROOTS]);
    void (*normal)(const double *arguments, int32_t part, const double p[3], double n[3]);
    const char *(*check)(const double *arguments);
    bool convex;
} pl_shape;

extern const pl_shape pl_sphere, pl_cylinder, pl_cone, pl_box_shape, pl_torus, pl_triangle, pl_square, pl_disc,
    pl_plane;

/* The shape of an id of bytecode.toml; the program is verified, so the id is known. */
const pl_shape *pl_shape_of(uint32_t id);

/* The box of a bounded shape under p' = M·(p, 1), M row by row (12 numbers; NULL: identity). */
pl_box pl_shape_box(const pl_shape *shape, const double *arguments, const double *matrix);

/* What of the interval [enter, leave], with the faces at its ends, lies in (t_min, t_max): the roots of a convex solid. */
static inline int pl_interval_roots(pl_root enter, pl_root leave, double t_min, double t_max,
                                    pl_root roots[PL_SHAPE_ROOTS])
{
    int count = 0;
    if (!(enter.t <= leave.t)) return 0;
    if (enter.t > t_min && enter.t < t_max) roots[count++] = enter;
    if (leave.t > t_min && leave.t < t_max) roots[count++] = leave;
    return count;
}

/* Narrows [enter, leave] to where lo <= o + t·d <= hi; false when nothing is left. Faces lo_part and hi_part. Which one comes
 * first can't be foretold, so it is looked up: branches for it take half of a box's time. */
static inline bool pl_interval_slab(double o, double d, double lo, double hi, int32_t lo_part, int32_t hi_part,
                                    pl_root *enter, pl_root *leave)
{
    if (d == 0.0) return o >= lo && o <= hi;
    const double planes[2] = {lo, hi};
    const int32_t parts[2] = {lo_part, hi_part};
    const bool back = d < 0.0;
    const pl_root first = {(planes[back] - o) / d, parts[back]}, second = {(planes[!back] - o) / d, parts[!back]};
    if (first.t > enter->t) *enter = first;
    if (second.t < leave->t) *leave = second;
    return enter->t <= leave->t;
}

#endif
