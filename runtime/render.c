/* render.c - see render.h. */
#include "render.h"

#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "antialias.h"
#include "error.h"
#include "quantise.h"

/* One rendering, shared by its threads. */
typedef struct pl_job {
    const pl_render_options *options;
    const pl_channels *channels;
    bool wants_first; /* a channel besides colours is wanted */
    pl_quantiser quantiser;
    uint32_t columns, tiles;
    atomic_uint next, finished;
    atomic_uint failed; /* the first tile that failed so far; UINT_MAX: none */
    atomic_bool cancelled;
    pthread_mutex_t lock; /* of error */
    pl_error error;       /* of tile `failed` */
} pl_job;

typedef struct pl_worker {
    pl_job *job;
    pl_shader *shader;
    pl_sampler *sampler;
    pthread_t thread;
    bool reports; /* this one calls the progress function */
    bool started;
    double color[3]; /* the last one that was written, … */
    uint8_t srgb[3]; /* … and in picture files: neighbours often are alike */
    uint16_t linear16[3];
    double first_pixel; /* when this one's first pixel was done; 0: none is */
    double cpu;         /* seconds that its thread ran */
} pl_worker;

static double seconds(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void set_vector(float *channel, size_t pixel, const double *value)
{
    for (int i = 0; channel && i < 3; i++) channel[3 * pixel + i] = value ? (float)value[i] : 0.0f;
}

static void quantise(pl_worker *worker, const double color[3])
{
    const pl_channels *channels = worker->job->channels;
    memcpy(worker->color, color, sizeof worker->color);
    for (int i = 0; channels->srgb && i < 3; i++) worker->srgb[i] = pl_srgb(&worker->job->quantiser, (float)color[i]);
    for (int i = 0; channels->linear16 && i < 3; i++) worker->linear16[i] = pl_linear_16((float)color[i]);
}

/* A pixel's colour, in single precision and in what picture files have of that. */
static void write_color(pl_worker *worker, size_t pixel, const double color[3])
{
    const pl_channels *channels = worker->job->channels;
    set_vector(channels->color, pixel, color);
    if (!channels->srgb && !channels->linear16) return;
    if (memcmp(worker->color, color, sizeof worker->color) != 0) quantise(worker, color);
    if (channels->srgb) memcpy(channels->srgb + 3 * pixel, worker->srgb, sizeof worker->srgb);
    if (channels->linear16) memcpy(channels->linear16 + 3 * pixel, worker->linear16, sizeof worker->linear16);
}

static void set_index(int32_t *channel, size_t pixel, uint64_t value)
{
    if (channel) channel[pixel] = value > INT32_MAX ? INT32_MAX : (int32_t)value;
}

static void write_first(const pl_channels *channels, size_t pixel, const pl_first *first)
{
    const bool found = first->t != INFINITY;
    const pl_surface *surface = &first->surface;
    if (channels->depth) channels->depth[pixel] = (float)first->t;
    set_vector(channels->normal, pixel, found ? surface->normal : NULL);
    set_vector(channels->position, pixel, found ? surface->point : NULL);
    if (channels->primitive)
        channels->primitive[pixel] = !found ? -1 : first->primitive > INT64_MAX ? INT64_MAX : (int64_t)first->primitive;
    if (channels->symbol) channels->symbol[pixel] = found ? surface->symbol : -1;
    if (channels->rule) channels->rule[pixel] = found ? surface->rule : -1;
    if (channels->recursion) channels->recursion[pixel] = found ? surface->depth : 0;
    set_index(channels->boxes, pixel, first->box_tests);
    set_index(channels->miss_depth, pixel, first->miss_depth);
}

/* Keeps the error of the first tile in order, whichever thread is first in time. */
static void fail(pl_job *job, uint32_t tile, const pl_error *error)
{
    pthread_mutex_lock(&job->lock);
    if (tile < atomic_load(&job->failed)) {
        job->error = *error;
        atomic_store(&job->failed, tile);
    }
    pthread_mutex_unlock(&job->lock);
}

/* A tile's result is of no use: the rendering is cancelled or an earlier tile failed. */
static bool is_idle(pl_job *job, uint32_t tile)
{
    return atomic_load_explicit(&job->cancelled, memory_order_relaxed) ||
           atomic_load_explicit(&job->failed, memory_order_relaxed) < tile;
}

/* Pixel by pixel, with what is asked for beside colours. */
static bool render_pixels(pl_worker *worker, uint32_t tile, int left, int top, int columns, int rows, pl_error *error)
{
    pl_job *job = worker->job;
    for (int y = top; y < top + rows; y++)
        for (int x = left; x < left + columns; x++) {
            const size_t pixel = (size_t)y * (size_t)job->options->width + (size_t)x;
            double color[3];
            pl_first first;
            if (is_idle(job, tile)) return true;
            if (!pl_sampler_pixel(worker->sampler, x, y, color, &first, error)) return false;
            write_color(worker, pixel, color);
            write_first(job->channels, pixel, &first);
        }
    return true;
}

static bool render_colors(pl_worker *worker, int left, int top, int columns, int rows, pl_error *error)
{
    double colors[PL_TILE * PL_TILE][3];
    if (!pl_sampler_tile(worker->sampler, columns, rows, colors, error)) return false;
    for (int y = 0; y < rows; y++)
        for (int x = 0; x < columns; x++) {
            const size_t pixel = (size_t)(top + y) * (size_t)worker->job->options->width + (size_t)(left + x);
            write_color(worker, pixel, colors[y * columns + x]);
        }
    return true;
}

static bool render_tile(pl_worker *worker, uint32_t tile, pl_error *error)
{
    const pl_job *job = worker->job;
    const int left = (int)(tile % job->columns) * PL_TILE, top = (int)(tile / job->columns) * PL_TILE;
    const int columns = job->options->width - left < PL_TILE ? job->options->width - left : PL_TILE;
    const int rows = job->options->height - top < PL_TILE ? job->options->height - top : PL_TILE;
    pl_sampler_begin_tile(worker->sampler, left, top);
    if (!(job->wants_first ? render_pixels(worker, tile, left, top, columns, rows, error)
                           : render_colors(worker, left, top, columns, rows, error)))
        return false;
    if (worker->first_pixel == 0.0) worker->first_pixel = seconds(CLOCK_MONOTONIC);
    return true;
}

static void render_tiles(pl_worker *worker)
{
    pl_job *job = worker->job;
    const pl_render_options *options = job->options;
    for (;;) {
        const uint32_t tile = atomic_fetch_add(&job->next, 1);
        pl_error error = {.code = PL_OK};
        if (tile >= job->tiles || is_idle(job, tile)) return;
        if (!render_tile(worker, tile, &error)) fail(job, tile, &error);
        const uint32_t finished = atomic_fetch_add(&job->finished, 1) + 1;
        if (worker->reports && options->progress && !options->progress(options->context, (double)finished / job->tiles))
            atomic_store(&job->cancelled, true);
    }
}

static void *work(void *context)
{
    pl_worker *worker = context;
    const double start = seconds(CLOCK_THREAD_CPUTIME_ID);
    render_tiles(worker);
    worker->cpu = seconds(CLOCK_THREAD_CPUTIME_ID) - start;
    return NULL;
}

static bool check(const pl_scene *scene, const pl_render_options *options, const pl_channels *channels, pl_error *error)
{
    if (!scene || !options || !channels)
        return pl_fail(error, PL_ERROR_ARGUMENT, "pl_render", "scene, options or channels are missing");
    if (options->width < 1 || options->height < 1 || options->width > PL_LIMIT_SIDE || options->height > PL_LIMIT_SIDE)
        return pl_fail(error, PL_ERROR_ARGUMENT, "size", "a picture of %d x %d pixels, not 1 to %d a side",
                       options->width, options->height, PL_LIMIT_SIDE);
    if (pl_scene_is_empty(scene))
        return pl_fail(error, PL_ERROR_SCENE, "objects", "the scene has no object, so there is nothing to render");
    return pl_sampler_check(options, error);
}

static bool prepare(pl_worker *workers, int count, pl_job *job, const pl_view *view, pl_error *error)
{
    for (int i = 0; i < count; i++) {
        workers[i].job = job;
        workers[i].reports = i == 0;
        quantise(&workers[i], (const double[3]){0.0, 0.0, 0.0});
        workers[i].shader = pl_shader_create(view, error);
        if (!workers[i].shader) return false;
        workers[i].sampler = pl_sampler_create(workers[i].shader, job->options, error);
        if (!workers[i].sampler) return false;
    }
    return true;
}

/* All workers to the end. A thread that can't be started leaves its tiles to the others. */
static void run(pl_worker *workers, int count)
{
    for (int i = 1; i < count; i++)
        workers[i].started = pthread_create(&workers[i].thread, NULL, work, &workers[i]) == 0;
    work(&workers[0]);
    for (int i = 1; i < count; i++)
        if (workers[i].started) pthread_join(workers[i].thread, NULL);
}

static bool render(pl_scene *scene, pl_job *job, const pl_view *view, pl_error *error)
{
    const double start = seconds(CLOCK_MONOTONIC);
    int count = pl_scene_threads(scene);
    if ((uint32_t)count > job->tiles) count = (int)job->tiles;
    pl_worker *workers = calloc((size_t)count, sizeof *workers);
    if (!workers) return pl_fail_memory(error, "preparing to render");
    bool ok = prepare(workers, count, job, view, error);
    if (ok) run(workers, count);
    double first_pixel = INFINITY, cpu = 0.0;
    for (int i = 0; i < count; i++) {
        if (workers[i].first_pixel > 0.0) first_pixel = fmin(first_pixel, workers[i].first_pixel);
        cpu += workers[i].cpu;
        if (workers[i].shader) pl_shader_count(workers[i].shader, scene);
        pl_sampler_destroy(workers[i].sampler);
        pl_shader_destroy(workers[i].shader);
    }
    free(workers);
    const double trace = seconds(CLOCK_MONOTONIC) - start;
    pl_scene_count_seconds(scene, trace, cpu, first_pixel < INFINITY ? first_pixel - start : 0.0);
    if (ok && atomic_load(&job->cancelled))
        return pl_fail(error, PL_ERROR_CANCELLED, "rendering", "stopped before the picture was complete");
    if (ok && job->error.code != PL_OK) {
        if (error) *error = job->error;
        return false;
    }
    if (ok && job->options->progress) job->options->progress(job->options->context, 1.0);
    return ok;
}

bool pl_render(pl_scene *scene, const pl_render_options *options, const pl_channels *channels, pl_error *error)
{
    pl_error_clear(error);
    pl_view view;
    if (!check(scene, options, channels, error) || !pl_view_create(&view, scene, error)) return false;
    view.spread = pl_camera_spread(&view.camera, options->width, options->height);
    const uint32_t columns = (uint32_t)(options->width + PL_TILE - 1) / PL_TILE;
    const uint32_t rows = (uint32_t)(options->height + PL_TILE - 1) / PL_TILE;
    pl_job job = {
        .options = options,
        .channels = channels,
        .wants_first = channels->depth || channels->normal || channels->position || channels->primitive ||
                       channels->symbol || channels->rule || channels->recursion || channels->boxes ||
                       channels->miss_depth,
        .columns = columns,
        .tiles = columns * rows,
        .failed = UINT_MAX,
        .lock = PTHREAD_MUTEX_INITIALIZER,
    };
    pl_quantiser_init(&job.quantiser);
    const bool ok = render(scene, &job, &view, error);
    pl_view_free(&view);
    return ok;
}
