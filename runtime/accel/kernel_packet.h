/* kernel_packet.h - the traversal of fronts by packets of PL_LANES rays that go about the same way (kernel.h has the single
 * ray's; this is part of the kernels of x86).
 *
 * In nodes of the scene's front a packet is one *beam*: intervals of its origins and of its directions' inverses, so that a
 * child is met or missed for all rays at once by about twice the arithmetic of one ray (interval arithmetic in packets:
 * Boulos, Wald & Shirley 2006, "Geometric and arithmetic culling methods for entire ray packets"). Below it the rays have
 * spread: nodes are told for each ray (kernel_each.h). Boxes of instances and primitives are told for each ray in either case.
 * One that is left alone goes on as a single ray.
 *
 * The same filters, wider: candidates are mapped down the path and evaluated as those of single rays are, so packets
 * can't show in hits. */

#include "kernel_lanes.h"
#include "kernel_offer.h"
#include "kernel_alone.h"
#include "kernel_each.h"
#include "kernel_beam.h"

/* So few go on alone. */
enum { FEW = 1 };

/* --- frames --- */

/* t_max of all rays in the frame's own t; *most: of its lanes. */
static inline void set_t_max(pl_packet_frame *f, const double *t_max)
{
    const __m256d from = _mm256_set1_pd(f->t0), rate = _mm256_set1_pd(f->rate * (1.0 + 0x1p-20));
    wide most = wide_set(0.0f);
    for (int first = 0; first < PL_LANES; first += HALF) {
        if (!(f->lanes >> first & 0xFF)) continue;
        const __m256d low = (_mm256_loadu_pd(t_max + first) - from) * rate, high = (_mm256_loadu_pd(t_max + first + 4) - from) * rate;
        const wide t = wide_min(wide_max(wide_narrow(low, high), wide_set(1e-35f)), wide_set(1e30f));
        _mm256_storeu_ps(f->t_max + first, t);
        most = wide_max(wide_and(t, wide_lanes(f->lanes >> first & 0xFF)), most);
    }
    f->most = wide_most(most);
}

/* What single precision tells of rays that begin a frame. */
typedef struct begun {
    unsigned fit, met; /* lanes that are finite, neither too slow nor too fast; those that meet the box */
    wide far, least;   /* |o| (sums of axes) of all lanes; the first t at which one meets the box; each the worse of two */
} begun;

static inline float packet_slack(const pl_packet_frame *f)
{
    return f->error + f->front->slack_gain * f->distance + f->front->slack_base + 0x1p-19f;
}

/* Brings eight rays from double precision to single and to the frame's box; sets t_max and inverses. */
static inline __attribute__((always_inline)) void begin_half(pl_packet_frame *f, int first, unsigned lanes, const double *t_max,
                                                            begun *all)
{
    const __m256d from = _mm256_set1_pd(f->t0), rate = _mm256_set1_pd(f->rate * (1.0 + 0x1p-20));
    const __m256d early = (_mm256_loadu_pd(t_max + first) - from) * rate, late = (_mm256_loadu_pd(t_max + first + 4) - from) * rate;
    const wide in = wide_lanes(lanes >> first & 0xFF), t = wide_min(wide_max(wide_narrow(early, late), wide_set(1e-35f)), wide_set(1e30f));
    wide o[3], d[3], enter = wide_set(0.0f), leave = t;
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        const double *at = f->o[axis] + first, *along = f->d[axis] + first;
        o[axis] = wide_narrow(_mm256_loadu_pd(at), _mm256_loadu_pd(at + 4));
        d[axis] = wide_narrow(_mm256_loadu_pd(along), _mm256_loadu_pd(along + 4));
        _mm256_storeu_ps(f->origin[axis] + first, o[axis]);
        _mm256_storeu_ps(f->direction[axis] + first, d[axis]);
    }
    const wide far = wide_absolute(o[0]) + wide_absolute(o[1]) + wide_absolute(o[2]);
    const wide fast = wide_absolute(d[0]) + wide_absolute(d[1]) + wide_absolute(d[2]);
    const wide slack = wide_set(packet_slack(f)) + wide_set(0x1p-19f) * far;
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        const wide inverse = wide_inverse(d[axis], 1e-18f), middle = o[axis] * inverse;
        const wide reach = (wide_set(f->front->half[axis]) + slack) * wide_absolute(inverse);
        _mm256_storeu_ps(f->inverse[axis] + first, inverse);
        enter = wide_max(-middle - reach, enter);
        leave = wide_min(reach - middle, leave);
    }
    _mm256_storeu_ps(f->t_max + first, t);
    const wide moves = wide_and(_mm256_cmp_ps(fast, wide_set(SLOW), _CMP_GE_OQ), _mm256_cmp_ps(fast, wide_set(FAST), _CMP_LE_OQ));
    const wide meets = wide_and(_mm256_cmp_ps(enter, leave, _CMP_LE_OQ), in);
    all->fit |= wide_mask_of(wide_and(moves, _mm256_cmp_ps(far, wide_set(INFINITY), _CMP_LT_OQ))) << first;
    all->met |= wide_mask_of(meets) << first;
    all->far = wide_max(wide_and(far, in), all->far);
    all->least = wide_min(_mm256_blendv_ps(all->least, enter, meets), all->least);
}

