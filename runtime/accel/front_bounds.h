/* front_bounds.h - boxes in single precision as a front's tree is built of them, four numbers at once.
 *
 *     bounds b = NOTHING;
 *     join(&b, bounds_of(&boxes[0]));    area(&b)    half the surface of the first box */
#ifndef PL_FRONT_BOUNDS_H
#define PL_FRONT_BOUNDS_H

#include <math.h>
#include <string.h>

#include "front.h"

/* Four numbers at once, of which the fourth means nothing. */
typedef float four __attribute__((vector_size(16)));
typedef int32_t four_ints __attribute__((vector_size(16)));

#ifdef __SSE2__
#include <immintrin.h>
static inline four least(four a, four b)
{
    return (four)_mm_min_ps((__m128)a, (__m128)b);
}

static inline four most(four a, four b)
{
    return (four)_mm_max_ps((__m128)a, (__m128)b);
}
#else
static inline four least(four a, four b)
{
    four_ints less = a < b;
    return (four)(((four_ints)a & less) | ((four_ints)b & ~less));
}

static inline four most(four a, four b)
{
    four_ints more = a > b;
    return (four)(((four_ints)a & more) | ((four_ints)b & ~more));
}
#endif

typedef struct bounds {
    four lo, hi;
} bounds;

#define NOTHING ((bounds){{INFINITY, INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY, -INFINITY}})

/* Without the reference that stands in the fourth number, which as a number may be slow to compute with. */
static inline bounds bounds_of(const pl_boxed *box)
{
    const four_ints three = {-1, -1, -1, 0};
    four lo, hi;
    memcpy(&lo, box->lo, sizeof lo);
    memcpy(&hi, box->hi, sizeof hi);
    return (bounds){(four)((four_ints)lo & three), hi};
}

static inline void join(bounds *b, bounds other)
{
    b->lo = least(b->lo, other.lo);
    b->hi = most(b->hi, other.hi);
}

static inline float area(const bounds *b)
{
    four size = b->hi - b->lo;
    return size[0] >= 0.0f ? size[0] * size[1] + size[1] * size[2] + size[2] * size[0] : 0.0f;
}

#endif
