/* front_plan.c - which states are opened in which fronts (front.h).
 *
 * A ray that enters an instance pays for mapping it and for looking at another front's root; opening the instance's
 * state in place saves that, and costs memory for a copy of the state's items. With p(i | s) the probability that a ray in
 * state s enters its item i, a front is expected to be visited v times a ray, and an instance in it, below items i1 …
 * in of opened states, v · p(i1) · … · p(in) times. An instance is opened where that pays for the memory at one
 * price for the whole scene:
 *
 *     visits > price · bytes                      (a Lagrange multiplier: no exchange of openings would be better)
 *
 * Parents are deeper than their children (pl_state.depth), so one pass in this order knows every front's v before it looks
 * at the front. The price is found by trying: lower ones until the memory is used up, or until a doubling of the memory no
 * longer wins 7 %. A price doesn't see that a front whose state is opened everywhere is gone: on which levels there are fronts
 * at all is chosen before (front_levels.c). What occurs once is opened always, since that copies nothing.
 *
 * p comes from the pilot's rays, and from areas where they haven't been: (entries + K·area share) / (visits + K). */
#include "front.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../error.h"

/* A primitive's share of nodes: about 7 of eight children are there, one of them a node. */
#define NODE_BYTES_AN_ITEM (sizeof(pl_front_node) / 5.8)
#define PRIMITIVE_BYTES (sizeof(pl_front_primitive) + NODE_BYTES_AN_ITEM)
#define INSTANCE_BYTES(fine) ((double)pl_front_instance_bytes(fine) + NODE_BYTES_AN_ITEM)
#define PRIOR_VISITS 8.0

/* Time besides instances, in instances: a ray of a flat scene takes about as long as entering so many (measured). */
#define REST_OF_A_RAY(primitives) fmax(1.0, 0.3 * log2(1.0 + (primitives)) - 1.2)
/* A doubling of memory must win 7 %: 2^-0.1 = 0.93. */
#define MEMORY_EXPONENT 0.1
/* That of fronts and as much as this, which rays take anyway: where there is less, doubling it is no matter. */
#define MEMORY_BESIDE 65536.0

/* Opening anything adds more bytes than this, or nothing. */
#define LEAST_STEP 1.0

/* Rounding an instance's map moves points by some 2^-23 in its unit frame. What this becomes in frames that are so many times
 * larger still isn't seen. */
#define COARSE_ZOOM 8192.0

enum { PRICES = 48 };

/* --- what is known of states before any price --- */

static int deeper(const void *a, const void *b)
{
    const pl_state *const *x = a, *const *y = b;
    if ((*x)->depth != (*y)->depth) return (*x)->depth > (*y)->depth ? -1 : 1;
    return *x < *y ? -1 : *x > *y;
}

/* States, each before those that it enters: the scene, then by depth. */
static bool sort_states(pl_front_plan *plan)
{
    const pl_states *states = plan->compositions->states;
    const pl_state **sorted = malloc(states->count * sizeof *sorted);
    if (!sorted) return false;
    for (uint32_t i = 0; i < states->count; i++) sorted[i] = &states->list[i];
    qsort(sorted + 1, states->count - 1, sizeof *sorted, deeper);
    for (uint32_t i = 0; i < states->count; i++) plan->order[i] = (uint32_t)(sorted[i] - states->list);
    free(sorted);
    return true;
}

/* Which states are opened always. */
static void find_free(pl_front_plan *plan, bool once_is_free)
{
    const pl_states *states = plan->compositions->states;
    uint32_t *references = plan->front_of; /* borrowed: counted once, then cleared */
    for (uint32_t i = 0; once_is_free && i < states->count; i++)
        for (uint32_t k = 0; k < states->list[i].item_count; k++) {
            const pl_item *item = &states->list[i].items[k];
            if (item->kind == PL_NODE_ENTER && pl_front_occurs(states, item)) references[item->what]++;
        }
    for (uint32_t i = 0; i < states->count; i++) {
        const pl_state *state = &states->list[i];
        uint32_t live = 0;
        for (uint32_t k = 0; k < state->item_count; k++) live += pl_front_occurs(states, &state->items[k]);
        plan->single[i] = plan->price_free[i] = (live <= 1 && !state->endless) || references[i] == 1;
    }
    memset(references, 0, states->count * sizeof *references);
}

