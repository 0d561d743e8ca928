/* front_levels.c - on which levels of a scene there are fronts at all (front_plan.c).
 *
 * A plan that opens instances one by one never sees that a front is no longer needed when *all* instances of its state are
 * open: then its bytes are saved and its visits too. In a tree of 14 levels, whose states are entered by the next level
 * only, three tall fronts take no more memory than ten low ones, and a ray enters a third of the instances.
 *
 * So levels are chosen first. A state's level is its depth; if fronts are on levels l0 > l1 > … only, those on li are opened
 * down to l(i+1), and a ray enters what is visited on the chosen levels, which doesn't depend on the choice:
 *
 *     best(i) = min over j of  price · bytes(i, j) + visits(j) + best(j)
 *
 *     14 levels of a binary tree → {14, 9, 4}
 *
 * Where states enter others several levels below, bytes(i, j) is an estimate; the plan counts again. */
#include "front.h"

#include <math.h>
#include <stdlib.h>

enum { MOST_LEVELS = 64, MOST_WORK = 1 << 22 };

struct pl_front_levels {
    uint32_t count; /* of levels besides the scene itself, which is level 0 … */
    uint32_t depth[MOST_LEVELS + 2]; /* … falling; behind the last one 0 */
    double visits[MOST_LEVELS + 2];
    double bytes[MOST_LEVELS + 1][MOST_LEVELS + 2];
};

/* The levels of states that have visits. false: too many. */
static bool find_levels(pl_front_levels *levels, const pl_front_plan *plan)
{
    const pl_states *states = plan->compositions->states;
    for (uint32_t i = 1; i < states->count; i++) {
        const uint32_t state = plan->order[i], depth = states->list[state].depth;
        if (!(plan->visits[state] > 0.0) || states->list[state].endless) continue;
        if (levels->count == 0 || depth != levels->depth[levels->count]) {
            if (levels->count == MOST_LEVELS) return false;
            levels->depth[++levels->count] = depth;
        }
        levels->visits[levels->count] += plan->visits[state];
    }
    return true;
}

/* The highest level that isn't above a depth. */
static uint32_t level_of(const pl_front_levels *levels, uint32_t depth)
{
    uint32_t level = 1;
    while (levels->depth[level] > depth) level++;
    return level;
}

/* Bytes of each state, opened down to a level; those of fronts are added up by their levels. */
static void add_bytes(pl_front_levels *levels, uint32_t end, const pl_front_plan *plan, double *bytes)
{
    const pl_states *states = plan->compositions->states;
    for (uint32_t i = states->count; i-- > 0;) {
        const uint32_t index = plan->order[i];
        const pl_state *state = &states->list[index];
        bytes[index] = sizeof(pl_opened);
        for (uint32_t k = 0; k < state->item_count; k++) {
            const pl_item *item = &state->items[k];
            if (!pl_front_occurs(states, item)) continue;
            if (pl_front_leaf(states, item)) bytes[index] += pl_front_primitive_bytes();
            else if (plan->single[item->what] || states->list[item->what].depth > levels->depth[end])
                bytes[index] += bytes[item->what];
            else bytes[index] += pl_front_instance_share(plan->fine[index]);
        }
        const uint32_t level = i == 0 ? 0 : level_of(levels, state->depth);
        if (plan->visits[index] > 0.0 && level < end) levels->bytes[level][end] += PL_FRONT_BYTES + bytes[index];
    }
}

pl_front_levels *pl_front_levels_create(const pl_front_plan *plan)
{
    const pl_states *states = plan->compositions->states;
    pl_front_levels *levels = calloc(1, sizeof *levels);
    double *bytes = malloc(states->count * sizeof *bytes);
    const bool ok = levels && bytes && find_levels(levels, plan) && levels->count * states->item_count <= MOST_WORK;
    for (uint32_t end = 1; ok && end <= levels->count + 1; end++) add_bytes(levels, end, plan, bytes);
    free(bytes);
    if (ok) return levels;
    free(levels);
    return NULL;
}

void pl_front_levels_choose(const pl_front_levels *levels, double price, pl_front_plan *plan)
{
    const pl_states *states = plan->compositions->states;
    double best[MOST_LEVELS + 2] = {0};
    uint32_t next[MOST_LEVELS + 1] = {0};
    bool chosen[MOST_LEVELS + 2] = {0};
    for (uint32_t i = levels->count + 1; i-- > 0;) {
        best[i] = INFINITY;
        for (uint32_t j = i + 1; j <= levels->count + 1; j++) {
            const double cost = price * levels->bytes[i][j] + levels->visits[j] + best[j];
            if (!(cost < best[i]) && j > i + 1) continue;
            best[i] = cost;
            next[i] = j;
        }
    }
    for (uint32_t i = next[0]; i <= levels->count; i = next[i]) chosen[i] = true;
    for (uint32_t i = 1; i < states->count; i++) {
        const pl_state *state = &states->list[i];
        const uint32_t level = level_of(levels, state->depth);
        const bool here = levels->depth[level] == state->depth && chosen[level];
        plan->price_free[i] = plan->single[i] || (!here && !state->endless);
    }
}
