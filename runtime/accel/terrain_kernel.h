/* terrain_kernel.h - the traversal of a terrain's tree, tiles and clusters (terrain.h), compiled once for each instruction set
 * by the kernel_*.c, below kernel.h, whose frames and nodes it uses. TERRAIN_KERNEL is the name of the function.
 *
 * Boxes filter in single precision, triangles in double and eight at a time; what is left, hardly ever more than one a hit,
 * is evaluated normatively. */
#include "terrain.h"

/* Eight numbers at once, lowered to what there is; they don't leave this file. */
#pragma GCC diagnostic ignored "-Wpsabi"
typedef double double8 __attribute__((vector_size(64)));
typedef int64_t long8 __attribute__((vector_size(64)));

/* Bit i: number i is negative. */
static inline unsigned eight_signs(long8 x)
{
#if defined(__AVX512DQ__)
    return _mm512_movepi64_mask((__m512i)x);
#elif defined(__AVX2__)
    __m256d half[2];
    memcpy(half, &x, sizeof half);
    return (unsigned)_mm256_movemask_pd(half[0]) | (unsigned)_mm256_movemask_pd(half[1]) << 4;
#else
    unsigned bits = 0;
    for (int i = 0; i < 8; i++) bits |= (unsigned)(x[i] < 0) << i;
    return bits;
#endif
}

static inline double8 eight(double x)
{
    return x - (double8){0};
}

/* A ray among the triangles, in the terrain's frame. */
typedef struct sight {
    double8 cells[PL_TERRAIN_CELLS]; /* of the eight triangles looked at */
    const pl_terrain *terrain;
    const double *o, *d;
    double across, along; /* rounding, as much as it could be, of the side of an edge and of the distance */
} sight;

/* Where no normative hit lies farther from its triangle than `slack`, o may be moved by it and the ray then meets the
 * triangle exactly. That changes the products below by slack · |d| · edge and slack · edge²; slack holds their own rounding too. */
static inline void begin_sight(sight *s, const pl_terrain *terrain, const double o[3], const double d[3])
{
    const pl_reach *reach = &terrain->front.reach;
    const pl_terrain_form *form = &terrain->form;
    double distance = __builtin_fabs(o[0]) + __builtin_fabs(o[1]) + __builtin_fabs(o[2]);
    double size = __builtin_fabs(d[0]) + __builtin_fabs(d[1]) + __builtin_fabs(d[2]);
    double slack = DBL_EPSILON * 2.0 * (reach->gain * distance + reach->base) + 0x1p-44 * (distance + reach->size);
    s->terrain = terrain;
    s->o = o;
    s->d = d;
    s->across = 4.0 * slack * size * terrain->edge;
    s->along = 4.0 * slack * terrain->edge * terrain->edge;
    for (uint32_t c = form->slots; c < form->cells; c++) s->cells[c] = eight(form->number[c]);
}

/* The cells of a cluster's triangles. */
static inline void load_cells(sight *s, const double *values, uint32_t leaf)
{
    const pl_terrain *terrain = s->terrain;
    const uint16_t *class = terrain->classes + leaf;
    for (uint32_t c = 0; c < terrain->form.slots; c++, class += terrain->tile_row)
        s->cells[c] = (double8){values[class[0]], values[class[1]], values[class[2]], values[class[3]],
                                values[class[4]], values[class[5]], values[class[6]], values[class[7]]};
}

/* Which of eight triangles can have a root in (t_min, t_max), as bits; *certain: which must. Möller & Trumbore, "Fast, minimum
 * storage ray/triangle intersection" (1997), without the division. NaN rules nothing out. */
static inline unsigned filter_eight(const sight *s, double t_min, double t_max, unsigned *certain)
{
    const pl_terrain_form *form = &s->terrain->form;
    const double8 *cells = s->cells;
    const double *d = s->d;
    double8 x[3], y[3], from[3];
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        x[axis] = cells[form->plus[axis]] - cells[form->minus[axis]];
        y[axis] = cells[form->plus[3 + axis]] - cells[form->minus[3 + axis]];
        from[axis] = s->o[axis] - (cells[form->plus[9 + axis]] - cells[form->minus[9 + axis]]);
    }
    const double8 p[3] = {d[1] * y[2] - d[2] * y[1], d[2] * y[0] - d[0] * y[2], d[0] * y[1] - d[1] * y[0]};
    const double8 q[3] = {from[1] * x[2] - from[2] * x[1], from[2] * x[0] - from[0] * x[2], from[0] * x[1] - from[1] * x[0]};
    double8 volume = x[0] * p[0] + x[1] * p[1] + x[2] * p[2], u = from[0] * p[0] + from[1] * p[1] + from[2] * p[2];
    double8 v = d[0] * q[0] + d[1] * q[1] + d[2] * q[2], t = y[0] * q[0] + y[1] * q[1] + y[2] * q[2];
    const long8 turn = (long8)volume & INT64_MIN;
    volume = (double8)((long8)volume ^ turn);
    u = (double8)((long8)u ^ turn);
    v = (double8)((long8)v ^ turn);
    t = (double8)((long8)t ^ turn);
    const double across = s->across, along = s->along;
    const double8 first = t_min * volume, last = t_max * volume, side = u + v;
    const long8 out = (u < -across) | (v < -across) | (side > volume + across) | (t + along < first) | (t - along > last);
    const long8 in = (u > across) & (v > across) & (side < volume - across) & (t - along > first) & (t + along < last);
    *certain = eight_signs(in);
    return ~eight_signs(out) & 0xFF;
}

