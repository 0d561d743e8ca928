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
#include "coverage.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "error.h"
#include "random.h"

enum {
    SIDE = 8, /* of a bundle's square of rays */
    RAYS = SIDE * SIDE,
    MOST_PARTS = 1024,
    ROUNDS = 200,
    /* Bundles go in squares about a direction: 2·2 to 6·6. What is sparse needs many rays, and has few parts. */
    FEWEST_BUNDLES = 2,
    MOST_BUNDLES = 6,
    ALL_BUNDLES = PL_COVERAGE_DIRECTIONS * MOST_BUNDLES * MOST_BUNDLES,
    /* Parts times bundles, about each direction: shared by all states, but so many for one of them. */
    WORK = 1 << 16,
    LEAST_WORK = 512,
    MOST_WORK = 4096
};

#define TURN 0.5      /* widths of the square of directions about each of the thirteen */
#define PARTS 0.125   /* of the diameter: instances so small aren't opened */
#define SETTLED 1e-4f /* the iteration's last change */

/* Signs of the thirteen directions. */
static const signed char directions[PL_COVERAGE_DIRECTIONS][3] = {
    {1, 0, 0}, {0, 1, 0},  {0, 0, 1}, {1, 1, 0},  {1, -1, 0},  {1, 0, 1},  {1, 0, -1},
    {0, 1, 1}, {0, 1, -1}, {1, 1, 1}, {1, 1, -1}, {1, -1, 1}, {-1, 1, 1}};

/* Of one state, by direction, and the largest of them. */
typedef struct shares {
    float by[PL_COVERAGE_DIRECTIONS], most;
} shares;

/* A ray meets a part. */
typedef struct meeting {
    uint32_t part; /* a state; 0: a primitive */
    uint16_t bundle;
    uint8_t ray, direction; /* the direction in the part's frame */
} meeting;

typedef struct meetings {
    meeting *list;
    size_t count, capacity;
    uint16_t bundles; /* about each direction; squared */
    uint64_t counted[ALL_BUNDLES]; /* bits of the rays that meet the box at all */
} meetings;

struct pl_coverage {
    pl_states *states;
    pthread_mutex_t lock; /* of all but known */
    atomic_uchar *known;
    shares *shares;
};

/* The nearest of the directions: along the largest of |d|, its two largest or all three. */
int pl_coverage_direction(const double d[3])
{
    const double x = fabs(d[0]), y = fabs(d[1]), z = fabs(d[2]);
    const int least = x <= y && x <= z ? 0 : y <= z ? 1 : 2, most = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
    const double sum = x + y + z, two = (sum - fabs(d[least])) * 0.70710678118654752, three = sum * 0.57735026918962576;
    const bool nx = d[0] < 0.0, ny = d[1] < 0.0, nz = d[2] < 0.0;
    if (fabs(d[most]) >= two && fabs(d[most]) >= three) return most;
    if (two >= three) return least == 2 ? 3 + (nx != ny) : least == 1 ? 5 + (nx != nz) : 7 + (ny != nz);
    return nx == ny ? (nx == nz ? 9 : 10) : nx == nz ? 11 : 12;
}

/* --- parts --- */

typedef struct part {
    const pl_item *item; /* NULL: the state itself, as the first of the queue */
    pl_affine to_parent, to_object;
    double stretch;
    double centre[3], half[3][3]; /* of a box that holds it: half its edges, in the state's frame */
} part;

typedef struct parts {
    part *list; /* a queue: those before `head` were opened */
    size_t head, count, capacity;
} parts;

