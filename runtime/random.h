/* random.h - counter-based random numbers: pure functions on 64-bit integers, bit-exact everywhere.
 *
 * bytecode.toml defines them and has test vectors. Example: the first draw of rand(3) in an application with key k is
 * pl_unit(pl_mix(pl_mix(k, pl_bits(3.0)), 0)). */
#ifndef PL_RANDOM_H
#define PL_RANDOM_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "bytecode.h"

/* splitmix64's finalizer (Steele, Lea & Flood 2014; the constants are Stafford's "Mix13"). */
static inline uint64_t pl_finalize(uint64_t z)
{
    z ^= z >> 30;
    z *= PL_RANDOM_FINALIZE_1;
    z ^= z >> 27;
    z *= PL_RANDOM_FINALIZE_2;
    return z ^ (z >> 31);
}

/* A new key from key k and the number x. */
static inline uint64_t pl_mix(uint64_t k, uint64_t x)
{
    return pl_finalize(pl_finalize(x + PL_RANDOM_MIX_ADD_X) ^ (k * PL_RANDOM_MIX_MUL_K + PL_RANDOM_MIX_ADD_K));
}

/* FNV-1a, 64 bits. */
static inline uint64_t pl_name_hash(const char *bytes, size_t length)
{
    uint64_t hash = UINT64_C(0xCBF29CE484222325);
    for (size_t i = 0; i < length; i++)
        hash = (hash ^ (unsigned char)bytes[i]) * UINT64_C(0x100000001B3);
    return hash;
}

/* The IEEE bits of a, those of +0 for -0. */
static inline uint64_t pl_bits(double a)
{
    uint64_t bits;
    a = a == 0 ? 0 : a;
    memcpy(&bits, &a, sizeof bits);
    return bits;
}

/* The upper 53 bits as a number in [0, 1). */
static inline double pl_unit(uint64_t x)
{
    return (double)(x >> 11) * 0x1p-53;
}

static inline uint64_t pl_seed_key(double seed)
{
    return pl_mix(pl_name_hash("plsys", 5), pl_bits(seed));
}

/* The key of term i of a union. */
static inline uint64_t pl_term_key(uint64_t key, uint64_t term)
{
    return pl_mix(key, PL_RANDOM_TERM + term);
}

/* Draw number `ordinal` (from 0) on a stream, given by its bits, in an application with this key. */
static inline double pl_rand(uint64_t key, uint64_t stream_bits, uint64_t ordinal)
{
    return pl_unit(pl_mix(pl_mix(key, stream_bits), ordinal));
}

/* hash(a, …) of n arguments. */
static inline double pl_hash(uint64_t seed_key, size_t n, const double *arguments)
{
    uint64_t h = pl_mix(seed_key, pl_name_hash("hash", 4));
    for (size_t i = 0; i < n; i++)
        h = pl_mix(h, pl_bits(arguments[i]));
    return pl_unit(h);
}

/* A quick hash of numbers' bits, one after the other, and its place in a small table: by the upper bits, since whole numbers
 * have zeros in all others. */
static inline uint64_t pl_quick_hash(uint64_t hash, uint64_t bits)
{
    return (hash ^ bits) * PL_RANDOM_MIX_ADD_X;
}

static inline size_t pl_quick_place(uint64_t hash, uint32_t places)
{
    return (size_t)((hash >> 32) * places >> 32);
}

#endif
