/* lazy.c - bvh where there are too many states to build: they are unfolded when a ray comes to them (lazy.h).
 *
 * Rays go together, up to PL_TRACE_MANY of them: a frame is an instance on the way from the root, with its state and the rays that
 * came into it; an entry of the stack is an item of a frame that is still to be visited, with the rays that meet it. Entries
 * are visited depth first, those that a ray meets first first, so frames form a stack as well. Boxes only filter, so neither what is
 * in the cache nor how loose the classes' boxes are shows in a hit, nor with which others a ray went. Boxes and gates are
 * tested four rays at a time (lazy_kernel.h).
 *
 * With a cut-off nearly all gates are clearly open: larger than the footprint where the ray leaves the box. Spans (cut.h)
 * and hashes of paths are found only where one isn't. */
#include "lazy_work.h"

#include <string.h>

/* Instances of which nothing is known that one ray may enter: a path has no more symbols. */
enum { MOST_UNKNOWN = PL_LIMIT_DEPTH + 1024 };

/* Rays that go together have this part of each limit. Beyond it each goes alone, since one of them may have the error; that
 * what they did was in vain costs little then, and 8,192 symbols deep they have 20 MB of frames. */
enum { PART_TOGETHER = 32 };

static void work_destroy(void *memory)
{
    work *w = memory;
    if (!w) return;
    pl_unfolder_free(w->unfolder);
    free(w->frames);
    free(w->inside);
    free(w->stack);
    free(w->scope);
    free(w->scopes);
    free(w->slots);
    free(w->free_slots);
    free(w->path.terms);
    free(w);
}

static const pl_lazy_kernel *kernel_of(const pl_scene *scene)
{
    switch (scene->isa) {
#ifdef __x86_64__
    case PL_ISA_AVX512: return &pl_lazy_kernel_avx512;
    case PL_ISA_AVX2: return &pl_lazy_kernel_avx2;
#endif
    default: return &pl_lazy_kernel_scalar;
    }
}

static void *work_create(const pl_scene *scene, pl_error *error)
{
    work *w = calloc(1, sizeof *w);
    if (w && (w->unfolder = pl_unfolder_create(scene, error))) {
        w->scope_words = pl_scope_words(scene->program, &(pl_scope){.draws = 0});
        w->scope = malloc(w->scope_words * sizeof *w->scope);
        w->kernel = kernel_of(scene);
        if (w->scope) return w;
    }
    work_destroy(w);
    pl_fail_memory(error, "preparing to trace");
    return NULL;
}

/* --- items --- */

