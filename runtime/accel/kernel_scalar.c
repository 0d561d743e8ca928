/* kernel_scalar.c - the traversal (kernel.h) in plain C, for any machine. */
#include <string.h>

#include "bvh.h"
#include "lazy.h"

/* Vectors of four doubles are lowered to what there is; they don't leave this file. */
#pragma GCC diagnostic ignored "-Wpsabi"

#define KERNEL pl_bvh_trace_scalar
#define STREAM_KERNEL pl_bvh_stream_scalar
#define TERRAIN_KERNEL pl_terrain_trace_scalar
#define GATED_KERNEL pl_gated_trace_scalar
#define LAZY_KERNEL pl_lazy_kernel_scalar

#define wide_end() ((void)0)
#define four_fma(a, b, c) ((a) * (b) + (c))

#define four_min(a, b) four_least(a, b)
#define four_max(a, b) (-four_least(-(a), -(b)))

typedef float four __attribute__((vector_size(16), aligned(4), may_alias));

static inline four four_least(four a, four b)
{
    for (int i = 0; i < 4; i++) a[i] = a[i] < b[i] ? a[i] : b[i];
    return a;
}

typedef struct wide {
    float at[8];
} wide;

static inline wide wide_load(const float *from)
{
    wide w;
    for (int i = 0; i < 8; i++) w.at[i] = from[i];
    return w;
}

static inline wide wide_set(float x)
{
    wide w;
    for (int i = 0; i < 8; i++) w.at[i] = x;
    return w;
}

static inline wide wide_bytes(const uint8_t *from)
{
    wide w;
    for (int i = 0; i < 8; i++) w.at[i] = (float)from[i];
    return w;
}

static inline wide wide_multiply_subtract(wide a, wide b, wide c)
{
    for (int i = 0; i < 8; i++) a.at[i] = a.at[i] * b.at[i] - c.at[i];
    return a;
}

static inline wide wide_multiply_add(wide a, wide b, wide c)
{
    for (int i = 0; i < 8; i++) a.at[i] = a.at[i] * b.at[i] + c.at[i];
    return a;
}

/* The second where the first is NaN. */
static inline wide wide_max(wide a, wide b)
{
    for (int i = 0; i < 8; i++) a.at[i] = a.at[i] > b.at[i] ? a.at[i] : b.at[i];
    return a;
}

static inline wide wide_min(wide a, wide b)
{
    for (int i = 0; i < 8; i++) a.at[i] = a.at[i] < b.at[i] ? a.at[i] : b.at[i];
    return a;
}

enum { ENTRIES_AT_ONCE = 4 };

/* Which of so many entries don't exceed a limit. */
static inline uint32_t entries_within(const uint64_t *entries, uint64_t limit)
{
    uint32_t within = 0;
    for (int i = 0; i < ENTRIES_AT_ONCE; i++) within |= (uint32_t)(entries[i] <= limit) << i;
    return within;
}

/* Which of eight integers don't exceed others. */
static inline uint32_t wide_at_most(const uint32_t *a, const uint32_t *b)
{
    uint32_t set = 0;
    for (int i = 0; i < 8; i++) set |= (uint32_t)(a[i] <= b[i]) << i;
    return set;
}

/* Which of eight references are of a kind. */
static inline uint32_t wide_of_kind(const pl_ref *refs, uint32_t kind)
{
    uint32_t set = 0;
    for (int i = 0; i < 8; i++) set |= (uint32_t)(refs[i] >> PL_REF_SHIFT == kind) << i;
    return set;
}

/* Entries of the children whose enter <= leave, the nearest last; their number. */
static inline unsigned wide_list(wide enter, wide leave, const pl_ref *child, uint64_t *entries)
{
    unsigned count = 0;
    for (int i = 0; i < 8; i++) {
        if (!(enter.at[i] <= leave.at[i])) continue;
        uint32_t bits;
        memcpy(&bits, &enter.at[i], sizeof bits);
        uint64_t entry = (uint64_t)bits << 32 | child[i];
        unsigned place = count++;
        for (; place > 0 && entries[place - 1] < entry; place--) entries[place] = entries[place - 1];
        entries[place] = entry;
    }
    return count;
}

static inline unsigned wide_order(wide enter, wide leave, const pl_ref *child, uint64_t *entries, pl_ref *nearest)
{
    const unsigned count = wide_list(enter, leave, child, entries);
    if (count) *nearest = (pl_ref)entries[count - 1];
    return count;
}

#include "kernel.h"
#include "kernel_stream.h"
#include "gated_kernel.h"
#include "terrain_kernel.h"

/* The second where one is NaN. */
static inline double4 double4_max(double4 a, double4 b)
{
    for (int i = 0; i < 4; i++) a[i] = a[i] > b[i] ? a[i] : b[i];
    return a;
}

static inline double4 double4_min(double4 a, double4 b)
{
    for (int i = 0; i < 4; i++) a[i] = a[i] < b[i] ? a[i] : b[i];
    return a;
}

static inline double4 double4_root(double4 a)
{
    for (int i = 0; i < 4; i++) a[i] = sqrt(a[i]);
    return a;
}

/* A bit for each true one of a comparison. */
static inline uint32_t double4_bits(long4 c)
{
    return (uint32_t)((c[0] & 1) | (c[1] & 2) | (c[2] & 4) | (c[3] & 8));
}

#include "lazy_kernel.h"
