/* circular.h - sine and cosine of an angle in degrees, each the sum of two doubles, for elementary.c.
 *
 * Angle -> the nearest whole degree, whose sine and cosine are in a table, and the rest r of at most half a degree:
 *
 *     sin(j + r) = sin j + cos j · sin r + sin j · (cos r - 1)
 *
 * (Tang 1991, "Table-lookup algorithms for elementary functions and their error analysis"). Only the first two terms are large:
 * of the second the product of upper halves is exact, and their sum is. All else is below 2^-14 of the result and so needs no more
 * than a double: the relative error is below 2^-64. Without such a table it would take two Taylor series in double-double,
 * which cost five times as much. */
#ifndef PL_CIRCULAR_H
#define PL_CIRCULAR_H

#include <math.h>

#include "double_double.h"

static const pair RADIANS = {0x1.1df46a2529d39p-6, 0x1.5c1d8becdd291p-62};  /* pi / 180 */
static const pair DEGREES = {0x1.ca5dc1a63c1f8p+5, -0x1.1e7ab456405f9p-49}; /* 180 / pi */

/* The sine s = high + low of each whole degree, and s · pi/180 = scaled + rest, where `scaled` has 26 bits. */
typedef struct whole_degree {
    double high, low, scaled, rest;
} whole_degree;

