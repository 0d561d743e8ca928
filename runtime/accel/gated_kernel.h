/* gated_kernel.h - the traversal of fronts with gates (gated.h): kernel.h's, whose pieces it uses and which stands before it in
 * each kernel_*.c, with a gate at every instance. GATED_KERNEL: the name of the function. */
#include "gated.h"

/* Whether a gate so large is open wherever on the ray it is met up to `to`, whatever the path. */
static inline bool is_clearly_open(double size, const pl_footprint *footprint, double to)
{
    return size * (1.0 - 0x1p-20) > footprint->width + footprint->spread * to;
}

/* Whether it is cut wherever it is entered from `from` on, unless it is missed. */
static inline bool is_clearly_cut(double size, const pl_footprint *footprint, double from)
{
    return size * (1.0 + 0x1p-20) < footprint->width + footprint->spread * from;
}

/* Bounds of the ray's t where it enters and leaves the box of a frame that has begun. */
typedef struct passage {
    double from, to;
} passage;

static inline passage passage_of(const pl_frame *f)
{
    if (f->blind) return (passage){-INFINITY, INFINITY};
    const float4 inverse = *(const float4 *)f->inverse, middle = *(const float4 *)f->origin * inverse;
    const float4 reach = (*(const float4 *)f->front->half + f->slack) * absolute(inverse);
    const float4 ends = least_of(reach + middle, reach - middle);
    const double enter = -(double)ends[0], leave = (double)ends[1];
    const double over = 1.0 / f->rate;
    return (passage){f->t0 + (enter > 0.0 ? enter : 0.0) * (1.0 - 0x1p-16) * over,
                     f->t0 + (leave > 0.0 ? leave : 0.0) * (1.0 + 0x1p-16) * over};
}

/* The largest rung that has no closed gates inside, from `rung` on. */
static inline const pl_gated_rung *choose_rung(const pl_gated_rung *rung, uint32_t count, const pl_gated_frame *f,
                                               const pl_footprint *footprint)
{
    for (; count > 1; count--, rung++)
        if (is_clearly_open(rung->least * f->stretch, footprint, f->to) && f->at.distance < rung->farthest) break;
    return rung;
}

/* Where the first rung may not be taken at once: another, or NULL where the instance isn't gone into. false: an error. */
static __attribute__((noinline)) bool pass_gate(pl_tracer *tracer, uint32_t index, const pl_gated_state *state,
                                                pl_query *query, const pl_gated_rung **rung)
{
    const pl_gated *gated = tracer->scene->structure;
    pl_gated_work *w = tracer->work;
    pl_gated_frame *f = &w->frames[index + 1];
    const passage through = passage_of(&f->at);
    const double size = state->diameter * f->stretch;
    *rung = NULL;
    if (through.to < f->to) f->to = through.to;
    if (!state->unbounded &&
        !(is_clearly_open(size, &query->footprint, f->to) && f->at.distance < state->farthest)) {
        wide_end();
        int open = pl_gated_arrive(tracer, index, f->at.instance,
                                   is_clearly_cut(size, &query->footprint, through.from), query);
        if (open <= 0) return open == 0;
    }
    *rung = choose_rung(&gated->rungs[state->first], state->count, f, &query->footprint);
    return true;
}

/* The path goes on into an instance: frame `index` + 1 as far as it is the same for all rays. */
static inline const pl_gated_state *gated_step(pl_gated_work *w, const pl_gated *gated, uint32_t index, uint32_t instance)
{
    const pl_gated_frame *parent = &w->frames[index];
    const pl_front_instance *it = &parent->at.front->instances[instance];
    const pl_gated_link *link = &parent->rung->links[instance];
    const pl_gated_state *state = &gated->states[it->front & ~PL_NO_SHADOW];
    pl_gated_frame *f = &w->frames[index + 1];
    f->rung = &gated->rungs[state->first];
    f->stretch = parent->stretch * link->stretch;
    f->to = parent->to;
    f->serial = ++w->serial;
    f->hash = parent->hash * link->power + link->hash;
    f->depth = parent->depth + link->depth;
    f->at.front = &f->rung->front;
    f->at.instance = instance;
    return state;
}

