/* lazy.c - bvh where there are too many states to build: they are unfolded when a ray comes to them (lazy.h).
 *
 * A frame is an instance on the way from the root, with its state; an entry of the stack is an item of a frame that is
 * still to be visited. Entries are visited depth first, near ones first, so frames form a stack as well. Boxes only
 * filter, so neither what is in the cache nor how loose the classes' boxes are shows in a hit.
 *
 * With a cut-off nearly all gates are clearly open: larger than the footprint where the ray leaves the box. Spans (cut.h)
 * and hashes of paths are found only where one isn't. */
#include "lazy.h"

#include <stdlib.h>
#include <string.h>

#include "../error.h"

/* What one ray may do before it is given up: nodes visited to unfold states and to bound classes, and instances entered
 * of which nothing is known. The first is hundreds of times what a ray needs that grazes all trees of a forest; a path has
 * no more symbols than the second. */
#define MOST_WORK (UINT64_C(1) << 24)
enum { MOST_UNKNOWN = PL_LIMIT_DEPTH + 1024 };

/* A ray in the frame of an instance. */
typedef struct place {
    double o[3], d[3];
    double stretch; /* with cut-offs: the product of stretches */
    double leave;   /* with cut-offs: from there on nothing stands below */
} place;

/* Frames are the instances on one path from the root, so frame i is the parent of frame i + 1. */
typedef struct frame {
    pl_lazy_state *state; /* NULL: its half of the cache is gone */
    uint32_t symbol, terms; /* terms on the path up to here */
    uint32_t item;          /* of the frame before, by which this one was reached */
    bool spanned;           /* `inside` is known */
    place at;
    pl_span inside; /* with cut-offs: of what stands below */
} frame;

/* An item that is still to be visited. With cut-offs a ray has gone as far as the gates of those that enter states: these say
 * more than boxes would, and most boxes that it meets have gates that it meets. */
typedef struct pending {
    double t_entry;
    uint32_t frame, item;
    bool arrived; /* `at` is known … */
    bool open;    /* … and the gate is clearly open */
    place at;
} pending;

typedef struct work {
    pl_unfolder *unfolder;
    pl_lazy_half *half;
    pl_footprint footprint; /* the query's; without a cut-off 0: then all gates are clearly open */
    frame *frames;
    pending *stack;
    uint64_t *scopes;
    pl_path path; /* to the last frame */
    size_t frame_count, frame_capacity, stack_count, stack_capacity, scope_capacity;
    size_t scope_words;
    uint64_t spent, found; /* for this ray */
    uint32_t unknown, changes; /* of the half */
} work;

static void work_destroy(void *memory)
{
    work *w = memory;
    if (!w) return;
    pl_unfolder_free(w->unfolder);
    free(w->frames);
    free(w->stack);
    free(w->scopes);
    free(w->path.terms);
    free(w);
}

static void *work_create(const pl_scene *scene, pl_error *error)
{
    work *w = calloc(1, sizeof *w);
    if (w && (w->unfolder = pl_unfolder_create(scene, error))) {
        w->scope_words = pl_scope_words(scene->program, &(pl_scope){.draws = 0});
        return w;
    }
    free(w);
    pl_fail_memory(error, "preparing to trace");
    return NULL;
}

static bool grow(void *array, size_t count, size_t *capacity, size_t element, pl_error *error)
{
    void **place = array, *data;
    if (count < *capacity) return true;
    size_t more = 2 * count + 64;
    if (!(data = realloc(*place, more * element))) return pl_fail_memory(error, "tracing a ray");
    *place = data;
    *capacity = more;
    return true;
}

/* Whether a gate so large is open wherever on the ray it is met up to `to`; in the order of pl_gate_at's roundings. */
static inline bool is_open(const work *w, double size, double to)
{
    return size > w->footprint.width + w->footprint.spread * to;
}

/* [t_min, t_max] within a box with some room; nothing if `enter` > `leave`. */
static inline pl_span clip(const pl_slab *slab, const float planes[6], double room, double t_min, double t_max)
{
    pl_span span = {t_min, t_max};
    for (int axis = 0; axis < 3; axis++) {
        const double lo = (double)planes[axis] - room, hi = (double)planes[3 + axis] + room;
        const double t_near = ((slab->negative[axis] ? hi : lo) - slab->near_origin[axis]) * slab->inverse[axis];
        const double t_far = ((slab->negative[axis] ? lo : hi) - slab->far_origin[axis]) * slab->inverse[axis];
        span.enter = t_near > span.enter ? t_near : span.enter;
        span.leave = t_far < span.leave ? t_far : span.leave;
    }
    return span;
}