/* Asks for a state's memory before the ray comes to it: what stands near the bottom of a tree is in no cache. */
static inline void fetch(const pl_lazy_state *state)
{
    if (!state) return;
    for (int line = 0; line < 5; line++) __builtin_prefetch((const char *)state + 64 * line);
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

/* Whether an item stands below a drawn transformation that is singular. */
static bool is_dropped(const pl_lazy_state *state, const pl_lazy_item *it)
{
    for (uint32_t i = 0; i < it->link_count; i++)
        if (pl_lazy_transform(state, &it->links[i])->singular) return true;
    return false;
}

/* Goes with a frame's rays as far as an item of its state; those that miss it are left out. */
static void approach(const work *w, const frame *f, const pl_lazy_item *it, bool gates, pending *next, pl_counters *counters)
{
    const pl_lazy_four *from = rays_at(w, f->slot);
    pl_lazy_four *to = rays_at(w, next->slot);
    next->rays = f->rays;
    next->arrived = false;
    next->stretch = f->stretch;
    const bool gated = gates && it->kind == PL_NODE_ENTER;
    if (it->boxed) {
        counters->box_tests += (unsigned)__builtin_popcount(next->rays);
        next->rays = w->kernel->clip(it, &f->state->pattern->reach, f->stretch, &w->wants, from, to, next->rays, &next->t_entry);
    } else if (!gated || it->gate->unbounded) {
        next->t_entry = w->kernel->begin(&w->wants, to, next->rays);
    }
    if (next->rays && gated) {
        for (uint32_t i = 0; i < it->link_count; i++) next->stretch *= pl_lazy_stretch(f->state, &it->links[i]);
        counters->box_tests += (unsigned)__builtin_popcount(next->rays);
        next->arrived = true;
        w->kernel->map(f->state, it, from, to, next->rays);
        next->rays = w->kernel->meet(it->gate, next->stretch, &w->wants, from, to, next->rays, &next->open, &next->t_entry);
    }
}

/* Pushes the items that rays meet. */
static bool push_items(work *w, uint32_t index, bool gates, pl_counters *counters, pl_error *error)
{
    const frame *f = &w->frames[index];
    const pl_lazy_state *state = f->state;
    const size_t first = w->stack_count;
    for (uint32_t i = 0; i < state->pattern->item_count; i++) {
        const pl_lazy_item *it = &state->pattern->items[i];
        uint32_t slot;
        if ((w->queries->shadow && it->no_shadow) || (state->singular && is_dropped(state, it))) continue;
        if (!take_slot(w, &slot, error) || !grow(&w->stack, w->stack_count, &w->stack_capacity, sizeof *w->stack, error)) return false;
        pending *next = &w->stack[w->stack_count];
        next->frame = index;
        next->item = i;
        next->slot = slot;
        approach(w, f, it, gates, next, counters);
        if (!next->rays) {
            give_slot(w, slot);
            if (index > counters->miss_depth) counters->miss_depth = index;
            continue;
        }
        insert(w, first);
        fetch(atomic_load_explicit(&state->below[i], memory_order_relaxed));
    }
    return true;
}

static bool fail_work(const pl_scene *scene, uint32_t symbol, const char *what, uint64_t limit, pl_error *error)
{
    return pl_fail_at(error, PL_ERROR_LIMIT, scene->program, symbol == UINT32_MAX ? 0 : symbol,
                      "work: one ray %s %llu, which is the limit; does the recursion end?", what, (unsigned long long)limit);
}

/* A ray's span for what stands below a frame: each within that of the frame before. */
static pl_span span_of(work *w, size_t index, uint32_t ray)
{
    const uint32_t bit = UINT32_C(1) << ray;
    size_t known = index;
    while (!(w->frames[known].spanned & bit)) known--;
    for (size_t i = known + 1; i <= index; i++) {
        frame *f = &w->frames[i];
        double o[3], d[3];
        take_ray(w, f->slot, ray, o, d);
        *inside_of(w, i, ray) = pl_span_below(w->frames[i - 1].state->pattern->items[f->item].gate, o, d, *inside_of(w, i - 1, ray));
        f->spanned |= bit;
    }
    return *inside_of(w, index, ray);
}

/* Keeps the scopes of frames that have states, by which they are found again: all are equally long, having no draws. */
static bool keep_scopes(work *w, const pl_program *program, pl_error *error)
{
    const size_t words = w->scope_words;
    for (size_t i = 1; i < w->frame_count; i++) {
        const pl_lazy_state *above = w->frames[i - 1].state;
        if (!above) continue;
        if (!grow(&w->scopes, (i + 1) * words, &w->scope_capacity, sizeof *w->scopes, error)) return false;
        pl_lazy_scope(program, above, &above->pattern->items[w->frames[i].item], words, w->scopes + i * words);
    }
    return true;
}

/* Lets all states go for an empty half of the cache. */
static bool change(pl_tracer *tracer, pl_error *error)
{
    work *w = tracer->work;
    for (size_t i = 0; tracer->scene->gates && i < w->frame_count; i++)
        for (uint32_t rays = w->frames[i].rays; rays;) span_of(w, i, next_ray(&rays));
    if (!keep_scopes(w, tracer->scene->program, error)) return false;
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
        const pl_lazy_state *above = index ? w->frames[index - 1].state : NULL;
        const frame *f = &w->frames[index];
        const uint64_t *scope = !index ? NULL : above ? w->scope : w->scopes + index * w->scope_words;
        bool full;
        if (above) pl_lazy_scope(tracer->scene->program, above, &above->pattern->items[f->item], w->scope_words, w->scope);
        pl_lazy_state *state = pl_lazy_get(tracer->scene->structure, w->half, w->unfolder, f->symbol, scope, index && !above, &w->spent, &full, error);
        if (!state && (!full || !change(tracer, error))) return NULL;
        w->frames[index].state = state;
    }
    return w->frames[index].state;
}

/* Goes into an instance, that of a frame that is complete but for its state: by an item of the frame before, or the scene itself
 * (NULL). */
