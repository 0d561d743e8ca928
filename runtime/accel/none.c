/* none.c - the paper's chapter 2: every ray walks the whole derivation, evaluating it as it goes. No memory, no states.
 *
 * boxes.c shares the walk and adds its box tests at the graph nodes. */
#include "walk.h"

#include <stdlib.h>
#include <string.h>

static bool walk_path(const void *source, pl_path *path)
{
    const pl_walk *walk = source;
    return pl_path_copy(path, &walk->path, walk->at.terms);
}

bool pl_walk_offer(pl_walk *walk, const pl_scene *scene, pl_counters *counters, pl_query *query, pl_node_test missed)
{
    uint64_t primitive = 0, steps = 0;
    double *o = walk->at.payload, *d = o + 3;
    while (!query->done) {
        pl_leaf leaf = {.path = walk_path, .source = walk};
        if (++steps > PL_LIMIT_WALK_STEPS) return pl_query_fail_steps(query, PL_LIMIT_WALK_STEPS);
        switch (pl_walk_next(walk, query->error)) {
        case PL_EVENT_ERROR: return false;
        case PL_EVENT_END: return true;
        case PL_EVENT_NODE:
            if (missed(walk, scene, counters, query)) pl_walk_prune(walk);
            continue;
        case PL_EVENT_TRANSFORM: pl_map_ray(walk->transform, o, d); continue;
        case PL_EVENT_TEXTURE:
        case PL_EVENT_ENTER: continue;
        case PL_EVENT_PRIMITIVE:
            leaf.shape = walk->shape;
            leaf.arguments = walk->arguments;
            break;
        case PL_EVENT_MESH: leaf.mesh = scene->meshes[walk->mesh]; break;
        }
        leaf.primitive = primitive++;
        if (query->shadow && walk->at.no_shadow) continue;
        counters->primitive_tests++;
        if (!pl_query_leaf(query, &leaf, o, d)) return false;
    }
    return true;
}

bool pl_walk_trace(pl_walk *walk, const pl_scene *scene, pl_counters *counters, const pl_ray *ray, pl_query *query,
                   pl_node_test missed)
{
    pl_walk_restart(walk, 0, NULL);
    memcpy(walk->at.payload, ray->origin, 3 * sizeof(double));
    memcpy(walk->at.payload + 3, ray->direction, 3 * sizeof(double));
    return pl_walk_offer(walk, scene, counters, query, missed);
}

void *pl_walk_work_create(const pl_scene *scene, pl_error *error)
{
    pl_walk *walk = malloc(sizeof *walk);
    if (!walk || !pl_walk_begin(walk, scene->program, 0, NULL, error)) {
        free(walk);
        return NULL;
    }
    return walk;
}

void pl_walk_work_destroy(void *work)
{
    if (work) pl_walk_end(work);
    free(work);
}

static bool trace(pl_tracer *tracer, const pl_ray *ray, pl_query *query)
{
    return pl_walk_trace(tracer->work, tracer->scene, &tracer->counters, ray, query, NULL);
}

const pl_accel pl_accel_none = {
    .name = "none", .work_create = pl_walk_work_create, .work_destroy = pl_walk_work_destroy, .trace = trace};
