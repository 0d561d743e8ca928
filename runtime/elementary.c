/* elementary.c - see elementary.h.
 *
 * Method: arguments are reduced exactly, the function is evaluated as an unevaluated sum of two doubles
 * ("double-double": Dekker 1971) with a relative error below 2^-62, and rounded once. Of each Taylor series only the
 * leading terms need double-double; the rest, small enough, is a Horner scheme in double. Sine and cosine are looked up
 * (circular.h). Sources: Muller et al., Handbook of Floating-Point Arithmetic, chapters 4, 5 and 11. */
#include "elementary.h"

#include <math.h>

#include "bytecode.h"
#include "circular.h"
#include "double_double.h"
#include "random.h"

/* --- circular functions --- */

static const pair THIRD = {0x1.5555555555555p-2, 0x1.5555555555555p-56};

/* a * constant, rounded once, for every finite a != 0. */
static double scaled(double a, pair constant)
{
    int exponent;
    const double mantissa = split(a, &exponent);
    return join(scale_by(constant, mantissa), exponent);
}

/* degrees = 360 n + 90 * quadrant + rest exactly, |rest| <= 45. Every step is exact (fmod; Sterbenz for the
 * difference). */
static double reduce(double degrees, int *quadrant)
{
    const double turn = fabs(degrees) < 360 ? degrees : fmod(degrees, 360);
    const double q = pl_round(turn / 90);
    *quadrant = (int)q & 3;
    return turn - 90 * q;
}

/* Below this an angle's sine and tangent are the angle, its cosine is 1, as far as a double can tell. */
static const double TINY = 0x1p-40;

double pl_sin(double degrees)
{
    if (!(degrees - degrees == 0) || degrees == 0)
        return degrees == 0 ? degrees : NAN;
    int quadrant;
    const double rest = reduce(degrees, &quadrant);
    pair result;
    if (quadrant % 2 == 0 && fabs(rest) < TINY) {
        const double small = rest == 0 ? 0 : scaled(rest, RADIANS);
        return rest == 0 ? copysign(0, degrees) : quadrant == 2 ? -small : small;
    }
    result = quadrant % 2 ? cosine(rest) : sine(rest);
    return quadrant >= 2 ? -result.high - result.low : result.high + result.low;
}

double pl_cos(double degrees)
{
    if (!(degrees - degrees == 0))
        return NAN;
    int quadrant;
    const double rest = reduce(degrees, &quadrant);
    if (quadrant % 2 && rest == 0)
        return 0;
    if (quadrant % 2 == 0 && fabs(rest) < TINY)
        return quadrant == 2 ? -1 : 1;
    const pair result = quadrant % 2 ? sine(rest) : cosine(rest);
    return quadrant == 1 || quadrant == 2 ? -result.high - result.low : result.high + result.low;
}

void pl_sin_cos(double degrees, double *sin_, double *cos_)
{
    int quadrant;
    const double rest = degrees - degrees == 0 ? reduce(degrees, &quadrant) : 0;
    if (fabs(rest) < TINY) {
        *sin_ = pl_sin(degrees);
        *cos_ = pl_cos(degrees);
        return;
    }
    pair s, c;
    sine_and_cosine(rest, &s, &c);
    const double a = s.high + s.low, b = c.high + c.low;
    *sin_ = quadrant == 0 ? a : quadrant == 1 ? b : quadrant == 2 ? -a : -b;
    *cos_ = quadrant == 0 ? b : quadrant == 1 ? -a : quadrant == 2 ? -b : a;
}

double pl_tan(double degrees)
{
    if (!(degrees - degrees == 0) || degrees == 0)
        return degrees == 0 ? degrees : NAN;
    int quadrant;
    const double rest = reduce(degrees, &quadrant);
    if (rest == 0)
        return quadrant % 2 ? copysign(INFINITY, pl_sin(degrees)) : copysign(0, degrees);
    if (quadrant % 2 == 0 && fabs(rest) < TINY)
        return scaled(rest, RADIANS);
    pair s, c;
    sine_and_cosine(rest, &s, &c);
    const pair result = quadrant % 2 ? divide(negate(c), s) : divide(s, c);
    return result.high + result.low;
}

/* Arc tangent of n / d in degrees, for 0 <= n <= d, d > 0, nothing near over- or underflow. With c = j/16 near n/d:
 * atan(n/d) = atan(c) + atan((n - c d) / (d + c n)), whose argument is at most 1/32. */
