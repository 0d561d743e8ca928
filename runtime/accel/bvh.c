/* bvh.c - the default accelerator: fronts (front.h), filtered in single precision by a kernel, evaluated in double here. */
#include "bvh.h"

#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "../error.h"

/* --- working memory --- */

static void work_destroy(void *memory)
{
    pl_bvh_work *w = memory;
    if (!w) return;
    for (int i = 0; i < PL_LANES; i++) {
        free(w->lanes[i].frames);
        free(w->lanes[i].stack);
    }
    free(w->legs);
    free(w->chain);
    free(w->packets);
    free(w->packet_stack);
    free(w->packet_lanes);
    free(w);
}

static void *work_create(const pl_scene *scene, pl_error *error)
{
    pl_bvh_work *w = calloc(1, sizeof *w);
    if (w) w->legs = pl_bvh_legs_create();
    if (!w || !w->legs || !pl_bvh_grow_frames(w->lanes, 0, error) || !pl_bvh_grow_stack(w->lanes, 0, error)) {
        work_destroy(w);
        pl_fail_memory(error, "preparing to trace");
        return NULL;
    }
    w->states = &scene->states;
    return w;
}

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

bool pl_bvh_grow_frames(pl_bvh_lane *lane, size_t count, pl_error *error)
{
    return grow(&lane->frames, count + 1, &lane->frame_capacity, sizeof *lane->frames, error);
}

bool pl_bvh_grow_stack(pl_bvh_lane *lane, size_t top, pl_error *error)
{
    return grow(&lane->stack, top + 64, &lane->stack_capacity, sizeof *lane->stack, error);
}

bool pl_bvh_grow_packets(pl_bvh_work *w, size_t count, pl_error *error)
{
    return pl_bvh_grow_frames(w->lanes, count, error) &&
           grow(&w->packets, count + 1, &w->packet_capacity, sizeof *w->packets, error);
}

bool pl_bvh_grow_packet_stack(pl_bvh_work *w, size_t top, pl_error *error)
{
    return grow(&w->packet_stack, top + 64, &w->packet_stack_capacity, sizeof *w->packet_stack, error) &&
           grow(&w->packet_lanes, top + 64, &w->packet_lanes_capacity, sizeof *w->packet_lanes, error);
}

/* --- candidates --- */

/* Adds an item's transformations, the last one first. Most items have none, one or two, and which it is can't be foretold: two
 * are read in any case, from the block of packed states, in which items stand before all lists. */
static inline size_t add_transforms(const pl_transform **chain, size_t length, const pl_item *item)
{
    const size_t count = item->transform_count;
    const pl_transform *const *end = item->transforms + count;
    chain[length] = end[-1];
    chain[length + 1] = end[-2];
    if (__builtin_expect(count > 2, 0))
        for (size_t i = 2; i < count; i++) chain[length + i] = end[-1 - (ptrdiff_t)i];
    return length + count;
}

/* A chain's room for what stands above an item and its own transformations. */
static bool reserve_chain(pl_bvh_work *w, size_t above, const pl_item *item, pl_error *error)
{
    const size_t most = above + item->transform_count + 2;
    return most <= w->chain_capacity || grow(&w->chain, most, &w->chain_capacity, sizeof *w->chain, error);
}

bool pl_bvh_chain(pl_bvh_work *w, const pl_front *front, uint32_t opened, const pl_item *item, const pl_item *leaf,
                  size_t *count, pl_error *error)
{
    size_t length = 0;
    if (leaf && leaf != item) {
        if (!reserve_chain(w, 0, leaf, error)) return false;
        length = add_transforms(w->chain, 0, leaf);
    }
    if (front->links) {
        const pl_front_list list = front->opened[opened].list;
        const uint8_t *links = front->links + list.first;
        size_t above = list.length;
        if (!reserve_chain(w, length + above, item, error)) return false;
        length = add_transforms(w->chain, length, item);
        while (above > 0) w->chain[length++] = front->maps[links[--above]];
        *count = length;
        return true;
    }
    for (uint32_t at = opened;; at = front->opened[at].above) {
        if (!reserve_chain(w, length, item, error)) return false;
        length = add_transforms(w->chain, length, item);
        if (!at) break;
        item = &w->states->items[front->opened[at].item];
    }
    *count = length;
    return true;
}

static const pl_item *instance_item(const pl_scene *scene, const pl_front *front, uint32_t instance)
{
    return pl_front_item(&scene->states, front->places[instance].item);
}

static bool write_trail(const void *source, pl_path *trail)
{
    const pl_bvh_place *p = source;
    while (trail->capacity <= p->frame)
        if (!pl_path_push(trail, trail->capacity, 0)) return false;
    for (uint32_t i = 0; i < p->frame; i++) trail->terms[i] = p->lane->frames[i + 1].instance;
    trail->terms[p->frame] = p->ref;
    trail->length = p->frame + 1;
    return true;
}

