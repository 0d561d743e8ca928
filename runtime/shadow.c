/* shadow.c - what stands between hits and a light (SHADING.md, section 4).
 *
 * Shadow rays of a tile's hits are traced together, those of hits at the same distance side by side. Each ray's answer is its
 * own, so no grouping shows in a picture. */
#include <math.h>
#include <string.h>

#include "shading.h"
#include "vector.h"

typedef struct pl_shadow {
    pl_shader *shader;
    const pl_ray *ray;
    double last; /* t of the surface crossed last */
    double *color;
    pl_error *error;
    bool failed;
} pl_shadow;

void pl_leave(const pl_view *view, const pl_spotted *at, const double direction[3], double origin[3])
{
    const double off = view->povray_epsilon ? 0.0 : copysign(at->epsilon, pl_dot(direction, at->flat));
    for (int axis = 0; axis < 3; axis++) origin[axis] = at->point[axis] + off * at->flat[axis];
}

/* What a surface on the way to the light lets through. */
static bool passes(pl_shader *shader, const pl_ray *ray, const pl_hit *hit, double through[3], pl_error *error)
{
    pl_surface surface;
    pl_pigment pigment;
    if (!pl_trace_surface(shader->tracer, ray, hit, &surface, error) ||
        !pl_texture_pigment(surface.texture, surface.entries, surface.pattern_point, &pigment, error))
        return false;
    pl_pigment_through(&pigment, through);
    return true;
}

/* One surface between a point and the light. */
static bool cross(void *context, const pl_hit *hit)
{
    pl_shadow *shadow = context;
    double through[3];
    if (shadow->shader->view->povray_epsilon) {
        if (!(hit->t - shadow->last > POVRAY_SHADOW)) return true;
        shadow->last = hit->t;
    }
    shadow->failed = !passes(shadow->shader, shadow->ray, hit, through, shadow->error);
    if (shadow->failed) return false;
    for (int c = 0; c < 3; c++) shadow->color[c] *= through[c];
    if (!pl_is_dark(shadow->color)) return true;
    memset(shadow->color, 0, 3 * sizeof *shadow->color);
    return false;
}

/* Filters the colour by all surfaces along the ray, in order. Where the nearest one, which is known, is opaque, the
 * others don't matter and needn't be found. */
static bool filter_light(pl_shader *shader, const pl_ray *ray, const pl_hit *nearest, double color[3], pl_error *error)
{
    double through[3];
    if (nearest->t == INFINITY) return true;
    if (!passes(shader, ray, nearest, through, error)) return false;
    if (through[0] == 0.0 && through[1] == 0.0 && through[2] == 0.0) {
        memset(color, 0, 3 * sizeof *color);
        return true;
    }
    pl_shadow state = {.shader = shader, .ray = ray, .color = color, .error = error};
    return pl_trace_all(shader->tracer, ray, cross, &state, error) && !state.failed;
}

/* The ray from a hit to the light; false: there is nothing in between. */
static bool set_shadow_ray(const pl_shader *shader, const pl_shine *shine, pl_ray *ray)
{
    const pl_view *view = shader->view;
    const pl_spotted *at = shine->at;
    pl_leave(view, at, shine->towards, ray->origin);
    memcpy(ray->direction, shine->towards, sizeof ray->direction);
    ray->t_min = view->povray_epsilon ? POVRAY_SHADOW : 0.0;
    ray->t_max = view->povray_epsilon ? fmin(shine->distance - POVRAY_SHADOW, POVRAY_FARTHEST) : shine->distance - at->epsilon;
    ray->shadow = true;
    const bool leaves = at->convex && view->all_opaque && !view->povray_epsilon && pl_dot(ray->direction, at->flat) > 0.0;
    ray->leaves = leaves ? at->hit : NULL;
    ray->width = at->width;
    ray->spread = view->spread;
    return ray->t_min < ray->t_max;
}

/* Makes the colours that arrive what is left of them behind everything on the first `count` rays to the light. */
static bool shadow_light(pl_shader *shader, pl_shine *const *shines, unsigned count, pl_error *error)
{
    shader->rays.shadow += count;
    if (shader->view->all_opaque) {
        if (pl_trace_any_many(shader->tracer, shader->traced, count, shader->blocked, error) < count) return false;
        for (unsigned i = 0; i < count; i++)
            if (shader->blocked[i]) memset(shines[i]->color, 0, sizeof shines[i]->color);
        return true;
    }
    if (pl_trace_nearest_many(shader->tracer, shader->traced, count, shader->hits, error) < count) return false;
    for (unsigned i = 0; i < count; i++)
        if (!filter_light(shader, &shader->traced[i], &shader->hits[i], shines[i]->color, error)) return false;
    return true;
}

/* Puts shines about into the order of their distance from the eye: into drawers. Hits of a tile that are equally far away
 * lie side by side, so their rays to a light meet the same things; those of neighbouring pixels may be far apart. */
static void sort_by_depth(pl_shine *shines, unsigned count, pl_shine **sorted)
{
    enum { DRAWERS = 64 };
    uint8_t drawers[PL_SHADE_MANY];
    unsigned begin[DRAWERS + 1] = {0};
    double nearest = INFINITY, farthest = 0.0;
    for (unsigned i = 0; i < count; i++) {
        const double depth = shines[i].at->depth;
        nearest = depth < nearest ? depth : nearest;
        farthest = depth > farthest ? depth : farthest;
    }
    const double scale = farthest > nearest ? (DRAWERS - 1) / (farthest - nearest) : 0.0;
    for (unsigned i = 0; i < count; i++) {
        const double place = (shines[i].at->depth - nearest) * scale;
        drawers[i] = place < DRAWERS - 1 ? (uint8_t)place : DRAWERS - 1;
        begin[drawers[i] + 1]++;
    }
    for (int i = 0; i < DRAWERS; i++) begin[i + 1] += begin[i];
    for (unsigned i = 0; i < count; i++) sorted[begin[drawers[i]]++] = &shines[i];
}

bool pl_cast_shadows(pl_shader *shader, unsigned count, pl_error *error)
{
    pl_shine **next = shader->sorted, *const *end = next + count;
    sort_by_depth(shader->shines, count, next);
    while (next < end) {
        pl_shine *shadowed[PL_TRACE_MANY];
        unsigned rays = 0;
        for (; next < end && rays < PL_TRACE_MANY; next++)
            if (set_shadow_ray(shader, *next, &shader->traced[rays])) shadowed[rays++] = *next;
        if (rays && !shadow_light(shader, shadowed, rays, error)) return false;
    }
    return true;
}
