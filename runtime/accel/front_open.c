/* front_open.c - from a state to the items of its front, as planned (front_plan.c).
 *
 * Matrices are composed on the way down, with a bound of what composition and the normative chain can differ by:
 * a chain of maps x' = N·x + τ with stretches ν sends |x| to at most ν|x| + T, and rounds by at most
 * ε·(gain·|x| + base). Appending a second such chain to a first gives
 *
 *     T = ν2·T1 + T2    gain = ν2·gain1 + gain2·ν1    base = ν2·base1 + gain2·T1 + base2    ν = ν2·ν1
 *
 * The plan has counted a front's items, so they go straight to where they stay. Large fronts are opened by several threads:
 * from the state down until there are enough places to go on from, whose items are counted again to know where
 * each place's begin. So the order of items doesn't depend on the threads. */
#include "front.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "../error.h"

/* Roundings of one map, and as many for its composition. */
#define ROUNDINGS 32.0

enum { PARALLEL_ITEMS = 1 << 14, PLACES = 64, MOST_THREADS = 64 };

typedef pl_composition chain;

/* A state that is to be opened. */
typedef struct place {
    chain at;
    const pl_item *item; /* that leads to it; NULL: the front's own state */
    double reached;
    uint32_t parent;     /* opened */
    bool no_shadow;
} place;

/* Opening from one place on: where its items go. */
typedef struct opening {
    const pl_front_plan *plan;
    const pl_front *front;
    pl_front_items *items;
    size_t primitive, instance, opened; /* the next of each */
    place *stack;
    size_t count, capacity;
    bool odd; /* has items that are in no box */
    pl_front_bounds bounds;
} opening;

static chain chain_identity(void)
{
    return (chain){pl_affine_identity(), pl_affine_identity(), 1.0, 0.0, 0.0, 0.0};
}

static void chain_append(chain *first, const chain *second)
{
    double stretch = second->stretch;
    first->base = stretch * first->base + second->gain * first->offset + second->base;
    first->gain = stretch * first->gain + second->gain * first->stretch;
    first->offset = stretch * first->offset + second->offset;
    first->stretch *= stretch;
    first->to_parent = pl_affine_multiply(&first->to_parent, &second->to_parent);
    first->to_object = pl_affine_multiply(&second->to_object, &first->to_object);
}

static chain chain_of(const pl_transform *transform)
{
    const double *m = transform->to_object.m;
    double stretch = pl_largest_stretch(&transform->to_object);
    double offset = sqrt(m[3] * m[3] + m[7] * m[7] + m[11] * m[11]);
    return (chain){transform->to_parent, transform->to_object, stretch,
                   offset,               ROUNDINGS * stretch,  ROUNDINGS * offset};
}

pl_compositions *pl_compositions_create(const pl_states *states, pl_error *error)
{
    pl_compositions *made = calloc(1, sizeof *made);
    size_t total = 0;
    for (uint32_t i = 0; i < states->count; i++) total += states->list[i].item_count;
    if (made) {
        made->states = states;
        made->first = malloc((states->count + 1) * sizeof *made->first);
        made->list = malloc((total + 1) * sizeof *made->list);
    }
    if (!made || !made->first || !made->list) {
        pl_compositions_free(made);
        pl_fail_memory(error, "building the fronts");
        return NULL;
    }
    total = 0;
    for (uint32_t i = 0; i < states->count; i++) {
        const pl_state *state = &states->list[i];
        made->first[i] = total;
        for (uint32_t k = 0; k < state->item_count; k++) {
            const pl_item *item = &state->items[k];
            chain *whole = &made->list[total++];
            *whole = item->transform_count ? chain_of(item->transforms[0]) : chain_identity();
            for (uint32_t t = 1; t < item->transform_count; t++) {
                chain next = chain_of(item->transforms[t]);
                chain_append(whole, &next);
            }
        }
    }
    made->first[states->count] = total;
    return made;
}

size_t pl_compositions_bytes(const pl_compositions *compositions)
{
    const size_t states = compositions->states->count;
    return compositions->first[states] * sizeof *compositions->list + (states + 1) * sizeof *compositions->first;
}

