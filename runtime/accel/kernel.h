/* kernel.h - the traversal of fronts, compiled once for each instruction set by a kernel_*.c that defines the eight-wide
 * operations (wide, wide_load, wide_order, …) and KERNEL, the name of the function.
 *
 * A ray goes to the nearest child first; kernel_stream.h and kernel_packet.h take several rays at once. The stack holds
 * 64-bit entries, the local t of entry in the high half (but for its last three bits), so that they sort as integers; an
 * instance pushes a PL_KIND_RETURN entry below its own. All that is computed in single precision filters only
 * (front.h), so instruction sets can't show in hits. */
#include "bvh.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "kernel_filter.h"

static inline uint64_t entry_of(float t, pl_ref ref)
{
    uint32_t bits;
    memcpy(&bits, &t, sizeof bits);
    return (uint64_t)bits << 32 | ref;
}

/* Entries above it lie beyond t_max: numbers that aren't negative compare like their bits. */
static inline uint64_t limit_of(float t_max)
{
    uint32_t bits;
    memcpy(&bits, &t_max, sizeof bits);
    return (uint64_t)(bits | (PL_FRONT_WIDTH - 1)) << 32 | UINT32_MAX;
}

static inline bool entry_is_beyond(uint64_t entry, float t_max)
{
    return entry > limit_of(t_max);
}

/* --- entering an instance --- */

static inline float4 absolute(float4 x)
{
    return (float4)((int4)x & INT32_MAX);
}

/* a0 b0 a1 b1; a2 b2 a3 b3; the second half twice. */
#define LOW(a, b) __builtin_shuffle(a, b, (int4){0, 4, 1, 5})
#define HIGH(a, b) __builtin_shuffle(a, b, (int4){2, 6, 3, 7})
#define SECOND(a) __builtin_shuffle(a, (int4){2, 3, 2, 3})

/* The sums of the sizes of a's first three numbers, and of b's, in the first two places. */
static inline float4 sums_of(float4 a, float4 b)
{
    const int4 three = {INT32_MAX, INT32_MAX, INT32_MAX};
    const float4 x = (float4)((int4)a & three), y = (float4)((int4)b & three), pairs = LOW(x, y) + HIGH(x, y);
    return pairs + SECOND(pairs);
}

/* The least of a's first three numbers, and of b's. */
static inline float4 least_of(float4 a, float4 b)
{
    const int4 three = {0, 1, 2, 7};
    const float4 most = {0.0f, 0.0f, 0.0f, INFINITY};
    a = __builtin_shuffle(a, most, three);
    b = __builtin_shuffle(b, most, three);
    const float4 pairs = four_min(LOW(a, b), HIGH(a, b));
    return four_min(pairs, SECOND(pairs));
}

