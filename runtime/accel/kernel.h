/* kernel.h - the traversal of fronts, compiled once for each instruction set by a kernel_*.c that defines the eight-wide
 * operations (wide, wide_load, wide_order, …) and KERNEL, the name of the function.
 *
 * Single ray, nearest child first. The stack holds 64-bit entries, the local t of entry in the high half (but for its last
 * three bits), so that they sort as integers; an instance pushes a PL_KIND_RETURN entry below its own. All that is
 * computed here in single precision filters only (front.h), so instruction sets can't show in hits. */
#include "bvh.h"

#include <string.h>

enum kernel_verdict { MISS, CANDIDATE, CERTAIN };

static inline uint64_t entry_of(float t, pl_ref ref)
{
    uint32_t bits;
    memcpy(&bits, &t, sizeof bits);
    return (uint64_t)bits << 32 | ref;
}

/* Whether an entry lies beyond t_max: numbers that aren't negative compare like their bits. */
static inline bool entry_is_beyond(uint64_t entry, float t_max)
{
    uint32_t bits;
    memcpy(&bits, &t_max, sizeof bits);
    return ((uint32_t)(entry >> 32) & ~(uint32_t)(PL_FRONT_WIDTH - 1)) > bits;
}

/* [enter, leave], the ray's interval in the shape widened by the margin. Every constraint narrows it by itself, and each
 * is widened, so the interval holds the normative roots. NaN constrains nothing. */
typedef struct interval {
    float enter, leave;
} interval;

static inline void between(interval *i, float o, float inverse, float lo, float hi)
{
    float a = (lo - o) * inverse, b = (hi - o) * inverse;
    float near_t = a < b ? a : b, far_t = a < b ? b : a;
    if (near_t > i->enter) i->enter = near_t;
    if (far_t < i->leave) i->leave = far_t;
}

/* a·t² + 2b·t + c <= 0 with a >= 0 and the discriminant given. */
static inline bool inside_quadric(interval *i, float a, float b, float discriminant)
{
    if (!(a > 1e-30f)) return true; /* along the axis: the caller's other constraints remain */
    if (discriminant < 0.0f) return false;
    float root = __builtin_sqrtf(discriminant), over = 1.0f / a;
    float near_t = (-b - root) * over, far_t = (-b + root) * over;
    if (near_t > i->enter) i->enter = near_t;
    if (far_t < i->leave) i->leave = far_t;
    return true;
}

static inline float inverse_of(float d)
{
    return 1.0f / (__builtin_fabsf(d) > 1e-30f ? d : __builtin_copysignf(1e-30f, d));
}

/* What of the ray o + t·d is within `grow` of a unit shape; false: nothing. grow < 0 gives what lies as deep inside. */
static inline bool shape_interval(uint32_t kind, float argument, const float o[3], const float d[3], float grow,
                                  interval *i)
{
    switch (kind) {
    case PL_SHAPE_SPHERE: {
        float a = d[0] * d[0] + d[1] * d[1] + d[2] * d[2], r = 1.0f + grow;
        float x = o[1] * d[2] - o[2] * d[1], y = o[2] * d[0] - o[0] * d[2], z = o[0] * d[1] - o[1] * d[0];
        return inside_quadric(i, a, o[0] * d[0] + o[1] * d[1] + o[2] * d[2], a * r * r - (x * x + y * y + z * z));
    }
    case PL_SHAPE_DISC:
    case PL_SHAPE_CYLINDER: {
        float a = d[0] * d[0] + d[1] * d[1], r = 1.0f + grow, cross = o[0] * d[1] - o[1] * d[0];
        between(i, o[2], inverse_of(d[2]), -grow, (kind == PL_SHAPE_CYLINDER ? 1.0f : 0.0f) + grow);
        return inside_quadric(i, a, o[0] * d[0] + o[1] * d[1], a * r * r - cross * cross);
    }
    case PL_SHAPE_CONE: {
        /* Within a cylinder as wide as the cone's wider end; its side is left to double precision. */
        float a = d[0] * d[0] + d[1] * d[1], r = (argument > 1.0f ? argument : 1.0f) + grow;
        float cross = o[0] * d[1] - o[1] * d[0];
        between(i, o[2], inverse_of(d[2]), -grow, 1.0f + grow);
        return inside_quadric(i, a, o[0] * d[0] + o[1] * d[1], a * r * r - cross * cross);
    }
    case PL_SHAPE_TORUS: {
        float r = 1.0f + argument + grow, h = argument + grow;
        between(i, o[0], inverse_of(d[0]), -r, r);
        between(i, o[1], inverse_of(d[1]), -r, r);
        between(i, o[2], inverse_of(d[2]), -h, h);
        return true;
    }
    case PL_SHAPE_BOX:
    case PL_SHAPE_TRIANGLE:
    case PL_SHAPE_SQUARE:
        between(i, o[0], inverse_of(d[0]), -grow, 1.0f + grow);
        between(i, o[1], inverse_of(d[1]), -grow, 1.0f + grow);
        between(i, o[2], inverse_of(d[2]), -grow, (kind == PL_SHAPE_BOX ? 1.0f : 0.0f) + grow);
        if (kind == PL_SHAPE_TRIANGLE) { /* x + y <= 1: a half-plane */
            float along = d[0] + d[1], t = (1.0f + 2.0f * grow - o[0] - o[1]) * inverse_of(along);
            if (along > 0.0f && t < i->leave) i->leave = t;
            if (along < 0.0f && t > i->enter) i->enter = t;
        }
        return true;
    default: return true;
    }
}

