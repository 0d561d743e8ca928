/* antialias.h - from a pixel to its samples: POV-Ray's methods without jitter (SHADING.md, section 8).
 *
 *     pl_sampler *sampler = pl_sampler_create(shader, options, error);      one a thread
 *     pl_sampler_begin_tile(sampler, left, top);                            pixels are asked for tile by tile
 *     if (!pl_sampler_tile(sampler, columns, rows, colors, error)) …
 *
 * A pixel's colour depends on the options and the scene only, not on tiles or their order. */
#ifndef PL_ANTIALIAS_H
#define PL_ANTIALIAS_H

#include "shade.h"

enum {
    PL_TILE = 16, /* pixels a side */
    PL_LIMIT_GRID = 256,
    PL_LIMIT_ADAPTIVE = 9
};

typedef struct pl_sampler pl_sampler;

/* false: options that make no sense. */
bool pl_sampler_check(const pl_render_options *options, pl_error *error);

pl_sampler *pl_sampler_create(pl_shader *shader, const pl_render_options *options, pl_error *error);
void pl_sampler_destroy(pl_sampler *sampler);

/* Pixels left … left + PL_TILE - 1 and top … top + PL_TILE - 1 come next; they share samples. */
void pl_sampler_begin_tile(pl_sampler *sampler, int left, int top);

/* The colours of the tile's first columns and rows, row by row. */
bool pl_sampler_tile(pl_sampler *sampler, int columns, int rows, double (*colors)[3], pl_error *error);

/* The colour of one pixel of the tile, and what the ray through its centre met. */
bool pl_sampler_pixel(pl_sampler *sampler, int x, int y, double color[3], pl_first *first, pl_error *error);

#endif
