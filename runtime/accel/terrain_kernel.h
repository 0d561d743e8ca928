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
    float o[3], d[3], t0;
    float side, depth; /* rounding of the products below, as much as it could be */
} sight;

/* Rounding: the sides are sums of three products of numbers up to size, length and 255, the depths of those up to size,
 * 255 and 255; 2^-20 is sixteen roundings. */
#define SIDE_ROUNDING (0x1p-20f * 255.0f)
#define DEPTH_ROUNDING (0x1p-19f * 255.0f * 255.0f)
#define LEAST_SIZE (3.0f * 255.0f)

static inline sight sight_of(const pl_frame *f, float inverse_square, const float steps[3], const pl_terrain_tile *tile)
{
    sight s = {.t0 = 0.0f};
    float size = LEAST_SIZE, length = 0.0f;
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) s.t0 += (tile->lo[axis] - f->origin[axis]) * f->direction[axis];
    s.t0 *= inverse_square;
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        s.o[axis] = (f->origin[axis] + s.t0 * f->direction[axis] - tile->lo[axis]) * steps[axis];
        s.d[axis] = f->direction[axis] * steps[axis];
        size += __builtin_fabsf(s.o[axis]);
        length += __builtin_fabsf(s.d[axis]);
    }
    s.side = SIDE_ROUNDING * size * length;
    s.depth = DEPTH_ROUNDING * size;
    return s;
}

/* A cluster's triangles in the tile's steps. margin: a ray's and a corner's error along each axis. */
typedef struct facets {
    float8 corner[3], x[3], y[3], normal[3], depth;
    float margin[3];
} facets;

/* slack: of rays, in steps. */
static inline void unpack_cluster(const pl_terrain_tile *tile, uint32_t cluster, const float slack[3], facets *f)
{
    const uint8_t (*corners)[PL_TERRAIN_CLUSTER] = tile->corners[cluster];
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        const float lo = tile->planes[axis][cluster], part = ((float)tile->planes[3 + axis][cluster] - lo) * (1.0f / 255.0f);
        const float8 corner = eight_bytes(corners[axis]);
        f->x[axis] = (eight_bytes(corners[3 + axis]) - corner) * part;
        f->y[axis] = (eight_bytes(corners[6 + axis]) - corner) * part;
        f->corner[axis] = corner * part + lo;
        f->margin[axis] = slack[axis] + 0.51f * part + 0x1p-10f;
    }
    cross(f->x, f->y, f->normal);
    f->depth = spread(f->margin, f->normal);
}

/* Which of a cluster's triangles can have a root in (0, t_max) of the frame, as bits; *certain: which must, where that is asked
 * for. Möller & Trumbore, "Fast, minimum storage ray/triangle intersection" (1997), without the division.
 *
 * Where the ray meets a triangle normatively, another one beside it by no more than the margin meets the triangle of rounded
 * corners; the products of three vectors change by the spread. NaN rules nothing out. */
static inline unsigned filter_eight(const sight *s, const facets *f, float t_max, bool any, unsigned *certain)
{
    float8 from[3], d[3], across_x[3], across_y[3];
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        from[axis] = s->o[axis] - f->corner[axis];
        d[axis] = s->d[axis] - (float8){0};
    }
    cross(d, f->y, across_y);
    cross(f->x, d, across_x);
    float8 volume = dot(f->x, across_y), u = dot(from, across_y), v = dot(from, across_x), t = dot(from, f->normal);
    const float8 u_slack = spread(f->margin, across_y) + s->side, v_slack = spread(f->margin, across_x) + s->side;
    const float8 t_slack = f->depth + s->depth, both_slack = u_slack + v_slack;
    const int8 turn = (int8)volume & INT32_MIN;
    volume = (float8)((int8)volume ^ turn);
    u = (float8)((int8)u ^ turn);
    v = (float8)((int8)v ^ turn);
    t = (float8)((int8)t ^ turn) + s->t0 * volume;
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