static bool enter(pl_tracer *tracer, const pl_lazy_item *it, pl_error *error)
{
    work *w = tracer->work;
    const uint32_t index = (uint32_t)w->frame_count;
    frame *f = &w->frames[index];
    _Atomic(pl_lazy_state *) *place = it ? &w->frames[index - 1].state->below[f->item] : NULL;
    f->symbol = it ? it->what : UINT32_MAX;
    if (index > PL_LIMIT_DEPTH / w->part)
        return pl_fail_at(error, PL_ERROR_LIMIT, tracer->scene->program, f->symbol,
                          "depth: a ray came %d symbols deep, which is the limit; does the recursion end?", PL_LIMIT_DEPTH);
    f->state = it ? atomic_load_explicit(place, memory_order_acquire) : NULL;
    w->found += f->state != NULL;
    w->frame_count++;
    if (!f->state) {
        const uint32_t changes = w->changes;
        pl_lazy_state *state = state_of(tracer, index, error);
        if (!state) return false;
        if (it && w->changes == changes) atomic_store_explicit(place, state, memory_order_release);
    }
    if (w->spent > PL_LIMIT_UNFOLD_STEPS / w->part)
        return fail_work(tracer->scene, f->symbol, "needed to visit more nodes of the graph than", PL_LIMIT_UNFOLD_STEPS, error);
    return push_items(w, index, tracer->scene->gates != NULL, &tracer->counters, error);
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

/* Decides for a ray at a gate that isn't clearly open, of an instance that f is; where it is cut, offers its box. */
static pl_gate decide(pl_tracer *tracer, const pl_lazy_item *it, frame *f, uint32_t ray, bool *ok)
{
    work *w = tracer->work;
    pl_query *query = &w->queries[ray];
    double o[3], d[3], t_entry;
    take_ray(w, f->slot, ray, o, d);
    const pl_span within = span_of(w, w->frame_count - 1, ray);
    pl_arrival at = {0, o, d, f->stretch, within, (uint32_t)w->frame_count};
    const pl_gate gate = pl_gate_at(it->gate, o, d, f->stretch, &query->footprint, within, query->t_min, query->t_max, &t_entry,
                                    inside_of(w, w->frame_count, ray));
    if (gate == PL_GATE_OPEN) f->spanned |= UINT32_C(1) << ray;
    if (gate != PL_GATE_CUT || !(t_entry < query->t_max)) return gate;
    pl_leaf leaf = {.path = write_path, .source = w};
    const uint64_t hash = pl_cut_hash(0, w->path.terms, w->path.length);
    pl_lazy_scope(tracer->scene->program, w->frames[w->frame_count - 1].state, it, w->scope_words, w->scope);
    const double coverage = pl_lazy_coverage(w->unfolder, it->what, w->scope, d);
    *ok = pl_query_cut_box(query, it->gate, coverage, &at, hash, t_entry, &leaf);
    update(w, ray);
    return gate;
}

/* Goes into the instance of an item, which f is, with the rays for which its gate is open. */
static bool visit_instance(pl_tracer *tracer, const pl_lazy_item *it, frame *f, const pending *at, pl_error *error)
{
    work *w = tracer->work;
    bool ok = true;
    if (!at->arrived) w->kernel->map(w->frames[at->frame].state, it, rays_at(w, w->frames[at->frame].slot), rays_at(w, f->slot), f->rays);
    for (uint32_t rays = at->arrived ? f->rays & ~at->open : 0; ok && rays;) {
        const uint32_t ray = next_ray(&rays);
        if (decide(tracer, it, f, ray, &ok) != PL_GATE_OPEN) f->rays &= ~(UINT32_C(1) << ray);
    }
    if (!ok || !f->rays) {
        give_slot(w, f->slot);
        return ok;
    }
    if (it->unbounded && ++w->unknown > MOST_UNKNOWN)
        return fail_work(tracer->scene, it->what, "entered more instances of unknown size than", MOST_UNKNOWN, error);
    return enter(tracer, it, error);
}

/* Offers a primitive or a mesh to rays, in the frame of the state that it belongs to. */
static bool visit_leaf(pl_tracer *tracer, const pl_lazy_state *state, const pl_lazy_item *it, uint32_t slot, uint32_t rays)
{
    work *w = tracer->work;
    double o[3], d[3];
    pl_leaf leaf = {.arguments = it->arguments, .primitive = UINT64_MAX, .path = write_path, .source = w, .o = o, .d = d};
    if (it->kind == PL_NODE_MESH) leaf.mesh = tracer->scene->meshes[it->what];
    else leaf.shape = it->what;
    while (rays) {
        const uint32_t ray = next_ray(&rays);
        take_ray(w, slot, ray, o, d);
        for (uint32_t i = 0; i < it->link_count; i++) pl_map_ray(pl_lazy_transform(state, &it->links[i]), o, d);
        tracer->counters.primitive_tests++;
        if (!pl_query_leaf(&w->queries[ray], &leaf)) return false;
        update(w, ray);
    }
    return true;
}

/* An item of the last frame, which the frame after it is made of. */
static bool visit(pl_tracer *tracer, const pending *at, pl_error *error)
{
    work *w = tracer->work;
    const pl_lazy_state *state = state_of(tracer, at->frame, error);
    if (!state || !grow(&w->frames, w->frame_count, &w->frame_capacity, sizeof *w->frames, error) ||
        !grow(&w->inside, (w->frame_count + 1) * 4 * w->fours, &w->inside_capacity, sizeof *w->inside, error))
        return false;
    const pl_lazy_item *it = &state->pattern->items[at->item];
    if (!extend_path(w, it, error)) return false;
    if (it->kind != PL_NODE_ENTER) {
        give_slot(w, at->slot);
        return visit_leaf(tracer, state, it, w->frames[at->frame].slot, at->rays);
    }
    frame *f = &w->frames[w->frame_count];
    *f = (frame){.terms = w->path.length, .item = at->item, .slot = at->slot, .rays = at->rays, .stretch = at->stretch};
    return visit_instance(tracer, it, f, at, error);
}

/* The rays as they are in the world. */
static bool begin(work *w, const pl_scene *scene, const pl_ray *rays, pl_query *queries, unsigned count, pl_error *error)
{
    static const pl_footprint none;
    uint32_t slot;
    w->queries = queries;
    w->fours = (count + 3) / 4;
    w->part = count > 1 ? PART_TOGETHER : 1;
    w->all = UINT32_MAX >> (32 - count);
    w->stack_count = w->frame_count = w->slot_count = w->free_count = w->path.length = w->unknown = 0;
    w->spent = w->found = 0;
    if (!grow(&w->frames, 0, &w->frame_capacity, sizeof *w->frames, error) ||
        !grow(&w->inside, 4 * w->fours, &w->inside_capacity, sizeof *w->inside, error) || !take_slot(w, &slot, error))
        return false;
    w->frames[0] = (frame){.slot = slot, .rays = w->all, .spanned = w->all, .stretch = 1.0};
    pl_lazy_four *fours = rays_at(w, slot);
    for (uint32_t i = 0; i < 4 * w->fours; i++) {
        const uint32_t ray = i < count ? i : 0; /* what fills the last four counts nowhere */
        const pl_footprint footprint = scene->gates ? queries[ray].footprint : none;
        for (int axis = 0; axis < 3; axis++) {
            fours[i / 4].o[axis][i % 4] = rays[ray].origin[axis];
            fours[i / 4].d[axis][i % 4] = rays[ray].direction[axis];
        }
        fours[i / 4].leave[i % 4] = w->wants.t_max[i] = queries[ray].t_max;
        w->wants.t_min[i] = queries[ray].t_min;
        w->wants.width[i] = footprint.width;
        w->wants.spread[i] = footprint.spread;
        *inside_of(w, 0, i) = (pl_span){queries[ray].t_min, INFINITY};
    }
    return true;
}

/* false: an error, or they can't go together. */
static bool trace_many(pl_tracer *tracer, const pl_ray *rays, pl_query *queries, unsigned count)
{
    work *w = tracer->work;
    pl_lazy_cache *cache = tracer->scene->structure;
    pl_error *error = queries->error;
    if (!begin(w, tracer->scene, rays, queries, count, error)) return false;
    w->half = pl_lazy_hold(cache);
    bool ok = enter(tracer, NULL, error);
    for (uint64_t steps = 0; ok && w->stack_count && w->all; steps++) {
        pending at = w->stack[--w->stack_count];
        if (steps > PL_LIMIT_RAY_STEPS / w->part) ok = pl_query_fail_steps(queries, PL_LIMIT_RAY_STEPS);
        at.rays = w->kernel->waiting(&w->wants, rays_at(w, at.slot), at.rays);
        if (!at.rays) {
            give_slot(w, at.slot);
            continue;
        }
        while (w->frame_count > at.frame + 1) give_slot(w, w->frames[--w->frame_count].slot);
        ok = ok && visit(tracer, &at, error);
    }
    pl_lazy_release(cache, w->half);
    pl_lazy_add_found(cache, w->found);
    return ok;
}

static bool trace(pl_tracer *tracer, const pl_ray *ray, pl_query *query)
{
    return trace_many(tracer, ray, query, 1);
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
                                .trace_many = trace_many,
                                .number = number};
