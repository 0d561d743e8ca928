/* front.c - all fronts of a scene: how many items each may have under the budget, then building them (front.h). */
#include "front.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../error.h"

enum { DEFAULT_CACHE = 1 << 20, LEAST_ITEMS = 21 };

/* A primitive's share of nodes: 6 of eight children are there, one of them a node. */
#define NODE_BYTES_AN_ITEM (sizeof(pl_front_node) / 5.0)

/* --- the budget --- */

/* Half of a core's second-level cache: what rays keep touching should stay there (engine measurements: residency, not
 * arithmetic, decides). */
static size_t cache_bytes(void)
{
    long size = sysconf(_SC_LEVEL2_CACHE_SIZE);
    return size > 0 ? (size_t)size / 2 : DEFAULT_CACHE / 2;
}

/* What the fronts that the scene's front leads to take with at most `most` items each: an estimate for trees, exact
 * for the rest. Stops early above `enough`. false: no memory. */
static bool measure(const pl_compositions *compositions, const pl_states *states, uint64_t most, double enough,
                    double *bytes, bool *flat, pl_error *error)
{
    pl_state_list reached = {0};
    bool *seen = calloc(states->count, sizeof *seen), ok = seen != NULL;
    size_t done = 0;
    uint32_t state = 0;
    *bytes = 0.0;
    *flat = true;
    if (!ok) pl_fail_memory(error, "planning the fronts");
    while (ok && *bytes <= enough) {
        if (!seen[state]) {
            pl_front_counts counts;
            seen[state] = true;
            ok = pl_front_count(compositions, state, most, &counts, &reached, error);
            double items = (double)(counts.primitives + counts.instances);
            *bytes += sizeof(pl_front) + (double)counts.primitives * sizeof(pl_front_primitive) +
                      (double)counts.instances * sizeof(pl_front_instance) +
                      (double)counts.opened * sizeof(pl_opened) + items * NODE_BYTES_AN_ITEM;
            if (counts.instances) *flat = false;
        }
        if (done == reached.count) break;
        state = reached.list[done++];
    }
    free(reached.list);
    free(seen);
    return ok;
}

/* The largest K whose fronts fit into `budget` bytes; 0: not even K = 1. */
static bool choose(const pl_compositions *compositions, const pl_states *states, double budget, uint64_t *most,
                   double *floor, pl_error *error)
{
    bool flat;
    double bytes;
    *most = 0;
    if (!measure(compositions, states, 1, INFINITY, floor, &flat, error)) return false;
    if (*floor > budget) return true;
    *most = flat ? UINT64_MAX : 1;
    if (flat) return true;
    double whole = (double)states->list[0].primitives * (sizeof(pl_front_primitive) + NODE_BYTES_AN_ITEM);
    if (whole <= budget) {
        if (!measure(compositions, states, UINT64_MAX, budget, &bytes, &flat, error)) return false;
        if (bytes <= budget) *most = UINT64_MAX;
        if (bytes <= budget) return true;
    }
    for (uint64_t k = 4; k < PL_REF_INDEX; k += k / 2) {
        if (!measure(compositions, states, k, budget, &bytes, &flat, error)) return false;
        if (bytes > budget) return true;
        *most = k;
    }
    return true;
}

/* K for the scene's options: as asked for, or by the budget. Without one: what half of the cache holds, or, where the
 * graph itself is larger, a little unfolding. */
static bool plan(const pl_scene *scene, const pl_compositions *compositions, uint64_t *most, pl_error *error)
{
    const pl_options *options = &scene->options;
    double floor, used = (double)scene->states.bytes;
    if (options->front_items) {
        *most = options->front_items;
        return true;
    }
    double budget = options->memory ? (double)options->memory - used : (double)cache_bytes();
    if (!choose(compositions, &scene->states, budget, most, &floor, error)) return false;
    if (*most) return true;
    if (!options->memory) {
        *most = LEAST_ITEMS;
        return true;
    }
    return pl_fail(error, PL_ERROR_LIMIT, "memory", "this scene needs at least %.0f KB; %.0f KB are allowed",
                   (used + floor) / 1024.0 + 1.0, (double)options->memory / 1024.0);
}

/* --- one front --- */

static void *copy(const void *data, size_t bytes, size_t *total)
{
    size_t rounded = (bytes + 64) & ~(size_t)63;
    void *place = aligned_alloc(64, rounded);
    if (place && bytes) memcpy(place, data, bytes);
    *total += rounded;
    return place;
}

/* Moves the items and their tree into memory of exact size. */
static bool keep(pl_fronts *fronts, pl_front *front, pl_front_items *items, int threads)
{
    pl_front_node *nodes = aligned_alloc(64, (pl_front_most_nodes(items->box_count) * sizeof *nodes + 63) & ~(size_t)63);
    if (!nodes) return false;
    uint32_t count = pl_front_tree(items->boxes, items->box_count, nodes, &front->root, threads);
    size_t node_bytes = 0, item_bytes = 0;
    front->nodes = copy(nodes, count * sizeof *nodes, &node_bytes);
    free(nodes);
    front->primitives = copy(items->primitives, items->primitive_count * sizeof *items->primitives, &item_bytes);
    front->instances = copy(items->instances, items->instance_count * sizeof *items->instances, &item_bytes);
    front->opened = copy(items->opened, items->opened_count * sizeof *items->opened, &item_bytes);
    front->unbounded = copy(items->unbounded, items->unbounded_count * sizeof *items->unbounded, &item_bytes);
    front->unbounded_count = (uint32_t)items->unbounded_count;
    fronts->nodes += count;
    fronts->items += items->primitive_count + items->instance_count;
    fronts->instances += items->instance_count;
    fronts->opened += items->opened_count;
    fronts->node_bytes += node_bytes;
    fronts->item_bytes += item_bytes;
    return front->nodes && front->primitives && front->instances && front->opened && front->unbounded;
}

