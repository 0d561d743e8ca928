/* plsys.h - ray tracing of cyclic object-instancing graphs (the public interface of libplsys).
 *
 * Bytecode in, hits and pictures out:
 *
 *     pl_error error;
 *     pl_scene *scene = pl_scene_create(bytes, length, &(pl_options){.threads = 2}, &error);
 *     if (!scene) { fprintf(stderr, "%s: %s\n", error.place, error.reason); return 2; }
 *     pl_intersect(scene, n, origins, directions, &hits, &error);
 *     pl_scene_destroy(scene);
 *
 * Units: positions and distances in scene units; t in multiples of the direction's length (directions need not be
 * normalised). Arrays are C-contiguous. A scene is immutable after creation and may be used by several threads.
 * Every function that can fail returns false (or NULL) and fills *error; nothing prints, nothing exits. */
#ifndef PLSYS_H
#define PLSYS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define PL_API __attribute__((visibility("default")))

/* What went wrong: `place` is "file:line:column" of the source where known, else what was being read. */
typedef struct pl_error {
    int code; /* PL_OK … */
    char place[256];
    char reason[512];
} pl_error;

enum pl_error_code {
    PL_OK = 0,
    PL_ERROR_BYTECODE,  /* damaged, truncated or not bytecode at all */
    PL_ERROR_SCENE,     /* a scene that can't be derived: NaN, read before assigned, endless recursion … */
    PL_ERROR_LIMIT,     /* a named limit was reached: depth, states, memory … */
    PL_ERROR_MEMORY,    /* the machine has no more memory */
    PL_ERROR_ARGUMENT,  /* a bad argument of the caller's */
    PL_ERROR_CANCELLED, /* the progress callback said stop */
    PL_ERROR_OUTPUT     /* a file can't be written */
};

enum pl_accelerator { PL_AUTO = 0, PL_NONE, PL_BOXES, PL_BVH, PL_GRID };
enum pl_isa { PL_ISA_AUTO = 0, PL_ISA_SCALAR, PL_ISA_AVX2, PL_ISA_AVX512 };

typedef struct pl_options {
    int accelerator;     /* pl_accelerator */
    int threads;         /* 0: one a core */
    size_t memory;       /* bytes for states and structures; 0: chosen automatically */
    bool povray_epsilon; /* POV-Ray's hit and shadow tolerances instead of ours */
    uint32_t grid[3];    /* of PL_GRID: voxels along x, y and z; all 0: 16, 16 and 8 */
    int isa;             /* pl_isa: the instruction set of bvh's kernel; same hits from each */
    uint64_t front_items; /* bvh: items a front may have, UINT64_MAX: all; 0: chosen by `memory` */
    double detail;       /* pixel footprints below which an instance is drawn as its state's box; 0: automatic (none, but
                            0.5 in endless scenes); below 0: none, endless scenes end where rounding does */
} pl_options;

typedef struct pl_scene pl_scene;

PL_API pl_scene *pl_scene_create(const void *bytecode, size_t length, const pl_options *options, pl_error *error);
PL_API void pl_scene_destroy(pl_scene *scene);

/* Hits of n rays; each array may be NULL. t: distance (INFINITY: none) · primitive: index in derivation order (-1:
 * none) · symbol: index of the innermost symbol (-1: none) · rule · depth: symbols entered on the path · normal: n*3, unit,
 * world space, as the shape has it (not flipped) · bound: error bound of t (NaN until known). */
typedef struct pl_hits {
    double *t;
    int64_t *primitive;
    int32_t *symbol;
    int32_t *rule;
    int32_t *depth;
    double *normal;
    double *bound;
} pl_hits;

/* origins, directions: n*3. */
PL_API bool pl_intersect(pl_scene *scene, size_t n, const double *origins, const double *directions,
                         const pl_hits *hits, pl_error *error);

/* occluded[i] = 1 if something stands at 0 < t < distance[i] (NULL: at any distance). */
PL_API bool pl_occluded(pl_scene *scene, size_t n, const double *origins, const double *directions,
                        const double *distance, uint8_t *occluded, pl_error *error);

enum pl_antialias { PL_AA_OFF = 0, PL_AA_GRID, PL_AA_ADAPTIVE };

typedef struct pl_render_options {
    int width, height;
    int antialias;    /* pl_antialias */
    int samples;      /* grid: n of the n*n sub-cells; adaptive: recursion depth */
    double threshold; /* adaptive: colour difference that calls for more */
    /* Called now and then from one thread with the share done; false cancels. May be NULL. */
    bool (*progress)(void *context, double done);
    void *context;
} pl_render_options;

/* Planes of height*width pixels, row 0 on top, each may be NULL. color is linear rgb (3 a pixel), never clipped; srgb and
 * linear16 are its values as pl_quantise gives them.
 * depth: distance along the unit primary ray (INFINITY: none); normal, position: world space, of the foremost hit (0: none);
 * boxes: box tests of the primary ray; miss_depth: the deepest recursion depth at which the ray missed a box (paper,
 * Picture 1; 0: never entered one). With antialiasing the extra channels are the pixel centre's. */
