/* coverage.c - how much of its box's silhouette a state covers, seen from thirteen directions (coverage.h).
 *
 * About each of the directions there are bundles of parallel rays through the state's box, stratified over its silhouette.
 * The state's *parts* are its primitives, and instances of at most an eighth of its size, which let through 1 - coverage
 * of their own. A part is tried by the rays that pass near its projection. So a state's coverage is that of its parts,
 * mean over rays, and a picture's brightness stays when an instance is drawn instead of its parts.
 *
 * Which parts a ray meets doesn't depend on what they cover. So it is found once; a finite state then follows from its
 * parts, and endless ones, all together, are iterated from 1 towards their fixpoint. The rays' numbers are pure functions of
 * state and direction, so coverages are the same in every run. */
#include "coverage_rays.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "error.h"

enum { ROUNDS = 200 };

#define SETTLED 1e-4f /* the iteration's last change */

/* Of one state, by direction, and the largest of them. */
typedef struct shares {
    float by[PL_COVERAGE_DIRECTIONS], most;
} shares;

struct pl_coverage {
    pl_states *states;
    pthread_mutex_t lock; /* of all but known */
    atomic_uchar *known;
    shares *shares;
};

/* --- shares --- */

/* Adds the rays of bundle `index` that are met; *next goes on to the meetings of the bundle after it. */
static void count_bundle(const shares *table, const pl_meetings *found, int index, size_t *next, double *covered, int *rays)
{
    float light[PL_BUNDLE_RAYS];
    for (int k = 0; k < PL_BUNDLE_RAYS; k++) light[k] = 1.0f;
    for (; *next < found->count && found->list[*next].bundle == index; ++*next) {
        const pl_meeting *m = &found->list[*next];
        light[m->ray] *= m->part ? 1.0f - table[m->part].by[m->direction] : 0.0f;
    }
    for (int k = 0; k < PL_BUNDLE_RAYS; k++)
        if (found->counted[index] >> k & 1) *covered += 1.0 - (double)light[k], ++*rays;
}

/* A state's shares from those of its parts; returns the largest change. */
static float evaluate(shares *table, uint32_t state, const pl_meetings *found)
{
    shares now = {.most = 0.0f};
    float change = 0.0f;
    size_t next = 0;
    for (int direction = 0, bundle = 0; direction < PL_COVERAGE_DIRECTIONS; direction++) {
        double covered = 0.0;
        int rays = 0;
        for (int i = 0; i < found->bundles * found->bundles; i++)
            count_bundle(table, found, bundle++, &next, &covered, &rays);
        now.by[direction] = rays ? (float)(covered / rays) : 1.0f;
        now.most = fmaxf(now.most, now.by[direction]);
        change = fmaxf(change, fabsf(now.by[direction] - table[state].by[direction]));
    }
    table[state] = now;
    return change;
}

static bool is_measured(const pl_states *states, uint32_t index)
{
    const pl_state *state = &states->list[index];
    return index && !state->unbounded && !pl_box_is_empty(&state->bounds->box) && pl_box_is_finite(&state->bounds->box);
}

static bool is_known(pl_coverage *c, uint32_t state)
{
    return atomic_load_explicit(&c->known[state], memory_order_acquire);
}

static void set_known(pl_coverage *c, uint32_t state)
{
    atomic_store_explicit(&c->known[state], 1, memory_order_release);
}

/* A state that waits for its parts. */
typedef struct waiting {
    uint32_t state;
    size_t next;
    pl_meetings found;
} waiting;

typedef struct wait_stack {
    waiting *list;
    size_t count, capacity;
} wait_stack;

static bool begin(pl_coverage *c, wait_stack *stack, uint32_t state)
{
    if (stack->count == stack->capacity) {
        size_t capacity = 2 * stack->capacity + 16;
        waiting *list = realloc(stack->list, capacity * sizeof *list);
        if (!list) return false;
        stack->list = list;
        stack->capacity = capacity;
    }
    waiting *w = &stack->list[stack->count++];
    w->state = state;
    w->next = 0;
    w->found = (pl_meetings){0};
    return !is_measured(c->states, state) || pl_meetings_find(c->states, state, &w->found);
}

