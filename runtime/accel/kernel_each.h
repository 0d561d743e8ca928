/* kernel_each.h - nodes against the rays of a packet that don't go the same way (kernel_packet.h), each by itself.
 *
 *     meet_each(frame, &lanes, node, entries, own, &nearest)    → the children that any of these lanes meets, with their lanes
 *
 * A node is visited once by all rays that met its box, in the order of the nearest of them (Barringer & Akenine-Möller
 * 2014, "Dynamic ray stream traversal"). It is loaded once, and no ray waits for its own last step: one more
 * takes a third of what a node takes a ray alone. */

/* Sets what nodes need of each lane of a frame. */
static inline void look_at_each(pl_packet_frame *f)
{
    const wide slack = wide_set(f->slack);
    unsigned below[3] = {0}; /* lanes that go down an axis */
    for (int first = 0; first < PL_LANES; first += HALF) {
        if (!(f->lanes >> first & 0xFF)) continue;
#pragma GCC unroll 3
        for (int axis = 0; axis < 3; axis++) {
            const wide inverse = wide_load(f->inverse[axis] + first), middle = wide_load(f->origin[axis] + first) * inverse;
            const wide toward = slack * wide_absolute(inverse);
            const __m256i negative = _mm256_srai_epi32(_mm256_castps_si256(inverse), 31);
            const __m256i high = _mm256_and_si256(negative, _mm256_set1_epi32(3 * PL_FRONT_WIDTH));
            below[axis] |= wide_mask_of(inverse) << first;
            _mm256_storeu_ps(f->near_base[axis] + first, middle + toward);
            _mm256_storeu_ps(f->far_base[axis] + first, middle - toward);
            _mm256_storeu_si256((__m256i *)(f->near_row[axis] + first), _mm256_add_epi32(high, _mm256_set1_epi32(axis * PL_FRONT_WIDTH)));
        }
    }
    f->alike = true;
    for (int axis = 0; axis < 3; axis++) f->alike = f->alike && (!(f->lanes & below[axis]) || !(f->lanes & ~below[axis]));
}

/* A node's planes in the order in which a lane comes to them. */
static inline __attribute__((always_inline)) void load_planes(const pl_packet_frame *f, int lane, const pl_front_node *node, wide near[3],
                                                             wide far[3])
{
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        const uint32_t row = f->near_row[axis][lane];
        near[axis] = wide_load(node->planes[0] + row);
        far[axis] = wide_load(node->planes[0] + ((uint32_t)(2 * axis + 3) * PL_FRONT_WIDTH - row));
    }
}

/* As meet, for one lane. */
static inline __attribute__((always_inline)) void meet_lane(const pl_packet_frame *f, int lane, const wide near[3], const wide far[3],
                                                            wide *enter, wide *leave)
{
    wide near_t[3], far_t[3];
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        const wide inverse = wide_set(f->inverse[axis][lane]);
        near_t[axis] = wide_multiply_subtract(near[axis], inverse, wide_set(f->near_base[axis][lane]));
        far_t[axis] = wide_multiply_subtract(far[axis], inverse, wide_set(f->far_base[axis][lane]));
    }
    *enter = wide_max(wide_max(near_t[0], near_t[1]), wide_max(near_t[2], wide_set(0.0f)));
    *leave = wide_min(wide_min(far_t[0], far_t[1]), wide_min(far_t[2], wide_set(f->t_max[lane])));
}

/* Where the first of some lanes enters a node's children (INFINITY: none does), and the bits of those that meet them. alike: they
 * come to the planes in the same order, so that these stay in registers. */
static inline __attribute__((always_inline)) void meet_lanes(const pl_packet_frame *f, unsigned lanes, const pl_front_node *node,
                                                             bool alike, wide *first, wide *met)
{
    wide near[3], far[3], enter, leave;
    *first = wide_set(INFINITY);
    *met = wide_set(0.0f);
    if (alike) load_planes(f, __builtin_ctz(lanes), node, near, far);
    for (unsigned rest = lanes; rest; rest &= rest - 1) {
        if (!alike) load_planes(f, __builtin_ctz(rest), node, near, far);
        meet_lane(f, __builtin_ctz(rest), near, far, &enter, &leave);
        /* All bits set are no number, which wide_min passes over. */
        const wide missed = _mm256_cmp_ps(enter, leave, _CMP_NLE_UQ), lane = _mm256_castsi256_ps(_mm256_set1_epi32((int)(rest & -rest)));
        *first = wide_min(_mm256_or_ps(missed, enter), *first);
        *met = _mm256_or_ps(_mm256_andnot_ps(missed, lane), *met);
    }
}

/* Entries of a node's children whose enter <= leave, the nearest last (alone it isn't written), with their lanes in own;
 * *lanes become those of the nearest. Returns their number. */
static inline __attribute__((always_inline)) unsigned order_children(wide enter, wide leave, const pl_front_node *node, __m256i lanes_of,
                                                                    unsigned *lanes, uint64_t *entries, uint32_t *own, pl_ref *nearest)
{
    const __m256i hit = _mm256_castps_si256(_mm256_cmp_ps(enter, leave, _CMP_LE_OQ));
    const unsigned mask = wide_mask_of(_mm256_castsi256_ps(hit));
    const int number = wide_nearest(enter, hit);
    *nearest = node->child[number];
    *lanes = (unsigned)_mm256_cvtsi256_si32(_mm256_permutevar8x32_epi32(lanes_of, _mm256_set1_epi32(number)));
    if ((mask & (mask - 1)) == 0) return mask != 0;
    const __m256i sorted = wide_ranks(enter, hit);
    wide_store(entries, _mm256_load_si256((const __m256i *)node->child), sorted);
    _mm256_storeu_si256((__m256i *)own, _mm256_permutevar8x32_epi32(lanes_of, sorted));
    return (unsigned)__builtin_popcount(mask);
}

/* As meet_nearest, for each of *lanes. *lanes become those of the nearest child, own those of the entries. */
static inline unsigned meet_each(const pl_packet_frame *f, unsigned *lanes, const pl_front_node *node, uint64_t *entries, uint32_t *own,
                                 pl_ref *nearest)
{
    wide first, met;
    if (f->alike) meet_lanes(f, *lanes, node, true, &first, &met);
    else meet_lanes(f, *lanes, node, false, &first, &met);
    return order_children(first, wide_set(FLT_MAX), node, _mm256_castps_si256(met), lanes, entries, own, nearest);
}

/* The lanes whose t_max an entry doesn't lie beyond. */
static inline unsigned lanes_within(const pl_packet_frame *f, uint64_t entry)
{
    const wide t = _mm256_castsi256_ps(_mm256_set1_epi32((int)(entry >> 32) & ~(PL_FRONT_WIDTH - 1)));
    unsigned within = 0;
    for (int first = 0; first < PL_LANES; first += HALF)
        within |= wide_mask_of(_mm256_cmp_ps(t, wide_load(f->t_max + first), _CMP_LE_OQ)) << first;
    return within;
}
