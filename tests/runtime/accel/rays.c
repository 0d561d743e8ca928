/* rays.c - one scene, every accelerator, small fronts too, every entry point: the answers must be the same bits. For the sanitizers too.
 *
 *     rays SCENE.plsb [COUNT]        exit code 0, or lines that say what differs; COUNT rays instead of 1500
 *
 * nearest (pl_intersect with 1 and 4 threads) = first of pl_trace_all · pl_occluded = nearest within the distance ·
 * every hit's surface has a unit normal and a texture · the unfolding counts, of what symbols generate, as much as the states do. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check.h"
#include "trace.h"

enum { RAYS = 1500, BATCH = 100 };

static const pl_options ways[] = {
    {.accelerator = PL_NONE, .threads = 1},
    {.accelerator = PL_NONE, .threads = 4},
    {.accelerator = PL_BOXES, .threads = 1},
    {.accelerator = PL_BOXES, .threads = 4},
    {.accelerator = PL_BVH, .threads = 1},
    {.accelerator = PL_BVH, .threads = 4},
    {.accelerator = PL_BVH, .threads = 1, .front_items = 1},
    {.accelerator = PL_BVH, .threads = 4, .front_items = 7, .isa = PL_ISA_SCALAR},
    {.accelerator = PL_GRID, .threads = 1},
    {.accelerator = PL_GRID, .threads = 4},
};

static int rays = RAYS;
static double origins[3 * RAYS], directions[3 * RAYS], distance[RAYS];
static uint64_t state = 7;

static double uniform(double lo, double hi)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return lo + (hi - lo) * (double)(state >> 11) * 0x1p-53;
}

static void *read_file(const char *path, size_t *length)
{
    FILE *file = fopen(path, "rb");
    if (!file || fseek(file, 0, SEEK_END) != 0) exit(3);
    *length = (size_t)ftell(file);
    rewind(file);
    void *bytes = malloc(*length);
    if (!bytes || fread(bytes, 1, *length, file) != *length) exit(3);
    fclose(file);
    return bytes;
}

/* Sixteen rays that follow the first of them closely enough to be traced together. */
static void follow(int first)
{
    for (int i = first + 1; i < first + 16 && i < rays; i++)
        for (int axis = 0; axis < 3; axis++) {
            origins[3 * i + axis] = origins[3 * first + axis];
            directions[3 * i + axis] = directions[3 * first + axis] * uniform(0.995, 1.005);
        }
}

/* Towards the origins of random primitives, and along axes; the second half in packets. */
static void make_rays(pl_scene *scene)
{
    static double matrices[12 * BATCH * 40];
    size_t known = 0;
    int64_t got;
    pl_error error;
    pl_unfolding *unfolding = pl_unfold_begin(scene, &error);
    while (known < BATCH * 39 &&
           (got = pl_unfold_next(unfolding, BATCH, NULL, matrices + 12 * known, NULL, NULL, NULL, NULL, &error)) > 0)
        known += (size_t)got;
    pl_unfold_end(unfolding);
    CHECK(known > 0);
    for (int i = 0; i < rays; i++) {
        const double *m = matrices + 12 * (size_t)uniform(0, (double)known);
        for (int axis = 0; axis < 3; axis++) {
            double target = m[4 * axis + 3] + uniform(0, 0.5) * m[4 * axis] + uniform(0, 1) * m[4 * axis + 2];
            origins[3 * i + axis] = uniform(-20, 20);
            directions[3 * i + axis] = target - origins[3 * i + axis];
            if (i % 10 == 0) {
                origins[3 * i + axis] = axis == 0 ? -30.0 : target;
                directions[3 * i + axis] = axis == 0 ? 1.0 : -0.0;
            }
        }
        distance[i] = uniform(0.5, 1.5);
    }
    for (int i = rays / 2 / 16 * 16; i < rays; i += 16) follow(i);
}

typedef struct answers {
    double t[RAYS], normal[3 * RAYS];
    int64_t primitive[RAYS];
    int32_t symbol[RAYS], rule[RAYS], depth[RAYS];
    uint8_t occluded[RAYS], shadowed[RAYS]; /* shadowed: without what stands below no_shadow */
} answers;

typedef struct first_hit {
    pl_tracer *tracer;
    double t, previous;
    uint64_t primitive;
    int count;
} first_hit;

static bool keep_first(void *context, const pl_hit *hit)
{
    first_hit *first = context;
    CHECK(hit->t >= first->previous);
    if (first->count++ == 0) first->t = hit->t, first->primitive = pl_trace_primitive(first->tracer, hit);
    first->previous = hit->t;
    return true;
}

