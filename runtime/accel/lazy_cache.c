/* lazy_cache.c - unfolding one application of a state, and the cache of such states (lazy.h). */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "../array.h"
#include "../error.h"
#include "../random.h"
#include "lazy.h"

enum { SHARDS = 64, SHARD_BYTES = 1 << 17, OVERHEAD = 32, SMALLEST_BUDGET = 16384, MOST_LOOKED_AT = 64, BYTES_A_BUCKET = 1024 };

/* Of an event of the derivation, in nodes visited by a walk over a class. */
enum { EVENT_WORK = 4 };

typedef struct shard {
    pthread_mutex_t lock;
    pl_lazy_state **buckets;
    uint32_t bucket_count, hand;
    size_t bytes, limit;
    uint64_t states, found, unfolded, evicted;
} shard;

struct pl_lazy_cache {
    const pl_scene *scene;
    pl_classes *classes;
    uint32_t shard_count; /* few where the budget is small, so that each holds many states */
    shard shards[SHARDS];
};

/* Growing arrays of what is being unfolded; a draft refers to them by index. */
typedef struct draft {
    pl_lazy_item it;
    pl_box box;
    pl_gate_box gate;
    size_t transform_first, term_first, scope_first, scope_count;
} draft;

struct pl_unfolder {
    const pl_scene *scene;
    pl_walk walk;
    pl_scope scope;
    pl_array drafts, chain, transforms, computed, terms, scopes, key;
    uint64_t work;
    size_t entered; /* drafts of states */
};

/* A transformation of the current path: constant, or one of `computed`. */
typedef struct link {
    const pl_transform *constant;
    size_t computed;
} link_;

pl_unfolder *pl_unfolder_create(const pl_scene *scene, pl_error *error)
{
    pl_unfolder *u = calloc(1, sizeof *u);
    if (u) {
        u->scene = scene;
        u->drafts.element = sizeof(draft);
        u->chain.element = u->transforms.element = sizeof(link_);
        u->computed.element = sizeof(pl_transform);
        u->terms.element = sizeof(uint32_t);
        u->scopes.element = u->key.element = sizeof(uint64_t);
        u->scope.parameters = malloc((scene->program->parameter_count + 1) * sizeof(double));
    }
    if (u && u->scope.parameters && pl_walk_begin(&u->walk, scene->program, 0, NULL, error)) {
        u->walk.stretches = scene->gates != NULL;
        return u;
    }
    pl_unfolder_free(u);
    pl_fail_memory(error, "preparing to unfold");
    return NULL;
}

void pl_unfolder_free(pl_unfolder *u)
{
    if (!u) return;
    pl_walk_end(&u->walk);
    free(u->scope.parameters);
    pl_array *arrays[] = {&u->drafts, &u->chain, &u->transforms, &u->computed, &u->terms, &u->scopes, &u->key};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]->data);
    free(u);
}

/* --- unfolding --- */

static bool add_transform(pl_unfolder *u)
{
    link_ l = {u->walk.transform, 0};
    if (l.constant == &u->walk.computed) {
        pl_transform *kept = pl_array_extend(&u->computed, 1);
        if (!kept) return false;
        *kept = u->walk.computed;
        l = (link_){NULL, u->computed.count - 1};
    }
    u->chain.count = u->walk.at.marks[0]++;
    link_ *place = pl_array_extend(&u->chain, 1);
    if (place) *place = l;
    return place != NULL;
}

static const pl_transform *link_transform(const pl_unfolder *u, const link_ *l)
{
    return l->constant ? l->constant : (const pl_transform *)u->computed.data + l->computed;
}

