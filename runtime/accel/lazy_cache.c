/* lazy_cache.c - the cache of states that were unfolded, in two halves (lazy.h). */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "../error.h"
#include "../random.h"
#include "../table.h"
#include "lazy.h"

enum { SMALLEST_BUDGET = 16384, SMALLEST_CHUNK = 2048, LARGEST_CHUNK = 1 << 20, BYTES_A_BUCKET = 1024 };

/* Bytes for a dozen classes. What a tree consists of is in so many, and if not all of them fit, unfolding a state means following
 * the graph below it again: that took 30 times as long. */
enum { FEW_CLASSES = 16384 };

typedef struct chunk {
    struct chunk *next;
    size_t used, size;
    _Alignas(16) unsigned char memory[];
} chunk;

struct pl_lazy_half {
    pl_lazy_state **buckets;
    chunk *chunks, *spare; /* the newest first; emptied ones */
    size_t bytes;
    uint64_t states;
    uint64_t epoch; /* since it was emptied last; never that of another half */
    atomic_bool loose; /* some states with keys of their own can be looked up */
    unsigned users; /* rays that stand in it */
};

struct pl_lazy_cache {
    const pl_scene *scene;
    pl_classes *classes;
    pthread_mutex_t lock;
    pthread_cond_t released;
    pl_lazy_half halves[2], *current;
    uint32_t bucket_count;
    size_t limit, chunk_size; /* of a half */
    uint64_t unfolded, evicted, epochs;
    bool keys_repeat;
    atomic_uint_fast64_t found;
};

/* Whether there is code that maps random keys to fewer. */
static bool do_keys_repeat(const pl_program *program)
{
    for (uint32_t i = 0; i < program->node_count; i++) {
        const pl_node *node = &program->nodes[i];
        if (node->kind != PL_NODE_CALCULATE || !node->as.calculate.code) continue;
        for (const uint8_t *at = program->code + (node->as.calculate.code - 1); *at != PL_OP_END;) {
            const uint8_t opcode = *at++;
            if (opcode == PL_OP_VARIANTS) return true;
            if (pl_op_row_of(opcode)->operand == PL_OPERAND_NONE) continue;
            while (*at++ & 0x80) continue;
        }
    }
    return false;
}

static size_t taken_of(const pl_scene *scene)
{
    return scene->program->bytes + scene->mesh_bytes;
}

size_t pl_lazy_budget(const pl_scene *scene)
{
    const size_t taken = taken_of(scene);
    return scene->memory > taken ? scene->memory - taken : 0;
}

size_t pl_lazy_class_budget(size_t limit)
{
    const size_t most = limit / 2 < FEW_CLASSES ? limit / 2 : FEW_CLASSES;
    return limit / 4 > most ? limit / 4 : most;
}

static size_t limit_of_half(size_t limit)
{
    return (limit - pl_lazy_class_budget(limit)) / 2;
}

pl_lazy_cache *pl_lazy_cache_create(const pl_scene *scene, size_t limit, pl_error *error)
{
    if (limit < SMALLEST_BUDGET) {
        pl_fail_allowed(error, (double)(taken_of(scene) + SMALLEST_BUDGET), (double)scene->memory);
        return NULL;
    }
    pl_lazy_cache *cache = calloc(1, sizeof *cache);
    if (!cache) {
        pl_fail_memory(error, "preparing to unfold");
        return NULL;
    }
    cache->scene = scene;
    cache->keys_repeat = do_keys_repeat(scene->program);
    cache->classes = scene->gates ? scene->gates : pl_classes_create(scene->program, scene->meshes, pl_lazy_class_budget(limit), error);
    bool ok = cache->classes != NULL;
    pthread_mutex_init(&cache->lock, NULL);
    pthread_cond_init(&cache->released, NULL);
    cache->current = &cache->halves[0];
    cache->bucket_count = 16;
    while (cache->bucket_count < (1u << 20) && (size_t)cache->bucket_count * BYTES_A_BUCKET < limit) cache->bucket_count *= 2;
    cache->limit = limit_of_half(limit);
    cache->chunk_size = cache->limit / 16;
    cache->chunk_size = cache->chunk_size < SMALLEST_CHUNK   ? SMALLEST_CHUNK
                        : cache->chunk_size > LARGEST_CHUNK ? LARGEST_CHUNK
                                                             : cache->chunk_size / 16 * 16;
    for (int i = 0; i < 2; i++) {
        cache->halves[i].buckets = calloc(cache->bucket_count, sizeof(pl_lazy_state *));
        cache->halves[i].bytes = cache->bucket_count * sizeof(pl_lazy_state *);
        cache->halves[i].epoch = ++cache->epochs;
        ok = ok && cache->halves[i].buckets;
    }
    if (ok) return cache;
    pl_lazy_cache_free(cache);
    pl_fail_memory(error, "preparing to unfold");
    return NULL;
}