/* Four numbers at once: a vector and one that means nothing. */
typedef double double4 __attribute__((vector_size(32), aligned(8), may_alias));
typedef float float4 __attribute__((vector_size(16), aligned(4), may_alias));
typedef int32_t int4 __attribute__((vector_size(16)));

/* Whether a primitive can have a root in (0, t_max) of the frame; with `any`, also whether it must. */
static inline enum kernel_verdict filter(const pl_front_primitive *p, uint32_t kind, const pl_frame *f, float t_max,
                                         bool any)
{
    if (kind == PL_KIND_MESH || kind == PL_SHAPE_PLANE) return CANDIDATE;
    const float4 x = *(const float4 *)p->columns, y = *(const float4 *)(p->columns + 3);
    const float4 z = *(const float4 *)(p->columns + 6), offset = *(const float4 *)(p->columns + 9);
    const float4 at = x * f->origin[0] + y * f->origin[1] + (z * f->origin[2] + offset);
    const float4 along = x * f->direction[0] + y * f->direction[1] + z * f->direction[2];
    const float o[3] = {at[0], at[1], at[2]}, d[3] = {along[0], along[1], along[2]};
    float margin = p->stretch * f->slack + 0x1p-19f;
    interval i = {-1e30f, 1e30f};
    if (!shape_interval(kind, p->argument, o, d, margin, &i)) return MISS;
    if (i.enter > i.leave || i.enter > t_max || i.leave < 0.0f) return MISS;
    if (!any || !(kind == PL_SHAPE_CYLINDER || kind == PL_SHAPE_SPHERE || kind == PL_SHAPE_BOX)) return CANDIDATE;
    /* Outside the wider shape at first and later inside the narrower one: in between it passes the surface. Along its axis a
     * cylinder's interval doesn't tell. */
    interval deep = {-1e30f, 1e30f};
    if (kind == PL_SHAPE_CYLINDER && !(d[0] * d[0] + d[1] * d[1] > 1e-30f)) return CANDIDATE;
    if (!(i.enter > 0.0f && margin < 0.25f) || !shape_interval(kind, p->argument, o, d, -margin, &deep)) return CANDIDATE;
    return deep.enter < deep.leave && deep.enter < t_max * 0.9999f ? CERTAIN : CANDIDATE;
}

/* --- entering an instance --- */

static inline float4 absolute(float4 x)
{
    return (float4)((int4)x & INT32_MAX);
}

static inline float sum_of(float4 x)
{
    return x[0] + x[1] + x[2];
}

static inline float least_of(float4 x)
{
    float least = x[0] < x[1] ? x[0] : x[1];
    return x[2] < least ? x[2] : least;
}