/* How far out of a box that holds primitives what is cut may stand that is drawn instead of some of them: it is no larger than a
 * footprint. */
static inline double room_of(const work *w, const place *at)
{
    const double footprint = w->footprint.width + (w->footprint.spread > 0.0 ? w->footprint.spread * at->leave : 0.0);
    return footprint / at->stretch * (1.0 + 0x1p-20);
}

/* Asks for a state's memory before the ray comes to it: what stands near the bottom of a tree is in no cache. */
static inline void fetch(const pl_lazy_state *state)
{
    if (!state) return;
    for (int line = 0; line < 5; line++) __builtin_prefetch((const char *)state + 64 * line);
}

static inline void map_down(const pl_lazy_item *it, place *at)
{
    for (uint32_t i = 0; i < it->transform_count; i++) pl_map_ray(it->transforms[i], at->o, at->d);
}

/* Goes as far as the gate of an item that enters a state. false: it is missed. */
static inline bool arrive(const work *w, const pl_lazy_item *it, const pl_query *query, pending *next)
{
    const pl_gate_box *gate = it->gate;
    const double *stretches = pl_lazy_stretches(it);
    map_down(it, &next->at);
    for (uint32_t i = 0; i < it->transform_count; i++) next->at.stretch *= stretches[i];
    next->arrived = next->open = true;
    if (gate->unbounded) return true;
    const pl_span own = pl_gate_span(gate, next->at.o, next->at.d, (pl_span){query->t_min, query->t_max});
    if (!(own.enter <= own.leave)) return false;
    next->t_entry = own.enter;
    next->at.leave = own.leave;
    next->open = is_open(w, gate->diameter * next->at.stretch, own.leave);
    return true;
}

/* Puts what was written behind the stack's last entry into its place among those from `first` on, the nearest last. */
static inline void insert(work *w, size_t first)
{
    size_t place = w->stack_count++;
    if (place == first || !(w->stack[place - 1].t_entry < w->stack[place].t_entry)) return;
    const pending next = w->stack[place];
    for (; place > first && w->stack[place - 1].t_entry < next.t_entry; place--) w->stack[place] = w->stack[place - 1];
    w->stack[place] = next;
}

/* Pushes the items that the ray meets. */
static bool push_items(work *w, uint32_t index, bool gates, pl_query *query, pl_counters *counters)
{
    const place *from = &w->frames[index].at;
    const pl_lazy_state *state = w->frames[index].state;
    const size_t first = w->stack_count;
    const pl_slab slab = pl_slab_of(from->o, from->d, pl_reach_slack(&state->reach, from->o));
    for (uint32_t i = 0; i < state->item_count; i++) {
        const pl_lazy_item *it = &state->items[i];
        if (!grow(&w->stack, w->stack_count, &w->stack_capacity, sizeof *w->stack, query->error)) return false;
        pending *next = &w->stack[w->stack_count];
        bool met = true;
        if (query->shadow && it->no_shadow) continue;
        next->t_entry = query->t_min;
        next->frame = index;
        next->item = i;
        next->arrived = false;
        if (it->boxed) {
            const pl_span span = clip(&slab, it->box, it->whole ? 0.0 : room_of(w, from), query->t_min, query->t_max);
            counters->box_tests++;
            next->t_entry = span.enter;
            met = it->box[0] <= it->box[3] && span.enter <= span.leave;
        }
        if (met && gates && it->kind == PL_NODE_ENTER) {
            counters->box_tests++;
            next->at = *from;
            met = arrive(w, it, query, next);
        }
        if (!met) {
            if (index > counters->miss_depth) counters->miss_depth = index;
            continue;
        }
        insert(w, first);
        fetch(atomic_load_explicit(&it->state, memory_order_relaxed));
    }
    return true;
}

static bool fail_work(const pl_scene *scene, uint32_t symbol, const char *what, uint64_t limit, pl_error *error)
{
    return pl_fail_at(error, PL_ERROR_LIMIT, scene->program, symbol == UINT32_MAX ? 0 : symbol,
                      "work: one ray %s %llu, which is the limit; does the recursion end?", what, (unsigned long long)limit);
}

/* The span for what stands below a frame: each within that of the frame before. */
static pl_span span_of(work *w, size_t index)
{
    size_t known = index;
    while (!w->frames[known].spanned) known--;
    for (size_t i = known + 1; i <= index; i++) {
        frame *f = &w->frames[i];
        const pl_lazy_item *it = &w->frames[i - 1].state->items[f->item];
        f->inside = pl_span_below(it->gate, f->at.o, f->at.d, w->frames[i - 1].inside);
        f->spanned = true;
    }
    return w->frames[index].inside;
}

