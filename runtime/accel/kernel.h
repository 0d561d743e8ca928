/* kernel.h - the traversal of fronts, compiled once for each instruction set by a kernel_*.c that defines the eight-wide
 * operations (wide, wide_load, wide_set, …) and KERNEL, the name of the function.
 *
 * Single ray, nearest child first. The stack holds 64-bit entries, the local t of entry in the high half, so that they
 * sort as integers; an instance pushes a PL_KIND_RETURN entry below its own. All that is computed here in single
 * precision filters only (front.h), so instruction sets can't show in hits. */
#include "bvh.h"

#include <string.h>

enum kernel_verdict { MISS, CANDIDATE, CERTAIN };

static inline uint64_t entry_of(float t, pl_ref ref)
{
    uint32_t bits;
    memcpy(&bits, &t, sizeof bits);
    return (uint64_t)bits << 32 | ref;
}

static inline float entry_t(uint64_t entry)
{
    uint32_t bits = (uint32_t)(entry >> 32);
    float t;
    memcpy(&t, &bits, sizeof t);
    return t;
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

/* Whether a primitive can have a root in (0, t_max) of the frame; with `any`, also whether it must. */
static inline enum kernel_verdict filter(const pl_front_primitive *p, uint32_t kind, const pl_frame *f, float t_max,
                                         bool any)
{
    float o[3], d[3];
    if (kind == PL_KIND_MESH || kind == PL_SHAPE_PLANE) return CANDIDATE;
    for (int r = 0; r < 3; r++) {
        const float *m = p->to_object + 4 * r;
        o[r] = m[0] * f->origin[0] + m[1] * f->origin[1] + m[2] * f->origin[2] + m[3];
        d[r] = m[0] * f->direction[0] + m[1] * f->direction[1] + m[2] * f->direction[2];
    }
    float margin = p->stretch * f->slack + 0x1p-19f;
    interval i = {-1e30f, 1e30f};
    if (!shape_interval(kind, p->argument, o, d, margin, &i)) return MISS;
    if (i.enter > i.leave || i.enter > t_max || i.leave < 0.0f) return MISS;
    if (!any || !(kind == PL_SHAPE_CYLINDER || kind == PL_SHAPE_SPHERE || kind == PL_SHAPE_BOX)) return CANDIDATE;
    /* Outside the wider shape at first and later inside the narrower one: in between it passes the surface. */
    interval deep = {-1e30f, 1e30f};
    if (!(i.enter > 0.0f && margin < 0.25f) || !shape_interval(kind, p->argument, o, d, -margin, &deep)) return CANDIDATE;
    return deep.enter < deep.leave && deep.enter < t_max * 0.9999f ? CERTAIN : CANDIDATE;
}

/* --- entering an instance --- */

/* Four numbers at once: a vector and one that means nothing. */
typedef double double4 __attribute__((vector_size(32), aligned(8), may_alias));
typedef float float4 __attribute__((vector_size(16), aligned(4), may_alias));
typedef int64_t long4 __attribute__((vector_size(32)));
typedef int32_t int4 __attribute__((vector_size(16)));

static inline double4 absolute(double4 x)
{
    return (double4)((long4)x & INT64_MAX);
}

static inline float4 absolute_float(float4 x)
{
    return (float4)((int4)x & INT32_MAX);
}

static inline double larger(double a, double b)
{
    return a > b ? a : b;
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

/* A ray that can't be told in single precision meets everything. */
static void give_up_filtering(pl_frame *f, double t_min)
{
    f->t0 = t_min;
    f->rate = 0.0;
    f->slack = 1e30f;
    for (int axis = 0; axis < 3; axis++) {
        f->origin[axis] = f->direction[axis] = 0.0f;
        f->inverse[axis] = 1.0f;
    }
}

/* Begins a frame with the ray of f->o and f->d; false if it misses the box. f->t0 becomes where the box begins, roughly:
 * no hit lies before it, and from there on all numbers are about 1, which single precision can tell apart.
 *
 * In the unit frame a hit lies outside its exact box by no more than `slack`: the rounding of the chain below (reach.h,
 * twice: boxes here are composed too), of the ray above (error), of moving to t0; and of single precision, where
 * 2^-19 is some 30 roundings. A direction that hardly moves along an axis still gets an inverse: within the front it moves
 * by less than the slack either way. */
static inline __attribute__((always_inline)) bool begin_frame(pl_frame *f, double4 o, double4 d, double t_min, double t_max)
{
    const pl_front *front = f->front;
    double4 d_size = absolute(d), o_size = absolute(o);
    double largest = larger(d_size[0], larger(d_size[1], d_size[2]));
    double shrink = inverse_power(largest);
    *(double4 *)f->o = o;
    *(double4 *)f->d = d;
    f->mapped = false;
    f->distance = o_size[0] + o_size[1] + o_size[2];
    double slack = f->error + DBL_EPSILON * (2.0 * (front->reach.gain * f->distance + front->reach.base) +
                                             16.0 * (f->distance + front->reach.size));
    slack *= 1.001 * front->scale;
    f->rate = front->scale * inverse_power(shrink);
    double4 origin = (o + t_min * d - *(const double4 *)front->centre) * front->scale, direction = d * shrink;
    double4 far = absolute(origin);
    double wide_slack = slack + 0x1p-19 * (1.0 + far[0] + far[1] + far[2]);
    if (front->root == PL_NOTHING || !(f->rate > 1e-200 && f->rate < 1e200 && wide_slack < 1e6)) {
        give_up_filtering(f, t_min);
        return front->root != PL_NOTHING;
    }
    float4 along = __builtin_convertvector(direction, float4), at = __builtin_convertvector(origin, float4);
    int4 still = absolute_float(along) <= 1e-18f;
    along = (float4)((still & (int4)(float4){1e-18f, 1e-18f, 1e-18f, 1e-18f}) | (~still & (int4)along) |
                     ((int4)along & INT32_MIN));
    float4 inverse = 1.0f / along, middle = -at * inverse;
    float4 reach = (*(const float4 *)front->half + (float)wide_slack) * absolute_float(inverse);
    float4 near_t = middle - reach, far_t = middle + reach;
    float enter = near_t[0] > near_t[1] ? near_t[0] : near_t[1], leave = far_t[0] < far_t[1] ? far_t[0] : far_t[1];
    enter = near_t[2] > enter ? near_t[2] : enter;
    leave = far_t[2] < leave ? far_t[2] : leave;
    enter = enter > 0.0f ? enter : 0.0f;
    f->t0 = t_min + (double)enter * shrink * front->size;
    if (enter > leave || f->t0 > t_max) {
        give_up_filtering(f, t_min);
        return false;
    }
    origin += (double)enter * direction;
    far = absolute(origin);
    *(float4 *)f->origin = __builtin_convertvector(origin, float4);
    *(float4 *)f->direction = along;
    *(float4 *)f->inverse = inverse;
    f->slack = (float)(slack + 0x1p-19 * (1.0 + far[0] + far[1] + far[2]));
    return true;
}

/* Goes into an instance: frame `index` + 1. 0: it misses, 1: it meets the box, 2: only what is unbounded, -1: an error. */
static inline int descend(pl_tracer *tracer, uint32_t index, uint32_t instance, pl_query *query)
{
    pl_bvh_work *w = tracer->work;
    const pl_fronts *fronts = tracer->scene->structure;
    if (index + 1 >= w->frame_capacity && !pl_bvh_grow_frames(w, index + 1, query->error)) return -1;
    const pl_frame *parent = &w->frames[index];
    const pl_front *front = parent->front;
    const pl_front_instance *it = &front->instances[instance];
    if (query->shadow && it->item & PL_NO_SHADOW) return 0;
    pl_frame *f = &w->frames[index + 1];
    f->front = &fronts->list[it->front];
    f->instance = instance;
    f->error = (double)it->stretch * parent->error +
               DBL_EPSILON * ((double)it->gain * (2.0 * parent->distance + front->reach.size) + (double)it->base);
    /* The fourth number of each is the next column's first, and nobody looks at what becomes of it. */
    const double4 x = *(const double4 *)it->columns, y = *(const double4 *)(it->columns + 3);
    const double4 z = *(const double4 *)(it->columns + 6), offset = *(const double4 *)(it->columns + 9);
    double4 o = x * parent->o[0] + y * parent->o[1] + z * parent->o[2] + offset;
    double4 d = x * parent->d[0] + y * parent->d[1] + z * parent->d[2];
    tracer->counters.instances++;
    if (begin_frame(f, o, d, query->t_min, query->t_max)) return 1;
    return f->front->unbounded_count ? 2 : 0;
}

/* --- the loop --- */

/* What the loop keeps at hand of the frame it is in. */
typedef struct near {
    wide near_origin[3], far_origin[3], inverse[3];
    uint32_t near_row[3], far_row[3]; /* offsets of planes, in floats */
    float t_max;
} near;

/* t_max in the frame's own t, rounded up. */
static inline float local_t_max(const pl_frame *f, double t_max)
{
    if (f->rate == 0.0) return 1e30f;
    double t = (t_max - f->t0) * f->rate * (1.0 + 0x1p-20);
    return t < 1e30 ? (t > 0.0 ? (float)t + 1e-35f : 1e-35f) : 1e30f;
}

static inline void look(near *n, const pl_frame *f, double t_max)
{
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        bool negative = f->direction[axis] < 0.0f;
        float toward = negative ? -f->slack : f->slack;
        n->near_origin[axis] = wide_set(f->origin[axis] + toward);
        n->far_origin[axis] = wide_set(f->origin[axis] - toward);
        n->inverse[axis] = wide_set(f->inverse[axis]);
        n->near_row[axis] = (uint32_t)(negative ? 3 + axis : axis) * PL_FRONT_WIDTH;
        n->far_row[axis] = (uint32_t)(negative ? axis : 3 + axis) * PL_FRONT_WIDTH;
    }
    n->t_max = local_t_max(f, t_max);
}

/* Writes the children of a node that the ray meets, in no order; returns their number. */
static inline unsigned meet(const near *n, const pl_front_node *node, uint64_t *entries)
{
    wide enter = wide_set(0.0f), leave = wide_set(n->t_max);
    wide near_t[3], far_t[3];
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        wide near_plane = wide_load(node->planes[0] + n->near_row[axis]);
        wide far_plane = wide_load(node->planes[0] + n->far_row[axis]);
        near_t[axis] = wide_multiply(wide_subtract(near_plane, n->near_origin[axis]), n->inverse[axis]);
        far_t[axis] = wide_multiply(wide_subtract(far_plane, n->far_origin[axis]), n->inverse[axis]);
    }
    enter = wide_max(wide_max(near_t[0], near_t[1]), wide_max(near_t[2], enter));
    leave = wide_min(wide_min(far_t[0], far_t[1]), wide_min(far_t[2], leave));
    return wide_entries(enter, leave, node->child, entries);
}

