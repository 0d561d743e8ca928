/* shade.h - from a ray to a colour: POV-Ray's model (SHADING.md), after Whitted 1980.
 *
 *     pl_view view;                                               one a picture, read-only, shared by all threads
 *     if (!pl_view_create(&view, scene, error)) …
 *     pl_shader *shader = pl_shader_create(&view, error);         one a thread
 *     pl_camera_direction(&view.camera, x + 0.5, y + 0.5, width, height, direction);
 *     if (!pl_shade(shader, &direction, 1, &color, NULL, error)) …     linear rgb, never clipped
 *
 * Nothing recurses and nothing is allocated a ray: reflected and transmitted rays wait on a stack that the shader owns.
 * A colour depends on the scene and the direction only. */
#ifndef PL_SHADE_H
#define PL_SHADE_H

#include "camera.h"
#include "light.h"
#include "trace.h"

enum {
    PL_SHADE_MANY = 256, /* samples at once */
    /* Rays that may come of one sample. Reached only by scenes that turn off both max_trace_level and adc_bailout. */
    PL_LIMIT_SAMPLE_RAYS = 1 << 18
};

/* The scene as far as shading knows it without tracing. */
typedef struct pl_view {
    const pl_scene *scene;
    pl_camera camera;
    pl_light *lights;
    uint32_t light_count;
    double spread; /* a pixel's width at unit distance; 0 until the picture's size is known */
    double ambient_light[3], background[3], max_trace_level, adc_bailout;
    bool all_opaque, povray_epsilon;
} pl_view;

/* false: no camera, or a camera or light that can't be. */
bool pl_view_create(pl_view *view, const pl_scene *scene, pl_error *error);
void pl_view_free(pl_view *view);

typedef struct pl_shader pl_shader;

pl_shader *pl_shader_create(const pl_view *view, pl_error *error);
void pl_shader_destroy(pl_shader *shader);
const pl_view *pl_shader_view(const pl_shader *shader);

/* What the eye's ray itself met, for the channels beside colour. */
typedef struct pl_first {
    double t; /* INFINITY: nothing, and then the surface is unspecified */
    uint64_t primitive;
    pl_surface surface;
    uint64_t box_tests;
    uint32_t miss_depth;
} pl_first;

/* The colours seen from the camera in up to PL_SHADE_MANY unit directions. Each PL_TRACE_MANY of them that follow each other are
 * traced together, so neighbours should; shadows are traced together whatever the order. first: of a single one, or NULL. */
bool pl_shade(pl_shader *shader, const double (*directions)[3], unsigned count, double (*colors)[3], pl_first *first,
              pl_error *error);

/* true: a camera's rays in directions between these four, going round, meet nothing. false: some may. */
bool pl_shade_misses(const pl_shader *shader, const double (*directions)[3]);

/* As pl_shade, where it is known that the rays meet nothing. */
void pl_shade_nothing(pl_shader *shader, unsigned count, double (*colors)[3]);

/* The first hit alone. */
bool pl_shade_first(pl_shader *shader, const double direction[3], pl_first *first, pl_error *error);

/* Adds the shader's rays to the scene's statistics. */
void pl_shader_count(const pl_shader *shader, pl_scene *scene);

#endif
