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

/* What the payload has behind the ray, where there are cut-offs: the product of stretches, and the span (cut.h). */
enum { STRETCH = 6, ENTER, LEAVE };

/* The gate of the instance at an enter node: that of its state, or of its class. *box is set for the latter. */
static pl_gate gate_of(const pl_walk *walk, const pl_scene *scene, const pl_query *query, pl_arrival *at, pl_gate_box *box,
                       double *t_entry, pl_span *inside)
{
    const uint32_t symbol = scene->program->nodes[walk->node].as.enter.symbol;
    if (!scene->gates) {
        at->state = pl_states_find(&scene->states, symbol, &walk->scope);
        return pl_query_gate(query, &scene->states, at, t_entry, inside);
    }
    pl_classes_gate(scene->gates, symbol, &walk->scope, box);
    return pl_gate_at(box, at->o, at->d, at->stretch, &query->footprint, at->within, query->t_min, query->t_max, t_entry,
                      inside);
}

/* At an enter node: goes on only into instances whose gate is open. */
static bool pass_gate(pl_walk *walk, const pl_scene *scene, pl_counters *counters, pl_query *query)
{
    pl_arrival at = {.o = walk->at.payload,
                     .d = walk->at.payload + 3,
                     .stretch = walk->at.payload[STRETCH],
                     .within = {walk->at.payload[ENTER], walk->at.payload[LEAVE]},
                     .depth = walk->at.depth + 1};
    double t_entry;
    pl_span inside;
    pl_gate_box box;
    if (query->shadow && walk->at.no_shadow) {
        pl_walk_prune(walk);
        return true;
    }
    counters->box_tests++;
    pl_gate gate = gate_of(walk, scene, query, &at, &box, &t_entry, &inside);
    if (gate == PL_GATE_OPEN) {
        walk->at.payload[ENTER] = inside.enter;
        walk->at.payload[LEAVE] = inside.leave;
        return true;
    }
    pl_walk_prune(walk);
    if (gate == PL_GATE_MISSED) {
        if (walk->at.depth > counters->miss_depth) counters->miss_depth = walk->at.depth;
        return true;
    }
    pl_leaf leaf = {.path = walk_path, .source = walk};
    const uint64_t hash = pl_cut_hash(0, walk->path.terms, walk->at.terms);
    if (!scene->gates) return pl_query_cut(query, &scene->states, &at, hash, t_entry, &leaf);
    const uint32_t symbol = scene->program->nodes[walk->node].as.enter.symbol;
    return pl_query_cut_box(query, &box, pl_covers_of(scene->covers, symbol, &walk->scope, at.d), &at, hash, t_entry, &leaf);
}

bool pl_walk_offer(pl_walk *walk, const pl_scene *scene, pl_counters *counters, pl_query *query, pl_node_test missed)
{
    const bool cuts = scene->states.cuts || scene->gates;
    uint64_t primitive = 0, steps = 0;
    double *o = walk->at.payload, *d = o + 3;
    walk->stretches = cuts;
    while (!query->done) {
        pl_leaf leaf = {.path = walk_path, .source = walk, .o = o, .d = d};
        if (++steps > PL_LIMIT_WALK_STEPS) return pl_query_fail_steps(query, PL_LIMIT_WALK_STEPS);
        switch (pl_walk_next(walk, query->error)) {
        case PL_EVENT_ERROR: return false;
        case PL_EVENT_END: return true;
        case PL_EVENT_NODE:
            if (missed(walk, scene, counters, query)) pl_walk_prune(walk);
            continue;
        case PL_EVENT_TRANSFORM:
            pl_map_ray(walk->transform, o, d);
            walk->at.payload[STRETCH] *= walk->transform->stretch;
            continue;
        case PL_EVENT_TEXTURE: continue;
        case PL_EVENT_ENTER:
            if (cuts && !pass_gate(walk, scene, counters, query)) return false;
            continue;
        case PL_EVENT_PRIMITIVE:
            leaf.shape = walk->shape;
            leaf.arguments = walk->arguments;
            break;
        case PL_EVENT_MESH: leaf.mesh = scene->meshes[walk->mesh]; break;
        }
        leaf.primitive = primitive++;
        if (query->shadow && walk->at.no_shadow) continue;
        counters->primitive_tests++;
        if (!pl_query_leaf(query, &leaf)) return false;
    }
    return true;
}

bool pl_walk_trace(pl_walk *walk, const pl_scene *scene, pl_counters *counters, const pl_ray *ray, pl_query *query,
                   pl_node_test missed)
{
    pl_walk_restart(walk, 0, NULL);
    memcpy(walk->at.payload, ray->origin, 3 * sizeof(double));
    memcpy(walk->at.payload + 3, ray->direction, 3 * sizeof(double));
    walk->at.payload[STRETCH] = 1.0;
    if (scene->states.cuts || scene->gates) {
        pl_span span = {query->t_min, INFINITY};
        if (scene->states.cuts) span = pl_span_in(&scene->states, 0, ray->origin, ray->direction, span);
        walk->at.payload[ENTER] = span.enter;
        walk->at.payload[LEAVE] = span.leave;
    }
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
