/* trace.c - rays to hits and hits to surfaces (trace.h), whatever the accelerator. */
#include "trace.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "accel/query.h"
#include "error.h"
#include "vector.h"

pl_tracer *pl_tracer_create(const pl_scene *scene, pl_error *error)
{
    pl_tracer *tracer = calloc(1, sizeof *tracer);
    if (!tracer) {
        pl_fail_memory(error, "preparing to trace");
        return NULL;
    }
    tracer->scene = scene;
    tracer->list = calloc(1, sizeof *tracer->list);
    tracer->work = scene->accel->work_create(scene, error);
    bool ok = pl_walk_begin(&tracer->walk, scene->program, 0, NULL, error);
    uint32_t largest = PL_TEXTURE_VALUES;
    for (uint32_t i = 0; i < scene->program->record_count; i++)
        if (scene->program->records[i].size > largest) largest = scene->program->records[i].size;
    tracer->texture = malloc(largest * sizeof *tracer->texture);
    if (!tracer->list || !tracer->texture) ok = pl_fail_memory(error, "preparing to trace");
    if (ok && tracer->work) return tracer;
    pl_tracer_destroy(tracer);
    return NULL;
}

void pl_tracer_destroy(pl_tracer *tracer)
{
    if (!tracer) return;
    tracer->scene->accel->work_destroy(tracer->work);
    pl_walk_end(&tracer->walk);
    pl_hit_list_free(tracer->list);
    free(tracer->chain.list);
    free(tracer->texture);
    free(tracer->first_textures);
    free(tracer->scratch.terms);
    free(tracer->spare.terms);
    free(tracer->items.list);
    free(tracer);
}

pl_counters *pl_tracer_counters(pl_tracer *tracer)
{
    return &tracer->counters;
}

void pl_hit_init(pl_hit *hit)
{
    *hit = (pl_hit){.t = INFINITY, .bound = NAN};
}

void pl_hit_free(pl_hit *hit)
{
    free(hit->path.terms);
    free(hit->trail.terms);
    pl_hit_init(hit);
}

static void begin_query(pl_query *query, pl_tracer *tracer, const pl_ray *ray, pl_query_kind kind, pl_error *error)
{
    query->kind = kind;
    query->t_min = ray->t_min;
    query->t_max = ray->t_max;
    query->shadow = ray->shadow;
    query->leaves = NULL;
    query->found = query->done = false;
    query->tracer = tracer;
    query->error = error;
    if (!tracer->scene->states.cuts && !tracer->scene->gates) { /* what is cut has no surface to go away from */
        if (kind == PL_QUERY_ANY) query->leaves = ray->leaves;
        return;
    }
    const double px = tracer->scene->detail;
    query->length = sqrt(pl_dot(ray->direction, ray->direction));
    query->footprint = (pl_footprint){px * ray->width, px * ray->spread, px * ray->width / query->length};
    query->ray = pl_cut_ray(ray->origin, ray->direction);
}

uint64_t pl_trace_primitive(pl_tracer *tracer, const pl_hit *hit)
{
    const pl_scene *scene = tracer->scene;
    uint64_t primitive = 0;
    if (scene->gates) return hit->primitive;
    if (scene->accel->node_boxes || (scene->states.cuts && !scene->accel->items))
        return pl_states_locate(&scene->states, &hit->path, hit->cut_depth);
    if (!scene->accel->items) return hit->primitive;
    if (!scene->accel->items(scene, &hit->trail, &tracer->items)) return UINT64_MAX;
    if (!tracer->items.count) return hit->primitive;
    for (size_t i = 0; i < tracer->items.count; i++)
        primitive = pl_add_saturating(primitive, tracer->items.list[i]->first);
    return primitive;
}

static void begin_hit(pl_hit *hit)
{
    hit->t = INFINITY;
    hit->bound = NAN;
    hit->cut_depth = 0;
}

/* A hit on what is cut is counted. */
static void count_cut(pl_tracer *tracer, const pl_query *query)
{
    const pl_hit *hit = query->hit;
    if (!query->found || !hit->cut_depth) return;
    tracer->counters.cuts++;
    tracer->counters.cut_error = fmax(tracer->counters.cut_error, hit->bound * query->length);
}

