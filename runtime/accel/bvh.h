/* bvh.h - a 4-wide tree of boxes a state, over the state's items in the state's own frame.
 *
 * bvh_build.c fills it, bvh.c traverses it. References (`child`, `root`): >= 0 a node of the same tree, PL_BVH_NOTHING,
 * else ~item. */
#ifndef PL_BVH_H
#define PL_BVH_H

#include "accel.h"

enum { PL_BVH_WIDTH = 4, PL_BVH_NOTHING = INT32_MIN };

typedef struct pl_bvh_node {
    double planes[2][3][PL_BVH_WIDTH]; /* lo and hi; unused children have empty boxes */
    int32_t child[PL_BVH_WIDTH];
} pl_bvh_node;

typedef struct pl_bvh_tree {
    const pl_bvh_node *nodes;
    const int32_t *unbounded; /* items without bounds: always visited */
    uint32_t node_count, unbounded_count;
    int32_t root;
} pl_bvh_tree;

/* One tree a state of scene->states, in memory of the states'. */
bool pl_bvh_build(pl_scene *scene, pl_error *error);
void pl_bvh_destroy(pl_scene *scene);

#endif