static inline begun begin_box(pl_packet_frame *f, unsigned lanes, const double *t_max)
{
    begun all = {0, 0, wide_set(0.0f), wide_set(INFINITY)};
    for (int first = 0; first < PL_LANES; first += HALF)
        if (lanes >> first & 0xFF) begin_half(f, first, lanes, t_max, &all);
    return all;
}

/* Brings all rays of a frame to the t where the first of them enters the box, so that it is near their origins. false: it isn't for
 * all. */
static bool move_lanes(pl_packet_frame *f, float first_t, float far, const double *t_max)
{
    const __m256d t = _mm256_set1_pd((double)first_t);
    const wide zero = wide_set(0.0f);
    wide most = zero;
    f->t0 += (double)first_t / f->rate;
    for (int first = 0; first < PL_LANES; first += HALF) {
        if (!(f->lanes >> first & 0xFF)) continue;
        wide away = zero;
#pragma GCC unroll 3
        for (int axis = 0; axis < 3; axis++) {
            double *o = f->o[axis] + first;
            const double *d = f->d[axis] + first;
            const __m256d low = _mm256_fmadd_pd(t, _mm256_loadu_pd(d), _mm256_loadu_pd(o));
            const __m256d high = _mm256_fmadd_pd(t, _mm256_loadu_pd(d + 4), _mm256_loadu_pd(o + 4));
            const wide origin = wide_narrow(low, high);
            _mm256_storeu_pd(o, low);
            _mm256_storeu_pd(o + 4, high);
            _mm256_storeu_ps(f->origin[axis] + first, origin);
            away += wide_absolute(origin);
        }
        most = wide_max(wide_and(away, wide_lanes(f->lanes >> first & 0xFF)), most);
    }
    set_t_max(f, t_max);
    f->error += 0x1p-49f * (f->distance + far);
    const float left = wide_most(most);
    f->slack = packet_slack(f) + 0x1p-19f * left;
    return left <= far_of(f->front);
}

/* Begins a frame with the rays f->o and f->d of some lanes: which of them meet the box, and how they go on. */
static enum course begin_lanes(pl_packet_frame *f, unsigned lanes, const double *t_max)
{
    f->lanes = lanes;
    if (f->front->root == PL_NOTHING) return ASTRAY;
    const begun all = begin_box(f, lanes, t_max);
    if (lanes & ~all.fit) return APART;
    const float far = wide_most(all.far);
    f->slack = packet_slack(f) + 0x1p-19f * far;
    if (!(f->slack < 1.0f)) return APART;
    f->lanes = all.met;
    if (!f->lanes) return ASTRAY;
    if (far > far_of(f->front) && !move_lanes(f, wide_least(all.least), far, t_max)) return APART;
    return __builtin_popcount(f->lanes) <= FEW ? ONE_BY_ONE : TOGETHER;
}

/* Those of some lanes whose queries want more. */
static inline unsigned lanes_left(const pl_query *queries, unsigned lanes)
{
    unsigned left = 0;
    for (unsigned rest = lanes; rest; rest &= rest - 1) {
        const int lane = __builtin_ctz(rest);
        left |= (unsigned)!queries[lane].done << lane;
    }
    return left;
}

/* --- the loop --- */