/* The gate of an instance whose frame `index` + 1 has begun: the rung to go on with becomes the frame's. *open: whether it is
 * gone into. false: an error. */
static inline __attribute__((always_inline)) bool gated_enter(pl_tracer *tracer, uint32_t index, const pl_gated_state *state,
                                                              pl_query *query, bool *open)
{
    pl_gated_frame *f = &((pl_gated_work *)tracer->work)->frames[index + 1];
    *open = true;
    if (is_clearly_open(state->least * f->stretch, &query->footprint, f->to) && f->at.distance < state->farthest_inside)
        return true;
    const pl_gated_rung *rung;
    if (!pass_gate(tracer, index, state, query, &rung)) return false;
    *open = rung != NULL;
    if (!rung) return true;
    f->rung = rung;
    f->at.front = &rung->front;
    return true;
}

/* Goes into an instance: frame `index` + 1. 0: it isn't gone into, 1: it is, 2: only what is unbounded, -1: an error. */
static inline int gated_descend(pl_tracer *tracer, uint32_t index, uint32_t instance, pl_query *query, float *local_max)
{
    pl_gated_work *w = tracer->work;
    if (index + 1 >= w->frame_capacity && !pl_gated_grow_frames(w, index + 1, query->error)) return -1;
    const pl_frame *parent = &w->frames[index].at;
    const pl_front_instance *it = &parent->front->instances[instance];
    if (query->shadow && it->front & PL_NO_SHADOW) return 0;
    const pl_gated_state *state = gated_step(w, tracer->scene->structure, index, instance);
    pl_frame *f = &w->frames[index + 1].at;
    double4 o, d;
    bool open;
    map_into(it, parent, f, &o, &d);
    /* Not local_t_max: whether f is blind isn't known yet. */
    if (parent->blind) *local_max = t_between(f->t0, query->t_max, f->rate);
    tracer->counters.instances++;
    const bool met = begin_frame(f, o, d, query->t_max, local_max);
    if (!met && !state->unbounded) return 0;
    if (!gated_enter(tracer, index, state, query, &open)) return -1;
    return !open ? 0 : met ? 1 : 2;
}

/* Pushes what a frame begins with, below it the way back. */
static inline bool gated_begin(pl_gated_work *w, const pl_front *front, bool met, size_t *top, pl_error *error)
{
    w->stack[(*top)++] = entry_of(0.0f, pl_ref_of(PL_KIND_RETURN, 0));
    for (uint32_t i = 0; i < front->unbounded_count; i++) {
        if (*top + 16 > w->stack_capacity && !pl_gated_grow_stack(w, *top, error)) return false;
        w->stack[(*top)++] = entry_of(0.0f, front->unbounded[i]);
    }
    if (*top + 16 > w->stack_capacity && !pl_gated_grow_stack(w, *top, error)) return false;
    if (met) w->stack[(*top)++] = entry_of(0.0f, front->root);
    return true;
}

