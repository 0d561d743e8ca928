/* kernel_lanes.h - primitives against eight rays at a time: the filters of kernel.h, wider, for kernel_packet.h. */

enum { HALF = 8, QUADS = PL_LANES / 4 };

#define wide_and(a, b) _mm256_and_ps(a, b)
#define wide_mask_of(x) ((unsigned)_mm256_movemask_ps(x))
#define SIGN _mm256_set1_ps(-0.0f)

static inline wide wide_absolute(wide x)
{
    return _mm256_andnot_ps(SIGN, x);
}

/* All bits of the lanes that are set in a mask. */
static inline wide wide_lanes(unsigned mask)
{
    const __m256i bit = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    return _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32((int)mask), bit), bit));
}

static inline wide wide_narrow(__m256d low, __m256d high)
{
    return _mm256_set_m128(_mm256_cvtpd_ps(high), _mm256_cvtpd_ps(low));
}

static inline float wide_least(wide x)
{
    __m128 v = _mm_min_ps(_mm256_castps256_ps128(x), _mm256_extractf128_ps(x, 1));
    v = _mm_min_ps(v, _mm_movehl_ps(v, v));
    return _mm_cvtss_f32(_mm_min_ss(v, _mm_shuffle_ps(v, v, 1)));
}

static inline float wide_most(wide x)
{
    return -wide_least(-x);
}

/* 1 / d, finite. */
static inline wide wide_inverse(wide d, float least)
{
    return wide_set(1.0f) / _mm256_or_ps(wide_max(wide_absolute(d), wide_set(least)), wide_and(d, SIGN));
}

typedef struct wide_interval {
    wide enter, leave;
} wide_interval;

static inline void between_lanes(wide_interval *i, wide o, wide d, float lo, float hi)
{
    const wide inverse = wide_inverse(d, 1e-30f);
    const wide a = (wide_set(lo) - o) * inverse, b = (wide_set(hi) - o) * inverse;
    i->enter = wide_max(wide_min(a, b), i->enter);
    i->leave = wide_min(wide_max(a, b), i->leave);
}

/* As inside_quadric; lanes that miss get an empty interval. false: all of `lanes` do, as most often, and roots aren't needed. */
static inline bool quadric_lanes(wide_interval *i, unsigned lanes, wide a, wide b, wide discriminant)
{
    const wide bent = _mm256_cmp_ps(a, wide_set(1e-30f), _CMP_GT_OQ), zero = wide_set(0.0f);
    const wide missed = wide_and(bent, _mm256_cmp_ps(discriminant, zero, _CMP_LT_OQ));
    if (!(lanes & ~wide_mask_of(missed))) return false;
    const wide root = _mm256_sqrt_ps(wide_max(zero, discriminant)), over = wide_set(1.0f) / a; /* NaN rules nothing out */
    const wide near_t = _mm256_blendv_ps(wide_set(-1e30f), (-b - root) * over, bent);
    const wide far_t = _mm256_blendv_ps(wide_set(1e30f), (root - b) * over, bent);
    i->enter = wide_max(near_t, i->enter);
    i->leave = _mm256_blendv_ps(wide_min(far_t, i->leave), wide_set(-2e30f), missed);
    return true;
}

/* As shape_interval, for `lanes`; false: nothing of any of these. */
static inline __attribute__((always_inline)) bool shape_lanes(uint32_t kind, float argument, unsigned lanes, const wide o[3],
                                                             const wide d[3], float grow, wide_interval *i)
{
    const wide flat = d[0] * d[0] + d[1] * d[1], cross = o[0] * d[1] - o[1] * d[0], along = o[0] * d[0] + o[1] * d[1];
    switch (kind) {
    case PL_SHAPE_SPHERE: {
        const wide a = flat + d[2] * d[2], r = wide_set(1.0f + grow);
        const wide x = o[1] * d[2] - o[2] * d[1], y = o[2] * d[0] - o[0] * d[2];
        return quadric_lanes(i, lanes, a, along + o[2] * d[2], a * r * r - (x * x + y * y + cross * cross));
    }
    case PL_SHAPE_DISC:
    case PL_SHAPE_CYLINDER:
    case PL_SHAPE_CONE: {
        const wide r = wide_set((kind == PL_SHAPE_CONE && argument > 1.0f ? argument : 1.0f) + grow);
        if (!quadric_lanes(i, lanes, flat, along, flat * r * r - cross * cross)) return false;
        between_lanes(i, o[2], d[2], -grow, (kind == PL_SHAPE_DISC ? 0.0f : 1.0f) + grow);
        return true;
    }
    case PL_SHAPE_TORUS: {
        const float r = 1.0f + argument + grow, h = argument + grow;
        between_lanes(i, o[0], d[0], -r, r);
        between_lanes(i, o[1], d[1], -r, r);
        between_lanes(i, o[2], d[2], -h, h);
        return true;
    }
    case PL_SHAPE_BOX:
    case PL_SHAPE_TRIANGLE:
    case PL_SHAPE_SQUARE:
        between_lanes(i, o[0], d[0], -grow, 1.0f + grow);
        between_lanes(i, o[1], d[1], -grow, 1.0f + grow);
        between_lanes(i, o[2], d[2], -grow, (kind == PL_SHAPE_BOX ? 1.0f : 0.0f) + grow);
        return true;
    default: return true;
    }
}

