/* intersect.c - many rays at once: pl_intersect and pl_occluded, shared among threads in chunks. A ray's answer depends on
 * the ray alone, so neither the chunks nor the threads show in the results. */
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "error.h"
#include "scene.h"
#include "vector.h"

enum { CHUNK = 512 };

typedef struct job {
    pl_scene *scene;
    size_t n;
    const double *origins, *directions, *distance;
    const pl_hits *hits; /* NULL: occlusion */
    uint8_t *occluded;
    atomic_size_t next;    /* first ray of the next chunk */
    atomic_bool stop;
    pthread_mutex_t lock;
    pl_error error;        /* that of the lowest ray that failed, which is the one a single thread would meet */
    size_t failed;
} job;

/* A direction whose squares leave the range of doubles is traced longer or shorter by a power of two: t of the one given are *stretch
 * times the ray's. */
static bool stretch_direction(size_t i, pl_ray *ray, double *stretch, pl_error *error)
{
    double *d = ray->direction;
    const double size = fmax(fabs(d[0]), fmax(fabs(d[1]), fabs(d[2])));
    if (size == 0.0) return pl_fail(error, PL_ERROR_ARGUMENT, "rays", "the direction of ray %zu is zero", i);
    *stretch = ldexp(1.0, (int)fmin(-ilogb(size), 1000.0));
    for (int axis = 0; axis < 3; axis++) d[axis] *= *stretch;
    ray->t_max /= *stretch;
    return true;
}

static bool set_ray(const job *j, size_t i, pl_ray *ray, double *stretch, pl_error *error)
{
    const double *o = j->origins + 3 * i, *d = j->directions + 3 * i, square = pl_dot(d, d);
    for (int axis = 0; axis < 3; axis++) {
        ray->origin[axis] = o[axis];
        ray->direction[axis] = d[axis];
    }
    ray->t_max = j->distance ? j->distance[i] : INFINITY;
    *stretch = 1.0;
    if (!pl_finite(o) || !pl_finite(d))
        return pl_fail(error, PL_ERROR_ARGUMENT, "rays", "ray %zu has a number that isn't finite", i);
    return (square > PL_LEAST_SQUARE && square < PL_MOST_SQUARE) || stretch_direction(i, ray, stretch, error);
}

/* What is told of a hit's surface. */
static bool tell_surface(pl_tracer *tracer, const pl_hits *out, size_t i, const pl_ray *ray, pl_hit *hit, pl_error *error)
{
    pl_surface surface;
    surface.symbol = surface.rule = -1;
    surface.depth = 0;
    surface.normal[0] = surface.normal[1] = surface.normal[2] = 0.0;
    if (hit->t < INFINITY && !pl_trace_surface(tracer, ray, hit, &surface, error)) return false;
    if (out->symbol) out->symbol[i] = surface.symbol;
    if (out->rule) out->rule[i] = surface.rule;
    if (out->depth) out->depth[i] = surface.depth;
    for (size_t axis = 0; out->normal && axis < 3; axis++) out->normal[3 * i + axis] = surface.normal[axis];
    return true;
}

static bool tell_primitive(pl_tracer *tracer, const pl_hits *out, size_t i, pl_hit *hit, pl_error *error)
{
    const bool found = hit->t < INFINITY;
    if (!pl_trace_number(tracer, hit, error)) return false;
    const uint64_t primitive = found ? pl_trace_primitive(tracer, hit) : 0;
    out->primitive[i] = !found ? -1 : primitive > INT64_MAX ? INT64_MAX : (int64_t)primitive;
    return true;
}

/* Writes what is asked of some hits; returns how many were done before an error. */
static unsigned tell(pl_tracer *tracer, const pl_hits *out, size_t first, unsigned count, const pl_ray *rays, const double *stretches,
                     pl_hit *hits, pl_error *error)
{
    const bool surface = out->symbol || out->rule || out->depth || out->normal;
    for (unsigned i = 0; out->t && i < count; i++) out->t[first + i] = hits[i].t * stretches[i];
    for (unsigned i = 0; out->bound && i < count; i++) out->bound[first + i] = hits[i].bound * stretches[i];
    for (unsigned i = 0; (surface || out->primitive) && i < count; i++) {
        if (surface && !tell_surface(tracer, out, first + i, &rays[i], &hits[i], error)) return i;
        if (out->primitive && !tell_primitive(tracer, out, first + i, &hits[i], error)) return i;
    }
    return count;
}

