/* scene.c - a scene's life: bytecode -> program -> meshes, states, accelerator; records and statistics (plsys.h, trace.h). */
#include "scene.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "accel/front.h"
#include "accel/gated.h"
#include "accel/lazy.h"
#include "accel/terrain.h"
#include "coverage.h"
#include "error.h"
#include "table.h"

static const pl_accel *const accelerators[] = {
    [PL_AUTO] = &pl_accel_bvh, [PL_NONE] = &pl_accel_none, [PL_BOXES] = &pl_accel_boxes,
    [PL_BVH] = &pl_accel_bvh, [PL_GRID] = &pl_accel_grid};
static const int accelerator_ids[] = {
    [PL_AUTO] = PL_BVH, [PL_NONE] = PL_NONE, [PL_BOXES] = PL_BOXES, [PL_BVH] = PL_BVH, [PL_GRID] = PL_GRID};

enum { MOST_THREADS = 1024, MOST_VOXELS = 1 << 26 };

double pl_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* --- transparency --- */

/* Whether a piece of a texture's code sets a filter or transmit. Verified code: operands are complete and it ends. */
static bool code_sets_transparency(const pl_program *program, uint32_t code)
{
    const uint8_t *at = program->code + (code - 1);
    while (*at != PL_OP_END) {
        uint8_t opcode = *at++;
        if (pl_op_row_of(opcode)->operand == PL_OPERAND_NONE) continue;
        uint32_t value = 0;
        for (int shift = 0;; shift += 7) {
            value |= (uint32_t)(*at & 0x7F) << shift;
            if (!(*at++ & 0x80)) break;
        }
        if (opcode != PL_OP_TEXTURE_SET || value < PL_TEXTURE_VALUES) continue;
        uint32_t in_entry = (value - PL_TEXTURE_VALUES) % PL_TEXTURE_ENTRY;
        if (in_entry == PL_TEXTURE_ENTRY_FILTER || in_entry == PL_TEXTURE_ENTRY_TRANSMIT) return true;
    }
    return false;
}

static bool is_opaque(const pl_program *program)
{
    for (uint32_t i = 0; i < program->record_count; i++) {
        const pl_record *record = &program->records[i];
        if (record->kind != PL_RECORD_TEXTURE) continue;
        for (uint32_t k = 0; k < record->entries; k++) {
            const double *entry = record->values + PL_TEXTURE_VALUES + (size_t)k * PL_TEXTURE_ENTRY;
            if (entry[PL_TEXTURE_ENTRY_FILTER] != 0.0 || entry[PL_TEXTURE_ENTRY_TRANSMIT] != 0.0) return false;
        }
    }
    for (uint32_t i = 0; i < program->node_count; i++) {
        const pl_node *node = &program->nodes[i];
        if (node->kind == PL_NODE_TEXTURE && node->as.texture.code &&
            code_sets_transparency(program, node->as.texture.code))
            return false;
    }
    return true;
}

/* --- creation --- */

/* The best instruction set that this machine has. */
static int best_isa(void)
{
#ifdef __x86_64__
    __builtin_cpu_init();
    bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
    if (avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw"))
        return PL_ISA_AVX512;
    if (avx2) return PL_ISA_AVX2;
#endif
    return PL_ISA_SCALAR;
}

static bool check_grid(const uint32_t grid[3], pl_error *error)
{
    uint64_t voxels = 1;
    for (int axis = 0; axis < 3; axis++) {
        if (!grid[axis] != !grid[0])
            return pl_fail(error, PL_ERROR_ARGUMENT, "grid", "%ux%ux%u; every side needs a voxel", grid[0], grid[1], grid[2]);
        voxels = voxels > MOST_VOXELS ? voxels : voxels * grid[axis];
    }
    return voxels <= MOST_VOXELS || pl_fail(error, PL_ERROR_ARGUMENT, "grid", "%ux%ux%u are more than %d voxels", grid[0],
                                            grid[1], grid[2], MOST_VOXELS);
}

static bool check_options(const pl_options *options, pl_error *error)
{
    if (options->accelerator < PL_AUTO || options->accelerator > PL_GRID)
        return pl_fail(error, PL_ERROR_ARGUMENT, "accelerator", "there is no accelerator number %d", options->accelerator);
    if (options->threads < 0 || options->threads > MOST_THREADS)
        return pl_fail(error, PL_ERROR_ARGUMENT, "threads", "%d threads; 1 to %d, or 0 for one a core", options->threads,
                       MOST_THREADS);
    if (options->isa < PL_ISA_AUTO || options->isa > best_isa())
        return pl_fail(error, PL_ERROR_ARGUMENT, "isa", "this machine doesn't have instruction set number %d", options->isa);
    if (isnan(options->detail) || isinf(options->detail))
        return pl_fail(error, PL_ERROR_ARGUMENT, "detail", "%g isn't a number of pixels", options->detail);
    return check_grid(options->grid, error);
}

/* Half of the machine's memory, at most PL_STATES_DEFAULT_BYTES. */
static size_t default_memory(void)
{
    long pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGESIZE);
    size_t half = pages > 0 && page > 0 ? (size_t)pages / 2 * (size_t)page : PL_STATES_DEFAULT_BYTES;
    return half < PL_STATES_DEFAULT_BYTES ? half : PL_STATES_DEFAULT_BYTES;
}

