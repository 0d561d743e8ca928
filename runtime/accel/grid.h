/* grid.h - the paper's chapter 4: a regular grid of voxels, each referring to a state of the graph.
 *
 * A state is a node of the graph with all that a ray needs to go on from there: the chain of transformations above it,
 * all parameters and the random key, the union terms taken. grid_fill.c fills the grid top down and resolves what meets
 * in a voxel at the junction of their paths, so a voxel refers to one state; grid.c traverses it.
 *
 * All memory is that of scene->states. */
#ifndef PL_GRID_H
#define PL_GRID_H

#include "accel.h"

enum { PL_GRID_NOTHING = UINT32_MAX };

/* One transformation above a state; `parent` is the next one outward (NULL: none). States share what they can. */
typedef struct pl_grid_link {
    const pl_transform *transform;
    const struct pl_grid_link *parent;
} pl_grid_link;

typedef struct pl_grid_state {
    uint32_t node; /* an S-, +- or P-node, or a mesh */
    uint32_t link_count, term_count;
    uint32_t depth, symbol;
    int32_t rule;
    bool no_shadow;
    double arguments[PL_SHAPE_ARGUMENTS]; /* of a primitive */
    pl_box box; /* in world space */
    const pl_grid_link *link; /* innermost */
    const uint32_t *terms;
    const uint64_t *words; /* the packed scope */
} pl_grid_state;

typedef struct pl_grid {
    uint32_t size[3]; /* voxels a side; 0: there are no finite bounds, so there is no grid */
    double lo[3], step[3];
    double margin; /* by which boxes were widened before they were put into voxels */
    const uint32_t *voxels; /* x fastest; a state or PL_GRID_NOTHING */
    const pl_grid_state *states;
    uint32_t state_count, longest; /* chain */
} pl_grid;

/* Fills scene->structure. Needs the boxes of graph nodes. */
bool pl_grid_build(pl_scene *scene, pl_error *error);

#endif
