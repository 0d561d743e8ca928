/* lazy.c - bvh where there are too many states to build: they are unfolded when a ray comes to them (lazy.h).
 *
 * A frame is an instance on the way from the root, with its state pinned; an entry of the stack is an item of a frame that is
 * still to be visited. Entries are visited depth first, near ones first, so frames form a stack as well. Boxes only
 * filter, so neither what is in the cache nor how loose the classes' boxes are shows in a hit. */
#include "lazy.h"

#include <stdlib.h>
#include <string.h>

#include "../error.h"

/* What one ray may do before it is given up: nodes visited to unfold states and to bound classes, and instances entered
 * of which nothing is known. The first is hundreds of times what a ray needs that grazes all trees of a forest; a path has
 * no more symbols than the second. */
#define MOST_WORK (UINT64_C(1) << 24)
enum { MOST_UNKNOWN = PL_LIMIT_DEPTH + 1024 };

/* Frames from the end that pin their states: a path may be longer than the cache is large. */
enum { PINNED = 16 };

/* Frames are the instances on one path from the root, so frame i is the parent of frame i + 1. */
typedef struct frame {
    pl_lazy_state *state; /* NULL: not pinned any more */
    uint32_t symbol, terms; /* terms on the path up to here */
    uint32_t item;          /* of the frame before, by which this one was reached */
    size_t scope;           /* in `scopes`: what the state is found by again */
    double o[3], d[3];
    double stretch; /* with cut-offs: the product of stretches, the hash of the path and the span (cut.h) */
    uint64_t hash;
    pl_span inside;
} frame;

typedef struct pending {
    double t_entry;
    uint32_t frame, item;
} pending;

