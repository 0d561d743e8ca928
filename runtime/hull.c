/* hull.c - the supports of sets in 98 directions (hull.h). */
#include "hull.h"

#include <float.h>
#include <string.h>

#include "elementary.h"

#define ROUNDINGS (64.0 * DBL_EPSILON)

enum { N = PL_HULL_N, SIDE = PL_HULL_SIDE };

static const int strides[3] = {SIDE * SIDE, SIDE, 1};

/* false: not on the surface. */
static bool direction_of(int cell, double direction[3])
{
    const int x = cell / (SIDE * SIDE) - N, y = cell / SIDE % SIDE - N, z = cell % SIDE - N;
    direction[0] = x;
    direction[1] = y;
    direction[2] = z;
    return x == -N || x == N || y == -N || y == N || z == -N || z == N;
}

static pl_hull hull_with(double support)
{
    pl_hull hull;
    for (int i = 0; i < PL_HULL_CELLS; i++) hull.support[i] = support;
    return hull;
}

pl_hull pl_hull_empty(void)
{
    return hull_with(-INFINITY);
}

pl_hull pl_hull_of_box(const pl_box *box)
{
    pl_hull hull = pl_hull_empty();
    for (int i = 0; i < PL_HULL_CELLS && !pl_box_is_empty(box); i++) {
        double d[3], sum = 0.0, size = 0.0;
        direction_of(i, d);
        for (int axis = 0; axis < 3; axis++) {
            const double plane = d[axis] > 0.0 ? d[axis] * box->hi[axis] : d[axis] < 0.0 ? d[axis] * box->lo[axis] : 0.0;
            sum += plane;
            size += fabs(plane);
        }
        hull.support[i] = sum + ROUNDINGS * size;
    }
    return hull;
}

pl_hull pl_hull_of_shape(const pl_shape *shape, const double *arguments)
{
    pl_hull hull = hull_with(0.0);
    const pl_box box = pl_shape_box(shape, arguments, NULL);
    const double slack = 3.0 * ROUNDINGS * pl_box_reach(&box);
    for (int i = 0; i < PL_HULL_CELLS; i++) {
        double d[3];
        if (direction_of(i, d)) hull.support[i] = shape->support(arguments, d) + slack;
    }
    return hull;
}

pl_hull pl_hull_of_ball(double radius)
{
    pl_hull hull;
    for (int i = 0; i < PL_HULL_CELLS; i++) {
        double d[3];
        direction_of(i, d);
        hull.support[i] = radius * sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) * (1.0 + ROUNDINGS);
    }
    return hull;
}

void pl_hull_join(pl_hull *hull, const pl_hull *other)
{
    for (int i = 0; i < PL_HULL_CELLS; i++)
        if (!(other->support[i] <= hull->support[i])) hull->support[i] = other->support[i];
}

void pl_hull_meet(pl_hull *hull, const pl_hull *other)
{
    for (int i = 0; i < PL_HULL_CELLS; i++)
        if (other->support[i] < hull->support[i]) hull->support[i] = other->support[i];
}

/* Of all coordinates. */
static double reach_of(const pl_hull *hull)
{
    const pl_box box = pl_hull_box(hull);
    return pl_box_reach(&box);
}

/* Where a direction lies on the lattice: between three at the corners of half a square of the surface. */
typedef struct cell {
    int corner, step, across; /* from the middle to one corner, from there to the next and to the opposite one */
    double weights[3], scale; /* scale 0: no direction */
} cell;

static inline cell cell_of(const double v[3])
{
    const double a[3] = {fabs(v[0]), fabs(v[1]), fabs(v[2])};
    const int first = a[1] > a[0], most = a[2] > a[first] ? 2 : first, second = most == 2 ? 0 : !first, third = 3 - most - second;
    if (!(a[most] > 0.0)) return (cell){.scale = 0.0};
    const double in_cells = N / a[most];
    double x = a[second] * in_cells, y = a[third] * in_cells;
    const int column = x < N ? (int)x : N - 1, row = y < N ? (int)y : N - 1;
    const int right = v[second] < 0.0 ? -strides[second] : strides[second], up = v[third] < 0.0 ? -strides[third] : strides[third];
    x -= column;
    y -= row;
    const double more = x >= y ? x : y, less = x >= y ? y : x;
    return (cell){.corner = (v[most] < 0.0 ? -N : N) * strides[most] + column * right + row * up,
                  .step = x >= y ? right : up,
                  .across = right + up,
                  .weights = {1.0 - more, more - less, less},
                  .scale = a[most] / N};
}

/* The support there; side -1: in the opposite direction. Roundings, in proportion to the hull's reach, are left to the caller. */
static inline double support_at(const pl_hull *hull, const cell *at, int side)
{
    if (at->scale == 0.0) return 0.0;
    const double *h = hull->support + PL_HULL_MIDDLE + side * at->corner;
    return (at->weights[0] * h[0] + at->weights[1] * h[side * at->step] + at->weights[2] * h[side * at->across]) * at->scale;
}