static inline float greatest_of(float4 x)
{
    float greatest = x[0] > x[1] ? x[0] : x[1];
    return x[2] > greatest ? x[2] : greatest;
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

/* t_max in the frame's own t, rounded up. */
static inline float local_t_max(const pl_frame *f, double t_max)
{
    if (f->blind) return 1e30f;
    double t = (t_max - f->t0) * f->rate * (1.0 + 0x1p-20);
    return t < 1e30 ? (t > 0.0 ? (float)t + 1e-35f : 1e-35f) : 1e30f;
}

/* A ray that can't be told in single precision meets everything. */
static void go_blind(pl_frame *f)
{
    f->blind = true;
    f->slack = 1e30f;
    for (int axis = 0; axis < 3; axis++) {
        f->origin[axis] = f->direction[axis] = 0.0f;
        f->inverse[axis] = 1.0f;
    }
}

/* Where the ray o + t·d is within a frame's box widened by the slack. A direction that hardly moves along an axis still gets
 * an inverse: within the front it moves by less than the slack either way. */
typedef struct span {
    float4 along, inverse;
    float enter, leave;
} span;

static inline span box_span(const pl_front *front, float4 o, float4 d, float slack)
{
    const int4 sign = (int4)d & INT32_MIN;
    const float4 size = absolute(d), least = {1e-18f, 1e-18f, 1e-18f, 1e-18f};
    const int4 moves = size > least;
    span s;
    s.along = (float4)((((int4)size & moves) | ((int4)least & ~moves)) | sign);
    s.inverse = 1.0f / s.along;
    const float4 middle = o * s.inverse, reach = (*(const float4 *)front->half + slack) * absolute(s.inverse);
    s.enter = greatest_of(-middle - reach);
    s.enter = s.enter > 0.0f ? s.enter : 0.0f;
    s.leave = least_of(reach - middle);
    return s;
}

/* How far a ray may be from the box and still be told in single precision, and what its direction's length may be. */
#define FAR 64.0f
#define SLOW 0x1p-20f
#define FAST 0x1p20f

static inline float slack_of(const pl_frame *f, float far)
{
    return f->error + f->front->slack_gain * f->distance + f->front->slack_base + 0x1p-19f * (1.0f + far);
}

enum settled { BLIND, MISSES, SETTLED };

/* Brings the ray to where the box begins, and its direction to about unit length by a power of two. */
static __attribute__((noinline)) enum settled settle(pl_frame *f, double t_max)
{
    double largest = 0.0, far = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        double size = __builtin_fabs(f->d[axis]);
        largest = size > largest ? size : largest;
        far += __builtin_fabs(f->o[axis]);
    }
    const double shrink = inverse_power(largest), rate = f->rate * inverse_power(shrink);
    if (!(far < 1e12 && rate > 1e-200 && rate < 1e200)) return BLIND;
    const float slack = slack_of(f, (float)far);
    if (!(slack < 1e6f)) return BLIND;
    float4 o = {0}, d = {0};
    for (int axis = 0; axis < 3; axis++) {
        f->d[axis] *= shrink;
        o[axis] = (float)f->o[axis];
        d[axis] = (float)f->d[axis];
    }
    f->rate = rate;
    const span s = box_span(f->front, o, d, slack);
    if (s.enter > s.leave || s.enter > local_t_max(f, t_max)) return MISSES;
    f->t0 += (double)s.enter / rate;
    for (int axis = 0; axis < 3; axis++) f->o[axis] += (double)s.enter * f->d[axis];
    f->error += 0x1p-49f * (f->distance + (float)far);
    return SETTLED;
}

/* Begins a frame with the ray of f->o and f->d; false if it misses the box.
 *
 * In the unit frame a hit lies outside its exact box by no more than `slack`: the rounding of the chain below (front.h),
 * of the ray above (error), and of single precision, where 2^-19 is some 30 roundings. */