static bool build_meshes(pl_scene *scene, pl_error *error)
{
    const pl_program *program = scene->program;
    scene->meshes = calloc(program->mesh_count + 1, sizeof *scene->meshes);
    if (!scene->meshes) return pl_fail_memory(error, "building the meshes");
    for (uint32_t i = 0; i < program->mesh_count; i++) {
        scene->meshes[i] = pl_mesh_tree_build(&program->meshes[i]);
        if (!scene->meshes[i]) return pl_fail_memory(error, "building the meshes");
        scene->mesh_bytes += pl_mesh_tree_bytes(scene->meshes[i]);
    }
    return true;
}

static bool find_rule_places(pl_scene *scene, pl_error *error)
{
    const pl_program *program = scene->program;
    scene->rule_places = calloc(program->rule_count + 1, sizeof *scene->rule_places);
    if (!scene->rule_places) return pl_fail_memory(error, "loading the scene");
    for (uint32_t i = 0; i < program->rule_count; i++) {
        char place[256];
        scene->rule_places[i] = strdup(pl_program_place(program, program->rules[i], place, sizeof place));
        if (!scene->rule_places[i]) return pl_fail_memory(error, "loading the scene");
    }
    return true;
}

/* What symbols generate: the scene's own shapes, leaves of state 0, don't count. */
static uint64_t generated(const pl_states *states)
{
    const pl_state *root = &states->list[0];
    uint64_t own = 0;
    for (uint32_t i = 0; i < root->item_count; i++) own += root->items[i].kind != PL_NODE_ENTER;
    return root->primitives == UINT64_MAX ? UINT64_MAX : root->primitives - own;
}

/* More states than this aren't built but unfolded when rays come to them; with a cut-off the first number counts, in all
 * accelerators, and their gates are then those of classes (cut.h). */
enum { MOST_STATES_CUT = 1 << 14, MOST_STATES = 1 << 17 };

/* PX of an endless scene unless something else is asked for. */
#define ENDLESS_DETAIL 0.5

/* Gates of classes: states aren't needed, but by none of the accelerators that use them. */
static bool gate_by_classes(pl_scene *scene, pl_error *error)
{
    scene->accel = scene->accel == &pl_accel_bvh ? &pl_accel_lazy : &pl_accel_none;
    scene->detail = scene->options.detail;
    scene->gates = pl_classes_create(scene->program, scene->meshes, pl_lazy_class_budget(pl_lazy_budget(scene)), error);
    scene->covers = scene->gates ? pl_covers_create(scene->program, scene->meshes, scene->gates, error) : NULL;
    return scene->covers != NULL;
}

/* Where a scene has too many states or there is no room for them. */
static bool is_limit_of_states(const pl_error *error)
{
    return error->code == PL_ERROR_LIMIT && strcmp(error->place, "states") == 0;
}

/* The states, where the accelerator or a cut-off needs them. Without either they are explored all the same, since an endless
 * scene has a cut-off in every accelerator; what is wrong with a finite one is then met while tracing. */
static bool build_states(pl_scene *scene, size_t limit, pl_error *error)
{
    pl_states *states = &scene->states;
    pl_error failed = {.code = PL_OK};
    const double asked = scene->options.detail;
    const bool cut = asked > 0.0, lazy = scene->accel == &pl_accel_bvh;
    const bool needed = scene->accel->states || cut;
    if (lazy && !cut && !scene->options.front_items) {
        if (pl_terrains_build(scene, MOST_STATES, error)) scene->accel = &pl_accel_terrain;
        if (scene->accel == &pl_accel_terrain || error->code != PL_OK) return error->code == PL_OK;
    }
    const uint32_t most = cut ? MOST_STATES_CUT : lazy || !needed ? MOST_STATES : 0;
    if (!pl_states_build(states, scene->program, scene->meshes, scene->accel->node_boxes && !cut, limit, most, &failed)) {
        if (cut && is_limit_of_states(&failed) && strncmp(failed.reason, "more than", 9) == 0)
            return gate_by_classes(scene, error);
        if (lazy && !cut && is_limit_of_states(&failed)) {
            scene->accel = &pl_accel_lazy;
            return true;
        }
        if (needed) *error = failed;
        return !needed;
    }
    const bool endless = states->list[0].endless;
    if (!needed && !endless) {
        pl_states_free(states);
        return true;
    }
    scene->detail = cut ? asked : asked == 0.0 && endless ? ENDLESS_DETAIL : 0.0;
    states->cuts = endless || scene->detail > 0.0;
    /* A voxel's state is entered without the gates above it, which count where there are cut-offs. */
    if (states->cuts && scene->accel == &pl_accel_grid) scene->accel = &pl_accel_boxes;
    if (states->cuts && scene->accel == &pl_accel_bvh) scene->accel = &pl_accel_gated;
    return !states->cuts || (states->coverage = pl_coverage_create(states, error)) != NULL;
}

