/* reach.c - singular values of a 3x3 matrix by Jacobi's method, and the growth of the slack through a transformation. */
#include "reach.h"

/* One Jacobi rotation of the symmetric matrix that makes s[p][q] zero (Golub & Van Loan, section 8.5). */
static void rotate(double s[3][3], int p, int q)
{
    if (s[p][q] == 0.0) return;
    double theta = (s[q][q] - s[p][p]) / (2.0 * s[p][q]);
    double t = copysign(1.0, theta) / (fabs(theta) + sqrt(theta * theta + 1.0));
    double c = 1.0 / sqrt(t * t + 1.0), sine = t * c;
    int r = 3 - p - q;
    double pp = s[p][p] - t * s[p][q], qq = s[q][q] + t * s[p][q];
    double pr = c * s[p][r] - sine * s[q][r], qr = sine * s[p][r] + c * s[q][r];
    s[p][p] = pp;
    s[q][q] = qq;
    s[p][q] = s[q][p] = 0.0;
    s[p][r] = s[r][p] = pr;
    s[q][r] = s[r][q] = qr;
}

double pl_largest_stretch(const pl_affine *map)
{
    double scale = 0.0, s[3][3];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) scale = fmax(scale, fabs(map->m[4 * r + c]));
    if (scale == 0.0 || !isfinite(scale)) return scale;
    for (int i = 0; i < 3; i++)
        for (int j = i; j < 3; j++) {
            s[i][j] = 0.0;
            for (int r = 0; r < 3; r++) s[i][j] += (map->m[4 * r + i] / scale) * (map->m[4 * r + j] / scale);
            s[j][i] = s[i][j];
        }
    /* Convergence is quadratic; what is left beside the diagonal is then lost in the factor below. */
    for (int sweep = 0; sweep < 8; sweep++) {
        double off = fabs(s[0][1]) + fabs(s[0][2]) + fabs(s[1][2]);
        if (off <= 8.0 * DBL_EPSILON * (s[0][0] + s[1][1] + s[2][2])) break;
        rotate(s, 0, 1);
        rotate(s, 0, 2);
        rotate(s, 1, 2);
    }
    return scale * sqrt(fmax(s[0][0], fmax(s[1][1], s[2][2]))) * (1.0 + 64.0 * DBL_EPSILON);
}

pl_reach pl_reach_through(const pl_transform *transform, const pl_reach *below)
{
    return pl_reach_with(transform, pl_largest_stretch(&transform->to_parent), pl_largest_stretch(&transform->to_object), below);
}

pl_reach pl_reach_with(const pl_transform *transform, double m, double n, const pl_reach *below)
{
    const double c = PL_REACH_ROUNDINGS, *move = transform->to_parent.m;
    double tau = sqrt(move[3] * move[3] + move[7] * move[7] + move[11] * move[11]);
    double size = m * below->size + tau;

    pl_affine product = pl_affine_multiply(&transform->to_parent, &transform->to_object);
    double lack = 0.0, lack_move = 0.0;
    for (int r = 0; r < 3; r++) {
        for (int col = 0; col < 3; col++) {
            double off = product.m[4 * r + col] - (r == col ? 1.0 : 0.0);
            lack += off * off;
        }
        lack_move += product.m[4 * r + 3] * product.m[4 * r + 3];
    }
    pl_reach above;
    above.size = size;
    above.gain = m * n * (c + below->gain) + sqrt(lack) / DBL_EPSILON;
    above.base = m * n * (c * (size + tau) + below->gain * tau) + m * below->base + c * (2.0 * m * below->size + tau) +
                 (sqrt(lack) * size + sqrt(lack_move)) / DBL_EPSILON;
    /* What has left the range of numbers has no bound. */
    if (isnan(above.gain)) above.gain = INFINITY;
    if (isnan(above.base)) above.base = INFINITY;
    if (isnan(above.size)) above.size = INFINITY;
    return above;
}
