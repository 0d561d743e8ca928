/* kernel_avx512.c - the traversal (kernel.h) for AVX-512 on vectors of 256 bits. Called on machines that have it only. */
#ifdef __x86_64__
#pragma GCC target("avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi,bmi2,lzcnt")
#include <immintrin.h>

#define KERNEL pl_bvh_trace_avx512

typedef __m256 wide;

#define wide_load(from) _mm256_loadu_ps(from)
#define wide_set(x) _mm256_set1_ps(x)
#define wide_subtract(a, b) _mm256_sub_ps(a, b)
#define wide_multiply(a, b) _mm256_mul_ps(a, b)
#define wide_max(a, b) _mm256_max_ps(a, b) /* the second where the first is NaN */
#define wide_min(a, b) _mm256_min_ps(a, b)
#define wide_at_most(a, b) (unsigned)_mm256_cmp_ps_mask(a, b, _CMP_LE_OQ)
#define wide_store(to, a) _mm256_storeu_ps(to, a)

#include "kernel.h"
#endif
