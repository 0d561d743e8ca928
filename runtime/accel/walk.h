/* walk.h - tracing by walking the derivation: what none.c and boxes.c share. */
#ifndef PL_WALK_H
#define PL_WALK_H

#include "accel.h"

/* Whether the ray (walk->at.payload: origin, direction) misses the graph node where the walk stands. */
typedef bool (*pl_node_test)(const pl_walk *walk, const pl_scene *scene, pl_counters *counters, const pl_query *query);

/* Walks the derivation from the root and offers its leaves in path order; missed: NULL unless the walk announces nodes. */
bool pl_walk_trace(pl_walk *walk, const pl_scene *scene, pl_counters *counters, const pl_ray *ray, pl_query *query,
                   pl_node_test missed);

void *pl_walk_work_create(const pl_scene *scene, pl_error *error);
void pl_walk_work_destroy(void *work);

#endif
