/* front.c - all fronts of a scene: the budget, then opening the states and building their trees (front.h). */
#include "front.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../error.h"

enum { DEFAULT_CACHE = 1 << 20, LARGE_FRONT = 1 << 14, MOST_THREADS = 64 };

/* Of a core's second-level cache, what states and fronts may take unless something else is asked for: what rays keep
 * touching should stay there (engine measurements: residency, not arithmetic, decides), beside stacks and pixels. */
#define CACHE_SHARE 0.45
/* Where the graph itself is larger than that: so much of what it needs. Rays wait for memory there as it is, so taller fronts
 * win (forest: 65 instead of 97, a tenth faster). */
#define LEAST_GROWTH 1.85
/* What there may be at once while building: a process that traces takes SPARE more than its scene anyway. */
#define SPARE (256 << 10)
#define MOST_AT_ONCE 1.05
/* What plans that fill `memory` leave of it for lists of transformations, where they can. */
#define LINKS_ROOM 0.03
/* Where fronts became too large, the next ones are planned for a little less than what would have fitted. */
#define SHRINK 0.99
/* While a tree is improved that takes no more than one part in so many of what is allowed. */
#define IMPROVING_SHARE 32

/* --- the budget --- */

static double cache_bytes(void)
{
    long size = sysconf(_SC_LEVEL2_CACHE_SIZE);
    return CACHE_SHARE * (double)(size > 0 ? size : DEFAULT_CACHE);
}

/* What `memory` leaves to fronts and their states beside terrains; 0: they go by the cache. */
static double memory_of(const pl_scene *scene)
{
    return scene->options.memory ? fmax((double)scene->options.memory - (double)scene->terrain_bytes, 1.0) : 0.0;
}

/* What is there while fronts are built and gone afterwards: states before they are packed, compositions. */
static double building_bytes(const pl_scene *scene, const pl_compositions *compositions)
{
    return (double)scene->states.bytes + (double)pl_compositions_bytes(compositions);
}

/* Hulls are gone before the states are packed, so they take the room of these. */
static bool hulls_fit(const pl_scene *scene, const pl_front_plan *plan)
{
    const double needed = building_bytes(scene, plan->compositions) + plan->estimate + (double)pl_front_hulls_bytes(&scene->states);
    const double memory = memory_of(scene);
    return memory == 0.0 || needed <= MOST_AT_ONCE * memory + SPARE;
}

/* A plan for what the scene's options ask for: so many items; as much as fits into `memory`; or what pays, as far as the
 * cache reaches. share: of what there is for fronts, so much is planned with, since plans are estimates. */
static bool choose(const pl_scene *scene, const pl_compositions *compositions, double share, pl_fronts *fronts,
                   pl_front_plan **plan, pl_error *error)
{
    const pl_options *options = &scene->options;
    const double primitives = (double)scene->states.list[0].primitives, memory = memory_of(scene);
    if (!(*plan = pl_front_plan_create(compositions, NULL, false, error))) return false;
    if (options->front_items) return pl_front_plan_items(*plan, options->front_items, error);
    size_t states;
    if (!pl_states_packed_bytes(&scene->states, &states, error)) return false;
    const bool fill = memory > 0.0;
    double budget = cache_bytes() - (double)states;
    if (fill) {
        const double at_once = MOST_AT_ONCE * memory + SPARE - building_bytes(scene, compositions);
        budget = share * (fmin(memory, at_once) - (double)states);
    }
    if (primitives * sizeof(pl_front_primitive) < budget) {
        if (!pl_front_plan_items(*plan, UINT64_MAX, error)) return false;
        if ((*plan)->estimate + primitives * (fill ? sizeof(pl_boxed) / MOST_AT_ONCE : 0.0) <= budget) return true;
    }
    pl_pilot pilot;
    pl_front_plan_free(*plan);
    *plan = NULL;
    const double start = pl_seconds();
    bool fits, ok = pl_pilot_fly(&pilot, scene, compositions, error);
    fronts->pilot_seconds = pl_seconds() - start;
    fronts->pilot_rays = pilot.rays;
    fronts->flat_bytes = primitives < 1e17 ? (uint64_t)(primitives * pl_front_plan_flat_bytes()) : UINT64_MAX;
    double floor;
    ok = ok && (*plan = pl_front_plan_create(compositions, &pilot, true, error)) &&
         pl_front_plan_budget(*plan, budget - (fill ? LINKS_ROOM * memory : 0.0), fill, &floor, &fits, error) &&
         (fits || !fill || pl_front_plan_budget(*plan, budget, true, &floor, &fits, error));
    pl_pilot_free(&pilot);
    if (!ok || fits) return ok;
    if (!fill) return pl_front_plan_budget(*plan, LEAST_GROWTH * floor, false, &floor, &fits, error);
    const double needed = (double)states + floor / share;
    const double at_once = (building_bytes(scene, compositions) + needed - SPARE) / MOST_AT_ONCE;
    const double beside = (double)scene->options.memory - memory;
    return pl_fail_allowed(error, fmax(needed, at_once) + beside, memory + beside);
}