/* The triangles of a cluster that there are, as bits. */
static inline unsigned facets_of(const pl_terrain *terrain, uint32_t cluster)
{
    const uint32_t first = cluster * PL_TERRAIN_CLUSTER, rest = terrain->tile_leaves - first;
    return first >= terrain->tile_leaves ? 0 : rest >= PL_TERRAIN_CLUSTER ? 0xFF : (1u << rest) - 1;
}

/* Much of a tile will be looked at one after another: better wait once. */
static inline void fetch_tile(const pl_terrain *terrain, pl_ref ref)
{
    const char *tile = (const char *)pl_terrain_tile_at(terrain, ref & PL_REF_INDEX);
    for (size_t line = 0; line < terrain->stride; line += 64) __builtin_prefetch(tile + line);
}

/* A ray on its way through a terrain. */
typedef struct traveller {
    const pl_terrain *terrain;
    pl_frame *frame;
    const double *o, *d;
    pl_query *query;
    float inverse_square; /* of the frame's direction */
    uint64_t *stack;      /* of terrain->stack_need entries */
    size_t top;
    float t_max; /* in the frame's own t */
} traveller;

static const pl_ref CLUSTERS[PL_FRONT_WIDTH] = {0, 1, 2, 3, 4, 5, 6, 7};

/* Writes the clusters of a tile that the ray meets, the nearest last; returns their number. */
static inline unsigned meet_tile(const pl_frame *f, float t_max, const pl_terrain_tile *tile, uint64_t *entries, uint32_t *nearest)
{
    wide near_t[3], far_t[3];
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        const wide lo = wide_set(tile->lo[axis]), inverse = wide_set(f->inverse[axis]);
        const wide step = wide_multiply_subtract(wide_set(tile->step[axis]), inverse, wide_set(0.0f));
        near_t[axis] = wide_multiply_add(wide_bytes(tile->planes[0] + f->near_row[axis]), step,
                                         wide_multiply_subtract(lo, inverse, wide_set(f->near_base[axis])));
        far_t[axis] = wide_multiply_add(wide_bytes(tile->planes[0] + f->far_row[axis]), step,
                                        wide_multiply_subtract(lo, inverse, wide_set(f->far_base[axis])));
    }
    wide enter = wide_max(wide_max(near_t[0], near_t[1]), wide_max(near_t[2], wide_set(0.0f)));
    wide leave = wide_min(wide_min(far_t[0], far_t[1]), wide_min(far_t[2], wide_set(t_max)));
    return wide_order(enter, leave, CLUSTERS, entries, nearest);
}

/* Tests a cluster's triangles; -1: an error, 1: the query is done. */
static inline int visit_cluster(pl_tracer *tracer, const traveller *r, const sight *s, const float slack[3], uint32_t tile,
                                uint32_t cluster, bool any)
{
    facets f;
    unsigned certain = 0, left = facets_of(r->terrain, cluster);
    if (!left) return 0;
    unpack_cluster(pl_terrain_tile_at(r->terrain, tile), cluster, slack, &f);
    tracer->counters.filtered += PL_TERRAIN_CLUSTER;
    const unsigned there = left;
    left &= filter_eight(s, &f, r->t_max, any, &certain);
    if (any && certain & there) {
        r->query->found = r->query->done = true;
        return 1;
    }
    for (; left; left &= left - 1) {
        const uint32_t leaf = cluster * PL_TERRAIN_CLUSTER + (uint32_t)__builtin_ctz(left);
        wide_end();
        if (!pl_terrain_candidate(tracer, r->terrain, tile, leaf, r->o, r->d, r->query)) return -1;
        if (r->query->done) return 1;
    }
    return 0;
}