/* How much larger the unit frame of any state below a state is told than in that state's own. */
static double find_zoom(const pl_front_plan *plan, const double *zoom, uint32_t index)
{
    const pl_states *states = plan->compositions->states;
    const pl_state *state = &states->list[index];
    double largest = 1.0;
    if (state->endless) return INFINITY;
    for (uint32_t k = 0; k < state->item_count; k++) {
        const pl_item *item = &state->items[k];
        if (item->kind != PL_NODE_ENTER || !pl_front_occurs(states, item)) continue;
        const double stretch = plan->compositions->list[plan->compositions->first[index] + k].stretch;
        const double grown = stretch * pl_front_scale(states, item->what) / pl_front_scale(states, index);
        largest = fmax(largest, grown * zoom[item->what]);
    }
    return largest;
}

/* The largest of that for instances in a front of the state, whatever is opened there; below: of the fronts of states that are
 * less deep. */
static double find_below(const pl_front_plan *plan, const double *zoom, const double *below, uint32_t index)
{
    const pl_states *states = plan->compositions->states;
    const pl_state *state = &states->list[index];
    double largest = 0.0;
    if (state->endless) return INFINITY;
    for (uint32_t k = 0; k < state->item_count; k++) {
        const pl_item *item = &state->items[k];
        if (item->kind != PL_NODE_ENTER || !pl_front_occurs(states, item)) continue;
        largest = fmax(largest, fmax(below[item->what], plan->price_free[item->what] ? 0.0 : zoom[item->what]));
    }
    return largest;
}

/* Where single precision isn't enough for the maps of instances. false: no memory. */
static bool find_fine(pl_front_plan *plan)
{
    const uint32_t count = plan->compositions->states->count;
    double *zoom = malloc(2 * (size_t)count * sizeof *zoom);
    if (!zoom) return false;
    double *below = zoom + count;
    for (uint32_t i = count; i-- > 0;) {
        const uint32_t index = plan->order[i];
        zoom[index] = find_zoom(plan, zoom, index);
        below[index] = find_below(plan, zoom, below, index);
        plan->fine[index] = !(below[index] <= COARSE_ZOOM);
    }
    free(zoom);
    return true;
}

/* What a copy of a state in another front adds: its items and itself, less the instance. What is opened always counts as
 * a part of the state that it stands in. */
static void find_bytes(pl_front_plan *plan)
{
    const pl_states *states = plan->compositions->states;
    for (uint32_t i = states->count; i-- > 0;) {
        const uint32_t index = plan->order[i];
        const pl_state *state = &states->list[index];
        const double instance_bytes = INSTANCE_BYTES(plan->fine[index]);
        double bytes = sizeof(pl_opened);
        for (uint32_t k = 0; k < state->item_count; k++) {
            const pl_item *item = &state->items[k];
            if (!pl_front_occurs(states, item)) continue;
            if (pl_front_leaf(states, item)) bytes += PRIMITIVE_BYTES;
            else bytes += instance_bytes + (plan->price_free[item->what] ? plan->bytes[item->what] : 0.0);
        }
        plan->bytes[index] = fmax(bytes - instance_bytes, 1.0);
    }
}

/* The probability that a ray in a state enters an item of it. */
static double probability(const pl_front_plan *plan, const pl_pilot *pilot, uint32_t state, uint32_t index)
{
    const pl_states *states = plan->compositions->states;
    const pl_item *item = &states->list[state].items[index];
    const size_t at = plan->compositions->first[state] + index;
    const double whole = pl_box_area(&states->list[state].bounds->box);
    const pl_box box = pl_box_map(&plan->compositions->list[at].to_parent, &states->list[item->what].bounds->box);
    double share = states->list[item->what].unbounded ? 1.0 : pl_box_area(&box) / whole;
    if (!(share < 1.0)) share = 1.0;
    return pilot ? (pilot->entries[at] + PRIOR_VISITS * share) / (pilot->visits[state] + PRIOR_VISITS) : share;
}

static void find_probabilities(pl_front_plan *plan, const pl_pilot *pilot)
{
    const pl_states *states = plan->compositions->states;
    for (uint32_t i = 0; i < states->count; i++)
        for (uint32_t k = 0; k < states->list[i].item_count; k++)
            if (states->list[i].items[k].kind == PL_NODE_ENTER)
                plan->probability[plan->compositions->first[i] + k] = (float)probability(plan, pilot, i, k);
}

