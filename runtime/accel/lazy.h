/* lazy.h - states unfolded on first touch, kept in a cache of fixed size.
 *
 * Where every plant is its own (a live random key) or updates don't commute, there are too many states to build. Then a
 * state is unfolded one application at a time, when a ray comes to it: its items, each with a box from the
 * classes (class.h), which are conservative without anything below being unfolded. An item points at the state that it
 * enters as soon as that is unfolded, so a ray goes down a tree without looking anything up.
 *
 * The cache has two halves. States are put into one of them; when it is full the other one is emptied and taken instead. So
 * nothing points at what is gone, as long as no ray stands in both: a ray holds one half at a time, and when that changes
 * it lets go of all states and finds them again by their scopes, or unfolds them again. A state is a pure function of its key.
 *
 *     pl_lazy_half *half = pl_lazy_hold(cache);                                 a ray begins
 *     pl_lazy_state *state = pl_lazy_get(cache, half, unfolder, symbol, scope, …);
 *     half = pl_lazy_change(cache, half);                                       where there was no room
 *     pl_lazy_release(cache, half);                                             it ends
 *
 * Shared by all threads; an unfolding holds no lock. */
#ifndef PL_LAZY_H
#define PL_LAZY_H

#include <stdatomic.h>

#include "../class.h"
#include "accel.h"

typedef struct pl_lazy_state pl_lazy_state;

/* A primitive, a mesh or an instance of a state below some transformations. */
typedef struct pl_lazy_item {
    float box[6]; /* lo, hi: in the state's frame, if it is `boxed` */
    uint8_t kind; /* as pl_item */
    bool no_shadow, unbounded, boxed;
    bool whole; /* the box holds all that may be drawn; else only the primitives, but what is drawn has some of them in it */
    uint32_t what; /* of an enter item: the symbol's node */
    uint32_t transform_count, term_count;
    const pl_transform *const *transforms; /* to_object and form; the rest isn't kept */
    const uint32_t *terms;
    union {
        const double *arguments; /* of a primitive */
        const pl_gate_box *gate; /* of an enter item: its state's */
    };
    /* Of an enter item: */
    const uint64_t *scope; /* packed, as it is there */
    _Atomic(pl_lazy_state *) state; /* NULL: not unfolded yet */
} pl_lazy_item;

struct pl_lazy_state {
    pl_lazy_state *next; /* in its bucket */
    uint64_t hash;
    uint32_t symbol, key_words, item_count;
    pl_reach reach; /* of all its items */
    const uint64_t *key;
    pl_lazy_item items[];
};

/* With cut-offs: the stretch of each of an enter item's transformations. */
static inline const double *pl_lazy_stretches(const pl_lazy_item *it)
{
    return (const double *)(it->transforms + it->transform_count);
}

typedef struct pl_lazy_cache pl_lazy_cache;
typedef struct pl_lazy_half pl_lazy_half;
typedef struct pl_unfolder pl_unfolder; /* a thread's working memory (lazy_unfold.c) */

/* What a scene's budget leaves for states and classes. */
size_t pl_lazy_budget(const pl_scene *scene);

pl_lazy_cache *pl_lazy_cache_create(const pl_scene *scene, size_t limit, pl_error *error);
void pl_lazy_cache_free(pl_lazy_cache *cache);

/* The half that is being filled, whose states stay until it is released. It may be changed for another one when it is
 * full, which waits for rays that still stand in that; then all states are gone that the ray has come to. */
pl_lazy_half *pl_lazy_hold(pl_lazy_cache *cache);
pl_lazy_half *pl_lazy_change(pl_lazy_cache *cache, pl_lazy_half *half);
void pl_lazy_release(pl_lazy_cache *cache, pl_lazy_half *half);

/* The state that a packed scope leads to at a symbol (UINT32_MAX, NULL: the scene itself). NULL: an error or, with `full` set, no room in
 * the half. *work grows by the nodes that were visited to unfold it and to bound what it consists of. */
