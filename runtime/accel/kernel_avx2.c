/* kernel_avx2.c - the traversal (kernel.h) for AVX2. Called on machines that have it only. */
#ifdef __x86_64__
#pragma GCC target("avx2,fma,bmi,bmi2,lzcnt,popcnt")

#include "bvh.h"
#include "lazy.h"

#define KERNEL pl_bvh_trace_avx2
#define STREAM_KERNEL pl_bvh_stream_avx2
#define TERRAIN_KERNEL pl_terrain_trace_avx2
#define TERRAIN_PACKET pl_terrain_packet_avx2
#define PACKET_KERNEL pl_bvh_packet_avx2
#define GATED_KERNEL pl_gated_trace_avx2
#define LAZY_KERNEL pl_lazy_kernel_avx2
#define GATED_PACKET pl_gated_packet_avx2

#include "kernel_vector.h"

#include "kernel.h"
#include "kernel_stream.h"
#include "kernel_packet.h"
#include "gated_kernel.h"
#include "gated_packet.h"
#include "terrain_kernel.h"
#include "terrain_packet.h"
#include "lazy_kernel.h"
#endif
