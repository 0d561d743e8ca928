/* terrain_fill.c - a terrain's tiles (terrain.h): which values they share, their values, their boxes, and the tree above.
 *
 * Which parameters of a tile are one value is learnt from tiles spread over the terrain: two are, if they are equal, bit by
 * bit, in every one of these. All tiles are then filled and compared with that, subtree by subtree among the threads; if one
 * differs, more are learnt from. So the classes depend on the scene alone. */
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "../random.h"
#include "terrain.h"

enum { FIRST_SAMPLES = 256, MORE_SAMPLES = 16, TASKS = 64, MOST_THREADS = 64, ROOM = PL_TERRAIN_TILE * PL_TERRAIN_CELLS };

/* --- which values are the same --- */

/* A tile's parameters: cells[leaf][cell] in one row. */
typedef struct sheet {
    uint32_t count, width;
    double cells[ROOM];
} sheet;

static bool take_cells(void *context, uint64_t leaf, const double *cells, const pl_transform *transform)
{
    sheet *s = context;
    (void)leaf, (void)transform;
    memcpy(s->cells + s->count, cells, s->width * sizeof *cells);
    s->count += s->width;
    return true;
}

static bool derive_sheet(const pl_terrain *terrain, pl_terrain_walk *w, uint64_t tile, sheet *s)
{
    s->count = 0;
    s->width = terrain->form.slots;
    return pl_terrain_derive(terrain, w, terrain->tile_level, tile, take_cells, s);
}

typedef struct cell {
    uint32_t class, place;
    uint64_t bits;
} cell;

static int compare_cells(const void *a, const void *b)
{
    const cell *x = a, *y = b;
    if (x->class != y->class) return x->class < y->class ? -1 : 1;
    if (x->bits != y->bits) return x->bits < y->bits ? -1 : 1;
    return (x->place > y->place) - (x->place < y->place);
}