static const whole_degree WHOLE_DEGREES[91] = {
    {0, 0, 0, 0},
    {0x1.1df0b2b89dd1ep-6, 0x1.5834d68148788p-60, 0x1.3f65f7p-12, -0x1.de7a98a5b87dep-41},
    {0x1.1de58c9f7dc27p-5, 0x1.6a29acafffa4cp-59, 0x1.3f5983p-11, -0x1.ddbdd3e7d111cp-39},
    {0x1.acbc748efc90ep-5, -0x1.1aac9507cfe2ep-59, 0x1.dee723p-11, 0x1.34681469a7c95p-38},
    {0x1.1db8f6d6a5128p-4, -0x1.eab8ddc6fd5e1p-60, 0x1.3f27b58p-10, 0x1.04afa3a95c6f6p-38},
    {0x1.64fd6b8c28103p-4, -0x1.c8b5c051cd2dcp-58, 0x1.8ec2f68p-10, -0x1.ada29d0baa318p-37},
    {0x1.ac2609b3c576cp-4, 0x1.46278894ee35fp-61, 0x1.de3f1e8p-10, 0x1.449a52e6742bep-38},
    {0x1.f32d44c4f62d3p-4, 0x1.71db46a5c3e9ep-58, 0x1.16cafep-9, -0x1.47e286ff7fc44p-36},
    {0x1.1d06c968d9e19p-3, 0x1.ce41cc5da7ce2p-58, 0x1.3e60afp-9, -0x1.00ec7044cfbefp-36},
    {0x1.4060b67a85375p-3, 0x1.dcc510fdcc9c4p-65, 0x1.65dd8cp-9, 0x1.5707b754467e1p-36},
    {0x1.63a1a7e0b738ap-3, -0x1.744603e3937c7p-57, 0x1.8d3e818p-9, -0x1.241dc3f000545p-37},
    {0x1.86c6ddd76624fp-3, 0x1.28f0bc3a8cf76p-57, 0x1.b4807c8p-9, 0x1.6a0ed1aa849bap-38},
    {0x1.a9cd9ac4258f6p-3, -0x1.93e458481ed0ap-58, 0x1.dba06ep-9, -0x1.7966e9788ae67p-36},
    {0x1.ccb3236cdc675p-3, -0x1.8ca1c7b0f9233p-58, 0x1.014da4p-8, 0x1.9817ad97d558fp-36},
    {0x1.ef74bf2e4b91dp-3, -0x1.143d8df6f6888p-57, 0x1.14b701p-8, -0x1.d3e70acc8540cp-35},
    {0x1.0907dc193069p-2, 0x1.a5ec4dc53f528p-56, 0x1.280ac98p-8, -0x1.6728667a818ap-36},
    {0x1.1a40add328e29p-2, 0x1.9bc8cbb922504p-56, 0x1.3b477cp-8, 0x1.8c19bb3a71p-35},
    {0x1.2b637cf83d5c7p-2, 0x1.06ee1a1c0b777p-56, 0x1.4e6b99p-8, 0x1.620f49ead83aep-36},
    {0x1.3c6ef372fe95p-2, -0x1.f506319fcfd19p-56, 0x1.6175a2p-8, -0x1.441bdb255526fp-38},
    {0x1.4d61bd000cddbp-2, 0x1.c12551f7dc083p-56, 0x1.74641bp-8, -0x1.9f7e332bbd86ep-35},
    {0x1.5e3a8748a0bf5p-2, 0x1.7371a64afcbd6p-56, 0x1.8735898p-8, 0x1.bdfe0a9b7a218p-36},
    {0x1.6ef801fced33cp-2, 0x1.7a7c2ec0e8901p-58, 0x1.99e877p-8, -0x1.fc81da4b36d2dp-35},
    {0x1.7f98deee59681p-2, 0x1.7ce7221fdb4d2p-56, 0x1.ac7b6dp-8, -0x1.e5e6cfcbea251p-37},
    {0x1.901bd2298ffabp-2, -0x1.2b17ccd9e8858p-56, 0x1.beecf98p-8, -0x1.dd0aefff26594p-36},
    {0x1.a07f921061ad1p-2, -0x1.300958f09a077p-61, 0x1.d13bacp-8, -0x1.b42adb38f4a27p-36},
    {0x1.b0c2d77379853p-2, -0x1.784bf8168bfb9p-58, 0x1.e36617p-8, 0x1.a1b39a4923b1p-42},
    {0x1.c0e45dabe05c8p-2, 0x1.f64aed2c5990ep-57, 0x1.f56adp-8, 0x1.159bb19e676dap-36},
    {0x1.d0e2e2b44de01p-2, -0x1.dcad11f226a79p-57, 0x1.03a4378p-7, 0x1.90f4aa732f948p-34},
    {0x1.e0bd274245078p-2, 0x1.d97f1131c42afp-56, 0x1.0c7ec8p-7, 0x1.49389b88ef1a5p-34},
    {0x1.f071eedefa0ecp-2, 0x1.e08e08d88a29ap-56, 0x1.1544688p-7, 0x1.749d94ac0c96fp-34},
    {0x1p-1, 0, 0x1.1df46ap-7, 0x1.294e9c8ae0ec6p-34},
    {0x1.07b3120fddf13p-1, 0x1.f7249b9bb949dp-55, 0x1.268e1fp-7, 0x1.f4ea6df827fe3p-35},
    {0x1.0f5193eacdd2ap-1, 0x1.eb124a84fa5e7p-55, 0x1.2f10dcp-7, -0x1.372b269680e8fp-35},
    {0x1.16daed770771dp-1, -0x1.2cef38bdd979fp-59, 0x1.377bf68p-7, 0x1.37d21f667c56ap-34},
    {0x1.1e4e88411fd12p-1, 0x1.4f3aba7a54adcp-55, 0x1.3fcec78p-7, -0x1.fc67afe3fa0c7p-34},
    {0x1.25abcf87c4978p-1, 0x1.b805821236b88p-55, 0x1.4808a78p-7, 0x1.f7204fe65eaddp-36},
    {0x1.2cf2304755a5ep-1, -0x1.24bd9a522ca0dp-57, 0x1.5028f38p-7, -0x1.14cbf5866601cp-34},
    {0x1.342119455beb6p-1, 0x1.cf31de7818f57p-57, 0x1.582f088p-7, -0x1.e85f00ac79ba4p-36},
    {0x1.3b37fb1bdc939p-1, -0x1.bbf07ed3a7b9ep-57, 0x1.601a468p-7, 0x1.c4bafcfb8e862p-35},
    {0x1.4236484487abep-1, -0x1.c69dccc7e3747p-55, 0x1.67ea1p-7, -0x1.ac99d4931df38p-34},
    {0x1.491b7523c161dp-1, -0x1.518a0c6797c16p-55, 0x1.6f9dc8p-7, 0x1.333389ccd9e34p-36},
    {0x1.4fe6f81384fd4p-1, 0x1.4a12a7b6f1ebap-57, 0x1.7734d58p-7, 0x1.893a43ac90faep-35},
    {0x1.5698496e20bd8p-1, -0x1.b5feef3e4cbc6p-56, 0x1.7eaea1p-7, -0x1.b3c6436d9356ep-36},
    {0x1.5d2ee398c9c2bp-1, 0x1.b9188095a7413p-56, 0x1.860a95p-7, -0x1.2ef5858d465edp-34},
    {0x1.63aa430e0731p-1, 0x1.2c3d582a33eb5p-55, 0x1.8d481e8p-7, -0x1.95723df074234p-35},
    {0x1.6a09e667f3bcdp-1, -0x1.bdd3413b26456p-55, 0x1.9466adp-7, 0x1.bfad33aa43f45p-36},
    {0x1.704d4e6a54d39p-1, -0x1.e43e27f2d691ap-55, 0x1.9b65b28p-7, 0x1.84bccbbb33b84p-34},
    {0x1.7673fe0c86982p-1, 0x1.b09ccd1e10433p-56, 0x1.a244a38p-7, 0x1.23c754cec1f0ep-34},
    {0x1.7c7d7a833bec2p-1, -0x1.4fd665c1bfc2cp-57, 0x1.a902f7p-7, -0x1.ff816b6751ce4p-34},
    {0x1.82694b4a11c37p-1, -0x1.290ea09aff038p-56, 0x1.afa0258p-7, -0x1.b1619be50cb33p-35},
    {0x1.8836fa2cf5039p-1, 0x1.913ad5051e83cp-56, 0x1.b61bab8p-7, 0x1.46678747c5299p-36},
    {0x1.8de613515a328p-1, -0x1.926077627a614p-56, 0x1.bc7508p-7, -0x1.c7ee4548ec3e3p-34},
    {0x1.9376253f463d1p-1, 0x1.eda014796a4e9p-55, 0x1.c2abbb8p-7, -0x1.1c88a0cdaec83p-34},
    {0x1.98e6c0ea27a14p-1, 0x1.3aa23c4fc810ap-56, 0x1.c8bf4ap-7, 0x1.fbaab031a5dc7p-34},
    {0x1.9e3779b97f4a8p-1, -0x1.f506319fcfd19p-56, 0x1.ceaf3bp-7, 0x1.150cded88b99fp-34},
    {0x1.a367e59158747p-1, -0x1.476f2057c7a75p-57, 0x1.d47b178p-7, -0x1.e995d256fd907p-41},
    {0x1.a8779cda8eea5p-1, -0x1.8e3108597e53dp-55, 0x1.da226b8p-7, 0x1.ff70129ee8ecep-35},
    {0x1.ad663a8ae2fdcp-1, -0x1.7d089f38daab4p-56, 0x1.dfa4c68p-7, 0x1.38aa085e5c5d7p-34},
    {0x1.b2335c2cda945p-1, 0x1.f650e3542f522p-57, 0x1.e501ba8p-7, 0x1.a169f6a3dd3f4p-35},
    {0x1.b6dea1e76eadep-1, -0x1.a99ccc062eac6p-55, 0x1.ea38dc8p-7, -0x1.72447626da2ebp-35},
    {0x1.bb67ae8584caap-1, 0x1.cec95d0b5c1e3p-55, 0x1.ef49c4p-7, -0x1.36e6c866c4f96p-36},
    {0x1.bfce277d339c7p-1, -0x1.dedb255224689p-55, 0x1.f4340cp-7, 0x1.0320cfbb4777bp-34},
    {0x1.c411b4f6d2708p-1, -0x1.abc92c5ff4313p-55, 0x1.f8f753p-7, -0x1.be38f34d4fe8fp-34},
    {0x1.c83201d3d2c6dp-1, -0x1.502f18ecea53dp-55, 0x1.fd9339p-7, -0x1.340f765b0925fp-34},
    {0x1.cc2ebbb5638cap-1, -0x1.9d86cf47b63ecp-55, 0x1.0103b1p-6, 0x1.480181c5051ebp-33},
    {0x1.d0079302dd767p-1, 0x1.ea1affbfa8e0fp-56, 0x1.0329bbp-6, 0x1.233c405cee5f5p-33},
    {0x1.d3bc3aeff7f95p-1, 0x1.0a9585526bd01p-55, 0x1.053b8f8p-6, -0x1.5aa5efe4348d4p-36},
    {0x1.d74c6982c666fp-1, -0x1.b4737903637a7p-55, 0x1.073905p-6, -0x1.2b26f8c71d0a5p-33},
    {0x1.dab7d7997cb58p-1, -0x1.b12f63f5c16f5p-56, 0x1.0921f38p-6, 0x1.467886423a902p-35},
    {0x1.ddfe40effb805p-1, 0x1.ba37ac9812146p-58, 0x1.0af6358p-6, -0x1.722c5773da9ebp-34},
    {0x1.e11f642522d1cp-1, -0x1.94741676559d4p-55, 0x1.0cb5a6p-6, -0x1.a5d3ad581d805p-35},
    {0x1.e41b02bfeb4cbp-1, -0x1.4a4b213edc43fp-55, 0x1.0e60228p-6, -0x1.e107f06bef07fp-33},
    {0x1.e6f0e134454ffp-1, 0x1.798ddb868c354p-55, 0x1.0ff589p-6, 0x1.a224da3a8b782p-34},
    {0x1.e9a0c6e7bdb1fp-1, 0x1.a6ba2d98e8fd3p-55, 0x1.1175bbp-6, -0x1.3b195fe5a45c7p-33},
    {0x1.ec2a7e35e7b8p-1, -0x1.294d8b709433cp-55, 0x1.12e0998p-6, 0x1.35928ca9e22fdp-35},
    {0x1.ee8dd4748bf15p-1, -0x1.d5ba34b10d383p-56, 0x1.143609p-6, -0x1.e9deccb40f657p-34},
    {0x1.f0ca99f79ba25p-1, -0x1.77907e4ebb232p-61, 0x1.1575eep-6, 0x1.fda9df527f373p-33},
    {0x1.f2e0a214e870fp-1, -0x1.3ff9654e4d475p-56, 0x1.16a0308p-6, 0x1.94c72676b7d7fp-33},
    {0x1.f4cfc327a008p-1, -0x1.d582906f0e46fp-55, 0x1.17b4b9p-6, -0x1.02669d1b74505p-35},
    {0x1.f697d6938b6c2p-1, -0x1.99d15a2cab02p-56, 0x1.18b3718p-6, -0x1.643ef7f2c8c04p-39},
    {0x1.f838b8c811c17p-1, 0x1.682ec6bde69d5p-55, 0x1.199c468p-6, -0x1.43b39ae5eafedp-34},
    {0x1.f9b24942fe45cp-1, -0x1.974e46efc6627p-55, 0x1.1a6f258p-6, 0x1.55253e4746a31p-34},
    {0x1.fb046a930947ap-1, -0x1.b0888ea4fc47fp-55, 0x1.1b2bfe8p-6, 0x1.4b41490893fcep-35},
    {0x1.fc2f025a23e8bp-1, 0x1.de40913111faap-55, 0x1.1bd2c28p-6, 0x1.0ea583d517fb2p-34},
    {0x1.fd31f94f867c6p-1, 0x1.b2107407b26fbp-55, 0x1.1c63648p-6, 0x1.3f14a9d5ae6adp-33},
    {0x1.fe0d3b41815a2p-1, -0x1.dc0ff3c26b1bep-57, 0x1.1cddd98p-6, 0x1.fda71e4f833c9p-36},
    {0x1.fec0b7170fff6p-1, 0x1.cccd75c56b11fp-55, 0x1.1d42178p-6, 0x1.247f9e41cfe78p-33},
    {0x1.ff4c5ed12e61dp-1, 0x1.7605c7f798be8p-55, 0x1.1d9017p-6, 0x1.646364ecd5f59p-33},
    {0x1.ffb0278bf0567p-1, -0x1.282e2ce2238c1p-55, 0x1.1dc7d2p-6, 0x1.5b46107b5d4bbp-35},
    {0x1.ffec097f5af8ap-1, -0x1.18945ff801a15p-55, 0x1.1de944p-6, -0x1.90ed3457df6ap-34},
    {0x1p+0, 0, 0x1.1df46ap-6, 0x1.294e9c8ae0ec6p-33},
};

