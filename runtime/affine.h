/* affine.h - 3x4 affine maps in double: p' = M·(p, 1).
 *
 * m holds the rows one after another: m[4*r + c]; column 3 is the translation. Nothing here allocates or fails but
 * pl_affine_inverse, which says so for singular maps. All sums are written in one fixed order and compiled without
 * contraction, so results have the same bits on every machine. */
#ifndef PL_AFFINE_H
#define PL_AFFINE_H

#include <stdbool.h>

typedef struct pl_affine {
    double m[12];
} pl_affine;

static inline pl_affine pl_affine_identity(void)
{
    return (pl_affine){{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
}

/* a·b: b acts first. */
static inline pl_affine pl_affine_multiply(const pl_affine *a, const pl_affine *b)
{
    pl_affine product;
    for (int r = 0; r < 3; r++) {
        const double *row = a->m + 4 * r;
        for (int c = 0; c < 4; c++) {
            double sum = row[0] * b->m[c] + row[1] * b->m[4 + c] + row[2] * b->m[8 + c];
            product.m[4 * r + c] = c == 3 ? sum + row[3] : sum;
        }
    }
    return product;
}

/* out may be p. */
static inline void pl_affine_point(const pl_affine *a, const double p[3], double out[3])
{
    const double x = p[0], y = p[1], z = p[2];
    for (int r = 0; r < 3; r++) {
        const double *row = a->m + 4 * r;
        out[r] = row[0] * x + row[1] * y + row[2] * z + row[3];
    }
}

/* Without the translation; out may be v. */
static inline void pl_affine_vector(const pl_affine *a, const double v[3], double out[3])
{
    const double x = v[0], y = v[1], z = v[2];
    for (int r = 0; r < 3; r++) {
        const double *row = a->m + 4 * r;
        out[r] = row[0] * x + row[1] * y + row[2] * z;
    }
}

/* By the transposed linear part: with a the inverse of M this maps a normal by M (not to unit length). out may be n.
 */
static inline void pl_affine_normal(const pl_affine *a, const double n[3], double out[3])
{
    const double x = n[0], y = n[1], z = n[2];
    for (int c = 0; c < 3; c++)
        out[c] = a->m[c] * x + a->m[4 + c] * y + a->m[8 + c] * z;
}

/* Determinant of the linear part. */
static inline double pl_affine_determinant(const pl_affine *a)
{
    const double *m = a->m;
    return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
           m[2] * (m[4] * m[9] - m[5] * m[8]);
}

/* The inverse, by the adjugate, of a map that is known to have one. */
static inline void pl_affine_invert(const pl_affine *a, double determinant, pl_affine *inverse)
{
    const double *m = a->m;
    const double adjugate[9] = {
        m[5] * m[10] - m[6] * m[9], m[2] * m[9] - m[1] * m[10], m[1] * m[6] - m[2] * m[5],
        m[6] * m[8] - m[4] * m[10], m[0] * m[10] - m[2] * m[8], m[2] * m[4] - m[0] * m[6],
        m[4] * m[9] - m[5] * m[8],  m[1] * m[8] - m[0] * m[9],  m[0] * m[5] - m[1] * m[4],
    };
    for (int r = 0; r < 3; r++) {
        double *row = inverse->m + 4 * r;
        for (int c = 0; c < 3; c++)
            row[c] = adjugate[3 * r + c] / determinant;
        row[3] = -(row[0] * m[3] + row[1] * m[7] + row[2] * m[11]);
    }
}

/* The same. false, with *inverse unspecified, if the map is singular: the determinant is 0 or an entry of the inverse isn't
 * finite. */
static inline bool pl_affine_inverse(const pl_affine *a, pl_affine *inverse)
{
    const double determinant = pl_affine_determinant(a);
    if (determinant == 0)
        return false;
    pl_affine_invert(a, determinant, inverse);
    for (int i = 0; i < 12; i++)
        if (!(inverse->m[i] - inverse->m[i] == 0))
            return false;
    return true;
}

#endif