static inline __attribute__((always_inline)) bool begin_frame(pl_frame *f, double4 o, double4 d, double t_max,
                                                              float *local_max)
{
    float4 at = __builtin_convertvector(o, float4), along = __builtin_convertvector(d, float4);
    float far = sum_of(absolute(at)), size = sum_of(absolute(along));
    *(double4 *)f->o = o;
    *(double4 *)f->d = d;
    f->mapped = f->blind = false;
    if (__builtin_expect(!(far <= FAR && size >= SLOW && size <= FAST), 0)) {
        enum settled result = settle(f, t_max);
        if (result != SETTLED) {
            go_blind(f);
            *local_max = 1e30f;
            return result == BLIND && f->front->root != PL_NOTHING;
        }
        at = __builtin_convertvector(*(const double4 *)f->o, float4);
        along = __builtin_convertvector(*(const double4 *)f->d, float4);
        far = sum_of(absolute(at));
        *local_max = local_t_max(f, t_max);
    }
    f->slack = slack_of(f, far);
    const span s = box_span(f->front, at, along, f->slack);
    *(float4 *)f->origin = at;
    *(float4 *)f->direction = s.along;
    *(float4 *)f->inverse = s.inverse;
    const bool told = f->slack < 1e6f;
    if (told && s.enter <= s.leave && s.enter <= *local_max && f->front->root != PL_NOTHING) return true;
    go_blind(f);
    *local_max = 1e30f;
    return !told && f->front->root != PL_NOTHING;
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
    const float stretch = bounds->stretch * __builtin_sqrtf(sum_of(x * x + y * y + z * z));
    const float away = sum_of(absolute(__builtin_convertvector(centre, float4)));
    f->error = stretch * (parent->error + bounds->gain * parent->distance + bounds->base) + bounds->rough;
    f->distance = stretch * (parent->distance + away);
    f->t0 = parent->t0;
    f->rate = parent->rate;
}

/* Goes into an instance: frame `index` + 1. 0: it misses, 1: it meets the box, 2: only what is unbounded, -1: an error. */
static inline int descend(pl_tracer *tracer, uint32_t index, uint32_t instance, const pl_query *query, float *local_max)
{
    pl_bvh_work *w = tracer->work;
    const pl_fronts *fronts = tracer->scene->structure;
    if (index + 1 >= w->frame_capacity && !pl_bvh_grow_frames(w, index + 1, query->error)) return -1;
    const pl_frame *parent = &w->frames[index];
    const pl_front_instance *it = &parent->front->instances[instance];
    if (query->shadow && it->front & PL_NO_SHADOW) return 0;
    pl_frame *f = &w->frames[index + 1];
    double4 o, d;
    f->front = &fronts->list[it->front & ~PL_NO_SHADOW];
    f->instance = instance;
    map_into(it, parent, f, &o, &d);
    if (parent->blind) *local_max = local_t_max(f, query->t_max);
    tracer->counters.instances++;
    if (begin_frame(f, o, d, query->t_max, local_max)) return 1;
    return f->front->unbounded_count ? 2 : 0;
}

/* --- the loop --- */

/* What the loop keeps at hand of the frame it is in. base: (origin moved by the slack) / direction. */
typedef struct near {
    wide near_base[3], far_base[3], inverse[3];
    uint32_t near_row[3], far_row[3]; /* offsets of planes, in floats */
    float t_max;
} near;

static inline void look(near *n, const pl_frame *f)
{
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        bool negative = f->direction[axis] < 0.0f;
        float toward = f->slack * __builtin_fabsf(f->inverse[axis]), middle = f->origin[axis] * f->inverse[axis];
        n->near_base[axis] = wide_set(middle + toward);
        n->far_base[axis] = wide_set(middle - toward);
        n->inverse[axis] = wide_set(f->inverse[axis]);
        n->near_row[axis] = (uint32_t)(negative ? 3 + axis : axis) * PL_FRONT_WIDTH;
        n->far_row[axis] = (uint32_t)(negative ? axis : 3 + axis) * PL_FRONT_WIDTH;
    }
}

/* Writes the children of a node that the ray meets, the nearest last; returns their number. */
static inline __attribute__((always_inline)) unsigned meet(const near *n, const pl_front_node *node, uint64_t *entries, pl_ref *nearest)
{
    wide near_t[3], far_t[3];
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        near_t[axis] = wide_multiply_subtract(wide_load(node->planes[0] + n->near_row[axis]), n->inverse[axis],
                                              n->near_base[axis]);
        far_t[axis] = wide_multiply_subtract(wide_load(node->planes[0] + n->far_row[axis]), n->inverse[axis],
                                             n->far_base[axis]);
    }
    wide enter = wide_max(wide_max(near_t[0], near_t[1]), wide_max(near_t[2], wide_set(0.0f)));
    wide leave = wide_min(wide_min(far_t[0], far_t[1]), wide_min(far_t[2], wide_set(n->t_max)));
    return wide_order(enter, leave, node->child, entries, nearest);
}