static pair arc_tangent(pair n, pair d)
{
    static const pair table[17] = {
        {0x0.0p+0, 0x0.0p+0},
        {0x1.c9c55326164cfp+1, -0x1.88708ff33aabap-55},
        {0x1.c80044927fe83p+2, -0x1.2a9346eb4b87bp-53},
        {0x1.53d4374d3c2a3p+3, 0x1.c5b7fa992d71fp-52},
        {0x1.c128e80fae02ep+3, -0x1.0fc10e257c651p-53},
        {0x1.15aa15bcab87ep+4, 0x1.2f23fe5f78d35p-52},
        {0x1.48e58fac13547p+4, 0x1.bdef92fae944fp-51},
        {0x1.7a11ee6220071p+4, -0x1.63c539bb8dcc2p-55},
        {0x1.a90a731a61dc4p+4, -0x1.80b27b26e182bp-51},
        {0x1.d5b95bc765110p+4, 0x1.6f006acd20fc1p-52},
        {0x1.000b0659f5545p+5, 0x1.0e62435c62f2fp-49},
        {0x1.141174800a666p+5, 0x1.e004defca5108p-50},
        {0x1.26f58ce59e23cp+5, 0x1.80b27b26e182bp-50},
        {0x1.38c03916765b8p+5, 0x1.50a2d34ee7050p-49},
        {0x1.497cc65551cf8p+5, -0x1.2dd089737cc28p-49},
        {0x1.5938181bde651p+5, 0x1.ea28ab192aaf3p-51},
        {0x1.6800000000000p+5, 0x0.0p+0},
    };
    const int j = (int)(n.high / d.high * 16 + 0.5);
    const double c = j / 16.0;
    const pair u = divide(add(n, scale_by(d, -c)), add(d, scale_by(n, c)));
    const pair u2 = multiply(u, u);
    const double z = u2.high;
    const double tail = 1.0 / 5 + z * (-1.0 / 7 + z * (1.0 / 9 + z * (-1.0 / 11 + z * (1.0 / 13 - z / 15))));
    const pair sum = add(negate(THIRD), two_product(z, tail));
    const pair angle = add(u, multiply(u, multiply(u2, sum)));
    return add(table[j], multiply(angle, DEGREES));
}

/* atan2 in degrees of n (its sign apart) and d, neither 0. */
static pair angle_of(pair n, pair d)
{
    const bool left = d.high < 0;
    if (left)
        d = negate(d);
    pair angle;
    if (n.high <= d.high)
        angle = arc_tangent(n, d);
    else
        angle = add((pair){90, 0}, negate(arc_tangent(d, n)));
    return left ? add((pair){180, 0}, negate(angle)) : angle;
}

double pl_atan2(double y, double x)
{
    if (x != x || y != y)
        return NAN;
    const bool left = signbit(x);
    if (y == 0)
        return copysign(left ? 180 : 0, y);
    if (x == 0)
        return copysign(90, y);
    const bool x_infinite = x - x != 0, y_infinite = y - y != 0;
    if (x_infinite && y_infinite)
        return copysign(left ? 135 : 45, y);
    if (x_infinite)
        return copysign(left ? 180 : 0, y);
    if (y_infinite)
        return copysign(90, y);
    int x_exponent, y_exponent;
    const double x_mantissa = split(x, &x_exponent), y_mantissa = fabs(split(y, &y_exponent));
    const int difference = y_exponent - x_exponent;
    if (difference > 60)
        return copysign(90, y);
    if (difference < -60) {
        if (left)
            return copysign(180, y);
        const pair quotient = divide((pair){y_mantissa, 0}, (pair){x_mantissa, 0});
        return copysign(join(multiply(quotient, DEGREES), difference), y);
    }
    const pair angle = angle_of((pair){y_mantissa * power_of_two(difference), 0}, (pair){x_mantissa, 0});
    return copysign(angle.high + angle.low, y);
}

/* sqrt(1 - a^2). */
static pair other_leg(double a)
{
    return root(multiply(two_sum(1, -a), two_sum(1, a)));
}

double pl_asin(double a)
{
    if (!(fabs(a) <= 1))
        return NAN;
    if (fabs(a) < TINY)
        return a == 0 ? a : scaled(a, DEGREES);
    if (fabs(a) == 1)
        return 90 * a;
    const pair angle = angle_of((pair){fabs(a), 0}, other_leg(a));
    return copysign(angle.high + angle.low, a);
}

double pl_acos(double a)
{
    if (!(fabs(a) <= 1))
        return NAN;
    if (fabs(a) < 0x1p-60)
        return 90;
    if (fabs(a) == 1)
        return a > 0 ? 0 : 180;
    const pair angle = angle_of(other_leg(a), (pair){a, 0});
    return angle.high + angle.low;
}

/* --- exponential functions --- */

