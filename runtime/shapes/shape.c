/* shape.c - the table of shapes and the boxes that follow from their support functions. */
#include "shape.h"

#include <stddef.h>

#include "../bytecode.h"

const pl_shape *pl_shape_of(uint32_t id)
{
    switch (id) {
    case PL_SHAPE_SPHERE: return &pl_sphere;
    case PL_SHAPE_CYLINDER: return &pl_cylinder;
    case PL_SHAPE_CONE: return &pl_cone;
    case PL_SHAPE_BOX: return &pl_box_shape;
    case PL_SHAPE_TORUS: return &pl_torus;
    case PL_SHAPE_TRIANGLE: return &pl_triangle;
    case PL_SHAPE_SQUARE: return &pl_square;
    case PL_SHAPE_DISC: return &pl_disc;
    case PL_SHAPE_PLANE: return &pl_plane;
    default: return NULL;
    }
}

pl_box pl_shape_box(const pl_shape *shape, const double *arguments, const double *matrix)
{
    static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    if (!shape->support) return pl_box_everything();
    if (!matrix) matrix = identity;
    pl_box box;
    for (int axis = 0; axis < 3; axis++) {
        const double *row = matrix + 4 * axis;
        double backward[3] = {-row[0], -row[1], -row[2]};
        box.hi[axis] = row[3] + shape->support(arguments, row);
        box.lo[axis] = row[3] - shape->support(arguments, backward);
    }
    return box;
}
