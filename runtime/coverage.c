/* coverage.c - how much of its box's silhouette a state covers, seen from thirteen directions (cut.h).
 *
 * Random rays are sent through each state's box, stratified over the silhouette and turned a little about the
 * direction. A ray goes down the state's items as far as instances of an eighth of its size; those let through
 * 1 - coverage of their own. So a state's coverage is that of its parts, mean over rays, and a picture's brightness
 * stays when an instance is drawn instead of its parts. Finite states are done bottom up; endless ones begin with 1 and are
 * iterated towards their fixpoint. The rays' numbers are pure functions of state, direction and ray, so coverages are the
 * same in every run. */
#include <stdlib.h>

#include "cut.h"
#include "error.h"
#include "random.h"

enum { MOST_RAYS = 196, FEWEST_RAYS = 16, RAYS_IN_ALL = 1 << 19, ROUNDS = 24, MOST_STEPS = 4096 };

#define TURN 0.5     /* widths of the square of directions about each of the thirteen */
#define PARTS 0.125 /* of the diameter: instances so small aren't opened */

/* Signs of the thirteen directions. */
static const signed char directions[PL_COVERAGE_DIRECTIONS][3] = {
    {1, 0, 0}, {0, 1, 0},  {0, 0, 1}, {1, 1, 0},  {1, -1, 0},  {1, 0, 1},  {1, 0, -1},
    {0, 1, 1}, {0, 1, -1}, {1, 1, 1}, {1, 1, -1}, {1, -1, 1}, {-1, 1, 1}};

/* The nearest of the directions. */
static int direction_of(const double d[3])
{
    static const double scale[4] = {0.0, 1.0, 0.70710678118654752, 0.57735026918962576};
    double best = -1.0;
    int found = 0;
    for (int i = 0; i < PL_COVERAGE_DIRECTIONS; i++) {
        const signed char *s = directions[i];
        double along = fabs(d[0] * s[0] + d[1] * s[1] + d[2] * s[2]) * scale[abs(s[0]) + abs(s[1]) + abs(s[2])];
        if (along > best) {
            best = along;
            found = i;
        }
    }
    return found;
}

double pl_coverage_of(const pl_states *states, uint32_t state, const double d[3])
{
    return states->coverage[(size_t)state * PL_COVERAGE_DIRECTIONS + (size_t)direction_of(d)];
}

typedef struct passage {
    const pl_states *states;
    double smallest; /* diameter, in the first state's frame, of instances that are opened */
    int steps;
} passage;

/* The share of light that passes a state's items along a ray. Depth is bounded: sizes shrink to p->smallest, or steps
 * run out. */
static double passes(passage *p, uint32_t state, const double o[3], const double d[3], double stretch, bool whole)
{
    const pl_state *s = &p->states->list[state];
    double entry, light = 1.0;
    pl_slab slab = pl_slab_of(o, d, pl_reach_slack(&s->gate, o));
    if (s->unbounded || !pl_slab_hits(&slab, &s->box, -INFINITY, INFINITY, &entry)) return 1.0;
    if (!whole && (s->diameter * stretch <= p->smallest || p->steps <= 0))
        return 1.0 - pl_coverage_of(p->states, state, d);
    for (uint32_t i = 0; i < s->item_count && light > 0.0; i++) {
        const pl_item *item = &s->items[i];
        double at[3] = {o[0], o[1], o[2]}, along[3] = {d[0], d[1], d[2]}, size = stretch;
        pl_root roots[PL_SHAPE_ROOTS];
        for (uint32_t k = 0; k < item->transform_count; k++) {
            pl_affine_point(&item->transforms[k]->to_object, at, at);
            pl_affine_vector(&item->transforms[k]->to_object, along, along);
            size *= item->transforms[k]->stretch;
        }
        p->steps--;
        if (item->kind == PL_NODE_ENTER)
            light *= passes(p, item->what, at, along, size, false);
        else if (item->kind == PL_NODE_MESH)
            light *= !pl_mesh_nearest(p->states->meshes[item->what], at, along, -INFINITY, INFINITY, roots);
        else
            light *= !pl_shape_of(item->what)->roots(item->arguments, at, along, -INFINITY, INFINITY, roots);
    }
    return light;
}

/* Unit vectors along a direction and across it. */
static void make_frame(int direction, double s[3], double a[3], double b[3])
{
    double square = 0.0, norm = 0.0;
    for (int axis = 0; axis < 3; axis++) s[axis] = directions[direction][axis], square += s[axis] * s[axis];
    for (int axis = 0; axis < 3; axis++) s[axis] /= sqrt(square);
    int least = fabs(s[0]) <= fabs(s[1]) && fabs(s[0]) <= fabs(s[2]) ? 0 : fabs(s[1]) <= fabs(s[2]) ? 1 : 2;
    for (int axis = 0; axis < 3; axis++) a[axis] = (axis == least) - s[least] * s[axis], norm += a[axis] * a[axis];
    for (int axis = 0; axis < 3; axis++) a[axis] /= sqrt(norm);
    for (int axis = 0; axis < 3; axis++)
        b[axis] = s[(axis + 1) % 3] * a[(axis + 2) % 3] - s[(axis + 2) % 3] * a[(axis + 1) % 3];
}