/* The nearest last. */
static inline void sort_entries(uint64_t *entries, unsigned count)
{
    for (unsigned i = 1; i < count; i++) {
        uint64_t entry = entries[i];
        unsigned place = i;
        for (; place > 0 && entries[place - 1] < entry; place--) entries[place] = entries[place - 1];
        entries[place] = entry;
    }
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

/* met: the root's box; else only what is unbounded there counts. */
static inline bool visit(pl_tracer *tracer, pl_query *query, bool met, bool any)
{
    pl_bvh_work *w = tracer->work;
    uint64_t *stack, steps = 0;
    uint32_t frame = 0;
    const pl_frame *f = &w->frames[0];
    size_t top = 0;
    near n;
    if (!begin(w, f->front, met, &top, query->error)) return false;
    stack = w->stack;
    look(&n, f, query->t_max);
    for (;;) {
        uint64_t at = stack[--top];
        pl_ref ref = (pl_ref)at;
        if (entry_t(at) > n.t_max) continue;
        while (ref >> PL_REF_SHIFT == PL_KIND_NODE) {
            const pl_front_node *node = &f->front->nodes[ref];
            unsigned count = meet(&n, node, stack + top);
            steps++;
            if (count == 0) goto next;
            if (count == 2) {
                uint64_t a = stack[top], b = stack[top + 1];
                stack[top] = a > b ? a : b;
                stack[top + 1] = a > b ? b : a;
            } else if (count > 2) {
                sort_entries(stack + top, count);
            }
            top += count - 1;
            ref = (pl_ref)stack[top];
            if (top + 16 > w->stack_capacity) {
                if (!pl_bvh_grow_stack(w, top, query->error)) return false;
                stack = w->stack;
            }
        }
        uint32_t kind = ref >> PL_REF_SHIFT;
        if (kind == PL_KIND_RETURN) {
            if (frame == 0) break;
            f = &w->frames[--frame];
            look(&n, f, query->t_max);
        } else if (kind == PL_KIND_INSTANCE) {
            int entered = descend(tracer, frame, ref & PL_REF_INDEX, query);
            if (entered < 0) return false;
            if (entered) frame++;
            f = &w->frames[frame]; /* which may have moved */
            if (!entered) continue;
            if (!begin(w, f->front, entered == 1, &top, query->error)) return false;
            stack = w->stack;
            look(&n, f, query->t_max);
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
    const double4 o = {ray->origin[0], ray->origin[1], ray->origin[2]};
    const double4 d = {ray->direction[0], ray->direction[1], ray->direction[2]};
    root->front = &fronts->list[0];
    root->error = 0.0;
    root->instance = 0;
    bool met = begin_frame(root, o, d, query->t_min, query->t_max);
    if (!met && !root->front->unbounded_count) {
        wide_end();
        return true;
    }
    root->mapped = true;
    memcpy(root->normative_o, ray->origin, sizeof root->normative_o);
    memcpy(root->normative_d, ray->direction, sizeof root->normative_d);
    bool ok = query->kind == PL_QUERY_ANY ? visit(tracer, query, met, true) : visit(tracer, query, met, false);
    wide_end();
    return ok;
}
