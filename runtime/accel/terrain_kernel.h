/* terrain_kernel.h - the traversal of a terrain's tree, tiles and clusters (terrain.h), compiled once for each instruction set
 * by the kernel_*.c, below kernel.h, whose frames and nodes it uses. TERRAIN_KERNEL is the name of the function.
 *
 * All filters in single precision; what is left, hardly ever more than one triangle a hit, is evaluated normatively. */
#include "terrain.h"

/* Eight numbers at once, lowered to what there is; they don't leave this file. */
#pragma GCC diagnostic ignored "-Wpsabi"
typedef float float8 __attribute__((vector_size(32)));
typedef int32_t int8 __attribute__((vector_size(32)));

/* Bit i: number i is negative. */
static inline unsigned eight_signs(int8 x)
{
#ifdef __AVX2__
    return (unsigned)_mm256_movemask_ps((__m256)x);
#else
    unsigned bits = 0;
    for (int i = 0; i < 8; i++) bits |= (unsigned)(x[i] < 0) << i;
    return bits;
#endif
}

static inline float8 eight_bytes(const uint8_t *from)
{
    const wide bytes = wide_bytes(from);
    float8 x;
    memcpy(&x, &bytes, sizeof x);
    return x;
}

static inline float8 eight_absolute(float8 x)
{
    return (float8)((int8)x & INT32_MAX);
}

static inline void cross(const float8 a[3], const float8 b[3], float8 out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline float8 dot(const float8 a[3], const float8 b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* How much from·b changes where `from` is moved by no more than the margin along each axis. */
static inline float8 spread(const float margin[3], const float8 b[3])
{
    return margin[0] * eight_absolute(b[0]) + margin[1] * eight_absolute(b[1]) + margin[2] * eight_absolute(b[2]);
}

/* A ray in a tile's steps, from the point next to the tile's low corner, which it passes at t0. */
typedef struct sight {
    float o[3], d[3], margin[3], t0;
    float side, depth; /* rounding of the products below, as much as it could be */
} sight;

/* margin: of the ray. Rounding: the sides are sums of three products of numbers up
 * to size, length and 255, the depths of those up to size, 255 and 255; 2^-20 is sixteen roundings. */
static inline sight sight_of(const pl_frame *f, float inverse_square, const pl_terrain_tile *tile)
{
    sight s = {.t0 = 0.0f};
    float size = 3.0f * 255.0f, length = 0.0f;
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) s.t0 += (tile->lo[axis] - f->origin[axis]) * f->direction[axis];
    s.t0 *= inverse_square;
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        const float steps = 1.0f / tile->step[axis];
        s.o[axis] = (f->origin[axis] + s.t0 * f->direction[axis] - tile->lo[axis]) * steps;
        s.d[axis] = f->direction[axis] * steps;
        s.margin[axis] = f->slack * steps;
        size += __builtin_fabsf(s.o[axis]);
        length += __builtin_fabsf(s.d[axis]);
    }
    s.side = 0x1p-20f * size * length * 255.0f;
    s.depth = 0x1p-19f * size * 255.0f * 255.0f;
    return s;
}

/* Which of a cluster's triangles can have a root in (0, t_max) of the frame, as bits; *certain: which must, where that is asked
 * for. Möller & Trumbore, "Fast, minimum storage ray/triangle intersection" (1997), without the division.
 *
 * Where the ray meets a triangle normatively, another one beside it by no more than the margin meets the triangle of rounded
 * corners; the products of three vectors change by the spread. NaN rules nothing out. */
static inline unsigned filter_eight(const sight *ray, const pl_terrain_tile *tile, uint32_t cluster, float t_max, bool any,
                                    unsigned *certain)
{
    const uint8_t (*corners)[PL_TERRAIN_CLUSTER] = tile->corners[cluster];
    sight s = *ray;
    float8 x[3], y[3], from[3], d[3], across_x[3], across_y[3], normal[3];
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        const float lo = tile->planes[axis][cluster], part = ((float)tile->planes[3 + axis][cluster] - lo) * (1.0f / 255.0f);
        const float8 corner = eight_bytes(corners[axis]);
        x[axis] = (eight_bytes(corners[3 + axis]) - corner) * part;
        y[axis] = (eight_bytes(corners[6 + axis]) - corner) * part;
        from[axis] = (s.o[axis] - lo) - corner * part;
        s.margin[axis] += 0.51f * part + 0x1p-10f;
        d[axis] = s.d[axis] - (float8){0};
    }
    cross(d, y, across_y);
    cross(x, d, across_x);
    cross(x, y, normal);
    float8 volume = dot(x, across_y), u = dot(from, across_y), v = dot(from, across_x), t = dot(from, normal);
    const float8 u_slack = spread(s.margin, across_y) + s.side, v_slack = spread(s.margin, across_x) + s.side;
    const float8 t_slack = spread(s.margin, normal) + s.depth, both_slack = u_slack + v_slack;
    const int8 turn = (int8)volume & INT32_MIN;
    volume = (float8)((int8)volume ^ turn);
    u = (float8)((int8)u ^ turn);
    v = (float8)((int8)v ^ turn);
    t = (float8)((int8)t ^ turn) + s.t0 * volume;
    const int8 out = (u < -u_slack) | (v < -v_slack) | (u + v > volume + both_slack) | (t < -t_slack) |
                     (t - t_slack > t_max * volume);
    if (any) {
        const float last = t_max * (1.0f - 0x1p-18f);
        const int8 in = (u > u_slack) & (v > v_slack) & (u + v < volume - both_slack) & (t > t_slack) &
                        (t + t_slack < last * volume);
        *certain = eight_signs(in);
    }
    return ~eight_signs(out) & 0xFF;
}

