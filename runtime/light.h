/* light.h - what arrives from a light at a point, unshadowed (SHADING.md, section 3).
 *
 *     pl_light_direction(light, point, towards, &distance);
 *     if (pl_light_arriving(light, towards, distance, color)) …     color reaches the point along -towards */
#ifndef PL_LIGHT_H
#define PL_LIGHT_H

#include "plsys.h"

/* A light record, prepared. */
typedef struct pl_light {
    double location[3], color[3];
    double axis[3];                  /* unit; from the location to point_at; of spotlights and parallel lights */
    double cos_radius, cos_falloff, tightness;
    double fade_distance, fade_power; /* both not 0, or both 0 */
    bool parallel, spotlight, shadowless;
} pl_light;

/* From a light record. false: a light with an axis has point_at at its location. */
bool pl_light_create(const double *record, pl_light *light, pl_error *error);

/* The unit vector from a point to the light and the distance, which is negative behind a parallel light's plane. */
void pl_light_direction(const pl_light *light, const double point[3], double towards[3], double *distance);

/* The light's colour at the point; false if it is nothing. */
bool pl_light_arriving(const pl_light *light, const double towards[3], double distance, double color[3]);

/* Less light than this, in each channel, is none. */
#define PL_DARK 1e-10

static inline bool pl_is_dark(const double color[3])
{
    return !(color[0] >= PL_DARK || color[0] <= -PL_DARK || color[1] >= PL_DARK || color[1] <= -PL_DARK ||
             color[2] >= PL_DARK || color[2] <= -PL_DARK);
}

#endif