pl_leaf pl_bvh_leaf(const pl_scene *scene, const pl_item *item, const pl_bvh_place *place)
{
    return (pl_leaf){
        .shape = item->what,
        .arguments = item->arguments,
        .mesh = item->kind == PL_NODE_MESH ? scene->meshes[item->what] : NULL,
        .trail = write_trail,
        .source = place,
    };
}

bool pl_bvh_offer(pl_tracer *tracer, const pl_bvh_lane *lane, uint32_t frame, pl_ref ref, const pl_item *item,
                  const double o[3], const double d[3], pl_query *query)
{
    const pl_bvh_place place = {lane, frame, ref};
    pl_leaf leaf = pl_bvh_leaf(tracer->scene, item, &place);
    leaf.o = o;
    leaf.d = d;
    tracer->counters.primitive_tests++;
    return pl_query_leaf(query, &leaf);
}

/* --- from a trail to the items on the path --- */

static bool trail_items(const pl_scene *scene, const pl_path *trail, pl_items *items)
{
    const pl_fronts *fronts = scene->structure;
    const pl_front *front = &fronts->list[0];
    items->count = 0;
    for (uint32_t i = 0; i + 1 < trail->length; i++) {
        const uint32_t instance = trail->terms[i];
        if (!pl_front_add_items(items, &scene->states, front, front->places[instance].opened, instance_item(scene, front, instance)))
            return false;
        front = &fronts->list[front->instances[instance].front & ~PL_NO_SHADOW];
    }
    const pl_front_primitive *leaf = &front->primitives[trail->terms[trail->length - 1] & PL_REF_INDEX];
    return pl_front_add_items(items, &scene->states, front, leaf->opened,
                              pl_front_item(&scene->states, leaf->item));
}

/* --- which kernel --- */

static bool trace(pl_tracer *tracer, const pl_ray *ray, pl_query *query)
{
    switch (tracer->scene->isa) {
#ifdef __x86_64__
    case PL_ISA_AVX512: return pl_bvh_trace_avx512(tracer, ray, query);
    case PL_ISA_AVX2: return pl_bvh_trace_avx2(tracer, ray, query);
#endif
    default: return pl_bvh_trace_scalar(tracer, ray, query);
    }
}

#ifdef __x86_64__
/* Whether another ray goes about the same way as the first one; scale: 1 / half the size of what is traced. */
static bool is_alike(const pl_ray *first, const pl_ray *other, double scale)
{
    const double *d = first->direction, near = PL_ALIKE * (fabs(d[0]) + fabs(d[1]) + fabs(d[2]));
    for (int axis = 0; axis < 3; axis++) {
        const double along = other->direction[axis], apart = other->origin[axis] - first->origin[axis];
        if (!(fabs(along - d[axis]) < near && fabs(apart) * scale < PL_NEAR)) return false;
    }
    return true;
}

/* Whether rays may be a packet, by the first two and the last one: the packets' kernel looks at all. */
static bool are_like_packet(const pl_ray *rays, unsigned count, double scale)
{
    return count >= PL_LEAST_LANES && is_alike(rays, rays + 1, scale) && is_alike(rays, rays + count - 1, scale);
}
#endif

/* Where not all go together, halves of them may. */
static bool trace_many(pl_tracer *tracer, const pl_ray *rays, pl_query *queries, unsigned count)
{
#ifdef __x86_64__
    const int isa = tracer->scene->isa;
    const double scale = ((const pl_fronts *)tracer->scene->structure)->list->scale;
    const unsigned half = PL_LANES / 2;
    if (isa == PL_ISA_SCALAR) return pl_bvh_stream_scalar(tracer, rays, queries, count);
    if (are_like_packet(rays, count, scale)) return pl_bvh_packet_avx2(tracer, rays, queries, count);
    if (count > half && (are_like_packet(rays, half, scale) || are_like_packet(rays + half, count - half, scale)))
        return trace_many(tracer, rays, queries, half) && trace_many(tracer, rays + half, queries + half, count - half);
    return (isa == PL_ISA_AVX512 ? pl_bvh_stream_avx512 : pl_bvh_stream_avx2)(tracer, rays, queries, count);
#else
    return pl_bvh_stream_scalar(tracer, rays, queries, count);
#endif
}

static bool misses(const pl_scene *scene, const double eye[3], const double (*directions)[3])
{
    return pl_front_misses(((const pl_fronts *)scene->structure)->list, eye, directions);
}

const pl_accel pl_accel_bvh = {.name = "bvh",
                               .states = true,
                               .build = pl_fronts_build,
                               .destroy = pl_fronts_destroy,
                               .work_create = work_create,
                               .work_destroy = work_destroy,
                               .trace = trace,
                               .trace_many = trace_many,
                               .misses = misses,
                               .items = trail_items,
                               .legs = pl_bvh_legs_of};
