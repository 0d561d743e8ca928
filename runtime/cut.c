/* cut.c - the gates of instances (cut.h). */
#include "cut.h"

#include "random.h"

/* How much wider boxes are where they end what stands below: for its own slack, and for roundings of composed maps. */
#define ROOM_SLACK 4.0
#define ROOM_SIZE 0x1p-30

static pl_span clip(const pl_box *box, const double o[3], const double d[3], double slack, pl_span within)
{
    pl_slab slab = pl_slab_of(o, d, slack);
    for (int axis = 0; axis < 3; axis++) {
        double near_plane = slab.negative[axis] ? box->hi[axis] : box->lo[axis];
        double far_plane = slab.negative[axis] ? box->lo[axis] : box->hi[axis];
        double t_near = (near_plane - slab.near_origin[axis]) * slab.inverse[axis];
        double t_far = (far_plane - slab.far_origin[axis]) * slab.inverse[axis];
        within.enter = t_near > within.enter ? t_near : within.enter;
        within.leave = t_far < within.leave ? t_far : within.leave;
    }
    return within;
}

/* Sums of coordinates are as far off as these together, and round. */
#define BEVEL_SLACK 4.0

static pl_span clip_bevels(const pl_gate_box *gate, const double o[3], const double d[3], double slack, pl_span within)
{
    double at[PL_GATE_BEVELS], along[PL_GATE_BEVELS], enter[PL_GATE_BEVELS], leave[PL_GATE_BEVELS];
    pl_gate_bevels(o, at);
    pl_gate_bevels(d, along);
    for (int i = 0; i < PL_GATE_BEVELS; i++) {
        const double inverse = 1.0 / along[i];
        const double low = ((double)gate->low[i] - BEVEL_SLACK * slack - at[i]) * inverse;
        const double high = ((double)gate->high[i] + BEVEL_SLACK * slack - at[i]) * inverse;
        enter[i] = inverse < 0.0 ? high : low;
        leave[i] = inverse < 0.0 ? low : high;
    }
    /* A ray in a plane gives NaN, which is left aside; along -0 as well as along 0 it is between planes or not. */
    for (int i = 0; i < PL_GATE_BEVELS; i++) {
        within.enter = enter[i] > within.enter ? enter[i] : within.enter;
        within.leave = leave[i] < within.leave ? leave[i] : within.leave;
    }
    return within;
}

static pl_span clip_gate(const pl_gate_box *gate, const double o[3], const double d[3], double slack, pl_span within)
{
    within = clip(&gate->box, o, d, slack, within);
    return gate->bevelled && within.enter <= within.leave ? clip_bevels(gate, o, d, slack, within) : within;
}

static pl_span span_with_room(const pl_box *box, double diameter, const double o[3], const double d[3], double slack,
                              pl_span within)
{
    return clip(box, o, d, ROOM_SLACK * slack + ROOM_SIZE * diameter, within);
}

pl_span pl_span_in(const pl_states *states, uint32_t state, const double o[3], const double d[3], pl_span within)
{
    const pl_state *s = &states->list[state];
    return span_with_room(&s->bounds->box, s->bounds->diameter, o, d, pl_reach_slack(&s->bounds->gate, o), within);
}

pl_span pl_span_below(const pl_gate_box *gate, const double o[3], const double d[3], pl_span within)
{
    return clip_gate(gate, o, d, ROOM_SLACK * pl_reach_slack(&gate->reach, o) + ROOM_SIZE * gate->diameter, within);
}

pl_span pl_gate_span(const pl_gate_box *gate, const double o[3], const double d[3], pl_span within)
{
    return clip_gate(gate, o, d, pl_reach_slack(&gate->reach, o), within);
}

pl_gate pl_gate_at(const pl_gate_box *s, const double o[3], const double d[3], double stretch,
                   const pl_footprint *footprint, pl_span within, double t_min, double t_max, double *t_entry,
                   pl_span *inside)
{
    double slack = pl_reach_slack(&s->reach, o);
    if (s->unbounded) {
        *inside = pl_span_below(s, o, d, within);
        return PL_GATE_OPEN;
    }
    if (pl_box_is_empty(&s->box)) return PL_GATE_MISSED;
    pl_span own = clip_gate(s, o, d, slack, within);
    *t_entry = own.enter;
    if (!(own.enter <= own.leave && own.enter <= t_max)) return PL_GATE_MISSED;
    bool small = s->diameter * stretch <= footprint->width + footprint->spread * own.enter;
    if (!small && !(s->endless && s->diameter <= PL_CUT_BLUR * slack)) {
        *inside = pl_span_below(s, o, d, within);
        return PL_GATE_OPEN;
    }
    /* From within, and within the footprint that a ray starts from, nothing is told of the box's sides. */
    return own.enter > t_min && own.enter > footprint->skip ? PL_GATE_CUT : PL_GATE_MISSED;
}

pl_gate pl_gate_of(const pl_states *states, uint32_t state, const double o[3], const double d[3], double stretch,
                   const pl_footprint *footprint, pl_span within, double t_min, double t_max, double *t_entry,
                   pl_span *inside)
{
    const pl_state *s = &states->list[state];
    pl_gate_box box;
    box.box = s->bounds->box;
    box.reach = s->bounds->gate;
    box.diameter = s->bounds->diameter;
    box.unbounded = s->unbounded;
    box.endless = s->endless;
    box.bevelled = false;
    return pl_gate_at(&box, o, d, stretch, footprint, within, t_min, t_max, t_entry, inside);
}

uint64_t pl_cut_hash(uint64_t hash, const uint32_t *terms, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) hash = hash * PL_CUT_BASE + pl_mix(PL_CUT_BASE, terms[i]);
    return hash;
}

uint64_t pl_cut_ray(const double origin[3], const double direction[3])
{
    uint64_t key = 0;
    for (int axis = 0; axis < 3; axis++) key = pl_mix(pl_mix(key, pl_bits(origin[axis])), pl_bits(direction[axis]));
    return key;
}

double pl_cut_chance(uint64_t hash, uint32_t depth, uint64_t ray)
{
    return pl_unit(pl_mix(pl_mix(hash, depth), ray));
}