/* The bounds of a draft in the state's frame. */
static void bound(pl_unfolder *u, pl_classes *classes, draft *d)
{
    pl_bounds bounds;
    const pl_item *item = &d->it.item;
    if (item->kind == PL_NODE_ENTER) {
        pl_classes_bound(classes, item->what, &u->walk.scope, &bounds, &u->work);
        d->gate = pl_bounds_gate(&bounds);
        if (u->scene->gates) bounds.reach = d->gate.reach;
    } else if (item->kind == PL_NODE_MESH) {
        pl_bounds_of_box(pl_mesh_box(u->scene->meshes[item->what]), &bounds);
    } else {
        pl_bounds_of_shape(pl_shape_of(item->what), item->arguments, item->arguments, &bounds);
    }
    const bool whole = u->scene->gates && item->kind == PL_NODE_ENTER;
    for (size_t i = item->transform_count; i-- > 0;)
        pl_bounds_through(link_transform(u, (const link_ *)u->chain.data + i), whole, &bounds);
    d->box = bounds.box;
    d->it.reach = bounds.reach;
    d->it.unbounded = bounds.unbounded;
}

static bool add_draft(pl_unfolder *u, pl_classes *classes, uint8_t kind, uint32_t what)
{
    const pl_walk *walk = &u->walk;
    draft d = {.it.item = {.kind = kind,
                           .no_shadow = walk->at.no_shadow,
                           .what = what,
                           .transform_count = walk->at.marks[0],
                           .term_count = walk->at.terms},
               .transform_first = u->transforms.count,
               .term_first = u->terms.count,
               .scope_first = u->scopes.count};
    if (kind == PL_NODE_PRIMITIVE) memcpy(d.it.item.arguments, walk->arguments, sizeof d.it.item.arguments);
    bound(u, classes, &d);
    link_ *transforms = pl_array_extend(&u->transforms, d.it.item.transform_count);
    uint32_t *terms = pl_array_extend(&u->terms, d.it.item.term_count);
    if (!transforms || !terms) return false;
    if (d.it.item.transform_count) memcpy(transforms, u->chain.data, d.it.item.transform_count * sizeof *transforms);
    if (d.it.item.term_count) memcpy(terms, walk->path.terms, d.it.item.term_count * sizeof *terms);
    u->entered += kind == PL_NODE_ENTER;
    if (kind == PL_NODE_ENTER) {
        d.scope_count = pl_scope_words(walk->program, &walk->scope) - walk->scope.draws;
        uint64_t *words = pl_array_extend(&u->scopes, d.scope_count);
        if (!words) return false;
        /* Draws end with the application. */
        pl_scope entered = walk->scope;
        entered.draws = 0;
        pl_scope_pack(walk->program, &entered, words);
    }
    draft *place = pl_array_extend(&u->drafts, 1);
    if (place) *place = d;
    return place != NULL;
}

static bool derive(pl_unfolder *u, pl_classes *classes, pl_error *error)
{
    bool ok = true;
    u->entered = u->drafts.count = u->chain.count = u->transforms.count = u->computed.count = u->terms.count = u->scopes.count = 0;
    while (ok) {
        u->work += EVENT_WORK;
        switch (pl_walk_next(&u->walk, error)) {
        case PL_EVENT_ERROR: return false;
        case PL_EVENT_END: return true;
        case PL_EVENT_TRANSFORM: ok = add_transform(u); break;
        case PL_EVENT_ENTER:
            ok = add_draft(u, classes, PL_NODE_ENTER, u->scene->program->nodes[u->walk.node].as.enter.symbol);
            pl_walk_prune(&u->walk);
            break;
        case PL_EVENT_PRIMITIVE: ok = add_draft(u, classes, PL_NODE_PRIMITIVE, u->walk.shape); break;
        case PL_EVENT_MESH: ok = add_draft(u, classes, PL_NODE_MESH, u->walk.mesh); break;
        default: break;
        }
    }
    return pl_fail_memory(error, "unfolding a state");
}

