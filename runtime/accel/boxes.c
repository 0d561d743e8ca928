/* boxes.c - the paper's chapter 3: one box a graph node, made conservative.
 *
 * The paper takes the box of a node's root-level instance, which cuts off deeper instances that outgrow it. Here a node's
 * box is the union over all its instances, each in the node's own frame, found through the shared states. Like the
 * paper's it is computed from the primitives through the whole chain of transformations, not from other boxes
 * (extent.c). A hit's primitive index follows from its path afterwards (trace.c), since subtrees that were skipped
 * aren't counted. */
#include "walk.h"

bool pl_walk_misses_box(const pl_walk *walk, const pl_scene *scene, pl_counters *counters, const pl_query *query)
{
    const pl_node_box *node = &scene->states.node_boxes[walk->node];
    double t_entry;
    if (node->unbounded) return false;
    counters->box_tests++;
    const double *o = walk->at.payload, *d = o + 3;
    pl_slab slab = pl_slab_of(o, d, pl_reach_slack(&node->reach, o));
    if (!pl_box_is_empty(&node->box) && pl_slab_hits(&slab, &node->box, query->t_min, query->t_max, &t_entry))
        return false;
    if (walk->at.depth > counters->miss_depth) counters->miss_depth = walk->at.depth;
    return true;
}

void *pl_walk_announcing_create(const pl_scene *scene, pl_error *error)
{
    pl_walk *walk = pl_walk_work_create(scene, error);
    if (walk) walk->announce = true;
    return walk;
}

/* With cut-offs the boxes of instances, tested at their gates, take the place of the nodes'. */
static bool trace(pl_tracer *tracer, const pl_ray *ray, pl_query *query)
{
    pl_walk *walk = tracer->work;
    walk->announce = !tracer->scene->states.cuts;
    return pl_walk_trace(tracer->work, tracer->scene, &tracer->counters, ray, query, pl_walk_misses_box);
}

const pl_accel pl_accel_boxes = {.name = "boxes",
                                 .states = true,
                                 .node_boxes = true,
                                 .work_create = pl_walk_announcing_create,
                                 .work_destroy = pl_walk_work_destroy,
                                 .trace = trace};
