/* mesh.c - a binary tree of boxes over a mesh's triangles, and the watertight triangle test.
 *
 * The test is Woop, Benthin & Wald's (JCGT 2(1), 2013) in double: vertices are sheared into a frame in which the ray runs
 * along z, so that the three edge functions have exactly opposite signs in the two triangles that share an edge, and no
 * ray slips between them. */
#include "mesh.h"

#include <float.h>
#include <stdlib.h>

enum { LEAF_TRIANGLES = 4, STACK = 128 };

typedef struct tree_node {
    pl_box box;
    uint32_t first; /* leaf: into order; inner: the left child, the right one follows it */
    uint32_t count; /* leaf: triangles; inner: 0 */
} tree_node;

struct pl_mesh_tree {
    const pl_mesh *mesh;
    tree_node *nodes;
    uint32_t *order;
    uint32_t node_count;
    double reach;
    pl_box box;
};

static const double *corner(const pl_mesh *mesh, uint32_t triangle, int i)
{
    return mesh->vertices + 3 * (size_t)mesh->triangles[3 * (size_t)triangle + (size_t)i];
}

static pl_box triangle_box(const pl_mesh *mesh, uint32_t triangle)
{
    pl_box box = pl_box_empty();
    for (int i = 0; i < 3; i++) {
        const double *p = corner(mesh, triangle, i);
        pl_box point = {{p[0], p[1], p[2]}, {p[0], p[1], p[2]}};
        pl_box_join(&box, &point);
    }
    return box;
}

static double middle(const pl_mesh *mesh, uint32_t triangle, int axis)
{
    return corner(mesh, triangle, 0)[axis] + corner(mesh, triangle, 1)[axis] + corner(mesh, triangle, 2)[axis];
}

/* Moves the `half` triangles with the smallest middles to the front (Hoare's selection; ties by index, so the tree
 * is the same everywhere). */
static void select_half(const pl_mesh *mesh, uint32_t *order, uint32_t count, uint32_t half, int axis)
{
    uint32_t lo = 0, hi = count - 1;
    while (lo < hi) {
        uint32_t pivot = order[lo + (hi - lo) / 2], i = lo, j = hi;
        double at = middle(mesh, pivot, axis);
        for (;;) {
            while (middle(mesh, order[i], axis) < at || (middle(mesh, order[i], axis) == at && order[i] < pivot)) i++;
            while (middle(mesh, order[j], axis) > at || (middle(mesh, order[j], axis) == at && order[j] > pivot)) j--;
            if (i >= j) break;
            uint32_t swap = order[i];
            order[i++] = order[j];
            order[j--] = swap;
        }
        if (half <= j) hi = j;
        else lo = j + 1;
    }
}

static int widest(const pl_box *box)
{
    double x = box->hi[0] - box->lo[0], y = box->hi[1] - box->lo[1], z = box->hi[2] - box->lo[2];
    return x >= y && x >= z ? 0 : y >= z ? 1 : 2;
}

/* Halves by count, so the depth is at most 32 and recursion is bounded. */
static void split(pl_mesh_tree *tree, uint32_t index, uint32_t first, uint32_t count)
{
    tree_node *node = &tree->nodes[index];
    node->box = pl_box_empty();
    for (uint32_t i = 0; i < count; i++) {
        pl_box box = triangle_box(tree->mesh, tree->order[first + i]);
        pl_box_join(&node->box, &box);
    }
    if (count <= LEAF_TRIANGLES) {
        node->first = first;
        node->count = count;
        return;
    }
    uint32_t half = count / 2, children = tree->node_count;
    select_half(tree->mesh, tree->order + first, count, half, widest(&node->box));
    tree->node_count += 2;
    node->first = children;
    node->count = 0;
    split(tree, children, first, half);
    split(tree, children + 1, first + half, count - half);
}

