/* front_open.c - from a state to the items of its front: child states are opened, the largest first (front.h).
 *
 * Matrices are composed on the way down, with a bound of what composition and the normative chain can differ by:
 * a chain of maps x' = N·x + τ with stretches ν sends |x| to at most ν|x| + T, and rounds by at most
 * ε·(gain·|x| + base). Appending a second such chain to a first gives
 *
 *     T = ν2·T1 + T2    gain = ν2·gain1 + gain2·ν1    base = ν2·base1 + gain2·T1 + base2    ν = ν2·ν1 */
#include "front.h"

#include <stdlib.h>
#include <string.h>

#include "../error.h"

/* Roundings of one map, and as many for its composition. */
#define ROUNDINGS 32.0

typedef struct chain {
    pl_affine to_parent, to_object;
    double stretch, offset, gain, base;
} chain;

struct pl_compositions {
    const pl_states *states;
    size_t *first; /* of each state, in chains */
    chain *chains; /* of each item */
};

/* A state that may still be opened, or becomes an instance. */
typedef struct closed {
    chain at;
    const pl_item *item;
    double area;
    uint32_t opened;
    bool no_shadow;
} closed;

typedef struct opening {
    const pl_compositions *compositions;
    const pl_front *front;
    pl_front_items *items; /* NULL: only counted */
    pl_front_counts counts;
    closed *heap; /* the largest area first */
    size_t heap_count, heap_capacity;
    bool ordered; /* by area; else last in, first out */
    pl_error *error;
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
        made->chains = malloc((total + 1) * sizeof *made->chains);
    }
    if (!made || !made->first || !made->chains) {
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
            chain *whole = &made->chains[total++];
            *whole = item->transform_count ? chain_of(item->transforms[0]) : chain_identity();
            for (uint32_t t = 1; t < item->transform_count; t++) {
                chain next = chain_of(item->transforms[t]);
                chain_append(whole, &next);
            }
        }
    }
    return made;
}

void pl_compositions_free(pl_compositions *compositions)
{
    if (!compositions) return;
    free(compositions->first);
    free(compositions->chains);
    free(compositions);
}

/* --- growing arrays --- */