void pl_compositions_free(pl_compositions *compositions)
{
    if (!compositions) return;
    free(compositions->first);
    free(compositions->list);
    pl_front_plan_free(compositions->single);
    free(compositions);
}

/* --- items --- */

/* A bound, and what its rounding to single precision and that of sums with it lose. */
static float bound(double x)
{
    return pl_round_up(x * (1.0 + 0x1p-20));
}

static double length(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

double pl_front_scale(const pl_states *states, uint32_t state)
{
    const pl_box *box = &states->list[state].bounds->box;
    double half = 0.0;
    if (pl_box_is_empty(box) || !pl_box_is_finite(box)) return 1.0;
    for (int axis = 0; axis < 3; axis++) half = fmax(half, 0.5 * box->hi[axis] - 0.5 * box->lo[axis]);
    return half > 0.0 ? fmin(1.0 / half, 1e300) : 1.0;
}

/* Slack: reach.h's (twice: boxes here are composed too), and moving a ray along itself to a front's box. */
void pl_front_set_frame(pl_front *front, const pl_states *states, uint32_t state)
{
    const pl_box *box = &states->list[state].bounds->box;
    front->state = state;
    front->box = *box;
    front->reach = states->list[state].bounds->reach;
    memset(front->centre, 0, sizeof front->centre);
    front->scale = pl_front_scale(states, state);
    front->framed = !pl_box_is_empty(box) && pl_box_is_finite(box);
    for (int axis = 0; front->framed && axis < 3; axis++) {
        front->centre[axis] = 0.5 * box->lo[axis] + 0.5 * box->hi[axis];
        front->half[axis] = (float)((0.5 * box->hi[axis] - 0.5 * box->lo[axis]) * front->scale);
    }
    const pl_reach *reach = &front->reach;
    double away = length(front->centre);
    front->slack_gain = bound(DBL_EPSILON * (2.0 * reach->gain + 16.0));
    front->slack_base = bound(DBL_EPSILON * front->scale *
                              (2.0 * (reach->gain * away + reach->base) + 16.0 * (away + reach->size)));
}

/* An item's box in the front's unit frame. What has none, or everything, is told by one that isn't in order: empty or NaN. */
static void set_box(opening *o, size_t index, const pl_box *box, bool unbounded, pl_ref ref)
{
    pl_boxed *boxed = &o->items->boxes[index];
    boxed->ref = ref;
    boxed->zero = 0.0f;
    for (int axis = 0; axis < 3; axis++) {
        boxed->lo[axis] = pl_round_down((box->lo[axis] - o->front->centre[axis]) * o->front->scale);
        boxed->hi[axis] = pl_round_up((box->hi[axis] - o->front->centre[axis]) * o->front->scale);
    }
    const bool empty = box->lo[0] > box->hi[0]; /* which NaN isn't */
    if (unbounded || !(empty || (pl_box_is_finite(box) && o->front->framed))) boxed->lo[0] = NAN;
    o->odd = o->odd || !(boxed->lo[0] <= boxed->hi[0]);
}

static uint32_t number_of(const pl_states *states, const pl_item *item)
{
    return (uint32_t)(item - states->items);
}

/* leaf: what the item is, or what stands alone in the state that it enters. */
static void add_primitive(opening *o, const chain *at, const pl_item *item, const pl_item *leaf, bool no_shadow)
{
    const pl_states *states = o->plan->compositions->states;
    const size_t place = o->primitive++;
    const double *m = at->to_object.m, *centre = o->front->centre;
    pl_front_primitive *p = &o->items->primitives[place];
    double square = 0.0, size = 1.0 / o->front->scale;
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) {
            double x = m[4 * r + c] * size;
            square += x * x;
            p->columns[3 * c + r] = (float)x;
        }
        p->columns[9 + r] =
            (float)(m[4 * r] * centre[0] + m[4 * r + 1] * centre[1] + m[4 * r + 2] * centre[2] + m[4 * r + 3]);
    }
    p->stretch = pl_round_up(sqrt(square) * (1.0 + 0x1p-20));
    p->opened = (uint32_t)o->opened - 1;
    p->item = number_of(states, item) | (no_shadow ? PL_NO_SHADOW : 0);
    const bool mesh = leaf->kind == PL_NODE_MESH;
    const pl_shape *shape = mesh ? NULL : pl_shape_of(leaf->what);
    const pl_box box = mesh ? pl_box_map(&at->to_parent, pl_mesh_box(states->meshes[leaf->what]))
                            : pl_shape_box(shape, leaf->arguments, at->to_parent.m);
    const uint32_t kind = mesh ? PL_KIND_MESH : leaf->what;
    if (pl_front_has_argument(kind)) p->argument = (float)leaf->arguments[0];
    else p->leaf = number_of(states, leaf);
    set_box(o, place, &box, !mesh && !shape->support, pl_ref_of(kind, (uint32_t)place));
}