typedef struct pl_channels {
    float *color;
    float *depth;
    float *normal;
    float *position;
    int64_t *primitive;
    int32_t *symbol;
    int32_t *rule;
    int32_t *recursion;
    int32_t *boxes;
    int32_t *miss_depth;
    uint8_t *srgb;
    uint16_t *linear16;
} pl_channels;

PL_API bool pl_render(pl_scene *scene, const pl_render_options *options, const pl_channels *channels, pl_error *error);

/* n linear values as picture files of integers have them: floor(clip(x, 0, 1) * most + 1/2), NaN as 0; srgb (IEC 61966-2-1)
 * and linear16 may be NULL. */
PL_API void pl_quantise(size_t n, const float *linear, uint8_t *srgb, uint16_t *linear16);

/* Counts and costs so far. */
typedef struct pl_statistics {
    uint64_t primitives; /* that symbols generate (the scene's own objects don't count); UINT64_MAX: more, or unknown */
    uint64_t states;
    uint64_t depth;        /* most symbols entered on a path, UINT64_MAX: endless or unknown */
    uint64_t scene_bytes;  /* program, states and accelerator */
    uint64_t rays_primary, rays_shadow, rays_reflection, rays_transmitted;
    uint64_t box_tests, primitive_tests;
    uint64_t singular;     /* subtrees dropped because a transformation was singular */
    uint64_t bailout, trace_level; /* rays ended by adc_bailout and by max_trace_level */
    double seconds_verify, seconds_build, seconds_trace;
    int accelerator, threads;
    double detail;          /* the cut-off in use, in pixel footprints; 0: none */
    uint64_t cut_instances; /* rays whose foremost hit is a cut instance's box */
    double cut_max_error;   /* the largest error bound of these, in scene units */
    /* Where there are too many states to build: unfolded when rays came to them, thrown out again, and in memory now. */
    uint64_t lazy_unfolded, lazy_evicted, lazy_states, lazy_bytes, lazy_classes;
    uint64_t instances, filtered; /* of bvh: instances entered, primitives tried in single precision before primitive_tests */
    uint64_t front_count, front_items, front_instances, front_limit; /* of bvh; limit: K, UINT64_MAX: any number */
    uint64_t bytes_program, bytes_meshes, bytes_states, bytes_nodes, bytes_items; /* scene_bytes by structure */
    double seconds_states; /* of seconds_build */
    int isa;               /* pl_isa of bvh's kernel; 0: another accelerator */
    uint64_t lazy_found;   /* times that a ray came to a state that was in memory already */
    uint64_t terrain_tiles; /* of regular subdivisions; their bytes are nodes and items */
    double seconds_first_pixel; /* from the last rendering's start to its first pixel's colour; 0: nothing rendered */
    /* Of bvh, where not everything fits: rays of the pilot, instances that a ray is then expected to enter, bytes that all
     * opened would take. pilot_seconds is a part of seconds_build, 0: no pilot. */
    uint64_t front_pilot_rays, front_flat_bytes;
    double front_entries, front_pilot_seconds;
    uint64_t terrain_triangles, terrain_bytes, terrain_node_bytes; /* in the tiles; of bytes_items and bytes_nodes */
    double seconds_trace_cpu; /* that the threads of renderings ran, added up */
    uint64_t lazy_visited; /* nodes of the graph, to bound classes */
} pl_statistics;

PL_API void pl_scene_statistics(const pl_scene *scene, pl_statistics *statistics);

/* Names for symbol and rule indices; "" when out of range. Rules: "file:line:column". */
PL_API const char *pl_symbol_name(const pl_scene *scene, int32_t symbol);
PL_API const char *pl_rule_place(const pl_scene *scene, int32_t rule);

/* The unfolding, batch by batch, in derivation order. kind: shape id (0: mesh) · matrix: 12 a primitive, row-major
 * 3x4 object to world, composed down the path · argument: the shape's first argument (0: none) or mesh index · texture: number for
 * pl_scene_texture (-1: none) · Returns the number of primitives written (0: finished), or -1 on an error. */
typedef struct pl_unfolding pl_unfolding;
PL_API pl_unfolding *pl_unfold_begin(pl_scene *scene, pl_error *error);
PL_API int64_t pl_unfold_next(pl_unfolding *unfolding, size_t capacity, int32_t *kind, double *matrix, double *argument,
                              int32_t *texture, int32_t *symbol, int32_t *depth, pl_error *error);
PL_API void pl_unfold_end(pl_unfolding *unfolding);

/* The values of a texture (bytecode.toml's texture record, entries included) before its own code changes some of them;
 * *size numbers that live as long as the scene. NULL: there is no such texture. */
PL_API const double *pl_scene_texture(const pl_scene *scene, int32_t texture, uint32_t *size);

/* The disassembly as a NUL-terminated text to be freed with pl_free, or NULL. */
PL_API char *pl_disassemble(const void *bytecode, size_t length, pl_error *error);
PL_API void pl_free(void *pointer);

#ifdef __cplusplus
}
#endif
#endif