/* Everything of a state in one block of memory. */
static pl_lazy_state *assemble(pl_unfolder *u, uint32_t symbol, uint64_t hash)
{
    size_t drafts = u->drafts.count * sizeof(pl_lazy_item), computed = u->computed.count * sizeof(pl_transform);
    size_t transforms = u->transforms.count * sizeof(pl_transform *), scopes = u->scopes.count * sizeof(uint64_t);
    size_t key = u->key.count * sizeof(uint64_t), terms = u->terms.count * sizeof(uint32_t);
    size_t gates = u->scene->gates ? u->entered * sizeof(pl_gate_box) : 0;
    size_t boxes = u->drafts.count * sizeof(pl_shrinking_box);
    size_t bytes = sizeof(pl_lazy_state) + drafts + boxes + computed + gates + transforms + scopes + key + terms;
    pl_lazy_state *state = malloc(bytes);
    if (!state) return NULL;
    memset(state, 0, sizeof *state);
    char *at = (char *)(state + 1);
    pl_lazy_item *items = (pl_lazy_item *)at;
    pl_shrinking_box *box = (pl_shrinking_box *)(at += drafts);
    pl_transform *matrices = (pl_transform *)(at += boxes);
    pl_gate_box *gate = (pl_gate_box *)(at += computed);
    const pl_transform **list = (const pl_transform **)(at += gates);
    uint64_t *words = (uint64_t *)(at += transforms);
    uint64_t *key_words = (uint64_t *)(at += scopes);
    uint32_t *term_list = (uint32_t *)(at + key);
    if (computed) memcpy(matrices, u->computed.data, computed);
    if (scopes) memcpy(words, u->scopes.data, scopes);
    if (key) memcpy(key_words, u->key.data, key);
    if (terms) memcpy(term_list, u->terms.data, terms);
    for (size_t i = 0; i < u->transforms.count; i++) {
        const link_ *l = (const link_ *)u->transforms.data + i;
        list[i] = l->constant ? l->constant : matrices + l->computed;
    }
    for (size_t i = 0; i < u->drafts.count; i++) {
        const draft *d = (const draft *)u->drafts.data + i;
        items[i] = d->it;
        items[i].item.transforms = list + d->transform_first;
        items[i].item.terms = term_list + d->term_first;
        items[i].scope = words + d->scope_first;
        items[i].box = &box[i];
        for (int axis = 0; axis < 3; axis++) {
            atomic_init(&box[i].lo[axis], d->box.lo[axis]);
            atomic_init(&box[i].hi[axis], d->box.hi[axis]);
        }
        if (gates && d->it.item.kind == PL_NODE_ENTER) {
            *gate = d->gate;
            items[i].gate = gate++;
        }
        if (!d->it.unbounded) pl_reach_join(&state->reach, &d->it.reach);
    }
    state->hash = hash;
    state->symbol = symbol;
    state->item_count = (uint32_t)u->drafts.count;
    state->items = items;
    state->key = key_words;
    state->key_words = (uint32_t)u->key.count;
    state->bytes = bytes + OVERHEAD;
    atomic_init(&state->pins, 1);
    atomic_init(&state->touched, true);
    return state;
}

double pl_lazy_coverage(pl_unfolder *u, uint32_t symbol, const uint64_t *scope, const double d[3])
{
    pl_scope_unpack(u->scene->program, scope, &u->scope);
    return pl_covers_of(u->scene->covers, symbol, &u->scope, d);
}

/* Planes that move by less aren't worth telling those above. */
#define MUCH 0.02

bool pl_lazy_shrink(const pl_lazy_item *item, const pl_lazy_state *state)
{
    pl_box hull = pl_box_empty();
    for (uint32_t i = 0; i < state->item_count; i++) {
        pl_box box = pl_lazy_box(&state->items[i]);
        if (state->items[i].unbounded) return false;
        pl_box_join(&hull, &box);
    }
    for (uint32_t i = item->item.transform_count; i-- > 0;) pl_box_through(item->item.transforms[i], &hull);
    pl_box old = pl_lazy_box(item);
    bool much = false;
    for (int axis = 0; axis < 3; axis++) {
        const double least = MUCH * (old.hi[axis] - old.lo[axis]);
        if (hull.lo[axis] > old.lo[axis]) {
            atomic_store_explicit(&item->box->lo[axis], hull.lo[axis], memory_order_relaxed);
            much = much || hull.lo[axis] > old.lo[axis] + least;
        }
        if (hull.hi[axis] < old.hi[axis]) {
            atomic_store_explicit(&item->box->hi[axis], hull.hi[axis], memory_order_relaxed);
            much = much || hull.hi[axis] < old.hi[axis] - least;
        }
    }
    return much;
}

