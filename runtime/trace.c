/* trace.c - rays to hits and hits to surfaces (trace.h), whatever the accelerator. */
#include "trace.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "accel/query.h"
#include "error.h"

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
    free(tracer->scratch.terms);
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
    pl_hit_init(hit);
}

static pl_query begin_query(pl_tracer *tracer, const pl_ray *ray, pl_query_kind kind, pl_error *error)
{
    return (pl_query){.kind = kind,
                      .t_min = ray->t_min,
                      .t_max = ray->t_max,
                      .shadow = ray->shadow,
                      .list = tracer->list,
                      .scratch = &tracer->scratch,
                      .error = error};
}

/* Accelerators that skip without counting leave the primitive's index to be found from the path. */
static void number_primitive(const pl_tracer *tracer, pl_hit *hit)
{
    if (tracer->scene->accel->node_boxes) hit->primitive = pl_states_locate(&tracer->scene->states, &hit->path);
}

bool pl_trace_nearest(pl_tracer *tracer, const pl_ray *ray, pl_hit *hit, pl_error *error)
{
    pl_query query = begin_query(tracer, ray, PL_QUERY_NEAREST, error);
    query.hit = hit;
    hit->t = INFINITY;
    hit->bound = NAN;
    if (!tracer->scene->accel->trace(tracer, ray, &query)) {
        hit->t = INFINITY;
        return false;
    }
    if (query.found) number_primitive(tracer, hit);
    return true;
}

int pl_trace_any(pl_tracer *tracer, const pl_ray *ray, pl_error *error)
{
    pl_query query = begin_query(tracer, ray, PL_QUERY_ANY, error);
    if (!tracer->scene->accel->trace(tracer, ray, &query)) return -1;
    return query.found;
}

bool pl_trace_all(pl_tracer *tracer, const pl_ray *ray, bool (*visit)(void *context, const pl_hit *hit), void *context,
                  pl_error *error)
{
    pl_query query = begin_query(tracer, ray, PL_QUERY_ALL, error);
    tracer->list->count = 0;
    if (!tracer->scene->accel->trace(tracer, ray, &query)) return false;
    pl_hit_list_sort(tracer->list);
    for (size_t i = 0; i < tracer->list->count; i++) {
        number_primitive(tracer, &tracer->list->hits[i]);
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
    return 64.0 * DBL_EPSILON * (from + t * along) * (1.0 + surface->depth);
}

/* --- from a hit to its surface --- */

static bool remember(pl_chain *chain, const pl_transform *transform, pl_error *error)
{
    if (chain->count == chain->capacity) {
        size_t capacity = chain->capacity ? 2 * chain->capacity : 32;
        pl_transform *list = realloc(chain->list, capacity * sizeof *list);
        if (!list) return pl_fail_memory(error, "shading a hit");
        chain->list = list;
        chain->capacity = capacity;
    }
    chain->list[chain->count++] = *transform;
    return true;
}

/* At a texture node: its values, with those that depend on parameters computed here, and the frame it stands in. */
static bool take_texture(pl_tracer *tracer, double t, pl_surface *surface, pl_error *error)
{
    const pl_program *program = tracer->scene->program;
    const pl_node *node = &program->nodes[tracer->walk.node];
    const pl_record *record = &program->records[node->as.texture.texture];
    const double *o = tracer->walk.at.payload, *d = o + 3;
    for (int axis = 0; axis < 3; axis++) surface->pattern_point[axis] = o[axis] + t * d[axis];
    surface->entries = record->entries;
    surface->texture = record->values;
    if (!node->as.texture.code) return true;
    memcpy(tracer->texture, record->values, record->size * sizeof *tracer->texture);
    surface->texture = tracer->texture;
    tracer->walk.result.texture = tracer->texture;
    return pl_run(program, tracer->walk.node, node->as.texture.code, &tracer->walk.scope, &tracer->walk.result, error);
}

/* The normal at the leaf, mapped back by the chain of inverse transposes; unit at every level, so that no scale
 * however deep overflows (paper, section 2: only the foremost hit's normal is transformed back). */
static void map_normal_back(const pl_tracer *tracer, double n[3])
{
    for (size_t i = tracer->chain.count + 1; i-- > 0;) {
        double size = fmax(fabs(n[0]), fmax(fabs(n[1]), fabs(n[2])));
        for (int axis = 0; axis < 3; axis++) n[axis] /= size;
        double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (int axis = 0; axis < 3; axis++) n[axis] /= length;
        if (i > 0) pl_affine_normal(&tracer->chain.list[i - 1].to_object, n, n);
    }
}

static void finish_surface(pl_tracer *tracer, pl_event event, const pl_ray *ray, const pl_hit *hit, pl_surface *surface)
{
    const pl_walk *walk = &tracer->walk;
    const double *o = walk->at.payload, *d = o + 3;
    double local[3];
    for (int axis = 0; axis < 3; axis++) {
        local[axis] = o[axis] + hit->t * d[axis];
        surface->point[axis] = ray->origin[axis] + hit->t * ray->direction[axis];
    }
    if (event == PL_EVENT_MESH) pl_mesh_normal(tracer->scene->meshes[walk->mesh], hit->part, local, surface->normal);
    else pl_shape_of(walk->shape)->normal(walk->arguments, hit->part, local, surface->normal);
    map_normal_back(tracer, surface->normal);
    surface->symbol = walk->at.symbol == UINT32_MAX
                          ? -1
                          : (int32_t)tracer->scene->program->nodes[walk->at.symbol].symbol;
    surface->rule = walk->at.rule;
    surface->depth = (int32_t)walk->at.depth;
}

bool pl_trace_surface(pl_tracer *tracer, const pl_ray *ray, const pl_hit *hit, pl_surface *surface, pl_error *error)
{
    static const double plain[PL_TEXTURE_VALUES + PL_TEXTURE_ENTRY] = PL_TEXTURE_DEFAULTS;
    pl_walk *walk = &tracer->walk;
    pl_walk_restart(walk, 0, NULL);
    walk->follow = &hit->path;
    tracer->chain.count = 0;
    surface->texture = plain;
    surface->entries = 1;
    double *o = walk->at.payload;
    memcpy(o, ray->origin, 3 * sizeof *o);
    memcpy(o + 3, ray->direction, 3 * sizeof *o);
    for (int axis = 0; axis < 3; axis++)
        surface->pattern_point[axis] = ray->origin[axis] + hit->t * ray->direction[axis];
    for (;;) {
        pl_event event = pl_walk_next(walk, error);
        switch (event) {
        case PL_EVENT_ERROR: return false;
        case PL_EVENT_END: return pl_fail(error, PL_ERROR_ARGUMENT, "path", "the path doesn't exist in this scene");
        case PL_EVENT_TRANSFORM:
            pl_map_ray(walk->transform, o, o + 3);
            if (!remember(&tracer->chain, walk->transform, error)) return false;
            break;
        case PL_EVENT_TEXTURE:
            if (!take_texture(tracer, hit->t, surface, error)) return false;
            break;
        case PL_EVENT_PRIMITIVE:
        case PL_EVENT_MESH: finish_surface(tracer, event, ray, hit, surface); return true;
        default: break;
        }
    }
}