/* Some lanes go into an instance: frame `index` + 1. */
static inline void descend_lanes(pl_packet_frame *f, const pl_packet_frame *parent, const pl_front_instance *it, unsigned lanes)
{
    const pl_front_bounds *bounds = &parent->front->bounds;
    const pl_front_fine *fine = parent->front->fine ? &parent->front->fine[f->instance] : NULL;
    float square = 0.0f, away = 0.0f;
    double m[9];
    for (int i = 0; i < 9; i++) {
        square += it->columns[i] * it->columns[i];
        m[i] = (double)it->columns[i] + (fine ? (double)fine->columns[i] : 0.0);
    }
    for (int axis = 0; axis < 3; axis++) away += (float)__builtin_fabs(it->centre[axis]);
    const float stretch = bounds->stretch * __builtin_sqrtf(square);
    f->error = stretch * (parent->error + bounds->gain * parent->distance + bounds->base) + bounds->rough;
    f->distance = stretch * (parent->distance + away);
    f->t0 = parent->t0;
    f->rate = parent->rate;
    f->mapped = 0;
    for (int i = 0; i < PL_LANES; i += 4) {
        if (!(lanes >> i & 15)) continue;
        const __m256d x = _mm256_loadu_pd(parent->o[0] + i) - it->centre[0], y = _mm256_loadu_pd(parent->o[1] + i) - it->centre[1];
        const __m256d z = _mm256_loadu_pd(parent->o[2] + i) - it->centre[2];
        const __m256d u = _mm256_loadu_pd(parent->d[0] + i), v = _mm256_loadu_pd(parent->d[1] + i), w = _mm256_loadu_pd(parent->d[2] + i);
#pragma GCC unroll 3
        for (int r = 0; r < 3; r++) {
            const __m256d a = _mm256_set1_pd(m[r]), b = _mm256_set1_pd(m[3 + r]), c = _mm256_set1_pd(m[6 + r]);
            _mm256_storeu_pd(f->o[r] + i, _mm256_fmadd_pd(a, x, _mm256_fmadd_pd(b, y, c * z)));
            _mm256_storeu_pd(f->d[r] + i, _mm256_fmadd_pd(a, u, _mm256_fmadd_pd(b, v, c * w)));
        }
    }
}

/* A frame's unbounded primitives for some lanes; *all: there are unbounded instances, which only single rays go into. */
static inline bool offer_unbounded(pl_tracer *tracer, uint32_t index, unsigned lanes, pl_query *queries, double *t_max, bool any,
                                   bool *all)
{
    pl_bvh_work *w = tracer->work;
    const pl_front *front = w->packets[index].front;
    *all = false;
    for (uint32_t i = 0; i < front->unbounded_count; i++) *all = *all || front->unbounded[i] >> PL_REF_SHIFT == PL_KIND_INSTANCE;
    if (*all) return visit_one_by_one(tracer, index, lanes, APART, queries, t_max, any);
    for (uint32_t i = 0; i < front->unbounded_count; i++)
        if (!offer_lanes(tracer, index, front->unbounded[i], any ? lanes_left(queries, lanes) : lanes, queries, t_max))
            return false;
    return true;
}

/* Begins frame `index` of the packet, whose rays are set; false in *goes_on: nothing is left to be done in it. */
static inline bool enter_lanes(pl_tracer *tracer, uint32_t index, unsigned lanes, pl_query *queries, double *t_max, bool any,
                               bool *goes_on)
{
    pl_bvh_work *w = tracer->work;
    pl_packet_frame *f = &w->packets[index];
    bool done;
    *goes_on = false;
    f->lanes = lanes;
    f->each = index > 0;
    if (f->front->unbounded_count) {
        if (!offer_unbounded(tracer, index, lanes, queries, t_max, any, &done)) return false;
        if (any) lanes = lanes_left(queries, lanes);
        if (done || !lanes) return true;
    }
    f->answers = w->answers;
    const enum course course = begin_lanes(f, lanes, t_max);
    *goes_on = course == TOGETHER;
    if (*goes_on && (f->each = f->each || !look_along(f))) look_at_each(f);
    return course < ONE_BY_ONE || visit_one_by_one(tracer, index, f->lanes, course, queries, t_max, any);
}

/* A frame after some of its rays have met something. */
static void take_answers(pl_packet_frame *f, const pl_bvh_work *w, const pl_query *queries, const double *t_max, bool any)
{
    f->answers = w->answers;
    if (any) {
        const unsigned left = lanes_left(queries, f->lanes);
        if (!f->each && left && left != f->lanes) {
            f->lanes = left;
            look_along(f);
        }
        f->lanes = left;
    } else {
        set_t_max(f, t_max);
    }
}

