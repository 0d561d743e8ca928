/* lazy.h - states unfolded on first touch, kept in a cache of fixed size.
 *
 * Where every plant is its own (a live random key) or updates don't commute, there are too many states to build. Then a
 * state is unfolded one application at a time, when a ray comes to it: its items, each with a box from the
 * classes (class.h), which are conservative without anything below being unfolded. What isn't in use is thrown out by the
 * clock when the budget is used up, and unfolded again when it is needed: a state is a pure function of its key.
 *
 *     pl_lazy_state *state = pl_lazy_get(cache, unfolder, symbol, scope, &work, error);     pinned
 *     …
 *     pl_lazy_release(state);
 *
 * Shared by all threads: shards by key, each with a lock; an unfolding holds none. */
#ifndef PL_LAZY_H
#define PL_LAZY_H

#include <stdatomic.h>

#include "../class.h"
#include "accel.h"

/* A box that shrinks while others read it, as more is learnt of what it holds: each plane holds by itself, so whatever mixture
 * of old and new planes is read does. */
typedef struct pl_shrinking_box {
    _Atomic double lo[3], hi[3];
} pl_shrinking_box;

typedef struct pl_lazy_item {
    pl_item item; /* of an enter item, `what` is the symbol's node */
    pl_shrinking_box *box; /* in the state's frame */
    pl_reach reach;
    bool unbounded;
    const uint64_t *scope; /* of an enter item: packed, as it is there */
    const pl_gate_box *gate; /* of an enter item, with cut-offs; else NULL */
} pl_lazy_item;

typedef struct pl_lazy_state {
    struct pl_lazy_state *next; /* in its bucket */
    uint64_t hash;
    uint32_t symbol, key_words, item_count;
    atomic_uint pins;
    atomic_bool touched;
    size_t bytes;
    pl_reach reach; /* of all its items */
    const uint64_t *key;
    const pl_lazy_item *items;
} pl_lazy_state;

static inline pl_box pl_lazy_box(const pl_lazy_item *item)
{
    pl_box box;
    for (int axis = 0; axis < 3; axis++) {
        box.lo[axis] = atomic_load_explicit(&item->box->lo[axis], memory_order_relaxed);
        box.hi[axis] = atomic_load_explicit(&item->box->hi[axis], memory_order_relaxed);
    }
    return box;
}

/* A state was unfolded by way of an item: its items' boxes bound the item's. Returns whether that made it much smaller. */
bool pl_lazy_shrink(const pl_lazy_item *item, const pl_lazy_state *state);

typedef struct pl_lazy_cache pl_lazy_cache;
typedef struct pl_unfolder pl_unfolder; /* a thread's working memory */

/* What a scene's budget leaves for states and classes. */
size_t pl_lazy_budget(const pl_scene *scene);

pl_lazy_cache *pl_lazy_cache_create(const pl_scene *scene, size_t limit, pl_error *error);
void pl_lazy_cache_free(pl_lazy_cache *cache);

pl_unfolder *pl_unfolder_create(const pl_scene *scene, pl_error *error);
void pl_unfolder_free(pl_unfolder *unfolder);

/* The state that a packed scope leads to at a symbol (UINT32_MAX, NULL: the scene itself), pinned. NULL: an error. *work grows
 * by the nodes that were visited to unfold it and to bound what it consists of; is_new: it was unfolded. */
pl_lazy_state *pl_lazy_get(pl_lazy_cache *cache, pl_unfolder *unfolder, uint32_t symbol, const uint64_t *scope,
                           uint64_t *work, bool *is_new, pl_error *error);
void pl_lazy_release(pl_lazy_state *state);

/* The coverage (cut.h) of the state that a packed scope leads to at a symbol, from a direction of its frame. */
double pl_lazy_coverage(pl_unfolder *unfolder, uint32_t symbol, const uint64_t *scope, const double d[3]);

typedef struct pl_lazy_counts {
    uint64_t states, bytes, found, unfolded, evicted, classes, classes_emptied, classes_visited;
} pl_lazy_counts;
void pl_lazy_count(pl_lazy_cache *cache, pl_lazy_counts *counts);

pl_classes *pl_lazy_classes(pl_lazy_cache *cache);

#endif
