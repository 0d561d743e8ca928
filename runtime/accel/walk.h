/* walk.h - tracing by walking the derivation: what none.c, boxes.c and grid.c share. */
#ifndef PL_WALK_H
#define PL_WALK_H

#include "accel.h"

/* Whether the ray (walk->at.payload: origin, direction) misses the graph node where the walk stands. */
typedef bool (*pl_node_test)(const pl_walk *walk, const pl_scene *scene, pl_counters *counters, const pl_query *query);

/* Walks the derivation from the root and offers its leaves in path order; missed: NULL unless the walk announces nodes. */
bool pl_walk_trace(pl_walk *walk, const pl_scene *scene, pl_counters *counters, const pl_ray *ray, pl_query *query,
                   pl_node_test missed);

/* The same from where the walk stands, with the ray in its payload (origin, direction) mapped that far. */
bool pl_walk_offer(pl_walk *walk, const pl_scene *scene, pl_counters *counters, pl_query *query, pl_node_test missed);

/* Whether the ray misses the box of the node where the walk stands (boxes.c). */
bool pl_walk_misses_box(const pl_walk *walk, const pl_scene *scene, pl_counters *counters, const pl_query *query);

void *pl_walk_work_create(const pl_scene *scene, pl_error *error);
void pl_walk_work_destroy(void *work);

/* pl_walk_work_create for walks that announce nodes. */
void *pl_walk_announcing_create(const pl_scene *scene, pl_error *error);

#endif
