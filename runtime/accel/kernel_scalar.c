/* kernel_scalar.c - the traversal (kernel.h) in plain C, for any machine. */
#define KERNEL pl_bvh_trace_scalar

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

static inline unsigned wide_at_most(wide a, wide b)
{
    unsigned mask = 0;
    for (int i = 0; i < 8; i++) mask |= (unsigned)(a.at[i] <= b.at[i]) << i;
    return mask;
}

static inline void wide_store(float *to, wide a)
{
    for (int i = 0; i < 8; i++) to[i] = a.at[i];
}

#include "kernel.h"