/* --- one front --- */

/* Rays that go together are among different items where they are as far apart as some items are large. */
#define WIDE_ITEMS 3.5
#define WIDEST 0.5

static float wide_of(const pl_front_items *items)
{
    double sum = 0.0; /* of the sides of a cube with a box's surface */
    for (size_t i = 0; i < items->box_count; i++) {
        const pl_boxed *box = &items->boxes[i];
        const float x = box->hi[0] - box->lo[0], y = box->hi[1] - box->lo[1], z = box->hi[2] - box->lo[2];
        sum += sqrtf((x * y + y * z + z * x) / 3.0f);
    }
    return (float)fmin(WIDEST, WIDE_ITEMS * sum / (double)(items->box_count + 1));
}

/* Whether a ray that comes to a front meets one of its primitives as a rule: their boxes have twice the surface of its own, since
 * not all who meet a box meet what is in it. */
static bool is_dense(const pl_front *front, const pl_front_items *items)
{
    const float *half = front->half;
    float sum = 0.0f;
    for (size_t i = 0; i < items->box_count; i++) {
        const pl_boxed *box = &items->boxes[i];
        const float x = box->hi[0] - box->lo[0], y = box->hi[1] - box->lo[1], z = box->hi[2] - box->lo[2];
        if (box->ref >> PL_REF_SHIFT != PL_KIND_INSTANCE) sum += x * y + y * z + z * x;
    }
    return sum > 8.0f * (half[0] * half[1] + half[1] * half[2] + half[2] * half[0]);
}

/* Builds a front's tree and gives it its items; what they were listed with is freed. */
static bool keep(pl_front *front, pl_front_items *items, int threads, bool improve)
{
    front->wide = wide_of(items);
    front->dense = is_dense(front, items);
    front->nodes = pl_front_tree(items->boxes, items->box_count, &front->node_count, &front->root, threads, improve);
    front->primitives = items->primitives;
    front->instances = items->instances;
    front->places = items->places;
    front->fine = items->fine;
    front->bounds = items->bounds;
    front->opened = items->opened;
    front->unbounded = items->unbounded;
    front->unbounded_count = (uint32_t)items->unbounded_count;
    front->opened_count = (uint32_t)items->opened_count;
    front->instance_count = (uint32_t)items->instance_count;
    items->primitives = NULL;
    items->instances = NULL;
    items->opened = NULL;
    items->unbounded = NULL;
    return front->nodes != NULL;
}

/* improve: since many rays enter it, as far as there is memory for that. */
static bool build_front(const pl_scene *scene, const pl_front_plan *plan, pl_front *front, int threads, bool improve,
                        pl_error *error)
{
    const pl_front_counts *counts = &plan->counts[front->state];
    pl_front_items items;
    pl_front_set_frame(front, &scene->states, front->state);
    if (counts->primitives > PL_REF_INDEX || counts->instances > PL_REF_INDEX || counts->opened > UINT32_MAX)
        return pl_fail(error, PL_ERROR_LIMIT, "memory", "a front of more than %d items", PL_REF_INDEX);
    bool ok = pl_front_open(plan, front, threads, &items, error);
    const uint64_t room = scene->options.memory ? (uint64_t)memory_of(scene) / IMPROVING_SHARE : UINT64_MAX;
    improve = improve && ok && items.box_count * PL_FRONT_IMPROVING_BYTES <= room;
    if (ok && !keep(front, &items, threads, improve)) ok = pl_fail_memory(error, "building the fronts");
    pl_front_items_free(&items);
    return ok;
}

/* --- all fronts --- */

typedef struct task {
    const pl_scene *scene;
    const pl_front_plan *plan;
    pl_fronts *fronts;
    atomic_uint next;
    atomic_bool failed;
    pthread_mutex_t lock; /* of error */
    pl_error error;
} task;

static bool is_large(const pl_front_plan *plan, const pl_front *front)
{
    const pl_front_counts *counts = &plan->counts[front->state];
    return counts->primitives + counts->instances >= LARGE_FRONT;
}

static void *build_small(void *context)
{
    task *t = context;
    for (uint32_t i; (i = atomic_fetch_add(&t->next, 1)) < t->fronts->count && !atomic_load(&t->failed);) {
        pl_error error = {.code = PL_OK};
        if (is_large(t->plan, &t->fronts->list[i])) continue;
        if (build_front(t->scene, t->plan, &t->fronts->list[i], 1, true, &error)) continue;
        pthread_mutex_lock(&t->lock);
        t->error = error;
        atomic_store(&t->failed, true);
        pthread_mutex_unlock(&t->lock);
    }
    return NULL;
}

