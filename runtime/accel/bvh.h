/* bvh.h - traversal of fronts: frames, the kernels that filter, and the evaluation of what they leave.
 *
 * kernel.h holds the traversal; kernel_*.c compile it for an instruction set each. bvh.c evaluates candidates in double. */
#ifndef PL_BVH_H
#define PL_BVH_H

#include "front.h"

/* An instance of a front on the way from the root, with the ray in its unit frame. The ray comes down by composed matrices,
 * which filter only; `error` bounds how far its points lie from those of the normative ray, which is mapped down the
 * path one transformation after another when a candidate needs it. */
typedef struct pl_frame {
    double o[4], d[4]; /* at t0; the fourth numbers mean nothing */
    double t0, rate;   /* local t: (t - t0) * rate */
    const pl_front *front;
    float error, distance; /* distance: no less than the ray's whole origin has */
    float slack;           /* no hit lies farther outside its item */
    bool blind;            /* the ray can't be told in single precision: it meets everything */
    bool mapped;           /* normative_… are known */
    uint32_t instance;
    float origin[4], direction[4], inverse[4];
    float near_base[4], far_base[4];      /* (origin moved by the slack) / direction */
    uint32_t near_row[4], far_row[4];     /* offsets of a node's planes, in floats */
    double normative_o[4], normative_d[4];
} pl_frame;

enum {
    PL_LANES = PL_TRACE_MANY,
    PL_LEAST_LANES = 4 /* fewer rays don't gain from going together */
};

typedef struct pl_lanes {
    double o[3][PL_LANES], d[3][PL_LANES];
} pl_lanes;

/* Intervals of what nodes need of a packet's rays. A plane's distances from the origins lie on one side of that from near_o or
 * far_o, and t is extreme at one end of the inverses. */
typedef struct pl_beam {
    float near_o[3], far_o[3], least[3], most[3];
    uint32_t near_row[3], far_row[3]; /* offsets of a node's planes, in floats */
} pl_beam;

/* The same of a packet of rays, which share t0: axis by axis. front and instance stand in the frame of the same number. */
typedef struct pl_packet_frame {
    double o[3][PL_LANES], d[3][PL_LANES];
    float origin[3][PL_LANES], direction[3][PL_LANES], inverse[3][PL_LANES], t_max[PL_LANES];
    double t0, rate;
    const pl_front *front;
    float error, distance, slack; /* the largest */
    float most;      /* of t_max */
    unsigned lanes;  /* those that meet the box */
    unsigned mapped; /* fours of rays that normative is known of */
    uint32_t instance;
    uint32_t answers; /* of the work when t_max and lanes were set last */
    bool each;  /* nodes are told for each ray, by what a pl_frame has … */
    bool alike; /* … and the signs of all lanes' directions agree … */
    float near_base[3][PL_LANES], far_base[3][PL_LANES];
    uint32_t near_row[3][PL_LANES];
    pl_beam beam; /* … else for the beam of all lanes */
    pl_lanes normative;
} pl_packet_frame;

/* A ray's own memory. */
typedef struct pl_bvh_lane {
    pl_frame *frames;
    uint64_t *stack; /* local t of entry as float bits, reference below */
    size_t frame_capacity, stack_capacity;
} pl_bvh_lane;

typedef struct pl_bvh_work {
    const pl_states *states;
    struct pl_bvh_legs *legs; /* bvh_legs.c */
    pl_bvh_lane lanes[PL_LANES]; /* the first one for single rays, the others from when they are needed */
    const pl_transform **chain;
    size_t chain_capacity;
    pl_packet_frame *packets;
    uint64_t *packet_stack;
    uint32_t *packet_lanes; /* of its entries */
    size_t packet_capacity, packet_stack_capacity, packet_lanes_capacity;
    uint32_t answers;    /* that a packet's queries got: as long as there are no more of them, nothing has changed */
    unsigned alone;      /* rays of a packet that go on one by one, the lowest first, its normative ray not yet told; or 0 */
    uint32_t alone_from; /* … from this frame on */
} pl_bvh_work;

typedef bool pl_bvh_kernel(pl_tracer *tracer, const pl_ray *ray, pl_query *query);
extern pl_bvh_kernel pl_bvh_trace_scalar, pl_bvh_trace_avx2, pl_bvh_trace_avx512;

/* Of several rays, whether or not they go the same way. */
typedef bool pl_bvh_many_kernel(pl_tracer *tracer, const pl_ray *rays, pl_query *queries, unsigned count);
extern pl_bvh_many_kernel pl_bvh_packet_avx2;
/* Rays that take steps in turn, at most PL_LANES. */
extern pl_bvh_many_kernel pl_bvh_stream_scalar, pl_bvh_stream_avx2, pl_bvh_stream_avx512;
/* Rays go well together as a packet where all directions lie about the first's, by this share of its size (sums of axes), and
 * origins no farther away than this share of half the size of what is traced: shadow rays of a tile begin far apart in depth. */
#define PL_ALIKE 0.125
#define PL_NEAR 1.0

/* Where a leaf is: frames 1 … frame of a lane, then a primitive. */
typedef struct pl_bvh_place {
    const pl_bvh_lane *lane;
    uint32_t frame;
    pl_ref ref;
} pl_bvh_place;

/* A primitive's leaf, but for the ray; place is kept. */
pl_leaf pl_bvh_leaf(const pl_scene *scene, const pl_item *item, const pl_bvh_place *place);

/* Offers a primitive of a frame with the normative ray in the primitive's own frame. */
bool pl_bvh_offer(pl_tracer *tracer, const pl_bvh_lane *lane, uint32_t frame, pl_ref ref, const pl_item *item,
                  const double o[3], const double d[3], pl_query *query);

/* The transformations on the way from a front's state to an item of an opened node and the leaf that it leads to (NULL: it is an
 * instance), into work->chain, the last one first. */
bool pl_bvh_chain(pl_bvh_work *work, const pl_front *front, uint32_t opened, const pl_item *item, const pl_item *leaf,
                  size_t *count, pl_error *error);

/* Whether a primitive of a frame is the one that the ray leaves (pl_ray): it needn't be evaluated. */
static inline bool pl_bvh_is_left(const pl_hit *hit, const pl_frame *frames, uint32_t frame, pl_ref ref)
{
    if (!hit || hit->trail.length != frame + 1 || hit->trail.terms[frame] != ref) return false;
    for (uint32_t i = 0; i < frame; i++)
        if (hit->trail.terms[i] != frames[i + 1].instance) return false;
    return true;
}

/* --- bvh_legs.c --- */

/* NULL: no memory. */
struct pl_bvh_legs *pl_bvh_legs_create(void);

/* pl_accel.legs */
bool pl_bvh_legs_of(pl_tracer *tracer, const pl_path *trail, pl_leg *legs);

/* Room for one more frame, for eight more entries above `top`; false: no memory. */
bool pl_bvh_grow_frames(pl_bvh_lane *lane, size_t count, pl_error *error);
bool pl_bvh_grow_stack(pl_bvh_lane *lane, size_t top, pl_error *error);
bool pl_bvh_grow_packets(pl_bvh_work *work, size_t count, pl_error *error);
bool pl_bvh_grow_packet_stack(pl_bvh_work *work, size_t top, pl_error *error);

#endif
