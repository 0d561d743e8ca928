/* cut.c - the gates of instances (cut.h). */
#include "cut.h"

#include "random.h"

/* An endless state is cut where its box is smaller than so many times what rounding can move a ray by. */
#define BLUR 16.0

pl_gate pl_gate_of(const pl_states *states, uint32_t state, const double o[3], const double d[3], double stretch,
                   const pl_footprint *footprint, double t_min, double t_max, double *t_entry)
{
    const pl_state *s = &states->list[state];
    if (s->unbounded) return PL_GATE_OPEN;
    if (pl_box_is_empty(&s->box)) return PL_GATE_MISSED;
    double slack = pl_reach_slack(&s->gate, o);
    pl_slab slab = pl_slab_of(o, d, slack);
    if (!pl_slab_hits(&slab, &s->box, t_min, t_max, t_entry)) return PL_GATE_MISSED;
    bool small = s->diameter * stretch <= footprint->width + footprint->spread * *t_entry;
    if (!small && !(s->endless && s->diameter <= BLUR * slack)) return PL_GATE_OPEN;
    /* From within, and within the footprint that a ray starts from, nothing is told of the box's sides. */
    return *t_entry > t_min && *t_entry > footprint->skip ? PL_GATE_CUT : PL_GATE_MISSED;
}

uint64_t pl_cut_hash(uint64_t hash, const uint32_t *terms, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) hash = pl_mix(hash, terms[i]);
    return hash;
}

uint64_t pl_cut_ray(const double origin[3], const double direction[3])
{
    uint64_t key = 0;
    for (int axis = 0; axis < 3; axis++) key = pl_mix(pl_mix(key, pl_bits(origin[axis])), pl_bits(direction[axis]));
    return key;
}

bool pl_cut_is_drawn(const pl_states *states, uint32_t state, const double d[3], uint64_t hash, uint32_t depth,
                     uint64_t ray)
{
    return pl_unit(pl_mix(pl_mix(hash, depth), ray)) < pl_coverage_of(states, state, d);
}
