/* light.c - see light.h. */
#include "light.h"

#include <math.h>
#include <string.h>

#include "bytecode.h"
#include "elementary.h"
#include "error.h"
#include "vector.h"

bool pl_light_create(const double *record, pl_light *light, pl_error *error)
{
    *light = (pl_light){
        .cos_radius = pl_cos(record[PL_LIGHT_RADIUS]),
        .cos_falloff = pl_cos(record[PL_LIGHT_FALLOFF]),
        .tightness = record[PL_LIGHT_TIGHTNESS],
        .parallel = record[PL_LIGHT_PARALLEL] != 0.0,
        .shadowless = record[PL_LIGHT_SHADOWLESS] != 0.0,
        .spotlight = record[PL_LIGHT_SPOTLIGHT] != 0.0 && record[PL_LIGHT_SHADOWLESS] == 0.0,
    };
    memcpy(light->location, record + PL_LIGHT_LOCATION, sizeof light->location);
    memcpy(light->color, record + PL_LIGHT_COLOR, sizeof light->color);
    if (record[PL_LIGHT_FADE_POWER] > 0.0 && record[PL_LIGHT_FADE_DISTANCE] != 0.0) {
        light->fade_power = record[PL_LIGHT_FADE_POWER];
        light->fade_distance = record[PL_LIGHT_FADE_DISTANCE];
    }
    for (int axis = 0; axis < 3; axis++)
        light->axis[axis] = record[PL_LIGHT_POINT_AT + axis] - light->location[axis];
    if (pl_normalize(light->axis) == 0.0 && (light->parallel || light->spotlight))
        return pl_fail(error, PL_ERROR_SCENE, "light_source", "a %s light shines nowhere: point_at is its location",
                       light->parallel ? "parallel" : "spot");
    return true;
}

void pl_light_direction(const pl_light *light, const double point[3], double towards[3], double *distance)
{
    for (int axis = 0; axis < 3; axis++) towards[axis] = light->location[axis] - point[axis];
    if (!light->parallel) {
        *distance = pl_normalize(towards);
        return;
    }
    *distance = -pl_dot(towards, light->axis);
    for (int axis = 0; axis < 3; axis++) towards[axis] = -light->axis[axis];
}

/* A spotlight's strength by the cosine of the angle to its axis. The cubic is in the cosine, not in the angle. */
static double cone(const pl_light *light, double cosine)
{
    double strength = 1.0;
    if (!(cosine > 0.0)) return 0.0;
    if (light->cos_radius > 0.0 && cosine < light->cos_radius) {
        if (cosine < light->cos_falloff) return 0.0;
        const double x = (cosine - light->cos_falloff) / (light->cos_radius - light->cos_falloff);
        strength = x * x * (3.0 - 2.0 * x);
    }
    return light->tightness != 0.0 ? strength * pl_power(cosine, light->tightness) : strength;
}

bool pl_light_arriving(const pl_light *light, const double towards[3], double distance, double color[3])
{
    double strength = 1.0;
    if (light->spotlight) {
        if (light->parallel) strength = distance > 0.0 ? cone(light, 1.0) : 0.0;
        else strength = cone(light, -pl_dot(towards, light->axis));
    }
    if (light->fade_power > 0.0)
        strength = strength * 2.0 / (1.0 + pl_power(distance / light->fade_distance, light->fade_power));
    /* Fractional powers of the negative distances behind a parallel light: not a number, so nothing. */
    if (!(strength == strength)) return false;
    for (int c = 0; c < 3; c++) color[c] = strength * light->color[c];
    return !pl_is_dark(color);
}