static void set_box(const pl_states *states, part *p)
{
    const pl_item *item = p->item;
    pl_box box;
    memset(p->half, 0, sizeof p->half);
    if (item->kind == PL_NODE_ENTER) {
        const pl_box *own = &states->list[item->what].bounds->box;
        double middle[3];
        for (int k = 0; k < 3; k++) {
            middle[k] = 0.5 * (own->lo[k] + own->hi[k]);
            for (int axis = 0; axis < 3; axis++)
                p->half[k][axis] = 0.5 * (own->hi[k] - own->lo[k]) * p->to_parent.m[4 * axis + k];
        }
        pl_affine_point(&p->to_parent, middle, p->centre);
        return;
    }
    if (item->kind == PL_NODE_MESH) box = pl_box_map(&p->to_parent, pl_mesh_box(states->meshes[item->what]));
    else box = pl_shape_box(pl_shape_of(item->what), item->arguments, p->to_parent.m);
    for (int axis = 0; axis < 3; axis++) {
        p->centre[axis] = 0.5 * (box.lo[axis] + box.hi[axis]);
        p->half[axis][axis] = 0.5 * (box.hi[axis] - box.lo[axis]);
    }
}

static bool add_part(const pl_states *states, parts *all, const part *parent, const pl_item *item)
{
    if (pl_item_primitives(states, item) == 0 || pl_item_unbounded(states, item)) return true;
    if (item->kind == PL_NODE_ENTER && pl_box_is_empty(&states->list[item->what].bounds->box)) return true;
    if (all->count == all->capacity) {
        size_t capacity = all->capacity ? 2 * all->capacity : 256;
        part *list = realloc(all->list, capacity * sizeof *list);
        if (!list) return false;
        all->list = list;
        all->capacity = capacity;
    }
    part *p = &all->list[all->count++];
    *p = *parent;
    p->item = item;
    for (uint32_t i = 0; i < item->transform_count; i++) {
        p->to_parent = pl_affine_multiply(&p->to_parent, &item->transforms[i]->to_parent);
        p->to_object = pl_affine_multiply(&item->transforms[i]->to_object, &p->to_object);
        p->stretch *= item->transforms[i]->stretch;
    }
    set_box(states, p);
    return true;
}

/* The parts of a state, those of no matter what size if there are too many: breadth first, so that all are opened alike. */
static bool find_parts(const pl_states *states, uint32_t state, parts *all)
{
    const double smallest = PARTS * states->list[state].bounds->diameter;
    const part whole = {.to_parent = pl_affine_identity(), .to_object = pl_affine_identity(), .stretch = 1.0};
    *all = (parts){0};
    for (uint32_t i = 0; i < states->list[state].item_count; i++)
        if (!add_part(states, all, &whole, &states->list[state].items[i])) return false;
    size_t kept = 0;
    while (all->head < all->count) {
        const part p = all->list[all->head++];
        const pl_state *below = p.item->kind == PL_NODE_ENTER ? &states->list[p.item->what] : NULL;
        if (!below || below->bounds->diameter * p.stretch <= smallest || all->count - all->head + kept >= MOST_PARTS) {
            all->list[kept++] = p;
            continue;
        }
        for (uint32_t i = 0; i < below->item_count; i++)
            if (!add_part(states, all, &p, &below->items[i])) return false;
    }
    all->count = kept;
    return true;
}

/* --- rays --- */

/* Parallel rays: ray i starts at origins[i], on the plane through the box's middle. */
typedef struct bundle {
    double d[3];
    double across[3], up[3];       /* of a point, moved along d onto the plane: its place there, in strata, from the middle */
    double origins[RAYS][3], enter[RAYS], leave[RAYS]; /* of the box */
} bundle;

/* Unit vectors along a direction and across it. */
void pl_coverage_frame(int direction, double s[3], double a[3], double b[3])
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

/* Half of the box's width along a unit vector; not 0. */
static double half_width(const pl_box *box, const double a[3])
{
    double sum = 0.0;
    for (int axis = 0; axis < 3; axis++) sum += 0.5 * (box->hi[axis] - box->lo[axis]) * fabs(a[axis]);
    return sum > 1e-300 ? sum : 1e-300;
}

/* [enter, leave] of a box; false: it isn't met. */
static bool meets_box(const pl_box *box, const double o[3], const double d[3], double *enter, double *leave)
{
    for (int axis = 0; axis < 3; axis++) {
        const double by = 1.0 / d[axis], a = (box->lo[axis] - o[axis]) * by, b = (box->hi[axis] - o[axis]) * by;
        const double near_t = a < b ? a : b, far_t = a < b ? b : a;
        if (near_t > *enter) *enter = near_t;
        if (far_t < *leave) *leave = far_t;
    }
    return *enter <= *leave;
}