/* From frame `base` on. met: its box; else only what is unbounded there counts. */
static inline bool gated_visit(pl_tracer *tracer, uint32_t base, pl_query *query, bool met, bool any)
{
    pl_gated_work *w = tracer->work;
    uint64_t *stack, steps = 0;
    uint32_t frame = base;
    const pl_gated_frame *f = &w->frames[base];
    size_t top = 0;
    float t_max;
    if (!gated_begin(w, f->at.front, met, &top, query->error)) return false;
    stack = w->stack;
    t_max = local_t_max(&f->at, query->t_max);
    for (;;) {
        uint64_t at = stack[--top];
        pl_ref ref = (pl_ref)at;
        if (entry_is_beyond(at, t_max)) continue;
        while (ref >> PL_REF_SHIFT == PL_KIND_NODE) {
            unsigned count = meet_nearest(&f->at, t_max, &f->at.front->nodes[ref], stack + top, &ref);
            steps++;
            if (count == 0) goto next;
            top += count - 1;
            if (top + 16 > w->stack_capacity) {
                if (!pl_gated_grow_stack(w, top, query->error)) return false;
                stack = w->stack;
            }
        }
        uint32_t kind = ref >> PL_REF_SHIFT;
        if (kind == PL_KIND_RETURN) {
            if (frame == base) break;
            f = &w->frames[--frame];
            t_max = local_t_max(&f->at, query->t_max);
        } else if (kind == PL_KIND_INSTANCE) {
            float inner = t_max;
            int entered = gated_descend(tracer, frame, ref & PL_REF_INDEX, query, &inner);
            if (entered < 0) return false;
            if (query->done) break;
            if (entered) frame++;
            f = &w->frames[frame]; /* which may have moved */
            if (!entered) {
                t_max = local_t_max(&f->at, query->t_max); /* a box may have been drawn */
                continue;
            }
            t_max = inner;
            if (!gated_begin(w, f->at.front, entered == 1, &top, query->error)) return false;
            stack = w->stack;
            if (++steps > PL_LIMIT_RAY_STEPS) return pl_query_fail_steps(query, PL_LIMIT_RAY_STEPS);
        } else {
            const pl_front_primitive *p = &f->at.front->primitives[ref & PL_REF_INDEX];
            if (query->shadow && p->item & PL_NO_SHADOW) continue;
            tracer->counters.filtered++;
            enum kernel_verdict verdict = filter(p, kind, &f->at, t_max, any);
            if (verdict == MISS) continue;
            if (any && verdict == CERTAIN) {
                query->found = query->done = true;
                break;
            }
            wide_end();
            if (!pl_gated_candidate(tracer, frame, ref, query)) return false;
            if (query->done) break;
            t_max = local_t_max(&f->at, query->t_max);
            if (++steps > PL_LIMIT_RAY_STEPS) return pl_query_fail_steps(query, PL_LIMIT_RAY_STEPS);
        }
    next:;
    }
    tracer->counters.box_tests += steps * PL_FRONT_WIDTH;
    return true;
}

bool GATED_KERNEL(pl_tracer *tracer, const pl_ray *ray, pl_query *query)
{
    pl_gated_work *w = tracer->work;
    const pl_gated *gated = tracer->scene->structure;
    const pl_gated_state *state = &gated->states[0];
    pl_gated_frame *root = &w->frames[0];
    const pl_front *front = &gated->rungs[state->first].front;
    const double4 origin = {ray->origin[0], ray->origin[1], ray->origin[2]};
    const double4 direction = {ray->direction[0], ray->direction[1], ray->direction[2]};
    const double4 from = (origin - *(const double4 *)front->centre) * front->scale, d = direction * front->scale;
    float local_max = 1e30f;
    root->rung = &gated->rungs[state->first];
    root->stretch = 1.0;
    root->hash = 0;
    root->depth = 0;
    root->at.front = front;
    root->at.error = 0.0f;
    root->at.distance = (float)__builtin_fabs(from[0]) + (float)__builtin_fabs(from[1]) + (float)__builtin_fabs(from[2]);
    root->at.distance *= 1.0f + 0x1p-20f;
    root->at.t0 = query->t_min;
    root->at.rate = 1.0;
    root->at.instance = 0;
    const bool met = begin_frame(&root->at, from + query->t_min * d, d, query->t_max, &local_max);
    if (!met && !state->unbounded) {
        wide_end();
        return true;
    }
    root->to = met ? passage_of(&root->at).to : INFINITY;
    root->rung = choose_rung(root->rung, state->count, root, &query->footprint);
    root->at.front = &root->rung->front;
    root->serial = ++w->serial;
    w->lane = 0;
    pl_gated_begin(w, ray, query->t_min);
    const bool ok = query->kind == PL_QUERY_ANY ? gated_visit(tracer, 0, query, met, true)
                                                : gated_visit(tracer, 0, query, met, false);
    wide_end();
    return ok;
}