/* The accelerator's structure. Fronts that don't fit into the memory that was asked for are left, and states with them: they are
 * unfolded on touch. Where there isn't enough for that either, what fronts need is told. */
static bool build_structure(pl_scene *scene, pl_error *error)
{
    pl_error why = {.code = PL_OK};
    if (!scene->accel->build || scene->accel->build(scene, &why)) return true;
    if (scene->accel != &pl_accel_bvh || why.code != PL_ERROR_LIMIT || strcmp(why.place, "memory") != 0) {
        *error = why;
        return false;
    }
    scene->accel->destroy(scene);
    pl_states_free(&scene->states);
    scene->accel = &pl_accel_lazy;
    if (scene->accel->build(scene, NULL)) return true;
    *error = why;
    return false;
}

static bool build(pl_scene *scene, pl_error *error)
{
    double start = pl_seconds();
    const size_t limit = scene->memory = scene->options.memory ? scene->options.memory : default_memory();
    if (!build_meshes(scene, error) || !find_rule_places(scene, error)) return false;
    double before_states = pl_seconds();
    if (!build_states(scene, limit, error)) return false;
    scene->statistics.seconds_states = pl_seconds() - before_states;
    if (!build_structure(scene, error)) return false;
    scene->all_opaque = is_opaque(scene->program);

    pl_statistics *counts = &scene->statistics;
    counts->primitives = UINT64_MAX;
    if (scene->states.count) {
        const pl_state *root = &scene->states.list[0];
        counts->primitives = generated(&scene->states);
        counts->singular = root->bounds->singular;
        counts->depth = root->endless ? UINT64_MAX : root->depth;
        counts->states = scene->states.count - 1; /* the scene itself is none */
    }
    counts->bytes_program = sizeof *scene + scene->program->bytes;
    counts->bytes_meshes = scene->mesh_bytes;
    counts->bytes_states = scene->states.bytes;
    if (scene->accel == &pl_accel_bvh) pl_fronts_count(scene, counts);
    if (scene->accel == &pl_accel_gated) pl_gated_count(scene, counts);
    if (scene->accel == &pl_accel_terrain) pl_terrains_count(scene, counts);
    counts->scene_bytes = counts->bytes_program + counts->bytes_meshes + counts->bytes_states + counts->bytes_nodes +
                          counts->bytes_items;
    counts->detail = scene->detail;
    counts->accelerator = scene->accel == &pl_accel_boxes ? PL_BOXES : accelerator_ids[scene->options.accelerator];
    counts->threads = scene->threads;
    counts->seconds_build = pl_seconds() - start;
    return true;
}

pl_scene *pl_scene_create(const void *bytecode, size_t length, const pl_options *options, pl_error *error)
{
    static const pl_options defaults = {0};
    pl_error_clear(error);
    if (!options) options = &defaults;
    if (!bytecode && length) {
        pl_fail(error, PL_ERROR_ARGUMENT, "bytecode", "no bytes given");
        return NULL;
    }
    if (!check_options(options, error)) return NULL;
    pl_scene *scene = calloc(1, sizeof *scene);
    if (!scene) {
        pl_fail_memory(error, "loading the scene");
        return NULL;
    }
    pthread_mutex_init(&scene->lock, NULL);
    scene->options = *options;
    scene->accel = accelerators[options->accelerator];
    scene->isa = options->isa ? options->isa : best_isa();
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    scene->threads = options->threads ? options->threads : cores > 0 ? (int)cores : 1;
    double start = pl_seconds();
    scene->program = pl_program_load(bytecode, length, error);
    scene->statistics.seconds_verify = pl_seconds() - start;
    if (scene->program && build(scene, error)) return scene;
    pl_scene_destroy(scene);
    return NULL;
}