bool pl_trace_nearest(pl_tracer *tracer, const pl_ray *ray, pl_hit *hit, pl_error *error)
{
    pl_query query;
    begin_query(&query, tracer, ray, PL_QUERY_NEAREST, error);
    query.hit = hit;
    begin_hit(hit);
    if (!tracer->scene->accel->trace(tracer, ray, &query)) {
        hit->t = INFINITY;
        return false;
    }
    count_cut(tracer, &query);
    return true;
}

/* false: it isn't done so, or a ray has an error: alone they tell which. hits: of the nearest. */
static bool trace_many(pl_tracer *tracer, const pl_ray *rays, unsigned count, pl_query_kind kind, pl_hit *hits,
                       pl_query *queries)
{
    const pl_accel *accel = tracer->scene->accel;
    if (!accel->trace_many || count < 2) return false;
    for (unsigned i = 0; i < count; i++) {
        begin_query(&queries[i], tracer, &rays[i], kind, NULL);
        if (!hits) continue;
        queries[i].hit = &hits[i];
        begin_hit(&hits[i]);
    }
    return accel->trace_many(tracer, rays, queries, count);
}

unsigned pl_trace_nearest_many(pl_tracer *tracer, const pl_ray *rays, unsigned count, pl_hit *hits, pl_error *error)
{
    pl_query queries[PL_TRACE_MANY];
    if (trace_many(tracer, rays, count, PL_QUERY_NEAREST, hits, queries)) {
        for (unsigned i = 0; i < count; i++) count_cut(tracer, &queries[i]);
        return count;
    }
    for (unsigned i = 0; i < count; i++)
        if (!pl_trace_nearest(tracer, &rays[i], &hits[i], error)) return i;
    return count;
}

bool pl_trace_misses(const pl_scene *scene, const double eye[3], const double (*directions)[3])
{
    return scene->accel->misses && scene->accel->misses(scene, eye, directions);
}

bool pl_trace_number(pl_tracer *tracer, pl_hit *hit, pl_error *error)
{
    const pl_scene *scene = tracer->scene;
    if (hit->t == INFINITY) return true;
    if (scene->gates) return pl_number_by_classes(tracer, scene->gates, hit, error);
    return !scene->accel->number || scene->accel->number(tracer, hit, error);
}

int pl_trace_any(pl_tracer *tracer, const pl_ray *ray, pl_error *error)
{
    pl_query query;
    begin_query(&query, tracer, ray, PL_QUERY_ANY, error);
    if (!tracer->scene->accel->trace(tracer, ray, &query)) return -1;
    return query.found;
}

unsigned pl_trace_any_many(pl_tracer *tracer, const pl_ray *rays, unsigned count, bool *blocked, pl_error *error)
{
    pl_query queries[PL_TRACE_MANY];
    if (trace_many(tracer, rays, count, PL_QUERY_ANY, NULL, queries)) {
        for (unsigned i = 0; i < count; i++) blocked[i] = queries[i].found;
        return count;
    }
    for (unsigned i = 0; i < count; i++) {
        const int found = pl_trace_any(tracer, &rays[i], error);
        if (found < 0) return i;
        blocked[i] = found;
    }
    return count;
}

bool pl_trace_all(pl_tracer *tracer, const pl_ray *ray, bool (*visit)(void *context, const pl_hit *hit), void *context,
                  pl_error *error)
{
    pl_query query;
    begin_query(&query, tracer, ray, PL_QUERY_ALL, error);
    tracer->list->count = 0;
    if (!tracer->scene->accel->trace(tracer, ray, &query)) return false;
    pl_hit_list_sort(tracer->list);
    for (size_t i = 0; i < tracer->list->count; i++) {
        if (!visit(context, &tracer->list->hits[i])) break;
    }
    return true;
}

double pl_hit_epsilon(const pl_surface *surface, const pl_ray *ray, double t)
{
    double from = 0.0, along = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        from += fabs(ray->origin[axis]);
        along += fabs(ray->direction[axis]);
    }
    return 16.0 * DBL_EPSILON * (from + t * along) * (1.0 + surface->depth);
}