/* Tests the clusters of a tile, the nearest first; the same answers. */
static inline int visit_tile(pl_tracer *tracer, traveller *r, pl_ref ref, bool any)
{
    const uint32_t index = ref & PL_REF_INDEX;
    const pl_terrain_tile *tile = pl_terrain_tile_at(r->terrain, index);
    uint64_t entries[PL_TERRAIN_CLUSTERS];
    uint32_t cluster;
    unsigned count = meet_tile(r->frame, r->t_max, tile, entries, &cluster);
    if (count == 0) return 0;
    float steps[3], slack[3];
    for (int axis = 0; axis < 3; axis++) {
        steps[axis] = 1.0f / tile->step[axis];
        slack[axis] = r->frame->slack * steps[axis];
    }
    const sight s = sight_of(r->frame, r->inverse_square, steps, tile);
    for (;;) {
        int done = visit_cluster(tracer, r, &s, slack, index, cluster, any);
        if (done) return done;
        r->t_max = local_t_max(r->frame, r->query->t_max);
        if (--count == 0 || entry_is_beyond(entries[count - 1], r->t_max)) return 0;
        cluster = (uint32_t)entries[count - 1];
    }
}

/* Goes on to the next tile that the ray meets; PL_NOTHING: there is none. */
static inline pl_ref next_tile(traveller *r, uint64_t *steps)
{
    const pl_front_node *nodes = r->terrain->front.nodes;
    uint64_t *stack = r->stack, taken = 0;
    size_t top = r->top;
    pl_ref found = PL_NOTHING;
    while (top) {
        const uint64_t entry = stack[--top];
        pl_ref ref = (pl_ref)entry;
        if (entry_is_beyond(entry, r->t_max)) continue;
        while (ref >> PL_REF_SHIFT == PL_KIND_NODE) {
            const unsigned count = meet_nearest(r->frame, r->t_max, &nodes[ref], stack + top, &ref);
            taken++;
            if (count == 0) goto next;
            top += count - 1;
        }
        taken++;
        found = ref;
        break;
    next:;
    }
    r->top = top;
    *steps += taken;
    return found;
}

/* Sets out a ray of the terrain's frame; false: it misses the terrain. */
static inline bool set_out(traveller *r, const pl_terrain *terrain, pl_frame *f, const double o[3], const double d[3],
                           pl_query *query, uint64_t *stack)
{
    const pl_front *front = &terrain->front;
    r->terrain = terrain;
    r->frame = f;
    r->o = o;
    r->d = d;
    r->query = query;
    r->stack = stack;
    const double4 origin = {o[0], o[1], o[2]}, direction = {d[0], d[1], d[2]};
    const double4 from = (origin - *(const double4 *)front->centre) * front->scale, along = direction * front->scale;
    float local_max = 1e30f;
    f->front = front;
    f->error = 0.0f;
    f->distance = (float)__builtin_fabs(from[0]) + (float)__builtin_fabs(from[1]) + (float)__builtin_fabs(from[2]);
    f->distance *= 1.0f + 0x1p-20f;
    f->t0 = query->t_min;
    f->rate = 1.0;
    if (!begin_frame(f, from + query->t_min * along, along, query->t_max, &local_max)) return false;
    const float *v = f->direction;
    r->inverse_square = 1.0f / (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    r->t_max = local_t_max(f, query->t_max);
    stack[0] = entry_of(0.0f, front->root);
    r->top = 1;
    return true;
}

static inline bool travel(pl_tracer *tracer, traveller *r, bool any)
{
    uint64_t steps = 0;
    int done = 0;
    for (pl_ref ref; !done && (ref = next_tile(r, &steps)) != PL_NOTHING;) {
        fetch_tile(r->terrain, ref);
        done = visit_tile(tracer, r, ref, any);
    }
    tracer->counters.box_tests += steps * PL_FRONT_WIDTH;
    return done >= 0;
}

bool TERRAIN_KERNEL(pl_tracer *tracer, const pl_terrain *terrain, const double o[3], const double d[3], pl_query *query)
{
    pl_bvh_work *w = tracer->work;
    pl_bvh_lane *lane = w->lanes;
    if (lane->stack_capacity < terrain->stack_need && !pl_bvh_grow_stack(lane, terrain->stack_need, query->error)) return false;
    traveller r;
    bool ok = true;
    if (set_out(&r, terrain, lane->frames, o, d, query, lane->stack)) ok = query->kind == PL_QUERY_ANY ? travel(tracer, &r, true) : travel(tracer, &r, false);
    wide_end();
    return ok;
}
