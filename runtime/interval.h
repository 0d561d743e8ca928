/* interval.h - running code on intervals: what an expression can be, whatever is drawn.
 *
 *     pl_range parameters[…];                             lo = NaN: not assigned
 *     pl_range_result result;
 *     if (!pl_range_run(program, code, parameters, &result)) …   nothing is known
 *
 * Draws and hashes are [0, 1]. Points stay points, bit for bit, as long as only points go into them, so that counters are exact;
 * everything else is rounded outward. Where a condition may go both ways, both are run and joined. What would be an error
 * for some of the values just bounds the others. */
#ifndef PL_INTERVAL_H
#define PL_INTERVAL_H

#include "expression.h"

typedef struct pl_range {
    double lo, hi;
} pl_range;

/* Operations of a transformation that can be followed one by one: more are followed as a matrix of ranges. */
enum { PL_RANGE_STEPS = 8 };

/* PL_OP_TRANS, a rotation about an axis or a scaling, with its arguments. */
typedef struct pl_range_step {
    uint8_t opcode;
    pl_range arguments[3];
} pl_range_step;

/* A matrix that isn't known exactly, row by row as pl_affine, with what bounds of rounding errors need: the largest stretch
 * of any such matrix and of its inverse. And, where they are known, the operations whose product it is, the outermost first: ranges
 * of its entries don't tell that the columns of a rotation are unit vectors. */
typedef struct pl_range_map {
    pl_range m[12];
    double stretch, inverse_stretch;
    int step_count; /* -1: unknown */
    pl_range_step steps[PL_RANGE_STEPS];
} pl_range_map;

typedef struct pl_range_result {
    uint32_t count;
    pl_range values[PL_LIMIT_STACK];
    pl_range_map map;
} pl_range_result;

static inline pl_range pl_range_of(double a)
{
    return (pl_range){a, a};
}

static inline bool pl_range_is_point(pl_range a)
{
    return a.lo == a.hi;
}

static inline pl_range pl_range_join(pl_range a, pl_range b)
{
    return (pl_range){a.lo < b.lo ? a.lo : b.lo, a.hi > b.hi ? a.hi : b.hi};
}

pl_range pl_range_add(pl_range a, pl_range b);
pl_range pl_range_multiply(pl_range a, pl_range b);

/* A pure opcode; everything where nothing is known. */
pl_range pl_range_apply(int opcode, pl_range a, pl_range b, pl_range c);

/* parameters are changed by stores. false: too many ways, or values that aren't numbers. */
bool pl_range_run(const pl_program *program, uint32_t code, pl_range *parameters, pl_range_result *result);

#endif