static void check_tracer(pl_scene *scene, const answers *expected)
{
    pl_error error;
    pl_hit hit;
    pl_hit_init(&hit);
    pl_tracer *tracer = pl_tracer_create(scene, &error);
    for (int i = 0; i < rays; i++) {
        pl_ray ray = {.t_min = 0.0, .t_max = INFINITY};
        memcpy(ray.origin, origins + 3 * i, sizeof ray.origin);
        memcpy(ray.direction, directions + 3 * i, sizeof ray.direction);
        first_hit first = {tracer, INFINITY, -INFINITY, 0, 0};
        CHECK(pl_trace_all(tracer, &ray, keep_first, &first, &error));
        CHECK(first.t == expected->t[i]);
        CHECK(first.count == 0 || (int64_t)first.primitive == expected->primitive[i]);
        CHECK(pl_trace_nearest(tracer, &ray, &hit, &error) && hit.t == expected->t[i]);
        if (hit.t == INFINITY) continue;
        pl_surface surface;
        CHECK(pl_trace_surface(tracer, &ray, &hit, &surface, &error));
        double squared = 0.0;
        for (int axis = 0; axis < 3; axis++) squared += surface.normal[axis] * surface.normal[axis];
        CHECK(fabs(squared - 1.0) < 1e-12 && surface.texture && pl_hit_epsilon(&surface, &ray, hit.t) > 0.0);
        ray.t_max = hit.t; /* an open interval: nothing stands before the foremost hit */
        CHECK(pl_trace_any(tracer, &ray, &error) == 0);
        ray.t_max = nextafter(hit.t, INFINITY);
        CHECK(pl_trace_any(tracer, &ray, &error) == 1);
    }
    pl_hit_free(&hit);
    pl_tracer_destroy(tracer);
}

static void ask_shadows(pl_scene *scene, answers *a)
{
    pl_error error;
    pl_tracer *tracer = pl_tracer_create(scene, &error);
    for (int i = 0; i < rays; i++) {
        pl_ray ray = {.t_min = 0.0, .t_max = distance[i], .shadow = true};
        memcpy(ray.origin, origins + 3 * i, sizeof ray.origin);
        memcpy(ray.direction, directions + 3 * i, sizeof ray.direction);
        a->shadowed[i] = (uint8_t)pl_trace_any(tracer, &ray, &error);
        CHECK(a->shadowed[i] <= a->occluded[i]);
    }
    pl_tracer_destroy(tracer);
}

static void ask(pl_scene *scene, answers *a)
{
    pl_error error;
    pl_hits hits = {a->t, a->primitive, a->symbol, a->rule, a->depth, a->normal, NULL};
    CHECK(pl_intersect(scene, rays, origins, directions, &hits, &error));
    CHECK(pl_occluded(scene, rays, origins, directions, distance, a->occluded, &error));
    for (int i = 0; i < rays; i++) CHECK(a->occluded[i] == (a->t[i] < distance[i]));
    ask_shadows(scene, a);
}

static uint64_t count_unfolded(pl_scene *scene)
{
    pl_error error;
    int64_t got;
    uint64_t count = 0;
    int32_t symbol[BATCH];
    pl_unfolding *unfolding = pl_unfold_begin(scene, &error);
    while ((got = pl_unfold_next(unfolding, BATCH, NULL, NULL, NULL, NULL, symbol, NULL, &error)) > 0)
        for (int64_t i = 0; i < got; i++) count += symbol[i] >= 0;
    CHECK(got == 0);
    pl_unfold_end(unfolding);
    return count;
}

int main(int argc, char **argv)
{
    static answers first, other;
    size_t length;
    if (argc != 2 && argc != 3) return 3;
    if (argc == 3) rays = atoi(argv[2]);
    if (rays < 1 || rays > RAYS) return 3;
    void *bytes = read_file(argv[1], &length);
    for (size_t way = 0; way < sizeof ways / sizeof *ways; way++) {
        pl_error error;
        pl_scene *scene = pl_scene_create(bytes, length, &ways[way], &error);
        if (!scene) {
            printf("%s: %s\n", error.place, error.reason);
            return 1;
        }
        if (way == 0) make_rays(scene);
        ask(scene, way == 0 ? &first : &other);
        if (way > 0) CHECK(memcmp(&first, &other, sizeof first) == 0);
        if (ways[way].threads == 1 && way > 0) {
            pl_statistics statistics;
            check_tracer(scene, &first);
            pl_scene_statistics(scene, &statistics);
            CHECK(statistics.primitives == count_unfolded(scene));
        }
        pl_scene_destroy(scene);
    }
    free(bytes);
    return check_result();
}