/* Small fronts by one thread each, large ones one after another by all. */
static bool build_fronts(const pl_scene *scene, const pl_front_plan *plan, pl_fronts *fronts, pl_error *error)
{
    task t = {.scene = scene, .plan = plan, .fronts = fronts, .lock = PTHREAD_MUTEX_INITIALIZER};
    pthread_t started[MOST_THREADS];
    int others = 0, threads = scene->threads < MOST_THREADS ? scene->threads : MOST_THREADS;
    for (uint32_t i = 0; i < fronts->count; i++)
        if (is_large(plan, &fronts->list[i]) && !build_front(scene, plan, &fronts->list[i], threads, true, error))
            return false;
    if (fronts->count < 2 || plan->estimate < 1e5) threads = 1;
    while (others < threads - 1 && pthread_create(&started[others], NULL, build_small, &t) == 0) others++;
    build_small(&t);
    for (int i = 0; i < others; i++) pthread_join(started[i], NULL);
    if (atomic_load(&t.failed)) *error = t.error;
    return !atomic_load(&t.failed);
}

/* Fronts in the plan's order. */
static bool list_fronts(pl_fronts *fronts, pl_front_plan *plan)
{
    const uint32_t states = plan->compositions->states->count;
    for (uint32_t i = 0; i < states; i++)
        if (plan->visits[plan->order[i]] > 0.0) plan->front_of[plan->order[i]] = ++fronts->count;
    fronts->list = calloc(fronts->count, sizeof *fronts->list);
    for (uint32_t i = 0; fronts->list && i < states; i++)
        if (plan->front_of[i]) fronts->list[plan->front_of[i] - 1].state = i;
    return fronts->list;
}

static size_t rounded(size_t bytes)
{
    return (bytes + 64) & ~(size_t)63;
}

static void add_to(pl_fronts *sums, const pl_front *front, const pl_front_counts *counts)
{
    const uint64_t items = counts->primitives + counts->instances;
    sums->items += items;
    sums->nodes += front->node_count;
    sums->opened += counts->opened;
    sums->instances += counts->instances;
    if (items > sums->most_items) sums->most_items = items;
    sums->node_bytes += rounded(front->node_count * sizeof *front->nodes);
    sums->item_bytes += rounded(counts->primitives * sizeof *front->primitives) +
                        rounded(counts->instances * pl_front_instance_bytes(front->fine)) +
                        counts->opened * sizeof *front->opened +
                        (front->unbounded_count + 1) * sizeof *front->unbounded;
}

/* --- a front by itself --- */

static pl_front_plan *single_plan(pl_compositions *compositions, pl_error *error)
{
    if (compositions->single) return compositions->single;
    pl_front_plan *plan = compositions->single = pl_front_plan_create(compositions, NULL, false, error);
    for (uint32_t i = 0; plan && i < compositions->states->count; i++) plan->front_of[i] = i + 1;
    return plan;
}

bool pl_front_make(const pl_scene *scene, pl_compositions *compositions, uint32_t state, uint64_t most, pl_fronts *sums,
                   pl_front *front, pl_error *error)
{
    pl_front_counts counts;
    pl_front_plan *plan = single_plan(compositions, error);
    *front = (pl_front){.state = state};
    if (!plan || !pl_front_plan_single(plan, state, most, &counts, error)) return false;
    if (!build_front(scene, plan, front, scene->threads, false, error)) return false;
    add_to(sums, front, &counts);
    return true;
}

void pl_front_free(pl_front *front)
{
    free((void *)front->nodes);
    free((void *)front->primitives);
    free((void *)front->instances);
    free((void *)front->opened);
    free((void *)front->maps);
    free((void *)front->unbounded);
}

bool pl_front_count(pl_compositions *compositions, uint32_t state, uint64_t most, pl_front_counts *counts,
                    pl_state_list *closed, pl_error *error)
{
    pl_front_plan *plan = single_plan(compositions, error);
    if (!plan || !pl_front_plan_single(plan, state, most, counts, error)) return false;
    plan->counting.closed = closed;
    bool ok = pl_front_plan_count(plan, &plan->counting, state, state, 1.0, counts);
    plan->counting.closed = NULL;
    return ok || pl_fail_memory(error, "planning the fronts");
}

/* Frees the fronts, but not what is known of the pilot. */
static void clear(pl_fronts *fronts)
{
    for (uint32_t i = 0; i < fronts->count && fronts->list; i++) pl_front_free(&fronts->list[i]);
    free(fronts->list);
    fronts->list = NULL;
    fronts->count = 0;
    fronts->items = fronts->nodes = fronts->opened = fronts->instances = fronts->most_items = 0;
    fronts->node_bytes = fronts->item_bytes = 0;
}