/* Traces up to PL_TRACE_MANY rays from `first` on; returns how many were done before an error. */
static unsigned trace_some(job *j, pl_tracer *tracer, size_t first, unsigned count, pl_ray *rays, pl_hit *hits,
                           pl_error *error)
{
    double stretches[PL_TRACE_MANY];
    unsigned known = 0, done = 0;
    while (known < count && set_ray(j, first + known, &rays[known], &stretches[known], error)) known++;
    if (!j->hits) {
        bool blocked[PL_TRACE_MANY];
        const unsigned traced = pl_trace_any_many(tracer, rays, known, blocked, error);
        for (; done < traced; done++) j->occluded[first + done] = blocked[done];
        return done;
    }
    const unsigned traced = pl_trace_nearest_many(tracer, rays, known, hits, error);
    return tell(tracer, j->hits, first, traced, rays, stretches, hits, error);
}

static void report(job *j, size_t ray, const pl_error *error)
{
    pthread_mutex_lock(&j->lock);
    if (j->error.code == PL_OK || ray < j->failed) {
        j->error = *error;
        j->failed = ray;
    }
    pthread_mutex_unlock(&j->lock);
    atomic_store(&j->stop, true);
}

static void *work(void *context)
{
    job *j = context;
    pl_error error;
    pl_error_clear(&error);
    pl_tracer *tracer = pl_tracer_create(j->scene, &error);
    if (!tracer) {
        report(j, j->n, &error);
        return NULL;
    }
    pl_ray rays[PL_TRACE_MANY] = {0};
    pl_hit hits[PL_TRACE_MANY];
    for (int i = 0; i < PL_TRACE_MANY; i++) pl_hit_init(&hits[i]);
    while (!atomic_load(&j->stop)) {
        size_t first = atomic_fetch_add(&j->next, CHUNK);
        if (first >= j->n) break;
        size_t end = j->n - first < CHUNK ? j->n : first + CHUNK;
        size_t i = first;
        for (unsigned count = 0, done = 0; i < end && done == count; i += done) {
            count = end - i < PL_TRACE_MANY ? (unsigned)(end - i) : PL_TRACE_MANY;
            done = trace_some(j, tracer, i, count, rays, hits, &error);
        }
        if (i == end) continue;
        report(j, i, &error);
        break;
    }
    pl_scene_count(j->scene, tracer, &(pl_ray_counts){0});
    for (int i = 0; i < PL_TRACE_MANY; i++) pl_hit_free(&hits[i]);
    pl_tracer_destroy(tracer);
    return NULL;
}

static bool run(job *j, pl_error *error)
{
    pl_error_clear(error);
    if (j->n && (!j->origins || !j->directions || (!j->hits && !j->occluded)))
        return pl_fail(error, PL_ERROR_ARGUMENT, "rays", "an array is missing");
    pl_error_clear(&j->error);
    pthread_mutex_init(&j->lock, NULL);
    size_t chunks = (j->n + CHUNK - 1) / CHUNK, wanted = (size_t)pl_scene_threads(j->scene);
    size_t others = wanted < chunks ? wanted - 1 : chunks ? chunks - 1 : 0, started = 0;
    pthread_t *threads = others ? malloc(others * sizeof *threads) : NULL;
    while (threads && started < others && pthread_create(&threads[started], NULL, work, j) == 0) started++;
    if (j->n) work(j);
    for (size_t i = 0; i < started; i++) pthread_join(threads[i], NULL);
    free(threads);
    pthread_mutex_destroy(&j->lock);
    if (j->error.code == PL_OK) return true;
    if (error) *error = j->error;
    return false;
}

bool pl_intersect(pl_scene *scene, size_t n, const double *origins, const double *directions, const pl_hits *hits,
                  pl_error *error)
{
    static const pl_hits nothing = {0};
    job j = {.scene = scene, .n = n, .origins = origins, .directions = directions, .hits = hits ? hits : &nothing};
    return run(&j, error);
}

bool pl_occluded(pl_scene *scene, size_t n, const double *origins, const double *directions, const double *distance,
                 uint8_t *occluded, pl_error *error)
{
    job j = {.scene = scene,
             .n = n,
             .origins = origins,
             .directions = directions,
             .distance = distance,
             .occluded = occluded};
    return run(&j, error);
}