/* Makes room for one more element; false: no memory. */
static bool grow(void *array, size_t count, size_t *capacity, size_t element)
{
    if (count < *capacity) return true;
    size_t more = *capacity ? 2 * *capacity : 64;
    void **place = array, *data = realloc(*place, more * element);
    if (!data) return false;
    *place = data;
    *capacity = more;
    return true;
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

/* --- the heap of closed states --- */

static bool push(opening *o, const closed *c)
{
    if (!grow(&o->heap, o->heap_count, &o->heap_capacity, sizeof *o->heap)) return false;
    size_t at = o->heap_count++;
    while (o->ordered && at > 0 && o->heap[(at - 1) / 2].area < c->area) {
        o->heap[at] = o->heap[(at - 1) / 2];
        at = (at - 1) / 2;
    }
    o->heap[at] = *c;
    return true;
}

static closed pop(opening *o)
{
    closed top = o->heap[o->ordered ? 0 : o->heap_count - 1], last = o->heap[--o->heap_count];
    if (!o->ordered || o->heap_count == 0) return top;
    size_t at = 0;
    for (;;) {
        size_t child = 2 * at + 1;
        if (child >= o->heap_count) break;
        if (child + 1 < o->heap_count && o->heap[child + 1].area > o->heap[child].area) child++;
        if (o->heap[child].area <= last.area) break;
        o->heap[at] = o->heap[child];
        at = child;
    }
    o->heap[at] = last;
    return top;
}

/* --- items --- */

static float round_down(double x)
{
    float f = (float)x;
    return (double)f > x ? nextafterf(f, -INFINITY) : f;
}

static float round_up(double x)
{
    float f = (float)x;
    return (double)f < x ? nextafterf(f, INFINITY) : f;
}

/* A bound, and what its rounding to single precision and that of sums with it lose. */
static float bound(double x)
{
    return round_up(x * (1.0 + 0x1p-20));
}

static double length(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* Slack: reach.h's (twice: boxes here are composed too), and moving a ray along itself to a front's box. */
void pl_front_set_frame(pl_front *front, const pl_states *states, uint32_t state)
{
    const pl_box *box = &states->list[state].box;
    double half = 0.0;
    front->state = state;
    front->box = *box;
    front->reach = states->list[state].reach;
    memset(front->centre, 0, sizeof front->centre);
    front->scale = 1.0;
    front->framed = !pl_box_is_empty(box) && pl_box_is_finite(box);
    for (int axis = 0; front->framed && axis < 3; axis++) {
        front->centre[axis] = 0.5 * box->lo[axis] + 0.5 * box->hi[axis];
        half = fmax(half, 0.5 * box->hi[axis] - 0.5 * box->lo[axis]);
    }
    if (half > 0.0) front->scale = fmin(1.0 / half, 1e300);
    for (int axis = 0; front->framed && axis < 3; axis++)
        front->half[axis] = (float)((0.5 * box->hi[axis] - 0.5 * box->lo[axis]) * front->scale);
    const pl_reach *reach = &front->reach;
    double away = length(front->centre);
    front->slack_gain = bound(DBL_EPSILON * (2.0 * reach->gain + 16.0));
    front->slack_base = bound(DBL_EPSILON * front->scale *
                              (2.0 * (reach->gain * away + reach->base) + 16.0 * (away + reach->size)));
}

/* Lists an item under its box in the front's own frame, or as unbounded. Empty boxes hold nothing to hit. */
static bool list_item(opening *o, const pl_box *box, bool unbounded, pl_ref ref)
{
    pl_front_items *items = o->items;
    bool empty = box->lo[0] > box->hi[0]; /* which NaN isn't */
    if (unbounded || !(empty || (pl_box_is_finite(box) && o->front->framed))) {
        if (!grow(&items->unbounded, items->unbounded_count, &items->unbounded_capacity, sizeof *items->unbounded))
            return false;
        items->unbounded[items->unbounded_count++] = ref;
        return true;
    }
    if (empty) return true;
    if (!grow(&items->boxes, items->box_count, &items->box_capacity, sizeof *items->boxes)) return false;
    pl_boxed *boxed = &items->boxes[items->box_count++];
    for (int axis = 0; axis < 3; axis++) {
        boxed->lo[axis] = round_down((box->lo[axis] - o->front->centre[axis]) * o->front->scale);
        boxed->hi[axis] = round_up((box->hi[axis] - o->front->centre[axis]) * o->front->scale);
    }
    boxed->ref = ref;
    return true;
}

static bool add_primitive(opening *o, const chain *at, const pl_item *item, uint32_t opened, uint32_t index,
                          bool no_shadow)
{
    pl_front_items *items = o->items;
    const pl_states *states = o->compositions->states;
    o->counts.primitives++;
    if (!items) return true;
    if (!grow(&items->primitives, items->primitive_count, &items->primitive_capacity, sizeof *items->primitives))
        return false;
    const double *m = at->to_object.m, *centre = o->front->centre;
    pl_front_primitive *p = &items->primitives[items->primitive_count];
    double square = 0.0;
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) {
            double x = m[4 * r + c] / o->front->scale;
            square += x * x;
            p->columns[3 * c + r] = (float)x;
        }
        p->columns[9 + r] =
            (float)(m[4 * r] * centre[0] + m[4 * r + 1] * centre[1] + m[4 * r + 2] * centre[2] + m[4 * r + 3]);
    }
    p->stretch = round_up(sqrt(square) * (1.0 + 0x1p-20));
    p->argument = (float)item->arguments[0];
    p->opened = opened;
    p->item = index | (no_shadow ? PL_NO_SHADOW : 0);
    bool mesh = item->kind == PL_NODE_MESH;
    const pl_shape *shape = mesh ? NULL : pl_shape_of(item->what);
    pl_box box = mesh ? pl_box_map(&at->to_parent, pl_mesh_box(states->meshes[item->what]))
                      : pl_shape_box(shape, item->arguments, at->to_parent.m);
    uint32_t kind = mesh ? PL_KIND_MESH : item->what;
    return list_item(o, &box, !mesh && !shape->support, pl_ref_of(kind, (uint32_t)items->primitive_count++));
}

/* The map from a front's unit frame to that of an instance in it, and its bounds (front.h). Beyond what chain bounds: the
 * rounding of what is composed here, for points within a few units. */
static void set_instance_map(pl_front_instance *it, const pl_front *outer, const pl_front *inner, const chain *at)
{
    const double *m = at->to_object.m, size = 1.0 / outer->scale, zoom = inner->scale * size;
    double away = length(outer->centre);
    double stretch = at->stretch * zoom;
    double offset = inner->scale * (at->stretch * away + at->offset + length(inner->centre));
    double base = inner->scale * (at->gain * (2.0 * away + outer->reach.size) + at->base);
    it->stretch = bound(stretch);
    it->offset = bound(offset);
    it->gain = bound(DBL_EPSILON * (2.0 * at->gain * zoom + ROUNDINGS * stretch));
    it->base = bound(DBL_EPSILON * (base + ROUNDINGS * (offset + 4.0 * stretch)));
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) it->columns[3 * c + r] = m[4 * r + c] * zoom;
        double centre[3];
        pl_affine_point(&at->to_object, outer->centre, centre);
        it->columns[9 + r] = (centre[r] - inner->centre[r]) * inner->scale;
    }
}

