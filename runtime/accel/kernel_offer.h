/* kernel_offer.h - the candidates of packets (kernel_packet.h) mapped down the path in double precision, four rays at a time.
 *
 *     offer_lanes(tracer, frame, ref, lanes, queries, t_max)    → the queries of these lanes know of the primitive
 *
 * The rays stay in registers all the way down the path. They are the normative ones: lane by lane these are pl_map_ray's
 * operations, in its order and without fused ones, so that the bits are the same. The roots are left to the shapes: in lanes
 * they gain 2 % only, since a division of four takes as long as two of one and half the lanes are empty. */

typedef __m256d four;

static inline four four_set(double x)
{
    return _mm256_set1_pd(x);
}

/* The rays of four lanes. */
typedef struct quad {
    four o[3], d[3];
} quad;

static inline quad load_quad(const pl_lanes *rays, int first)
{
    quad q;
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        q.o[axis] = _mm256_loadu_pd(rays->o[axis] + first);
        q.d[axis] = _mm256_loadu_pd(rays->d[axis] + first);
    }
    return q;
}

static inline void store_quad(pl_lanes *rays, int first, const quad *q)
{
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        _mm256_storeu_pd(rays->o[axis] + first, q->o[axis]);
        _mm256_storeu_pd(rays->d[axis] + first, q->d[axis]);
    }
}

/* pl_map_ray */
static inline void map_quad(const pl_transform *transform, quad *q)
{
    if (transform->form <= PL_FORM_PACKED) {
        double room[12];
        const double *m = pl_transform_entries(transform, room);
        const quad from = *q;
#pragma GCC unroll 3
        for (int r = 0; r < 3; r++) {
            const four a = four_set(m[4 * r]), b = four_set(m[4 * r + 1]), c = four_set(m[4 * r + 2]);
            q->o[r] = a * from.o[0] + b * from.o[1] + c * from.o[2] + four_set(m[4 * r + 3]);
            q->d[r] = a * from.d[0] + b * from.d[1] + c * from.d[2];
        }
        return;
    }
    const double *m = transform->to_object.m;
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        if (transform->form == PL_FORM_DIAGONAL) {
            q->o[axis] *= four_set(m[5 * axis]);
            q->d[axis] *= four_set(m[5 * axis]);
        }
        q->o[axis] += four_set(m[4 * axis + 3]);
    }
}

/* Four normative rays of a frame, mapped through the chain. */
static inline quad quad_below(const pl_bvh_work *w, size_t count, const pl_lanes *rays, int first)
{
    quad q = load_quad(rays, first);
    while (count > 0) map_quad(w->chain[--count], &q);
    return q;
}

/* The quads that some lanes are in. */
static inline unsigned quads_of(unsigned lanes)
{
    unsigned quads = 0;
    for (int i = 0; i < QUADS; i++) quads |= (unsigned)((lanes >> 4 * i & 15) != 0) << i;
    return quads;
}

/* The normative rays of some quads of a frame. */
static bool map_packet(const pl_scene *scene, pl_bvh_work *w, uint32_t index, unsigned quads, pl_error *error)
{
    uint32_t from = index;
    while (quads & ~w->packets[from].mapped) from--;
    for (; from < index; from++) {
        const pl_packet_frame *parent = &w->packets[from];
        pl_packet_frame *f = &w->packets[from + 1];
        const pl_front_place *it = &parent->front->places[f->instance];
        const pl_item *item = pl_front_item(&scene->states, it->item);
        size_t count;
        if (!pl_bvh_chain(w, parent->front, it->opened, item, NULL, &count, error)) return false;
        /* Quads that were mapped before are mapped again to the same numbers. */
        for (unsigned rest = quads; rest; rest &= rest - 1) {
            const int first = 4 * __builtin_ctz(rest);
            const quad q = quad_below(w, count, &parent->normative, first);
            store_quad(&f->normative, first, &q);
        }
        f->mapped |= quads;
    }
    return true;
}

/* Those of some lanes whose rays don't leave a primitive. */
static inline unsigned lanes_that_stay(const pl_bvh_work *w, uint32_t index, pl_ref ref, const pl_query *queries, unsigned lanes)
{
    unsigned stay = lanes;
    for (unsigned rest = lanes; rest; rest &= rest - 1) {
        const int lane = __builtin_ctz(rest);
        if (pl_bvh_is_left(queries[lane].leaves, w->lanes->frames, index, ref)) stay &= ~(1u << lane);
    }
    return stay;
}

