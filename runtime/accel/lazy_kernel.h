/* lazy_kernel.h - boxes and gates on the way to states that are unfolded on touch, four rays at a time (lazy.h); compiled by each
 * kernel_*.c. LAZY_KERNEL: the name of the table of functions.
 *
 * Each number is what one ray alone would have, by the same operations in the same order as pl_map_ray, pl_slab_of and
 * pl_gate_span have: mapped rays are normative, and all else is no narrower than the gates. */

static inline __attribute__((always_inline)) double4 get4(const double *at)
{
    return *(const double4 *)at;
}

static inline __attribute__((always_inline)) void put4(double *at, double4 value)
{
    *(double4 *)at = value;
}

static inline __attribute__((always_inline)) double4 all4(double x)
{
    return (double4){x, x, x, x};
}

static inline __attribute__((always_inline)) double4 choose4(long4 first, double4 a, double4 b)
{
    return (double4)(((long4)a & first) | ((long4)b & ~first));
}

/* The fours with some of the rays in them. */
#define EACH_FOUR(four, rays) for (uint32_t four = 0; four < PL_TRACE_MANY / 4; four++) if ((rays) >> 4 * four & 15)

/* The least of some lanes, and of what was the least. */
static inline __attribute__((always_inline)) double least4(double4 v, uint32_t lanes, double least)
{
    for (int lane = 0; lane < 4; lane++) least = lanes >> lane & 1 && v[lane] < least ? v[lane] : least;
    return least;
}

static inline __attribute__((always_inline)) double4 slack4(const pl_reach *reach, const pl_lazy_four *at)
{
    const double4 x = get4(at->o[0]), y = get4(at->o[1]), z = get4(at->o[2]);
    return DBL_EPSILON * (reach->gain * double4_root(x * x + y * y + z * z) + reach->base);
}

/* Narrows [*enter, *leave] by the slab between two planes. */
static inline __attribute__((always_inline)) void clip_slab(double4 o, double4 d, double4 lo, double4 hi, double4 slack,
                                                            double4 *enter, double4 *leave)
{
    const long4 negative = (long4)d < 0;
    const double4 inverse = 1.0 / d, toward = choose4(negative, -slack, slack);
    *enter = double4_max((choose4(negative, hi, lo) - (o + toward)) * inverse, *enter);
    *leave = double4_min((choose4(negative, lo, hi) - (o - toward)) * inverse, *leave);
}

/* The same along a bevel (cut.c, clip_bevels): by the inverse's sign, which is the direction's. */
static inline __attribute__((always_inline)) void clip_bevel(double4 at, double4 along, float low, float high, double4 room,
                                                             double4 *enter, double4 *leave)
{
    const double4 inverse = 1.0 / along;
    const double4 below = ((double)low - room - at) * inverse, above = ((double)high + room - at) * inverse;
    const long4 back = inverse < 0.0;
    *enter = double4_max(choose4(back, above, below), *enter);
    *leave = double4_min(choose4(back, below, above), *leave);
}

static inline __attribute__((always_inline)) void bevels4(const double v[3][4], double4 along[PL_GATE_BEVELS])
{
    const double4 x = get4(v[0]), y = get4(v[1]), z = get4(v[2]);
    along[0] = x + y;
    along[1] = x - y;
    along[2] = x + z;
    along[3] = x - z;
    along[4] = y + z;
    along[5] = y - z;
    along[6] = along[0] + z;
    along[7] = along[0] - z;
    along[8] = along[1] + z;
    along[9] = along[1] - z;
}

/* How far out of a box that holds primitives what is cut may stand that is drawn instead of some of them: it is no larger than a
 * footprint. */
static inline __attribute__((always_inline)) double4 room4(const pl_lazy_wants *wants, uint32_t four, double4 leave, double stretch)
{
    const double4 spread = get4(wants->spread + 4 * four);
    const double4 footprint = get4(wants->width + 4 * four) + choose4(spread > 0.0, spread * leave, all4(0.0));
    return footprint / stretch * (1.0 + 0x1p-20);
}

static uint32_t lazy_clip(const pl_lazy_item *it, const pl_reach *reach, double stretch, const pl_lazy_wants *wants,
                          const pl_lazy_four *from, pl_lazy_four *to, uint32_t rays, double *first)
{
    uint32_t met = 0;
    *first = INFINITY;
    if (!(it->box[0] <= it->box[3])) return 0;
    EACH_FOUR(four, rays)
    {
        const pl_lazy_four *at = &from[four];
        const double4 slack = slack4(reach, at), room = it->whole ? all4(0.0) : room4(wants, four, get4(at->leave), stretch);
        double4 enter = get4(wants->t_min + 4 * four), leave = get4(wants->t_max + 4 * four);
        for (int axis = 0; axis < 3; axis++)
            clip_slab(get4(at->o[axis]), get4(at->d[axis]), (double)it->box[axis] - room, (double)it->box[3 + axis] + room, slack, &enter, &leave);
        const uint32_t lanes = rays >> 4 * four & double4_bits(enter <= leave);
        put4(to[four].enter, enter);
        *first = least4(enter, lanes, *first);
        met |= lanes << 4 * four;
    }
    return met;
}

