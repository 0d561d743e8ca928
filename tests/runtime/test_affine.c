/* test_affine.c - 3x4 maps: composition, inverse, what is singular. */
#include "affine.h"
#include "check.h"

static const pl_affine SAMPLE = {{2, 0, 0, 5, 0, 0, -4, 6, 0, 0.5, 0, 7}};

static void composition_acts_right_to_left(void)
{
    const pl_affine move = {{1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3}}, grow = {{2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0}};
    const pl_affine both = pl_affine_multiply(&move, &grow);
    double p[3] = {1, 1, 1}, v[3] = {1, 1, 1};
    pl_affine_point(&both, p, p);
    pl_affine_vector(&both, v, v);
    CHECK(p[0] == 3 && p[1] == 4 && p[2] == 5);
    CHECK(v[0] == 2 && v[1] == 2 && v[2] == 2);
}

static void inverse_undoes_the_map(void)
{
    pl_affine inverse;
    CHECK(pl_affine_inverse(&SAMPLE, &inverse));
    const pl_affine product = pl_affine_multiply(&SAMPLE, &inverse), identity = pl_affine_identity();
    for (int i = 0; i < 12; i++)
        CHECK(product.m[i] == identity.m[i]);
    CHECK(pl_affine_determinant(&SAMPLE) == 4);
}

static void normals_stay_perpendicular(void)
{
    pl_affine inverse;
    const pl_affine shear = {{1, 3, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
    double tangent[3] = {0, 1, 0}, normal[3] = {1, 0, 0};
    CHECK(pl_affine_inverse(&shear, &inverse));
    pl_affine_vector(&shear, tangent, tangent);
    pl_affine_normal(&inverse, normal, normal);
    CHECK(tangent[0] * normal[0] + tangent[1] * normal[1] + tangent[2] * normal[2] == 0);
}

static void flat_and_tiny_maps_are_singular(void)
{
    pl_affine inverse;
    const pl_affine flat = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0}},
                    tiny = {{1e-120, 0, 0, 0, 0, 1e-120, 0, 0, 0, 0, 1e-120, 0}};
    const pl_affine overflowing = {{1e-200, 0, 0, 1e200, 0, 1, 0, 0, 0, 0, 1, 0}};
    CHECK(!pl_affine_inverse(&flat, &inverse));
    CHECK(!pl_affine_inverse(&tiny, &inverse));
    CHECK(!pl_affine_inverse(&overflowing, &inverse));
}

int main(void)
{
    composition_acts_right_to_left();
    inverse_undoes_the_map();
    normals_stay_perpendicular();
    flat_and_tiny_maps_are_singular();
    return check_result();
}
