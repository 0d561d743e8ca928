/* gated.h - a 4-wide tree of boxes a state, over the state's items in the state's own frame.
 *
 * gated_build.c fills it, gated.c traverses it. References (`child`, `root`): >= 0 a node of the same tree, PL_GATED_NOTHING,
 * else ~item. */
#ifndef PL_GATED_H
#define PL_GATED_H

#include "accel.h"

enum { PL_GATED_WIDTH = 4, PL_GATED_NOTHING = INT32_MIN };

typedef struct pl_gated_node {
    double planes[2][3][PL_GATED_WIDTH]; /* lo and hi; unused children have empty boxes */
    int32_t child[PL_GATED_WIDTH];
} pl_gated_node;

typedef struct pl_gated_tree {
    const pl_gated_node *nodes;
    const int32_t *unbounded; /* items without bounds: always visited */
    uint32_t node_count, unbounded_count;
    int32_t root;
} pl_gated_tree;

/* One tree a state of scene->states, in memory of the states'. */
bool pl_gated_build(pl_scene *scene, pl_error *error);
void pl_gated_destroy(pl_scene *scene);

#endif
