/* vector.h - three doubles: dot and cross products, unit vectors. All sums in one fixed order (see affine.h). */
#ifndef PL_VECTOR_H
#define PL_VECTOR_H

#include <math.h>
#include <stdbool.h>

static inline double pl_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* out may be neither a nor b. */
static inline void pl_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Squares of lengths that are surely far from the ends of the range of doubles. */
#define PL_LEAST_SQUARE 1e-250
#define PL_MOST_SQUARE 1e250

/* Divides v by its length, which is returned: also where the squares would leave the range of doubles. A vector that
 * has no direction (zero, or not finite) stays as it is, and the result is 0. */
static inline double pl_normalize(double v[3])
{
    const double square = pl_dot(v, v);
    if (square > PL_LEAST_SQUARE && square < PL_MOST_SQUARE) {
        const double length = sqrt(square);
        for (int axis = 0; axis < 3; axis++) v[axis] = v[axis] / length;
        return length;
    }
    const double scale = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
    if (!(scale > 0.0 && scale < INFINITY)) return 0.0;
    const double scaled[3] = {v[0] / scale, v[1] / scale, v[2] / scale};
    const double length = sqrt(pl_dot(scaled, scaled));
    if (!(length > 0.0 && length < INFINITY)) return 0.0;
    for (int axis = 0; axis < 3; axis++) v[axis] = scaled[axis] / length;
    return length * scale;
}

static inline bool pl_finite(const double v[3])
{
    return (v[0] - v[0]) + (v[1] - v[1]) + (v[2] - v[2]) == 0.0; /* else NaN */
}

#endif