/* e^(x.high + x.low), rounded once, for |x.high| < 800. x = k log 2 + r, |r| < 0.35; e^r by Taylor. */
static double exponential(pair x, bool negative)
{
    static const double LOG2_1 = 0x1.62e42fefa3800p-1;                          /* 42 bits: k times it is exact */
    static const pair LOG2_2 = {0x1.ef35793c76730p-45, 0x1.f97b57a079a19p-103}; /* the rest */
    static const pair c4 = {0x1.5555555555555p-5, 0x1.5555555555555p-59},
                      c3 = {0x1.5555555555555p-3, 0x1.5555555555555p-57};
    const double k = pl_round(x.high * 0x1.71547652b82fep+0);
    pair r = two_sum(x.high, -k * LOG2_1);
    r = add(r, add((pair){x.low, 0}, scale_by(LOG2_2, -k)));
    const double z = r.high;
    double tail = 1.0 / 355687428096000;
    static const double coefficients[] = {1.0 / 20922789888000, 1.0 / 1307674368000, 1.0 / 87178291200,
                                          1.0 / 6227020800,     1.0 / 479001600,     1.0 / 39916800,
                                          1.0 / 3628800,        1.0 / 362880,        1.0 / 40320,
                                          1.0 / 5040,           1.0 / 720,           1.0 / 120};
    for (size_t i = 0; i < sizeof coefficients / sizeof *coefficients; i++)
        tail = coefficients[i] + z * tail;
    pair sum = add(c4, two_product(z, tail));
    sum = add(c3, multiply(r, sum));
    sum = add((pair){0.5, 0}, multiply(r, sum));
    sum = add((pair){1, 0}, multiply(r, sum));
    sum = add((pair){1, 0}, multiply(r, sum));
    return join(negative ? negate(sum) : sum, (int)k);
}

/* Natural logarithm of finite a > 0: a = 2^k m, log m = 2 atanh((m - 1) / (m + 1)) with m between sqrt(1/2) and
 * sqrt 2. */
static pair logarithm(double a)
{
    static const pair LOG2 = {0x1.62e42fefa39efp-1, 0x1.abc9e3b39803fp-56};
    static const pair c2 = {0x1.999999999999ap-3, -0x1.999999999999ap-57},
                      c3 = {0x1.2492492492492p-3, 0x1.2492492492492p-57};
    int k;
    double m = split(a, &k);
    if (m > 0x1.6a09e667f3bcdp+0) {
        m /= 2;
        k++;
    }
    const pair s = divide((pair){m - 1, 0}, two_sum(m, 1)), s2 = multiply(s, s);
    const double z = s2.high;
    double tail = 1.0 / 35;
    for (int i = 33; i >= 9; i -= 2)
        tail = 1.0 / i + z * tail;
    pair sum = add(c3, two_product(z, tail));
    sum = add(c2, multiply(s2, sum));
    sum = add(THIRD, multiply(s2, sum));
    sum = add(s, multiply(s, multiply(s2, sum)));
    sum = (pair){2 * sum.high, 2 * sum.low};
    return k ? add(scale_by(LOG2, k), sum) : sum;
}

double pl_exp(double a)
{
    if (a != a)
        return a;
    if (a > 710)
        return INFINITY;
    if (a < -746)
        return 0;
    return exponential((pair){a, 0}, false);
}

double pl_log(double a)
{
    if (!(a > 0))
        return a == 0 ? -INFINITY : NAN;
    if (a - a != 0)
        return a;
    const pair result = logarithm(a);
    return result.high + result.low;
}

double pl_pow(double a, double b)
{
    if (b == 0 || a == 1)
        return 1;
    if (a != a || b != b)
        return NAN;
    const double size = fabs(a);
    const bool whole = pl_floor(b) == b, odd = whole && fabs(b) < 0x1p53 && fmod(b, 2) != 0;
    if (b - b != 0) { /* infinite */
        if (size == 1)
            return 1;
        return (size > 1) == (b > 0) ? INFINITY : 0;
    }
    if (size == 0 || size - size != 0) {
        const double magnitude = (size == 0) == (b > 0) ? 0 : INFINITY;
        return odd ? copysign(magnitude, a) : magnitude;
    }
    if (a < 0 && !whole)
        return NAN;
    const bool negative = a < 0 && odd;
    const pair log_size = logarithm(size);
    const double estimate = b * log_size.high;
    if (estimate > 710)
        return negative ? -INFINITY : INFINITY;
    if (estimate < -746)
        return negative ? -0.0 : 0;
    if (fabs(estimate) < 0x1p-60)
        return negative ? -1 : 1;
    return exponential(scale_by(log_size, b), negative); /* b < 2^63: a logarithm that isn't 0 is above 2^-54 */
}

double pl_power(double a, double b)
{
    if (!(b >= 0 && b <= 1024 && pl_floor(b) == b))
        return pl_pow(a, b);
    double power = 1;
    for (unsigned n = (unsigned)b; n; n >>= 1, a *= a)
        if (n & 1)
            power *= a;
    return power;
}