static void join_bounds(pl_front_bounds *bounds, const pl_front_bounds *other)
{
    bounds->stretch = fmaxf(bounds->stretch, other->stretch);
    bounds->gain = fmaxf(bounds->gain, other->gain);
    bounds->base = fmaxf(bounds->base, other->base);
    bounds->rough = fmaxf(bounds->rough, other->rough);
}

/* The point of a front's unit frame that a chain brings to the origin of an instance's. *left: how far it misses that. Its
 * own map to the parent is inverse but for rounding, which one step of Newton's method makes up for. */
static void find_centre(double centre[3], const pl_front *outer, const pl_front *inner, const chain *at, double *left)
{
    double from[3], to[3], miss[3] = {0}, back[3];
    pl_affine_point(&at->to_parent, inner->centre, from);
    for (int axis = 0; axis < 3; axis++) centre[axis] = (from[axis] - outer->centre[axis]) * outer->scale;
    for (int step = 0; step < 2; step++) {
        pl_affine_vector(&at->to_parent, miss, back);
        for (int axis = 0; axis < 3; axis++) {
            centre[axis] -= back[axis] * outer->scale;
            from[axis] = outer->centre[axis] + centre[axis] / outer->scale;
        }
        pl_affine_point(&at->to_object, from, to);
        for (int axis = 0; axis < 3; axis++) miss[axis] = to[axis] - inner->centre[axis];
    }
    *left = length(miss) * inner->scale;
}

/* The map from a front's unit frame to that of an instance in it, and its bounds (front.h). Beyond what chain bounds: the
 * rounding of what is composed here, for points within a few units, and that of L for points of the instance's box.
 * fine may be NULL. */
static void set_instance_map(pl_front_instance *it, pl_front_fine *fine, const pl_front *outer, const pl_front *inner,
                             const chain *at, pl_front_bounds *bounds)
{
    const double size = 1.0 / outer->scale, zoom = inner->scale * size;
    double away = length(outer->centre), square = 0.0, rough = 0.0, left;
    find_centre(it->centre, outer, inner, at, &left);
    for (int r = 0; r < 3; r++) {
        double moved = 0.0;
        for (int c = 0; c < 3; c++) {
            const double exact = at->to_object.m[4 * r + c] * zoom;
            double kept = it->columns[3 * c + r] = (float)exact;
            if (fine) kept += (double)(fine->columns[3 * c + r] = (float)(exact - kept));
            double reach = 0.0; /* of the instance's box, from its middle along axis c of the front's unit frame */
            for (int k = 0; k < 3; k++) reach += fabs(at->to_parent.m[4 * c + k]) * (double)inner->half[k];
            square += kept * kept;
            moved += fabs(kept - exact) * reach / zoom;
        }
        rough += moved;
    }
    const double norm = sqrt(square), stretch = fmin(at->stretch * zoom, norm), offset = stretch * length(it->centre);
    const double gain = 2.0 * at->gain * zoom + ROUNDINGS * stretch;
    const double base = inner->scale * (at->gain * (2.0 * away + outer->reach.size) + at->base) + left / DBL_EPSILON +
                        ROUNDINGS * (offset + 4.0 * stretch + length(inner->centre) * inner->scale);
    /* Squares of numbers much smaller than these would be lost. */
    const bool told = outer->framed && norm > 1e-15;
    *bounds = (pl_front_bounds){bound(stretch / norm * (1.0 + 0x1p-19)), bound(DBL_EPSILON * gain / stretch),
                                bound(DBL_EPSILON * base / stretch), told ? bound(2.0 * rough) : INFINITY};
}

