/* gated.c - what the kernels of gated.h leave to double precision: gates that may be cut, primitives, and paths. */
#include "gated.h"

#include <stdlib.h>
#include <string.h>

#include "../coverage.h"
#include "../error.h"

/* --- working memory --- */

static bool grow(void *array, size_t least, size_t *capacity, size_t element, pl_error *error)
{
    void **place = array, *data;
    if (least <= *capacity) return true;
    size_t more = 2 * least + 16;
    if (!(data = realloc(*place, more * element))) return pl_fail_memory(error, "tracing a ray");
    *place = data;
    *capacity = more;
    return true;
}

bool pl_gated_grow_frames(pl_gated_work *w, size_t count, pl_error *error)
{
    const size_t before = w->frame_capacity;
    if (count < before) return true;
    if (!grow(&w->frames, count + 1, &w->frame_capacity, sizeof *w->frames, error)) return false;
    pl_gated_place *places = realloc(w->places, w->frame_capacity * PL_LANES * sizeof *places);
    if (!places) {
        w->frame_capacity = before;
        return pl_fail_memory(error, "tracing a ray");
    }
    w->places = places;
    for (size_t i = before * PL_LANES; i < w->frame_capacity * PL_LANES; i++) places[i].serial = 0;
    return true;
}

bool pl_gated_grow_stack(pl_gated_work *w, size_t top, pl_error *error)
{
    return grow(&w->stack, top + 64, &w->stack_capacity, sizeof *w->stack, error);
}

static void work_destroy(void *memory)
{
    pl_gated_work *w = memory;
    if (!w) return;
    if (w->packets) pl_accel_bvh.work_destroy(w->packets);
    free(w->frames);
    free(w->places);
    free(w->stack);
    free(w->chain);
    free(w);
}

static void *work_create(const pl_scene *scene, pl_error *error)
{
    pl_gated_work *w = calloc(1, sizeof *w);
    if (w) w->states = &scene->states;
    if (!w) pl_fail_memory(error, "preparing to trace");
    else if (pl_gated_grow_frames(w, 0, error) && pl_gated_grow_stack(w, 0, error) &&
             (w->packets = pl_accel_bvh.work_create(scene, error)))
        return w;
    work_destroy(w);
    return NULL;
}

/* --- down the path --- */

/* A path that may magnify rounding more than so many times is looked at gate by gate. */
#define BENT 16.0

static double bend_of(const pl_gated *gated, const pl_states *states, uint32_t state, const pl_item *item)
{
    return gated->bends ? (double)gated->states[state].bends[item - states->list[state].items] : 1.0;
}

/* The items of the opened nodes of a front from below its own state down to one, in w->chain, and one more; their number,
 * or 0: no memory. */
static size_t list_items(pl_gated_work *w, const pl_front *front, uint32_t opened, const pl_item *item, pl_error *error)
{
    size_t count = 1;
    for (uint32_t at = opened; at; at = front->opened[at].parent) count++;
    if (!grow(&w->chain, count, &w->chain_capacity, sizeof *w->chain, error)) return 0;
    w->chain[count - 1] = item;
    for (size_t i = count - 1; i > 0; opened = front->opened[opened].parent)
        w->chain[--i] = pl_front_item(w->states, front->opened[opened].item);
    return count;
}

static const pl_item *instance_item(const pl_scene *scene, const pl_front *front, uint32_t instance)
{
    return pl_front_item(&scene->states, front->places[instance].item);
}

/* Maps a ray through one item, and the product of stretches with it. */
static inline void step_down(const pl_item *item, pl_gated_place *place)
{
    for (uint32_t k = 0; k < item->transform_count; k++) {
        pl_map_ray(item->transforms[k], place->o, place->d);
        place->stretch *= item->transforms[k]->stretch;
    }
}

/* Maps a ray from a front's state to an item of an opened node, one transformation after another. */
static bool map_down(const pl_scene *scene, pl_gated_work *w, const pl_front *front, uint32_t opened, const pl_item *item,
                     double o[3], double d[3], double *bend, pl_error *error)
{
    const size_t count = list_items(w, front, opened, item, error);
    uint32_t state = front->state;
    for (size_t i = 0; i < count; i++) {
        for (uint32_t k = 0; k < w->chain[i]->transform_count; k++) pl_map_ray(w->chain[i]->transforms[k], o, d);
        *bend *= bend_of(scene->structure, &scene->states, state, w->chain[i]);
        state = w->chain[i]->what;
    }
    return count > 0;
}