/* How far roundings may move a point, along a unit of each axis, that is mapped from within `reach`. Not in proportion to the result:
 * terms may have cancelled each other out. */
static double slack_under(const pl_affine *to_parent, double reach)
{
    double size = 0.0;
    for (int i = 0; i < 12; i++) size += (i % 4 == 3 ? 1.0 : 2.0 * reach) * fabs(to_parent->m[i]);
    return ROUNDINGS * size;
}

/* Direction d as it is below a map, and how far the map moves the set along it. */
static double turn_back(const pl_affine *to_parent, const double d[3], double v[3])
{
    const double *m = to_parent->m;
    for (int axis = 0; axis < 3; axis++) v[axis] = d[0] * m[axis] + d[1] * m[4 + axis] + d[2] * m[8 + axis];
    return d[0] * m[3] + d[1] * m[7] + d[2] * m[11];
}

/* The supports of a set in a direction and in the opposite one, which lie on the lattice alike. */
typedef struct both_ways {
    double ahead, behind;
} both_ways;

static inline both_ways both_along(const pl_hull *hull, const double v[3])
{
    const cell at = cell_of(v);
    return (both_ways){support_at(hull, &at, 1), support_at(hull, &at, -1)};
}

static inline both_ways larger_ways(both_ways a, both_ways b)
{
    return (both_ways){b.ahead > a.ahead ? b.ahead : a.ahead, b.behind > a.behind ? b.behind : a.behind};
}

/* Of the set mapped. */
static inline both_ways both_under(const pl_affine *to_parent, const pl_hull *hull, const double d[3])
{
    double v[3];
    const double move = turn_back(to_parent, d, v);
    const both_ways below = both_along(hull, v);
    return (both_ways){below.ahead + move, below.behind - move};
}

void pl_hull_through(const pl_affine *to_parent, pl_hull *hull)
{
    const pl_hull below = *hull;
    const double slack = N * slack_under(to_parent, reach_of(&below));
    for (int i = 0; i < PL_HULL_MIDDLE; i++) {
        double d[3];
        if (!direction_of(i, d)) continue;
        const both_ways mapped = both_under(to_parent, &below, d);
        hull->support[i] = mapped.ahead + slack;
        hull->support[PL_HULL_CELLS - 1 - i] = mapped.behind + slack;
    }
}

pl_box pl_hull_box_under(const pl_affine *to_parent, const pl_hull *hull)
{
    const double slack = slack_under(to_parent, reach_of(hull));
    pl_box box;
    for (int axis = 0; axis < 3; axis++) {
        const double *row = to_parent->m + 4 * axis;
        const cell at = cell_of(row);
        box.lo[axis] = row[3] - support_at(hull, &at, -1) - slack;
        box.hi[axis] = row[3] + support_at(hull, &at, 1) + slack;
    }
    return box;
}

/* --- maps that are known by ranges --- */

/* The corners of a polytope of linear parts and translations that holds all maps of a range: a support is
 * convex in the map, so it is largest at a corner. */
enum { MOST_CORNERS = 64, ARC = 18 };

typedef struct corners {
    pl_affine list[MOST_CORNERS];
    int count;
    double largest; /* entry on the way: roundings are in proportion to it */
} corners;

/* Replaces each corner by `ways` of it, the first ones last. false: too many. */
static bool multiply_corners(corners *c, int ways)
{
    if (c->count * ways > MOST_CORNERS) return false;
    for (int way = 1; way < ways; way++) memcpy(c->list + way * c->count, c->list, (size_t)c->count * sizeof *c->list);
    c->count *= ways;
    return true;
}

/* Columns i and j are turned by an arc, whose polygon has its ends and, between tangents, a corner each `ARC` degrees. */
static bool rotate_corners(corners *c, int i, int j, pl_range degrees)
{
    const double width = fmin(degrees.hi - degrees.lo, 360.0);
    const int before = c->count, tangents = (int)ceil(width / ARC), ends = width < 360.0 ? width > 0.0 ? 2 : 1 : 0;
    if (!multiply_corners(c, tangents + ends)) return false;
    for (int k = 0; k < c->count; k++) {
        const int way = k / before;
        double *m = c->list[k].m, at = way == tangents ? degrees.lo : degrees.hi, radius = 1.0, sine, cosine;
        if (way < tangents) {
            at = degrees.lo + width / tangents * (way + 0.5);
            radius = (1.0 + 1e-9) / pl_cos(0.5 * width / tangents);
        }
        sine = radius * pl_sin(at);
        cosine = radius * pl_cos(at);
        for (int row = 0; row < 12; row += 4) {
            const double a = m[row + i], b = m[row + j];
            m[row + i] = a * cosine + b * sine;
            m[row + j] = b * cosine - a * sine;
        }
    }
    return true;
}

static bool scale_corners(corners *c, const pl_range factors[3], bool uniform)
{
    for (int axis = 0; axis < 3; axis++) {
        const int before = c->count;
        if (uniform && axis) break;
        if (!multiply_corners(c, pl_range_is_point(factors[axis]) ? 1 : 2)) return false;
        for (int k = 0; k < c->count; k++)
            for (int entry = 0; entry < 12; entry++)
                if (uniform ? entry % 4 != 3 : entry % 4 == axis) c->list[k].m[entry] *= k < before ? factors[axis].lo : factors[axis].hi;
    }
    return true;
}