pl_mesh_tree *pl_mesh_tree_build(const pl_mesh *mesh)
{
    pl_mesh_tree *tree = calloc(1, sizeof *tree);
    if (!tree) return NULL;
    tree->mesh = mesh;
    tree->box = pl_box_empty();
    if (mesh->triangle_count == 0) return tree;
    tree->nodes = malloc(2 * (size_t)mesh->triangle_count * sizeof *tree->nodes);
    tree->order = malloc(mesh->triangle_count * sizeof *tree->order);
    if (!tree->nodes || !tree->order) {
        pl_mesh_tree_free(tree);
        return NULL;
    }
    for (uint32_t i = 0; i < mesh->triangle_count; i++) tree->order[i] = i;
    tree->node_count = 1;
    split(tree, 0, 0, mesh->triangle_count);
    tree->box = tree->nodes[0].box;
    tree->reach = pl_box_reach(&tree->box);
    return tree;
}

void pl_mesh_tree_free(pl_mesh_tree *tree)
{
    if (!tree) return;
    free(tree->nodes);
    free(tree->order);
    free(tree);
}

size_t pl_mesh_tree_bytes(const pl_mesh_tree *tree)
{
    return sizeof *tree + 2 * (size_t)tree->mesh->triangle_count * sizeof *tree->nodes +
           tree->mesh->triangle_count * sizeof *tree->order;
}

const pl_box *pl_mesh_box(const pl_mesh_tree *tree)
{
    return &tree->box;
}

/* The ray's frame for the triangle test: axis z is the direction's largest component; x and y keep handedness. */
typedef struct sheared_ray {
    int x, y, z;
    double shear_x, shear_y, scale_z;
    const double *origin;
} sheared_ray;

static sheared_ray shear_ray(const double o[3], const double d[3])
{
    sheared_ray ray;
    ray.z = fabs(d[0]) > fabs(d[1]) ? (fabs(d[0]) > fabs(d[2]) ? 0 : 2) : (fabs(d[1]) > fabs(d[2]) ? 1 : 2);
    ray.x = (ray.z + 1) % 3;
    ray.y = (ray.x + 1) % 3;
    ray.shear_x = d[ray.x] / d[ray.z];
    ray.shear_y = d[ray.y] / d[ray.z];
    ray.scale_z = 1.0 / d[ray.z];
    ray.origin = o;
    return ray;
}

static bool triangle_root(const sheared_ray *ray, const pl_mesh *mesh, uint32_t triangle, double t_min, double t_max,
                          double *t)
{
    double x[3], y[3], z[3];
    for (int i = 0; i < 3; i++) {
        const double *p = corner(mesh, triangle, i);
        double along = p[ray->z] - ray->origin[ray->z];
        x[i] = p[ray->x] - ray->origin[ray->x] - ray->shear_x * along;
        y[i] = p[ray->y] - ray->origin[ray->y] - ray->shear_y * along;
        z[i] = ray->scale_z * along;
    }
    double u = x[2] * y[1] - y[2] * x[1], v = x[0] * y[2] - y[0] * x[2], w = x[1] * y[0] - y[1] * x[0];
    if ((u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0)) return false;
    double determinant = u + v + w;
    if (determinant == 0.0) return false;
    *t = (u * z[0] + v * z[1] + w * z[2]) / determinant;
    return *t > t_min && *t < t_max;
}

/* Visits the triangles that the ray passes; visit gets the root and returns the new t_max (exclusive), or NaN to stop. */
static bool traverse(const pl_mesh_tree *tree, const double o[3], const double d[3], double t_min, double t_max,
                     double (*visit)(void *context, pl_root root), void *context)
{
    if (tree->node_count == 0) return true;
    double distance = sqrt(o[0] * o[0] + o[1] * o[1] + o[2] * o[2]);
    pl_slab slab = pl_slab_of(o, d, 16.0 * DBL_EPSILON * (distance + tree->reach));
    sheared_ray ray = shear_ray(o, d);
    uint32_t stack[STACK];
    int top = 0;
    stack[top++] = 0;
    while (top > 0) {
        const tree_node *node = &tree->nodes[stack[--top]];
        double t_entry, t;
        if (!pl_slab_hits(&slab, &node->box, t_min, t_max, &t_entry)) continue;
        if (node->count == 0) {
            /* Near child on top of the stack: nearer along the axis in which the children lie apart the most. */
            const tree_node *left = &tree->nodes[node->first], *right = left + 1;
            int axis = widest(&node->box);
            double apart = left->box.lo[axis] + left->box.hi[axis] - right->box.lo[axis] - right->box.hi[axis];
            uint32_t left_nearer = (apart < 0.0) == (d[axis] >= 0.0);
            stack[top++] = node->first + left_nearer;
            stack[top++] = node->first + !left_nearer;
            continue;
        }
        for (uint32_t i = 0; i < node->count; i++) {
            uint32_t triangle = tree->order[node->first + i];
            if (!triangle_root(&ray, tree->mesh, triangle, t_min, t_max, &t)) continue;
            t_max = visit(context, (pl_root){t, (int32_t)triangle});
            if (isnan(t_max)) return false;
        }
    }
    return true;
}