/* An angle of at most 45 degrees, its sign apart. */
typedef struct part_angle {
    const whole_degree *sine, *cosine; /* of the nearest whole degree */
    double r, upper, lower;            /* the rest in degrees, and its halves: upper + lower */
    double sine_less, cosine_less;     /* sin r - r and cos r - 1, r in radians */
} part_angle;

static inline part_angle take_apart(double degrees)
{
    const double size = fabs(degrees);
    const int below = (int)size, whole = below + (size - below > 0.5); /* the rest is exact (Sterbenz) */
    const double r = size - whole, half = upper(r), x = RADIANS.high * r, z = x * x;
    return (part_angle){
        .sine = &WHOLE_DEGREES[whole],
        .cosine = &WHOLE_DEGREES[90 - whole],
        .r = r,
        .upper = half,
        .lower = r - half,
        .sine_less = x * z * (-1.0 / 6 + z * (1.0 / 120 + z * (-1.0 / 5040 + z / 362880))),
        .cosine_less = z * (-0.5 + z * (1.0 / 24 + z * (-1.0 / 720 + z / 40320))),
    };
}

/* own · cos r + other · sin r: of a whole degree's sine and cosine the sine; of its cosine and sine, with r < 0, the cosine. */
static inline pair turn(const part_angle *at, const whole_degree *own, const whole_degree *other, double sign)
{
    const double large = sign * (at->upper * other->scaled);
    const double small = at->lower * other->scaled + at->r * other->rest + other->high * at->sine_less;
    const pair sum = fast_two_sum(own->high, large);
    return fast_two_sum(sum.high, sum.low + (own->low + (sign * small + own->high * at->cosine_less)));
}

static inline pair sine_of(const part_angle *at, double degrees)
{
    const pair s = turn(at, at->sine, at->cosine, 1);
    return degrees < 0 ? negate(s) : s;
}

static inline pair cosine_of(const part_angle *at)
{
    return turn(at, at->cosine, at->sine, -1);
}

/* Of at most 45 degrees. */
static inline pair sine(double degrees)
{
    const part_angle at = take_apart(degrees);
    return sine_of(&at, degrees);
}

static inline pair cosine(double degrees)
{
    const part_angle at = take_apart(degrees);
    return cosine_of(&at);
}

static inline void sine_and_cosine(double degrees, pair *s, pair *c)
{
    const part_angle at = take_apart(degrees);
    *s = sine_of(&at, degrees);
    *c = cosine_of(&at);
}

#endif
