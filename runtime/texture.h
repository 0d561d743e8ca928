/* texture.h - what a surface is made of at a point: the pigment's colour and the finish (SHADING.md, section 5).
 *
 *     pl_pigment pigment;
 *     pl_texture_pigment(surface.texture, surface.entries, surface.pattern_point, &pigment, error);
 *     pl_texture_finish(surface.texture, &finish);
 *
 * A texture is a record's numbers (bytecode.h: PL_TEXTURE_…) with its entries behind them. */
#ifndef PL_TEXTURE_H
#define PL_TEXTURE_H

#include "bytecode.h"
#include "plsys.h"

typedef struct pl_pigment {
    double color[3], filter, transmit;
} pl_pigment;

typedef struct pl_finish {
    double ambient[3], emission[3], reflection[3];
    double diffuse, brilliance, phong, phong_size, specular, roughness;
} pl_finish;

/* The colour at a point of the frame in which the texture stands. Without entries: black, opaque. false: the pigment's
 * own matrix is singular. */
bool pl_texture_pigment(const double *texture, uint32_t entries, const double point[3], pl_pigment *pigment,
                        pl_error *error);

void pl_texture_finish(const double *texture, pl_finish *finish);

/* What passes through a surface of this colour, per channel: color * filter + transmit. */
static inline void pl_pigment_through(const pl_pigment *pigment, double through[3])
{
    for (int c = 0; c < 3; c++) through[c] = pigment->color[c] * pigment->filter + pigment->transmit;
}

#endif