pl_lazy_state *pl_lazy_get(pl_lazy_cache *cache, pl_lazy_half *half, pl_unfolder *unfolder, uint32_t symbol,
                           const uint64_t *scope, uint64_t *work, bool *full, pl_error *error);

/* The coverage (cut.h) of the state that a packed scope leads to at a symbol, from a direction of its frame. */
double pl_lazy_coverage(pl_unfolder *unfolder, uint32_t symbol, const uint64_t *scope, const double d[3]);

typedef struct pl_lazy_counts {
    uint64_t states, bytes, found, unfolded, evicted, classes, classes_emptied, classes_visited;
} pl_lazy_counts;
void pl_lazy_count(pl_lazy_cache *cache, pl_lazy_counts *counts);

/* Adds to the times that a ray came to a state that was there. */
void pl_lazy_add_found(pl_lazy_cache *cache, uint64_t found);

pl_classes *pl_lazy_classes(pl_lazy_cache *cache);

/* --- lazy_unfold.c --- */

pl_unfolder *pl_unfolder_create(const pl_scene *scene, pl_error *error);
void pl_unfolder_free(pl_unfolder *unfolder);

/* The key of the state that a packed scope leads to; NULL: no memory. */
const uint64_t *pl_unfolder_key(pl_unfolder *unfolder, uint32_t symbol, const uint64_t *scope, uint32_t *words);

/* Derives the state whose key was asked for last, and what it takes in bytes. */
bool pl_unfolder_derive(pl_unfolder *unfolder, uint32_t symbol, pl_classes *classes, size_t *bytes, uint64_t *work,
                        pl_error *error);

/* Writes it to memory of so many bytes. */
pl_lazy_state *pl_unfolder_write(pl_unfolder *unfolder, uint32_t symbol, uint64_t hash, void *memory);

/* --- lazy_kernel.h, for each instruction set --- */

/* Four rays in the frame of an instance. */
typedef struct pl_lazy_four {
    double o[3][4], d[3][4];
    double enter[4]; /* where they enter what is to be visited next */
    double leave[4]; /* with cut-offs: from there on nothing stands below */
} pl_lazy_four;

/* What rays want: the queries' t and footprints; without a cut-off the latter are 0, so that all gates are clearly open. */
typedef struct pl_lazy_wants {
    double t_min[PL_TRACE_MANY], t_max[PL_TRACE_MANY], width[PL_TRACE_MANY], spread[PL_TRACE_MANY];
} pl_lazy_wants;

/* Of rays, a bit each, in fours. What is told of those that are left: `enter` of each, and *first, the least of these. */
typedef struct pl_lazy_kernel {
    /* Those that meet an item's box. */
    uint32_t (*clip)(const pl_lazy_item *it, const pl_reach *reach, double stretch, const pl_lazy_wants *wants,
                     const pl_lazy_four *from, pl_lazy_four *to, uint32_t rays, double *first);
    /* Maps them into an item's frame. */
    void (*map)(const pl_lazy_item *it, const pl_lazy_four *from, pl_lazy_four *to, uint32_t rays);
    /* Those that meet a gate, in whose frame they are; *open: those for which it is clearly open. from: above it. */
    uint32_t (*meet)(const pl_gate_box *gate, double stretch, const pl_lazy_wants *wants, const pl_lazy_four *from,
                     pl_lazy_four *to, uint32_t rays, uint32_t *open, double *first);
    /* Sets `enter` where nothing is known; the least. */
    double (*begin)(const pl_lazy_wants *wants, pl_lazy_four *to, uint32_t rays);
    /* Those that enter before what they want ends. */
    uint32_t (*waiting)(const pl_lazy_wants *wants, const pl_lazy_four *at, uint32_t rays);
} pl_lazy_kernel;

extern const pl_lazy_kernel pl_lazy_kernel_scalar, pl_lazy_kernel_avx2, pl_lazy_kernel_avx512;

#endif