/* The power of two that brings x into [1, 2), where it and its inverse are normal numbers. */
static inline double inverse_power(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits = (UINT64_C(2046) << 52) - (bits & UINT64_C(2047) << 52);
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* From t0 to t_max in a frame's own t, rounded up. */
static inline float t_between(double t0, double t_max, double rate)
{
    const double t = (t_max - t0) * rate * (1.0 + 0x1p-20);
    return t < 1e30 ? (t > 0.0 ? (float)t + 1e-35f : 1e-35f) : 1e30f;
}

static inline float local_t_max(const pl_frame *f, double t_max)
{
    return f->blind ? 1e30f : t_between(f->t0, t_max, f->rate);
}

/* The ray in single precision, and what the loop needs at each node. */
static inline void set_ray(pl_frame *f, float4 origin, float4 direction, float4 inverse)
{
    const int4 first = {0, PL_FRONT_WIDTH, 2 * PL_FRONT_WIDTH}, high = ((int4)direction >> 31) & 3 * PL_FRONT_WIDTH;
    const float4 middle = origin * inverse, toward = f->slack * absolute(inverse);
    *(float4 *)f->origin = origin;
    *(float4 *)f->direction = direction;
    *(float4 *)f->inverse = inverse;
    *(float4 *)f->near_base = middle + toward;
    *(float4 *)f->far_base = middle - toward;
    *(int4 *)f->near_row = first + high;
    *(int4 *)f->far_row = first + 3 * PL_FRONT_WIDTH - high;
}

/* A ray that can't be told in single precision meets everything. */
static void go_blind(pl_frame *f)
{
    const float4 zero = {0};
    f->blind = true;
    f->slack = 1e30f;
    set_ray(f, zero, zero, zero + 1.0f);
}

/* Where the ray o + t·d is within a frame's box widened by the slack. A direction that hardly moves along an axis still gets
 * an inverse: within the front it moves by less than the slack either way. */
typedef struct span {
    float4 along, inverse;
    float enter, leave;
} span;

static inline span box_span(const pl_front *front, float4 o, float4 d, float slack)
{
    const float4 least = {1e-18f, 1e-18f, 1e-18f, 1e-18f};
    span s;
    s.along = (float4)((int4)four_max(absolute(d), least) | ((int4)d & INT32_MIN));
    s.inverse = 1.0f / s.along;
    const float4 middle = o * s.inverse, reach = (*(const float4 *)front->half + slack) * absolute(s.inverse);
    const float4 ends = least_of(reach + middle, reach - middle);
    s.enter = ends[0] < 0.0f ? -ends[0] : 0.0f;
    s.leave = ends[1];
    return s;
}

/* How far a ray may be from the box and still be told in single precision. Where there are instances, whose unit frames are as many
 * times smaller as it becomes farther, it is brought near sooner. */
static inline float far_of(const pl_front *front)
{
    return front->instance_count ? 64.0f : 256.0f;
}

/* Farther than this no ray is told, and its direction's length must be between these. */
#define FARTHEST 1e12f
#define SLOW 0x1p-20f
#define FAST 0x1p20f

static inline float slack_of(const pl_frame *f, float far)
{
    return f->error + f->front->slack_gain * f->distance + f->front->slack_base + 0x1p-19f * (1.0f + far);
}

/* Moves the ray along itself to where t is `enter` in the frame's own t. */
static inline void move_along(pl_frame *f, float enter, float far)
{
    f->t0 += (double)enter / f->rate;
    *(double4 *)f->o += (double)enter * *(const double4 *)f->d;
    f->error += 0x1p-49f * (f->distance + far);
}

/* Brings the direction to about unit length by a power of two. false: the ray can't be told in single precision. */
static __attribute__((noinline)) bool normalise(pl_frame *f)
{
    double largest = 0.0, far = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        double size = __builtin_fabs(f->d[axis]);
        largest = size > largest ? size : largest;
        far += __builtin_fabs(f->o[axis]);
    }
    const double shrink = inverse_power(largest), rate = f->rate * inverse_power(shrink);
    if (!(far < (double)FARTHEST && rate > 1e-200 && rate < 1e200)) return false;
    for (int axis = 0; axis < 3; axis++) f->d[axis] *= shrink;
    f->rate = rate;
    return true;
}

/* Begins a frame with the ray of f->o and f->d; false if it misses the box. What begins far from the box is brought there.
 *
 * In the unit frame a hit lies outside its exact box by no more than `slack`: the rounding of the chain below (front.h),
 * of the ray above (error), and of single precision, where 2^-19 is some 30 roundings. */
static inline __attribute__((always_inline)) bool begin_frame(pl_frame *f, double4 o, double4 d, double t_max,
                                                              float *local_max)
{
    const bool filled = f->front->root != PL_NOTHING;
    float4 at = __builtin_convertvector(o, float4), along = __builtin_convertvector(d, float4);
    const float4 sums = sums_of(at, along);
    const float far = sums[0], size = sums[1];
    *(double4 *)f->o = o;
    *(double4 *)f->d = d;
    f->mapped = f->blind = false;
    if (__builtin_expect(!(far < FARTHEST && size >= SLOW && size <= FAST), 0)) {
        if (!normalise(f)) {
            go_blind(f);
            *local_max = 1e30f;
            return filled;
        }
        along = __builtin_convertvector(*(const double4 *)f->d, float4);
        *local_max = local_t_max(f, t_max);
    }
    f->slack = slack_of(f, far);
    const span s = box_span(f->front, at, along, f->slack);
    const bool told = f->slack < 1e6f;
    if (told && s.enter <= s.leave && s.enter <= *local_max && filled) {
        if (far > far_of(f->front)) {
            move_along(f, s.enter, far);
            at = __builtin_convertvector(*(const double4 *)f->o, float4);
            f->slack = slack_of(f, sums_of(at, at)[0]);
            *local_max = local_t_max(f, t_max);
        }
        set_ray(f, at, s.along, s.inverse);
        return true;
    }
    if (told && !f->front->unbounded_count) return false;
    go_blind(f);
    *local_max = 1e30f;
    return !told && filled;
}