/* Half of the box's width along a unit vector. */
static double half_width(const pl_box *box, const double a[3])
{
    double sum = 0.0;
    for (int axis = 0; axis < 3; axis++) sum += 0.5 * (box->hi[axis] - box->lo[axis]) * fabs(a[axis]);
    return sum;
}

/* The mean over rays through the box in about a direction: points of the rectangle about its silhouette, stratified. */
static double measure(const pl_states *states, uint32_t state, int direction, int rays, uint32_t round)
{
    const pl_box *box = &states->list[state].box;
    int side = (int)sqrt(rays), met = 0;
    double covered = 0.0, s[3], a[3], b[3];
    uint64_t key = pl_mix(pl_mix(state, (uint64_t)direction), round);
    make_frame(direction, s, a, b);
    const double wide = half_width(box, a), high = half_width(box, b);
    for (int i = 0; i < side * side; i++) {
        double u[4], o[3], d[3], entry;
        for (int k = 0; k < 4; k++) u[k] = pl_unit(pl_mix(pl_mix(key, (uint64_t)i), (uint64_t)k));
        const double x = wide * (2.0 * (i % side + u[0]) / side - 1.0);
        const double y = high * (2.0 * ((double)(i / side) + u[1]) / side - 1.0);
        for (int axis = 0; axis < 3; axis++) {
            o[axis] = 0.5 * (box->lo[axis] + box->hi[axis]) + x * a[axis] + y * b[axis];
            d[axis] = s[axis] + TURN * ((u[2] - 0.5) * a[axis] + (u[3] - 0.5) * b[axis]);
        }
        pl_slab slab = pl_slab_of(o, d, 0.0);
        if (!pl_slab_hits(&slab, box, -INFINITY, INFINITY, &entry)) continue;
        passage p = {states, PARTS * states->list[state].diameter, MOST_STEPS};
        met++;
        covered += 1.0 - passes(&p, state, o, d, 1.0, true);
    }
    return met ? covered / met : 1.0;
}

static void measure_state(pl_states *states, uint32_t state, int rays, uint32_t round)
{
    float *coverage = states->coverage + (size_t)state * PL_COVERAGE_DIRECTIONS;
    for (int i = 0; i < PL_COVERAGE_DIRECTIONS; i++) {
        double now = measure(states, state, i, rays, round);
        /* Later rounds of endless states are averaged, so that the sampling's noise dies out. */
        double share = round < ROUNDS / 2 ? 1.0 : 1.0 / (round - ROUNDS / 2 + 1.0);
        coverage[i] = (float)(coverage[i] + share * (now - coverage[i]));
    }
}

/* A state and its depth: sorted by it, what a finite state enters comes before it, and endless ones come last. */
typedef struct place {
    uint32_t depth, state;
} place;

static int compare_places(const void *a, const void *b)
{
    const place *x = a, *y = b;
    if (x->depth != y->depth) return x->depth < y->depth ? -1 : 1;
    return (x->state > y->state) - (x->state < y->state);
}

static bool is_measured(const pl_state *state)
{
    return !state->unbounded && !pl_box_is_empty(&state->box) && pl_box_is_finite(&state->box);
}

bool pl_coverage_build(pl_states *states, pl_error *error)
{
    size_t bytes = (size_t)states->count * PL_COVERAGE_DIRECTIONS * sizeof *states->coverage;
    if (states->bytes + bytes > states->limit)
        return pl_fail(error, PL_ERROR_LIMIT, "states", "memory: the coverages of %u states need %zu bytes more than allowed",
                       (unsigned)states->count, states->bytes + bytes - states->limit);
    states->coverage = malloc(bytes);
    if (!states->coverage) return pl_fail_memory(error, "measuring coverages");
    states->bytes += bytes;
    for (size_t i = 0; i < bytes / sizeof *states->coverage; i++) states->coverage[i] = 1.0f;
    uint32_t rays = RAYS_IN_ALL / PL_COVERAGE_DIRECTIONS / states->count;
    int count = rays > MOST_RAYS ? MOST_RAYS : rays < FEWEST_RAYS ? FEWEST_RAYS : (int)rays;
    int few = count / 4 < FEWEST_RAYS ? FEWEST_RAYS : count / 4; /* a round */
    place *order = malloc(states->count * sizeof *order);
    if (!order) return pl_fail_memory(error, "measuring coverages");
    for (uint32_t i = 0; i < states->count; i++) order[i] = (place){states->list[i].depth, i};
    qsort(order, states->count, sizeof *order, compare_places);
    for (uint32_t round = 0; round < ROUNDS; round++) {
        bool endless = false;
        for (uint32_t i = 0; i < states->count; i++) {
            const pl_state *state = &states->list[order[i].state];
            if (order[i].state == 0 || !is_measured(state) || (round > 0 && !state->endless)) continue;
            measure_state(states, order[i].state, state->endless ? few : count, round);
            endless = endless || state->endless;
        }
        if (!endless) break;
    }
    free(order);
    return true;
}