/* --- rounding and comparing --- */

double pl_floor(double a)
{
    return floor(a);
}

double pl_ceil(double a)
{
    return ceil(a);
}

double pl_round(double a)
{
    const double size = fabs(a), below = floor(size);
    return copysign(size - below >= 0.5 ? below + 1 : below, a);
}

double pl_modulo(double a, double b)
{
    return fmod(a, b);
}

double pl_min(double a, double b)
{
    return a < b ? a : b;
}

double pl_max(double a, double b)
{
    return a > b ? a : b;
}

/* --- by opcode --- */

static bool apply(int opcode, double a, double b, double c, double *out)
{
    switch (opcode) {
    case PL_OP_BOOL: *out = a != 0; return true;
    case PL_OP_ADD: *out = a + b; return true;
    case PL_OP_SUBTRACT: *out = a - b; return true;
    case PL_OP_MULTIPLY: *out = a * b; return true;
    case PL_OP_DIVIDE: *out = a / b; return true;
    case PL_OP_MODULO: *out = pl_modulo(a, b); return true;
    case PL_OP_NEGATE: *out = -a; return true;
    case PL_OP_NOT: *out = a == 0; return true;
    case PL_OP_LESS: *out = a < b; return true;
    case PL_OP_LESS_EQUAL: *out = a <= b; return true;
    case PL_OP_GREATER: *out = a > b; return true;
    case PL_OP_GREATER_EQUAL: *out = a >= b; return true;
    case PL_OP_EQUAL: *out = a == b; return true;
    case PL_OP_NOT_EQUAL: *out = a != b; return true;
    case PL_OP_ABS: *out = fabs(a); return true;
    case PL_OP_SIGN: *out = a > 0 ? 1 : a < 0 ? -1 : a == 0 ? 0 : a; return true;
    case PL_OP_FLOOR: *out = pl_floor(a); return true;
    case PL_OP_CEIL: *out = pl_ceil(a); return true;
    case PL_OP_ROUND: *out = pl_round(a); return true;
    case PL_OP_MIN: *out = pl_min(a, b); return true;
    case PL_OP_MAX: *out = pl_max(a, b); return true;
    case PL_OP_CLAMP: *out = pl_min(pl_max(a, b), c); return true;
    case PL_OP_MIX: *out = a * (1 - c) + b * c; return true;
    case PL_OP_POW: *out = pl_pow(a, b); return true;
    case PL_OP_EXP: *out = pl_exp(a); return true;
    case PL_OP_LOG: *out = pl_log(a); return true;
    case PL_OP_SQRT: *out = sqrt(a); return true;
    case PL_OP_SIN: *out = pl_sin(a); return true;
    case PL_OP_COS: *out = pl_cos(a); return true;
    case PL_OP_TAN: *out = pl_tan(a); return true;
    case PL_OP_ASIN: *out = pl_asin(a); return true;
    case PL_OP_ACOS: *out = pl_acos(a); return true;
    case PL_OP_ATAN2: *out = pl_atan2(a, b); return true;
    default: *out = NAN; return false;
    }
}

double pl_elementary(int opcode, double a, double b, double c)
{
    double out;
    apply(opcode, a, b, c, &out);
    return out;
}

bool pl_elementary_array(int opcode, size_t n, const double *a, const double *b, const double *c, double *out)
{
    double unused;
    if (!apply(opcode, 0, 0, 0, &unused))
        return false;
    for (size_t i = 0; i < n; i++)
        apply(opcode, a[i], b ? b[i] : 0, c ? c[i] : 0, &out[i]);
    return true;
}

/* --- random numbers on arrays --- */

uint64_t pl_name_hash_of(const char *bytes, size_t length)
{
    return pl_name_hash(bytes, length);
}

uint64_t pl_seed_key_of(double seed)
{
    return pl_seed_key(seed);
}

void pl_mix_array(size_t n, const uint64_t *k, const uint64_t *x, uint64_t *out)
{
    for (size_t i = 0; i < n; i++)
        out[i] = pl_mix(k[i], x[i]);
}

void pl_bits_array(size_t n, const double *a, uint64_t *out)
{
    for (size_t i = 0; i < n; i++)
        out[i] = pl_bits(a[i]);
}

void pl_rand_array(size_t n, const uint64_t *key, const uint64_t *stream_bits, const uint64_t *ordinal, double *out)
{
    for (size_t i = 0; i < n; i++)
        out[i] = pl_rand(key[i], stream_bits[i], ordinal[i]);
}

void pl_hash_array(size_t n, uint64_t seed_key, size_t count, const double *arguments, double *out)
{
    for (size_t i = 0; i < n; i++)
        out[i] = pl_hash(seed_key, count, arguments + i * count);
}
