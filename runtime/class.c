/* class.c - the table of classes (class.h): a state's class, and what was learnt on the way about others. */
#include "class.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "error.h"
#include "random.h"

enum { FEWEST_BUCKETS = 16, FEWEST_COSTLY = 16, MOST_COSTLY = 1 << 14 };

typedef struct entry {
    struct entry *next;
    uint64_t hash;
    uint64_t work, worth; /* the nodes visited for it; what is left of them since it was asked for (make_room) */
    uint32_t symbol;
    pl_bounds bounds;
    pl_range live[];
} entry;

/* A class that takes too much work on a grid, told by 128 bits of hash: there are many of them, and they are small. */
typedef struct costly {
    uint64_t low, high;
} costly;

struct pl_classes {
    const pl_program *program;
    pthread_mutex_t lock;
    pl_class_walk *walk;
    pl_class_grid grid; /* of the walk that goes on */
    entry **buckets;
    costly *costly;
    uint32_t bucket_count, costly_count;
    uint32_t next_to_empty; /* bucket */
    size_t bytes, limit;
    uint64_t count;
    pl_range *scope, *live;
};

pl_classes *pl_classes_create(const pl_program *program, pl_mesh_tree *const *meshes, size_t limit, pl_error *error)
{
    pl_classes *c = calloc(1, sizeof *c);
    if (c) {
        c->program = program;
        c->bucket_count = FEWEST_BUCKETS;
        while (c->bucket_count < (1u << 20) && (size_t)c->bucket_count * 256 < limit) c->bucket_count *= 2;
        c->costly_count = FEWEST_COSTLY;
        while (c->costly_count < MOST_COSTLY && 8 * c->costly_count * sizeof(costly) < limit) c->costly_count *= 2;
        size_t tables = c->bucket_count * sizeof *c->buckets + c->costly_count * sizeof *c->costly;
        c->limit = limit > tables ? limit - tables : 0;
        c->buckets = calloc(c->bucket_count, sizeof *c->buckets);
        c->costly = calloc(c->costly_count, sizeof *c->costly);
        c->scope = malloc((program->parameter_count + 1) * sizeof *c->scope);
        c->live = malloc((program->parameter_count + 1) * sizeof *c->live);
        c->walk = pl_class_walk_create(program, meshes);
        pthread_mutex_init(&c->lock, NULL);
    }
    if (c && c->buckets && c->costly && c->scope && c->live && c->walk) return c;
    pl_classes_free(c);
    pl_fail_memory(error, "bounding states");
    return NULL;
}

/* Of an entry, with what malloc adds. */
static size_t entry_bytes(const pl_classes *c, uint32_t symbol)
{
    return sizeof(entry) + c->program->nodes[symbol].as.symbol.live_count * sizeof(pl_range) + 16;
}

/* Lets go what is worth no more than so much in a bucket; the rest is worth half. */
static void empty(pl_classes *c, uint32_t bucket, uint64_t worth)
{
    for (entry **at = &c->buckets[bucket], *e; (e = *at);) {
        if (e->worth > worth) {
            e->worth /= 2;
            at = &e->next;
            continue;
        }
        *at = e->next;
        c->bytes -= entry_bytes(c, e->symbol);
        c->count--;
        free(e);
    }
}

/* What took little work and wasn't asked for lately goes first: a class of trees takes thousands of nodes, one of leaves a few. */
static bool make_room(pl_classes *c, size_t bytes)
{
    if (bytes > c->limit) return false;
    while (c->bytes + bytes > c->limit) empty(c, c->next_to_empty++ & (c->bucket_count - 1), 1);
    return true;
}

void pl_classes_free(pl_classes *c)
{
    if (!c) return;
    for (uint32_t i = 0; c->buckets && i < c->bucket_count; i++) empty(c, i, UINT64_MAX);
    pthread_mutex_destroy(&c->lock);
    pl_class_walk_free(c->walk);
    free(c->buckets);
    free(c->costly);
    free(c->scope);
    free(c->live);
    free(c);
}

void pl_classes_count(pl_classes *c, pl_class_counts *counts)
{
    pthread_mutex_lock(&c->lock);
    *counts = (pl_class_counts){c->count, pl_class_walk_visited(c->walk)};
    pthread_mutex_unlock(&c->lock);
}