/* Those of eight rays that certainly pass a shape's surface before t_max, given their interval (filter in kernel.h). */
static inline unsigned certain_lanes(uint32_t kind, const wide o[3], const wide d[3], float margin, const wide_interval *i,
                                     wide t_max)
{
    if (!(kind == PL_SHAPE_CYLINDER || kind == PL_SHAPE_SPHERE || kind == PL_SHAPE_BOX) || !(margin < 0.25f)) return 0;
    wide_interval deep = {wide_set(-1e30f), wide_set(1e30f)};
    if (!shape_lanes(kind, 0.0f, 0xFF, o, d, -margin, &deep)) return 0;
    wide sure = wide_and(_mm256_cmp_ps(i->enter, wide_set(0.0f), _CMP_GT_OQ), _mm256_cmp_ps(deep.enter, deep.leave, _CMP_LT_OQ));
    sure = wide_and(sure, _mm256_cmp_ps(deep.enter, t_max * wide_set(0.9999f), _CMP_LT_OQ));
    if (kind == PL_SHAPE_CYLINDER) sure = wide_and(sure, _mm256_cmp_ps(d[0] * d[0] + d[1] * d[1], wide_set(1e-30f), _CMP_GT_OQ));
    return wide_mask_of(sure);
}

/* filter_lanes for the lanes of eight that begin at `first`. Not in line: in a loop the primitive's numbers would all be spread
 * beforehand, more than there are registers for, and most often one eight is all. */
static __attribute__((noinline)) unsigned filter_half(const pl_front_primitive *p, uint32_t kind, const pl_packet_frame *f,
                                                       unsigned first, unsigned lanes, unsigned *certain)
{
    const float margin = p->stretch * f->slack + 0x1p-19f, *m = p->columns;
    wide o[3], d[3];
    const wide x = wide_load(f->origin[0] + first), y = wide_load(f->origin[1] + first);
    const wide z = wide_load(f->origin[2] + first), u = wide_load(f->direction[0] + first);
    const wide v = wide_load(f->direction[1] + first), w = wide_load(f->direction[2] + first);
#pragma GCC unroll 3
    for (int r = 0; r < 3; r++) {
        const wide a = wide_set(m[r]), b = wide_set(m[3 + r]), c = wide_set(m[6 + r]);
        o[r] = wide_multiply_add(a, x, wide_multiply_add(b, y, wide_multiply_add(c, z, wide_set(m[9 + r]))));
        d[r] = wide_multiply_add(a, u, wide_multiply_add(b, v, c * w));
    }
    wide_interval i = {wide_set(-1e30f), wide_set(1e30f)};
    if (!shape_lanes(kind, p->argument, lanes >> first & 0xFF, o, d, margin, &i)) return 0;
    const wide t_max = wide_load(f->t_max + first), latest = wide_min(i.leave, t_max);
    const wide met = wide_and(_mm256_cmp_ps(i.enter, latest, _CMP_LE_OQ), _mm256_cmp_ps(i.leave, wide_set(0.0f), _CMP_GE_OQ));
    const unsigned eight = wide_mask_of(met) & (lanes >> first & 0xFF);
    if (certain && eight) *certain |= (eight & certain_lanes(kind, o, d, margin, &i, t_max)) << first;
    return eight << first;
}

/* The rays of a packet's frame that can have a root in a primitive; certain: NULL, or those that must. */
static inline unsigned filter_lanes(const pl_front_primitive *p, uint32_t kind, const pl_packet_frame *f, unsigned lanes,
                                    unsigned *certain)
{
    if (certain) *certain = 0;
    if (kind == PL_KIND_MESH || kind == PL_SHAPE_PLANE) return lanes;
    if (!(lanes & (lanes - 1))) { /* as among twigs */
        const int i = __builtin_ctz(lanes);
        const float o[3] = {f->origin[0][i], f->origin[1][i], f->origin[2][i]};
        const float d[3] = {f->direction[0][i], f->direction[1][i], f->direction[2][i]};
        const enum kernel_verdict verdict = filter_ray(p, kind, o, d, f->slack, f->t_max[i], certain != NULL);
        if (verdict == CERTAIN) *certain = lanes;
        return verdict == MISS ? 0 : lanes;
    }
    unsigned found = 0;
    for (unsigned rest = lanes, first; rest; rest &= ~(0xFFu << first)) {
        first = (unsigned)__builtin_ctz(rest) & ~7u;
        found |= filter_half(p, kind, f, first, lanes, certain);
    }
    return found;
}
