/* shade.c - see shade.h; section numbers are SHADING.md's. */
#include "shade.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "elementary.h"
#include "error.h"
#include "texture.h"
#include "vector.h"

/* POV-Ray's tolerances, in scene units (section 7). */
#define POVRAY_LEAST 1e-4
#define POVRAY_SHADOW 1e-3
#define POVRAY_FARTHEST 1e7

/* A light this flat above the surface doesn't count (section 2). */
#define LEAST_COSINE 1e-10

/* A ray that waits to be traced. */
typedef struct pl_bounce {
    double origin[3], direction[3], t_min;
    double share[3]; /* of the sample's colour that the ray's colour counts for */
    double width;    /* of the pixel's footprint at the origin; it goes on growing by the view's spread */
    double weight;   /* POV-Ray's measure of it: the product of largest channels */
    uint32_t level;
} pl_bounce;

struct pl_shader {
    const pl_view *view;
    pl_tracer *tracer;
    pl_hit hit, blocker; /* of the ray being shaded; of its shadow ray */
    pl_bounce *waiting;
    size_t count, capacity;
    uint32_t sample_rays;
    pl_ray_counts rays;
    /* The eye's rays that were traced before they are asked for, and the next of them. */
    pl_ray ahead[PL_TRACE_MANY];
    pl_hit ahead_hits[PL_TRACE_MANY];
    unsigned ahead_count, ahead_next;
};

/* One hit while it is shaded. */
typedef struct pl_spotted {
    const pl_bounce *ray;
    double point[3], normal[3]; /* turned against the ray */
    double flat[3];             /* the surface's own normal, to either side */
    double width;               /* of the pixel's footprint here */
    double epsilon;             /* rounding error of the point, in our own tolerances */
    pl_pigment pigment;
    pl_finish finish;
} pl_spotted;

bool pl_view_create(pl_view *view, const pl_scene *scene, pl_error *error)
{
    const double *settings = pl_scene_settings(scene);
    const double *const *lights;
    *view = (pl_view){
        .scene = scene,
        .light_count = pl_scene_lights(scene, &lights),
        .max_trace_level = settings[PL_SETTINGS_MAX_TRACE_LEVEL],
        .adc_bailout = settings[PL_SETTINGS_ADC_BAILOUT],
        .all_opaque = pl_scene_all_opaque(scene),
        .povray_epsilon = pl_scene_povray_epsilon(scene),
    };
    memcpy(view->ambient_light, settings + PL_SETTINGS_AMBIENT_LIGHT, sizeof view->ambient_light);
    memcpy(view->background, settings + PL_SETTINGS_BACKGROUND, sizeof view->background);
    if (!pl_camera_create(pl_scene_camera(scene), &view->camera, error)) return false;
    view->lights = malloc(((size_t)view->light_count + 1) * sizeof *view->lights);
    if (!view->lights) return pl_fail_memory(error, "preparing the lights");
    for (uint32_t i = 0; i < view->light_count; i++)
        if (!pl_light_create(lights[i], &view->lights[i], error)) {
            pl_view_free(view);
            return false;
        }
    return true;
}

void pl_view_free(pl_view *view)
{
    free(view->lights);
    view->lights = NULL;
    view->light_count = 0;
}

pl_shader *pl_shader_create(const pl_view *view, pl_error *error)
{
    pl_shader *shader = calloc(1, sizeof *shader);
    if (!shader) {
        pl_fail_memory(error, "preparing to shade");
        return NULL;
    }
    shader->view = view;
    pl_hit_init(&shader->hit);
    pl_hit_init(&shader->blocker);
    for (int i = 0; i < PL_TRACE_MANY; i++) pl_hit_init(&shader->ahead_hits[i]);
    shader->tracer = pl_tracer_create(view->scene, error);
    if (shader->tracer) return shader;
    pl_shader_destroy(shader);
    return NULL;
}