/* Goes on with a frame; in line, as it mostly has nothing to do. */
static inline __attribute__((always_inline)) void go_on(pl_packet_frame *f, const pl_bvh_work *w, const pl_query *queries,
                                                        const double *t_max, bool any)
{
    if (f->answers != w->answers) take_answers(f, w, queries, t_max, any);
}

/* The same after a primitive was offered to some lanes only. */
static inline void go_on_each(pl_packet_frame *f, const pl_bvh_work *w, unsigned lanes, const pl_query *queries, const double *t_max,
                              bool any)
{
    f->answers = w->answers;
    if (any) f->lanes &= ~lanes | lanes_left(queries, lanes);
    for (; !any && lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        f->t_max[lane] = t_between(f->t0, t_max[lane], f->rate);
    }
}

#include "kernel_through.h"

static inline bool visit_packet(pl_tracer *tracer, unsigned lanes, pl_query *queries, double *t_max, bool any)
{
    pl_bvh_work *w = tracer->work;
    const pl_fronts *fronts = tracer->scene->structure;
    const bool shadow = queries->shadow;
    pl_error *error = queries->error;
    uint32_t index = 0;
    bool goes_on;
    if (!enter_lanes(tracer, 0, lanes, queries, t_max, any, &goes_on)) return false;
    if (!goes_on) return true;
    pl_packet_frame *f = &w->packets[0];
    packet_way way = way_of(w);
    push_front(&way, f->front);
    for (;;) {
        pl_ref ref;
        unsigned some;
        if (!go_through_nodes(&way, w, f, any, &ref, &some, error)) return false;
        const uint32_t kind = ref >> PL_REF_SHIFT;
        if (kind == PL_KIND_RETURN) {
            if (index == 0) break;
            f = &w->packets[--index];
            go_on(f, w, queries, t_max, any);
        } else if (kind == PL_KIND_INSTANCE) {
            const uint32_t instance = ref & PL_REF_INDEX;
            const pl_front_instance *it = &f->front->instances[instance];
            if (shadow && it->front & PL_NO_SHADOW) continue;
            if (!pl_bvh_grow_packets(w, index + 1, error)) return false;
            f = &w->packets[index];
            pl_packet_frame *inner = f + 1;
            inner->front = &fronts->list[it->front & ~PL_NO_SHADOW];
            inner->instance = w->lanes->frames[index + 1].instance = instance;
            w->lanes->frames[index + 1].front = inner->front;
            tracer->counters.instances++;
            descend_lanes(inner, f, it, some);
            if (!enter_lanes(tracer, index + 1, some, queries, t_max, any, &goes_on)) return false;
            if (goes_on) {
                f = &w->packets[++index];
                push_front(&way, f->front);
            } else {
                go_on(f, w, queries, t_max, any);
            }
            if (++way.steps > PL_LIMIT_RAY_STEPS) return pl_query_fail_steps(queries, PL_LIMIT_RAY_STEPS);
        } else {
            const pl_front_primitive *p = &f->front->primitives[ref & PL_REF_INDEX];
            if (shadow && p->item & PL_NO_SHADOW) continue;
            tracer->counters.filtered++;
            unsigned certain = 0, found = filter_lanes(p, kind, f, some, any ? &certain : NULL);
            if (any) certain &= found = lanes_that_stay(w, index, ref, queries, found);
            if (!found) continue;
            for (unsigned rest = certain; rest; rest &= rest - 1) {
                pl_query *query = &queries[__builtin_ctz(rest)];
                query->found = query->done = true;
            }
            w->answers += certain != 0;
            if (found & ~certain && !offer_lanes(tracer, index, ref, found & ~certain, queries, t_max)) return false;
            if (f->each) go_on_each(f, w, found, queries, t_max, any);
            else go_on(f, w, queries, t_max, any);
            if (++way.steps > PL_LIMIT_RAY_STEPS) return pl_query_fail_steps(queries, PL_LIMIT_RAY_STEPS);
        }
    }
    tracer->counters.box_tests += way.steps * PL_FRONT_WIDTH;
    return true;
}

/* The rays as they came; lanes that are left over get the first one. */
static inline void load_rays(pl_lanes *lanes, const pl_ray *rays, const pl_query *queries, unsigned count, double *t_max)
{
    for (unsigned lane = 0; lane < PL_LANES; lane++) {
        const unsigned i = lane < count ? lane : 0;
        t_max[lane] = queries[i].t_max;
        for (int axis = 0; axis < 3; axis++) {
            lanes->o[axis][lane] = rays[i].origin[axis];
            lanes->d[axis][lane] = rays[i].direction[axis];
        }
    }
}

