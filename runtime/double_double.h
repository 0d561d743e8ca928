/* double_double.h - numbers that are the sum of two doubles, and exponents, for elementary.c and circular.h.
 *
 *     const pair third = divide((pair){1, 0}, (pair){3, 0});     100 bits of it at least
 *
 * An unevaluated sum high + low has 106 bits (Dekker 1971; Muller et al., Handbook of Floating-Point Arithmetic, chapters 4
 * and 5). Everything here relies on each operation being rounded once, to double. */
#ifndef PL_DOUBLE_DOUBLE_H
#define PL_DOUBLE_DOUBLE_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined __FAST_MATH__ || \
    (__FLT_EVAL_METHOD__ != 0 && __FLT_EVAL_METHOD__ != 16) /* 16: only half precision is widened */
#error \
    "results must have the same bits everywhere: compile without -ffast-math, for a machine with IEEE double arithmetic"
#endif

/* --- double-double --- */

typedef struct pair {
    double high, low; /* |low| <= ulp(high) / 2 */
} pair;

/* a + b exactly, for |a| >= |b| or a = 0. */
static inline pair fast_two_sum(double a, double b)
{
    const double sum = a + b;
    return (pair){sum, b - (sum - a)};
}

/* a + b exactly. */
static inline pair two_sum(double a, double b)
{
    const double sum = a + b, b_seen = sum - a;
    return (pair){sum, (a - (sum - b_seen)) + (b - b_seen)};
}

/* The upper 26 bits; for |a| < 2^996. */
static inline double upper(double a)
{
    const double t = 0x1.0000002p27 * a;
    return t - (t - a);
}

static inline pair add(pair a, pair b)
{
    pair high = two_sum(a.high, b.high);
    const pair low = two_sum(a.low, b.low);
    high = fast_two_sum(high.high, high.low + low.high);
    return fast_two_sum(high.high, high.low + low.low);
}

/* a * b exactly, where nothing over- or underflows. */
static inline pair two_product(double a, double b)
{
    const double product = a * b, a1 = upper(a), b1 = upper(b), a2 = a - a1, b2 = b - b1;
    return (pair){product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2};
}

static inline pair multiply(pair a, pair b)
{
    const pair p = two_product(a.high, b.high);
    return fast_two_sum(p.high, p.low + (a.high * b.low + a.low * b.high));
}

static inline pair scale_by(pair a, double b)
{
    return multiply(a, (pair){b, 0});
}

static inline pair divide(pair a, pair b)
{
    const double q1 = a.high / b.high;
    const pair p = scale_by(b, q1);
    const pair rest = add(a, (pair){-p.high, -p.low});
    return fast_two_sum(q1, rest.high / b.high);
}

/* Newton's step from the double root. */
static inline pair root(pair a)
{
    if (a.high <= 0)
        return (pair){0, 0};
    const double r = sqrt(a.high);
    const pair square = two_product(r, r);
    const pair rest = add(a, (pair){-square.high, -square.low});
    return fast_two_sum(r, rest.high / (2 * r));
}

static inline pair negate(pair a)
{
    return (pair){-a.high, -a.low};
}

/* --- exponents --- */

static inline uint64_t bits_of(double a)
{
    uint64_t bits;
    memcpy(&bits, &a, sizeof bits);
    return bits;
}

static inline double from_bits(uint64_t bits)
{
    double a;
    memcpy(&a, &bits, sizeof a);
    return a;
}

/* 2^exponent for -1022 <= exponent <= 1023. */
static inline double power_of_two(int exponent)
{
    return from_bits((uint64_t)(exponent + 1023) << 52);
}

/* a = result * 2^*exponent with 1 <= |result| < 2, for finite a != 0. */
static inline double split(double a, int *exponent)
{
    int e = 0;
    if (fabs(a) < 0x1p-1022) {
        a *= 0x1p54;
        e = -54;
    }
    const uint64_t bits = bits_of(a);
    *exponent = e + (int)((bits >> 52) & 0x7FF) - 1023;
    return from_bits((bits & UINT64_C(0x800FFFFFFFFFFFFF)) | UINT64_C(0x3FF0000000000000));
}

/* a * 2^exponent, rounded once, also to a denormal number, 0 or infinity. 2^-60 < |a.high| < 2^60. */
static inline double join(pair a, int exponent)
{
    if (exponent > 2000)
        exponent = 2000;
    if (exponent < -2000)
        exponent = -2000;
    int e;
    split(a.high, &e);
    if (e + exponent >= -1022) {
        double result = a.high + a.low;
        for (; exponent > 1023; exponent -= 1000)
            result *= 0x1p1000;
        for (; exponent < -900; exponent += 900)
            result *= 0x1p-900;
        return result * power_of_two(exponent);
    }
    if (e + exponent < -1080)
        return a.high < 0 ? -0.0 : 0.0;
    /* Adding a number whose ulp is the denormals' spacing, 2^(-1074 - exponent), rounds there. */
    const double anchor = copysign(1, a.high) * power_of_two(-1022 - exponent);
    const pair sum = two_sum(anchor, a.high);
    const double rounded = (sum.high + (sum.low + a.low)) - anchor;
    const int half = exponent / 2;
    return copysign(rounded * power_of_two(half) * power_of_two(exponent - half), a.high);
}

#endif
