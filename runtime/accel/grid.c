/* grid.c - rays through the grid of grid.h: a 3-D DDA (Fujimoto et al. 1986; Amanatides and Woo 1987) and, in a voxel, the
 * walk of boxes.c from the voxel's state on.
 *
 * Where being right departs from the paper:
 * - A state keeps the chain of transformations, not their product. The normative hit maps the ray level by level
 *   (accel.h), and a product rounds otherwise. What the product is good for, to find out quickly that a state is
 *   missed, the state's box in world space does.
 * - A state that lies in several voxels must neither hide what stands before it nor count twice. Its walk sees only the
 *   stretch of the ray inside the voxels that it was reached through; these stretches divide the ray, so every hit
 *   belongs to one of them. A primitive is tested over the whole ray, once (mailbox), unless all hits are wanted.
 * - Boxes were widened by `margin` before they were put into voxels. It exceeds all rounding, that of the mapped ray and
 *   that of the DDA; a ray from so far away that this isn't so walks the graph as in chapter 3.
 * - Shapes without bounds are in no voxel: every ray walks to them first. */
#include "grid.h"

#include <stdlib.h>
#include <string.h>

#include "../error.h"
#include "walk.h"

typedef struct work {
    pl_walk *walk;
    pl_scope scope;
    uint64_t ray;   /* number of the ray */
    uint64_t *seen; /* by state: the last ray that tested this primitive */
    const pl_grid_link **order; /* a chain, outermost last */
} work;

static void work_destroy(void *memory)
{
    work *w = memory;
    if (!w) return;
    pl_walk_work_destroy(w->walk);
    free(w->scope.parameters);
    free(w->seen);
    free(w->order);
    free(w);
}

static void *work_create(const pl_scene *scene, pl_error *error)
{
    const pl_grid *grid = scene->structure;
    work *w = calloc(1, sizeof *w);
    if (!w) {
        pl_fail_memory(error, "preparing to trace");
        return NULL;
    }
    w->walk = pl_walk_announcing_create(scene, error);
    w->scope.parameters = malloc((scene->program->parameter_count + 1) * sizeof *w->scope.parameters);
    w->seen = calloc((size_t)grid->state_count + 1, sizeof *w->seen);
    w->order = malloc(((size_t)grid->longest + 1) * sizeof *w->order);
    if (w->walk && w->scope.parameters && w->seen && w->order) return w;
    pl_fail_memory(error, "preparing to trace");
    work_destroy(w);
    return NULL;
}

/* --- a state --- */

/* In voxels, what has no bounds was tested before. */
static bool misses_bounded(const pl_walk *walk, const pl_scene *scene, pl_counters *counters, const pl_query *query)
{
    uint8_t kind = scene->program->nodes[walk->node].kind;
    bool leaf = kind == PL_NODE_PRIMITIVE || kind == PL_NODE_MESH;
    if (leaf && scene->states.node_boxes[walk->node].unbounded) return true;
    return pl_walk_misses_box(walk, scene, counters, query);
}

static bool misses_unbounded(const pl_walk *walk, const pl_scene *scene, pl_counters *counters, const pl_query *query)
{
    (void)counters;
    (void)query;
    return !scene->states.node_boxes[walk->node].unbounded;
}

/* The ray in a state's frame, mapped one transformation after another. */
static void map_ray(work *w, const pl_grid_state *state, const pl_ray *ray, double o[3], double d[3])
{
    uint32_t count = 0;
    for (const pl_grid_link *link = state->link; link; link = link->parent) w->order[count++] = link;
    memcpy(o, ray->origin, 3 * sizeof *o);
    memcpy(d, ray->direction, 3 * sizeof *d);
    while (count) pl_map_ray(w->order[--count]->transform, o, d);
}

static bool leaf_path(const void *context, pl_path *path)
{
    const pl_grid_state *state = context;
    return pl_path_copy(path, &(pl_path){(uint32_t *)state->terms, state->term_count, 0}, state->term_count);
}

