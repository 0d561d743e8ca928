/* terrain.h - regular subdivisions: landscapes whose triangles cost bytes.
 *
 * A patch that becomes k patches, level after level, all different, ends in N = k^n triangles that share next to nothing
 * as states. What they share is their shape: the subdivision is a complete tree, so a triangle's number tells its path, and
 * each triangle's matrix is made of the same few parameters (`matrix xb - xa, …`), whose values recur in its neighbours.
 *
 *     tile     a subtree of at most 64 triangles: a table of the distinct values of their parameters, in double
 *     classes  one for all tiles: which value of the table is which triangle's which parameter
 *     cluster  eight triangles that follow one another; a tile has their boxes and corners in 8 bits a coordinate, to filter
 *     front    a tree of boxes over the tiles, as front.h has it
 *
 * What else a scene has is in fronts of its own (bvh.c), and rays go through both.
 *
 * A matrix made from a tile's values has the bits that the derivation gives it: every triangle was compared when the tiles
 * were filled. So hits are normative and nothing is derived while tracing.
 *
 *     terrain_find.c  scene -> terrains, or none      terrain_fill.c  terrain -> tiles      terrain.c  rays -> hits
 *     terrain_end.c  what is known of a triangle's last symbol
 *     terrain_kernel.h  the traversal, for an instruction set each      terrain_packet.h  the same of many rays
 *
 * Example: 2,097,152 triangles with heights of their own and shared edges take 18.8 bytes each, tree included. */
#ifndef PL_TERRAIN_H
#define PL_TERRAIN_H

#include <string.h>

#include "front.h"

enum {
    PL_TERRAIN_CELLS = 25, /* a number or parameter each: 12 differences have two at most, and there is 0 */
    PL_TERRAIN_TILE = 64,
    PL_TERRAIN_CLUSTER = 8,
    PL_TERRAIN_CLUSTERS = PL_TERRAIN_TILE / PL_TERRAIN_CLUSTER,
    PL_TERRAIN_LEVELS = 40,
    PL_TERRAIN_MOST = 1 << 24, /* triangles: more take too long before the first ray */
    PL_KIND_TILE = 1 /* of references in a terrain's tree */
};

/* As far apart in the unit frame rays of a packet may be. */
#define PL_TERRAIN_WIDE 0.5f

/* The triangles' transformation: number i of its matrix (pl_affine) is cell plus[i] - cell minus[i]. */
typedef struct pl_terrain_form {
    uint32_t node;         /* transform_code */
    uint32_t slots, cells; /* the first `slots` cells are parameters, the others numbers */
    uint32_t slot[PL_TERRAIN_CELLS];
    double number[PL_TERRAIN_CELLS];
    uint8_t plus[12], minus[12];
    pl_affine fixed;      /* the numbers of the matrix that no parameter goes into … */
    uint8_t variable[12]; /* … and where the others stand */
    uint32_t variables;
    bool signed_zeros; /* some cells may be -0 */
} pl_terrain_form;

/* Planes are in the unit frame: q lies at lo + q * step, rows are those of pl_front_node. Corners are in their cluster's box,
 * which is 255 wide, each the whole number next to it. They stand by cluster: x, y and z of where the matrix brings the
 * origin, (1, 0, 0) and (0, 1, 0), of eight triangles each. */
typedef struct pl_terrain_tile {
    float lo[3], step[3];
    uint8_t planes[6][PL_TERRAIN_CLUSTERS];
    uint8_t corners[PL_TERRAIN_CLUSTERS][9][PL_TERRAIN_CLUSTER];
    double values[];
} pl_terrain_tile;

/* What the scene has at its root: a shape or mesh of its own, or a terrain. */
typedef struct pl_terrain_place {
    pl_transform *transforms; /* outermost first */
    uint32_t *terms;          /* from the root */
    uint32_t transform_count, term_count;
    bool no_shadow;
    uint64_t first; /* the number of its first primitive */
} pl_terrain_place;

/* The last symbol on the way to each triangle, and what parameters have on the way into it: as far as that is known without
 * deriving what stands above, shading a triangle needn't. */
typedef struct pl_terrain_end {
    bool known;
    uint32_t symbol;
    int32_t rule;    /* of the reference to it */
    uint8_t *cells;  /* by slot: the cell with the parameter's value, or PL_TERRAIN_CELLS … */
    double *values;  /* … if it has this one always; NaN: none, or not known */
} pl_terrain_end;

typedef struct pl_terrain {
    pl_terrain_place place;
    uint32_t entered; /* symbols that the scene enters before its own */
    uint32_t symbol;
    uint64_t *scope; /* packed, on the way into the symbol */
    uint32_t levels, radix[PL_TERRAIN_LEVELS]; /* terms of each union on the way down */
    uint8_t shift[PL_TERRAIN_LEVELS];          /* radix = 2^shift; 0: it is none */
    uint32_t depth;      /* symbols entered, its own included */
    uint64_t leaves;
    uint32_t tile_level; /* unions above a tile */
    uint32_t tile_leaves;
    uint64_t tiles;
    pl_terrain_form form;
    uint16_t *classes;   /* [cell][tile_row]: which value is the parameter */
    uint32_t tile_row;   /* tile_leaves, filled up to whole clusters */
    uint32_t values;     /* of a tile */
    size_t stride;       /* bytes of a tile */
    pl_terrain_end end;
    unsigned char *memory;
    pl_front front;      /* its tree's leaves are tiles */
    size_t node_bytes;
    size_t stack_need;   /* entries that a ray's stack in the tree has at most */
} pl_terrain;

typedef struct pl_terrain_single {
    pl_terrain_place place;
    uint32_t shape;
    const pl_mesh_tree *mesh; /* NULL: a shape */
    double arguments[PL_SHAPE_ARGUMENTS];
} pl_terrain_single;