/* The same with all that gates need. Where a box lies within the one around it, that one's span takes nothing away. */
static bool place_down(const pl_scene *scene, pl_gated_work *w, const pl_front *front, uint32_t opened,
                       const pl_item *item, pl_gated_place *place, pl_error *error)
{
    const pl_gated *gated = scene->structure;
    const pl_states *states = &scene->states;
    const size_t count = list_items(w, front, opened, item, error);
    uint32_t state = front->state;
    for (size_t i = 0; i < count; i++) {
        const pl_item *at = w->chain[i];
        if (!gated->states[state].nested[at - states->list[state].items])
            place->within = pl_span_in(states, state, place->o, place->d, place->within);
        step_down(at, place);
        place->bend *= bend_of(gated, states, state, at);
        state = at->what;
    }
    return count > 0;
}

/* Finds the place of the ray under way in a frame, from the deepest frame above where it is known. */
static bool place_frame(const pl_scene *scene, pl_gated_work *w, uint32_t index, pl_error *error)
{
    uint32_t from = index;
    while (pl_gated_place_in(w, from)->serial != w->frames[from].serial) from--;
    for (; from < index; from++) {
        const pl_front *front = w->frames[from].at.front;
        const uint32_t instance = w->frames[from + 1].at.instance;
        pl_gated_place *place = pl_gated_place_in(w, from + 1);
        *place = *pl_gated_place_in(w, from);
        place->serial = 0;
        if (!place_down(scene, w, front, front->places[instance].opened, instance_item(scene, front, instance), place, error))
            return false;
        place->serial = w->frames[from + 1].serial;
    }
    return true;
}

/* Whether all gates on the path to an opened node of a frame are open, those too that stand in fronts, and the span below
 * them: 1, 0, or -1: an error. */
static int pass_all_gates(const pl_scene *scene, pl_gated_work *w, uint32_t frame, uint32_t opened, const pl_query *query,
                          pl_span *within)
{
    const pl_states *states = &scene->states;
    pl_gated_place place = *pl_gated_place_in(w, 0);
    uint32_t depth = 0;
    *within = pl_span_in(states, 0, place.o, place.d, place.within);
    for (uint32_t i = 0; i <= frame; i++) {
        const pl_front *front = w->frames[i].at.front;
        const uint32_t instance = i < frame ? w->frames[i + 1].at.instance : 0;
        const uint32_t node = i < frame ? front->places[instance].opened : opened;
        const pl_item *last = i < frame ? instance_item(scene, front, instance) : NULL;
        const size_t count = list_items(w, front, node, last, query->error);
        if (!count) return -1;
        for (size_t k = 0; k < count && w->chain[k]; k++) {
            const pl_item *item = w->chain[k];
            double t_entry;
            step_down(item, &place);
            const pl_arrival arrival = {item->what, place.o, place.d, place.stretch, *within, ++depth};
            if (pl_query_gate(query, states, &arrival, &t_entry, within) != PL_GATE_OPEN) return 0;
        }
    }
    return 1;
}

void pl_gated_begin(pl_gated_work *w, const pl_ray *ray, double t_min)
{
    pl_gated_place *place = pl_gated_place_in(w, 0);
    *place = (pl_gated_place){.stretch = 1.0, .bend = 1.0, .within = {t_min, INFINITY}, .serial = w->frames[0].serial};
    memcpy(place->o, ray->origin, sizeof place->o);
    memcpy(place->d, ray->direction, sizeof place->d);
}

/* --- offering --- */

/* A leaf's place: frames 1 … frame, then a primitive or an instance. */
typedef struct source {
    const pl_scene *scene;
    const pl_gated_work *work;
    uint32_t frame;
    pl_ref ref;
} source;

/* Pairs of a rung and an instance in it, then a rung and a reference. */
static bool write_trail(const void *context, pl_path *trail)
{
    const source *s = context;
    const pl_gated *gated = s->scene->structure;
    uint32_t length = 0;
    for (uint32_t i = 0; i <= s->frame; i++) {
        const pl_gated_frame *f = &s->work->frames[i];
        pl_ref ref = i == s->frame ? s->ref : f[1].at.instance;
        if (!pl_path_push(trail, length++, (uint32_t)(f->rung - gated->rungs)) || !pl_path_push(trail, length++, ref))
            return false;
    }
    trail->length = length;
    return true;
}

bool pl_gated_candidate(pl_tracer *tracer, uint32_t frame, pl_ref ref, pl_query *query)
{
    pl_gated_work *w = tracer->work;
    const pl_scene *scene = tracer->scene;
    const pl_gated_frame *f = &w->frames[frame];
    const pl_front *front = f->at.front;
    const pl_front_primitive *primitive = &front->primitives[ref & PL_REF_INDEX];
    const pl_item *item = pl_front_item(&scene->states, primitive->item);
    if (!place_frame(scene, w, frame, query->error)) return false;
    const pl_gated_place *place = pl_gated_place_in(w, frame);
    double o[3], d[3];
    memcpy(o, place->o, sizeof o);
    memcpy(d, place->d, sizeof d);
    double bend = place->bend;
    pl_span within;
    if (!map_down(scene, w, front, primitive->opened, item, o, d, &bend, query->error)) return false;
    if (bend > BENT) {
        const int passed = pass_all_gates(scene, w, frame, primitive->opened, query, &within);
        if (passed <= 0) return passed == 0;
    }
    source s = {scene, w, frame, ref};
    pl_leaf leaf = {
        .shape = item->what,
        .arguments = item->arguments,
        .mesh = item->kind == PL_NODE_MESH ? scene->meshes[item->what] : NULL,
        .trail = write_trail,
        .source = &s,
        .o = o,
        .d = d,
    };
    tracer->counters.primitive_tests++;
    return pl_query_leaf(query, &leaf);
}

