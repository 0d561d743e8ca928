/* kernel_beam.h - nodes against all rays of a packet at once, while these go about the same way (kernel_packet.h).
 *
 *     look_along(frame)                                            → the frame's beam; false: its rays go different ways
 *     meet_together(frame, &lanes, node, entries, own, &nearest)   → the children that the beam meets, with their lanes
 *
 * A beam is intervals of the rays' origins and of their directions' inverses: twice the arithmetic of one ray. A child that is
 * a node is met by all rays then. Instances and primitives are dear, and most rays of a beam pass them by, so their boxes are
 * told for each ray, eight at a time: half as many rays are brought to instances in order 20, a third as many in a forest's
 * shadows. */

/* Widens intervals by the rays of some lanes. */
static inline void span_of(const float *values, unsigned lanes, float *least, float *most)
{
    const wide high = wide_set(INFINITY);
    wide low = high, top = -high;
    for (int first = 0; first < PL_LANES; first += HALF) {
        const wide some = wide_load(values + first), in = wide_lanes(lanes >> first & 0xFF);
        low = wide_min(_mm256_blendv_ps(high, some, in), low);
        top = wide_max(_mm256_blendv_ps(-high, some, in), top);
    }
    *least = wide_least(low);
    *most = wide_most(top);
}

/* The rays of a frame's lanes become its beam. false: they go different ways. */
static inline bool look_along(pl_packet_frame *f)
{
    pl_beam *b = &f->beam;
    for (int axis = 0; axis < 3; axis++) {
        float o_least, o_most, least, most;
        span_of(f->inverse[axis], f->lanes, &least, &most);
        const bool negative = most < 0.0f;
        if (!negative && !(least > 0.0f)) return false;
        span_of(f->origin[axis], f->lanes, &o_least, &o_most);
        if (o_most - o_least > f->front->wide) return false;
        o_least -= f->slack;
        o_most += f->slack;
        b->near_o[axis] = negative ? o_least : o_most;
        b->far_o[axis] = negative ? o_most : o_least;
        b->least[axis] = least;
        b->most[axis] = most;
        b->near_row[axis] = (uint32_t)(negative ? 3 + axis : axis) * PL_FRONT_WIDTH;
        b->far_row[axis] = (uint32_t)(negative ? axis : 3 + axis) * PL_FRONT_WIDTH;
    }
    float least;
    span_of(f->t_max, f->lanes, &least, &f->most);
    return true;
}

/* Where a beam's rays enter and leave a node's children: the first one at the earliest, the last one at the latest. */
static inline __attribute__((always_inline)) void meet_all(const pl_beam *b, float t_max, const pl_front_node *node, wide *enter,
                                                           wide *leave)
{
    *enter = wide_set(0.0f);
    *leave = wide_set(t_max);
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        const wide near = wide_load(node->planes[0] + b->near_row[axis]) - wide_set(b->near_o[axis]);
        const wide far = wide_load(node->planes[0] + b->far_row[axis]) - wide_set(b->far_o[axis]);
        const wide least = wide_set(b->least[axis]), most = wide_set(b->most[axis]);
        *enter = wide_max(wide_min(near * least, near * most), *enter);
        *leave = wide_min(wide_max(far * least, far * most), *leave);
    }
}

/* As meet. */
static inline unsigned meet_beam(const pl_beam *b, float t_max, const pl_front_node *node, uint64_t *entries, pl_ref *nearest)
{
    wide enter, leave;
    meet_all(b, t_max, node, &enter, &leave);
    return wide_order(enter, leave, node->child, entries, nearest);
}

/* The lanes of a beam that meet a child's box. */
static inline unsigned lanes_at_child(const pl_packet_frame *f, const pl_front_node *node, int child)
{
    const pl_beam *b = &f->beam;
    wide near[3], far[3];
    unsigned met = 0;
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        const float slack = __builtin_copysignf(f->slack, b->least[axis]);
        near[axis] = wide_set((node->planes[0] + b->near_row[axis])[child] - slack);
        far[axis] = wide_set((node->planes[0] + b->far_row[axis])[child] + slack);
    }
    for (int first = 0; first < PL_LANES; first += HALF) {
        wide enter = wide_set(0.0f), leave = wide_load(f->t_max + first);
#pragma GCC unroll 3
        for (int axis = 0; axis < 3; axis++) {
            const wide inverse = wide_load(f->inverse[axis] + first), o = wide_load(f->origin[axis] + first);
            enter = wide_max((near[axis] - o) * inverse, enter);
            leave = wide_min((far[axis] - o) * inverse, leave);
        }
        met |= wide_mask_of(_mm256_cmp_ps(enter, leave, _CMP_LE_OQ)) << first;
    }
    return met & f->lanes;
}

/* As meet_each, for all lanes of a frame. */
static inline unsigned meet_together(const pl_packet_frame *f, unsigned *lanes, const pl_front_node *node, uint64_t *entries,
                                     uint32_t *own, pl_ref *nearest)
{
    wide enter, leave;
    meet_all(&f->beam, f->most, node, &enter, &leave);
    const __m256i kinds = _mm256_srli_epi32(_mm256_loadu_si256((const __m256i *)node->child), PL_REF_SHIFT);
    const wide inner = _mm256_castsi256_ps(_mm256_cmpeq_epi32(kinds, _mm256_set1_epi32(PL_KIND_NODE)));
    unsigned items = wide_mask_of(_mm256_andnot_ps(inner, _mm256_cmp_ps(enter, leave, _CMP_LE_OQ)));
    if (!items) {
        _mm256_storeu_si256((__m256i *)own, _mm256_set1_epi32(-1));
        return wide_order(enter, leave, node->child, entries, nearest);
    }
    _Alignas(32) uint32_t lanes_of[PL_FRONT_WIDTH];
    _mm256_store_si256((__m256i *)lanes_of, _mm256_set1_epi32((int)f->lanes));
    for (; items; items &= items - 1) {
        const int child = __builtin_ctz(items);
        lanes_of[child] = lanes_at_child(f, node, child);
    }
    const __m256i of = _mm256_load_si256((const __m256i *)lanes_of), none = _mm256_cmpeq_epi32(of, _mm256_setzero_si256());
    leave = _mm256_blendv_ps(leave, wide_set(-1.0f), _mm256_castsi256_ps(none));
    return order_children(enter, leave, node, of, lanes, entries, own, nearest);
}