/* Three of nine numbers; none beyond them is read. */
static inline float4 column(const float columns[9], int number)
{
    if (number < 2) return *(const float4 *)(columns + 3 * number);
    const float4 last = *(const float4 *)(columns + 5);
    return (float4){last[1], last[2], last[3], last[3]};
}

/* Maps the ray of a frame into an instance (front.h): *o and *d, and what bounds the new frame's error and distance. */
static inline __attribute__((always_inline)) void map_into(const pl_front_instance *it, const pl_frame *parent, pl_frame *f,
                                                           double4 *o, double4 *d)
{
    const pl_front_bounds *bounds = &parent->front->bounds;
    /* The fourth number of each means nothing. */
    const double4 centre = *(const double4 *)it->centre, from = *(const double4 *)parent->o - centre;
    const float4 x = column(it->columns, 0), y = column(it->columns, 1), z = column(it->columns, 2);
    double4 a = __builtin_convertvector(x, double4), b = __builtin_convertvector(y, double4);
    double4 c = __builtin_convertvector(z, double4);
    if (parent->front->fine) {
        const float *columns = parent->front->fine[f->instance].columns;
        a += __builtin_convertvector(column(columns, 0), double4);
        b += __builtin_convertvector(column(columns, 1), double4);
        c += __builtin_convertvector(column(columns, 2), double4);
    }
    *o = four_fma(a, from[0], four_fma(b, from[1], c * from[2]));
    *d = four_fma(a, parent->d[0], four_fma(b, parent->d[1], c * parent->d[2]));
    const float4 sums = sums_of(x * x + y * y + z * z, __builtin_convertvector(centre, float4));
    const float stretch = bounds->stretch * __builtin_sqrtf(sums[0]), away = sums[1];
    f->error = stretch * (parent->error + bounds->gain * parent->distance + bounds->base) + bounds->rough;
    f->distance = stretch * (parent->distance + away);
    f->t0 = parent->t0;
    f->rate = parent->rate;
}

/* Goes into an instance: frame `index` + 1. 0: it misses, 1: it meets the box, 2: only what is unbounded, -1: an error. In line:
 * with a call for it random rays take 2 % longer. */
static inline __attribute__((always_inline)) int descend(pl_tracer *tracer, pl_bvh_lane *lane, uint32_t index, uint32_t instance,
                                                         const pl_query *query, float *local_max)
{
    const pl_fronts *fronts = tracer->scene->structure;
    if (index + 1 >= lane->frame_capacity && !pl_bvh_grow_frames(lane, index + 1, query->error)) return -1;
    const pl_frame *parent = &lane->frames[index];
    const pl_front_instance *it = &parent->front->instances[instance];
    if (query->shadow && it->front & PL_NO_SHADOW) return 0;
    pl_frame *f = &lane->frames[index + 1];
    double4 o, d;
    f->front = &fronts->list[it->front & ~PL_NO_SHADOW];
    f->instance = instance;
    map_into(it, parent, f, &o, &d);
    /* Not local_t_max: whether f is blind isn't known yet. */
    if (parent->blind) *local_max = t_between(f->t0, query->t_max, f->rate);
    tracer->counters.instances++;
    if (begin_frame(f, o, d, query->t_max, local_max)) return 1;
    return f->front->unbounded_count ? 2 : 0;
}

#include "kernel_candidate.h"

/* --- the loop --- */

/* Where the ray enters and leaves a node's children. */
static inline __attribute__((always_inline)) void meet(const pl_frame *f, float t_max, const pl_front_node *node, wide *enter,
                                                       wide *leave)
{
    wide near_t[3], far_t[3];
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        const wide inverse = wide_set(f->inverse[axis]);
        near_t[axis] = wide_multiply_subtract(wide_load(node->planes[0] + f->near_row[axis]), inverse,
                                              wide_set(f->near_base[axis]));
        far_t[axis] = wide_multiply_subtract(wide_load(node->planes[0] + f->far_row[axis]), inverse,
                                             wide_set(f->far_base[axis]));
    }
    *enter = wide_max(wide_max(near_t[0], near_t[1]), wide_max(near_t[2], wide_set(0.0f)));
    *leave = wide_min(wide_min(far_t[0], far_t[1]), wide_min(far_t[2], wide_set(t_max)));
}

/* Writes the children of a node that the ray meets, the nearest last (alone it isn't written); returns their number. */
static inline __attribute__((always_inline)) unsigned meet_nearest(const pl_frame *f, float t_max, const pl_front_node *node,
                                                                   uint64_t *entries, pl_ref *nearest)
{
    wide enter, leave;
    meet(f, t_max, node, &enter, &leave);
    return wide_order(enter, leave, node->child, entries, nearest);
}