static void lazy_map(const pl_lazy_state *state, const pl_lazy_item *it, const pl_lazy_four *from, pl_lazy_four *to, uint32_t rays)
{
    EACH_FOUR(four, rays)
    {
        double4 o[3], d[3];
        for (int axis = 0; axis < 3; axis++) {
            o[axis] = get4(from[four].o[axis]);
            d[axis] = get4(from[four].d[axis]);
        }
        for (uint32_t i = 0; i < it->link_count; i++) {
            const pl_transform *transform = pl_lazy_transform(state, &it->links[i]);
            pl_affine room;
            const double *m = pl_transform_entries(transform, room.m);
            if (transform->form <= PL_FORM_PACKED) {
                const double4 x = o[0], y = o[1], z = o[2], u = d[0], v = d[1], w = d[2];
                for (int axis = 0; axis < 3; axis++, m += 4) {
                    o[axis] = m[0] * x + m[1] * y + m[2] * z + m[3];
                    d[axis] = m[0] * u + m[1] * v + m[2] * w;
                }
                continue;
            }
            for (int axis = 0; axis < 3 && transform->form == PL_FORM_DIAGONAL; axis++) {
                o[axis] *= m[5 * axis];
                d[axis] *= m[5 * axis];
            }
            for (int axis = 0; axis < 3; axis++) o[axis] += m[4 * axis + 3];
        }
        for (int axis = 0; axis < 3; axis++) {
            put4(to[four].o[axis], o[axis]);
            put4(to[four].d[axis], d[axis]);
        }
    }
}

static uint32_t lazy_meet(const pl_gate_box *gate, double stretch, const pl_lazy_wants *wants, const pl_lazy_four *from,
                          pl_lazy_four *to, uint32_t rays, uint32_t *open, double *first)
{
    uint32_t met = 0;
    *open = gate->unbounded ? rays : 0;
    if (!gate->unbounded) *first = INFINITY;
    EACH_FOUR(four, rays)
    {
        pl_lazy_four *at = &to[four];
        if (gate->unbounded) {
            put4(at->leave, get4(from[four].leave));
            met |= rays & UINT32_C(15) << 4 * four;
            continue;
        }
        const double4 slack = slack4(&gate->reach, at);
        double4 enter = get4(wants->t_min + 4 * four), leave = get4(wants->t_max + 4 * four);
        for (int axis = 0; axis < 3; axis++)
            clip_slab(get4(at->o[axis]), get4(at->d[axis]), all4(gate->box.lo[axis]), all4(gate->box.hi[axis]), slack, &enter, &leave);
        uint32_t lanes = rays >> 4 * four & double4_bits(enter <= leave);
        if (lanes && gate->bevelled) {
            double4 origins[PL_GATE_BEVELS], along[PL_GATE_BEVELS];
            bevels4(at->o, origins);
            bevels4(at->d, along);
            for (int i = 0; i < PL_GATE_BEVELS; i++)
                clip_bevel(origins[i], along[i], gate->low[i], gate->high[i], PL_BEVEL_SLACK * slack, &enter, &leave);
            lanes &= double4_bits(enter <= leave);
        }
        const double4 footprint = get4(wants->width + 4 * four) + get4(wants->spread + 4 * four) * leave;
        put4(at->enter, enter);
        put4(at->leave, leave);
        *first = least4(enter, lanes, *first);
        *open |= (lanes & double4_bits(gate->diameter * stretch > footprint)) << 4 * four;
        met |= lanes << 4 * four;
    }
    return met;
}

static double lazy_begin(const pl_lazy_wants *wants, pl_lazy_four *to, uint32_t rays)
{
    double first = INFINITY;
    EACH_FOUR(four, rays)
    {
        put4(to[four].enter, get4(wants->t_min + 4 * four));
        first = least4(get4(to[four].enter), rays >> 4 * four, first);
    }
    return first;
}

static uint32_t lazy_waiting(const pl_lazy_wants *wants, const pl_lazy_four *at, uint32_t rays)
{
    uint32_t waiting = 0;
    EACH_FOUR(four, rays)
        waiting |= (rays >> 4 * four & double4_bits(get4(at[four].enter) <= get4(wants->t_max + 4 * four))) << 4 * four;
    return waiting;
}

const pl_lazy_kernel LAZY_KERNEL = {lazy_clip, lazy_map, lazy_meet, lazy_begin, lazy_waiting};