void pl_scene_destroy(pl_scene *scene)
{
    if (!scene) return;
    if (scene->accel->destroy) scene->accel->destroy(scene);
    pl_states_free(&scene->states);
    pl_covers_free(scene->covers);
    pl_classes_free(scene->gates);
    if (scene->program) {
        for (uint32_t i = 0; scene->meshes && i < scene->program->mesh_count; i++) pl_mesh_tree_free(scene->meshes[i]);
        for (uint32_t i = 0; scene->rule_places && i < scene->program->rule_count; i++) free(scene->rule_places[i]);
    }
    free(scene->meshes);
    free(scene->rule_places);
    pl_program_free(scene->program);
    pthread_mutex_destroy(&scene->lock);
    free(scene);
}

void pl_free(void *pointer)
{
    free(pointer);
}

/* --- what a scene tells --- */

const double *pl_scene_settings(const pl_scene *scene)
{
    return scene->program->settings;
}

const double *pl_scene_camera(const pl_scene *scene)
{
    return scene->program->camera;
}

uint32_t pl_scene_lights(const pl_scene *scene, const double *const **lights)
{
    *lights = scene->program->lights;
    return scene->program->light_count;
}

bool pl_scene_is_empty(const pl_scene *scene)
{
    return scene->program->nodes[0].kind == PL_NODE_EMPTY;
}

bool pl_scene_all_opaque(const pl_scene *scene)
{
    return scene->all_opaque;
}

bool pl_scene_povray_epsilon(const pl_scene *scene)
{
    return scene->options.povray_epsilon;
}

int pl_scene_threads(const pl_scene *scene)
{
    return scene->threads;
}

const char *pl_symbol_name(const pl_scene *scene, int32_t symbol)
{
    const pl_program *program = scene->program;
    if (symbol < 0 || (uint32_t)symbol >= program->symbol_count) return "";
    return program->strings[program->nodes[program->symbols[symbol]].as.symbol.name].text;
}

const char *pl_rule_place(const pl_scene *scene, int32_t rule)
{
    const pl_program *program = scene->program;
    for (uint32_t i = 0; i < program->rule_count && rule >= 0; i++)
        if (program->nodes[program->rules[i]].as.rule.index == (uint32_t)rule) return scene->rule_places[i];
    return "";
}

const double *pl_scene_texture(const pl_scene *scene, int32_t texture, uint32_t *size)
{
    *size = 0;
    if (texture < 0 || (uint32_t)texture >= scene->program->record_count) return NULL;
    const pl_record *record = &scene->program->records[texture];
    if (record->kind != PL_RECORD_TEXTURE) return NULL;
    *size = record->size;
    return record->values;
}

/* --- statistics --- */

void pl_scene_count(pl_scene *scene, const pl_tracer *tracer, const pl_ray_counts *rays)
{
    pthread_mutex_lock(&scene->lock);
    pl_statistics *counts = &scene->statistics;
    counts->box_tests += tracer->counters.box_tests;
    counts->primitive_tests += tracer->counters.primitive_tests;
    counts->instances += tracer->counters.instances;
    counts->filtered += tracer->counters.filtered;
    counts->rays_primary += rays->primary;
    counts->rays_shadow += rays->shadow;
    counts->rays_reflection += rays->reflection;
    counts->rays_transmitted += rays->transmitted;
    counts->bailout += rays->bailout;
    counts->trace_level += rays->trace_level;
    counts->cut_instances += tracer->counters.cuts;
    counts->cut_max_error = fmax(counts->cut_max_error, tracer->counters.cut_error);
    pthread_mutex_unlock(&scene->lock);
}

void pl_scene_count_seconds(pl_scene *scene, double trace, double cpu, double first_pixel)
{
    pthread_mutex_lock(&scene->lock);
    scene->statistics.seconds_trace += trace;
    scene->statistics.seconds_trace_cpu += cpu;
    scene->statistics.seconds_first_pixel = first_pixel;
    pthread_mutex_unlock(&scene->lock);
}

void pl_scene_statistics(const pl_scene *scene, pl_statistics *statistics)
{
    pl_scene *locked = (pl_scene *)scene; /* only the lock changes */
    pthread_mutex_lock(&locked->lock);
    *statistics = scene->statistics;
    pthread_mutex_unlock(&locked->lock);
    if (scene->accel != &pl_accel_lazy) return;
    pl_lazy_counts lazy;
    pl_lazy_count(scene->structure, &lazy);
    statistics->lazy_found = lazy.found;
    statistics->lazy_unfolded = lazy.unfolded;
    statistics->lazy_evicted = lazy.evicted;
    statistics->lazy_states = lazy.states;
    statistics->lazy_bytes = lazy.bytes;
    statistics->lazy_classes = lazy.classes;
    statistics->lazy_visited = lazy.visited;
    statistics->scene_bytes += lazy.bytes;
}