typedef struct work {
    pl_unfolder *unfolder;
    frame *frames;
    pending *stack;
    uint64_t *scopes;
    pl_path path; /* to the last frame */
    size_t frame_count, frame_capacity, stack_count, stack_capacity, scope_capacity;
    size_t scope_words;
    uint64_t spent; /* for this ray */
    uint32_t unknown;
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

static void leave(frame *f)
{
    if (f->state) pl_lazy_release(f->state);
    f->state = NULL;
}

static void leave_frames(work *w, size_t count)
{
    while (w->frame_count > count) leave(&w->frames[--w->frame_count]);
}

/* Pushes the items that the ray meets, the nearest last. */
static bool push_items(work *w, uint32_t index, pl_query *query, pl_counters *counters)
{
    const frame *f = &w->frames[index];
    const pl_lazy_state *state = f->state;
    const size_t first = w->stack_count;
    pl_slab slab = pl_slab_of(f->o, f->d, pl_reach_slack(&state->reach, f->o));
    for (uint32_t i = 0; i < state->item_count; i++) {
        const pl_lazy_item *it = &state->items[i];
        double t_entry = query->t_min;
        if (query->shadow && it->item.no_shadow) continue;
        if (!it->unbounded) {
            counters->box_tests++;
            const pl_box box = pl_lazy_box(it);
            if (pl_box_is_empty(&box)) continue;
            if (!pl_slab_hits(&slab, &box, query->t_min, query->t_max, &t_entry)) {
                if (index > counters->miss_depth) counters->miss_depth = index;
                continue;
            }
        }
        if (!grow(&w->stack, w->stack_count, &w->stack_capacity, sizeof *w->stack, query->error)) return false;
        size_t place = w->stack_count++;
        for (; place > first && w->stack[place - 1].t_entry < t_entry; place--) w->stack[place] = w->stack[place - 1];
        w->stack[place] = (pending){t_entry, index, i};
    }
    return true;
}

static bool fail_work(const pl_scene *scene, uint32_t symbol, const char *what, uint64_t limit, pl_error *error)
{
    return pl_fail_at(error, PL_ERROR_LIMIT, scene->program, symbol == UINT32_MAX ? 0 : symbol,
                      "work: one ray %s %llu, which is the limit; does the recursion end?", what, (unsigned long long)limit);
}

/* A packed scope's words, kept behind those of the last frame: they have no draws, so all are equally long. */
static bool keep_scope(work *w, const uint64_t *scope, size_t *place, pl_error *error)
{
    const size_t words = w->scope_words;
    *place = w->frame_count * words;
    if (!scope) return true;
    if (!grow(&w->scopes, *place + words, &w->scope_capacity, sizeof *w->scopes, error)) return false;
    memcpy(w->scopes + *place, scope, words * sizeof *scope);
    return true;
}

/* The state of a frame, unfolded again where it was let go. */
static const pl_lazy_state *pin(pl_tracer *tracer, frame *f, pl_error *error)
{
    work *w = tracer->work;
    bool is_new;
    if (!f->state)
        f->state = pl_lazy_get(tracer->scene->structure, w->unfolder, f->symbol,
                               f->symbol == UINT32_MAX ? NULL : w->scopes + f->scope, &w->spent, &is_new, error);
    return f->state;
}

/* The last frame's state is new: what is known of its items is known of those above. */
static void shrink(work *w)
{
    for (size_t i = w->frame_count - 1; i > 0 && w->frames[i].state && w->frames[i - 1].state; i--)
        if (!pl_lazy_shrink(&w->frames[i - 1].state->items[w->frames[i].item], w->frames[i].state)) return;
}

/* Goes into an instance whose ray stands in f; terms: of the path to it. */
static bool enter(pl_tracer *tracer, uint32_t symbol, const uint64_t *scope, const frame *as, pl_query *query)
{
    work *w = tracer->work;
    frame f = *as;
    bool is_new;
    if (w->frame_count > PL_LIMIT_DEPTH)
        return pl_fail_at(query->error, PL_ERROR_LIMIT, tracer->scene->program, symbol,
                          "depth: a ray came %d symbols deep, which is the limit; does the recursion end?", PL_LIMIT_DEPTH);
    if (!grow(&w->frames, w->frame_count, &w->frame_capacity, sizeof *w->frames, query->error) ||
        !keep_scope(w, scope, &f.scope, query->error))
        return false;
    f.symbol = symbol;
    f.state = pl_lazy_get(tracer->scene->structure, w->unfolder, symbol, scope, &w->spent, &is_new, query->error);
    if (!f.state) return false;
    if (w->frame_count >= PINNED) leave(&w->frames[w->frame_count - PINNED]);
    w->frames[w->frame_count++] = f;
    /* With a cut-off an instance may be drawn as its whole box, however little stands in it. */
    if (is_new && !tracer->scene->gates) shrink(w);
    if (w->spent > MOST_WORK)
        return fail_work(tracer->scene, symbol, "needed to visit more nodes of the graph than", MOST_WORK, query->error);
    return push_items(w, (uint32_t)w->frame_count - 1, query, &tracer->counters);
}

static bool write_path(const void *context, pl_path *path)
{
    const work *w = context;
    return pl_path_copy(path, &w->path, w->path.length);
}

/* The path to an item of the last frame. */
static bool extend_path(work *w, const pl_item *item, pl_error *error)
{
    uint32_t length = w->frames[w->frame_count - 1].terms;
    for (uint32_t i = 0; i < item->term_count; i++)
        if (!pl_path_push(&w->path, length++, item->terms[i])) return pl_fail_memory(error, "tracing a ray");
    w->path.length = length;
    return true;
}

/* The gate of an instance whose ray stands in f, with the stretch above it. */
static pl_gate pass_gate(pl_tracer *tracer, const pl_lazy_item *it, frame *f, pl_query *query, bool *ok)
{
    const work *w = tracer->work;
    const pl_item *item = &it->item;
    for (uint32_t i = 0; i < item->transform_count; i++) f->stretch *= item->transforms[i]->stretch;
    pl_arrival at = {0, f->o, f->d, f->stretch, f->inside, (uint32_t)w->frame_count};
    double t_entry;
    pl_gate gate = pl_gate_at(it->gate, f->o, f->d, f->stretch, &query->footprint, f->inside, query->t_min, query->t_max,
                              &t_entry, &f->inside);
    if (gate == PL_GATE_MISSED) return gate;
    f->hash = pl_cut_hash(f->hash, item->terms, item->term_count);
    if (gate == PL_GATE_OPEN || !(t_entry < query->t_max)) return gate;
    pl_leaf leaf = {.path = write_path, .source = w};
    double coverage = pl_lazy_coverage(w->unfolder, item->what, it->scope, f->d);
    *ok = pl_query_cut_box(query, it->gate, coverage, &at, f->hash, t_entry, &leaf);
    return gate;
}

/* An item of the last frame. */
static bool visit(pl_tracer *tracer, const pending *at, pl_query *query)
{
    work *w = tracer->work;
    const pl_scene *scene = tracer->scene;
    frame *parent = &w->frames[at->frame];
    const pl_lazy_state *state = pin(tracer, parent, query->error);
    if (!state) return false;
    const pl_lazy_item *it = &state->items[at->item];
    const pl_item *item = &it->item;
    bool ok = true;
    frame f = *parent;
    f.state = NULL;
    f.item = at->item;
    for (uint32_t i = 0; i < item->transform_count; i++) pl_map_ray(item->transforms[i], f.o, f.d);
    if (!extend_path(w, item, query->error)) return false;
    f.terms = w->path.length;
    if (item->kind == PL_NODE_ENTER) {
        if (it->gate && pass_gate(tracer, it, &f, query, &ok) != PL_GATE_OPEN) return ok;
        if (it->unbounded && ++w->unknown > MOST_UNKNOWN)
            return fail_work(scene, item->what, "entered more instances of unknown size than", MOST_UNKNOWN, query->error);
        return enter(tracer, item->what, it->scope, &f, query);
    }
    pl_leaf leaf = {.arguments = item->arguments, .primitive = UINT64_MAX, .path = write_path, .source = w};
    if (item->kind == PL_NODE_MESH) leaf.mesh = scene->meshes[item->what];
    else leaf.shape = item->what;
    tracer->counters.primitive_tests++;
    leaf.o = f.o;
    leaf.d = f.d;
    return pl_query_leaf(query, &leaf);
}

static bool trace(pl_tracer *tracer, const pl_ray *ray, pl_query *query)
{
    work *w = tracer->work;
    frame root = {.stretch = 1.0, .inside = {query->t_min, INFINITY}};
    memcpy(root.o, ray->origin, sizeof root.o);
    memcpy(root.d, ray->direction, sizeof root.d);
    w->stack_count = w->path.length = w->unknown = 0;
    w->spent = 0;
    bool ok = enter(tracer, UINT32_MAX, NULL, &root, query);
    for (uint64_t steps = 0; ok && w->stack_count && !query->done; steps++) {
        pending at = w->stack[--w->stack_count];
        if (steps > PL_LIMIT_RAY_STEPS) ok = pl_query_fail_steps(query, PL_LIMIT_RAY_STEPS);
        else if (at.t_entry > query->t_max) continue;
        leave_frames(w, at.frame + 1);
        ok = ok && visit(tracer, &at, query);
    }
    leave_frames(w, 0);
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
