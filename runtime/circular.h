/* circular.h - double-double products, sine and cosine, for elementary.c, which includes this once without and once with
 * FUSED: with an instruction that computes a * b + c and rounds once. All else is the same, and so are all bits, since
 * what a product loses by rounding is a double, found exactly either way. NAME(function): what a function is called. */

/* a * b exactly, where nothing over- or underflows. */
static inline pair NAME(two_product)(double a, double b)
{
    const double product = a * b;
#ifdef FUSED
    return (pair){product, __builtin_fma(a, b, -product)};
#else
    const double a1 = upper(a), b1 = upper(b), a2 = a - a1, b2 = b - b1;
    return (pair){product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2};
#endif
}

static inline pair NAME(multiply)(pair a, pair b)
{
    const pair p = NAME(two_product)(a.high, b.high);
    return fast_two_sum(p.high, p.low + (a.high * b.low + a.low * b.high));
}

/* Sine of x radians, |x| <= pi/4: x (1 - x^2/6 + x^4/120 - ...). */
static inline pair NAME(sine)(pair x)
{
    static const pair c1 = {-0x1.5555555555555p-3, -0x1.5555555555555p-57},
                      c2 = {0x1.1111111111111p-7, 0x1.1111111111111p-63};
    const pair x2 = NAME(multiply)(x, x);
    const double z = x2.high;
    const double tail =
        -1.0 / 5040 +
        z * (1.0 / 362880 +
             z * (-1.0 / 39916800 +
                  z * (1.0 / 6227020800 +
                       z * (-1.0 / 1307674368000 + z * (1.0 / 355687428096000 + z * (-1.0 / 121645100408832000))))));
    pair sum = add(c2, NAME(two_product)(z, tail));
    sum = add(c1, NAME(multiply)(x2, sum));
    return add(x, NAME(multiply)(x, NAME(multiply)(x2, sum)));
}

/* Cosine of x radians, |x| <= pi/4: 1 - x^2/2 + x^4/24 - ... */
static inline pair NAME(cosine)(pair x)
{
    static const pair c2 = {0x1.5555555555555p-5, 0x1.5555555555555p-59},
                      c3 = {-0x1.6c16c16c16c17p-10, 0x1.f49f49f49f49fp-65};
    const pair x2 = NAME(multiply)(x, x);
    const double z = x2.high;
    const double tail =
        1.0 / 40320 +
        z * (-1.0 / 3628800 +
             z * (1.0 / 479001600 +
                  z * (-1.0 / 87178291200 + z * (1.0 / 20922789888000 +
                                                 z * (-1.0 / 6402373705728000 + z * (1.0 / 2432902008176640000))))));
    pair sum = add(c3, NAME(two_product)(z, tail));
    sum = add(c2, NAME(multiply)(x2, sum));
    sum = add((pair){-0.5, 0}, NAME(multiply)(x2, sum));
    return add((pair){1, 0}, NAME(multiply)(x2, sum));
}

static void NAME(circle)(pair x, pair *s, pair *c)
{
    *s = NAME(sine)(x);
    *c = NAME(cosine)(x);
}