/* Writes the clusters of a tile that the ray meets, the nearest last; returns their number. */
static inline unsigned meet_tile(const near *n, const pl_terrain_tile *tile, uint32_t index, uint64_t *entries, pl_ref *nearest)
{
    static const pl_ref lanes[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    wide near_t[3], far_t[3];
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        const wide lo = wide_set(tile->lo[axis]);
        const wide step = wide_multiply_subtract(wide_set(tile->step[axis]), n->inverse[axis], wide_set(0.0f));
        near_t[axis] = wide_multiply_add(wide_bytes(tile->planes[0] + n->near_row[axis]), step,
                                         wide_multiply_subtract(lo, n->inverse[axis], n->near_base[axis]));
        far_t[axis] = wide_multiply_add(wide_bytes(tile->planes[0] + n->far_row[axis]), step,
                                        wide_multiply_subtract(lo, n->inverse[axis], n->far_base[axis]));
    }
    wide enter = wide_max(wide_max(near_t[0], near_t[1]), wide_max(near_t[2], wide_set(0.0f)));
    wide leave = wide_min(wide_min(far_t[0], far_t[1]), wide_min(far_t[2], wide_set(n->t_max)));
    const pl_ref first = pl_ref_of(PL_KIND_CLUSTER, index * PL_TERRAIN_CLUSTERS);
    unsigned count = wide_order(enter, leave, lanes, entries, nearest);
    *nearest += first;
    for (unsigned i = 0; i + 1 < count; i++) entries[i] += first;
    return count;
}

/* Tests a cluster's triangles; -1: an error, 1: the query is done. */
static inline int visit_cluster(pl_tracer *tracer, sight *s, uint32_t index, pl_query *query, bool any)
{
    const pl_terrain *terrain = s->terrain;
    const uint64_t tile = index / PL_TERRAIN_CLUSTERS;
    const uint32_t leaf = index % PL_TERRAIN_CLUSTERS * PL_TERRAIN_CLUSTER;
    unsigned certain, left;
    if (leaf >= terrain->tile_leaves) return 0;
    load_cells(s, pl_terrain_tile_at(terrain, tile)->values, leaf);
    left = filter_eight(s, query->t_min, query->t_max, &certain);
    if (leaf + PL_TERRAIN_CLUSTER > terrain->tile_leaves) {
        left &= (1u << (terrain->tile_leaves - leaf)) - 1;
        certain &= left;
    }
    tracer->counters.filtered += PL_TERRAIN_CLUSTER;
    if (any && certain) {
        query->found = query->done = true;
        return 1;
    }
    for (; left; left &= left - 1) {
        wide_end();
        if (!pl_terrain_candidate(tracer, terrain, tile, leaf + (uint32_t)__builtin_ctz(left), s->o, s->d, query)) return -1;
        if (query->done) return 1;
    }
    return 0;
}

static inline bool visit_terrain(pl_tracer *tracer, sight *s, pl_query *query, bool any)
{
    const pl_terrain *terrain = s->terrain;
    pl_bvh_work *w = tracer->work;
    const pl_frame *f = &w->frames[0];
    size_t top = 0;
    uint64_t steps = 0, *stack = w->stack;
    int done = 0;
    near n;
    look(&n, f);
    n.t_max = local_t_max(f, query->t_max);
    stack[top++] = entry_of(0.0f, terrain->front.root);
    while (top && !done) {
        uint64_t at = stack[--top];
        pl_ref ref = (pl_ref)at;
        if (entry_is_beyond(at, n.t_max)) continue;
        while (ref >> PL_REF_SHIFT != PL_KIND_CLUSTER) {
            const uint32_t index = ref & PL_REF_INDEX;
            const bool is_tile = ref >> PL_REF_SHIFT == PL_KIND_TILE;
            unsigned count = is_tile ? meet_tile(&n, pl_terrain_tile_at(terrain, index), index, stack + top, &ref)
                                     : meet(&n, &terrain->front.nodes[index], stack + top, &ref);
            steps++;
            if (count == 0) goto next;
            top += count - 1;
            if (top + 16 > w->stack_capacity) {
                if (!pl_bvh_grow_stack(w, top, query->error)) return false;
                stack = w->stack;
            }
        }
        done = visit_cluster(tracer, s, ref & PL_REF_INDEX, query, any);
        n.t_max = local_t_max(f, query->t_max);
    next:;
    }
    tracer->counters.box_tests += steps * PL_FRONT_WIDTH;
    return done >= 0;
}

bool TERRAIN_KERNEL(pl_tracer *tracer, const pl_terrain *terrain, const double o[3], const double d[3], pl_query *query)
{
    pl_bvh_work *w = tracer->work;
    pl_frame *f = &w->frames[0];
    const pl_front *front = &terrain->front;
    const double4 origin = {o[0], o[1], o[2]}, direction = {d[0], d[1], d[2]};
    const double4 from = (origin - *(const double4 *)front->centre) * front->scale, along = direction * front->scale;
    float local_max = 1e30f;
    bool ok = true;
    f->front = front;
    f->error = 0.0f;
    f->distance = (float)__builtin_fabs(from[0]) + (float)__builtin_fabs(from[1]) + (float)__builtin_fabs(from[2]);
    f->distance *= 1.0f + 0x1p-20f;
    f->t0 = query->t_min;
    f->rate = 1.0;
    if (begin_frame(f, from + query->t_min * along, along, query->t_max, &local_max)) {
        sight s;
        begin_sight(&s, terrain, o, d);
        ok = query->kind == PL_QUERY_ANY ? visit_terrain(tracer, &s, query, true)
                                         : visit_terrain(tracer, &s, query, false);
    }
    wide_end();
    return ok;
}
