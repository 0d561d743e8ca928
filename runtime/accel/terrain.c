/* terrain.c - the accelerator of scenes that are regular subdivisions (terrain.h): rays through the tiles, triangles
 * evaluated from the tiles' values in double. */
#include "terrain.h"

#include <stdlib.h>
#include <string.h>

#include "bvh.h"

/* --- hits --- */

/* A trail: the number of a terrain or, after these, of a single shape; and a triangle's. The kind tells them from trails of
 * fronts. */
typedef struct source {
    uint32_t place, leaf;
} source;

enum { KIND_PLACE = 15 };

static bool write_trail(const void *context, pl_path *trail)
{
    const source *s = context;
    if (trail->capacity < 2 && !pl_path_push(trail, 1, 0)) return false;
    trail->terms[0] = pl_ref_of(KIND_PLACE, s->place);
    trail->terms[1] = s->leaf;
    trail->length = 2;
    return true;
}

static bool write_terms(const pl_terrain_place *place, uint32_t more, pl_path *path)
{
    const uint32_t length = place->term_count + more;
    if (length && !pl_path_push(path, length - 1, 0)) return false;
    if (place->term_count) memcpy(path->terms, place->terms, place->term_count * sizeof *path->terms);
    path->length = length;
    return true;
}

/* A triangle's number tells the terms. */
static bool trail_path(const pl_scene *scene, const pl_path *trail, pl_path *path)
{
    const pl_terrains *terrains = scene->terrains;
    const uint32_t place = trail->terms[0] & PL_REF_INDEX;
    if (place >= terrains->count) return write_terms(&terrains->singles[place - terrains->count].place, 0, path);
    const pl_terrain *terrain = &terrains->list[place];
    if (!write_terms(&terrain->place, terrain->levels, path)) return false;
    uint32_t *terms = path->terms + terrain->place.term_count;
    uint32_t rest = trail->terms[1];
    for (uint32_t i = terrain->levels; i-- > 0;) {
        terms[i] = terrain->shift[i] ? rest & (terrain->radix[i] - 1) : rest % terrain->radix[i];
        rest = terrain->shift[i] ? rest >> terrain->shift[i] : rest / terrain->radix[i];
    }
    return true;
}

static void skip(const pl_scene *scene, const pl_path *trail, pl_walk *walk)
{
    const pl_terrains *terrains = scene->terrains;
    const uint32_t place = trail->terms[0] & PL_REF_INDEX;
    if (place < terrains->count) pl_terrain_end_skip(&terrains->list[place], trail->terms[1], walk);
}

static bool trail_items(const pl_scene *scene, const pl_path *trail, pl_items *items)
{
    if (trail->terms[0] >> PL_REF_SHIFT != KIND_PLACE) return pl_accel_bvh.items(scene, trail, items);
    items->count = 0;
    return true;
}

bool pl_terrain_candidate(pl_tracer *tracer, const pl_terrain *terrain, uint64_t tile, uint32_t leaf, const double o[3],
                          const double d[3], pl_query *query)
{
    static const double no_arguments[PL_SHAPE_ARGUMENTS];
    double cells[PL_TERRAIN_CELLS], mapped_o[3], mapped_d[3];
    pl_affine matrix;
    pl_transform transform; /* of which pl_map_ray reads the inverse; singular ones would have been no terrain */
    pl_terrain_cells(terrain, pl_terrain_tile_at(terrain, tile)->values, leaf, cells);
    pl_terrain_matrix(&terrain->form, cells, &matrix);
    pl_affine_invert(&matrix, pl_affine_determinant(&matrix), &transform.to_object);
    transform.form = pl_form_of(&transform.to_object);
    memcpy(mapped_o, o, sizeof mapped_o);
    memcpy(mapped_d, d, sizeof mapped_d);
    pl_map_ray(&transform, mapped_o, mapped_d);
    const pl_terrains *terrains = tracer->scene->terrains;
    source s = {(uint32_t)(terrain - terrains->list), (uint32_t)(tile * terrain->tile_leaves) + leaf};
    pl_leaf candidate = {.shape = PL_SHAPE_TRIANGLE,
                         .arguments = no_arguments,
                         .primitive = terrain->place.first + s.leaf,
                         .trail = write_trail,
                         .source = &s,
                         .o = mapped_o,
                         .d = mapped_d};
    tracer->counters.primitive_tests++;
    return pl_query_leaf(query, &candidate);
}

static void map_to_place(const pl_terrain_place *place, const pl_ray *ray, double o[3], double d[3])
{
    memcpy(o, ray->origin, 3 * sizeof *o);
    memcpy(d, ray->direction, 3 * sizeof *d);
    for (uint32_t i = 0; i < place->transform_count; i++) pl_map_ray(&place->transforms[i], o, d);
}