/* Bits as they are: -0 isn't 0. */
static uint64_t exact_bits(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* Divides classes whose members differ in this tile; returns their number. */
static uint32_t refine(uint32_t *classes, const sheet *s)
{
    static _Thread_local cell cells[ROOM];
    uint32_t number = 0;
    for (uint32_t i = 0; i < s->count; i++) cells[i] = (cell){classes[i], i, exact_bits(s->cells[i])};
    qsort(cells, s->count, sizeof *cells, compare_cells);
    for (uint32_t i = 0; i < s->count; i++) {
        bool same = i && cells[i].class == cells[i - 1].class && cells[i].bits == cells[i - 1].bits;
        number += !same;
        classes[cells[i].place] = number - 1;
    }
    return number;
}

static int compare_hashes(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Tiles that recur are states that recur: fronts hold each of them once. */
static bool are_different(uint64_t *hashes, uint64_t count)
{
    qsort(hashes, count, sizeof *hashes, compare_hashes);
    for (uint64_t i = 1; i < count; i++)
        if (hashes[i] == hashes[i - 1]) return false;
    return true;
}

/* classes by cell, as the kernels read them, from those of a sheet's places. */
static void set_classes(pl_terrain *terrain, const uint32_t *found)
{
    const pl_terrain_form *form = &terrain->form;
    uint16_t renamed[ROOM];
    memset(renamed, 0xFF, sizeof renamed);
    terrain->values = 0;
    for (uint32_t leaf = 0; leaf < terrain->tile_row; leaf++) {
        uint32_t real = leaf < terrain->tile_leaves ? leaf : terrain->tile_leaves - 1;
        for (uint32_t c = 0; c < form->slots; c++) {
            uint16_t *name = &renamed[found[real * form->slots + c]];
            if (*name == UINT16_MAX) *name = (uint16_t)terrain->values++;
            terrain->classes[c * terrain->tile_row + leaf] = *name;
        }
    }
    terrain->stride = sizeof(pl_terrain_tile) + terrain->values * sizeof(double);
}

/* Learns the classes from `samples` tiles. */
static bool learn(pl_terrain *terrain, pl_terrain_walk *w, uint64_t samples)
{
    sheet *s = malloc(sizeof *s);
    uint64_t *hashes = malloc(samples * sizeof *hashes);
    uint32_t *found = malloc(ROOM * sizeof *found);
    bool ok = s && hashes && found;
    if (ok) memset(found, 0, ROOM * sizeof *found);
    for (uint64_t i = 0; ok && i < samples; i++) {
        if (!(ok = derive_sheet(terrain, w, i * (terrain->tiles - 1) / (samples - 1), s))) break;
        refine(found, s);
        hashes[i] = 0;
        for (uint32_t k = 0; k < s->count; k++) hashes[i] = pl_mix(hashes[i], exact_bits(s->cells[k]));
    }
    ok = ok && are_different(hashes, samples);
    if (ok) set_classes(terrain, found);
    free(s);
    free(hashes);
    free(found);
    return ok;
}

/* --- filling --- */

/* Upper bounds over all triangles, of which reach.h makes one for the terrain. */
typedef struct bounds {
    pl_box box;
    double stretch, inverse_stretch, move, lack;
} bounds;

typedef struct filler {
    pl_terrain *terrain;
    pl_terrain_walk walk;
    bounds bounds;
    pl_terrain_common common;
    bool set[ROOM];
    bool same, signed_zeros;
} filler;

static double length3(double x, double y, double z)
{
    return sqrt(x * x + y * y + z * z);
}

/* No singular value is larger. */
static double frobenius(const double *m)
{
    double sum = 0.0;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) sum += m[4 * r + c] * m[4 * r + c];
    return sqrt(sum) * (1.0 + 64.0 * DBL_EPSILON);
}

static void bound_triangle(bounds *b, const pl_transform *transform)
{
    const double *m = transform->to_parent.m;
    pl_affine product = pl_affine_multiply(&transform->to_parent, &transform->to_object);
    double lack = 0.0;
    for (int i = 0; i < 12; i++) lack = fmax(lack, fabs(product.m[i] - (i % 5 == 0 ? 1.0 : 0.0)));
    b->lack = fmax(b->lack, lack);
    b->stretch = fmax(b->stretch, frobenius(m));
    b->inverse_stretch = fmax(b->inverse_stretch, frobenius(transform->to_object.m));
    b->move = fmax(b->move, length3(m[3], m[7], m[11]));
    for (int axis = 0; axis < 3; axis++) {
        double at = m[4 * axis + 3], x = m[4 * axis], y = m[4 * axis + 1];
        b->box.lo[axis] = fmin(b->box.lo[axis], at + fmin(0.0, fmin(x, y)));
        b->box.hi[axis] = fmax(b->box.hi[axis], at + fmax(0.0, fmax(x, y)));
    }
}

static void join_bounds(bounds *a, const bounds *b)
{
    pl_box_join(&a->box, &b->box);
    a->stretch = fmax(a->stretch, b->stretch);
    a->inverse_stretch = fmax(a->inverse_stretch, b->inverse_stretch);
    a->move = fmax(a->move, b->move);
    a->lack = fmax(a->lack, b->lack);
}

/* Puts a triangle's values in their places; whoever comes second has to bring the same. */
static bool take_leaf(void *context, uint64_t leaf, const double *cells, const pl_transform *transform)
{
    filler *f = context;
    const pl_terrain *t = f->terrain;
    const uint32_t in_tile = (uint32_t)(leaf % t->tile_leaves);
    double *values = (double *)pl_terrain_tile_at(t, leaf / t->tile_leaves)->values;
    if (in_tile == 0) memset(f->set, 0, t->values * sizeof *f->set);
    for (uint32_t c = 0; c < t->form.slots; c++) {
        uint32_t class = t->classes[c * t->tile_row + in_tile];
        if (!f->set[class]) values[class] = cells[c];
        else if (exact_bits(values[class]) != exact_bits(cells[c])) f->same = false;
        f->signed_zeros = f->signed_zeros || pl_is_negative_zero(cells[c]);
        f->set[class] = true;
    }
    bound_triangle(&f->bounds, transform);
    pl_terrain_common_add(&f->common, t, &f->walk, cells);
    return f->same;
}

typedef struct job {
    pl_terrain *terrain;
    const pl_program *program;
    uint32_t level; /* subtrees of it are the tasks */
    uint64_t tasks;
    atomic_ullong next;
    atomic_bool departs, differs; /* the derivation from the shape; a tile from the classes */
    pthread_mutex_t lock;
    bounds bounds;
    pl_terrain_common common;
    bool signed_zeros;
} job;

static void *work(void *context)
{
    job *j = context;
    filler *f = malloc(sizeof *f);
    const bool begun = f && pl_terrain_walk_begin(&f->walk, j->program);
    const bool ready = f && pl_terrain_common_begin(&f->common, j->program->parameter_count) && begun;
    if (!ready) atomic_store(&j->departs, true);
    if (f) {
        f->terrain = j->terrain;
        f->signed_zeros = false;
        f->bounds = (bounds){.box = pl_box_empty()};
    }
    while (ready && !atomic_load(&j->departs) && !atomic_load(&j->differs)) {
        uint64_t task = atomic_fetch_add(&j->next, 1);
        if (task >= j->tasks) break;
        f->same = true;
        if (!pl_terrain_derive(j->terrain, &f->walk, j->level, task, take_leaf, f))
            atomic_store(f->same ? &j->departs : &j->differs, true);
    }
    if (ready) {
        pthread_mutex_lock(&j->lock);
        join_bounds(&j->bounds, &f->bounds);
        j->signed_zeros = j->signed_zeros || f->signed_zeros;
        pl_terrain_common_join(&j->common, &f->common);
        pthread_mutex_unlock(&j->lock);
    }
    if (f) {
        pl_terrain_walk_end(&f->walk);
        pl_terrain_common_free(&f->common);
    }
    free(f);
    return NULL;
}

/* Derives the whole terrain into its tiles. */
static void fill(const pl_scene *scene, job *j)
{
    pl_terrain *terrain = j->terrain;
    pthread_t threads[MOST_THREADS];
    int others = 0;
    j->program = scene->program;
    j->bounds = (bounds){.box = pl_box_empty()};
    j->tasks = 1;
    while (j->tasks < TASKS && j->level < terrain->tile_level) j->tasks *= terrain->radix[j->level++];
    pthread_mutex_init(&j->lock, NULL);
    while (others < scene->threads - 1 && others < MOST_THREADS &&
           pthread_create(&threads[others], NULL, work, j) == 0)
        others++;
    work(j);
    for (int i = 0; i < others; i++) pthread_join(threads[i], NULL);
    pthread_mutex_destroy(&j->lock);
}

/* --- boxes --- */

/* Quantises outward, by what the kernels make of it: lo + q * step. */
static uint8_t plane_below(float lo, float step, float x)
{
    int q = (int)((x - lo) / step);
    q = q < 0 ? 0 : q > 255 ? 255 : q;
    while (q > 0 && lo + (float)q * step > x) q--;
    return (uint8_t)q;
}

static uint8_t plane_above(float lo, float step, float x)
{
    int q = (int)((x - lo) / step);
    q = q < 0 ? 0 : q > 255 ? 255 : q;
    while (q < 255 && lo + (float)q * step < x) q++;
    return (uint8_t)q;
}

/* The corners of a triangle in the unit frame. */
static void find_corners(const pl_terrain *terrain, const double *values, uint32_t leaf, double corners[3][3])
{
    double cells[PL_TERRAIN_CELLS];
    pl_affine matrix;
    pl_terrain_cells(terrain, values, leaf, cells);
    pl_terrain_matrix(&terrain->form, cells, &matrix);
    for (int axis = 0; axis < 3; axis++) {
        const double *row = matrix.m + 4 * axis, at[3] = {row[3], row[3] + row[0], row[3] + row[1]};
        for (int i = 0; i < 3; i++)
            corners[i][axis] = (at[i] - terrain->front.centre[axis]) * terrain->front.scale;
    }
}

static void join_corners(pl_boxed *box, double corners[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int axis = 0; axis < 3; axis++) {
            box->lo[axis] = fminf(box->lo[axis], pl_round_down(corners[i][axis]));
            box->hi[axis] = fmaxf(box->hi[axis], pl_round_up(corners[i][axis]));
        }
}

static void set_corners(pl_terrain_tile *tile, uint32_t leaf, double corners[3][3])
{
    const uint32_t cluster = leaf / PL_TERRAIN_CLUSTER;
    for (int axis = 0; axis < 3; axis++) {
        const double lo = tile->planes[axis][cluster], part = (tile->planes[3 + axis][cluster] - lo) / 255.0;
        for (int i = 0; i < 3; i++) {
            double steps = (corners[i][axis] - (double)tile->lo[axis]) / (double)tile->step[axis];
            double q = part > 0.0 ? (steps - lo) / part + 0.5 : 0.0;
            tile->corners[cluster][3 * i + axis][leaf % PL_TERRAIN_CLUSTER] = (uint8_t)fmin(fmax(q, 0.0), 255.0);
        }
    }
}

/* A flat tile is LEAST_STEP high all the same, so that one can divide by it. */
#define LEAST_STEP 0x1p-30f

/* Boxes and corners of a tile, from its values. */
static void set_tile(const pl_terrain *terrain, uint64_t index, pl_boxed *box)
{
    static const pl_boxed nothing = {.lo = {INFINITY, INFINITY, INFINITY}, .hi = {-INFINITY, -INFINITY, -INFINITY}};
    pl_terrain_tile *tile = (pl_terrain_tile *)pl_terrain_tile_at(terrain, index);
    pl_boxed clusters[PL_TERRAIN_CLUSTERS];
    double corners[PL_TERRAIN_TILE][3][3];
    const uint32_t count = terrain->tile_row / PL_TERRAIN_CLUSTER;
    *box = nothing;
    for (uint32_t i = 0; i < count; i++) clusters[i] = nothing;
    for (uint32_t leaf = 0; leaf < terrain->tile_leaves; leaf++) {
        find_corners(terrain, tile->values, leaf, corners[leaf]);
        join_corners(&clusters[leaf / PL_TERRAIN_CLUSTER], corners[leaf]);
        join_corners(box, corners[leaf]);
    }
    box->ref = pl_ref_of(PL_KIND_TILE, (uint32_t)index);
    memset(tile->planes, 0, sizeof tile->planes);
    memset(tile->corners, 0, sizeof tile->corners);
    for (int axis = 0; axis < 3; axis++) {
        const float lo = tile->lo[axis] = box->lo[axis];
        float step = fmaxf((box->hi[axis] - lo) / 255.0f, LEAST_STEP);
        while (lo + 255.0f * step < box->hi[axis]) step = nextafterf(step, INFINITY);
        tile->step[axis] = step;
        for (uint32_t i = 0; i < count; i++) {
            tile->planes[axis][i] = plane_below(lo, step, clusters[i].lo[axis]);
            tile->planes[3 + axis][i] = plane_above(lo, step, clusters[i].hi[axis]);
        }
    }
    for (uint32_t leaf = 0; leaf < terrain->tile_leaves; leaf++) set_corners(tile, leaf, corners[leaf]);
}

/* pl_reach_through for all triangles at once: it rises with each of its arguments. */
static pl_reach reach_of(const bounds *b)
{
    const pl_reach leaf = pl_reach_leaf(1.4142135623730952);
    const double c = PL_REACH_ROUNDINGS, m = b->stretch, n = b->inverse_stretch, tau = b->move;
    pl_reach above = {.size = m * leaf.size + tau};
    above.gain = m * n * (c + leaf.gain) + 3.0 * b->lack / DBL_EPSILON;
    above.base = m * n * (c * (above.size + tau) + leaf.gain * tau) + m * leaf.base + c * (2.0 * m * leaf.size + tau) +
                 (3.0 * b->lack * above.size + 2.0 * b->lack) / DBL_EPSILON;
    return above;
}

static bool set_frame(pl_terrain *terrain, const bounds *b)
{
    pl_state_bounds bounds = {.box = b->box, .reach = reach_of(b)};
    pl_state state = {.bounds = &bounds};
    const pl_states states = {.list = &state};
    pl_front_set_frame(&terrain->front, &states, 0);
    terrain->front.wide = PL_TERRAIN_WIDE;
    return terrain->front.framed && isfinite(bounds.reach.base) && terrain->front.scale < 1e300;
}

/* Nodes on the longest way down a tree. */
static size_t height(const pl_front_node *nodes, pl_ref ref)
{
    size_t most = 0;
    if (ref >> PL_REF_SHIFT != PL_KIND_NODE) return 0;
    for (int i = 0; i < PL_FRONT_WIDTH; i++) {
        const size_t below = height(nodes, nodes[ref].child[i]);
        most = below > most ? below : most;
    }
    return 1 + most;
}

static bool build_tree(pl_terrain *terrain, int threads)
{
    pl_boxed *boxes = calloc(terrain->tiles, sizeof *boxes);
    uint32_t count;
    if (!boxes) return false;
    for (uint64_t i = 0; i < terrain->tiles; i++) set_tile(terrain, i, &boxes[i]);
    terrain->front.nodes = pl_front_tree(boxes, terrain->tiles, &count, &terrain->front.root, threads, false);
    free(boxes);
    if (!terrain->front.nodes) return false;
    terrain->node_bytes = count * sizeof *terrain->front.nodes;
    /* All but one child of each node on the way, and the eight that a node writes. */
    terrain->stack_need = (PL_FRONT_WIDTH - 1) * height(terrain->front.nodes, terrain->front.root) + PL_FRONT_WIDTH + 1;
    return true;
}

/* Rays jump about in large terrains; where there are large pages, finding a page's place is what they needn't wait for. */
static void *allocate_tiles(size_t bytes)
{
    enum { LARGE_PAGE = 1 << 21, LARGE_PAGES = 8 };
    if (bytes < (size_t)LARGE_PAGES * LARGE_PAGE) return aligned_alloc(64, (bytes + 63) & ~(size_t)63);
    size_t rounded = (bytes + LARGE_PAGE - 1) & ~(size_t)(LARGE_PAGE - 1);
    void *memory = aligned_alloc(LARGE_PAGE, rounded);
    if (memory) madvise(memory, rounded, MADV_HUGEPAGE);
    return memory;
}

/* found: among the parameters. */
static void settle_zeros(pl_terrain_form *form, bool found)
{
    for (uint32_t c = form->slots; c < form->cells; c++) found = found || pl_is_negative_zero(form->number[c]);
    form->signed_zeros = found;
}

/* What follows from all triangles together. */
static bool finish(const pl_scene *scene, pl_terrain *terrain, const job *j)
{
    settle_zeros(&terrain->form, j->signed_zeros);
    return set_frame(terrain, &j->bounds) && pl_terrain_end_set(terrain, &j->common) && build_tree(terrain, scene->threads);
}

/* Room for the tiles, and in the limit for the tree: its boxes while it is built, and nodes that have five children or more. */
static bool make_room(pl_terrain *terrain, size_t limit, double *lacking)
{
    const size_t a_tile = terrain->stride + sizeof(pl_boxed) + 2 * sizeof(pl_front_node) / 4;
    free(terrain->memory);
    terrain->memory = NULL;
    if (terrain->tiles > limit / a_tile) *lacking = (double)terrain->tiles * (double)a_tile - (double)limit;
    return terrain->tiles <= PL_REF_INDEX / PL_TERRAIN_CLUSTERS && terrain->tiles <= limit / a_tile &&
           (terrain->memory = allocate_tiles(terrain->tiles * terrain->stride));
}

bool pl_terrain_fill(const pl_scene *scene, pl_terrain *terrain, size_t limit, double *lacking)
{
    *lacking = 0.0;
    pl_terrain_walk w;
    uint64_t samples = terrain->tiles < FIRST_SAMPLES ? terrain->tiles : FIRST_SAMPLES;
    bool ok = pl_terrain_walk_begin(&w, scene->program), done = false;
    terrain->classes = calloc(terrain->form.slots * terrain->tile_row, sizeof *terrain->classes);
    ok = ok && terrain->classes;
    while (ok && !done) {
        job j = {.terrain = terrain};
        ok = pl_terrain_common_begin(&j.common, scene->program->parameter_count) && learn(terrain, &w, samples) &&
             make_room(terrain, limit, lacking);
        if (ok) fill(scene, &j);
        ok = ok && !atomic_load(&j.departs);
        done = ok && !atomic_load(&j.differs);
        if (done) ok = finish(scene, terrain, &j);
        pl_terrain_common_free(&j.common);
        samples = samples > terrain->tiles / MORE_SAMPLES ? terrain->tiles : samples * MORE_SAMPLES;
    }
    pl_terrain_walk_end(&w);
    return ok;
}