/* Keeps the scopes of frames that have states, by which they are found again: all are equally long, having no draws. */
static bool keep_scopes(work *w, pl_error *error)
{
    const size_t words = w->scope_words;
    for (size_t i = 1; i < w->frame_count; i++) {
        if (!w->frames[i - 1].state) continue;
        if (!grow(&w->scopes, (i + 1) * words, &w->scope_capacity, sizeof *w->scopes, error)) return false;
        memcpy(w->scopes + i * words, w->frames[i - 1].state->items[w->frames[i].item].scope, words * sizeof *w->scopes);
    }
    return true;
}

/* Lets all states go for an empty half of the cache. */
static bool change(pl_tracer *tracer, pl_error *error)
{
    work *w = tracer->work;
    if (tracer->scene->gates) span_of(w, w->frame_count - 1);
    if (!keep_scopes(w, error)) return false;
    for (size_t i = 0; i < w->frame_count; i++) w->frames[i].state = NULL;
    w->half = pl_lazy_change(tracer->scene->structure, w->half);
    w->changes++;
    return true;
}

/* The state of a frame: unfolded, or found again where it was let go. */
static pl_lazy_state *state_of(pl_tracer *tracer, size_t index, pl_error *error)
{
    work *w = tracer->work;
    while (!w->frames[index].state) {
        const frame *above = index ? &w->frames[index - 1] : NULL, *f = &w->frames[index];
        const uint64_t *scope = !above         ? NULL
                                : above->state ? above->state->items[f->item].scope
                                               : w->scopes + index * w->scope_words;
        bool full;
        pl_lazy_state *state = pl_lazy_get(tracer->scene->structure, w->half, w->unfolder, f->symbol, scope, &w->spent, &full, error);
        if (!state && (!full || !change(tracer, error))) return NULL;
        w->frames[index].state = state;
    }
    return w->frames[index].state;
}

/* Goes into an instance, that of a frame that is complete but for its state: by an item of the frame before, or the scene itself
 * (NULL). */
static bool enter(pl_tracer *tracer, pl_lazy_item *it, pl_query *query)
{
    work *w = tracer->work;
    const uint32_t index = (uint32_t)w->frame_count;
    frame *f = &w->frames[index];
    f->symbol = it ? it->what : UINT32_MAX;
    if (index > PL_LIMIT_DEPTH)
        return pl_fail_at(query->error, PL_ERROR_LIMIT, tracer->scene->program, f->symbol,
                          "depth: a ray came %d symbols deep, which is the limit; does the recursion end?", PL_LIMIT_DEPTH);
    f->state = it ? atomic_load_explicit(&it->state, memory_order_acquire) : NULL;
    w->found += f->state != NULL;
    w->frame_count++;
    if (!f->state) {
        const uint32_t changes = w->changes;
        pl_lazy_state *state = state_of(tracer, index, query->error);
        if (!state) return false;
        if (it && w->changes == changes) atomic_store_explicit(&it->state, state, memory_order_release);
    }
    if (w->spent > MOST_WORK)
        return fail_work(tracer->scene, f->symbol, "needed to visit more nodes of the graph than", MOST_WORK, query->error);
    return push_items(w, index, tracer->scene->gates != NULL, query, &tracer->counters);
}

static bool write_path(const void *context, pl_path *path)
{
    const work *w = context;
    return pl_path_copy(path, &w->path, w->path.length);
}

/* The path to an item of the last frame. */
static bool extend_path(work *w, const pl_lazy_item *item, pl_error *error)
{
    uint32_t length = w->frames[w->frame_count - 1].terms;
    for (uint32_t i = 0; i < item->term_count; i++)
        if (!pl_path_push(&w->path, length++, item->terms[i])) return pl_fail_memory(error, "tracing a ray");
    w->path.length = length;
    return true;
}

