/* texture.c - see texture.h. */
#include "texture.h"

#include <math.h>
#include <string.h>

#include "affine.h"
#include "error.h"
#include "vector.h"

/* POV-Ray's: a point on a boundary belongs to the square above it, rounding errors of this size notwithstanding. */
#define CHECKER_BIAS 1e-10

/* The period of POV-Ray's gradients below 0. */
#define GRADIENT_PERIOD 1.00001

static const double *entry_at(const double *texture, uint32_t index)
{
    return texture + PL_TEXTURE_VALUES + (size_t)index * PL_TEXTURE_ENTRY;
}

/* POV-Ray keeps keys as floats, which decides where points exactly on a sharp edge belong. */
static double key_at(const double *texture, uint32_t index)
{
    return (double)(float)entry_at(texture, index)[PL_TEXTURE_ENTRY_POSITION];
}

/* Between two entries, all of red, green, blue, filter and transmit alike. */
static void blend(const double *before, const double *after, double fraction, pl_pigment *pigment)
{
    double mixed[5];
    for (int i = 0; i < 5; i++) {
        const double from = before[PL_TEXTURE_ENTRY_RED + i], to = after[PL_TEXTURE_ENTRY_RED + i];
        mixed[i] = from + fraction * (to - from);
    }
    memcpy(pigment->color, mixed, sizeof pigment->color);
    pigment->filter = mixed[3];
    pigment->transmit = mixed[4];
}

static void take(const double *texture, uint32_t index, pl_pigment *pigment)
{
    blend(entry_at(texture, index), entry_at(texture, index), 0.0, pigment);
}

static uint32_t checker(const double p[3])
{
    const double cells = floor(p[0] + CHECKER_BIAS) + floor(p[1] + CHECKER_BIAS) + floor(p[2] + CHECKER_BIAS);
    return fmod(cells, 2.0) != 0.0;
}

static double gradient(const double direction[3], const double p[3])
{
    double unit[3] = {direction[0], direction[1], direction[2]};
    pl_normalize(unit);
    double g = pl_dot(p, unit);
    if (g > 1.0) g = fmod(g, 1.0);
    g = fmod(g, GRADIENT_PERIOD);
    return g < 0.0 ? g - floor(g) : g;
}

static void color_map(const double *texture, uint32_t entries, double value, pl_pigment *pigment)
{
    /* The first key at or above the value; entries - 1 where there is none, and for a NaN. */
    uint32_t low = 0, high = entries - 1;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        if (key_at(texture, middle) >= value) high = middle;
        else low = middle + 1;
    }
    if (low == 0 || value >= key_at(texture, entries - 1)) {
        take(texture, value >= key_at(texture, entries - 1) ? entries - 1 : 0, pigment);
        return;
    }
    const double from = key_at(texture, low - 1), gap = key_at(texture, low) - from;
    double fraction = (value - from) / (gap > 0.0 ? gap : 1.0);
    fraction = fraction > 0.0 ? (fraction < 1.0 ? fraction : 1.0) : 0.0;
    blend(entry_at(texture, low - 1), entry_at(texture, low), fraction, pigment);
}

/* From the frame in which the texture stands to the pigment's own, which the record's matrix maps the other way. */
static bool to_pattern(const double *texture, const double point[3], double p[3], pl_error *error)
{
    const pl_affine identity = pl_affine_identity();
    memcpy(p, point, 3 * sizeof *p);
    if (memcmp(texture + PL_TEXTURE_MATRIX, identity.m, sizeof identity.m) == 0) return true;
    pl_affine matrix, inverse;
    memcpy(matrix.m, texture + PL_TEXTURE_MATRIX, sizeof matrix.m);
    if (!pl_affine_inverse(&matrix, &inverse))
        return pl_fail(error, PL_ERROR_SCENE, "texture", "the pigment's transformation is singular");
    pl_affine_point(&inverse, p, p);
    return true;
}

bool pl_texture_pigment(const double *texture, uint32_t entries, const double point[3], pl_pigment *pigment,
                        pl_error *error)
{
    const double pattern = texture[PL_TEXTURE_PATTERN];
    double p[3];
    if (entries == 0) {
        memset(pigment, 0, sizeof *pigment);
        return true;
    }
    if (pattern == PL_PATTERN_SOLID) {
        take(texture, 0, pigment);
        return true;
    }
    if (!to_pattern(texture, point, p, error)) return false;
    if (pattern == PL_PATTERN_CHECKER) {
        const uint32_t index = checker(p);
        take(texture, index < entries ? index : entries - 1, pigment);
    } else {
        color_map(texture, entries, gradient(texture + PL_TEXTURE_DIRECTION, p), pigment);
    }
    return true;
}

void pl_texture_finish(const double *texture, pl_finish *finish)
{
    finish->diffuse = texture[PL_TEXTURE_DIFFUSE];
    finish->brilliance = texture[PL_TEXTURE_BRILLIANCE];
    finish->phong = texture[PL_TEXTURE_PHONG];
    finish->phong_size = texture[PL_TEXTURE_PHONG_SIZE];
    finish->specular = texture[PL_TEXTURE_SPECULAR];
    finish->roughness = texture[PL_TEXTURE_ROUGHNESS];
    memcpy(finish->ambient, texture + PL_TEXTURE_AMBIENT, sizeof finish->ambient);
    memcpy(finish->emission, texture + PL_TEXTURE_EMISSION, sizeof finish->emission);
    memcpy(finish->reflection, texture + PL_TEXTURE_REFLECTION, sizeof finish->reflection);
}
