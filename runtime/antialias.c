/* antialias.c - see antialias.h. */
#include "antialias.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "elementary.h"
#include "error.h"

/* POV-Ray's Antialias_Gamma: colours are compared as the eye sees them. */
#define COMPARISON_GAMMA 2.5

/* Pixels whose rays are traced together: some of a tile, BLOCK a side at most. */
enum { BLOCK = 4 };
typedef struct block {
    int x, y, columns, rows;
} block;

/* One sample of the adaptive method, kept as long as its tile or pixel is being worked on. */
typedef struct pl_sample {
    double color[3], encoded[3];
    uint64_t stamp; /* of the tile or pixel that it belongs to; any other: not taken yet */
} pl_sample;

struct pl_sampler {
    pl_shader *shader;
    const pl_render_options *options;
    int left, top;
    bool empty;         /* no ray through the tile meets anything */
    int steps;          /* of the adaptive method's finest grid, a pixel's side; a power of two */
    pl_sample *corners; /* of the tile's pixels: (PL_TILE + 1)² */
    pl_sample *inner;   /* of the pixel: (steps + 1)², without its corners */
    uint64_t tile_stamp, pixel_stamp;
};

bool pl_sampler_check(const pl_render_options *options, pl_error *error)
{
    switch (options->antialias) {
    case PL_AA_OFF: return true;
    case PL_AA_GRID:
        if (options->samples >= 1 && options->samples <= PL_LIMIT_GRID) return true;
        return pl_fail(error, PL_ERROR_ARGUMENT, "antialiasing", "a grid of %d samples a side, not 1 to %d",
                       options->samples, PL_LIMIT_GRID);
    case PL_AA_ADAPTIVE:
        if (!(options->threshold >= 0.0))
            return pl_fail(error, PL_ERROR_ARGUMENT, "antialiasing", "the threshold is %g, not 0 or more",
                           options->threshold);
        if (options->samples >= 1 && options->samples <= PL_LIMIT_ADAPTIVE) return true;
        return pl_fail(error, PL_ERROR_ARGUMENT, "antialiasing", "an adaptive depth of %d, not 1 to %d",
                       options->samples, PL_LIMIT_ADAPTIVE);
    default:
        return pl_fail(error, PL_ERROR_ARGUMENT, "antialiasing", "there is no method %d", options->antialias);
    }
}

pl_sampler *pl_sampler_create(pl_shader *shader, const pl_render_options *options, pl_error *error)
{
    pl_sampler *sampler = calloc(1, sizeof *sampler);
    if (sampler) {
        sampler->shader = shader;
        sampler->options = options;
        if (options->antialias != PL_AA_ADAPTIVE) return sampler;
        sampler->steps = 1 << (options->samples - 1);
        const size_t side = (size_t)sampler->steps + 1;
        sampler->corners = calloc((PL_TILE + 1) * (PL_TILE + 1), sizeof *sampler->corners);
        sampler->inner = calloc(side * side, sizeof *sampler->inner);
        if (sampler->corners && sampler->inner) return sampler;
    }
    pl_fail_memory(error, "preparing to sample");
    pl_sampler_destroy(sampler);
    return NULL;
}

void pl_sampler_destroy(pl_sampler *sampler)
{
    if (!sampler) return;
    free(sampler->corners);
    free(sampler->inner);
    free(sampler);
}

static void direction_at(const pl_sampler *sampler, double x, double y, double direction[3])
{
    const pl_view *view = pl_shader_view(sampler->shader);
    pl_camera_direction(&view->camera, x, y, sampler->options->width, sampler->options->height, direction);
}

/* The pyramid through the tile's corners has all rays of its pixels, half a pixel inside. */
static bool is_empty(const pl_sampler *sampler)
{
    double corners[4][3];
    for (int i = 0; i < 4; i++)
        direction_at(sampler, sampler->left + (i == 1 || i == 2) * PL_TILE, sampler->top + (i >= 2) * PL_TILE, corners[i]);
    return pl_shade_misses(sampler->shader, corners);
}

void pl_sampler_begin_tile(pl_sampler *sampler, int left, int top)
{
    sampler->left = left;
    sampler->top = top;
    sampler->tile_stamp++;
    sampler->empty = sampler->options->antialias == PL_AA_OFF && is_empty(sampler);
}

/* --- grid: the mean of the centre and of samples² cells' centres --- */

/* Sample 0 is the centre, the others are the cells row by row. */
static void grid_direction(const pl_sampler *sampler, int x, int y, int sample, double direction[3])
{
    const int cells = sampler->options->samples, column = (sample - 1) % cells, row = (sample - 1) / cells;
    if (sample == 0) direction_at(sampler, x + 0.5, y + 0.5, direction);
    else
        direction_at(sampler, ((double)x * cells + column + 0.5) / cells, ((double)y * cells + row + 0.5) / cells,
                     direction);
}