static void add_instance(opening *o, const chain *at, const pl_item *item, bool no_shadow)
{
    const pl_states *states = o->plan->compositions->states;
    const size_t place = o->instance++;
    pl_front inner = {0};
    pl_front_bounds bounds;
    pl_front_instance *it = &o->items->instances[place];
    *it = (pl_front_instance){.front = (o->plan->front_of[item->what] - 1) | (no_shadow ? PL_NO_SHADOW : 0)};
    o->items->places[place] = (pl_front_place){(uint32_t)o->opened - 1, number_of(states, item)};
    pl_front_set_frame(&inner, states, item->what);
    set_instance_map(it, o->items->fine ? &o->items->fine[place] : NULL, o->front, &inner, at, &bounds);
    if (inner.framed) join_bounds(&o->bounds, &bounds);
    const pl_box box = pl_front_instance_box(o->plan->hulls, states, item, &at->to_parent);
    set_box(o, o->items->primitive_count + place, &box, states->list[item->what].unbounded,
            pl_ref_of(PL_KIND_INSTANCE, (uint32_t)place));
}

static place *push(opening *o)
{
    if (o->count == o->capacity) {
        size_t more = 2 * o->capacity + 64;
        place *stack = realloc(o->stack, more * sizeof *stack);
        if (!stack) return NULL;
        o->stack = stack;
        o->capacity = more;
    }
    return &o->stack[o->count++];
}

/* Lists what a state consists of: primitives and instances at once, what is to be opened on the stack, the first on
 * top. */
static bool open_state(opening *o, const place *from)
{
    const pl_compositions *made = o->plan->compositions;
    const pl_states *states = made->states;
    const uint32_t state = from->item ? from->item->what : o->front->state, opened = (uint32_t)o->opened++;
    const pl_state *it = &states->list[state];
    pl_opened *list = o->items->opened;
    const uint32_t parent = from->parent;
    if (from->item) {
        const bool moved = parent && pl_front_item(states, list[parent].item)->transform_count;
        list[opened] = (pl_opened){.item = number_of(states, from->item),
                                   .parent = parent,
                                   .above = moved ? parent : list[parent].above};
    } else {
        list[opened] = (pl_opened){0};
    }
    for (uint32_t i = it->item_count; i-- > 0;) {
        const pl_item *item = &it->items[i];
        const size_t composition = made->first[state] + i;
        if (!pl_front_occurs(states, item)) continue;
        const bool no_shadow = from->no_shadow || item->no_shadow;
        const double reached = from->reached * (double)o->plan->probability[composition];
        const pl_item *leaf = pl_front_leaf(states, item);
        if (!leaf && pl_front_opens(o->plan, o->plan->threshold[o->front->state], reached, item->what)) {
            place *next = push(o);
            if (!next) return false;
            *next = (place){from->at, item, reached, opened, no_shadow};
            chain_append(&next->at, &made->list[composition]);
            continue;
        }
        chain at = from->at;
        chain_append(&at, &made->list[composition]);
        if (leaf && leaf != item) chain_append(&at, &made->list[made->first[item->what]]);
        if (leaf) add_primitive(o, &at, item, leaf, no_shadow || leaf->no_shadow);
        else add_instance(o, &at, item, no_shadow);
    }
    return true;
}

/* Opens what stands on the stack, and what comes of it. */
static bool open_all(opening *o)
{
    while (o->count) {
        const place next = o->stack[--o->count];
        if (!open_state(o, &next)) return false;
    }
    return true;
}

/* --- several threads --- */

typedef struct task {
    opening *openings;
    int number;
    atomic_int next;
    atomic_bool failed;
} task;

static void *work(void *context)
{
    task *t = context;
    for (int i; (i = atomic_fetch_add(&t->next, 1)) < t->number;)
        if (!open_all(&t->openings[i])) atomic_store(&t->failed, true);
    return NULL;
}

