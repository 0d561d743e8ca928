/* kernel_filter.h - whether a ray can meet a primitive, in single precision: part of kernel.h.
 *
 * A primitive that survives is evaluated in double; so what is said here may only ever be said too often. */

enum kernel_verdict { MISS, CANDIDATE, CERTAIN };

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
static inline __attribute__((always_inline)) bool shape_interval(uint32_t kind, float argument, const float o[3],
                                                                 const float d[3], float grow, interval *i)
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
        if (!inside_quadric(i, a, o[0] * d[0] + o[1] * d[1], a * r * r - cross * cross)) return false;
        between(i, o[2], inverse_of(d[2]), -grow, (kind == PL_SHAPE_CYLINDER ? 1.0f : 0.0f) + grow);
        return true;
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
typedef int64_t long4 __attribute__((vector_size(32), aligned(8), may_alias));
typedef float float4 __attribute__((vector_size(16), aligned(4), may_alias));
typedef int32_t int4 __attribute__((vector_size(16), aligned(4), may_alias));

/* Whether a ray o + t·d of a frame can have a root of a primitive in (0, t_max); with `any`, also whether it must. */
static inline __attribute__((always_inline)) enum kernel_verdict filter_ray(const pl_front_primitive *p, uint32_t kind,
                                                                           const float from[3], const float to[3], float slack,
                                                                           float t_max, bool any)
{
    if (kind == PL_KIND_MESH || kind == PL_SHAPE_PLANE) return CANDIDATE;
    const float4 x = *(const float4 *)p->columns, y = *(const float4 *)(p->columns + 3);
    const float4 z = *(const float4 *)(p->columns + 6), offset = *(const float4 *)(p->columns + 9);
    const float4 at = x * from[0] + y * from[1] + (z * from[2] + offset);
    const float4 along = x * to[0] + y * to[1] + z * to[2];
    const float o[3] = {at[0], at[1], at[2]}, d[3] = {along[0], along[1], along[2]};
    float margin = p->stretch * slack + 0x1p-19f;
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

static inline enum kernel_verdict filter(const pl_front_primitive *p, uint32_t kind, const pl_frame *f, float t_max, bool any)
{
    return filter_ray(p, kind, f->origin, f->direction, f->slack, t_max, any);
}
