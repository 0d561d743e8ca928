/* kernel_avx2.c - the traversal (kernel.h) for AVX2. Called on machines that have it only. */
#ifdef __x86_64__
#pragma GCC target("avx2,fma,bmi,bmi2,lzcnt")
#include <immintrin.h>

#include "bvh.h"

#define KERNEL pl_bvh_trace_avx2

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

/* Entries of the children whose enter <= leave; their number. */
static inline unsigned wide_entries(wide enter, wide leave, const pl_ref *child, uint64_t *entries)
{
    unsigned mask = (unsigned)_mm256_movemask_ps(_mm256_cmp_ps(enter, leave, _CMP_LE_OQ)), count = 0;
    uint32_t bits[8];
    _mm256_storeu_si256((__m256i *)bits, _mm256_castps_si256(enter));
    for (; mask; mask &= mask - 1) {
        int i = __builtin_ctz(mask);
        entries[count++] = (uint64_t)bits[i] << 32 | child[i];
    }
    return count;
}

#include "kernel.h"
#endif
