/* kernel_vector.h - eight floats in a register of 256 bits, for the kernels of x86 (kernel.h). */
#include <immintrin.h>

typedef __m256 wide;

#define wide_load(from) _mm256_loadu_ps(from)
#define wide_bytes(from) _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(from))))
#define wide_set(x) _mm256_set1_ps(x)
#define wide_multiply_subtract(a, b, c) _mm256_fmsub_ps(a, b, c)
#define wide_multiply_add(a, b, c) _mm256_fmadd_ps(a, b, c)
#define wide_max(a, b) _mm256_max_ps(a, b) /* the second where the first is NaN */
#define wide_min(a, b) _mm256_min_ps(a, b)
#define four_min(a, b) ((float4)_mm_min_ps((__m128)(a), (__m128)(b)))
#define four_max(a, b) ((float4)_mm_max_ps((__m128)(a), (__m128)(b)))
#define four_fma(a, b, c) ((double4)_mm256_fmadd_pd((__m256d)(a), _mm256_set1_pd(b), (__m256d)(c)))
#define double4_max(a, b) ((double4)_mm256_max_pd((__m256d)(a), (__m256d)(b))) /* the second where one is NaN */
#define double4_min(a, b) ((double4)_mm256_min_pd((__m256d)(a), (__m256d)(b)))
#define double4_root(a) ((double4)_mm256_sqrt_pd((__m256d)(a)))
#define double4_bits(comparison) ((uint32_t)_mm256_movemask_pd((__m256d)(comparison)))
/* Code of other instruction sets that follows would wait for the upper halves of registers; compilers forget this where
 * vectors are arguments. */
#define wide_end() _mm256_zeroupper()

/* Compares lanes with others of theirs: the larger goes to the first of two, the smaller to the second (bits of `second`). */
#define EXCHANGE(v, others, second) \
    _mm256_blend_epi32(_mm256_max_epi32(v, others), _mm256_min_epi32(v, others), second)

/* Eight integers, the largest first: Knuth, "The Art of Computer Programming" 3, 5.3.4: 19 comparisons, six at a time. */
static inline __m256i wide_sort(__m256i v)
{
    v = EXCHANGE(v, _mm256_shuffle_epi32(v, 0x4E), 0xCC);
    v = EXCHANGE(v, _mm256_permute4x64_epi64(v, 0x4E), 0xF0);
    v = EXCHANGE(v, _mm256_shuffle_epi32(v, 0xB1), 0xAA);
    v = EXCHANGE(v, _mm256_permute4x64_epi64(v, 0xD8), 0x30);
    v = EXCHANGE(v, _mm256_permutevar8x32_epi32(v, _mm256_setr_epi32(0, 4, 2, 6, 1, 5, 3, 7)), 0x50);
    return EXCHANGE(v, _mm256_permutevar8x32_epi32(v, _mm256_setr_epi32(0, 2, 1, 4, 3, 6, 5, 7)), 0x54);
}

/* Lane numbers below enter's bits. */
static inline __m256i wide_keys(wide enter)
{
    const __m256i lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    return _mm256_or_si256(_mm256_andnot_si256(_mm256_set1_epi32(7), _mm256_castps_si256(enter)), lanes);
}

#ifdef __AVX512VL__
/* Four integers, the largest first, in three steps. */
static inline __m128i four_sort(__m128i v)
{
    __m128i others = _mm_shuffle_epi32(v, 0x4E);
    v = _mm_mask_min_epi32(_mm_max_epi32(v, others), 0xC, v, others);
    others = _mm_shuffle_epi32(v, 0xB1);
    v = _mm_mask_min_epi32(_mm_max_epi32(v, others), 0xA, v, others);
    others = _mm_shuffle_epi32(v, 0xD8);
    return _mm_mask_min_epi32(_mm_max_epi32(v, others), 0x4, v, others);
}
#endif

enum { ENTRIES_AT_ONCE = 8 };

/* Which of so many entries don't exceed a limit. */
static inline uint32_t entries_within(const uint64_t *entries, uint64_t limit)
{
#ifdef __AVX512VL__
    return _mm512_cmple_epu64_mask(_mm512_loadu_si512(entries), _mm512_set1_epi64((int64_t)limit));
#else
    const __m256i most = _mm256_set1_epi64x((int64_t)limit); /* entries have no sign */
    const __m256i low = _mm256_cmpgt_epi64(_mm256_loadu_si256((const __m256i *)entries), most);
    const __m256i high = _mm256_cmpgt_epi64(_mm256_loadu_si256((const __m256i *)(entries + 4)), most);
    return 0xFF ^ (uint32_t)(_mm256_movemask_pd((__m256d)low) | _mm256_movemask_pd((__m256d)high) << 4);
#endif
}