static bool grid_pixel(const pl_sampler *sampler, int x, int y, double color[3], pl_first *first, pl_error *error)
{
    const int count = sampler->options->samples * sampler->options->samples + 1;
    memset(color, 0, 3 * sizeof *color);
    for (int from = 0, some; from < count; from += some) {
        double directions[PL_SHADE_MANY][3], colors[PL_SHADE_MANY][3];
        some = first && from == 0 ? 1 : count - from < PL_SHADE_MANY ? count - from : PL_SHADE_MANY;
        for (int i = 0; i < some; i++) grid_direction(sampler, x, y, from + i, directions[i]);
        if (!pl_shade(sampler->shader, directions, (unsigned)some, colors, from == 0 ? first : NULL, error)) return false;
        for (int i = 0; i < some; i++)
            for (int c = 0; c < 3; c++) color[c] += colors[i][c];
    }
    for (int c = 0; c < 3; c++) color[c] /= (double)count;
    return true;
}

/* --- adaptive: the mean of four corners, or of four quarters where two corners differ --- */

typedef struct pl_pixel {
    int x, y;
} pl_pixel;

/* Samples that are taken together. */
typedef struct pl_batch {
    pl_sample *samples[PL_TRACE_MANY];
    uint64_t stamps[PL_TRACE_MANY];
    double directions[PL_TRACE_MANY][3];
    unsigned count;
} pl_batch;

static bool take(pl_sampler *sampler, pl_batch *batch, pl_error *error)
{
    double colors[PL_TRACE_MANY][3];
    const unsigned count = batch->count;
    batch->count = 0;
    if (count == 0) return true;
    if (!pl_shade(sampler->shader, batch->directions, count, colors, NULL, error)) return false;
    for (unsigned i = 0; i < count; i++) {
        pl_sample *sample = batch->samples[i];
        memcpy(sample->color, colors[i], sizeof sample->color);
        for (int c = 0; c < 3 && sampler->steps > 1; c++)
            sample->encoded[c] = pl_pow(fmax(sample->color[c], 0.0), 1.0 / COMPARISON_GAMMA);
        sample->stamp = batch->stamps[i];
    }
    return true;
}

/* The sample at (column, row) of a pixel's finest grid; *stamp: what it has once it is taken. */
static pl_sample *sample_at(const pl_sampler *sampler, pl_pixel pixel, int column, int row, uint64_t *stamp)
{
    const int steps = sampler->steps;
    if (column % steps == 0 && row % steps == 0) {
        const int corner_x = pixel.x - sampler->left + column / steps, corner_y = pixel.y - sampler->top + row / steps;
        *stamp = sampler->tile_stamp;
        return &sampler->corners[corner_y * (PL_TILE + 1) + corner_x];
    }
    *stamp = sampler->pixel_stamp;
    return &sampler->inner[row * (steps + 1) + column];
}

/* Adds a sample to the batch unless it was taken before; a full batch is taken first. */
static bool want(pl_sampler *sampler, pl_batch *batch, pl_pixel pixel, int column, int row, pl_error *error)
{
    uint64_t stamp;
    pl_sample *sample = sample_at(sampler, pixel, column, row, &stamp);
    if (sample->stamp == stamp) return true;
    if (batch->count == PL_TRACE_MANY && !take(sampler, batch, error)) return false;
    direction_at(sampler, pixel.x + (double)column / sampler->steps, pixel.y + (double)row / sampler->steps,
                 batch->directions[batch->count]);
    batch->samples[batch->count] = sample;
    batch->stamps[batch->count++] = stamp;
    return true;
}

/* Takes those samples of a square of `size` steps at (column, row) that lie `apart` from each other. */
static bool take_square(pl_sampler *sampler, pl_pixel pixel, int column, int row, int size, int apart, pl_error *error)
{
    pl_batch batch = {.count = 0};
    for (int down = 0; down <= size; down += apart)
        for (int across = 0; across <= size; across += apart)
            if (!want(sampler, &batch, pixel, column + across, row + down, error)) return false;
    return take(sampler, &batch, error);
}

static bool differ(const pl_sample *a, const pl_sample *b, double threshold)
{
    return fabs(a->encoded[0] - b->encoded[0]) + fabs(a->encoded[1] - b->encoded[1]) +
               fabs(a->encoded[2] - b->encoded[2]) >=
           threshold;
}

/* The mean over the square of `size` steps at (column, row), whose corners are taken. Recurses at most PL_LIMIT_ADAPTIVE
 * deep. */
