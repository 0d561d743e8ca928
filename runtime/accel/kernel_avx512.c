/* kernel_avx512.c - the traversal (kernel.h) for AVX-512 on vectors of 256 bits. Called on machines that have it only. */
#ifdef __x86_64__
#pragma GCC target("avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi,bmi2,lzcnt,popcnt")
#include <immintrin.h>

#include "bvh.h"

#define KERNEL pl_bvh_trace_avx512

typedef __m256 wide;

#define wide_load(from) _mm256_loadu_ps(from)
#define wide_set(x) _mm256_set1_ps(x)
#define wide_subtract(a, b) _mm256_sub_ps(a, b)
#define wide_multiply(a, b) _mm256_mul_ps(a, b)
#define wide_max(a, b) _mm256_max_ps(a, b) /* the second where the first is NaN */
/* Code of other instruction sets that follows would wait for the upper halves of registers; compilers forget this where
 * vectors are arguments. */
#define wide_end() _mm256_zeroupper()
#define wide_min(a, b) _mm256_min_ps(a, b)

/* Entries of the children whose enter <= leave; their number. Writes all eight places. */
static inline unsigned wide_entries(wide enter, wide leave, const pl_ref *child, uint64_t *entries)
{
    __mmask8 mask = _mm256_cmp_ps_mask(enter, leave, _CMP_LE_OQ);
    __m512i t = _mm512_slli_epi64(_mm512_cvtepu32_epi64(_mm256_castps_si256(enter)), 32);
    __m512i refs = _mm512_cvtepu32_epi64(_mm256_loadu_si256((const __m256i *)child));
    _mm512_storeu_si512(entries, _mm512_maskz_compress_epi64(mask, _mm512_or_si512(t, refs)));
    return (unsigned)__builtin_popcount(mask);
}

#include "kernel.h"
#endif
