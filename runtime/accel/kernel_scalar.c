/* kernel_scalar.c - the traversal (kernel.h) in plain C, for any machine. */
#include <string.h>

#include "bvh.h"

/* Vectors of four doubles are lowered to what there is; they don't leave this file. */
#pragma GCC diagnostic ignored "-Wpsabi"

#define KERNEL pl_bvh_trace_scalar

#define wide_end() ((void)0)

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

static inline wide wide_subtract(wide a, wide b)
{
    for (int i = 0; i < 8; i++) a.at[i] -= b.at[i];
    return a;
}

static inline wide wide_multiply(wide a, wide b)
{
    for (int i = 0; i < 8; i++) a.at[i] *= b.at[i];
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

/* Entries of the children whose enter <= leave; their number. */
static inline unsigned wide_entries(wide enter, wide leave, const pl_ref *child, uint64_t *entries)
{
    unsigned count = 0;
    for (int i = 0; i < 8; i++) {
        uint32_t bits;
        memcpy(&bits, &enter.at[i], sizeof bits);
        entries[count] = (uint64_t)bits << 32 | child[i];
        count += enter.at[i] <= leave.at[i];
    }
    return count;
}

#include "kernel.h"