static bool move_corners(corners *c, const pl_range by[3])
{
    for (int axis = 0; axis < 3; axis++) {
        const int before = c->count;
        if (!multiply_corners(c, pl_range_is_point(by[axis]) ? 1 : 2)) return false;
        for (int k = 0; k < c->count; k++)
            for (int row = 0; row < 12; row += 4) c->list[k].m[row + 3] += c->list[k].m[row + axis] * (k < before ? by[axis].lo : by[axis].hi);
    }
    return true;
}

/* false: the operations aren't known, or there are too many corners. */
static bool corners_of_steps(const pl_range_map *map, corners *c)
{
    bool ok = map->step_count >= 0;
    c->list[0] = pl_affine_identity();
    c->count = 1;
    c->largest = 1.0;
    for (int i = 0; ok && i < map->step_count; i++) {
        const pl_range *a = map->steps[i].arguments;
        switch (map->steps[i].opcode) {
        case PL_OP_TRANS: ok = move_corners(c, a); break;
        case PL_OP_ROTX: ok = rotate_corners(c, 1, 2, a[0]); break;
        case PL_OP_ROTY: ok = rotate_corners(c, 2, 0, a[0]); break;
        case PL_OP_ROTZ: ok = rotate_corners(c, 0, 1, a[0]); break;
        default: ok = scale_corners(c, a, map->steps[i].opcode == PL_OP_SCALE_UNIFORM); break;
        }
        for (int k = 0; ok && k < c->count; k++)
            for (int entry = 0; entry < 12; entry++) c->largest = fmax(c->largest, fabs(c->list[k].m[entry]));
    }
    return ok;
}

/* The supports below a matrix of ranges, bounds that know nothing of how its entries belong together. */
static both_ways both_under_entries(const pl_range_map *map, const pl_hull *below, double reach, const double d[3])
{
    double lo[4], hi[4], size = 0.0;
    for (int column = 0; column < 4; column++) {
        lo[column] = hi[column] = 0.0;
        for (int r = 0; r < 3; r++) {
            const pl_range entry = map->m[4 * r + column];
            if (d[r] == 0.0) continue;
            lo[column] += d[r] > 0.0 ? d[r] * entry.lo : d[r] * entry.hi;
            hi[column] += d[r] > 0.0 ? d[r] * entry.hi : d[r] * entry.lo;
            size += fabs(d[r]) * (column == 3 ? 1.0 : reach) * fmax(fabs(entry.lo), fabs(entry.hi));
        }
    }
    both_ways largest = {-INFINITY, -INFINITY};
    for (int corner = 0; corner < 8; corner++) {
        const double at[3] = {corner & 1 ? hi[0] : lo[0], corner & 2 ? hi[1] : lo[1], corner & 4 ? hi[2] : lo[2]};
        const bool again = (corner & 1 && lo[0] == hi[0]) || (corner & 2 && lo[1] == hi[1]) || (corner & 4 && lo[2] == hi[2]);
        if (!again) largest = larger_ways(largest, both_along(below, at));
    }
    const double slack = 4.0 * ROUNDINGS * size;
    return (both_ways){largest.ahead + hi[3] + slack, largest.behind - lo[3] + slack};
}

static double with_slack(double support, double slack)
{
    const double sum = support + slack;
    return isnan(sum) ? INFINITY : sum;
}

void pl_hull_through_range(const pl_range_map *map, pl_hull *hull)
{
    const pl_hull below = *hull;
    const double reach = reach_of(&below);
    corners c;
    const bool known = corners_of_steps(map, &c);
    double slack = 0.0;
    for (int k = 0; known && k < c.count; k++) slack = fmax(slack, N * slack_under(&c.list[k], reach));
    if (known) slack += 16.0 * ROUNDINGS * N * c.largest * (1.0 + 3.0 * reach);
    for (int i = 0; i < PL_HULL_MIDDLE; i++) {
        double d[3];
        if (!direction_of(i, d)) continue;
        both_ways mapped = {-INFINITY, -INFINITY};
        if (!known) mapped = both_under_entries(map, &below, reach, d);
        for (int k = 0; known && k < c.count; k++) mapped = larger_ways(mapped, both_under(&c.list[k], &below, d));
        hull->support[i] = with_slack(mapped.ahead, slack);
        hull->support[PL_HULL_CELLS - 1 - i] = with_slack(mapped.behind, slack);
    }
}

pl_box pl_hull_box(const pl_hull *hull)
{
    pl_box box;
    for (int axis = 0; axis < 3; axis++) {
        box.lo[axis] = -hull->support[PL_HULL_MIDDLE - N * strides[axis]] / N;
        box.hi[axis] = hull->support[PL_HULL_MIDDLE + N * strides[axis]] / N;
    }
    return box;
}
