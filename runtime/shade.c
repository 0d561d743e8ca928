/* shade.c - see shade.h; section numbers are SHADING.md's. */
#include "shade.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "elementary.h"
#include "error.h"
#include "shading.h"
#include "texture.h"
#include "vector.h"

/* A light this flat above the surface doesn't count (section 2). */
#define LEAST_COSINE 1e-10

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

/* --- the eye --- */

/* Written in place: a structure that is put together and then copied waits for its parts to reach the cache. */
static void set_ray(const pl_view *view, const pl_bounce *bounce, pl_ray *ray)
{
    for (int axis = 0; axis < 3; axis++) {
        ray->origin[axis] = bounce->origin[axis];
        ray->direction[axis] = bounce->direction[axis];
    }
    ray->t_min = bounce->t_min;
    ray->t_max = view->povray_epsilon ? POVRAY_FARTHEST : INFINITY;
    ray->shadow = false;
    ray->leaves = NULL;
    ray->width = bounce->width;
    ray->spread = view->spread;
}

static void set_eye(const pl_view *view, pl_bounce *eye)
{
    *eye = (pl_bounce){.t_min = view->povray_epsilon ? nextafter(POVRAY_LEAST, 0.0) : 0.0,
                       .share = {1.0, 1.0, 1.0},
                       .weight = 1.0,
                       .level = 1};
    memcpy(eye->origin, view->camera.location, sizeof eye->origin);
}

/* The eye's rays in some of the samples' directions. */
static void look(pl_shader *shader, unsigned first, unsigned count, const double (*directions)[3])
{
    for (unsigned i = 0; i < count; i++) {
        memcpy(shader->eyes[first + i].direction, directions[i], sizeof directions[i]);
        memcpy(shader->eye_rays[i].direction, directions[i], sizeof directions[i]);
    }
}

pl_shader *pl_shader_create(const pl_view *view, pl_error *error)
{
    pl_shader *shader = calloc(1, sizeof *shader);
    if (!shader) {
        pl_fail_memory(error, "preparing to shade");
        return NULL;
    }
    shader->view = view;
    for (int i = 0; i < PL_SHADE_MANY; i++) pl_hit_init(&shader->hits[i]);
    for (int i = 0; i < PL_SHADE_MANY; i++) set_eye(view, &shader->eyes[i]);
    for (int i = 0; i < PL_TRACE_MANY; i++) set_ray(view, &shader->eyes[i], &shader->eye_rays[i]);
    shader->tracer = pl_tracer_create(view->scene, error);
    if (shader->tracer) return shader;
    pl_shader_destroy(shader);
    return NULL;
}