pl_front_plan *pl_front_plan_create(const pl_compositions *compositions, const pl_pilot *pilot, bool once_is_free,
                                    pl_error *error)
{
    const uint32_t count = compositions->states->count;
    pl_front_plan *plan = calloc(1, sizeof *plan);
    if (plan) {
        plan->compositions = compositions;
        plan->order = malloc(count * sizeof *plan->order);
        plan->front_of = calloc(count, sizeof *plan->front_of);
        plan->bytes = calloc(count, sizeof *plan->bytes);
        plan->single = calloc(count, sizeof *plan->single);
        plan->price_free = calloc(count, sizeof *plan->price_free);
        plan->visits = malloc(count * sizeof *plan->visits);
        plan->threshold = malloc(count * sizeof *plan->threshold);
        plan->counts = calloc(count, sizeof *plan->counts);
        plan->fine = calloc(count, sizeof *plan->fine);
        plan->probability = calloc(compositions->first[count] + 1, sizeof *plan->probability);
        if (plan->order && plan->front_of && plan->bytes && plan->single && plan->price_free && plan->visits &&
            plan->threshold && plan->counts && plan->fine && plan->probability && sort_states(plan)) {
            find_free(plan, once_is_free);
            if (find_fine(plan)) {
                find_bytes(plan);
                find_probabilities(plan, pilot);
                return plan;
            }
        }
    }
    pl_front_plan_free(plan);
    pl_fail_memory(error, "planning the fronts");
    return NULL;
}

void pl_front_plan_free(pl_front_plan *plan)
{
    if (!plan) return;
    if (plan->hulls) pl_front_hulls_free(plan->hulls, plan->compositions->states->count);
    free(plan->order);
    free(plan->front_of);
    free(plan->bytes);
    free(plan->single);
    free(plan->price_free);
    free(plan->visits);
    free(plan->threshold);
    free(plan->probability);
    free(plan->counts);
    free(plan->fine);
    free(plan->counting.stack);
    free(plan);
}

double pl_front_primitive_bytes(void)
{
    return PRIMITIVE_BYTES;
}

double pl_front_instance_share(bool fine)
{
    return INSTANCE_BYTES(fine);
}

double pl_front_plan_flat_bytes(void)
{
    return PRIMITIVE_BYTES + sizeof(pl_opened);
}

/* --- one front --- */

static bool list_state(pl_state_list *states, uint32_t state)
{
    if (states->count == states->capacity) {
        size_t more = 2 * states->capacity + 64;
        uint32_t *list = realloc(states->list, more * sizeof *list);
        if (!list) return false;
        states->list = list;
        states->capacity = more;
    }
    states->list[states->count++] = state;
    return true;
}

/* Given to an instance's state whatever its probability, which may be too small for a number: it has a front. */
#define LEAST_VISITS 1e-300

/* States opened for an item that stays: a recursion through states of one item each would open without end. */
enum { OPENED_AN_ITEM = 16 };

/* What stands below a state in a front, once that is reached; gives up above `most` items. visits: where not NULL, those
 * of the instances' states grow by `share` times the probability of entering them. */
static bool count_below(const pl_front_plan *plan, pl_front_counting *counting, pl_plan_entry from, double threshold,
                        uint64_t most, double share, double *visits, pl_front_counts *counts)
{
    const pl_states *states = plan->compositions->states;
    size_t top = 0;
    *counts = (pl_front_counts){.whole = true};
    for (pl_plan_entry at = from;;) {
        const pl_state *it = &states->list[at.state];
        const float *probabilities = plan->probability + plan->compositions->first[at.state];
        counts->opened++;
        if (top + it->item_count > counting->capacity) {
            size_t capacity = 2 * (top + it->item_count) + 64;
            pl_plan_entry *stack = realloc(counting->stack, capacity * sizeof *stack);
            if (!stack) return false;
            counting->stack = stack;
            counting->capacity = capacity;
        }
        for (uint32_t i = 0; i < it->item_count; i++) {
            const pl_item *item = &it->items[i];
            if (!pl_front_occurs(states, item)) continue;
            const double reached = at.reached * (double)probabilities[i];
            if (pl_front_leaf(states, item)) {
                counts->primitives++;
            } else if (pl_front_opens(plan, threshold, reached, item->what)) {
                counting->stack[top++] = (pl_plan_entry){item->what, reached};
            } else {
                counts->instances++;
                if (counting->closed && !list_state(counting->closed, item->what)) return false;
                if (visits) visits[item->what] += share * reached + LEAST_VISITS;
            }
        }
        counts->whole = counts->primitives + counts->instances + top <= most && counts->opened / OPENED_AN_ITEM <= most;
        if (top == 0 || !counts->whole) return true;
        at = counting->stack[--top];
    }
}

