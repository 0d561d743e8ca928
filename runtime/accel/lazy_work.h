/* lazy_work.h - what a tracer keeps while rays walk together through states that are unfolded on touch (lazy.c).
 *
 * Rays lie by fours in slots, one slot for each frame and each entry of the stack, which passes from an entry to the frame
 * that it becomes:
 *
 *     if (!take_slot(w, &slot, error)) …       room for rays; moves all
 *     take_ray(w, slot, ray, o, d);            one of them
 *     give_slot(w, slot); */
#ifndef PL_LAZY_WORK_H
#define PL_LAZY_WORK_H

#include <stdlib.h>

#include "../error.h"
#include "lazy.h"

/* Frames are the instances on one path from the root, so frame i is the parent of frame i + 1. */
typedef struct frame {
    pl_lazy_state *state; /* NULL: its half of the cache is gone */
    uint32_t symbol, terms; /* terms on the path up to here */
    uint32_t item;          /* of the frame before, by which this one was reached */
    uint32_t slot;          /* of its rays … */
    uint32_t rays;          /* … which of them came here … */
    uint32_t spanned;       /* … and whose `inside` is known */
    double stretch;         /* with cut-offs: the product of stretches */
} frame;

/* An item that is still to be visited. With cut-offs rays have gone as far as the gates of those that enter states: these say
 * more than boxes would, and most boxes that they meet have gates that they meet. */
typedef struct pending {
    double t_entry; /* the least of its rays' */
    double stretch;
    uint32_t frame, item, slot;
    uint32_t rays; /* that meet it … */
    uint32_t open; /* … and those for which the gate is clearly open */
    bool arrived;  /* rays have been mapped into the instance's frame */
} pending;

typedef struct work {
    pl_unfolder *unfolder;
    pl_lazy_half *half;
    const pl_lazy_kernel *kernel;
    pl_query *queries;
    pl_lazy_wants wants;
    uint32_t fours, all; /* of rays, and all of these */
    uint32_t part; /* limits are divided by it */
    frame *frames;
    pl_span *inside; /* with cut-offs: of what stands below a frame, for each ray of the fours */
    pending *stack;
    uint64_t *scope, *scopes; /* packed: of what is to be unfolded; of frames whose states were let go */
    pl_lazy_four *slots; /* `fours` each … */
    uint32_t *free_slots; /* … of which these aren't used */
    pl_path path; /* to the last frame */
    size_t frame_count, frame_capacity, inside_capacity, stack_count, stack_capacity, scope_capacity;
    size_t slot_count, slot_capacity, free_count, free_capacity;
    size_t scope_words;
    uint64_t spent, found; /* for these rays */
    uint32_t unknown, changes; /* of the half */
} work;

static inline bool grow(void *array, size_t count, size_t *capacity, size_t element, pl_error *error)
{
    void **place = array, *data;
    if (count < *capacity) return true;
    size_t more = 2 * count + 64;
    if (!(data = realloc(*place, more * element))) return pl_fail_memory(error, "tracing a ray");
    *place = data;
    *capacity = more;
    return true;
}

static inline pl_lazy_four *rays_at(const work *w, uint32_t slot)
{
    return w->slots + (size_t)slot * w->fours;
}

static inline pl_span *inside_of(const work *w, size_t index, uint32_t ray)
{
    return w->inside + index * 4 * w->fours + ray;
}

/* Room for rays; pointers to others' end. */
static inline bool take_slot(work *w, uint32_t *slot, pl_error *error)
{
    if (w->free_count) {
        *slot = w->free_slots[--w->free_count];
        return true;
    }
    *slot = (uint32_t)w->slot_count;
    if (!grow(&w->slots, (w->slot_count + 1) * w->fours, &w->slot_capacity, sizeof *w->slots, error) ||
        !grow(&w->free_slots, w->slot_count, &w->free_capacity, sizeof *w->free_slots, error))
        return false;
    w->slot_count++;
    return true;
}

static inline void give_slot(work *w, uint32_t slot)
{
    w->free_slots[w->free_count++] = slot;
}

/* One of the rays at a slot. */
static inline void take_ray(const work *w, uint32_t slot, uint32_t ray, double o[3], double d[3])
{
    const pl_lazy_four *four = rays_at(w, slot) + ray / 4;
    for (int axis = 0; axis < 3; axis++) {
        o[axis] = four->o[axis][ray % 4];
        d[axis] = four->d[axis][ray % 4];
    }
}

/* After a leaf was offered: what the ray still wants. */
static inline void update(work *w, uint32_t ray)
{
    w->wants.t_max[ray] = w->queries[ray].done ? -INFINITY : w->queries[ray].t_max;
    if (w->queries[ray].done) w->all &= ~(UINT32_C(1) << ray);
}

/* The first of some rays, which is left out of them. */
static inline uint32_t next_ray(uint32_t *rays)
{
    const uint32_t ray = (uint32_t)__builtin_ctz(*rays);
    *rays &= *rays - 1;
    return ray;
}

#endif