/* Which of eight integers don't exceed others. */
static inline uint32_t wide_at_most(const uint32_t *a, const uint32_t *b)
{
    const __m256i from = _mm256_load_si256((const __m256i *)a), most = _mm256_load_si256((const __m256i *)b);
#ifdef __AVX512VL__
    return _mm256_cmple_epi32_mask(from, most);
#else
    return 0xFF ^ (uint32_t)_mm256_movemask_ps((__m256)_mm256_cmpgt_epi32(from, most));
#endif
}

/* Which of eight references are of a kind. */
static inline uint32_t wide_of_kind(const pl_ref *refs, uint32_t kind)
{
    const __m256i kinds = _mm256_srli_epi32(_mm256_load_si256((const __m256i *)refs), PL_REF_SHIFT);
#ifdef __AVX512VL__
    return _mm256_cmpeq_epi32_mask(kinds, _mm256_set1_epi32((int)kind));
#else
    return (uint32_t)_mm256_movemask_ps((__m256)_mm256_cmpeq_epi32(kinds, _mm256_set1_epi32((int)kind)));
#endif
}

/* The keys of children whose enter <= leave, the largest first, behind them others; hit: that comparison. */
static inline __m256i wide_ranks(wide enter, __m256i hit)
{
    return wide_sort(_mm256_or_si256(wide_keys(enter), _mm256_xor_si256(hit, _mm256_set1_epi32(-1))));
}

/* Writes entries of keys and what their lanes number. */
static inline void wide_store(uint64_t *entries, __m256i refs, __m256i sorted)
{
    const __m256i lined = _mm256_permutevar8x32_epi32(refs, sorted);
    const __m256i low = _mm256_unpacklo_epi32(lined, sorted), high = _mm256_unpackhi_epi32(lined, sorted);
    _mm256_storeu_si256((__m256i *)entries, _mm256_permute2x128_si256(low, high, 0x20));
    _mm256_storeu_si256((__m256i *)(entries + 4), _mm256_permute2x128_si256(low, high, 0x31));
}

/* The number of the child that is met first; hit: those that are met. */
static inline int wide_nearest(wide enter, __m256i hit)
{
    const __m256i least = _mm256_or_si256(wide_keys(enter), _mm256_andnot_si256(hit, _mm256_set1_epi32(INT32_MAX)));
    __m128i least4 = _mm_min_epi32(_mm256_castsi256_si128(least), _mm256_extracti128_si256(least, 1));
    least4 = _mm_min_epi32(least4, _mm_shuffle_epi32(least4, 0x4E));
    least4 = _mm_min_epi32(least4, _mm_shuffle_epi32(least4, 0xB1));
    return _mm_cvtsi128_si32(least4) & 7;
}

/* Entries of the children whose enter <= leave, the nearest last; their number. Writes all eight places. No branches. */
static inline __attribute__((always_inline)) unsigned wide_list(wide enter, wide leave, const pl_ref *child, uint64_t *entries)
{
    const __m256i refs = _mm256_loadu_si256((const __m256i *)child);
#ifdef __AVX512VL__
    const __mmask8 hits = _mm256_cmp_ps_mask(enter, leave, _CMP_LE_OQ);
    const unsigned count = (unsigned)__builtin_popcount(hits);
    const __m256i keys = _mm256_maskz_compress_epi32(hits, wide_keys(enter));
    if (__builtin_expect(count <= 4, 1)) { /* as nearly always: half the work */
        const __m256i sorted = _mm256_castsi128_si256(four_sort(_mm256_castsi256_si128(keys)));
        const __m256i mixed = _mm256_permutex2var_epi32(_mm256_permutexvar_epi32(sorted, refs), _mm256_setr_epi32(0, 8, 1, 9, 2, 10, 3, 11), sorted);
        _mm256_storeu_si256((__m256i *)entries, mixed);
        return count;
    }
    const __m256i sorted = wide_sort(keys);
#else
    const __m256i hit = _mm256_castps_si256(_mm256_cmp_ps(enter, leave, _CMP_LE_OQ));
    const unsigned count = (unsigned)__builtin_popcount((unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(hit)));
    const __m256i sorted = wide_ranks(enter, hit);
#endif
    wide_store(entries, refs, sorted);
    return count;
}

/* The same, but one alone isn't written. *nearest is found by itself, so that the next node needn't wait for the sorting. */
static inline unsigned wide_order(wide enter, wide leave, const pl_ref *child, uint64_t *entries, pl_ref *nearest)
{
    const __m256i hit = _mm256_castps_si256(_mm256_cmp_ps(enter, leave, _CMP_LE_OQ));
    const unsigned mask = (unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(hit));
    *nearest = child[wide_nearest(enter, hit)];
    if ((mask & (mask - 1)) == 0) return mask != 0;
    return wide_list(enter, leave, child, entries);
}