/* Decides at a gate that isn't clearly open, of an instance whose ray stands in f; where it is cut, offers its box. */
static pl_gate decide(pl_tracer *tracer, const pl_lazy_item *it, frame *f, pl_query *query, bool *ok)
{
    work *w = tracer->work;
    const pl_span within = span_of(w, w->frame_count - 1);
    pl_arrival at = {0, f->at.o, f->at.d, f->at.stretch, within, (uint32_t)w->frame_count};
    double t_entry;
    const pl_gate gate = pl_gate_at(it->gate, f->at.o, f->at.d, f->at.stretch, &query->footprint, within, query->t_min,
                                    query->t_max, &t_entry, &f->inside);
    f->spanned = gate == PL_GATE_OPEN;
    if (gate != PL_GATE_CUT || !(t_entry < query->t_max)) return gate;
    pl_leaf leaf = {.path = write_path, .source = w};
    const uint64_t hash = pl_cut_hash(0, w->path.terms, w->path.length);
    const double coverage = pl_lazy_coverage(w->unfolder, it->what, it->scope, f->at.d);
    *ok = pl_query_cut_box(query, it->gate, coverage, &at, hash, t_entry, &leaf);
    return gate;
}

/* An item of the last frame, which the frame after it is made of. */
static bool visit(pl_tracer *tracer, const pending *at, pl_query *query)
{
    work *w = tracer->work;
    const pl_scene *scene = tracer->scene;
    pl_lazy_state *state = state_of(tracer, at->frame, query->error);
    if (!state || !grow(&w->frames, w->frame_count, &w->frame_capacity, sizeof *w->frames, query->error)) return false;
    pl_lazy_item *it = &state->items[at->item];
    bool ok = true;
    frame *f = &w->frames[w->frame_count];
    f->item = at->item;
    f->spanned = false;
    f->at = at->arrived ? at->at : w->frames[at->frame].at;
    if (!at->arrived) map_down(it, &f->at);
    if (!extend_path(w, it, query->error)) return false;
    f->terms = w->path.length;
    if (it->kind == PL_NODE_ENTER) {
        if (at->arrived && !at->open && decide(tracer, it, f, query, &ok) != PL_GATE_OPEN) return ok;
        if (it->unbounded && ++w->unknown > MOST_UNKNOWN)
            return fail_work(scene, it->what, "entered more instances of unknown size than", MOST_UNKNOWN, query->error);
        return enter(tracer, it, query);
    }
    pl_leaf leaf = {.arguments = it->arguments, .primitive = UINT64_MAX, .path = write_path, .source = w};
    if (it->kind == PL_NODE_MESH) leaf.mesh = scene->meshes[it->what];
    else leaf.shape = it->what;
    tracer->counters.primitive_tests++;
    leaf.o = f->at.o;
    leaf.d = f->at.d;
    return pl_query_leaf(query, &leaf);
}

static bool trace(pl_tracer *tracer, const pl_ray *ray, pl_query *query)
{
    static const pl_footprint none;
    work *w = tracer->work;
    pl_lazy_cache *cache = tracer->scene->structure;
    if (!grow(&w->frames, 0, &w->frame_capacity, sizeof *w->frames, query->error)) return false;
    frame *root = &w->frames[0];
    *root = (frame){.at = {.stretch = 1.0, .leave = query->t_max}, .spanned = true, .inside = {query->t_min, INFINITY}};
    memcpy(root->at.o, ray->origin, sizeof root->at.o);
    memcpy(root->at.d, ray->direction, sizeof root->at.d);
    w->stack_count = w->frame_count = w->path.length = w->unknown = 0;
    w->spent = w->found = 0;
    w->footprint = tracer->scene->gates ? query->footprint : none;
    w->half = pl_lazy_hold(cache);
    bool ok = enter(tracer, NULL, query);
    for (uint64_t steps = 0; ok && w->stack_count && !query->done; steps++) {
        const pending *at = &w->stack[--w->stack_count]; /* until something is pushed */
        if (steps > PL_LIMIT_RAY_STEPS) ok = pl_query_fail_steps(query, PL_LIMIT_RAY_STEPS);
        else if (at->t_entry > query->t_max) continue;
        w->frame_count = at->frame + 1;
        ok = ok && visit(tracer, at, query);
    }
    pl_lazy_release(cache, w->half);
    pl_lazy_add_found(cache, w->found);
    return ok;
}

static bool number(pl_tracer *tracer, pl_hit *hit, pl_error *error)
{
    return pl_number_by_classes(tracer, pl_lazy_classes(tracer->scene->structure), hit, error);
}

static bool build(pl_scene *scene, pl_error *error)
{
    scene->structure = pl_lazy_cache_create(scene, pl_lazy_budget(scene), error);
    return scene->structure != NULL;
}

static void destroy(pl_scene *scene)
{
    pl_lazy_cache_free(scene->structure);
    scene->structure = NULL;
}

const pl_accel pl_accel_lazy = {.name = "bvh",
                                .build = build,
                                .destroy = destroy,
                                .work_create = work_create,
                                .work_destroy = work_destroy,
                                .trace = trace,
                                .number = number};
