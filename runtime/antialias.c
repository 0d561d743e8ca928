/* antialias.c - see antialias.h. */
#include "antialias.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "elementary.h"
#include "error.h"

/* POV-Ray's Antialias_Gamma: colours are compared as the eye sees them. */
#define COMPARISON_GAMMA 2.5

/* One sample of the adaptive method, kept as long as its tile or pixel is being worked on. */
typedef struct pl_sample {
    double color[3], encoded[3];
    uint64_t stamp; /* of the tile or pixel that it belongs to; any other: not taken yet */
} pl_sample;

struct pl_sampler {
    pl_shader *shader;
    const pl_render_options *options;
    int left, top;
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

void pl_sampler_begin_tile(pl_sampler *sampler, int left, int top)
{
    sampler->left = left;
    sampler->top = top;
    sampler->tile_stamp++;
}

void pl_sampler_ahead(pl_sampler *sampler, int x, int y)
{
    const pl_view *view = pl_shader_view(sampler->shader);
    const int width = sampler->options->width, height = sampler->options->height;
    double directions[PL_BLOCK * PL_BLOCK][3];
    unsigned count = 0;
    if (sampler->options->antialias != PL_AA_OFF) return;
    for (int row = y; row < y + PL_BLOCK && row < height; row++)
        for (int column = x; column < x + PL_BLOCK && column < width; column++)
            pl_camera_direction(&view->camera, column + 0.5, row + 0.5, width, height, directions[count++]);
    pl_shade_ahead(sampler->shader, directions, count);
}

/* The colour at an image point. */
static bool color_at(const pl_sampler *sampler, double x, double y, double color[3], pl_first *first, pl_error *error)
{
    const pl_view *view = pl_shader_view(sampler->shader);
    double direction[3];
    pl_camera_direction(&view->camera, x, y, sampler->options->width, sampler->options->height, direction);
    if (color) return pl_shade(sampler->shader, direction, color, first, error);
    return pl_shade_first(sampler->shader, direction, first, error);
}

/* --- grid: the mean of the centre and of samples² cells' centres --- */

static bool grid_pixel(const pl_sampler *sampler, int x, int y, double color[3], pl_first *first, pl_error *error)
{
    const int cells = sampler->options->samples;
    if (!color_at(sampler, x + 0.5, y + 0.5, color, first, error)) return false;
    for (int row = 0; row < cells; row++)
        for (int column = 0; column < cells; column++) {
            double sample[3];
            if (!color_at(sampler, ((double)x * cells + column + 0.5) / cells, ((double)y * cells + row + 0.5) / cells,
                          sample, NULL, error))
                return false;
            for (int c = 0; c < 3; c++) color[c] += sample[c];
        }
    for (int c = 0; c < 3; c++) color[c] /= (double)cells * cells + 1.0;
    return true;
}

/* --- adaptive: the mean of four corners, or of four quarters where two corners differ --- */

typedef struct pl_pixel {
    int x, y;
} pl_pixel;

/* The sample at (column, row) of a pixel's finest grid, taken when it is first needed. NULL: an error. */
static const pl_sample *sample_at(pl_sampler *sampler, pl_pixel pixel, int column, int row, pl_error *error)
{
    const int steps = sampler->steps;
    pl_sample *sample = &sampler->inner[row * (steps + 1) + column];
    uint64_t stamp = sampler->pixel_stamp;
    if (column % steps == 0 && row % steps == 0) {
        const int corner_x = pixel.x - sampler->left + column / steps, corner_y = pixel.y - sampler->top + row / steps;
        sample = &sampler->corners[corner_y * (PL_TILE + 1) + corner_x];
        stamp = sampler->tile_stamp;
    }
    if (sample->stamp == stamp) return sample;
    if (!color_at(sampler, pixel.x + (double)column / steps, pixel.y + (double)row / steps, sample->color, NULL, error))
        return NULL;
    for (int c = 0; c < 3 && steps > 1; c++)
        sample->encoded[c] = pl_pow(fmax(sample->color[c], 0.0), 1.0 / COMPARISON_GAMMA);
    sample->stamp = stamp;
    return sample;
}

static bool differ(const pl_sample *a, const pl_sample *b, double threshold)
{
    return fabs(a->encoded[0] - b->encoded[0]) + fabs(a->encoded[1] - b->encoded[1]) +
               fabs(a->encoded[2] - b->encoded[2]) >=
           threshold;
}

/* The mean over the square of `size` steps at (column, row). Recurses at most PL_LIMIT_ADAPTIVE deep. */
static bool square(pl_sampler *sampler, pl_pixel pixel, int column, int row, int size, double mean[3], pl_error *error)
{
    const pl_sample *corners[4];
    bool divide = false;
    for (int i = 0; i < 4; i++) {
        corners[i] = sample_at(sampler, pixel, column + (i & 1 ? size : 0), row + (i & 2 ? size : 0), error);
        if (!corners[i]) return false;
        for (int j = 0; j < i && size > 1; j++)
            divide = divide || differ(corners[i], corners[j], sampler->options->threshold);
    }
    double sum[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i < 4; i++) {
        double quarter[3];
        const double *part = corners[i]->color;
        if (divide) {
            const int half = size / 2;
            if (!square(sampler, pixel, column + (i & 1 ? half : 0), row + (i & 2 ? half : 0), half, quarter, error))
                return false;
            part = quarter;
        }
        for (int c = 0; c < 3; c++) sum[c] += part[c];
    }
    for (int c = 0; c < 3; c++) mean[c] = sum[c] / 4.0;
    return true;
}

bool pl_sampler_pixel(pl_sampler *sampler, int x, int y, double color[3], pl_first *first, pl_error *error)
{
    switch (sampler->options->antialias) {
    case PL_AA_GRID: return grid_pixel(sampler, x, y, color, first, error);
    case PL_AA_ADAPTIVE:
        sampler->pixel_stamp++;
        return square(sampler, (pl_pixel){x, y}, 0, 0, sampler->steps, color, error) &&
               (!first || color_at(sampler, x + 0.5, y + 0.5, NULL, first, error));
    default: return color_at(sampler, x + 0.5, y + 0.5, color, first, error);
    }
}