/* Pushes what a frame begins with, below it the way back. */
static inline bool begin(pl_bvh_work *w, const pl_front *front, bool met, size_t *top, pl_error *error)
{
    w->stack[(*top)++] = entry_of(0.0f, pl_ref_of(PL_KIND_RETURN, 0));
    for (uint32_t i = 0; i < front->unbounded_count; i++) {
        if (*top + 16 > w->stack_capacity && !pl_bvh_grow_stack(w, *top, error)) return false;
        w->stack[(*top)++] = entry_of(0.0f, front->unbounded[i]);
    }
    if (*top + 16 > w->stack_capacity && !pl_bvh_grow_stack(w, *top, error)) return false;
    if (met) w->stack[(*top)++] = entry_of(0.0f, front->root);
    return true;
}

/* From frame `base` on. met: its box; else only what is unbounded there counts. */
static inline bool visit(pl_tracer *tracer, pl_query *query, uint32_t base, bool met, bool any)
{
    pl_bvh_work *w = tracer->work;
    uint64_t *stack, steps = 0;
    uint32_t frame = base;
    const pl_frame *f = &w->frames[base];
    size_t top = 0;
    near n;
    if (!begin(w, f->front, met, &top, query->error)) return false;
    stack = w->stack;
    look(&n, f);
    n.t_max = local_t_max(f, query->t_max);
    for (;;) {
        uint64_t at = stack[--top];
        pl_ref ref = (pl_ref)at;
        if (entry_is_beyond(at, n.t_max)) continue;
        while (ref >> PL_REF_SHIFT == PL_KIND_NODE) {
            unsigned count = meet(&n, &f->front->nodes[ref], stack + top, &ref);
            steps++;
            if (count == 0) goto next;
            top += count - 1;
            if (top + 16 > w->stack_capacity) {
                if (!pl_bvh_grow_stack(w, top, query->error)) return false;
                stack = w->stack;
            }
        }
        uint32_t kind = ref >> PL_REF_SHIFT;
        if (kind == PL_KIND_RETURN) {
            if (frame == base) break;
            f = &w->frames[--frame];
            look(&n, f);
            n.t_max = local_t_max(f, query->t_max);
        } else if (kind == PL_KIND_INSTANCE) {
            float t_max = n.t_max;
            int entered = descend(tracer, frame, ref & PL_REF_INDEX, query, &t_max);
            if (entered < 0) return false;
            if (entered) frame++;
            f = &w->frames[frame]; /* which may have moved */
            if (!entered) continue;
            n.t_max = t_max;
            if (!begin(w, f->front, entered == 1, &top, query->error)) return false;
            stack = w->stack;
            look(&n, f);
            if (++steps > PL_LIMIT_RAY_STEPS) return pl_query_fail_steps(query, PL_LIMIT_RAY_STEPS);
        } else {
            const pl_front_primitive *p = &f->front->primitives[ref & PL_REF_INDEX];
            if (query->shadow && p->item & PL_NO_SHADOW) continue;
            tracer->counters.filtered++;
            enum kernel_verdict verdict = filter(p, kind, f, n.t_max, any);
            if (verdict == MISS) continue;
            if (any && verdict == CERTAIN) {
                query->found = query->done = true;
                break;
            }
            wide_end();
            if (!pl_bvh_candidate(tracer, frame, ref, query)) return false;
            if (query->done) break;
            n.t_max = local_t_max(f, query->t_max);
            if (++steps > PL_LIMIT_RAY_STEPS) return pl_query_fail_steps(query, PL_LIMIT_RAY_STEPS);
        }
    next:;
    }
    tracer->counters.box_tests += steps * PL_FRONT_WIDTH;
    return true;
}

bool KERNEL(pl_tracer *tracer, const pl_ray *ray, pl_query *query)
{
    pl_bvh_work *w = tracer->work;
    const pl_fronts *fronts = tracer->scene->structure;
    pl_frame *root = &w->frames[0];
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
    bool met = begin_frame(root, from + query->t_min * d, d, query->t_max, &local_max);
    if (!met && !root->front->unbounded_count) {
        wide_end();
        return true;
    }
    root->mapped = true;
    memcpy(root->normative_o, ray->origin, sizeof root->normative_o);
    memcpy(root->normative_d, ray->direction, sizeof root->normative_d);
    bool ok = query->kind == PL_QUERY_ANY ? visit(tracer, query, 0, met, true) : visit(tracer, query, 0, met, false);
    wide_end();
    return ok;
}
