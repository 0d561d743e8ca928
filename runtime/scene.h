/* scene.h - what a scene holds: program, meshes, states, accelerator, statistics; and a tracer's working memory. */
#ifndef PL_SCENE_H
#define PL_SCENE_H

#include <pthread.h>

#include "class.h"
#include "shapes/mesh.h"
#include "state.h"
#include "trace.h"

typedef struct pl_accel pl_accel;

struct pl_scene {
    pl_program *program;
    pl_mesh_tree **meshes;
    pl_states states; /* empty where the accelerator needs none */
    pl_classes *gates; /* a cut-off applies, and there are too many states: gates are those of classes (cut.h); else NULL */
    pl_covers *covers; /* of the same classes */
    const pl_accel *accel;
    void *structure; /* the accelerator's */
    struct pl_terrains *terrains; /* beside it; NULL: none */
    size_t mesh_bytes;
    pl_options options;
    size_t memory; /* bytes that states and structures may take */
    size_t terrain_bytes; /* of them */
    double detail; /* footprints below which instances are cut; 0: only where rounding ends an endless recursion */
    int threads;
    bool all_opaque;
    int isa; /* of the accelerator's kernel: pl_isa */
    char **rule_places; /* of program->rules */
    pthread_mutex_t lock; /* of statistics */
    pl_statistics statistics;
};

/* Growing array of transformations, from the root to a leaf. */
typedef struct pl_chain {
    pl_transform *list;
    size_t count, capacity;
} pl_chain;

struct pl_tracer {
    const pl_scene *scene;
    void *work; /* the accelerator's */
    pl_counters counters;
    pl_walk walk; /* of pl_trace_surface */
    pl_chain chain;
    double *texture; /* values that code fills in */
    uint32_t *first_textures; /* by state: what surface.c found of the first texture below; NULL: nothing yet */
    pl_path scratch, spare;
    pl_items items;
    struct pl_hit_list *list;
};

/* A monotonic clock. */
double pl_seconds(void);

#endif