/* Where the scene has other symbols as well, or many single shapes, fronts have all but the terrains. */
typedef struct pl_terrains {
    pl_terrain *list;
    pl_terrain_single *singles; /* none where there are fronts */
    uint32_t count, single_count;
    bool fronts;
    uint64_t generated;
    size_t bytes;
} pl_terrains;

static inline const pl_terrain_tile *pl_terrain_tile_at(const pl_terrain *terrain, uint64_t tile)
{
    return (const pl_terrain_tile *)(terrain->memory + tile * terrain->stride);
}

static inline bool pl_is_negative_zero(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits == UINT64_C(1) << 63;
}

/* A triangle's matrix from its cells. It is the identity times what its operation says (expression.c): that changes nothing but
 * the sign of a zero, so only then it is multiplied. A difference is -0 only if a cell is. */
static inline void pl_terrain_matrix(const pl_terrain_form *form, const double *cells, pl_affine *matrix)
{
    *matrix = form->fixed;
    for (uint32_t k = 0; k < form->variables; k++) {
        const uint32_t i = form->variable[k];
        matrix->m[i] = cells[form->plus[i]] - cells[form->minus[i]];
    }
    if (!form->signed_zeros) return;
    const pl_affine identity = pl_affine_identity();
    bool found = false;
    for (int i = 0; i < 12; i++) found = found || pl_is_negative_zero(matrix->m[i]);
    if (found) *matrix = pl_affine_multiply(&identity, matrix);
}

/* The cells of a triangle of a tile. */
static inline void pl_terrain_cells(const pl_terrain *terrain, const double *values, uint32_t leaf, double *cells)
{
    const pl_terrain_form *form = &terrain->form;
    for (uint32_t c = 0; c < form->slots; c++) cells[c] = values[terrain->classes[c * terrain->tile_row + leaf]];
    for (uint32_t c = form->slots; c < form->cells; c++) cells[c] = form->number[c];
}

/* --- terrain_find.c --- */

/* A thread's working memory to derive parts of a terrain, and what it saw last. */
typedef struct pl_terrain_walk {
    pl_walk walk;
    pl_scope scope;
    pl_path path;
    double *entering;    /* the parameters at the last enter node */
    uint32_t symbol, terms;
    int32_t rule;
    bool textured;       /* ever, above a last symbol */
} pl_terrain_walk;
bool pl_terrain_walk_begin(pl_terrain_walk *w, const pl_program *program);
void pl_terrain_walk_end(pl_terrain_walk *w);

/* Derives the triangles below union `index` of a level, in order; false: the derivation departs from the terrain's shape, or take
 * returned false. */
typedef bool pl_terrain_take(void *context, uint64_t leaf, const double *cells, const pl_transform *transform);
bool pl_terrain_derive(const pl_terrain *terrain, pl_terrain_walk *w, uint32_t level, uint64_t index,
                       pl_terrain_take *take, void *context);

/* Whether the scene has terrains that pay; then it has scene->terrains, and states of what else there is, of which there are
 * no more than most. Terrains that don't fit are an error: unfolded on touch, each triangle has a class of its own. */
bool pl_terrains_build(pl_scene *scene, uint32_t most, pl_error *error);
void pl_terrains_free(pl_scene *scene);

/* --- terrain_end.c --- */

/* What triangles have had in common so far: slots by slot a bit for each cell that has the value, and one above for that
 * being `values`. */
typedef struct pl_terrain_common {
    uint32_t count; /* of parameters */
    bool any, same;
    uint32_t symbol;
    int32_t rule;
    uint32_t *agree;
    double *values;
} pl_terrain_common;
bool pl_terrain_common_begin(pl_terrain_common *common, uint32_t parameters);
void pl_terrain_common_free(pl_terrain_common *common);

/* Adds the triangle whose primitive the walk stands at. */
void pl_terrain_common_add(pl_terrain_common *common, const pl_terrain *terrain, const pl_terrain_walk *w, const double *cells);
void pl_terrain_common_join(pl_terrain_common *common, const pl_terrain_common *other);

/* Sets terrain->end. false: no memory. */
bool pl_terrain_end_set(pl_terrain *terrain, const pl_terrain_common *common);

/* Moves a walk from the terrain's symbol to the last one above a triangle (pl_accel.skip). */
void pl_terrain_end_skip(const pl_terrain *terrain, uint32_t leaf, pl_walk *walk);

/* --- terrain_fill.c --- */

/* Derives a terrain into tiles, in at most `limit` bytes. false: it isn't one, or doesn't pay, or so many bytes are lacking. */
bool pl_terrain_fill(const pl_scene *scene, pl_terrain *terrain, size_t limit, double *lacking);

/* --- terrain.c --- */

void pl_terrains_count(const pl_scene *scene, pl_statistics *counts);

typedef bool pl_terrain_kernel(pl_tracer *tracer, const pl_terrain *terrain, const double o[3], const double d[3],
                               pl_query *query);
extern pl_terrain_kernel pl_terrain_trace_scalar, pl_terrain_trace_avx2, pl_terrain_trace_avx512;

/* The foremost hits of up to PL_LANES rays, which are in the terrain's frame. */
typedef bool pl_terrain_packet(pl_tracer *tracer, const pl_terrain *terrain, const pl_ray *rays, pl_query *queries,
                               unsigned count);
extern pl_terrain_packet pl_terrain_packet_avx2;

/* Evaluates a triangle normatively and offers it; o, d: the ray in the terrain's frame. false: an error. */
bool pl_terrain_candidate(pl_tracer *tracer, const pl_terrain *terrain, uint64_t tile, uint32_t leaf, const double o[3],
                          const double d[3], pl_query *query);

#endif