void pl_shader_destroy(pl_shader *shader)
{
    if (!shader) return;
    if (shader->tracer) pl_tracer_destroy(shader->tracer);
    for (int i = 0; i < PL_SHADE_MANY; i++) pl_hit_free(&shader->hits[i]);
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

/* --- light on a surface (section 2) --- */

/* Of the angle between the light and the mirrored ray; 0: no highlight. */
static double phong_cosine(const pl_shine *shine)
{
    const pl_spotted *at = shine->at;
    const double *direction = at->ray->direction;
    if (at->finish.phong == 0.0) return 0.0;
    const double along = pl_dot(direction, at->normal);
    double mirrored[3];
    for (int axis = 0; axis < 3; axis++) mirrored[axis] = direction[axis] - 2.0 * along * at->normal[axis];
    const double cosine = pl_dot(mirrored, shine->towards);
    /* POV-Ray saves itself the faint end of sharp highlights. */
    return cosine > 0.0 && (at->finish.phong_size < 60.0 || cosine > 0.0008) ? fmin(cosine, 1.0) : 0.0;
}

/* Of the angle between the normal and half the way from the eye to the light; 0: no highlight. */
static double specular_cosine(const pl_shine *shine)
{
    const pl_spotted *at = shine->at;
    if (at->finish.specular == 0.0) return 0.0;
    double half[3];
    for (int axis = 0; axis < 3; axis++) half[axis] = shine->towards[axis] - at->ray->direction[axis];
    pl_normalize(half);
    const double cosine = pl_dot(half, at->normal);
    return cosine > 0.0 ? fmin(cosine, 1.0) : 0.0;
}

/* The highlights' share of a light, the same for all channels. */
static double highlights(const pl_shine *shine)
{
    const pl_finish *finish = &shine->at->finish;
    const double phong = phong_cosine(shine), specular = specular_cosine(shine);
    double sum = 0.0;
    if (phong > 0.0) sum += finish->phong * pl_power(phong, finish->phong_size);
    if (specular > 0.0) sum += finish->specular * pl_power(specular, 1.0 / finish->roughness);
    return sum;
}

/* Whether a light can matter on a hit, and what of it would arrive without shadows. */
static bool shines_on(const pl_light *light, pl_shine *shine)
{
    const pl_spotted *at = shine->at;
    const double opacity = 1.0 - at->pigment.filter - at->pigment.transmit;
    pl_light_direction(light, at->point, shine->towards, &shine->distance);
    const double cosine = pl_dot(at->normal, shine->towards);
    if (!(cosine >= LEAST_COSINE) || !pl_light_arriving(light, shine->towards, shine->distance, shine->color))
        return false;
    const double fall = at->finish.brilliance == 1.0 ? cosine : pl_power(cosine, at->finish.brilliance);
    for (int c = 0; c < 3; c++) shine->share[c] = at->pigment.color[c] * opacity * (at->finish.diffuse * fall);
    if (shine->share[0] != 0.0 || shine->share[1] != 0.0 || shine->share[2] != 0.0) return true;
    return !light->shadowless && highlights(shine) != 0.0;
}

/* Adds what arrives. Highlights wait until it is known that something does. */
static void add_shine(const pl_light *light, const pl_shine *shine)
{
    if (pl_is_dark(shine->color)) return;
    const double glint = light->shadowless ? 0.0 : highlights(shine);
    for (int c = 0; c < 3; c++) shine->at->total[c] += shine->color[c] * (shine->share[c] + glint);
}

/* Adds what one light does on some hits. Shadows are traced last, and only where they can matter. */
static bool add_light(pl_shader *shader, const pl_light *light, pl_spotted *spotted, unsigned count, pl_error *error)
{
    unsigned shining = 0;
    for (unsigned i = 0; i < count; i++) {
        pl_shine *shine = &shader->shines[shining];
        shine->at = &spotted[i];
        if (spotted[i].found && shines_on(light, shine)) shining++;
    }
    if (!light->shadowless && !pl_cast_shadows(shader, shining, error)) return false;
    for (unsigned i = 0; i < shining; i++) add_shine(light, &shader->shines[i]);
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
    pl_leave(shader->view, at, next.direction, next.origin);
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

/* What the surface needs for shading: everything that the tracer's next call may overwrite is copied. */
static bool spot(const pl_bounce *bounce, const pl_ray *ray, double t, const pl_surface *surface, pl_spotted *at,
                 pl_error *error)
{
    at->ray = bounce;
    at->depth = t;
    at->convex = surface->convex;
    at->epsilon = pl_hit_epsilon(surface, ray, t);
    at->width = ray->width + ray->spread * t;
    pl_texture_finish(surface->texture, &at->finish);
    memcpy(at->point, surface->point, sizeof at->point);
    memcpy(at->normal, surface->normal, sizeof at->normal);
    memcpy(at->flat, surface->flat, sizeof at->flat);
    if (pl_dot(at->normal, bounce->direction) > 0.0)
        for (int axis = 0; axis < 3; axis++) at->normal[axis] = -at->normal[axis];
    return pl_texture_pigment(surface->texture, surface->entries, surface->pattern_point, &at->pigment, error);
}

static void begin_first(const pl_shader *shader, pl_first *first)
{
    pl_counters *counters = pl_tracer_counters(shader->tracer);
    first->box_tests = counters->box_tests;
    counters->miss_depth = 0;
}

/* What the eye's ray met; surface where it met something. */
static bool set_first(pl_shader *shader, pl_hit *hit, const pl_surface *surface, pl_first *first, pl_error *error)
{
    const pl_counters *counters = pl_tracer_counters(shader->tracer);
    if (!pl_trace_number(shader->tracer, hit, error)) return false;
    first->t = hit->t;
    if (first->t != INFINITY) {
        first->primitive = pl_trace_primitive(shader->tracer, hit);
        first->surface = *surface;
    }
    first->box_tests = counters->box_tests - first->box_tests;
    first->miss_depth = counters->miss_depth;
    return true;
}

/* The light of hits themselves, into their totals. */
static bool light_hits(pl_shader *shader, pl_spotted *spotted, unsigned count, pl_error *error)
{
    const pl_view *view = shader->view;
    for (unsigned i = 0; i < count; i++) {
        pl_spotted *at = &spotted[i];
        if (!at->found) continue;
        const double opacity = 1.0 - at->pigment.filter - at->pigment.transmit;
        for (int c = 0; c < 3; c++)
            at->total[c] = at->pigment.color[c] * opacity *
                           (at->finish.ambient[c] * view->ambient_light[c] + at->finish.emission[c]);
    }
    for (uint32_t i = 0; i < view->light_count; i++)
        if (!add_light(shader, &view->lights[i], spotted, count, error)) return false;
    return true;
}

/* Finds what the rays of some bounces meet; *found: how many do. */
static bool spot_many(pl_shader *shader, const pl_bounce *bounces, const pl_ray *rays, unsigned count, pl_hit *hits,
                      pl_spotted *spotted, unsigned *found, pl_first *first, pl_error *error)
{
    if (pl_trace_nearest_many(shader->tracer, rays, count, hits, error) < count) return false;
    for (unsigned i = 0; i < count; i++) {
        const pl_ray *ray = &rays[i];
        pl_hit *hit = &hits[i];
        pl_surface surface;
        spotted[i].hit = hit;
        spotted[i].found = hit->t != INFINITY;
        if (spotted[i].found && !(pl_trace_surface(shader->tracer, ray, hit, &surface, error) &&
                                  spot(&bounces[i], ray, hit->t, &surface, &spotted[i], error)))
            return false;
        *found += spotted[i].found;
        if (first && !set_first(shader, hit, &surface, first, error)) return false;
    }
    return true;
}

/* The same of the eye's rays, a packet at a time, and lights it. */
static bool spot_all(pl_shader *shader, const double (*directions)[3], unsigned count, pl_first *first, pl_error *error)
{
    unsigned found = 0;
    for (unsigned from = 0; from < count; from += PL_TRACE_MANY) {
        const unsigned some = count - from < PL_TRACE_MANY ? count - from : PL_TRACE_MANY;
        look(shader, from, some, directions + from);
        if (!spot_many(shader, shader->eyes + from, shader->eye_rays, some, shader->hits + from, shader->spotted + from, &found,
                       first, error))
            return false;
    }
    return found == 0 || light_hits(shader, shader->spotted, count, error);
}

/* Adds a lighted hit to the sample's colour; rays that go on are left waiting. */
static bool collect(pl_shader *shader, const pl_bounce *bounce, const pl_spotted *at, double color[3], pl_error *error)
{
    const double *own = at->found ? at->total : shader->view->background;
    for (int c = 0; c < 3; c++) color[c] += bounce->share[c] * own[c];
    return !at->found || follow_both(shader, at, error);
}

/* What remains of a sample: the rays that wait, and those that come of them, the last one first. */
static bool follow_all(pl_shader *shader, double color[3], pl_error *error)
{
    while (shader->count) {
        const pl_bounce bounce = shader->waiting[--shader->count];
        pl_ray ray;
        pl_spotted at;
        unsigned found = 0;
        set_ray(shader->view, &bounce, &ray);
        if (!spot_many(shader, &bounce, &ray, 1, shader->hits, &at, &found, NULL, error)) return false;
        if (found && !light_hits(shader, &at, 1, error)) return false;
        if (!collect(shader, &bounce, &at, color, error)) return false;
    }
    return true;
}

bool pl_shade_first(pl_shader *shader, const double direction[3], pl_first *first, pl_error *error)
{
    pl_surface surface;
    begin_first(shader, first);
    shader->rays.primary++;
    look(shader, 0, 1, (const double (*)[3])direction);
    if (!pl_trace_nearest(shader->tracer, shader->eye_rays, shader->hits, error)) return false;
    if (shader->hits->t != INFINITY &&
        !pl_trace_surface(shader->tracer, shader->eye_rays, shader->hits, &surface, error))
        return false;
    return set_first(shader, shader->hits, &surface, first, error);
}

bool pl_shade_misses(const pl_shader *shader, const double (*directions)[3])
{
    return pl_trace_misses(shader->view->scene, shader->view->camera.location, directions);
}

/* The eye sees nothing at all, for the two limits on rays. */
static bool is_blind(const pl_view *view)
{
    return !(0 < view->max_trace_level) || 1.0 < view->adc_bailout;
}

void pl_shade_nothing(pl_shader *shader, unsigned count, double (*colors)[3])
{
    memset(colors, 0, count * sizeof *colors);
    if (is_blind(shader->view)) return;
    shader->rays.primary += count;
    for (unsigned i = 0; i < count; i++)
        for (int c = 0; c < 3; c++) colors[i][c] += shader->view->background[c];
}

bool pl_shade(pl_shader *shader, const double (*directions)[3], unsigned count, double (*colors)[3], pl_first *first,
              pl_error *error)
{
    memset(colors, 0, count * sizeof *colors);
    if (is_blind(shader->view)) return !first || pl_shade_first(shader, *directions, first, error);
    if (first) begin_first(shader, first);
    shader->rays.primary += count;
    if (!spot_all(shader, directions, count, first, error)) return false;
    for (unsigned i = 0; i < count; i++) {
        shader->count = 0;
        shader->sample_rays = 0;
        if (!collect(shader, &shader->eyes[i], &shader->spotted[i], colors[i], error) ||
            !follow_all(shader, colors[i], error))
            return false;
    }
    return true;
}
