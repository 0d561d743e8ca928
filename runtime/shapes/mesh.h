/* mesh.h - a triangle mesh as one leaf: watertight roots, bounds, smooth normals.
 *
 *     pl_mesh_tree *tree = pl_mesh_tree_build(mesh);            mesh (program.h) -> its own BVH; NULL: no memory
 *     if (pl_mesh_nearest(tree, o, d, t_min, t_max, &root)) …   root.part is the triangle
 *     pl_mesh_normal(tree, root.part, point, normal);
 *
 * Roots obey shape.h's contract, but a ray may have any number of them. On equal t the lower triangle counts first. */
#ifndef PL_MESH_H
#define PL_MESH_H

#include <stddef.h>

#include "../program.h"
#include "shape.h"

typedef struct pl_mesh_tree pl_mesh_tree;

pl_mesh_tree *pl_mesh_tree_build(const pl_mesh *mesh);
void pl_mesh_tree_free(pl_mesh_tree *tree);
size_t pl_mesh_tree_bytes(const pl_mesh_tree *tree);

/* The box of the vertices; empty for a mesh without triangles. */
const pl_box *pl_mesh_box(const pl_mesh_tree *tree);

bool pl_mesh_nearest(const pl_mesh_tree *tree, const double o[3], const double d[3], double t_min, double t_max,
                     pl_root *root);

/* Calls visit with each root, in no order, until it returns false; false if it did. */
bool pl_mesh_each(const pl_mesh_tree *tree, const double o[3], const double d[3], double t_min, double t_max,
                  bool (*visit)(void *context, pl_root root), void *context);

/* The (smooth, where given) normal of a triangle at a point, and the triangle's own; any positive length. */
void pl_mesh_normal(const pl_mesh_tree *tree, int32_t triangle, const double p[3], double n[3]);
void pl_mesh_flat_normal(const pl_mesh_tree *tree, int32_t triangle, double n[3]);

/* Whether the two may differ. */
bool pl_mesh_is_smooth(const pl_mesh_tree *tree);

#endif