/* Measures a finite state, those that its parts are first. Each waits for states deeper in the derivation. */
static bool measure(pl_coverage *c, uint32_t state)
{
    wait_stack stack = {0};
    bool ok = begin(c, &stack, state);
    while (ok && stack.count) {
        waiting *w = &stack.list[stack.count - 1];
        const pl_meetings *found = &w->found;
        while (w->next < found->count && is_known(c, found->list[w->next].part)) w->next++;
        if (w->next < found->count) {
            ok = begin(c, &stack, found->list[w->next].part);
            continue;
        }
        if (is_measured(c->states, w->state)) evaluate(c->shares, w->state, found);
        set_known(c, w->state);
        free(found->list);
        stack.count--;
    }
    while (stack.count) free(stack.list[--stack.count].found.list);
    free(stack.list);
    return ok;
}

/* Measures all endless states. */
static bool measure_endless(pl_coverage *c)
{
    const pl_states *states = c->states;
    pl_meetings *found = calloc(states->count, sizeof *found);
    bool ok = found != NULL;
    for (uint32_t i = 0; ok && i < states->count; i++) {
        if (!states->list[i].endless || !is_measured(states, i)) continue;
        ok = pl_meetings_find(states, i, &found[i]);
        for (size_t k = 0; ok && k < found[i].count; k++) {
            const uint32_t part = found[i].list[k].part;
            if (!states->list[part].endless && !is_known(c, part)) ok = measure(c, part);
        }
    }
    float change = 1.0f;
    for (int round = 0; ok && round < ROUNDS && change > SETTLED; round++) {
        change = 0.0f;
        for (uint32_t i = 0; i < states->count; i++)
            if (found[i].list) change = fmaxf(change, evaluate(c->shares, i, &found[i]));
    }
    for (uint32_t i = 0; found && i < states->count; i++) {
        free(found[i].list);
        if (ok && states->list[i].endless) set_known(c, i);
    }
    free(found);
    return ok;
}

static const shares *shares_of(const pl_states *states, uint32_t state)
{
    pl_coverage *c = states->coverage;
    bool ok = true;
    if (!is_known(c, state)) {
        pthread_mutex_lock(&c->lock);
        if (!is_known(c, state)) ok = states->list[state].endless ? measure_endless(c) : measure(c, state);
        pthread_mutex_unlock(&c->lock);
    }
    return ok ? &c->shares[state] : NULL;
}

double pl_coverage_of(const pl_states *states, uint32_t state, const double d[3])
{
    const shares *s = shares_of(states, state);
    return s ? s->by[pl_coverage_direction(d)] : -1.0;
}

double pl_coverage_most(const pl_states *states, uint32_t state)
{
    const shares *s = shares_of(states, state);
    return s ? s->most : -1.0;
}

/* --- the table --- */

pl_coverage *pl_coverage_create(pl_states *states, pl_error *error)
{
    const size_t bytes = sizeof(pl_coverage) + states->count * (sizeof(shares) + sizeof(atomic_uchar));
    if (states->bytes + bytes > states->limit) {
        pl_fail(error, PL_ERROR_LIMIT, "states", "memory: the coverages of %u states need %zu bytes more than allowed",
                (unsigned)states->count, states->bytes + bytes - states->limit);
        return NULL;
    }
    pl_coverage *c = calloc(1, sizeof *c);
    if (c) {
        c->states = states;
        pthread_mutex_init(&c->lock, NULL);
        c->shares = malloc(states->count * sizeof *c->shares);
        c->known = malloc(states->count * sizeof *c->known);
    }
    if (!c || !c->shares || !c->known) {
        pl_coverage_free(c);
        pl_fail_memory(error, "preparing the coverages");
        return NULL;
    }
    for (uint32_t i = 0; i < states->count; i++) {
        for (int k = 0; k < PL_COVERAGE_DIRECTIONS; k++) c->shares[i].by[k] = 1.0f;
        c->shares[i].most = 1.0f;
        atomic_init(&c->known[i], 0);
    }
    set_known(c, 0); /* which stands for primitives in pl_meetings */
    states->bytes += bytes;
    return c;
}

void pl_coverage_free(pl_coverage *c)
{
    if (!c) return;
    pthread_mutex_destroy(&c->lock);
    free(c->shares);
    free(c->known);
    free(c);
}