static bool offer_leaf(pl_tracer *tracer, const pl_grid_state *state, const pl_ray *ray, pl_query *query)
{
    const pl_scene *scene = tracer->scene;
    const pl_node *node = &scene->program->nodes[state->node];
    double o[3], d[3];
    pl_leaf leaf = {.arguments = state->arguments, .path = leaf_path, .source = state, .o = o, .d = d};
    if (node->kind == PL_NODE_MESH) leaf.mesh = scene->meshes[node->as.mesh.mesh];
    else leaf.shape = node->as.primitive.shape;
    map_ray(tracer->work, state, ray, o, d);
    tracer->counters.primitive_tests++;
    return pl_query_leaf(query, &leaf);
}

/* Sets the graph to the state and goes on from there. */
static bool offer_subtree(pl_tracer *tracer, const pl_grid_state *state, const pl_ray *ray, pl_query *query)
{
    work *w = tracer->work;
    pl_walk *walk = w->walk;
    pl_scope_unpack(tracer->scene->program, state->words, &w->scope);
    pl_walk_restart(walk, state->node, &w->scope);
    pl_path before = {(uint32_t *)state->terms, state->term_count, 0};
    if (!pl_path_copy(&walk->path, &before, before.length)) return pl_fail_memory(query->error, "tracing a ray");
    walk->at.terms = state->term_count;
    walk->at.depth = state->depth;
    walk->at.symbol = state->symbol;
    walk->at.rule = state->rule;
    walk->at.no_shadow = state->no_shadow;
    map_ray(w, state, ray, walk->at.payload, walk->at.payload + 3);
    return pl_walk_offer(walk, tracer->scene, &tracer->counters, query, misses_bounded);
}

/* Offers the leaves of a voxel's state that the ray may hit at t_from <= t < t_to. */
static bool visit(pl_tracer *tracer, uint32_t index, const pl_ray *ray, const pl_slab *slab, double t_from, double t_to,
                  pl_query *query)
{
    const pl_scene *scene = tracer->scene;
    const pl_grid_state *state = (const pl_grid_state *)((const pl_grid *)scene->structure)->states + index;
    uint8_t kind = scene->program->nodes[state->node].kind;
    bool leaf = kind == PL_NODE_PRIMITIVE || kind == PL_NODE_MESH;
    work *w = tracer->work;
    double t_min = query->t_min, t_max = query->t_max, t_entry;
    if (query->shadow && state->no_shadow) return true;
    if (leaf && query->kind != PL_QUERY_ALL) {
        if (w->seen[index] == w->ray) return true;
        w->seen[index] = w->ray;
        t_from = -INFINITY;
        t_to = INFINITY;
    }
    query->t_min = fmax(t_min, nextafter(t_from, -INFINITY));
    query->t_max = fmin(t_max, t_to);
    bool ok = true;
    tracer->counters.box_tests++;
    if (pl_slab_hits(slab, &state->box, query->t_min, query->t_max, &t_entry))
        ok = leaf ? offer_leaf(tracer, state, ray, query) : offer_subtree(tracer, state, ray, query);
    else if (state->depth > tracer->counters.miss_depth)
        tracer->counters.miss_depth = state->depth;
    query->t_min = t_min;
    query->t_max = t_max;
    if (query->kind == PL_QUERY_NEAREST && query->hit->t < INFINITY)
        query->t_max = fmin(t_max, nextafter(query->hit->t, INFINITY));
    return ok;
}

/* --- the voxels --- */

typedef struct dda {
    int32_t at[3], step[3], end[3]; /* end: the first index outside */
    double origin[3], inverse[3], next[3]; /* next: t at the plane that leaves the voxel, along each axis */
} dda;

/* Planes are computed from their index each time, so that rounding doesn't add up. */
static void set_next(const pl_grid *grid, dda *v, int axis)
{
    double plane = grid->lo[axis] + (v->at[axis] + (v->step[axis] > 0)) * grid->step[axis];
    v->next[axis] = v->step[axis] ? (plane - v->origin[axis]) * v->inverse[axis] : INFINITY;
}