/* The bits of its rays that meet the box. */
static uint64_t make_bundle(const pl_states *states, uint32_t state, int index, int bundles, bundle *made)
{
    const pl_box *box = &states->list[state].bounds->box;
    const int direction = index / (bundles * bundles), at = index % (bundles * bundles);
    const uint64_t key = pl_mix(state, (uint64_t)index);
    uint64_t met = 0;
    double s[3], a[3], b[3];
    pl_coverage_frame(direction, s, a, b);
    const double p = TURN * ((at % bundles + pl_unit(pl_mix(key, 2 * RAYS))) / bundles - 0.5);
    const double q = TURN * (((double)(at / bundles) + pl_unit(pl_mix(key, 2 * RAYS + 1))) / bundles - 0.5);
    const double wide = half_width(box, a), high = half_width(box, b);
    for (int axis = 0; axis < 3; axis++) {
        made->d[axis] = s[axis] + p * a[axis] + q * b[axis];
        made->across[axis] = (a[axis] - p * s[axis]) * (0.5 * SIDE / wide);
        made->up[axis] = (b[axis] - q * s[axis]) * (0.5 * SIDE / high);
    }
    for (int i = 0; i < RAYS; i++) {
        const double x = wide * (2.0 * (i % SIDE + pl_unit(pl_mix(key, 2 * (uint64_t)i))) / SIDE - 1.0);
        const double y = high * (2.0 * ((double)(i / SIDE) + pl_unit(pl_mix(key, 2 * (uint64_t)i + 1))) / SIDE - 1.0);
        for (int axis = 0; axis < 3; axis++)
            made->origins[i][axis] = 0.5 * (box->lo[axis] + box->hi[axis]) + x * a[axis] + y * b[axis];
        made->enter[i] = -INFINITY;
        made->leave[i] = INFINITY;
        if (meets_box(box, made->origins[i], made->d, &made->enter[i], &made->leave[i])) met |= UINT64_C(1) << i;
    }
    return met;
}

/* The strata that a part's projection touches, along one of the sides. */
static void touched(const double middle[3], const part *p, const double along[3], int *first, int *last)
{
    double at = 0.5 * SIDE, half = 0.0;
    for (int axis = 0; axis < 3; axis++) at += (p->centre[axis] - middle[axis]) * along[axis];
    for (int k = 0; k < 3; k++)
        half += fabs(p->half[k][0] * along[0] + p->half[k][1] * along[1] + p->half[k][2] * along[2]);
    const double lo = floor(at - half), hi = floor(at + half);
    *first = lo > 0.0 ? lo < SIDE ? (int)lo : SIDE : 0;
    *last = hi < SIDE - 1 ? hi >= 0.0 ? (int)hi : -1 : SIDE - 1;
}

static bool meets_part(const pl_states *states, const part *p, const double o[3], const double d[3], double enter,
                       double leave)
{
    const pl_item *item = p->item;
    pl_root roots[PL_SHAPE_ROOTS];
    double at[3];
    pl_affine_point(&p->to_object, o, at);
    if (item->kind == PL_NODE_ENTER) return meets_box(&states->list[item->what].bounds->box, at, d, &enter, &leave);
    if (item->kind == PL_NODE_MESH) return pl_mesh_nearest(states->meshes[item->what], at, d, -INFINITY, INFINITY, roots);
    return pl_shape_of(item->what)->roots(item->arguments, at, d, -INFINITY, INFINITY, roots) > 0;
}

static bool add_meeting(meetings *all, meeting m)
{
    if (all->count == all->capacity) {
        size_t capacity = all->capacity ? 2 * all->capacity : 4096;
        meeting *list = realloc(all->list, capacity * sizeof *list);
        if (!list) return false;
        all->list = list;
        all->capacity = capacity;
    }
    all->list[all->count++] = m;
    return true;
}

