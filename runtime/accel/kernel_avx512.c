/* kernel_avx512.c - the traversal (kernel.h) for AVX-512 on vectors of 256 bits, for rays alone and in streams: 7 % faster than
 * AVX2. Packets are 4 to 8 % faster in kernel_avx2.c. Called on machines that have it only. */
#ifdef __x86_64__
#pragma GCC target("avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi,bmi2,lzcnt,popcnt")

#include "bvh.h"
#include "lazy.h"

#define KERNEL pl_bvh_trace_avx512
#define STREAM_KERNEL pl_bvh_stream_avx512
#define TERRAIN_KERNEL pl_terrain_trace_avx512
#define GATED_KERNEL pl_gated_trace_avx512
#define LAZY_KERNEL pl_lazy_kernel_avx512

#include "kernel_vector.h"

#include "kernel.h"
#include "kernel_stream.h"
#include "gated_kernel.h"
#include "terrain_kernel.h"
#include "lazy_kernel.h"
#endif