static uint64_t hash_of(const pl_classes *c, uint32_t symbol, const pl_range *live, uint64_t hash)
{
    hash = pl_mix(hash, symbol);
    for (uint32_t i = 0; i < c->program->nodes[symbol].as.symbol.live_count; i++)
        hash = pl_mix(pl_mix(hash, pl_bits(live[i].lo)), pl_bits(live[i].hi));
    return hash;
}

static entry *find(const pl_classes *c, uint32_t symbol, const pl_range *live, uint64_t hash)
{
    const size_t bytes = c->program->nodes[symbol].as.symbol.live_count * sizeof *live;
    for (entry *e = c->buckets[hash & (c->bucket_count - 1)]; e; e = e->next)
        if (e->hash == hash && e->symbol == symbol && (!bytes || memcmp(e->live, live, bytes) == 0)) return e;
    return NULL;
}

/* Where there is no memory the class is bounded again when it is asked for. */
static void add(pl_classes *c, uint32_t symbol, const pl_range *live, uint64_t hash, const pl_bounds *bounds, uint64_t work)
{
    const size_t bytes = entry_bytes(c, symbol);
    if (find(c, symbol, live, hash) || !make_room(c, bytes)) return;
    entry *e = malloc(bytes);
    if (!e) return;
    entry **bucket = &c->buckets[hash & (c->bucket_count - 1)];
    *e = (entry){.next = *bucket, .hash = hash, .work = work, .worth = work, .symbol = symbol, .bounds = *bounds};
    memcpy(e->live, live, c->program->nodes[symbol].as.symbol.live_count * sizeof *live);
    *bucket = e;
    c->bytes += bytes;
    c->count++;
}

static bool is_costly(void *context, uint32_t symbol, const pl_range *live)
{
    const pl_classes *c = context;
    const uint64_t low = hash_of(c, symbol, live, c->grid), high = hash_of(c, symbol, live, ~(uint64_t)c->grid);
    const costly *at = &c->costly[low & (c->costly_count - 1)];
    return at->low == low && at->high == high;
}

static void keep_found(void *context, const pl_class_found *found)
{
    pl_classes *c = context;
    if (!found->bounds) {
        const uint64_t low = hash_of(c, found->symbol, found->live, c->grid);
        c->costly[low & (c->costly_count - 1)] = (costly){low, hash_of(c, found->symbol, found->live, ~(uint64_t)c->grid)};
        return;
    }
    /* On the coarse grid nothing is final but for the class itself; and what no state's class is, is never asked for. */
    const uint32_t count = c->program->nodes[found->symbol].as.symbol.live_count;
    if (c->grid == PL_GRID_COARSE || !pl_class_is_of_a_state(found->live, count)) return;
    add(c, found->symbol, found->live, hash_of(c, found->symbol, found->live, 0), found->bounds, found->work);
}

static bool follow(pl_classes *c, uint32_t symbol, pl_class_grid grid, pl_bounds *bounds)
{
    c->grid = grid;
    return !is_costly(c, symbol, c->live) &&
           pl_class_walk_bound(c->walk, symbol, c->live, grid, is_costly, keep_found, c, bounds);
}

void pl_classes_bound(pl_classes *c, uint32_t symbol, const pl_scope *scope, pl_bounds *bounds, uint64_t *work)
{
    pthread_mutex_lock(&c->lock);
    const uint64_t before = pl_class_walk_visited(c->walk);
    for (uint32_t i = 0; i < c->program->parameter_count; i++) c->scope[i] = pl_range_of(scope->parameters[i]);
    pl_class_of(c->program, symbol, c->scope, PL_GRID_CLASS, c->live);
    const uint64_t hash = hash_of(c, symbol, c->live, 0);
    entry *e = find(c, symbol, c->live, hash);
    if (e) {
        *bounds = e->bounds;
        e->worth = e->work;
    } else {
        if (!follow(c, symbol, PL_GRID_FINE, bounds) && !follow(c, symbol, PL_GRID_COARSE, bounds))
            *bounds = pl_bounds_unknown();
        add(c, symbol, c->live, hash, bounds, pl_class_walk_visited(c->walk) - before);
    }
    *work += pl_class_walk_visited(c->walk) - before;
    pthread_mutex_unlock(&c->lock);
}

void pl_classes_gate(pl_classes *c, uint32_t symbol, const pl_scope *scope, pl_gate_box *gate)
{
    pl_bounds bounds;
    uint64_t work = 0;
    pl_classes_bound(c, symbol, scope, &bounds, &work);
    *gate = pl_bounds_gate(&bounds);
}