static bool count_front(pl_front_plan *plan, uint32_t state, double threshold, uint64_t most, double share,
                        double *visits, pl_front_counts *counts)
{
    return count_below(plan, &plan->counting, (pl_plan_entry){state, 1.0}, threshold, most, share, visits, counts);
}

bool pl_front_plan_count(const pl_front_plan *plan, pl_front_counting *counting, uint32_t front, uint32_t state,
                         double reached, pl_front_counts *counts)
{
    return count_below(plan, counting, (pl_plan_entry){state, reached}, plan->threshold[front], UINT64_MAX, 0.0, NULL,
                       counts);
}

static double bytes_of(const pl_front_plan *plan, uint32_t state, const pl_front_counts *counts)
{
    return PL_FRONT_BYTES + (double)counts->primitives * PRIMITIVE_BYTES +
           (double)counts->instances * INSTANCE_BYTES(plan->fine[state]) + (double)counts->opened * sizeof(pl_opened);
}

/* --- all fronts at a price --- */

typedef struct outcome {
    double bytes, entries; /* of instances, a ray */
    uint64_t instances;
    bool whole;            /* not given up above `enough` bytes */
} outcome;

/* Sets the thresholds of all fronts that there are at a price. Only a state with visits has a front. */
static bool try_price(pl_front_plan *plan, double price, double enough, outcome *out)
{
    const uint32_t count = plan->compositions->states->count;
    *out = (outcome){.whole = true};
    if (plan->levels && price > 0.0) {
        pl_front_levels_choose(plan->levels, price, plan);
        find_bytes(plan);
    }
    for (uint32_t i = 0; i < count; i++) plan->visits[i] = 0.0;
    plan->visits[0] = 1.0;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t state = plan->order[i];
        pl_front_counts counts;
        if (!(plan->visits[state] > 0.0)) continue;
        plan->threshold[state] = price < 0.0 ? -1.0 : price / plan->visits[state];
        const double most = (enough - out->bytes) / PRIMITIVE_BYTES;
        if (!count_front(plan, state, plan->threshold[state], most < 1e15 ? (uint64_t)most + 1 : UINT64_MAX,
                         plan->visits[state], plan->visits, &counts))
            return false;
        plan->counts[state] = counts;
        out->bytes += bytes_of(plan, state, &counts);
        out->instances += counts.instances;
        if (i > 0) out->entries += plan->visits[state];
        out->whole = counts.whole && out->bytes <= enough;
        if (!out->whole) return true;
    }
    return true;
}

static double time_of(const pl_front_plan *plan, const outcome *out)
{
    return out->entries + REST_OF_A_RAY((double)plan->compositions->states->list[0].primitives);
}

/* What plans are compared by, the least is best; time alone where memory is to be filled. */
static double cost_of(const pl_front_plan *plan, const outcome *out, bool fill)
{
    return time_of(plan, out) * (fill ? 1.0 : pow(out->bytes + MEMORY_BESIDE, MEMORY_EXPONENT));
}

/* A price and what comes of it. */
typedef struct choice {
    double price, cost;
} choice;

/* Lower prices from one that fits, until they no longer fit into `most` bytes: the one that costs least. first: the outcome of
 * the first. */
static bool find_price(pl_front_plan *plan, double price, const outcome *first, double most, bool fill, choice *best)
{
    double fits = price, too_low = 0.0;
    outcome out = *first;
    *best = (choice){price, INFINITY};
    for (int i = 0; i < PRICES; i++) {
        if (out.whole) {
            const double cost = cost_of(plan, &out, fill);
            if (cost < best->cost) *best = (choice){price, cost};
            fits = price;
        } else {
            too_low = price;
        }
        if (out.instances == 0 || (too_low > 0.0 && fits < 1.1 * too_low)) break;
        price = too_low > 0.0 ? sqrt(fits * too_low) : fits / (fill ? 4.0 : 2.0);
        if (!try_price(plan, price, most, &out)) return false;
    }
    return true;
}