/* A ray on its way: 64 bytes, so that streams find theirs fast. */
typedef struct walk {
    pl_bvh_lane *lane;
    pl_query *query;
    const pl_frame *f; /* frame `frame` of the lane, and its front's nodes */
    const pl_front_node *nodes;
    uint64_t *top, *full; /* of the lane's stack; up to `full` there is room for a node's entries */
    uint32_t steps; /* but for nodes */
    uint32_t frame, base; /* ends where `base` is left */
    float t_max;       /* in the frame's own t */
} walk;

enum progress { FAILED = -1, ENDED, UNDER_WAY };

/* One more step that isn't a node. false: too many. */
static inline bool count_step(walk *k)
{
    if (__builtin_expect(++k->steps <= PL_LIMIT_RAY_STEPS, 1)) return true;
    return pl_query_fail_steps(k->query, PL_LIMIT_RAY_STEPS);
}

/* At a frame, which is number k->frame. */
static inline void look(walk *k, const pl_frame *f, float t_max)
{
    k->f = f;
    k->nodes = f->front->nodes;
    k->t_max = t_max;
}

enum { NODE_ROOM = 16 };

/* A stack whose first entries are known, with room for so many more and for a node's. false: no memory. */
static inline bool stand(walk *k, size_t top, size_t count)
{
    if (!pl_bvh_grow_stack(k->lane, top + count, k->query->error)) return false;
    k->top = k->lane->stack + top;
    k->full = k->lane->stack + k->lane->stack_capacity - NODE_ROOM;
    return true;
}

static inline bool make_room(walk *k, size_t count)
{
    if (__builtin_expect(k->top + count <= k->full, 1)) return true;
    return stand(k, (size_t)(k->top - k->lane->stack), count);
}

/* Leaves out what lies beyond t_max among the ENTRIES_AT_ONCE on top. The way back never does. */
static inline void pass_beyond(walk *k)
{
    const uint32_t within = entries_within(k->top - ENTRIES_AT_ONCE, limit_of(k->t_max));
    k->top -= (size_t)__builtin_clz(within << 1 | 1) + ENTRIES_AT_ONCE - 31;
}

/* Pushes what the frame begins with, below it the way back. */
static inline bool begin(walk *k, bool met)
{
    const pl_front *front = k->f->front;
    const uint32_t count = front->unbounded_count;
    if (!make_room(k, count)) return false;
    *k->top++ = entry_of(0.0f, pl_ref_of(PL_KIND_RETURN, 0));
    for (uint32_t i = 0; i < count; i++) *k->top++ = entry_of(0.0f, front->unbounded[i]);
    if (met) *k->top++ = entry_of(0.0f, front->root);
    return true;
}

/* From frame `base` on. met: its box; else only what is unbounded there counts. false: no memory. */
static inline bool set_off(walk *k, pl_bvh_lane *lane, pl_query *query, uint32_t base, bool met)
{
    k->lane = lane;
    k->query = query;
    k->steps = 0;
    if (!stand(k, ENTRIES_AT_ONCE, 0)) return false; /* pass_beyond reads them */
    memset(lane->stack, 0, ENTRIES_AT_ONCE * sizeof *lane->stack);
    k->frame = k->base = base;
    look(k, &lane->frames[base], local_t_max(&lane->frames[base], query->t_max));
    return begin(k, met);
}

/* The end of a frame, and of those above in which nothing is left. */
static inline enum progress go_back(walk *k)
{
    for (;; k->top--) {
        if (k->frame == k->base) return ENDED;
        k->frame--;
        look(k, k->f - 1, local_t_max(k->f - 1, k->query->t_max));
        pass_beyond(k);
        if ((pl_ref)k->top[-1] >> PL_REF_SHIFT != PL_KIND_RETURN) return UNDER_WAY;
    }
}

/* An instance, and what it begins with. */
static inline __attribute__((always_inline)) enum progress go_into(pl_tracer *tracer, walk *k, uint32_t instance)
{
    float t_max = k->t_max;
    const int entered = descend(tracer, k->lane, k->frame, instance, k->query, &t_max);
    if (entered < 0) return FAILED;
    if (entered == 0) t_max = k->t_max;
    k->frame += entered > 0;
    look(k, &k->lane->frames[k->frame], t_max); /* frames may have moved */
    if (entered == 0) return UNDER_WAY;
    return begin(k, entered == 1) && count_step(k) ? UNDER_WAY : FAILED;
}