static bool square(pl_sampler *sampler, pl_pixel pixel, int column, int row, int size, double mean[3], pl_error *error)
{
    const pl_sample *corners[4];
    const int half = size / 2;
    bool divide = false;
    uint64_t stamp;
    for (int i = 0; i < 4; i++) {
        corners[i] = sample_at(sampler, pixel, column + (i & 1 ? size : 0), row + (i & 2 ? size : 0), &stamp);
        for (int j = 0; j < i && size > 1; j++)
            divide = divide || differ(corners[i], corners[j], sampler->options->threshold);
    }
    if (divide && !take_square(sampler, pixel, column, row, size, half, error)) return false;
    double sum[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i < 4; i++) {
        double quarter[3];
        const double *part = corners[i]->color;
        if (divide) {
            if (!square(sampler, pixel, column + (i & 1 ? half : 0), row + (i & 2 ? half : 0), half, quarter, error))
                return false;
            part = quarter;
        }
        for (int c = 0; c < 3; c++) sum[c] += part[c];
    }
    for (int c = 0; c < 3; c++) mean[c] = sum[c] / 4.0;
    return true;
}

static bool adaptive_block(pl_sampler *sampler, block at, double (*colors)[3], pl_error *error)
{
    pl_batch batch = {.count = 0};
    for (int row = 0; row <= at.rows; row++)
        for (int column = 0; column <= at.columns; column++)
            if (!want(sampler, &batch, (pl_pixel){at.x, at.y}, column * sampler->steps, row * sampler->steps, error)) return false;
    if (!take(sampler, &batch, error)) return false;
    for (int i = 0; i < at.columns * at.rows; i++) {
        const pl_pixel pixel = {at.x + i % at.columns, at.y + i / at.columns};
        sampler->pixel_stamp++;
        if (!square(sampler, pixel, 0, 0, sampler->steps, colors[i], error)) return false;
    }
    return true;
}

/* --- pixels --- */

/* The i-th block of a tile's first columns and rows; false: there is none. */
static bool next_block(const pl_sampler *sampler, int columns, int rows, int i, block *at)
{
    const int across = (columns + BLOCK - 1) / BLOCK, x = i % across * BLOCK, y = i / across * BLOCK;
    at->x = sampler->left + x;
    at->y = sampler->top + y;
    at->columns = columns - x < BLOCK ? columns - x : BLOCK;
    at->rows = rows - y < BLOCK ? rows - y : BLOCK;
    return y < rows;
}

/* A block's colours to where they belong in the tile. */
static void put_in_rows(const pl_sampler *sampler, block at, int columns, const double (*block)[3], double (*rows)[3])
{
    rows += (at.y - sampler->top) * columns + at.x - sampler->left;
    for (int i = 0; i < at.rows; i++) memcpy(rows + i * columns, block + i * at.columns, (size_t)at.columns * sizeof *rows);
}

/* One sample a pixel, all shaded together. */
static bool plain_tile(pl_sampler *sampler, int columns, int rows, double (*colors)[3], pl_error *error)
{
    const pl_camera *camera = &pl_shader_view(sampler->shader)->camera;
    const pl_render_options *options = sampler->options;
    double directions[PL_TILE * PL_TILE][3], shaded[PL_TILE * PL_TILE][3];
    unsigned count = 0;
    block at;
    for (int i = 0; next_block(sampler, columns, rows, i, &at); i++) {
        pl_camera_directions(camera, at.x, at.y, at.columns, at.rows, options->width, options->height, directions + count);
        count += (unsigned)(at.columns * at.rows);
    }
    if (!pl_shade(sampler->shader, directions, count, shaded, NULL, error)) return false;
    const double (*from)[3] = shaded;
    for (int i = 0; next_block(sampler, columns, rows, i, &at); i++, from += at.columns * at.rows)
        put_in_rows(sampler, at, columns, from, colors);
    return true;
}
bool pl_sampler_tile(pl_sampler *sampler, int columns, int rows, double (*colors)[3], pl_error *error)
{
    if (sampler->empty) {
        pl_shade_nothing(sampler->shader, (unsigned)(columns * rows), colors);
        return true;
    }
    if (sampler->options->antialias == PL_AA_OFF) return plain_tile(sampler, columns, rows, colors, error);
    block at;
    for (int i = 0; next_block(sampler, columns, rows, i, &at); i++) {
        double shaded[BLOCK * BLOCK][3];
        if (sampler->options->antialias == PL_AA_ADAPTIVE) {
            if (!adaptive_block(sampler, at, shaded, error)) return false;
        } else {
            for (int k = 0; k < at.columns * at.rows; k++)
                if (!grid_pixel(sampler, at.x + k % at.columns, at.y + k / at.columns, shaded[k], NULL, error)) return false;
        }
        put_in_rows(sampler, at, columns, shaded, colors);
    }
    return true;
}

bool pl_sampler_pixel(pl_sampler *sampler, int x, int y, double color[3], pl_first *first, pl_error *error)
{
    double direction[3];
    if (sampler->options->antialias == PL_AA_GRID) return grid_pixel(sampler, x, y, color, first, error);
    direction_at(sampler, x + 0.5, y + 0.5, direction);
    if (sampler->options->antialias == PL_AA_OFF) return pl_shade(sampler->shader, &direction, 1, (double (*)[3])color, first, error);
    return adaptive_block(sampler, (block){x, y, 1, 1}, (double (*)[3])color, error) &&
           pl_shade_first(sampler->shader, direction, first, error);
}
