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

/* What the loop keeps at hand of the frame it is in. */
typedef struct near {
    wide near_origin[3], far_origin[3], inverse[3];
    int near_row[3], far_row[3];
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
    for (int axis = 0; axis < 3; axis++) {
        bool negative = f->direction[axis] < 0.0f;
        float toward = negative ? -f->slack : f->slack;
        n->near_origin[axis] = wide_set(f->origin[axis] + toward);
        n->far_origin[axis] = wide_set(f->origin[axis] - toward);
        n->inverse[axis] = wide_set(f->inverse[axis]);
        n->near_row[axis] = negative ? 3 + axis : axis;
        n->far_row[axis] = negative ? axis : 3 + axis;
    }
    n->t_max = local_t_max(f, t_max);
}

/* Which of a node's children the ray meets, one bit each, and where. */
static inline unsigned meet(const near *n, const pl_front_node *node, float entry[PL_FRONT_WIDTH])
{
    wide enter = wide_set(0.0f), leave = wide_set(n->t_max);
    for (int axis = 0; axis < 3; axis++) {
        wide near_plane = wide_load(node->planes[n->near_row[axis]]);
        wide far_plane = wide_load(node->planes[n->far_row[axis]]);
        enter = wide_max(wide_multiply(wide_subtract(near_plane, n->near_origin[axis]), n->inverse[axis]), enter);
        leave = wide_min(wide_multiply(wide_subtract(far_plane, n->far_origin[axis]), n->inverse[axis]), leave);
    }
    wide_store(entry, enter);
    return wide_at_most(enter, leave);
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
    pl_affine_point(&it->to_object, parent->o, f->o);
    pl_affine_vector(&it->to_object, parent->d, f->d);
    double distance = __builtin_sqrt(parent->o[0] * parent->o[0] + parent->o[1] * parent->o[1] + parent->o[2] * parent->o[2]);
    f->error = (double)it->stretch * parent->error +
               DBL_EPSILON * ((double)it->gain * (2.0 * distance + front->reach.size) + (double)it->base);
    f->instance = instance;
    f->depth = parent->depth + it->depth;
    f->first = pl_add_saturating(parent->first, front->opened[it->opened].first);
    const pl_item *item = &tracer->scene->states.list[front->opened[it->opened].state].items[it->item & ~PL_NO_SHADOW];
    f->first = pl_add_saturating(f->first, item->first);
    tracer->counters.instances++;
    if (pl_frame_begin(f, query->t_min, query->t_max)) return 1;
    return f->front->unbounded_count ? 2 : 0;
}

/* Pushes what a frame begins with. */
static inline bool begin(pl_bvh_work *w, const pl_front *front, bool met, size_t *top, pl_error *error)
{
    for (uint32_t i = 0; i < front->unbounded_count; i++) {
        if (*top + 16 > w->stack_capacity && !pl_bvh_grow_stack(w, *top, error)) return false;
        w->stack[(*top)++] = entry_of(0.0f, front->unbounded[i]);
    }
    if (*top + 16 > w->stack_capacity && !pl_bvh_grow_stack(w, *top, error)) return false;
    if (met) w->stack[(*top)++] = entry_of(0.0f, front->root);
    return true;
}

static inline bool visit(pl_tracer *tracer, pl_query *query, bool any)
{
    pl_bvh_work *w = tracer->work;
    uint64_t *stack = w->stack;
    uint32_t frame = 0;
    const pl_frame *f = &w->frames[0];
    size_t top = 0;
    near n;
    uint64_t boxes = 0;
    float entry[PL_FRONT_WIDTH];
    bool met = pl_frame_begin(&w->frames[0], query->t_min, query->t_max);
    w->frames[0].mapped = true;
    if (!begin(w, f->front, met, &top, query->error)) return false;
    stack = w->stack;
    look(&n, f, query->t_max);
    for (uint64_t steps = 0; top > 0; steps++) {
        if (steps > PL_LIMIT_RAY_STEPS) return pl_query_fail_steps(query, PL_LIMIT_RAY_STEPS);
        uint64_t at = stack[--top];
        pl_ref ref = (pl_ref)at;
        if (entry_t(at) > n.t_max) continue;
    again:;
        uint32_t kind = ref >> PL_REF_SHIFT;
        if (kind == PL_KIND_NODE) {
            const pl_front_node *node = &f->front->nodes[ref];
            unsigned mask = meet(&n, node, entry);
            boxes += PL_FRONT_WIDTH;
            if (mask != 0xFF && f->depth > tracer->counters.miss_depth) tracer->counters.miss_depth = f->depth;
            if (mask == 0) continue;
            int i = __builtin_ctz(mask);
            mask &= mask - 1;
            if (mask == 0) {
                ref = node->child[i];
                goto again;
            }
            if (top + 16 > w->stack_capacity) {
                if (!pl_bvh_grow_stack(w, top, query->error)) return false;
                stack = w->stack;
            }
            size_t bottom = top;
            stack[top++] = entry_of(entry[i], node->child[i]);
            do {
                i = __builtin_ctz(mask);
                mask &= mask - 1;
                uint64_t fresh = entry_of(entry[i], node->child[i]);
                size_t place = top++;
                for (; place > bottom && stack[place - 1] < fresh; place--) stack[place] = stack[place - 1];
                stack[place] = fresh;
            } while (mask);
            ref = (pl_ref)stack[--top];
            goto again;
        }
        if (kind == PL_KIND_RETURN) {
            f = &w->frames[--frame];
            look(&n, f, query->t_max);
            continue;
        }
        if (kind == PL_KIND_INSTANCE) {
            int entered = descend(tracer, frame, ref & PL_REF_INDEX, query);
            if (entered < 0) return false;
            if (!entered) continue;
            f = &w->frames[++frame];
            stack[top++] = entry_of(0.0f, pl_ref_of(PL_KIND_RETURN, 0));
            if (!begin(w, f->front, entered == 1, &top, query->error)) return false;
            stack = w->stack;
            look(&n, f, query->t_max);
            continue;
        }
        const pl_front_primitive *p = &f->front->primitives[ref & PL_REF_INDEX];
        if (query->shadow && p->item & PL_NO_SHADOW) continue;
        tracer->counters.filtered++;
        enum kernel_verdict verdict = filter(p, kind, f, n.t_max, any);
        if (verdict == MISS) continue;
        if (any && verdict == CERTAIN) {
            query->found = query->done = true;
            break;
        }
        if (!pl_bvh_candidate(tracer, frame, ref, query)) return false;
        if (query->done) break;
        n.t_max = local_t_max(f, query->t_max);
    }
    tracer->counters.box_tests += boxes;
    return true;
}

bool KERNEL(pl_tracer *tracer, const pl_ray *ray, pl_query *query)
{
    pl_bvh_work *w = tracer->work;
    const pl_fronts *fronts = tracer->scene->structure;
    pl_frame *root = &w->frames[0];
    root->front = &fronts->list[0];
    memcpy(root->o, ray->origin, sizeof root->o);
    memcpy(root->d, ray->direction, sizeof root->d);
    memcpy(root->normative_o, ray->origin, sizeof root->o);
    memcpy(root->normative_d, ray->direction, sizeof root->d);
    root->error = 0.0;
    root->first = 0;
    root->depth = root->instance = 0;
    return query->kind == PL_QUERY_ANY ? visit(tracer, query, true) : visit(tracer, query, false);
}
