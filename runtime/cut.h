/* cut.h - where a picture stops: instances too small to be seen are drawn as the boxes of their states (--detail).
 *
 * In a scene with a cut-off (states->cuts) every instance of a state is passed through its *gate*, and the gates are part of
 * the normative hit: an accelerator that comes to an instance, with the ray mapped there step by step, asks
 *
 *     switch (pl_query_gate(query, states, &arrival, &t_entry, &inside)) {
 *     case PL_GATE_MISSED: leave the instance out
 *     case PL_GATE_OPEN:   go on with its items, instances among them within the span `inside`
 *     case PL_GATE_CUT:    pl_query_cut(…), which draws it or leaves it out
 *     }
 *
 * and otherwise may filter as it likes as long as it doesn't leave out an instance that would pass all gates on its path.
 * So a hit with cut-offs depends on the path alone, and boxes of items must hold the whole boxes of their states
 * (pl_item_box). What is open at a gate is decided in double from the mapped ray, the state's own box, the span of t in
 * which the ray is within the boxes of all instances above, and the product of the stretches of the transformations on
 * the path, outermost first, starting from 1. Boxes of states need not lie within those of the states that enter them; the
 * span cuts off what doesn't, so that boxes may be left out with all that stands in them. It leaves a little room, so
 * that it changes nothing where a box does lie within.
 *
 * An instance is cut when diameter · stretch <= PX · footprint(t at the box's entry): then no point of it is farther than
 * that from the box's entry. The footprint is a pixel's width at that distance. In endless states an instance
 * is cut as well where its diameter falls to what rounding blurs: below, nothing could be told apart.
 *
 * What is cut keeps its coverage: the share of the box's silhouette that the state itself covers, by direction
 * (coverage.c). The box is drawn with that probability, decided by a hash of the path and the ray (stochastic transparency:
 * Enderton, Sintorn, Shirley & Luebke 2010), so that means over rays are right: one sample a pixel is no noisier than
 * one sample of the geometry itself, and antialiasing converges. Deciding once an instance (Cook, Halstead, Planck & Ryu 2007)
 * makes a small object appear whole or not at all; a blend would need all boxes on the ray in order instead of the nearest. */
#ifndef PL_CUT_H
#define PL_CUT_H

#include "state.h"

/* An endless state is cut where its box is no larger than so many times what rounding can move a ray by. */
#define PL_CUT_BLUR 16.0

/* PX footprints, in scene units, at t are width + spread · t; entries at t <= skip lie within the ray's first footprint. */
typedef struct pl_footprint {
    double width, spread, skip;
} pl_footprint;

/* Along bevels slack is so many times as large: sums of coordinates are as far off as these together, and round. */
#define PL_BEVEL_SLACK 4.0

/* Of t, in which a ray is within the boxes of the instances passed so far. */
typedef struct pl_span {
    double enter, leave;
} pl_span;

typedef enum pl_gate { PL_GATE_MISSED, PL_GATE_OPEN, PL_GATE_CUT } pl_gate;

/* What a gate knows of an instance. Where it is known of a class, the box lacks edges and corners: what stands beyond planes
 * across them, in the directions to a cube's edges and corners, doesn't belong to it. */
enum { PL_GATE_BEVELS = 10 };
typedef struct pl_gate_box {
    pl_box box;
    pl_reach reach;
    double diameter;
    bool unbounded, endless, bevelled;
    float low[PL_GATE_BEVELS], high[PL_GATE_BEVELS]; /* along pl_gate_bevels of points */
} pl_gate_box;

/* A vector along the directions of bevels: x+y, x-y, x+z, x-z, y+z, y-z, x+y+z, x+y-z, x-y+z, x-y-z. */
static inline void pl_gate_bevels(const double v[3], double along[PL_GATE_BEVELS])
{
    along[0] = v[0] + v[1];
    along[1] = v[0] - v[1];
    along[2] = v[0] + v[2];
    along[3] = v[0] - v[2];
    along[4] = v[1] + v[2];
    along[5] = v[1] - v[2];
    along[6] = along[0] + v[2];
    along[7] = along[0] - v[2];
    along[8] = along[1] + v[2];
    along[9] = along[1] - v[2];
}

pl_gate pl_gate_at(const pl_gate_box *box, const double o[3], const double d[3], double stretch,
                   const pl_footprint *footprint, pl_span within, double t_min, double t_max, double *t_entry,
                   pl_span *inside);

/* [t_enter, t_leave] of the box within `within`: an instance that this leaves nothing of is missed. */
pl_span pl_gate_span(const pl_gate_box *gate, const double o[3], const double d[3], pl_span within);

/* *inside of an open gate; nothing (enter > leave) only where the instance is missed. */
pl_span pl_span_below(const pl_gate_box *gate, const double o[3], const double d[3], pl_span within);

/* The same for a shared state. stretch: the product of the stretches on the path. within: the span above, at first that of the whole scene's box
 * (pl_span_in of state 0) within the ray's t_min and INFINITY.
 * t_max only saves work. Where the gate is open, *inside is the span for what stands below. */
pl_gate pl_gate_of(const pl_states *states, uint32_t state, const double o[3], const double d[3], double stretch,
                   const pl_footprint *footprint, pl_span within, double t_min, double t_max, double *t_entry,
                   pl_span *inside);

/* The span below an instance, whatever its gate: that of the instance's box with room, within the one above. What is unbounded has
 * the box of what isn't: spans are for gates, and what has no bounds has none. */
pl_span pl_span_in(const pl_states *states, uint32_t state, const double o[3], const double d[3], pl_span within);

/* A hash of a path's terms: a polynomial in PL_CUT_BASE modulo 2^64, so that those of two stretches of a path can be joined:
 * hash · PL_CUT_BASE^(terms of the second) + hash of the second. pl_cut_hash goes on from a hash with more terms; it is 0 at
 * the root. */
#define PL_CUT_BASE UINT64_C(0x9E3779B97F4A7C15)
uint64_t pl_cut_hash(uint64_t hash, const uint32_t *terms, uint32_t count);

/* A ray's key: a pure function of its origin and direction in the world. */
uint64_t pl_cut_ray(const double origin[3], const double direction[3]);

/* In [0, 1), a pure function of path and ray: a cut instance is drawn if its state covers more than that. hash: of the path's
 * terms; depth: symbols entered on it, the state's own included; ray: pl_cut_ray. */
double pl_cut_chance(uint64_t hash, uint32_t depth, uint64_t ray);

#endif