/* Evaluates a primitive of frame `index`, whose normative rays are known, for one lane and offers it to its query. */
static bool offer_lane(pl_tracer *tracer, uint32_t index, pl_ref ref, int lane, pl_query *queries, double *t_max)
{
    pl_bvh_work *w = tracer->work;
    const pl_packet_frame *f = &w->packets[index];
    const pl_front_primitive *p = &f->front->primitives[ref & PL_REF_INDEX];
    const pl_states *states = &tracer->scene->states;
    const pl_item *item = pl_front_item(states, p->item), *leaf = pl_front_leaf_of(states, p, ref >> PL_REF_SHIFT);
    double4 o = {f->normative.o[0][lane], f->normative.o[1][lane], f->normative.o[2][lane]};
    double4 d = {f->normative.d[0][lane], f->normative.d[1][lane], f->normative.d[2][lane]};
    double in_o[4], in_d[4];
    if (!map_down(w, f->front, p->opened, item, leaf, &o, &d, queries->error)) return false;
    *(double4 *)in_o = o;
    *(double4 *)in_d = d;
    wide_end();
    if (!pl_bvh_offer(tracer, w->lanes, index, ref, leaf, in_o, in_d, &queries[lane])) return false;
    t_max[lane] = queries[lane].t_max;
    return true;
}

/* Those of some lanes that can meet a plane: they begin on one side and go to the other. */
static inline unsigned lanes_to_plane(const pl_lanes *rays, unsigned lanes)
{
    unsigned towards = 0;
    for (int first = 0; first < PL_LANES; first += 4) {
        const four o = _mm256_loadu_pd(rays->o[2] + first), d = _mm256_loadu_pd(rays->d[2] + first);
        towards |= (unsigned)_mm256_movemask_pd(_mm256_xor_pd(o, d)) << first;
    }
    return towards & lanes;
}

/* Evaluates a primitive of frame `index` for some lanes and offers it to their queries. */
static bool offer_lanes(pl_tracer *tracer, uint32_t index, pl_ref ref, unsigned lanes, pl_query *queries, double *t_max)
{
    pl_bvh_work *w = tracer->work;
    const pl_scene *scene = tracer->scene;
    const pl_packet_frame *f = &w->packets[index];
    const pl_front_primitive *p = &f->front->primitives[ref & PL_REF_INDEX];
    const pl_item *item = pl_front_item(&scene->states, p->item);
    const pl_item *leaf_item = pl_front_leaf_of(&scene->states, p, ref >> PL_REF_SHIFT);
    unsigned quads = quads_of(lanes);
    /* All at once, where most rays have a candidate sooner or later. */
    const bool all = f->each && f->front->dense;
    if (!map_packet(scene, w, index, all ? quads_of(f->lanes) & ~f->mapped : quads, queries->error)) return false;
    w->answers++;
    if (!(lanes & (lanes - 1))) return offer_lane(tracer, index, ref, __builtin_ctz(lanes), queries, t_max);
    size_t count;
    if (!pl_bvh_chain(w, f->front, p->opened, item, leaf_item, &count, queries->error)) return false;
    pl_lanes rays;
    for (; quads; quads &= quads - 1) {
        const int first = 4 * __builtin_ctz(quads);
        const quad q = quad_below(w, count, &f->normative, first);
        store_quad(&rays, first, &q);
    }
    wide_end();
    tracer->counters.primitive_tests += (unsigned)__builtin_popcount(lanes);
    const pl_bvh_place place = {w->lanes, index, ref};
    pl_leaf leaf = pl_bvh_leaf(scene, leaf_item, &place);
    if (leaf.shape == PL_SHAPE_PLANE && !leaf.mesh) lanes = lanes_to_plane(&rays, lanes);
    for (; lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        const double o[3] = {rays.o[0][lane], rays.o[1][lane], rays.o[2][lane]};
        const double d[3] = {rays.d[0][lane], rays.d[1][lane], rays.d[2][lane]};
        leaf.o = o;
        leaf.d = d;
        if (!pl_query_leaf(&queries[lane], &leaf)) return false;
        t_max[lane] = queries[lane].t_max;
    }
    return true;
}