/* Takes the places on o's stack apart. */
static bool open_parallel(opening *o, int threads, pl_front_counting *counting)
{
    opening openings[2 * PLACES];
    pthread_t started[MOST_THREADS];
    task t = {.openings = openings};
    int others = 0;
    bool ok = true;
    for (size_t i = 0; i < o->count && ok; i++, t.number++) {
        pl_front_counts counts;
        const place *from = &o->stack[i];
        openings[i] = (opening){.plan = o->plan, .front = o->front, .items = o->items,
                                .primitive = o->primitive, .instance = o->instance, .opened = o->opened};
        place *own = push(&openings[i]);
        ok = own && pl_front_plan_count(o->plan, counting, o->front->state, from->item->what, from->reached, &counts);
        if (!ok) continue;
        *own = *from;
        o->primitive += counts.primitives;
        o->instance += counts.instances;
        o->opened += counts.opened;
    }
    if (threads > MOST_THREADS) threads = MOST_THREADS;
    while (ok && others < threads - 1 && pthread_create(&started[others], NULL, work, &t) == 0) others++;
    if (ok) work(&t);
    for (int i = 0; i < others; i++) pthread_join(started[i], NULL);
    for (int i = 0; i < t.number; i++) {
        o->odd = o->odd || openings[i].odd;
        join_bounds(&o->bounds, &openings[i].bounds);
        free(openings[i].stack);
    }
    o->count = 0;
    return ok && !atomic_load(&t.failed);
}

/* Opens breadth first until there are PLACES on the stack; a state that has more children than that is left. */
static bool open_widely(opening *o)
{
    while (o->count && o->count < PLACES) {
        const place next = o->stack[0];
        memmove(o->stack, o->stack + 1, --o->count * sizeof *o->stack);
        if (!open_state(o, &next)) return false;
    }
    return true;
}

/* Moves what is in no box out of the boxes: empty ones hold nothing to hit, the others are always visited. */
static bool sort_out(pl_front_items *items)
{
    size_t unbounded = 0, kept = 0;
    for (size_t i = 0; i < items->box_count; i++) unbounded += isnan(items->boxes[i].lo[0]);
    if (!(items->unbounded = malloc((unbounded + 1) * sizeof *items->unbounded))) return false;
    for (size_t i = 0; i < items->box_count; i++) {
        const pl_boxed *box = &items->boxes[i];
        if (isnan(box->lo[0])) items->unbounded[items->unbounded_count++] = box->ref;
        else if (box->lo[0] <= box->hi[0]) items->boxes[kept++] = *box;
    }
    items->box_count = kept;
    return true;
}

static void *allocate(size_t count, size_t element)
{
    return aligned_alloc(64, (count * element + 64) & ~(size_t)63);
}

bool pl_front_open(const pl_front_plan *plan, const pl_front *front, int threads, pl_front_items *items, pl_error *error)
{
    const pl_front_counts *counts = &plan->counts[front->state];
    *items = (pl_front_items){.primitive_count = counts->primitives,
                              .instance_count = counts->instances,
                              .opened_count = counts->opened,
                              .box_count = counts->primitives + counts->instances};
    items->primitives = allocate(items->primitive_count, sizeof *items->primitives);
    items->instances = allocate(items->instance_count, pl_front_instance_bytes(plan->fine[front->state]));
    items->places = (pl_front_place *)(items->instances + items->instance_count);
    items->fine = plan->fine[front->state] ? (pl_front_fine *)(items->places + items->instance_count) : NULL;
    items->opened = malloc(items->opened_count * sizeof *items->opened);
    items->boxes = allocate(items->box_count, sizeof *items->boxes);
    bool ok = items->primitives && items->instances && items->opened && items->boxes;
    opening o = {.plan = plan, .front = front, .items = items};
    place *root = ok ? push(&o) : NULL;
    if (root) *root = (place){.at = chain_identity(), .reached = 1.0};
    ok = root != NULL;
    if (ok && items->box_count >= PARALLEL_ITEMS) {
        pl_front_counting counting = {0};
        ok = open_widely(&o) && (o.count > 2 * PLACES || open_parallel(&o, threads, &counting));
        free(counting.stack);
    }
    ok = ok && open_all(&o);
    free(o.stack);
    items->bounds = o.bounds;
    if (ok && o.odd) ok = sort_out(items);
    return ok || pl_fail_memory(error, "building the fronts");
}

void pl_front_items_free(pl_front_items *items)
{
    free(items->primitives);
    free(items->instances);
    free(items->opened);
    free(items->unbounded);
    free(items->boxes);
    memset(items, 0, sizeof *items);
}
