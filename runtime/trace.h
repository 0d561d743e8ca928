/* trace.h - from a ray to a hit, and from a hit to the surface that shading needs.
 *
 * Shading sees the scene only through this file. A tracer is one thread's working memory (stacks, counters) over an
 * immutable scene. Rays are in world space; directions need not be unit length. A hit is *normative* (see
 * DESIGN in ARCHITECTURE.md): its t was evaluated level by level along the derivation path, so it is the same
 * for every accelerator and thread. */
#ifndef PL_TRACE_H
#define PL_TRACE_H

#include "bytecode.h" /* generated: PL_TEXTURE_… value offsets, sizes and defaults */
#include "plsys.h"

typedef struct pl_tracer pl_tracer;

typedef struct pl_ray {
    double origin[3], direction[3];
    double t_min, t_max; /* hits at t_min < t < t_max count */
    bool shadow;         /* skip what stands below no_shadow */
    const struct pl_hit *leaves; /* pl_trace_any: a hit whose primitive the ray goes away from and can't meet; or NULL */
    double width, spread; /* a pixel's width at t, in scene units: width + spread * t; 0: all is as near as can be */
} pl_ray;

/* A point on a derivation path: union term indices from the root, owned by the hit (grown as needed). */
typedef struct pl_path {
    uint32_t *terms;
    uint32_t length, capacity;
} pl_path;

typedef struct pl_hit {
    double t;           /* INFINITY: none */
    double bound;       /* error bound of t; NaN until known */
    uint32_t cut_depth; /* 0: a primitive; else symbols entered to the instance drawn as its state's box (cut.h) */
    uint64_t primitive; /* index in derivation order, where the accelerator counts: ask pl_trace_primitive */
    int32_t part;       /* of the shape: a face, or a mesh's triangle */
    double local[3];    /* the point in the shape's own frame */
    pl_path path;       /* where the accelerator has no trail */
    pl_path trail;      /* the accelerator's own way to the leaf (accel.h); the path follows from it */
} pl_hit;

/* What shading needs to know of a hit, found by walking its path once more with all parameters. */
typedef struct pl_surface {
    double point[3];         /* world: origin + t * direction */
    double normal[3];        /* world, unit, as the shape has it (smooth where the mesh is) */
    double flat[3];          /* the same, but of the triangle itself where the mesh is smooth */
    const double *texture;   /* PL_TEXTURE_VALUES numbers, then entries; valid until the tracer's next surface call */
    uint32_t entries;
    double pattern_point[3]; /* the hit point in the frame where the texture stands (before its own matrix), where that has a
                                pattern */
    int32_t symbol, rule, depth;
    bool convex; /* a ray that starts outside and goes away from it doesn't meet its primitive again */
} pl_surface;

pl_tracer *pl_tracer_create(const pl_scene *scene, pl_error *error);
void pl_tracer_destroy(pl_tracer *tracer);

void pl_hit_init(pl_hit *hit);
void pl_hit_free(pl_hit *hit);

/* The foremost hit (ties: first in path order). false: an error (hit->t is then INFINITY). */
bool pl_trace_nearest(pl_tracer *tracer, const pl_ray *ray, pl_hit *hit, pl_error *error);

/* The same for up to PL_TRACE_MANY rays, which are traced as a packet where they go about the same way: the same hits.
 * Returns how many were traced before an error: `count` without. */
enum { PL_TRACE_MANY = 32 };
unsigned pl_trace_nearest_many(pl_tracer *tracer, const pl_ray *rays, unsigned count, pl_hit *hits, pl_error *error);

/* true: no ray from the eye in a direction between these four, going round, meets anything. false: one may. */
bool pl_trace_misses(const pl_scene *scene, const double eye[3], const double (*directions)[3]);

/* Makes sure that a hit's primitive index is known: where states are unfolded on touch, tracing doesn't count. */
bool pl_trace_number(pl_tracer *tracer, pl_hit *hit, pl_error *error);

/* Whether anything stands between t_min and t_max: -1 error, 0 no, 1 yes. */
int pl_trace_any(pl_tracer *tracer, const pl_ray *ray, pl_error *error);

/* The same of up to PL_TRACE_MANY rays, as pl_trace_nearest_many; blocked[i]: something stands there. */
unsigned pl_trace_any_many(pl_tracer *tracer, const pl_ray *rays, unsigned count, bool *blocked, pl_error *error);

/* Calls visit with every hit between t_min and t_max, in (t, path) order, until it returns false; for the shadows of
 * transparent things. A solid gives each of its roots. false: an error. */
bool pl_trace_all(pl_tracer *tracer, const pl_ray *ray, bool (*visit)(void *context, const pl_hit *hit), void *context,
                  pl_error *error);

/* The index of a hit's primitive in derivation order. */
uint64_t pl_trace_primitive(pl_tracer *tracer, const pl_hit *hit);

bool pl_trace_surface(pl_tracer *tracer, const pl_ray *ray, const pl_hit *hit, pl_surface *surface, pl_error *error);

/* How far rounding may have carried the point found at t on a ray off its surface, and a ray from there: some ulps of the
 * coordinates that the hit was computed from, a level of the path. So it grows and shrinks with the scene. A ray that starts so
 * far along the flat normal, on the side to which it goes, can't meet its own surface again, however grazing it is. */
double pl_hit_epsilon(const pl_surface *surface, const pl_ray *ray, double t);

/* The tracer's counters of the last primary ray (for the extra channels) and totals. */
typedef struct pl_counters {
    uint64_t box_tests, primitive_tests; /* primitive_tests: in double */
    uint64_t filtered, instances;        /* primitives tried in single precision; instances entered */
    uint64_t cuts;       /* foremost hits that are boxes of cut instances */
    double cut_error;    /* largest error bound of theirs, in scene units */
    uint32_t miss_depth; /* deepest recursion depth at which a box was missed, since last reset */
} pl_counters;
pl_counters *pl_tracer_counters(pl_tracer *tracer);

/* Records (arrays of PL_…_VALUES numbers, defaults filled in). */
const double *pl_scene_settings(const pl_scene *scene);
const double *pl_scene_camera(const pl_scene *scene); /* NULL: the scene has none */
uint32_t pl_scene_lights(const pl_scene *scene, const double *const **lights);
bool pl_scene_is_empty(const pl_scene *scene);   /* it places nothing */
bool pl_scene_all_opaque(const pl_scene *scene); /* no texture filters or transmits, or could */
bool pl_scene_povray_epsilon(const pl_scene *scene);
int pl_scene_threads(const pl_scene *scene);
/* Adds a tracer's counters and ray counts to the scene's statistics; safe from any thread. */
typedef struct pl_ray_counts {
    uint64_t primary, shadow, reflection, transmitted, bailout, trace_level;
} pl_ray_counts;
void pl_scene_count(pl_scene *scene, const pl_tracer *tracer, const pl_ray_counts *rays);
/* Seconds of a rendering, those that its threads ran, and from its start to its first pixel. */
void pl_scene_count_seconds(pl_scene *scene, double trace, double cpu, double first_pixel);

#endif
