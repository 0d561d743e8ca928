/* class_box.c - bounds of leaves, of unions and below transformations (class.h). */
#include "class.h"

#include <string.h>

pl_bounds pl_bounds_nothing(void)
{
    return (pl_bounds){.box = pl_box_empty(), .hull = pl_hull_empty(), .hollow = false};
}

pl_bounds pl_bounds_unknown(void)
{
    const pl_box everything = pl_box_everything();
    return (pl_bounds){.box = everything,
                       .hull = pl_hull_of_box(&everything),
                       .reach = {INFINITY, INFINITY, INFINITY},
                       .count = UINT64_MAX,
                       .hollow = true,
                       .unbounded = true};
}

void pl_bounds_of_box(const pl_box *box, pl_bounds *bounds)
{
    bounds->box = *box;
    bounds->hull = pl_hull_of_box(box);
    bounds->count = 1;
    bounds->fewest = !pl_box_is_empty(box);
    bounds->hollow = false;
    bounds->unbounded = !(pl_box_is_empty(box) || pl_box_is_finite(box));
    bounds->reach = pl_reach_leaf(pl_box_is_finite(box) ? 1.7320508075688774 * pl_box_reach(box) : 0.0);
}

/* Radii of cones and tori are what isn't known exactly. */
void pl_bounds_of_shape(const pl_shape *shape, const double *low, const double *high, pl_bounds *bounds)
{
    pl_box box = pl_box_everything();
    if (!shape->support) {
        pl_bounds_of_box(&box, bounds);
        return;
    }
    box = pl_shape_box(shape, low, NULL);
    const pl_box other = pl_shape_box(shape, high, NULL);
    const pl_hull hull = pl_hull_of_shape(shape, high);
    pl_box_join(&box, &other);
    if (low != high) pl_box_widen(&box);
    pl_bounds_of_box(&box, bounds);
    bounds->hull = pl_hull_of_shape(shape, low);
    pl_hull_join(&bounds->hull, &hull);
}

void pl_bounds_join(pl_bounds *a, const pl_bounds *b, bool alternative)
{
    pl_box_join(&a->box, &b->box);
    pl_hull_join(&a->hull, &b->hull);
    pl_reach_join(&a->reach, &b->reach);
    a->unbounded = a->unbounded || b->unbounded;
    a->hollow = a->hollow || b->hollow;
    a->fewest = !alternative ? pl_add_saturating(a->fewest, b->fewest) : a->fewest < b->fewest ? a->fewest : b->fewest;
    if (alternative) a->count = a->count == b->count ? a->count : UINT64_MAX;
    else a->count = pl_add_saturating(a->count, b->count);
}

/* A little wider than rounding of composing and mapping could make a box. */
void pl_box_widen(pl_box *box)
{
    double slack = 64.0 * DBL_EPSILON * pl_box_reach(box);
    if (pl_box_is_empty(box)) return;
    for (int axis = 0; axis < 3; axis++) {
        box->lo[axis] -= slack;
        box->hi[axis] += slack;
        if (isnan(box->lo[axis]) || isnan(box->hi[axis])) *box = pl_box_everything();
    }
}

/* Box, hull and the distance from the frame's origin (reach.size), which turning leaves alone, are followed each for
 * itself, and each bounds the others. */
static void tighten(pl_bounds *bounds)
{
    if (pl_box_is_empty(&bounds->box)) return;
    const pl_hull ball = pl_hull_of_ball(bounds->reach.size * (1.0 + 1e-12)), block = pl_hull_of_box(&bounds->box);
    pl_hull_meet(&bounds->hull, &ball);
    pl_hull_meet(&bounds->hull, &block);
    bounds->box = pl_hull_box(&bounds->hull);
    double square = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        double far = fmax(fabs(bounds->box.lo[axis]), fabs(bounds->box.hi[axis]));
        square += far * far;
    }
    bounds->reach.size = fmin(bounds->reach.size, sqrt(square) * (1.0 + 1e-12));
}

/* Roundings are below those of a sum of four products, three of which have no larger factors than the largest coordinate and
 * the largest entry. */
void pl_box_through(const pl_transform *transform, pl_box *box)
{
    if (pl_box_is_empty(box)) return;
    const double *m = transform->to_parent.m, reach = pl_box_reach(box);
    double entry = 0.0, move = 0.0;
    for (int i = 0; i < 12; i++) {
        if (i % 4 == 3) move = fmax(move, fabs(m[i]));
        else entry = fmax(entry, fabs(m[i]));
    }
    *box = pl_box_map(&transform->to_parent, box);
    const double slack = 16.0 * DBL_EPSILON * (3.0 * reach * entry + move);
    for (int axis = 0; axis < 3; axis++) {
        box->lo[axis] -= slack;
        box->hi[axis] += slack;
    }
    pl_box_widen(box);
}