int pl_gated_arrive(pl_tracer *tracer, uint32_t frame, uint32_t instance, bool cut, pl_query *query)
{
    pl_gated_work *w = tracer->work;
    const pl_scene *scene = tracer->scene;
    const pl_states *states = &scene->states;
    const pl_gated_frame *f = &w->frames[frame];
    const pl_front *front = f->at.front;
    const pl_item *item = instance_item(scene, front, instance);
    const uint64_t hash = w->frames[frame + 1].hash;
    const uint32_t depth = w->frames[frame + 1].depth;
    tracer->counters.box_tests++;
    if (cut) { /* most of what isn't drawn needn't be mapped */
        const double most = pl_coverage_most(states, item->what);
        if (most < 0.0) return pl_fail_memory(query->error, "measuring coverages"), -1;
        if (!(pl_cut_chance(hash, depth, query->ray) < most)) return 0;
    }
    if (!place_frame(scene, w, frame, query->error)) return -1;
    pl_gated_place place = *pl_gated_place_in(w, frame);
    if (!place_down(scene, w, front, front->places[instance].opened, item, &place, query->error)) return -1;
    if (place.bend > BENT) {
        const int passed = pass_all_gates(scene, w, frame, front->places[instance].opened, query, &place.within);
        if (passed <= 0) return passed;
    }
    pl_arrival arrival = {item->what, place.o, place.d, place.stretch, place.within, depth};
    double t_entry;
    switch (pl_query_gate(query, states, &arrival, &t_entry, &place.within)) {
    case PL_GATE_MISSED: return 0;
    case PL_GATE_OPEN:
        place.serial = w->frames[frame + 1].serial;
        *pl_gated_place_in(w, frame + 1) = place;
        return 1;
    case PL_GATE_CUT: break;
    }
    source s = {scene, w, frame, pl_ref_of(PL_KIND_INSTANCE, instance)};
    pl_leaf leaf = {.trail = write_trail, .source = &s};
    return pl_query_cut(query, states, &arrival, hash, t_entry, &leaf) ? 0 : -1;
}

/* --- from a trail to the items on the path --- */

static bool trail_items(const pl_scene *scene, const pl_path *trail, pl_items *items)
{
    const pl_gated *gated = scene->structure;
    items->count = 0;
    for (uint32_t i = 0; i < trail->length; i += 2) {
        const pl_front *front = &gated->rungs[trail->terms[i]].front;
        const pl_ref ref = trail->terms[i + 1];
        const bool last = i + 2 == trail->length;
        uint32_t opened, item;
        if (!last || ref >> PL_REF_SHIFT == PL_KIND_INSTANCE) {
            opened = front->places[ref & PL_REF_INDEX].opened;
            item = front->places[ref & PL_REF_INDEX].item;
        } else {
            opened = front->primitives[ref & PL_REF_INDEX].opened;
            item = front->primitives[ref & PL_REF_INDEX].item;
        }
        if (!pl_front_add_items(items, &scene->states, front, opened, pl_front_item(&scene->states, item)))
            return false;
    }
    return true;
}

/* --- which kernel --- */

static bool trace(pl_tracer *tracer, const pl_ray *ray, pl_query *query)
{
    switch (tracer->scene->isa) {
#ifdef __x86_64__
    case PL_ISA_AVX512: return pl_gated_trace_avx512(tracer, ray, query);
    case PL_ISA_AVX2: return pl_gated_trace_avx2(tracer, ray, query);
#endif
    default: return pl_gated_trace_scalar(tracer, ray, query);
    }
}

static bool trace_many(pl_tracer *tracer, const pl_ray *rays, pl_query *queries, unsigned count)
{
#ifdef __x86_64__
    if (tracer->scene->isa != PL_ISA_SCALAR && count >= PL_LEAST_LANES) return pl_gated_packet_avx2(tracer, rays, queries, count);
#endif
    for (unsigned i = 0; i < count; i++)
        if (!trace(tracer, &rays[i], &queries[i])) return false;
    return true;
}

const pl_accel pl_accel_gated = {.name = "bvh",
                                 .states = true,
                                 .build = pl_gated_build,
                                 .destroy = pl_gated_destroy,
                                 .work_create = work_create,
                                 .work_destroy = work_destroy,
                                 .trace = trace,
                                 .trace_many = trace_many,
                                 .items = trail_items};