static bool trace_singles(pl_tracer *tracer, const pl_terrains *terrains, const pl_ray *ray, pl_query *query)
{
    double o[3], d[3];
    for (uint32_t i = 0; i < terrains->single_count && !query->done; i++) {
        const pl_terrain_single *single = &terrains->singles[i];
        if (query->shadow && single->place.no_shadow) continue;
        source s = {terrains->count + i, 0};
        map_to_place(&single->place, ray, o, d);
        pl_leaf leaf = {.shape = single->shape,
                        .mesh = single->mesh,
                        .arguments = single->arguments,
                        .primitive = single->place.first,
                        .trail = write_trail,
                        .source = &s,
                        .o = o,
                        .d = d};
        tracer->counters.primitive_tests++;
        if (!pl_query_leaf(query, &leaf)) return false;
    }
    return true;
}

static bool trace(pl_tracer *tracer, const pl_ray *ray, pl_query *query)
{
    const pl_terrains *terrains = tracer->scene->terrains;
    pl_terrain_kernel *kernel = pl_terrain_trace_scalar;
    double o[3], d[3];
#ifdef __x86_64__
    if (tracer->scene->isa == PL_ISA_AVX2) kernel = pl_terrain_trace_avx2;
    if (tracer->scene->isa == PL_ISA_AVX512) kernel = pl_terrain_trace_avx512;
#endif
    if (!trace_singles(tracer, terrains, ray, query)) return false;
    for (uint32_t i = 0; i < terrains->count && !query->done; i++) {
        const pl_terrain *terrain = &terrains->list[i];
        if (query->shadow && terrain->place.no_shadow) continue;
        map_to_place(&terrain->place, ray, o, d);
        if (!kernel(tracer, terrain, o, d, query)) return false;
    }
    return !terrains->fronts || query->done || pl_accel_bvh.trace(tracer, ray, query);
}

static bool trace_one_by_one(pl_tracer *tracer, const pl_ray *rays, pl_query *queries, unsigned count)
{
    for (unsigned k = 0; k < count; k++)
        if (!trace(tracer, &rays[k], &queries[k])) return false;
    return true;
}

/* Those that don't go well together gain as well: they needn't wait for memory one after another. */
static bool trace_many(pl_tracer *tracer, const pl_ray *rays, pl_query *queries, unsigned count)
{
#ifdef __x86_64__
    const pl_terrains *terrains = tracer->scene->terrains;
    pl_ray mapped[PL_LANES];
    if (tracer->scene->isa == PL_ISA_SCALAR || count < PL_LEAST_LANES) return trace_one_by_one(tracer, rays, queries, count);
    for (unsigned k = 0; k < count; k++)
        if (!trace_singles(tracer, terrains, &rays[k], &queries[k])) return false;
    for (uint32_t i = 0; i < terrains->count; i++) {
        const pl_terrain *terrain = &terrains->list[i];
        if (queries->shadow && terrain->place.no_shadow) continue;
        for (unsigned k = 0; k < count; k++) map_to_place(&terrain->place, &rays[k], mapped[k].origin, mapped[k].direction);
        if (!pl_terrain_packet_avx2(tracer, terrain, mapped, queries, count)) return false;
    }
    return !terrains->fronts || pl_accel_bvh.trace_many(tracer, rays, queries, count);
#else
    return trace_one_by_one(tracer, rays, queries, count);
#endif
}

/* --- memory --- */

static void *work_create(const pl_scene *scene, pl_error *error)
{
    return pl_accel_bvh.work_create(scene, error);
}

static void work_destroy(void *work)
{
    pl_accel_bvh.work_destroy(work);
}

/* Fronts of what isn't terrain, in the memory that terrains leave. */
static bool build(pl_scene *scene, pl_error *error)
{
    scene->terrain_bytes = scene->terrains->bytes;
    return !scene->terrains->fronts || pl_fronts_build(scene, error);
}

static void destroy(pl_scene *scene)
{
    pl_fronts_destroy(scene);
    pl_terrains_free(scene);
}

void pl_terrains_count(const pl_scene *scene, pl_statistics *counts)
{
    const pl_terrains *terrains = scene->terrains;
    if (terrains->fronts) pl_fronts_count(scene, counts);
    else counts->primitives = counts->depth = 0;
    counts->primitives = pl_add_saturating(counts->primitives, terrains->generated);
    for (uint32_t i = 0; i < terrains->count; i++) {
        const pl_terrain *terrain = &terrains->list[i];
        counts->depth = terrain->depth > counts->depth ? terrain->depth : counts->depth;
        counts->terrain_tiles += terrain->tiles;
        counts->terrain_triangles += terrain->leaves;
        counts->terrain_node_bytes += terrain->node_bytes;
    }
    counts->terrain_bytes = terrains->bytes - counts->terrain_node_bytes;
    counts->bytes_nodes += counts->terrain_node_bytes;
    counts->bytes_items += counts->terrain_bytes;
    counts->isa = scene->isa;
}

const pl_accel pl_accel_terrain = {.name = "bvh",
                                   .build = build,
                                   .destroy = destroy,
                                   .work_create = work_create,
                                   .work_destroy = work_destroy,
                                   .trace = trace,
                                   .trace_many = trace_many,
                                   .items = trail_items,
                                   .path = trail_path,
                                   .skip = skip};