void pl_bounds_through(const pl_transform *transform, bool whole, pl_bounds *bounds)
{
    bounds->reach = pl_reach_through(transform, &bounds->reach);
    if (!bounds->unbounded) pl_box_through(transform, &bounds->box);
    if (!bounds->unbounded && !whole && !pl_box_is_empty(&bounds->box)) pl_hull_through(&transform->to_parent, &bounds->hull);
    if (!pl_box_is_empty(&bounds->box) && !pl_box_is_finite(&bounds->box)) bounds->unbounded = true;
    if (!bounds->unbounded && !whole) tighten(bounds);
}

void pl_bounds_through_range(const pl_range_map *map, pl_bounds *bounds)
{
    const double c = 2.0 * PL_REACH_ROUNDINGS, m = map->stretch, n = map->inverse_stretch;
    double tau = 0.0;
    pl_reach below = bounds->reach, *above = &bounds->reach;
    for (int r = 0; r < 3; r++) tau = hypot(tau, fmax(fabs(map->m[4 * r + 3].lo), fabs(map->m[4 * r + 3].hi)));
    above->size = m * below.size + tau;
    above->gain = m * n * (c + below.gain);
    above->base = m * n * (2.0 * c * (above->size + tau) + below.gain * tau) + m * below.base +
                  c * (2.0 * m * below.size + tau);
    if (isnan(above->gain)) above->gain = INFINITY;
    if (isnan(above->base)) above->base = INFINITY;
    if (isnan(above->size)) above->size = INFINITY;
    if (bounds->unbounded || pl_box_is_empty(&bounds->box)) return;
    pl_box box;
    for (int r = 0; r < 3; r++) {
        pl_range sum = map->m[4 * r + 3];
        for (int k = 0; k < 3; k++)
            sum = pl_range_add(sum, pl_range_multiply(map->m[4 * r + k], (pl_range){bounds->box.lo[k], bounds->box.hi[k]}));
        box.lo[r] = sum.lo;
        box.hi[r] = sum.hi;
    }
    bounds->box = box;
    pl_box_widen(&bounds->box);
    pl_hull_through_range(map, &bounds->hull);
    if (!pl_box_is_finite(&bounds->box)) bounds->unbounded = true;
    else tighten(bounds);
}

/* Its diameter is the width along some v with components of falling size a, b, c: no more than (a-b) times the width to a face, (b-c)
 * to an edge and c to a corner. With widths F, E and C that is the product of v with (F, E-F, C-E), so no more than the length of that
 * for the worst face, edge and corner that meet. */
static double diameter_of(const pl_hull *hull)
{
    double square = 0.0;
    for (int i = 0; i < 24; i++) {
        const int first = i % 3, second = (first + 1 + i / 3 % 2) % 3, third = 3 - first - second;
        int v[3] = {0};
        double widths[3];
        for (int part = 0; part < 3; part++) {
            v[part == 0 ? first : part == 1 ? second : third] = part == 1 && i / 6 % 2 ? -1 : part == 2 && i / 12 ? -1 : 1;
            widths[part] = pl_hull_support(hull, v[0], v[1], v[2]) + pl_hull_support(hull, -v[0], -v[1], -v[2]);
        }
        const double e = widths[1] - widths[0], c = widths[2] - widths[1];
        const double length = widths[0] * widths[0] + e * e + c * c;
        if (!(length <= square)) square = length;
    }
    return sqrt(square) * (1.0 + 1e-12);
}

pl_gate_box pl_bounds_gate(const pl_bounds *bounds)
{
    static const int bevels[PL_GATE_BEVELS][3] = {{1, 1, 0}, {1, -1, 0}, {1, 0, 1}, {1, 0, -1}, {0, 1, 1},
                                                  {0, 1, -1}, {1, 1, 1}, {1, 1, -1}, {1, -1, 1}, {1, -1, -1}};
    pl_gate_box gate;
    memset(&gate, 0, sizeof gate); /* gates are compared byte by byte */
    gate.box = bounds->box;
    gate.reach = bounds->reach;
    gate.diameter = pl_box_diameter(&bounds->box);
    gate.unbounded = bounds->unbounded;
    gate.bevelled = !bounds->unbounded && !pl_box_is_empty(&bounds->box);
    if (!gate.bevelled) return gate;
    for (int i = 0; i < PL_GATE_BEVELS; i++) {
        const int *v = bevels[i];
        gate.low[i] = pl_round_down(-pl_hull_support(&bounds->hull, -v[0], -v[1], -v[2]));
        gate.high[i] = pl_round_up(pl_hull_support(&bounds->hull, v[0], v[1], v[2]));
    }
    gate.diameter = fmin(gate.diameter, diameter_of(&bounds->hull));
    /* Points of the box are meant, which may be farther out than what stands in it. */
    gate.reach.size = 1.7320508075688774 * pl_box_reach(&gate.box);
    return gate;
}