static void free_chunks(chunk *chunks)
{
    while (chunks) {
        chunk *next = chunks->next;
        free(chunks);
        chunks = next;
    }
}

void pl_lazy_cache_free(pl_lazy_cache *cache)
{
    if (!cache) return;
    for (int i = 0; i < 2; i++) {
        free_chunks(cache->halves[i].chunks);
        free_chunks(cache->halves[i].spare);
        free(cache->halves[i].buckets);
    }
    pthread_mutex_destroy(&cache->lock);
    pthread_cond_destroy(&cache->released);
    if (cache->classes != cache->scene->gates) pl_classes_free(cache->classes);
    free(cache);
}

pl_classes *pl_lazy_classes(pl_lazy_cache *cache)
{
    return cache->classes;
}

/* --- halves --- */

pl_lazy_half *pl_lazy_hold(pl_lazy_cache *cache)
{
    pthread_mutex_lock(&cache->lock);
    pl_lazy_half *half = cache->current;
    half->users++;
    pthread_mutex_unlock(&cache->lock);
    return half;
}

static void let_go(pl_lazy_cache *cache, pl_lazy_half *half)
{
    if (--half->users == 0) pthread_cond_broadcast(&cache->released);
}

void pl_lazy_release(pl_lazy_cache *cache, pl_lazy_half *half)
{
    pthread_mutex_lock(&cache->lock);
    let_go(cache, half);
    pthread_mutex_unlock(&cache->lock);
}

/* Memory is kept for what comes next; chunks for a single large state aren't. */
static void empty(pl_lazy_cache *cache, pl_lazy_half *half)
{
    while (half->chunks) {
        chunk *c = half->chunks;
        half->chunks = c->next;
        if (c->size == cache->chunk_size) {
            *c = (chunk){.next = half->spare, .size = c->size};
            half->spare = c;
        } else {
            half->bytes -= sizeof *c + c->size;
            free(c);
        }
    }
    memset(half->buckets, 0, cache->bucket_count * sizeof *half->buckets);
    half->states = 0;
    half->loose = false;
    half->epoch = ++cache->epochs;
}

/* A ray that waits stands in neither half, and one that doesn't ends or comes here, so no two wait for each other. */
pl_lazy_half *pl_lazy_change(pl_lazy_cache *cache, pl_lazy_half *half)
{
    pthread_mutex_lock(&cache->lock);
    let_go(cache, half);
    pl_lazy_half *other = half == &cache->halves[0] ? &cache->halves[1] : &cache->halves[0];
    while (cache->current == half && other->users) pthread_cond_wait(&cache->released, &cache->lock);
    if (cache->current == half) {
        cache->evicted += other->states;
        empty(cache, other);
        cache->current = other;
    }
    half = cache->current;
    half->users++;
    pthread_mutex_unlock(&cache->lock);
    return half;
}

/* Room for a state. There is always some for the first one. */
static void *allocate(pl_lazy_cache *cache, pl_lazy_half *half, size_t bytes, bool *full)
{
    bytes = (bytes + 15) & ~(size_t)15;
    chunk *c = half->chunks;
    const bool fits = c && c->used + bytes <= c->size;
    if (!fits && half->spare && bytes <= cache->chunk_size) {
        c = half->spare;
        half->spare = c->next;
        c->next = half->chunks;
        half->chunks = c;
    } else if (!fits) {
        const size_t size = bytes > cache->chunk_size ? bytes : cache->chunk_size;
        *full = half->states && half->bytes + sizeof *c + size > cache->limit;
        if (*full || !(c = malloc(sizeof *c + size))) return NULL;
        *c = (chunk){.next = half->chunks, .size = size};
        half->chunks = c;
        half->bytes += sizeof *c + size;
    }
    void *place = c->memory + c->used;
    c->used += bytes;
    half->states++;
    return place;
}

/* --- states --- */

static pl_lazy_state **bucket_of(const pl_lazy_cache *cache, const pl_lazy_half *half, uint64_t hash)
{
    return &half->buckets[hash & (cache->bucket_count - 1)];
}

