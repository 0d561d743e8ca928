/* hull.c - the supports of sets in 26 directions (hull.h). */
#include "hull.h"

#include <float.h>

#define ROUNDINGS (64.0 * DBL_EPSILON)

static const int strides[3] = {9, 3, 1};

static void direction_of(int cell, double direction[3])
{
    direction[0] = cell / 9 - 1;
    direction[1] = cell / 3 % 3 - 1;
    direction[2] = cell % 3 - 1;
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
            const double plane = d[axis] > 0.0 ? box->hi[axis] : d[axis] < 0.0 ? -box->lo[axis] : 0.0;
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
        direction_of(i, d);
        hull.support[i] = i == PL_HULL_MIDDLE ? 0.0 : shape->support(arguments, d) + slack;
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

/* The largest of all supports. */
static double reach_of(const pl_hull *hull)
{
    double reach = 0.0;
    for (int i = 0; i < PL_HULL_CELLS; i++)
        if (i != PL_HULL_MIDDLE) reach = fmax(reach, fabs(hull->support[i]));
    return reach;
}

static double support_along(const pl_hull *hull, double reach, const double v[3])
{
    const double a[3] = {fabs(v[0]), fabs(v[1]), fabs(v[2])};
    int most = a[1] > a[0], least = !most;
    if (a[2] > a[most]) most = 2;
    else if (!(a[2] > a[least])) least = 2;
    const int middle = 3 - most - least;
    int cell = PL_HULL_MIDDLE + (v[most] < 0.0 ? -strides[most] : strides[most]);
    double sum = (a[most] - a[middle]) * hull->support[cell];
    cell += v[middle] < 0.0 ? -strides[middle] : strides[middle];
    sum += (a[middle] - a[least]) * hull->support[cell];
    cell += v[least] < 0.0 ? -strides[least] : strides[least];
    sum += a[least] * hull->support[cell];
    return sum + ROUNDINGS * reach * a[most];
}

/* The support in direction d of the set mapped. */
static double support_under(const pl_affine *to_parent, const pl_hull *hull, double reach, const double d[3])
{
    const double *m = to_parent->m;
    double v[3], move = 0.0, size = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        v[axis] = d[0] * m[axis] + d[1] * m[4 + axis] + d[2] * m[8 + axis];
        move += d[axis] * m[4 * axis + 3];
        /* Not |v|: its terms may have cancelled each other out. */
        size += fabs(d[axis]) * (fabs(m[4 * axis + 3]) + reach * (fabs(m[4 * axis]) + fabs(m[4 * axis + 1]) + fabs(m[4 * axis + 2])));
    }
    return support_along(hull, reach, v) + move + ROUNDINGS * size;
}

void pl_hull_through(const pl_affine *to_parent, pl_hull *hull)
{
    const pl_hull below = *hull;
    const double reach = reach_of(&below);
    for (int i = 0; i < PL_HULL_CELLS; i++) {
        double d[3];
        direction_of(i, d);
        hull->support[i] = support_under(to_parent, &below, reach, d);
    }
}

pl_box pl_hull_box_under(const pl_affine *to_parent, const pl_hull *hull)
{
    const double reach = reach_of(hull);
    pl_box box;
    for (int axis = 0; axis < 3; axis++) {
        double d[3] = {0.0, 0.0, 0.0};
        d[axis] = -1.0;
        box.lo[axis] = -support_under(to_parent, hull, reach, d);
        d[axis] = 1.0;
        box.hi[axis] = support_under(to_parent, hull, reach, d);
    }
    return box;
}

void pl_hull_through_range(const pl_range_map *map, pl_hull *hull)
{
    const pl_hull below = *hull;
    const double reach = reach_of(&below);
    for (int i = 0; i < PL_HULL_CELLS; i++) {
        double d[3], lo[4], hi[4], size = 0.0, largest = -INFINITY;
        direction_of(i, d);
        for (int column = 0; column < 4; column++) {
            lo[column] = hi[column] = 0.0;
            for (int r = 0; r < 3; r++) {
                const pl_range entry = map->m[4 * r + column];
                if (d[r] == 0.0) continue;
                lo[column] += d[r] > 0.0 ? entry.lo : -entry.hi;
                hi[column] += d[r] > 0.0 ? entry.hi : -entry.lo;
                size += (column == 3 ? 1.0 : reach) * fmax(fabs(entry.lo), fabs(entry.hi));
            }
        }
        for (int corner = 0; corner < 8; corner++) {
            const double at[3] = {corner & 1 ? hi[0] : lo[0], corner & 2 ? hi[1] : lo[1], corner & 4 ? hi[2] : lo[2]};
            const bool again = (corner & 1 && lo[0] == hi[0]) || (corner & 2 && lo[1] == hi[1]) || (corner & 4 && lo[2] == hi[2]);
            if (!again) largest = fmax(largest, support_along(&below, reach, at));
        }
        const double sum = largest + hi[3] + ROUNDINGS * size;
        hull->support[i] = isnan(sum) ? INFINITY : sum;
    }
}

pl_box pl_hull_box(const pl_hull *hull)
{
    pl_box box;
    for (int axis = 0; axis < 3; axis++) {
        box.lo[axis] = -hull->support[PL_HULL_MIDDLE - strides[axis]];
        box.hi[axis] = hull->support[PL_HULL_MIDDLE + strides[axis]];
    }
    return box;
}