/* --- the cache --- */

size_t pl_lazy_budget(const pl_scene *scene)
{
    const size_t taken = scene->program->bytes + scene->mesh_bytes;
    return scene->memory > taken ? scene->memory - taken : 0;
}

pl_lazy_cache *pl_lazy_cache_create(const pl_scene *scene, size_t limit, pl_error *error)
{
    if (limit < SMALLEST_BUDGET) {
        pl_fail(error, PL_ERROR_LIMIT, "states", "memory: states that are unfolded when they are needed take at least %d bytes more than %zu",
                SMALLEST_BUDGET, limit);
        return NULL;
    }
    pl_lazy_cache *cache = calloc(1, sizeof *cache);
    if (!cache) {
        pl_fail_memory(error, "preparing to unfold");
        return NULL;
    }
    cache->scene = scene;
    cache->classes = scene->gates ? scene->gates : pl_classes_create(scene->program, scene->meshes, limit / 4, error);
    bool ok = cache->classes != NULL;
    cache->shard_count = 1;
    while (cache->shard_count < SHARDS && limit / cache->shard_count > 2 * SHARD_BYTES) cache->shard_count *= 2;
    uint32_t buckets = 16;
    while (buckets < (1u << 16) && (size_t)buckets * cache->shard_count * BYTES_A_BUCKET < limit) buckets *= 2;
    for (uint32_t i = 0; i < cache->shard_count; i++) {
        shard *s = &cache->shards[i];
        pthread_mutex_init(&s->lock, NULL);
        s->bucket_count = buckets;
        s->buckets = calloc(buckets, sizeof *s->buckets);
        s->limit = (limit - limit / 4) / cache->shard_count;
        ok = ok && s->buckets;
    }
    if (ok) return cache;
    pl_lazy_cache_free(cache);
    pl_fail_memory(error, "preparing to unfold");
    return NULL;
}

void pl_lazy_cache_free(pl_lazy_cache *cache)
{
    if (!cache) return;
    for (uint32_t i = 0; i < cache->shard_count; i++) {
        shard *s = &cache->shards[i];
        for (uint32_t b = 0; s->buckets && b < s->bucket_count; b++)
            for (pl_lazy_state *state = s->buckets[b]; state;) {
                pl_lazy_state *next = state->next;
                free(state);
                state = next;
            }
        free(s->buckets);
        pthread_mutex_destroy(&s->lock);
    }
    if (cache->classes != cache->scene->gates) pl_classes_free(cache->classes);
    free(cache);
}

pl_classes *pl_lazy_classes(pl_lazy_cache *cache)
{
    return cache->classes;
}

static pl_lazy_state *find(shard *s, uint64_t hash, uint32_t symbol, const uint64_t *key, size_t words)
{
    for (pl_lazy_state *state = s->buckets[(hash >> 8) & (s->bucket_count - 1)]; state; state = state->next)
        if (state->hash == hash && state->symbol == symbol && state->key_words == words &&
            memcmp(state->key, key, words * sizeof *key) == 0) {
            atomic_fetch_add_explicit(&state->pins, 1, memory_order_relaxed);
            atomic_store_explicit(&state->touched, true, memory_order_relaxed);
            return state;
        }
    return NULL;
}

/* The clock: what wasn't touched since the hand last passed, and isn't pinned, goes. A bounded number is looked at for each
 * state that comes, since all may be in use: those on the way to where a ray is, which may be deep. */
