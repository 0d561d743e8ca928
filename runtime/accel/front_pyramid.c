/* front_pyramid.c - whether all rays from one point through a rectangle miss the scene (front.h).
 *
 *     the eye, four directions  ->  true: no ray between them meets anything, false: one may
 *
 * Between the rays and a box stands one of the pyramid's four sides, if all the box lies beyond that side (culling by a
 * view frustum: Clark 1976). The walk ends at the first leaf that no side keeps off. Boxes are widened as for single rays, so
 * what misses them misses the scene. */
#include "front.h"

#include <float.h>
#include <math.h>

#include "../vector.h"

enum {
    SIDES = 4,
    MOST_NODES = 64 /* as many are worth their time; then the rays are traced */
};

/* Eyes farther from the front than this, in its unit frame, are left to the rays: as far_of in kernel.h. */
#define FARTHEST 64.0

/* A point x of the front's unit frame is beyond a side where normal·x < least. */
typedef struct pl_side {
    float normal[3], least;
    int row[3]; /* of a node's planes: the box's corner that goes farthest along the normal */
} pl_side;

/* false: the four directions are no pyramid. */
static bool set_sides(const double from[3], double slack, const double (*directions)[3], pl_side *sides)
{
    double middle[3];
    for (int axis = 0; axis < 3; axis++)
        middle[axis] = directions[0][axis] + directions[1][axis] + directions[2][axis] + directions[3][axis];
    for (int i = 0; i < SIDES; i++) {
        double normal[3];
        pl_cross(directions[i], directions[(i + 1) % SIDES], normal);
        if (!(pl_normalize(normal) > 1e-6)) return false;
        const double inside = pl_dot(normal, middle);
        if (!(fabs(inside) > 1e-6)) return false;
        for (int axis = 0; axis < 3; axis++) {
            normal[axis] = copysign(1.0, inside) * normal[axis];
            sides[i].normal[axis] = (float)normal[axis];
            sides[i].row[axis] = normal[axis] > 0.0 ? 3 + axis : axis;
        }
        sides[i].least = (float)(pl_dot(normal, from) - 2.0 * slack); /* |normal|₁ <= √3 */
    }
    return true;
}

/* The children of a node that no side keeps off. */
static unsigned children_within(const pl_side *sides, const pl_front_node *node)
{
    int within[PL_FRONT_WIDTH];
    unsigned mask = 0;
    for (int i = 0; i < PL_FRONT_WIDTH; i++) within[i] = node->child[i] != PL_NOTHING;
    for (const pl_side *side = sides; side < sides + SIDES; side++) {
        const float *x = node->planes[side->row[0]], *y = node->planes[side->row[1]], *z = node->planes[side->row[2]];
        for (int i = 0; i < PL_FRONT_WIDTH; i++)
            within[i] &= !(side->normal[0] * x[i] + side->normal[1] * y[i] + side->normal[2] * z[i] < side->least);
    }
    for (int i = 0; i < PL_FRONT_WIDTH; i++) mask |= (unsigned)within[i] << i;
    return mask;
}

bool pl_front_misses(const pl_front *front, const double eye[3], const double (*directions)[3])
{
    pl_ref stack[MOST_NODES * PL_FRONT_WIDTH];
    pl_side sides[SIDES];
    double from[3], distance = 0.0;
    unsigned top = 0;
    if (!front->framed || front->unbounded_count || front->root == PL_NOTHING) return false;
    for (int axis = 0; axis < 3; axis++) {
        from[axis] = (eye[axis] - front->centre[axis]) * front->scale;
        distance += fabs(from[axis]);
    }
    if (!(distance <= FARTHEST)) return false;
    /* What boxes are widened by, and the rounding of sums of single precision here. */
    const double slack = front->slack_gain * distance + front->slack_base + 64.0 * FLT_EPSILON * (1.0 + distance);
    if (!set_sides(from, slack, directions, sides)) return false;
    stack[top++] = front->root;
    for (int nodes = 0; top; nodes++) {
        const pl_ref ref = stack[--top];
        if (ref >> PL_REF_SHIFT != PL_KIND_NODE || nodes == MOST_NODES) return false;
        const pl_front_node *node = &front->nodes[ref];
        for (unsigned rest = children_within(sides, node); rest; rest &= rest - 1) {
            const pl_ref child = node->child[__builtin_ctz(rest)];
            if (child >> PL_REF_SHIFT != PL_KIND_NODE) return false;
            stack[top++] = child;
        }
    }
    return true;
}
