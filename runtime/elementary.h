/* elementary.h - the language's pure functions, one implementation for runtime, compiler and unfolder.
 *
 * Nothing here calls libm's transcendental functions: results depend on IEEE + − · / √ only, in one written order,
 * and so have the same bits for every compiler, optimisation level and instruction set (compiled with contraction
 * off). elementary.c stands alone: it is built into libplsys and once more into the compiler's libelementary.
 *
 * Largest error, measured against 200-bit arithmetic over the whole range, denormal results included
 * (tests/compiler/test_elementary.py): 0.501 units in the last place for exp, log, pow, sin, cos, tan, asin, acos and
 * atan2; mix, written a*(1 - t) + b*t, has its four roundings; everything else is exact or rounded once. */
#ifndef PL_ELEMENTARY_H
#define PL_ELEMENTARY_H

#include <stddef.h>
#include <stdint.h>

#include "plsys.h"

/* Angles in degrees. Multiples of 90 degrees are exact; sin and tan are odd, cos is even. NaN for infinite arguments.
 */
double pl_sin(double degrees);
double pl_cos(double degrees);
void pl_sin_cos(double degrees, double *sin_, double *cos_); /* both, with the same bits */
double pl_tan(double degrees); /* at odd multiples of 90: an infinity of the sign of the sine */
double pl_asin(double a);      /* NaN outside [-1, 1] */
double pl_acos(double a);
double pl_atan2(double y, double x);

double pl_exp(double a);
double pl_log(double a);
double pl_pow(double a, double b); /* special cases as C's pow, Annex F */
double pl_power(double a, double b); /* for shading: pl_pow, but whole b from 0 to 1024 by squaring, within b 2^-53 */
double pl_floor(double a);
double pl_ceil(double a);
double pl_round(double a); /* halves away from zero */
double pl_modulo(double a, double b);
double pl_min(double a, double b); /* a < b ? a : b, so NaN and -0 have one meaning */
double pl_max(double a, double b);

/* A pure opcode (PL_OP_ADD … PL_OP_ATAN2, PL_OP_BOOL) applied to as many of a, b, c as it pops; NaN for any other. */
PL_API double pl_elementary(int opcode, double a, double b, double c);

/* out[i] = opcode(a[i], b[i], c[i]); arrays that the opcode doesn't need may be NULL. false: not a pure opcode. */
PL_API bool pl_elementary_array(int opcode, size_t n, const double *a, const double *b, const double *c, double *out);

/* random.h's functions on arrays of n; `arguments` is n rows of `count`. */
PL_API uint64_t pl_name_hash_of(const char *bytes, size_t length);
PL_API uint64_t pl_seed_key_of(double seed);
PL_API void pl_mix_array(size_t n, const uint64_t *k, const uint64_t *x, uint64_t *out);
PL_API void pl_bits_array(size_t n, const double *a, uint64_t *out);
PL_API void pl_rand_array(size_t n, const uint64_t *key, const uint64_t *stream_bits, const uint64_t *ordinal,
                          double *out);
PL_API void pl_hash_array(size_t n, uint64_t seed_key, size_t count, const double *arguments, double *out);

#endif