/* What a ray is traced through, and the ray in its frame. */
typedef struct target {
    const pl_terrain *terrain;
    const pl_frame *frame;
    const double *o, *d;
    float inverse_square; /* of the frame's direction */
} target;

/* Writes the clusters of a tile that the ray meets, the nearest last; returns their number. */
static inline unsigned meet_tile(const near *n, const pl_terrain_tile *tile, uint64_t *entries, uint32_t *nearest)
{
    static const pl_ref clusters[PL_FRONT_WIDTH] = {0, 1, 2, 3, 4, 5, 6, 7};
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
    return wide_order(enter, leave, clusters, entries, nearest);
}

/* Tests a cluster's triangles; -1: an error, 1: the query is done. */
static inline int visit_cluster(pl_tracer *tracer, const target *at, const sight *s, uint32_t tile, uint32_t cluster, float t_max,
                                pl_query *query, bool any)
{
    const pl_terrain *terrain = at->terrain;
    const uint32_t first = cluster * PL_TERRAIN_CLUSTER;
    unsigned certain = 0, left;
    if (first >= terrain->tile_leaves) return 0;
    left = filter_eight(s, pl_terrain_tile_at(terrain, tile), cluster, t_max, any, &certain);
    if (first + PL_TERRAIN_CLUSTER > terrain->tile_leaves) {
        left &= (1u << (terrain->tile_leaves - first)) - 1;
        certain &= left;
    }
    tracer->counters.filtered += PL_TERRAIN_CLUSTER;
    if (any && certain) {
        query->found = query->done = true;
        return 1;
    }
    for (; left; left &= left - 1) {
        wide_end();
        if (!pl_terrain_candidate(tracer, terrain, tile, first + (uint32_t)__builtin_ctz(left), at->o, at->d, query)) return -1;
        if (query->done) return 1;
    }
    return 0;
}

/* Tests the clusters of a tile, the nearest first; the same answers. */
static inline int visit_tile(pl_tracer *tracer, const target *at, near *n, uint32_t index, pl_query *query, bool any)
{
    const pl_terrain_tile *tile = pl_terrain_tile_at(at->terrain, index);
    uint64_t entries[PL_TERRAIN_CLUSTERS];
    uint32_t cluster;
    /* Much of it will be looked at one after another: better wait once. */
    for (size_t line = 0; line < at->terrain->stride; line += 64) __builtin_prefetch((const char *)tile + line);
    unsigned count = meet_tile(n, tile, entries, &cluster);
    if (count == 0) return 0;
    const sight s = sight_of(at->frame, at->inverse_square, tile);
    for (;;) {
        int done = visit_cluster(tracer, at, &s, index, cluster, n->t_max, query, any);
        if (done) return done;
        n->t_max = local_t_max(at->frame, query->t_max);
        if (--count == 0 || entry_is_beyond(entries[count - 1], n->t_max)) return 0;
        cluster = (uint32_t)entries[count - 1];
    }
}

static inline bool visit_terrain(pl_tracer *tracer, const target *at, pl_query *query, bool any)
{
    pl_bvh_work *w = tracer->work;
    size_t top = 0;
    uint64_t steps = 0, *stack = w->stack;
    int done = 0;
    near n;
    look(&n, at->frame);
    n.t_max = local_t_max(at->frame, query->t_max);
    stack[top++] = entry_of(0.0f, at->terrain->front.root);
    while (top && !done) {
        const uint64_t entry = stack[--top];
        pl_ref ref = (pl_ref)entry;
        if (entry_is_beyond(entry, n.t_max)) continue;
        while (ref >> PL_REF_SHIFT == PL_KIND_NODE) {
            unsigned count = meet(&n, &at->terrain->front.nodes[ref], stack + top, &ref);
            steps++;
            if (count == 0) goto next;
            top += count - 1;
            if (top + 16 > w->stack_capacity) {
                if (!pl_bvh_grow_stack(w, top, query->error)) return false;
                stack = w->stack;
            }
        }
        steps++;
        done = visit_tile(tracer, at, &n, ref & PL_REF_INDEX, query, any);
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
        const float *v = f->direction;
        const target at = {terrain, f, o, d, 1.0f / (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])};
        ok = query->kind == PL_QUERY_ANY ? visit_terrain(tracer, &at, query, true)
                                         : visit_terrain(tracer, &at, query, false);
    }
    wide_end();
    return ok;
}