/* Whether a primitive is met. */
static inline __attribute__((always_inline)) enum kernel_verdict judge(pl_tracer *tracer, const walk *k, pl_ref ref, bool any)
{
    const pl_front_primitive *p = &k->f->front->primitives[ref & PL_REF_INDEX];
    if (k->query->shadow && p->item & PL_NO_SHADOW) return MISS;
    tracer->counters.filtered++;
    const enum kernel_verdict verdict = filter(p, ref >> PL_REF_SHIFT, k->f, k->t_max, any);
    return any && verdict != MISS && pl_bvh_is_left(k->query->leaves, k->lane->frames, k->frame, ref) ? MISS : verdict;
}

/* A primitive that may be met, or must be. */
static inline enum progress settle_primitive(pl_tracer *tracer, walk *k, pl_ref ref, bool certain)
{
    pl_query *query = k->query;
    if (certain) query->found = query->done = true;
    else if (!evaluate(tracer, k->lane, k->frame, ref, query)) return FAILED;
    if (query->done) return ENDED;
    k->t_max = local_t_max(k->f, query->t_max);
    pass_beyond(k);
    return count_step(k) ? UNDER_WAY : FAILED;
}

/* Does what stands next on the stack where it isn't a node. */
static inline __attribute__((always_inline)) enum progress take(pl_tracer *tracer, walk *k, pl_ref ref, bool any)
{
    const uint32_t kind = ref >> PL_REF_SHIFT;
    if (kind == PL_KIND_RETURN) return go_back(k);
    if (kind == PL_KIND_INSTANCE) return go_into(tracer, k, ref & PL_REF_INDEX);
    const enum kernel_verdict verdict = judge(tracer, k, ref, any);
    return verdict == MISS ? UNDER_WAY : settle_primitive(tracer, k, ref, any && verdict == CERTAIN);
}

/* One ray to its end. false: an error. */
static inline bool visit(pl_tracer *tracer, walk *k, bool any)
{
    uint64_t nodes = 0;
    enum progress progress = UNDER_WAY;
    while (progress == UNDER_WAY) {
        const uint64_t at = *--k->top;
        pl_ref ref = (pl_ref)at;
        if (entry_is_beyond(at, k->t_max)) continue;
        while (ref >> PL_REF_SHIFT == PL_KIND_NODE) {
            unsigned count = meet_nearest(k->f, k->t_max, &k->nodes[ref], k->top, &ref);
            nodes++;
            if (count == 0) goto next;
            k->top += count - 1;
            if (!make_room(k, 0)) return false;
        }
        progress = take(tracer, k, ref, any);
    next:;
    }
    tracer->counters.box_tests += (nodes + k->steps) * PL_FRONT_WIDTH;
    return progress == ENDED;
}

/* Begins frame 0 with a ray. false: nothing is met. */
static inline bool begin_root(pl_tracer *tracer, pl_bvh_lane *lane, const pl_ray *ray, const pl_query *query, bool *met)
{
    const pl_fronts *fronts = tracer->scene->structure;
    pl_frame *root = &lane->frames[0];
    const pl_front *front = &fronts->list[0];
    const double4 origin = {ray->origin[0], ray->origin[1], ray->origin[2]};
    const double4 direction = {ray->direction[0], ray->direction[1], ray->direction[2]};
    const double4 from = (origin - *(const double4 *)front->centre) * front->scale, d = direction * front->scale;
    float local_max = 1e30f;
    root->front = front;
    root->error = 0.0f;
    root->distance = (float)__builtin_fabs(from[0]) + (float)__builtin_fabs(from[1]) + (float)__builtin_fabs(from[2]);
    root->distance *= 1.0f + 0x1p-20f;
    root->t0 = query->t_min;
    root->rate = 1.0;
    root->instance = 0;
    *met = begin_frame(root, from + query->t_min * d, d, query->t_max, &local_max);
    root->mapped = true;
    *(double4 *)root->normative_o = origin;
    *(double4 *)root->normative_d = direction;
    return *met || front->unbounded_count;
}

bool KERNEL(pl_tracer *tracer, const pl_ray *ray, pl_query *query)
{
    pl_bvh_work *w = tracer->work;
    bool met, ok = true;
    if (begin_root(tracer, w->lanes, ray, query, &met)) {
        walk k;
        ok = set_off(&k, w->lanes, query, 0, met) &&
             (query->kind == PL_QUERY_ANY ? visit(tracer, &k, true) : visit(tracer, &k, false));
    }
    wide_end();
    return ok;
}