static inline four four_absolute(four x)
{
    return _mm256_andnot_pd(four_set(-0.0), x);
}

/* Whether all rays go about the same way. */
static inline bool are_alike(const pl_lanes *rays, const pl_front *front)
{
    const double near = PL_ALIKE * (__builtin_fabs(rays->d[0][0]) + __builtin_fabs(rays->d[1][0]) + __builtin_fabs(rays->d[2][0]));
    four alike = four_set(0.0) == four_set(0.0);
    for (int axis = 0; axis < 3; axis++) {
        const four o = four_set(rays->o[axis][0]), d = four_set(rays->d[axis][0]);
        for (int i = 0; i < PL_LANES; i += 4) {
            const four along = _mm256_loadu_pd(rays->d[axis] + i), apart = _mm256_loadu_pd(rays->o[axis] + i) - o;
            alike = _mm256_and_pd(alike, _mm256_cmp_pd(four_absolute(along - d), four_set(near), _CMP_LT_OQ));
            alike = _mm256_and_pd(alike, _mm256_cmp_pd(four_absolute(apart) * front->scale, four_set(PL_NEAR), _CMP_LT_OQ));
        }
    }
    return _mm256_movemask_pd(alike) == 15;
}

/* A packet's rays in the unit frame of the scene's front, from the first t that counts. */
static inline void begin_packet(pl_packet_frame *f, const pl_front *front, double t0)
{
    four farthest = four_set(0.0);
    for (int i = 0; i < PL_LANES; i += 4) {
        four away = four_set(0.0);
        for (int axis = 0; axis < 3; axis++) {
            const four from = (_mm256_loadu_pd(f->normative.o[axis] + i) - front->centre[axis]) * front->scale;
            const four d = _mm256_loadu_pd(f->normative.d[axis] + i) * front->scale;
            _mm256_storeu_pd(f->d[axis] + i, d);
            _mm256_storeu_pd(f->o[axis] + i, from + t0 * d);
            away += four_absolute(from);
        }
        farthest = _mm256_max_pd(away, farthest);
    }
    double distance = 0.0;
    for (int i = 0; i < 4; i++) distance = farthest[i] > distance ? farthest[i] : distance;
    f->front = front;
    f->instance = 0;
    f->error = 0.0f;
    f->distance = (float)distance * (1.0f + 0x1p-20f);
    f->t0 = t0;
    f->rate = 1.0;
    f->mapped = (1u << QUADS) - 1;
}

/* A packet at its beginning. false: its rays go different ways. */
static inline bool make_packet(pl_packet_frame *f, const pl_front *front, const pl_ray *rays, const pl_query *queries, unsigned count,
                               double *t_max)
{
    double t0 = queries->t_min;
    load_rays(&f->normative, rays, queries, count, t_max);
    if (!are_alike(&f->normative, front)) return false;
    for (unsigned i = 1; i < count; i++) t0 = queries[i].t_min < t0 ? queries[i].t_min : t0;
    begin_packet(f, front, t0);
    return true;
}

/* Rays that turn out to go different ways become two smaller packets or a stream. */
bool PACKET_KERNEL(pl_tracer *tracer, const pl_ray *rays, pl_query *queries, unsigned count)
{
    pl_bvh_work *w = tracer->work;
    double t_max[PL_LANES];
    if (!pl_bvh_grow_packets(w, 0, queries->error) || !pl_bvh_grow_packet_stack(w, 0, queries->error)) return false;
    const pl_front *front = ((const pl_fronts *)tracer->scene->structure)->list;
    if (!make_packet(w->packets, front, rays, queries, count, t_max)) {
        if (count <= PL_LANES / 2) return STREAM_KERNEL(tracer, rays, queries, count);
        return PACKET_KERNEL(tracer, rays, queries, PL_LANES / 2) &&
               PACKET_KERNEL(tracer, rays + PL_LANES / 2, queries + PL_LANES / 2, count - PL_LANES / 2);
    }
    w->lanes->frames[0].front = front;
    w->lanes->frames[0].instance = 0;
    const unsigned lanes = UINT32_MAX >> (32 - count);
    const bool ok = queries->kind == PL_QUERY_ANY ? visit_packet(tracer, lanes, queries, t_max, true)
                                                  : visit_packet(tracer, lanes, queries, t_max, false);
    wide_end();
    return ok;
}