static void begin_dda(const pl_grid *grid, const pl_ray *ray, double t, dda *v)
{
    for (int axis = 0; axis < 3; axis++) {
        double d = ray->direction[axis], index = floor((ray->origin[axis] + t * d - grid->lo[axis]) / grid->step[axis]);
        int32_t last = (int32_t)grid->size[axis] - 1;
        v->origin[axis] = ray->origin[axis];
        v->inverse[axis] = 1.0 / d;
        v->step[axis] = !isfinite(v->inverse[axis]) ? 0 : d > 0.0 ? 1 : -1;
        v->at[axis] = index > 0.0 ? index < last ? (int32_t)index : last : 0;
        v->end[axis] = v->step[axis] > 0 ? last + 1 : -1;
        set_next(grid, v, axis);
    }
}

static uint32_t voxel(const pl_grid *grid, const dda *v)
{
    size_t row = (size_t)v->at[2] * grid->size[1] + (size_t)v->at[1];
    return grid->voxels[row * grid->size[0] + (size_t)v->at[0]];
}

/* Goes to the next voxel; false: there is none. */
static bool advance(const pl_grid *grid, dda *v, double *t)
{
    int axis = v->next[0] <= v->next[1] ? v->next[0] <= v->next[2] ? 0 : 2 : v->next[1] <= v->next[2] ? 1 : 2;
    if (v->next[axis] > *t) *t = v->next[axis];
    v->at[axis] += v->step[axis];
    if (v->step[axis] == 0 || v->at[axis] == v->end[axis]) return false;
    set_next(grid, v, axis);
    return true;
}

/* Neighbouring voxels with one state are one stretch of the ray. */
static bool traverse(pl_tracer *tracer, const pl_ray *ray, const pl_slab *slab, double t, pl_query *query)
{
    const pl_grid *grid = tracer->scene->structure;
    double t_from = -INFINITY;
    dda v;
    begin_dda(grid, ray, t, &v);
    for (bool inside = true; inside && !query->done && t <= query->t_max;) {
        uint32_t state = voxel(grid, &v);
        do inside = advance(grid, &v, &t);
        while (inside && voxel(grid, &v) == state);
        double t_to = inside ? t : INFINITY;
        if (state != PL_GRID_NOTHING && !visit(tracer, state, ray, slab, t_from, t_to, query)) return false;
        t_from = t_to;
    }
    return true;
}

/* Whether the margin exceeds the rounding of hits and of the DDA for this ray. */
static bool is_in_reach(const pl_scene *scene, const pl_ray *ray, double slack)
{
    const pl_grid *grid = scene->structure;
    double far = 0.0, fastest = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        double hi = grid->lo[axis] + grid->size[axis] * grid->step[axis];
        far = fmax(far, fabs(ray->origin[axis]) + fabs(grid->lo[axis]) + fabs(hi));
        fastest = fmax(fastest, fabs(ray->direction[axis]));
    }
    return slack + 64.0 * DBL_EPSILON * far <= grid->margin && fastest > 1e-150 && fastest < 1e150;
}

static bool trace(pl_tracer *tracer, const pl_ray *ray, pl_query *query)
{
    const pl_scene *scene = tracer->scene;
    const pl_grid *grid = scene->structure;
    work *w = tracer->work;
    double slack = pl_reach_slack(&scene->states.list[0].bounds->reach, ray->origin), t;
    w->ray++;
    if (grid->size[0] == 0 || !is_in_reach(scene, ray, slack))
        return pl_walk_trace(w->walk, scene, &tracer->counters, ray, query, pl_walk_misses_box);
    if (scene->states.list[0].unbounded &&
        !pl_walk_trace(w->walk, scene, &tracer->counters, ray, query, misses_unbounded))
        return false;
    if (query->done) return true;
    pl_box whole;
    for (int axis = 0; axis < 3; axis++) {
        whole.lo[axis] = grid->lo[axis];
        whole.hi[axis] = grid->lo[axis] + grid->size[axis] * grid->step[axis];
    }
    pl_slab slab = pl_slab_of(ray->origin, ray->direction, slack);
    if (!pl_slab_hits(&slab, &whole, query->t_min, query->t_max, &t)) return true;
    return traverse(tracer, ray, &slab, t, query);
}

static void destroy(pl_scene *scene)
{
    scene->structure = NULL;
}

const pl_accel pl_accel_grid = {.name = "grid",
                                .states = true,
                                .node_boxes = true,
                                .build = pl_grid_build,
                                .destroy = destroy,
                                .work_create = work_create,
                                .work_destroy = work_destroy,
                                .trace = trace};