/* Fronts on all levels or on some, whichever is better, at the best price. closed: with nothing opened. */
static bool find_plan(pl_front_plan *plan, const pl_front_levels *levels, const outcome *closed, double most, bool fill,
                      double *price)
{
    choice all, coarse, some = {.cost = INFINITY};
    outcome out;
    const double highest = closed->entries / LEAST_STEP;
    if (!find_price(plan, highest, closed, most, fill, &all)) return false;
    *price = all.price;
    if (!levels) return true;
    plan->levels = levels;
    bool ok = try_price(plan, highest, most, &out) && find_price(plan, highest, &out, most, fill, &coarse) &&
              try_price(plan, coarse.price, most, &out);
    plan->levels = NULL; /* from here on they stay */
    ok = ok && find_price(plan, coarse.price, &out, most, fill, &some);
    if (some.cost < all.cost) {
        *price = some.price;
    } else {
        memcpy(plan->price_free, plan->single, plan->compositions->states->count * sizeof *plan->single);
        find_bytes(plan);
    }
    return ok;
}

bool pl_front_plan_budget(pl_front_plan *plan, double budget, bool fill, double *floor, bool *fits, pl_error *error)
{
    outcome out;
    double best = INFINITY;
    bool ok = try_price(plan, INFINITY, INFINITY, &out);
    *floor = out.bytes;
    *fits = ok && out.bytes <= budget;
    if (*fits) {
        const outcome closed = out;
        pl_front_levels *levels = pl_front_levels_create(plan);
        const double whole = (double)plan->compositions->states->list[0].primitives * PRIMITIVE_BYTES;
        out.whole = false;
        if (whole <= budget) ok = try_price(plan, -1.0, budget, &out);
        if (out.whole) best = -1.0;
        else ok = ok && find_plan(plan, levels, &closed, budget, fill, &best);
        free(levels);
    }
    ok = ok && try_price(plan, best, INFINITY, &out);
    plan->estimate = out.bytes;
    plan->entries = out.entries;
    return ok || pl_fail_memory(error, "planning the fronts");
}

/* --- so many items a front --- */

/* The lowest threshold at which a front has no more than `most` items. */
static bool limit_front(pl_front_plan *plan, uint32_t state, uint64_t most)
{
    double fits = INFINITY, too_low = 0.0, threshold = -1.0;
    pl_front_counts counts;
    for (int i = 0; i < PRICES; i++) {
        if (!count_front(plan, state, threshold, most, 0.0, NULL, &counts)) return false;
        if (counts.whole) fits = threshold;
        else too_low = fmax(threshold, too_low);
        /* No item is reached with more than 1, so above that nothing is opened. */
        if (fits < 0.0 || too_low >= 1.0 || fits < 1.001 * too_low) break;
        threshold = isinf(fits) ? 1.0 / LEAST_STEP : too_low > 0.0 ? sqrt(fits * too_low) : fits / 16.0;
    }
    plan->threshold[state] = fits;
    return true;
}

bool pl_front_plan_items(pl_front_plan *plan, uint64_t most, pl_error *error)
{
    const uint32_t count = plan->compositions->states->count;
    bool ok = true;
    for (uint32_t i = 0; i < count; i++) plan->visits[i] = 0.0;
    plan->visits[0] = 1.0;
    for (uint32_t i = 0; i < count && ok; i++) {
        const uint32_t state = plan->order[i];
        pl_front_counts counts;
        if (!(plan->visits[state] > 0.0)) continue;
        plan->threshold[state] = -1.0;
        ok = (most == UINT64_MAX || limit_front(plan, state, most)) &&
             count_front(plan, state, plan->threshold[state], UINT64_MAX, plan->visits[state], plan->visits, &counts);
        plan->counts[state] = counts;
        plan->estimate += bytes_of(plan, state, &counts);
        if (i > 0) plan->entries += plan->visits[state];
    }
    return ok || pl_fail_memory(error, "planning the fronts");
}

bool pl_front_plan_single(pl_front_plan *plan, uint32_t state, uint64_t most, pl_front_counts *counts, pl_error *error)
{
    plan->threshold[state] = most ? -1.0 : (double)NAN;
    const bool ok = (most == UINT64_MAX || most == 0 || limit_front(plan, state, most)) &&
                    count_front(plan, state, plan->threshold[state], UINT64_MAX, 0.0, NULL, counts);
    plan->counts[state] = *counts;
    return ok || pl_fail_memory(error, "planning the fronts");
}