static double keep_nearest(void *context, pl_root root)
{
    pl_root *best = context;
    if (root.t < best->t || (root.t == best->t && root.part < best->part)) *best = root;
    return nextafter(best->t, INFINITY);
}

bool pl_mesh_nearest(const pl_mesh_tree *tree, const double o[3], const double d[3], double t_min, double t_max,
                     pl_root *root)
{
    *root = (pl_root){INFINITY, 0};
    traverse(tree, o, d, t_min, t_max, keep_nearest, root);
    return root->t < INFINITY;
}

typedef struct each {
    bool (*visit)(void *context, pl_root root);
    void *context;
    double t_max;
} each;

static double pass_on(void *context, pl_root root)
{
    const each *e = context;
    return e->visit(e->context, root) ? e->t_max : NAN;
}

bool pl_mesh_each(const pl_mesh_tree *tree, const double o[3], const double d[3], double t_min, double t_max,
                  bool (*visit)(void *context, pl_root root), void *context)
{
    each e = {visit, context, t_max};
    return traverse(tree, o, d, t_min, t_max, pass_on, &e);
}

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

bool pl_mesh_is_smooth(const pl_mesh_tree *tree)
{
    return tree->mesh->normals != NULL;
}

void pl_mesh_flat_normal(const pl_mesh_tree *tree, int32_t triangle, double n[3])
{
    double edge[2][3];
    for (int i = 0; i < 2; i++)
        for (int axis = 0; axis < 3; axis++)
            edge[i][axis] = corner(tree->mesh, (uint32_t)triangle, i + 1)[axis] - corner(tree->mesh, (uint32_t)triangle, 0)[axis];
    cross(edge[0], edge[1], n);
}

void pl_mesh_normal(const pl_mesh_tree *tree, int32_t triangle, const double p[3], double n[3])
{
    const pl_mesh *mesh = tree->mesh;
    const double *corners[3];
    double edge[3][3], from[3][3], flat[3];
    for (int i = 0; i < 3; i++) corners[i] = corner(mesh, (uint32_t)triangle, i);
    for (int i = 0; i < 3; i++)
        for (int axis = 0; axis < 3; axis++) {
            edge[i][axis] = corners[(i + 2) % 3][axis] - corners[(i + 1) % 3][axis];
            from[i][axis] = p[axis] - corners[(i + 1) % 3][axis];
        }
    cross(edge[0], edge[1], flat);
    for (int axis = 0; axis < 3; axis++) n[axis] = flat[axis];
    double area = dot(flat, flat);
    if (!mesh->normals || area == 0.0) return;

    double smooth[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i < 3; i++) {
        double side[3];
        cross(edge[i], from[i], side);
        const double *at = mesh->normals + 3 * (size_t)mesh->normal_triangles[3 * (size_t)triangle + (size_t)i];
        double weight = dot(side, flat) / (area * sqrt(dot(at, at)));
        for (int axis = 0; axis < 3; axis++) smooth[axis] += weight * at[axis];
    }
    if (!(dot(smooth, smooth) > 0.0)) return;
    for (int axis = 0; axis < 3; axis++) n[axis] = smooth[axis];
}