/* The front of a state, which may be new: then it stands at the end of the list, to be built. */
static bool front_of(pl_fronts *fronts, uint32_t state, uint32_t *index)
{
    if (fronts->of_state[state]) {
        *index = fronts->of_state[state] - 1;
        return true;
    }
    if (fronts->count == fronts->capacity) {
        uint32_t capacity = fronts->capacity ? 2 * fronts->capacity : 16;
        pl_front *list = realloc(fronts->list, capacity * sizeof *list);
        if (!list) return false;
        fronts->list = list;
        fronts->capacity = capacity;
    }
    *index = fronts->count++;
    fronts->of_state[state] = fronts->count;
    memset(&fronts->list[*index], 0, sizeof *fronts->list);
    fronts->list[*index].state = state;
    return true;
}

bool pl_front_make(const pl_scene *scene, const pl_compositions *compositions, uint32_t state, uint64_t most,
                   pl_fronts *sums, pl_front *front, pl_error *error)
{
    pl_front_items items = {0};
    *front = (pl_front){.state = state};
    pl_front_set_frame(front, &scene->states, state);
    bool ok = pl_front_open(compositions, front, most, &items, error);
    if (ok && (items.primitive_count > PL_REF_INDEX || items.instance_count > PL_REF_INDEX))
        ok = pl_fail(error, PL_ERROR_LIMIT, "memory", "a front of more than %d items", PL_REF_INDEX);
    if (ok && !keep(sums, front, &items, scene->threads)) ok = pl_fail_memory(error, "building the fronts");
    front->instance_count = (uint32_t)items.instance_count;
    pl_front_items_free(&items);
    return ok;
}

void pl_front_free(pl_front *front)
{
    free((void *)front->nodes);
    free((void *)front->primitives);
    free((void *)front->instances);
    free((void *)front->opened);
    free((void *)front->unbounded);
}

/* The fronts that instances name by their states are listed, to be built later. */
static bool build_front(pl_scene *scene, pl_fronts *fronts, const pl_compositions *compositions, uint32_t index,
                        pl_error *error)
{
    pl_front front;
    bool ok = pl_front_make(scene, compositions, fronts->list[index].state, fronts->limit_items, fronts, &front, error);
    for (size_t i = 0; ok && i < front.instance_count; i++) {
        uint32_t *to = (uint32_t *)&front.instances[i].front;
        if (!front_of(fronts, *to, to)) ok = pl_fail_memory(error, "building the fronts");
    }
    fronts->list[index] = front;
    return ok;
}

bool pl_fronts_build(pl_scene *scene, pl_error *error)
{
    pl_fronts *fronts = calloc(1, sizeof *fronts);
    pl_compositions *compositions = pl_compositions_create(&scene->states, error);
    scene->structure = fronts;
    bool ok = compositions != NULL;
    if (ok && (!fronts || !(fronts->of_state = calloc(scene->states.count, sizeof *fronts->of_state))))
        ok = pl_fail_memory(error, "building the fronts");
    ok = ok && plan(scene, compositions, &fronts->limit_items, error);
    uint32_t first;
    if (ok && !front_of(fronts, 0, &first)) ok = pl_fail_memory(error, "building the fronts");
    for (uint32_t i = 0; ok && i < fronts->count; i++) ok = build_front(scene, fronts, compositions, i, error);
    pl_compositions_free(compositions);
    if (!ok) return false;
    free(fronts->of_state);
    fronts->of_state = NULL;
    fronts->flat = fronts->instances == 0;
    fronts->bytes = sizeof *fronts + fronts->capacity * sizeof *fronts->list + fronts->node_bytes + fronts->item_bytes;
    return true;
}

void pl_fronts_destroy(pl_scene *scene)
{
    pl_fronts *fronts = scene->structure;
    scene->structure = NULL;
    if (!fronts) return;
    for (uint32_t i = 0; i < fronts->count; i++) pl_front_free(&fronts->list[i]);
    free(fronts->list);
    free(fronts->of_state);
    free(fronts);
}

void pl_fronts_count(const pl_scene *scene, pl_statistics *counts)
{
    const pl_fronts *fronts = scene->structure;
    counts->front_count = fronts->count;
    counts->front_items = fronts->items;
    counts->front_instances = fronts->instances;
    counts->front_limit = fronts->flat ? UINT64_MAX : fronts->limit_items;
    counts->bytes_nodes = fronts->node_bytes;
    counts->bytes_items = fronts->bytes - fronts->node_bytes;
    counts->isa = scene->isa;
}