void pl_shader_destroy(pl_shader *shader)
{
    if (!shader) return;
    if (shader->tracer) pl_tracer_destroy(shader->tracer);
    pl_hit_free(&shader->hit);
    pl_hit_free(&shader->blocker);
    for (int i = 0; i < PL_TRACE_MANY; i++) pl_hit_free(&shader->ahead_hits[i]);
    free(shader->waiting);
    free(shader);
}

const pl_view *pl_shader_view(const pl_shader *shader)
{
    return shader->view;
}

void pl_shader_count(const pl_shader *shader, pl_scene *scene)
{
    pl_scene_count(scene, shader->tracer, &shader->rays);
}

/* --- shadows (section 4) --- */

typedef struct pl_shadow {
    pl_shader *shader;
    const pl_ray *ray;
    double last; /* t of the surface crossed last */
    double *color;
    pl_error *error;
    bool failed;
} pl_shadow;

/* Sets where a ray in a direction leaves the surface: off it by its rounding error, in our own tolerances. */
static void leave(const pl_shader *shader, const pl_spotted *at, const double direction[3], double origin[3])
{
    const double off = shader->view->povray_epsilon ? 0.0 : copysign(at->epsilon, pl_dot(direction, at->flat));
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

/* Filters the colour by all surfaces along the ray, in order. The nearest one is looked at first: where there is none,
 * or it is opaque, the others don't matter and needn't be found. */
static bool filter_light(pl_shader *shader, const pl_ray *ray, double color[3], pl_error *error)
{
    double through[3];
    if (!pl_trace_nearest(shader->tracer, ray, &shader->blocker, error)) return false;
    if (shader->blocker.t == INFINITY) return true;
    if (!passes(shader, ray, &shader->blocker, through, error)) return false;
    if (through[0] == 0.0 && through[1] == 0.0 && through[2] == 0.0) {
        memset(color, 0, 3 * sizeof *color);
        return true;
    }
    pl_shadow state = {.shader = shader, .ray = ray, .color = color, .error = error};
    return pl_trace_all(shader->tracer, ray, cross, &state, error) && !state.failed;
}

/* Makes the arriving colour what is left of it behind everything between the point and the light. */
static bool shadow_light(pl_shader *shader, const pl_spotted *at, const double towards[3], double distance,
                         double color[3], pl_error *error)
{
    const pl_view *view = shader->view;
    pl_ray ray = {.shadow = true, .width = at->width, .spread = view->spread};
    leave(shader, at, towards, ray.origin);
    memcpy(ray.direction, towards, sizeof ray.direction);
    ray.t_min = view->povray_epsilon ? POVRAY_SHADOW : 0.0;
    ray.t_max = view->povray_epsilon ? fmin(distance - POVRAY_SHADOW, POVRAY_FARTHEST) : distance - at->epsilon;
    if (!(ray.t_min < ray.t_max)) return true;
    shader->rays.shadow++;
    if (view->all_opaque) {
        const int found = pl_trace_any(shader->tracer, &ray, error);
        if (found > 0) memset(color, 0, 3 * sizeof *color);
        return found >= 0;
    }
    return filter_light(shader, &ray, color, error);
}

/* --- light on a surface (section 2) --- */

/* The highlights' share of a light; the same for all channels. */
static double highlights(const pl_finish *finish, const double normal[3], const double direction[3],
                         const double towards[3])
{
    double sum = 0.0;
    if (finish->phong != 0.0) {
        const double along = pl_dot(direction, normal);
        double mirrored[3];
        for (int axis = 0; axis < 3; axis++) mirrored[axis] = direction[axis] - 2.0 * along * normal[axis];
        const double cosine = pl_dot(mirrored, towards);
        /* POV-Ray saves itself the faint end of sharp highlights. */
        if (cosine > 0.0 && (finish->phong_size < 60.0 || cosine > 0.0008))
            sum += finish->phong * pl_pow(fmin(cosine, 1.0), finish->phong_size);
    }
    if (finish->specular != 0.0) {
        double half[3];
        for (int axis = 0; axis < 3; axis++) half[axis] = towards[axis] - direction[axis];
        pl_normalize(half);
        const double cosine = pl_dot(half, normal);
        if (cosine > 0.0) sum += finish->specular * pl_pow(fmin(cosine, 1.0), 1.0 / finish->roughness);
    }
    return sum;
}

/* Adds what one light does. Shadows are traced last, and only where they can matter. */
static bool add_light(pl_shader *shader, const pl_light *light, const pl_spotted *at, double total[3],
                      pl_error *error)
{
    const pl_finish *finish = &at->finish;
    double towards[3], distance, color[3], share[3];
    pl_light_direction(light, at->point, towards, &distance);
    const double cosine = pl_dot(at->normal, towards);
    if (!(cosine >= LEAST_COSINE) || !pl_light_arriving(light, towards, distance, color)) return true;
    const double opacity = 1.0 - at->pigment.filter - at->pigment.transmit;
    const double fall = finish->brilliance == 1.0 ? cosine : pl_pow(cosine, finish->brilliance);
    const double glint = light->shadowless ? 0.0 : highlights(finish, at->normal, at->ray->direction, towards);
    for (int c = 0; c < 3; c++) share[c] = at->pigment.color[c] * opacity * (finish->diffuse * fall) + glint;
    if (share[0] == 0.0 && share[1] == 0.0 && share[2] == 0.0) return true;
    if (!light->shadowless && !shadow_light(shader, at, towards, distance, color, error)) return false;
    for (int c = 0; c < 3; c++) total[c] += color[c] * share[c];
    return true;
}

/* --- rays that go on (section 1) --- */

static bool push(pl_shader *shader, const pl_bounce *bounce, pl_error *error)
{
    if (shader->sample_rays >= PL_LIMIT_SAMPLE_RAYS)
        return pl_fail(error, PL_ERROR_LIMIT, "max_trace_level",
                       "more than %d rays came of one sample; a lower max_trace_level or higher adc_bailout ends them",
                       PL_LIMIT_SAMPLE_RAYS);
    if (shader->count == shader->capacity) {
        const size_t capacity = shader->capacity ? 2 * shader->capacity : 64;
        pl_bounce *waiting = realloc(shader->waiting, capacity * sizeof *waiting);
        if (!waiting) return pl_fail_memory(error, "following reflections");
        shader->waiting = waiting;
        shader->capacity = capacity;
    }
    shader->sample_rays++;
    shader->waiting[shader->count++] = *bounce;
    return true;
}

/* The ray that goes on from a hit and counts for `factor` of its light, unless one of the two limits ends it. */
static bool follow(pl_shader *shader, const pl_spotted *at, const double factor[3], double largest, bool transmitted,
                   pl_error *error)
{
    const pl_view *view = shader->view;
    pl_bounce next = {.width = at->width, .weight = at->ray->weight * largest, .level = at->ray->level};
    if (next.level >= view->max_trace_level) {
        shader->rays.trace_level++;
        return true;
    }
    if (next.weight < view->adc_bailout) {
        shader->rays.bailout++;
        return true;
    }
    memcpy(next.direction, at->ray->direction, sizeof next.direction);
    for (int c = 0; c < 3; c++) next.share[c] = at->ray->share[c] * factor[c];
    next.t_min = view->povray_epsilon ? nextafter(POVRAY_LEAST, 0.0) : 0.0;
    if (transmitted) {
        shader->rays.transmitted++;
    } else {
        const double along = pl_dot(next.direction, at->normal);
        for (int axis = 0; axis < 3; axis++) next.direction[axis] -= 2.0 * along * at->normal[axis];
        pl_normalize(next.direction);
        next.level++;
        shader->rays.reflection++;
    }
    leave(shader, at, next.direction, next.origin);
    return push(shader, &next, error);
}

static bool follow_both(pl_shader *shader, const pl_spotted *at, pl_error *error)
{
    const double *mirror = at->finish.reflection;
    double through[3];
    if ((mirror[0] != 0.0 || mirror[1] != 0.0 || mirror[2] != 0.0) &&
        !follow(shader, at, mirror, fmax(mirror[0], fmax(mirror[1], mirror[2])), false, error))
        return false;
    pl_pigment_through(&at->pigment, through);
    if (through[0] == 0.0 && through[1] == 0.0 && through[2] == 0.0) return true;
    const double grey = 0.297 * through[0] + 0.589 * through[1] + 0.114 * through[2];
    if (!(fabs(grey) > shader->view->adc_bailout)) {
        shader->rays.bailout++;
        return true;
    }
    const double largest = fmax(fabs(through[0]), fmax(fabs(through[1]), fabs(through[2])));
    return follow(shader, at, through, largest, true, error);
}

/* --- a sample --- */

/* Written in place: a structure that is put together and then copied waits for its parts to reach the cache. */
static void set_ray(const pl_shader *shader, const pl_bounce *bounce, pl_ray *ray)
{
    for (int axis = 0; axis < 3; axis++) {
        ray->origin[axis] = bounce->origin[axis];
        ray->direction[axis] = bounce->direction[axis];
    }
    ray->t_min = bounce->t_min;
    ray->t_max = shader->view->povray_epsilon ? POVRAY_FARTHEST : INFINITY;
    ray->shadow = false;
    ray->width = bounce->width;
    ray->spread = shader->view->spread;
}

/* What the surface needs for shading: everything that the tracer's next call may overwrite is copied. */
static bool spot(const pl_bounce *bounce, const pl_ray *ray, double t, const pl_surface *surface, pl_spotted *at,
                 pl_error *error)
{
    at->ray = bounce;
    at->epsilon = pl_hit_epsilon(surface, ray, t);
    at->width = ray->width + ray->spread * t;
    at->finish = pl_texture_finish(surface->texture);
    memcpy(at->point, surface->point, sizeof at->point);
    memcpy(at->normal, surface->normal, sizeof at->normal);
    memcpy(at->flat, surface->flat, sizeof at->flat);
    if (pl_dot(at->normal, bounce->direction) > 0.0)
        for (int axis = 0; axis < 3; axis++) at->normal[axis] = -at->normal[axis];
    return pl_texture_pigment(surface->texture, surface->entries, surface->pattern_point, &at->pigment, error);
}

/* The light of a hit itself, added to color; rays that go on are left waiting. */
static bool shade_hit(pl_shader *shader, const pl_spotted *at, double color[3], pl_error *error)
{
    const pl_view *view = shader->view;
    const double opacity = 1.0 - at->pigment.filter - at->pigment.transmit;
    double total[3];
    for (int c = 0; c < 3; c++)
        total[c] = at->pigment.color[c] * opacity *
                   (at->finish.ambient[c] * view->ambient_light[c] + at->finish.emission[c]);
    for (uint32_t i = 0; i < view->light_count; i++)
        if (!add_light(shader, &view->lights[i], at, total, error)) return false;
    for (int c = 0; c < 3; c++) color[c] += at->ray->share[c] * total[c];
    return follow_both(shader, at, error);
}

/* Whether the hit of an eye's ray is known; then it becomes the shader's. */
static bool take_ahead(pl_shader *shader, const pl_ray *ray)
{
    const unsigned i = shader->ahead_next;
    if (i >= shader->ahead_count || memcmp(shader->ahead[i].direction, ray->direction, sizeof ray->direction) != 0)
        return false;
    const pl_hit hit = shader->ahead_hits[i];
    shader->ahead_hits[i] = shader->hit;
    shader->hit = hit;
    shader->ahead_next++;
    return true;
}

static bool find(pl_shader *shader, const pl_ray *ray, bool is_eye, pl_surface *surface, pl_error *error)
{
    if (!(is_eye && take_ahead(shader, ray)) && !pl_trace_nearest(shader->tracer, ray, &shader->hit, error)) return false;
    return shader->hit.t == INFINITY || pl_trace_surface(shader->tracer, ray, &shader->hit, surface, error);
}

/* As find, for the eye's ray; fills *first where asked. */
static bool find_first(pl_shader *shader, const pl_ray *ray, pl_surface *surface, pl_first *first, pl_error *error)
{
    pl_counters *counters = pl_tracer_counters(shader->tracer);
    const uint64_t box_tests = counters->box_tests;
    counters->miss_depth = 0;
    shader->rays.primary++;
    if (!find(shader, ray, true, surface, error)) return false;
    if (!first) return true;
    if (!pl_trace_number(shader->tracer, &shader->hit, error)) return false;
    first->t = shader->hit.t;
    if (first->t != INFINITY) {
        first->primitive = pl_trace_primitive(shader->tracer, &shader->hit);
        first->surface = *surface;
    }
    first->box_tests = counters->box_tests - box_tests;
    first->miss_depth = counters->miss_depth;
    return true;
}

static void set_eye_ray(const pl_shader *shader, const double direction[3], pl_bounce *eye)
{
    for (int axis = 0; axis < 3; axis++) {
        eye->origin[axis] = shader->view->camera.location[axis];
        eye->direction[axis] = direction[axis];
        eye->share[axis] = 1.0;
    }
    eye->t_min = shader->view->povray_epsilon ? nextafter(POVRAY_LEAST, 0.0) : 0.0;
    eye->width = 0.0;
    eye->weight = 1.0;
    eye->level = 0;
}

void pl_shade_ahead(pl_shader *shader, const double (*directions)[3], unsigned count)
{
    pl_error error; /* comes again when the ray is asked for */
    shader->ahead_count = shader->ahead_next = 0;
    if (!pl_trace_has_packets(shader->tracer)) return;
    for (unsigned i = 0; i < count; i++) {
        pl_bounce eye;
        set_eye_ray(shader, directions[i], &eye);
        set_ray(shader, &eye, &shader->ahead[i]);
    }
    shader->ahead_count = pl_trace_nearest_many(shader->tracer, shader->ahead, count, shader->ahead_hits, &error);
}

bool pl_shade_first(pl_shader *shader, const double direction[3], pl_first *first, pl_error *error)
{
    pl_bounce eye;
    pl_ray ray;
    pl_surface surface;
    set_eye_ray(shader, direction, &eye);
    set_ray(shader, &eye, &ray);
    return find_first(shader, &ray, &surface, first, error);
}

bool pl_shade(pl_shader *shader, const double direction[3], double color[3], pl_first *first, pl_error *error)
{
    const pl_view *view = shader->view;
    pl_bounce bounce;
    set_eye_ray(shader, direction, &bounce);
    memset(color, 0, 3 * sizeof *color);
    shader->count = 0;
    shader->sample_rays = 0;
    if (!(bounce.level < view->max_trace_level) || bounce.weight < view->adc_bailout)
        return !first || pl_shade_first(shader, direction, first, error);
    bounce.level = 1;
    for (bool is_eye = true;; is_eye = false) {
        pl_ray ray;
        pl_surface surface;
        set_ray(shader, &bounce, &ray);
        pl_spotted at;
        if (!(is_eye ? find_first(shader, &ray, &surface, first, error) : find(shader, &ray, false, &surface, error)))
            return false;
        if (shader->hit.t == INFINITY)
            for (int c = 0; c < 3; c++) color[c] += bounce.share[c] * view->background[c];
        else if (!spot(&bounce, &ray, shader->hit.t, &surface, &at, error) ||
                 !shade_hit(shader, &at, color, error))
            return false;
        if (shader->count == 0) return true;
        bounce = shader->waiting[--shader->count];
    }
}