static bool add_instance(opening *o, const closed *c)
{
    pl_front_items *items = o->items;
    const pl_states *states = o->compositions->states;
    const pl_state *state = &states->list[c->item->what];
    if (!grow(&items->instances, items->instance_count, &items->instance_capacity, sizeof *items->instances))
        return false;
    const pl_item *by = items->opened[c->opened].item;
    pl_front_instance *it = &items->instances[items->instance_count];
    pl_front inner = {0};
    *it = (pl_front_instance){
        .front = c->item->what,
        .opened = c->opened,
        .item = (uint32_t)(c->item - states->list[by ? by->what : o->front->state].items) | (c->no_shadow ? PL_NO_SHADOW : 0),
    };
    pl_front_set_frame(&inner, states, it->front);
    set_instance_map(it, o->front, &inner, &c->at);
    /* Where there are cut-offs the whole box may be drawn (cut.h). */
    pl_box box = states->cuts ? pl_box_map(&c->at.to_parent, &state->box) : pl_box_under(states, c->item, &c->at.to_parent);
    return list_item(o, &box, state->unbounded, pl_ref_of(PL_KIND_INSTANCE, (uint32_t)items->instance_count++));
}

/* Lists what a state consists of: primitives at once, states on the heap. */
static bool open_state(opening *o, const closed *c, uint32_t state)
{
    const pl_compositions *made = o->compositions;
    const pl_states *states = made->states;
    const pl_state *it = &states->list[state];
    uint32_t opened = (uint32_t)o->counts.opened++;
    if (o->items) {
        pl_front_items *items = o->items;
        if (!grow(&items->opened, items->opened_count, &items->opened_capacity, sizeof *items->opened)) return false;
        uint32_t moved = !c->item ? 0 : c->item->transform_count ? opened : items->opened[c->opened].moved;
        items->opened[items->opened_count++] = (pl_opened){c->item, c->opened, moved};
    }
    for (uint32_t i = 0; i < it->item_count; i++) {
        const pl_item *item = &it->items[i];
        if (pl_item_primitives(states, item) == 0) continue;
        closed next = {.at = c->at, .item = item, .opened = opened};
        next.no_shadow = c->no_shadow || item->no_shadow;
        chain_append(&next.at, &made->chains[made->first[state] + i]);
        if (item->kind != PL_NODE_ENTER) {
            if (!add_primitive(o, &next.at, item, opened, i, next.no_shadow)) return false;
            continue;
        }
        if (o->ordered) {
            pl_box box = pl_box_map(&next.at.to_parent, &states->list[item->what].box);
            next.area = states->list[item->what].unbounded ? INFINITY : pl_box_area(&box);
        }
        if (!push(o, &next)) return false;
    }
    return true;
}

/* Items with anything to hit: what opening a state adds in place of it. */
static uint32_t live_items(const pl_states *states, const pl_state *state)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < state->item_count; i++) count += pl_item_primitives(states, &state->items[i]) > 0;
    return count;
}

/* Opens as long as at most `most` items result; the rest stays on the heap. A state with one item costs nothing, but
 * there may be no end of them. most = 0: nothing is opened. */
static bool open_all(opening *o, uint32_t state, uint64_t most)
{
    const pl_states *states = o->compositions->states;
    closed root = {.at = chain_identity()};
    o->ordered = most != UINT64_MAX;
    if (!open_state(o, &root, state)) return false;
    size_t kept = 0; /* closed for good */
    closed *rest = NULL;
    size_t rest_capacity = 0;
    bool ok = true;
    while (ok && o->heap_count) {
        closed c = pop(o);
        uint64_t adds = live_items(states, &states->list[c.item->what]);
        uint64_t now = o->counts.primitives + o->heap_count + kept;
        if (now + adds <= most || (adds <= 1 && most > 0 && !states->list[c.item->what].endless)) {
            ok = open_state(o, &c, c.item->what);
        } else {
            ok = grow(&rest, kept, &rest_capacity, sizeof *rest);
            if (ok) rest[kept++] = c;
        }
    }
    o->counts.instances = kept;
    free(o->heap);
    o->heap = rest;
    o->heap_count = kept;
    return ok;
}

bool pl_front_open(const pl_compositions *compositions, const pl_front *front, uint64_t most, pl_front_items *items,
                   pl_error *error)
{
    opening o = {.compositions = compositions, .front = front, .items = items, .error = error};
    bool ok = open_all(&o, front->state, most);
    for (size_t i = 0; ok && i < o.heap_count; i++) ok = add_instance(&o, &o.heap[i]);
    free(o.heap);
    return ok || pl_fail_memory(error, "building the fronts");
}

bool pl_front_count(const pl_compositions *compositions, uint32_t state, uint64_t most, pl_front_counts *counts,
                    pl_state_list *closed_states, pl_error *error)
{
    opening o = {.compositions = compositions, .error = error};
    bool ok = open_all(&o, state, most);
    for (size_t i = 0; ok && i < o.heap_count; i++) {
        ok = grow(&closed_states->list, closed_states->count, &closed_states->capacity, sizeof *closed_states->list);
        if (ok) closed_states->list[closed_states->count++] = o.heap[i].item->what;
    }
    *counts = o.counts;
    free(o.heap);
    return ok || pl_fail_memory(error, "building the fronts");
}
