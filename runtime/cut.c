/* cut.c - the gates of instances (cut.h). */
#include "cut.h"

#include <string.h>

#include "random.h"

/* How much wider boxes are where they end what stands below: for its own slack, and for roundings of composed maps. */
#define ROOM_SLACK 4.0
#define ROOM_SIZE 0x1p-30

/* In line, since a span that is returned in registers is put together again through memory, which stalls. */
static inline __attribute__((always_inline)) pl_span clip(const pl_box *box, const double o[3], const double d[3], double slack,
                                                          pl_span within)
{
    const pl_slab slab = pl_slab_of(o, d, slack);
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

/* Bevels in pairs: v along x + y and x - y, and so on, in their order. */
typedef double pair __attribute__((vector_size(16)));
typedef long long pair_mask __attribute__((vector_size(16)));
typedef float pair_single __attribute__((vector_size(8)));
enum { PAIRS = PL_GATE_BEVELS / 2 };

static inline void pairs_along(const double v[3], pair along[PAIRS])
{
    const pair x = {v[0], v[0]}, y = {v[1], v[1]}, plus_minus_y = {v[1], -v[1]}, plus_minus_z = {v[2], -v[2]};
    along[0] = x + plus_minus_y;
    along[1] = x + plus_minus_z;
    along[2] = y + plus_minus_z;
    along[3] = (pair){along[0][0], along[0][0]} + plus_minus_z;
    along[4] = (pair){along[0][1], along[0][1]} + plus_minus_z;
}

static inline pair pick(pair_mask first, pair a, pair b)
{
    return (pair)(((pair_mask)a & first) | ((pair_mask)b & ~first));
}

static inline pair pair_of(const float *at)
{
    pair_single two;
    memcpy(&two, at, sizeof two);
    return __builtin_convertvector(two, pair);
}

static inline __attribute__((always_inline)) pl_span clip_bevels(const pl_gate_box *gate, const double o[3], const double d[3],
                                                                 double slack, pl_span within)
{
    pair at[PAIRS], along[PAIRS], enter = {within.enter, within.enter}, leave = {within.leave, within.leave};
    const double room = PL_BEVEL_SLACK * slack;
    pairs_along(o, at);
    pairs_along(d, along);
    for (int i = 0; i < PAIRS; i++) {
        const pair inverse = 1.0 / along[i];
        const pair low = (pair_of(gate->low + 2 * i) - room - at[i]) * inverse;
        const pair high = (pair_of(gate->high + 2 * i) + room - at[i]) * inverse;
        const pair_mask back = inverse < 0.0;
        const pair near = pick(back, high, low), far = pick(back, low, high);
        /* A ray in a plane gives NaN, which is left aside; along -0 as well as along 0 it is between planes or not. */
        enter = pick(near > enter, near, enter);
        leave = pick(far < leave, far, leave);
    }
    within.enter = enter[0] > enter[1] ? enter[0] : enter[1];
    within.leave = leave[0] < leave[1] ? leave[0] : leave[1];
    return within;
}

static inline __attribute__((always_inline)) pl_span clip_gate(const pl_gate_box *gate, const double o[3], const double d[3],
                                                               double slack, pl_span within)
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
    /* Boxes below may stick out of this one by a rounding: what they hold is left out only beyond the room for it. */
    *inside = pl_span_below(s, o, d, within);
    if (!(inside->enter <= inside->leave && inside->enter <= t_max)) return PL_GATE_MISSED;
    const pl_span own = clip_gate(s, o, d, slack, within);
    const bool met = own.enter <= own.leave;
    *t_entry = met ? own.enter : inside->enter;
    bool small = s->diameter * stretch <= footprint->width + footprint->spread * *t_entry;
    if (!small && !(s->endless && s->diameter <= PL_CUT_BLUR * slack)) return PL_GATE_OPEN;
    /* From within, and within the footprint that a ray starts from, nothing is told of the box's sides. */
    return met && own.enter <= t_max && own.enter > t_min && own.enter > footprint->skip ? PL_GATE_CUT : PL_GATE_MISSED;
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