/* Sends a bundle of rays through the parts. */
static bool send(const pl_states *states, const double middle[3], const parts *all, const bundle *rays, uint16_t index,
                 meetings *found)
{
    uint64_t open = found->counted[index]; /* rays that meet the box and no primitive so far */
    for (size_t i = 0; i < all->count && open; i++) {
        const part *p = &all->list[i];
        int left, right, low, high;
        touched(middle, p, rays->across, &left, &right);
        touched(middle, p, rays->up, &low, &high);
        if (left > right || low > high) continue;
        double d[3];
        pl_affine_vector(&p->to_object, rays->d, d);
        const bool enters = p->item->kind == PL_NODE_ENTER;
        meeting m = {enters ? p->item->what : 0, index, 0, (uint8_t)pl_coverage_direction(d)};
        for (int y = low; y <= high; y++)
            for (int x = left; x <= right; x++) {
                const int ray = y * SIDE + x;
                if (!(open >> ray & 1) ||
                    !meets_part(states, p, rays->origins[ray], d, rays->enter[ray], rays->leave[ray]))
                    continue;
                m.ray = (uint8_t)ray;
                if (!enters) open &= ~(UINT64_C(1) << ray);
                if (!add_meeting(found, m)) return false;
            }
    }
    return true;
}

static bool find_meetings(const pl_states *states, uint32_t state, meetings *found)
{
    const pl_box *box = &states->list[state].bounds->box;
    const double middle[3] = {0.5 * (box->lo[0] + box->hi[0]), 0.5 * (box->lo[1] + box->hi[1]),
                              0.5 * (box->lo[2] + box->hi[2])};
    parts all;
    *found = (meetings){0};
    bool ok = find_parts(states, state, &all);
    const size_t share = WORK / states->count, work = share < LEAST_WORK ? LEAST_WORK : share > MOST_WORK ? MOST_WORK : share;
    found->bundles = FEWEST_BUNDLES;
    while (found->bundles < MOST_BUNDLES && (found->bundles + 1u) * (found->bundles + 1u) * all.count <= work) found->bundles++;
    for (uint16_t i = 0; ok && i < PL_COVERAGE_DIRECTIONS * found->bundles * found->bundles; i++) {
        bundle rays;
        found->counted[i] = make_bundle(states, state, i, found->bundles, &rays);
        ok = send(states, middle, &all, &rays, i, found);
    }
    free(all.list);
    return ok;
}

/* --- shares --- */

/* Adds the rays of bundle `index` that are met; *next goes on to the meetings of the bundle after it. */
static void count_bundle(const shares *table, const meetings *found, int index, size_t *next, double *covered, int *rays)
{
    float light[RAYS];
    for (int k = 0; k < RAYS; k++) light[k] = 1.0f;
    for (; *next < found->count && found->list[*next].bundle == index; ++*next) {
        const meeting *m = &found->list[*next];
        light[m->ray] *= m->part ? 1.0f - table[m->part].by[m->direction] : 0.0f;
    }
    for (int k = 0; k < RAYS; k++)
        if (found->counted[index] >> k & 1) *covered += 1.0 - (double)light[k], ++*rays;
}

/* A state's shares from those of its parts; returns the largest change. */
static float evaluate(shares *table, uint32_t state, const meetings *found)
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
    meetings found;
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
    w->found = (meetings){0};
    return !is_measured(c->states, state) || find_meetings(c->states, state, &w->found);
}

/* Measures a finite state, those that its parts are first. Each waits for states deeper in the derivation. */
static bool measure(pl_coverage *c, uint32_t state)
{
    wait_stack stack = {0};
    bool ok = begin(c, &stack, state);
    while (ok && stack.count) {
        waiting *w = &stack.list[stack.count - 1];
        const meetings *found = &w->found;
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
    meetings *found = calloc(states->count, sizeof *found);
    bool ok = found != NULL;
    for (uint32_t i = 0; ok && i < states->count; i++) {
        if (!states->list[i].endless || !is_measured(states, i)) continue;
        ok = find_meetings(states, i, &found[i]);
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
    set_known(c, 0); /* which stands for primitives in meetings */
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
