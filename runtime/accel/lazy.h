/* lazy.h - states unfolded on first touch, kept in a cache of fixed size.
 *
 * Where every plant is its own (a live random key) or updates don't commute, there are too many states to build. Then a
 * state is unfolded one application at a time, when a ray comes to it: its items, each with a box from the
 * classes (class.h), which are conservative without anything below being unfolded. An item points at the state that it
 * enters as soon as that is unfolded, so a ray goes down a tree without looking anything up.
 *
 * What states of a symbol with the same live parameters have in common is their pattern: all but the random key, the states below
 * and the transformations that draw. Where draws decide nothing else, as in a tree whose branches sway, a pattern is derived once
 * and a state is made of it by drawing.
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

/* A transformation on the way to an item. */
typedef struct pl_lazy_link {
    const pl_transform *transform; /* NULL: each state's own. to_object and form; the rest isn't kept */
    union {
        double stretch; /* with cut-offs */
        uint32_t drawn; /* which of the state's */
    };
} pl_lazy_link;

/* A primitive, a mesh or an instance of a state below some transformations. */
typedef struct pl_lazy_item {
    float box[6]; /* lo, hi: in the state's frame, if it is `boxed` */
    uint8_t kind; /* as pl_item */
    bool no_shadow, unbounded, boxed;
    bool whole; /* the box holds all that may be drawn; else only the primitives, but what is drawn has some of them in it */
    uint32_t what; /* of an enter item: the symbol's node */
    uint32_t link_count, term_count;
    const pl_lazy_link *links; /* outermost first */
    const uint32_t *terms;
    union {
        const double *arguments; /* of a primitive */
        const pl_gate_box *gate; /* of an enter item: its state's */
    };
    const uint64_t *scope; /* of an enter item: packed, as it is there; in a shared pattern but for the key */
} pl_lazy_item;

/* A transformation that draws: its code, run below these terms of the application with these parameters. */
typedef struct pl_lazy_draw {
    uint32_t node, term_count;
    const uint32_t *terms;
    double *parameters;
} pl_lazy_draw;

typedef struct pl_lazy_pattern {
    uint32_t symbol, live_count, item_count, draw_count;
    bool shared;    /* by all states of the symbol with the same live parameters; else one state's alone */
    uint64_t work;  /* of a derivation */
    pl_reach reach; /* of all items with boxes */
    const uint64_t *live;
    const pl_lazy_draw *draws;
    pl_lazy_item items[];
} pl_lazy_pattern;

/* Behind the states below, a state has its drawn transformations, each with its stretch behind what tracing needs of it: all
 * before to_parent (program.h). */
struct pl_lazy_state {
    pl_lazy_state *next; /* in its bucket */
    uint64_t hash, key;  /* the random key; 0: draws don't matter */
    const pl_lazy_pattern *pattern;
    bool singular; /* one of the drawn transformations is */
    _Atomic(pl_lazy_state *) below[]; /* of each enter item; NULL: not unfolded yet */
};

#define PL_LAZY_MAP_BYTES offsetof(pl_transform, to_parent)
#define PL_LAZY_DRAWN_BYTES (PL_LAZY_MAP_BYTES + sizeof(double))

static inline const pl_transform *pl_lazy_transform(const pl_lazy_state *state, const pl_lazy_link *link)
{
    if (link->transform) return link->transform;
    return (const pl_transform *)((const char *)&state->below[state->pattern->item_count] + link->drawn * PL_LAZY_DRAWN_BYTES);
}

static inline double pl_lazy_stretch(const pl_lazy_state *state, const pl_lazy_link *link)
{
    if (link->transform) return link->stretch;
    return *(const double *)((const char *)pl_lazy_transform(state, link) + PL_LAZY_MAP_BYTES);
}

typedef struct pl_lazy_cache pl_lazy_cache;
typedef struct pl_lazy_half pl_lazy_half;
typedef struct pl_unfolder pl_unfolder; /* a thread's working memory (lazy_unfold.c) */

/* What a scene's budget leaves for states and classes. */
size_t pl_lazy_budget(const pl_scene *scene);

/* The classes' share of it. */
size_t pl_lazy_class_budget(size_t limit);

pl_lazy_cache *pl_lazy_cache_create(const pl_scene *scene, size_t limit, pl_error *error);
void pl_lazy_cache_free(pl_lazy_cache *cache);

/* The half that is being filled, whose states stay until it is released. It may be changed for another one when it is
 * full, which waits for rays that still stand in that; then all states are gone that the ray has come to. */
pl_lazy_half *pl_lazy_hold(pl_lazy_cache *cache);
pl_lazy_half *pl_lazy_change(pl_lazy_cache *cache, pl_lazy_half *half);
void pl_lazy_release(pl_lazy_cache *cache, pl_lazy_half *half);

/* The state that a packed scope leads to at a symbol (UINT32_MAX, NULL: the scene itself). again: no state points at it, since it
 * was let go. NULL: an error or, with `full` set, no room in the half. *work grows by the nodes that were visited to unfold it
 * and to bound what it consists of. */
pl_lazy_state *pl_lazy_get(pl_lazy_cache *cache, pl_lazy_half *half, pl_unfolder *unfolder, uint32_t symbol,
                           const uint64_t *scope, bool again, uint64_t *work, bool *full, pl_error *error);

/* The coverage (cut.h) of the state that a packed scope leads to at a symbol, from a direction of its frame. */
double pl_lazy_coverage(pl_unfolder *unfolder, uint32_t symbol, const uint64_t *scope, const double d[3]);

typedef struct pl_lazy_counts {
    uint64_t states, bytes, found, unfolded, evicted, classes, visited;
} pl_lazy_counts;
void pl_lazy_count(pl_lazy_cache *cache, pl_lazy_counts *counts);

/* Adds to the times that a ray came to a state that was there. */
void pl_lazy_add_found(pl_lazy_cache *cache, uint64_t found);

pl_classes *pl_lazy_classes(pl_lazy_cache *cache);

/* --- lazy_unfold.c --- */

pl_unfolder *pl_unfolder_create(const pl_scene *scene, pl_error *error);
void pl_unfolder_free(pl_unfolder *unfolder);

/* --- lazy_pattern.c --- */

/* The key of the state that a packed scope leads to: its random key (0: draws don't matter) and live parameters; NULL: no memory. */
const uint64_t *pl_unfolder_key(pl_unfolder *unfolder, uint32_t symbol, const uint64_t *scope, uint32_t *words);

/* Prepares the state whose key was asked for last, and what it takes in bytes. epoch: of the half that it will be written to; what is
 * known of patterns in others isn't used. */
bool pl_unfolder_prepare(pl_unfolder *unfolder, uint32_t symbol, pl_classes *classes, uint64_t epoch, size_t *bytes, uint64_t *work,
                         pl_error *error);

/* Writes it to memory of so many bytes; NULL: an error. */
pl_lazy_state *pl_unfolder_write(pl_unfolder *unfolder, uint32_t symbol, void *memory, pl_error *error);

/* The packed scope of an enter item of a state. */
void pl_lazy_scope(const pl_program *program, const pl_lazy_state *state, const pl_lazy_item *it, size_t words, uint64_t *scope);

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
    /* Maps them into the frame of a state's item. */
    void (*map)(const pl_lazy_state *state, const pl_lazy_item *it, const pl_lazy_four *from, pl_lazy_four *to, uint32_t rays);
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