static bool build_planned(const pl_scene *scene, const pl_compositions *compositions, double share, pl_fronts *fronts,
                          pl_error *error)
{
    pl_front_plan *plan = NULL;
    bool ok = choose(scene, compositions, share, fronts, &plan, error);
    if (ok && !list_fronts(fronts, plan)) ok = pl_fail_memory(error, "building the fronts");
    if (ok && !scene->states.cuts && hulls_fit(scene, plan)) plan->hulls = pl_front_hulls_create(plan);
    ok = ok && build_fronts(scene, plan, fronts, error);
    for (uint32_t i = 0; ok && i < fronts->count; i++)
        add_to(fronts, &fronts->list[i], &plan->counts[fronts->list[i].state]);
    fronts->bytes = sizeof *fronts + fronts->count * sizeof *fronts->list + fronts->node_bytes + fronts->item_bytes;
    fronts->entries = ok ? plan->entries : 0.0;
    pl_front_plan_free(plan);
    return ok;
}

/* Lists the transformations in fronts, in what `memory` or the cache leaves: where fronts outgrow the cache, rays wait for
 * other things. */
static void link_fronts(const pl_scene *scene, pl_fronts *fronts)
{
    const size_t memory = (size_t)(scene->options.memory ? memory_of(scene) : cache_bytes());
    for (uint32_t i = 0; i < fronts->count; i++) {
        const size_t taken = scene->states.bytes + fronts->bytes;
        const size_t bytes = taken < memory ? pl_front_link(&fronts->list[i], &scene->states, memory - taken) : 0;
        fronts->item_bytes += bytes;
        fronts->bytes += bytes;
    }
}

/* As many fronts as are asked for; again with less where they became larger than planned and than `memory`. */
bool pl_fronts_build(pl_scene *scene, pl_error *error)
{
    pl_fronts *fronts = scene->structure = calloc(1, sizeof *fronts);
    if (!fronts) return pl_fail_memory(error, "building the fronts");
    const pl_options *options = &scene->options;
    pl_compositions *compositions = pl_compositions_create(&scene->states, error);
    size_t states;
    bool ok = compositions && pl_states_packed_bytes(&scene->states, &states, error);
    for (double share = 1.0; ok;) {
        ok = build_planned(scene, compositions, share, fronts, error);
        const double room = memory_of(scene) - (double)states;
        if (!options->memory || options->front_items || (double)fronts->bytes <= room) break;
        share *= SHRINK * room / (double)fronts->bytes;
        if (ok) clear(fronts);
    }
    pl_compositions_free(compositions);
    if (!ok || !pl_states_pack(&scene->states, error)) return false;
    link_fronts(scene, fronts);
    return true;
}

void pl_fronts_destroy(pl_scene *scene)
{
    pl_fronts *fronts = scene->structure;
    scene->structure = NULL;
    if (!fronts) return;
    clear(fronts);
    free(fronts);
}

void pl_fronts_count(const pl_scene *scene, pl_statistics *counts)
{
    const pl_fronts *fronts = scene->structure;
    counts->front_count = fronts->count;
    counts->front_items = fronts->items;
    counts->front_instances = fronts->instances;
    counts->front_limit = fronts->instances ? fronts->most_items : UINT64_MAX;
    counts->bytes_nodes = fronts->node_bytes;
    counts->bytes_items = fronts->bytes - fronts->node_bytes;
    counts->isa = scene->isa;
    counts->front_pilot_rays = fronts->pilot_rays;
    counts->front_flat_bytes = fronts->flat_bytes;
    counts->front_entries = fronts->entries;
    counts->front_pilot_seconds = fronts->pilot_seconds;
}

bool pl_front_add_items(pl_items *items, const pl_states *states, const pl_front *front, uint32_t opened, const pl_item *last)
{
    const pl_item *leaf = pl_front_leaf(states, last);
    size_t begin = items->count, count = leaf && leaf != last ? 2 : 1;
    for (uint32_t at = opened; at; at = front->opened[at].parent) count++;
    if (begin + count > items->capacity) {
        size_t capacity = 2 * (begin + count) + 16;
        const pl_item **list = realloc(items->list, capacity * sizeof *list);
        if (!list) return false;
        items->list = list;
        items->capacity = capacity;
    }
    items->count = begin + count;
    if (leaf && leaf != last) items->list[begin + --count] = leaf;
    items->list[begin + --count] = last;
    for (uint32_t at = opened; at; at = front->opened[at].parent)
        items->list[begin + --count] = pl_front_item(states, front->opened[at].item);
    return true;
}
