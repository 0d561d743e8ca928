/* gated.h - bvh where there are cut-offs: fronts whose gates are all open are walked through as ever, others are avoided.
 *
 * Every state that rays can come to has *rungs*: fronts of K, K/4, K/16 … items and, at last, of its items alone
 * (K = 1). A front has walked through the gates (cut.h) of the states that stand opened in it, so it may be entered only
 * where they are open: where the smallest of them, `least`, is larger than any footprint on the ray's way through the
 * state's box. The kernel takes the largest rung of which this holds; the last one has no gates inside and may always be
 * entered. So what is far above the cut-off costs what it costs without one, a comparison aside.
 *
 * An instance has a gate of its own. The kernel goes in where it is clearly open; elsewhere pl_gated_arrive decides in
 * double, from the ray mapped down the path. What rungs there are never shows in a hit.
 *
 *     gated_build.c  the rungs, K, budget      gated_kernel.h  traversal      gated_packet.h  that of many rays at once
 *     gated.c        what is decided in double */
#ifndef PL_GATED_H
#define PL_GATED_H

#include "../cut.h"
#include "bvh.h"

/* From a front's state to one of its instances: the product of stretches, the hash of the terms (cut.h) with
 * PL_CUT_BASE to their number, and symbols entered. */
typedef struct pl_gated_link {
    double stretch;
    uint64_t hash, power;
    uint32_t depth;
} pl_gated_link;

typedef struct pl_gated_rung {
    pl_front front;        /* .front of its instances: a state */
    const pl_gated_link *links; /* of each instance */
    double least;          /* the smallest gate inside: diameter times stretch; INFINITY: none */
    float farthest;        /* from a distance of the ray's origin on (bvh.h) a gate inside may be cut for being a blur */
} pl_gated_rung;

typedef struct pl_gated_state {
    uint32_t first, count; /* rungs, the largest first */
    double diameter;
    double least;          /* of the first rung, and no more than the diameter */
    float farthest;        /* of its own gate, like a rung's … */
    float farthest_inside; /* … and of the first rung */
    bool unbounded;
    const uint8_t *nested; /* of each item: what it enters has its box within this state's (gated_build.c) */
    const float *bends;    /* of each item: how many times it may magnify rounding (gated_build.c) */
} pl_gated_state;

typedef struct pl_gated {
    pl_gated_state *states;
    pl_gated_rung *rungs;
    uint32_t count, capacity; /* of rungs */
    uint8_t *nested;
    float *bends; /* NULL: no state is endless */
    pl_fronts sums; /* counts and bytes of the rungs */
    size_t bytes;
} pl_gated;

/* A ray in the frame of a state, mapped down the path, and what gates need to know of the path. */
typedef struct pl_gated_place {
    double o[3], d[3], stretch, bend; /* bend: the product of the items' */
    pl_span within;  /* of the instances above, and of this one as far as it is needed */
    uint64_t serial; /* of the frame that this is the place in */
} pl_gated_place;

/* Of a path, which the rays of a packet have in common; .at is a single ray's. */
typedef struct pl_gated_frame {
    pl_frame at;
    const pl_gated_rung *rung;
    double stretch;  /* nearly the normative product */
    double to;       /* no gate below is entered later */
    uint64_t hash;   /* of the path to here */
    uint32_t depth;  /* symbols entered on it */
    uint64_t serial; /* no two frames of a tracer have the same */
} pl_gated_frame;

typedef struct pl_gated_work {
    const pl_states *states;
    pl_gated_frame *frames;
    pl_gated_place *places; /* of PL_LANES rays in each frame */
    unsigned lane;          /* the ray under way */
    uint64_t serial;        /* of the newest frame */
    uint64_t *stack;
    const pl_item **chain;
    size_t frame_capacity, stack_capacity, chain_capacity;
    pl_bvh_work *packets; /* of which only what belongs to packets is used */
} pl_gated_work;

/* The place of the ray under way in a frame: known if it has the frame's serial. */
static inline pl_gated_place *pl_gated_place_in(const pl_gated_work *work, uint32_t frame)
{
    return &work->places[(size_t)frame * PL_LANES + work->lane];
}

typedef bool pl_gated_kernel(pl_tracer *tracer, const pl_ray *ray, pl_query *query);
extern pl_gated_kernel pl_gated_trace_scalar, pl_gated_trace_avx2, pl_gated_trace_avx512;

/* Of several rays, whether or not they go the same way. */
extern pl_bvh_many_kernel pl_gated_packet_avx2;

/* The ray under way begins: its place in frame 0. */
void pl_gated_begin(pl_gated_work *work, const pl_ray *ray, double t_min);

/* Evaluates a primitive of a frame normatively and offers it. false: an error. */
bool pl_gated_candidate(pl_tracer *tracer, uint32_t frame, pl_ref ref, pl_query *query);

/* Decides at the gate of an instance, whose frame + 1 has its hash; where it is cut, offers its box. cut: if it isn't missed,
 * it is cut. 1: open, and the place in frame + 1 is known; 0: not; -1: an error. */
int pl_gated_arrive(pl_tracer *tracer, uint32_t frame, uint32_t instance, bool cut, pl_query *query);

/* Room for one more frame, for eight more entries above `top`; false: no memory. */
bool pl_gated_grow_frames(pl_gated_work *work, size_t count, pl_error *error);
bool pl_gated_grow_stack(pl_gated_work *work, size_t top, pl_error *error);

bool pl_gated_build(pl_scene *scene, pl_error *error);
void pl_gated_destroy(pl_scene *scene);

/* What was built, for the statistics. */
void pl_gated_count(const pl_scene *scene, pl_statistics *counts);

#endif