static pl_lazy_state *find(pl_lazy_state *bucket, uint64_t hash, uint32_t symbol, const uint64_t *key, uint32_t words)
{
    for (pl_lazy_state *state = bucket; state; state = state->next)
        if (state->hash == hash && state->key == key[0] && state->pattern->symbol == symbol &&
            memcmp(state->pattern->live, key + 1, (words - 1) * sizeof *key) == 0)
            return state;
    return NULL;
}

/* Whether a state has a random key of its own: then it is on one path only, and isn't looked up but found by the item that
 * enters it. Only where it was let go nothing enters it: then the rays after must find it in the half, or all of them would
 * unfold the states of which there is one, however large, again. */
static bool is_met_once(const pl_lazy_cache *cache, uint32_t symbol)
{
    return !cache->keys_repeat && symbol != UINT32_MAX && cache->scene->program->nodes[symbol].as.symbol.draws;
}

/* A state may take half of a half: if it is let go, at least as much was unfolded as it takes to unfold it again. */
static bool fail_room(const pl_lazy_cache *cache, uint32_t symbol, size_t bytes, pl_error *error)
{
    size_t limit = SMALLEST_BUDGET;
    while (bytes > limit_of_half(limit) / 2) limit += limit / 64;
    return pl_fail_at(error, PL_ERROR_LIMIT, cache->scene->program, symbol == UINT32_MAX ? 0 : symbol,
                      "memory: a state of %zu bytes is unfolded when it is needed, which takes about %zu bytes in all", bytes,
                      taken_of(cache->scene) + limit);
}

/* Two threads may unfold the same state: then there are two of it. */
pl_lazy_state *pl_lazy_get(pl_lazy_cache *cache, pl_lazy_half *half, pl_unfolder *unfolder, uint32_t symbol,
                           const uint64_t *scope, bool again, uint64_t *work, bool *full, pl_error *error)
{
    uint32_t words;
    size_t bytes;
    const uint64_t *key = pl_unfolder_key(unfolder, symbol, scope, &words);
    *full = false;
    if (!key) {
        pl_fail_memory(error, "unfolding a state");
        return NULL;
    }
    const bool listed = again || !is_met_once(cache, symbol);
    pl_lazy_state *state = NULL, **bucket = NULL;
    uint64_t hash = symbol;
    if (listed || half->loose) {
        for (uint32_t i = 0; i < words; i++) hash = pl_mix(hash, key[i]);
        bucket = bucket_of(cache, half, hash);
        pthread_mutex_lock(&cache->lock);
        state = find(*bucket, hash, symbol, key, words);
        pthread_mutex_unlock(&cache->lock);
    }
    if (state) {
        pl_lazy_add_found(cache, 1);
        return state;
    }
    if (!pl_unfolder_prepare(unfolder, symbol, cache->classes, half->epoch, &bytes, work, error)) return NULL;
    if (bytes > cache->limit / 2) {
        fail_room(cache, symbol, bytes, error);
        return NULL;
    }
    pthread_mutex_lock(&cache->lock);
    void *memory = allocate(cache, half, bytes, full);
    cache->unfolded += memory != NULL;
    pthread_mutex_unlock(&cache->lock);
    if (!memory) {
        if (!*full) pl_fail_memory(error, "unfolding a state");
        return NULL;
    }
    state = pl_unfolder_write(unfolder, symbol, memory, error);
    if (!listed || !state) return state;
    state->hash = hash;
    pthread_mutex_lock(&cache->lock);
    half->loose = half->loose || again;
    state->next = *bucket;
    *bucket = state;
    pthread_mutex_unlock(&cache->lock);
    return state;
}

/* --- counts --- */

void pl_lazy_add_found(pl_lazy_cache *cache, uint64_t found)
{
    atomic_fetch_add_explicit(&cache->found, found, memory_order_relaxed);
}

void pl_lazy_count(pl_lazy_cache *cache, pl_lazy_counts *counts)
{
    pl_class_counts classes;
    pl_classes_count(cache->classes, &classes);
    pthread_mutex_lock(&cache->lock);
    *counts = (pl_lazy_counts){.states = cache->halves[0].states + cache->halves[1].states,
                               .bytes = cache->halves[0].bytes + cache->halves[1].bytes,
                               .found = atomic_load(&cache->found),
                               .unfolded = cache->unfolded,
                               .evicted = cache->evicted,
                               .classes = classes.classes,
                               .visited = classes.visited};
    pthread_mutex_unlock(&cache->lock);
}