static void evict(shard *s)
{
    for (uint32_t steps = 0; s->bytes > s->limit && steps < MOST_LOOKED_AT; steps++) {
        pl_lazy_state **place = &s->buckets[s->hand++ & (s->bucket_count - 1)];
        while (*place) {
            pl_lazy_state *state = *place;
            steps++;
            if (atomic_load(&state->pins) || atomic_exchange(&state->touched, false)) {
                place = &state->next;
                continue;
            }
            *place = state->next;
            s->bytes -= state->bytes;
            s->states--;
            s->evicted++;
            free(state);
        }
    }
}

/* Into the cache, unless another thread was faster: then its state is taken. */
static pl_lazy_state *put(shard *s, pl_lazy_state *state)
{
    pthread_mutex_lock(&s->lock);
    s->unfolded++;
    pl_lazy_state *other = find(s, state->hash, state->symbol, state->key, state->key_words);
    if (other) {
        pthread_mutex_unlock(&s->lock);
        free(state);
        return other;
    }
    pl_lazy_state **bucket = &s->buckets[(state->hash >> 8) & (s->bucket_count - 1)];
    state->next = *bucket;
    *bucket = state;
    s->bytes += state->bytes;
    s->states++;
    if (s->bytes > s->limit) evict(s);
    pthread_mutex_unlock(&s->lock);
    return state;
}

static bool make_key(pl_unfolder *u, uint32_t symbol)
{
    const pl_program *program = u->scene->program;
    u->key.count = 0;
    if (symbol == UINT32_MAX) return true;
    const pl_node *node = &program->nodes[symbol];
    uint64_t *key = pl_array_extend(&u->key, node->as.symbol.live_count + 1);
    if (!key) return false;
    *key++ = node->as.symbol.draws ? u->scope.key : 0;
    for (uint32_t i = 0; i < node->as.symbol.live_count; i++) {
        double value = u->scope.parameters[program->slots[node->as.symbol.live_first + i]];
        *key++ = isnan(value) ? UINT64_MAX : pl_bits(value);
    }
    return true;
}

pl_lazy_state *pl_lazy_get(pl_lazy_cache *cache, pl_unfolder *u, uint32_t symbol, const uint64_t *scope,
                           uint64_t *work, bool *is_new, pl_error *error)
{
    *is_new = false;
    if (scope) pl_scope_unpack(cache->scene->program, scope, &u->scope);
    bool ok = make_key(u, symbol);
    uint64_t hash = symbol;
    for (size_t i = 0; i < u->key.count; i++) hash = pl_mix(hash, ((const uint64_t *)u->key.data)[i]);
    shard *s = &cache->shards[hash % cache->shard_count];
    if (ok) {
        pthread_mutex_lock(&s->lock);
        pl_lazy_state *known = find(s, hash, symbol, u->key.data, u->key.count);
        s->found += known != NULL;
        pthread_mutex_unlock(&s->lock);
        if (known) return known;
        pl_walk_restart(&u->walk, symbol == UINT32_MAX ? 0 : symbol, scope ? &u->scope : NULL);
        u->work = 0;
        bool derived = derive(u, cache->classes, error);
        *work += u->work;
        if (!derived) return NULL;
        pl_lazy_state *state = assemble(u, symbol, hash);
        *is_new = true;
        if (state) return put(s, state);
    }
    pl_fail_memory(error, "unfolding a state");
    return NULL;
}

void pl_lazy_release(pl_lazy_state *state)
{
    atomic_fetch_sub_explicit(&state->pins, 1, memory_order_release);
}

void pl_lazy_count(pl_lazy_cache *cache, pl_lazy_counts *counts)
{
    memset(counts, 0, sizeof *counts);
    for (uint32_t i = 0; i < cache->shard_count; i++) {
        shard *s = &cache->shards[i];
        pthread_mutex_lock(&s->lock);
        counts->states += s->states;
        counts->bytes += s->bytes;
        counts->found += s->found;
        counts->unfolded += s->unfolded;
        counts->evicted += s->evicted;
        pthread_mutex_unlock(&s->lock);
    }
    pl_class_counts classes;
    pl_classes_count(cache->classes, &classes);
    counts->classes = classes.classes;
    counts->classes_emptied = classes.emptied;
    counts->classes_visited = classes.visited;
}
