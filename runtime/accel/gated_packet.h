/* gated_packet.h - the traversal of fronts with gates by packets of rays that go about the same way: kernel_packet.h's, whose
 * pieces it uses and which stands before it in kernel_avx2.c, with a gate at every instance. GATED_PACKET: the name of the
 * function.
 *
 * All rays of a packet have their path in common, and with it the stretch of a gate. Far above the cut-off the gate is open
 * wherever any of them comes to it, which one comparison tells. Elsewhere each ray's gate is decided as if it were alone
 * (pl_gated_arrive), and those that find it open go on together. Candidates are evaluated ray by ray. So a packet can't show
 * in a hit. */

/* The rays of a packet. */
typedef struct gated_crowd {
    pl_query *queries;
    double t_max[PL_LANES];
    pl_footprint largest, smallest; /* of all */
    bool any;
} gated_crowd;

/* The queries of some lanes were answered, perhaps. */
static inline void gated_note(pl_bvh_work *b, gated_crowd *c, unsigned lane)
{
    b->answers += c->queries[lane].done || c->queries[lane].t_max != c->t_max[lane];
    c->t_max[lane] = c->queries[lane].t_max;
}

/* Bounds of the t where the first of a frame's rays enters its box, and where the last one leaves it. */
static passage packet_passage(const pl_packet_frame *f)
{
    wide least = wide_set(INFINITY), most = wide_set(0.0f);
    for (int first = 0; first < PL_LANES; first += HALF) {
        wide enter = wide_set(0.0f), leave = wide_set(INFINITY);
        const wide in = wide_lanes(f->lanes >> first & 0xFF);
#pragma GCC unroll 3
        for (int axis = 0; axis < 3; axis++) {
            const wide inverse = wide_load(f->inverse[axis] + first), middle = wide_load(f->origin[axis] + first) * inverse;
            const wide reach = wide_set(f->front->half[axis] + f->slack) * wide_absolute(inverse);
            enter = wide_max(-middle - reach, enter);
            leave = wide_min(reach - middle, leave);
        }
        least = wide_min(_mm256_blendv_ps(wide_set(INFINITY), enter, in), least);
        most = wide_max(wide_and(leave, in), most);
    }
    const double over = 1.0 / f->rate;
    return (passage){f->t0 + (double)wide_least(least) * (1.0 - 0x1p-16) * over,
                     f->t0 + (double)wide_most(most) * (1.0 + 0x1p-16) * over};
}

/* The rays of some lanes one by one through frame `index` > 0 and what lies below. passed: its gate is open, and the rung chosen. */
static bool gated_one_by_one(pl_tracer *tracer, uint32_t index, unsigned lanes, enum course course, bool passed, gated_crowd *c)
{
    pl_gated_work *w = tracer->work;
    const pl_gated *gated = tracer->scene->structure;
    const pl_gated_state *state = &gated->states[w->frames[index].at.front->state];
    const pl_gated_rung *rung = passed ? w->frames[index].rung : &gated->rungs[state->first];
    const double to = passed ? w->frames[index].to : w->frames[index - 1].to;
    for (; lanes; lanes &= lanes - 1) {
        const pl_packet_frame *from = &w->packets->packets[index];
        pl_gated_frame *f = &w->frames[index]; /* which may have moved */
        pl_query *query = &c->queries[w->lane = (unsigned)__builtin_ctz(lanes)];
        bool met = true, open = true;
        f->rung = rung;
        f->to = to;
        f->at.front = &rung->front;
        f->at.error = from->error;
        f->at.distance = from->distance;
        f->at.t0 = from->t0;
        f->at.rate = from->rate;
        if (course == ONE_BY_ONE) begin_alone(&f->at, from, (int)w->lane);
        else if (!begin_apart(&f->at, from, (int)w->lane, query->t_max, &met) && !state->unbounded) continue;
        if (!passed && !gated_enter(tracer, index - 1, state, query, &open)) return false;
        if (open && !query->done &&
            !(c->any ? gated_visit(tracer, index, query, met, true) : gated_visit(tracer, index, query, met, false)))
            return false;
        gated_note(w->packets, c, w->lane);
    }
    return true;
}

/* A ray by itself from frame `index` into an instance, and through what lies below. */
static bool gated_lone(pl_tracer *tracer, uint32_t index, uint32_t instance, gated_crowd *c)
{
    pl_gated_work *w = tracer->work;
    const pl_packet_frame *from = &w->packets->packets[index];
    const unsigned lane = w->lane;
    pl_frame *f = &w->frames[index].at;
    pl_query *query = &c->queries[lane];
    for (int axis = 0; axis < 3; axis++) {
        f->o[axis] = from->o[axis][lane];
        f->d[axis] = from->d[axis][lane];
    }
    f->error = from->error;
    f->distance = from->distance;
    f->t0 = from->t0;
    f->rate = from->rate;
    f->blind = false;
    float t_max = from->t_max[lane];
    const int entered = gated_descend(tracer, index, instance, query, &t_max);
    if (entered < 0) return false;
    if (entered > 0 && !(c->any ? gated_visit(tracer, index + 1, query, entered == 1, true)
                                : gated_visit(tracer, index + 1, query, entered == 1, false)))
        return false;
    gated_note(w->packets, c, lane);
    return true;
}

/* The gate of frame `index`, decided for each of its lanes: *lanes become those that find it open. */
static __attribute__((noinline)) bool gated_arrive_lanes(pl_tracer *tracer, uint32_t index, bool cut, gated_crowd *c, unsigned *lanes)
{
    pl_gated_work *w = tracer->work;
    unsigned open = 0;
    wide_end();
    for (unsigned rest = *lanes; rest; rest &= rest - 1) {
        w->lane = (unsigned)__builtin_ctz(rest);
        pl_query *query = &c->queries[w->lane];
        const int result = pl_gated_arrive(tracer, index - 1, w->frames[index].at.instance, cut, query);
        if (result < 0) return false;
        open |= (unsigned)(result > 0) << w->lane;
        gated_note(w->packets, c, w->lane);
    }
    *lanes = open;
    return true;
}

/* The gate of frame `index`, which its lanes have begun together: those that it is open for are left. false: an error. */
static inline bool gated_pass(pl_tracer *tracer, uint32_t index, const pl_gated_state *state, gated_crowd *c)
{
    pl_gated_work *w = tracer->work;
    const pl_gated *gated = tracer->scene->structure;
    pl_packet_frame *f = &w->packets->packets[index];
    pl_gated_frame *path = &w->frames[index];
    path->at.distance = f->distance;
    if (is_clearly_open(state->least * path->stretch, &c->largest, path->to) && f->distance < state->farthest_inside)
        return true;
    const passage through = packet_passage(f);
    const double size = state->diameter * path->stretch;
    if (through.to < path->to) path->to = through.to;
    if (!(is_clearly_open(size, &c->largest, path->to) && f->distance < state->farthest) &&
        !gated_arrive_lanes(tracer, index, is_clearly_cut(size, &c->smallest, through.from), c, &f->lanes))
        return false;
    path->rung = choose_rung(&gated->rungs[state->first], state->count, path, &c->largest);
    path->at.front = f->front = &path->rung->front;
    return true;
}

/* Some lanes go into an instance; false in *goes_on: nothing is left to be done in frame `index` + 1. */
static inline bool gated_descend_lanes(pl_tracer *tracer, uint32_t index, uint32_t instance, unsigned lanes, gated_crowd *c,
                                       bool *goes_on)
{
    pl_gated_work *w = tracer->work;
    *goes_on = false;
    if (!(lanes & (lanes - 1))) {
        w->lane = (unsigned)__builtin_ctz(lanes);
        return gated_lone(tracer, index, instance, c);
    }
    if (index + 1 >= w->frame_capacity && !pl_gated_grow_frames(w, index + 1, c->queries->error)) return false;
    if (!pl_bvh_grow_packets(w->packets, index + 1, c->queries->error)) return false;
    const pl_packet_frame *parent = &w->packets->packets[index];
    const pl_gated_state *state = gated_step(w, tracer->scene->structure, index, instance);
    pl_packet_frame *f = &w->packets->packets[index + 1];
    f->front = w->frames[index + 1].at.front;
    f->instance = instance;
    f->each = true;
    tracer->counters.instances++;
    descend_lanes(f, parent, &parent->front->instances[instance], lanes);
    if (state->unbounded) return gated_one_by_one(tracer, index + 1, lanes, APART, false, c);
    f->answers = w->packets->answers;
    const enum course course = begin_lanes(f, lanes, c->t_max);
    if (course == ASTRAY) return true;
    if (course != TOGETHER) return gated_one_by_one(tracer, index + 1, f->lanes, course, false, c);
    if (!gated_pass(tracer, index + 1, state, c)) return false;
    if (c->any) f->lanes = lanes_left(c->queries, f->lanes);
    if (__builtin_popcount(f->lanes) <= FEW) return gated_one_by_one(tracer, index + 1, f->lanes, ONE_BY_ONE, true, c);
    if (f->answers != w->packets->answers) set_t_max(f, c->t_max);
    f->answers = w->packets->answers;
    look_at_each(f);
    *goes_on = true;
    return true;
}

/* A primitive is evaluated for some lanes. */
static bool gated_offer(pl_tracer *tracer, uint32_t index, pl_ref ref, unsigned lanes, gated_crowd *c)
{
    pl_gated_work *w = tracer->work;
    wide_end();
    for (; lanes; lanes &= lanes - 1) {
        w->lane = (unsigned)__builtin_ctz(lanes);
        if (!pl_gated_candidate(tracer, index, ref, &c->queries[w->lane])) return false;
        gated_note(w->packets, c, w->lane);
    }
    return true;
}

/* What a primitive means for some lanes of frame `index`. */
static inline bool gated_meet_primitive(pl_tracer *tracer, uint32_t index, pl_ref ref, unsigned some, gated_crowd *c)
{
    pl_bvh_work *b = ((pl_gated_work *)tracer->work)->packets;
    pl_packet_frame *f = &b->packets[index];
    const pl_front_primitive *p = &f->front->primitives[ref & PL_REF_INDEX];
    if (c->queries->shadow && p->item & PL_NO_SHADOW) return true;
    unsigned certain = 0;
    const unsigned found = filter_lanes(p, ref >> PL_REF_SHIFT, f, some, c->any ? &certain : NULL);
    tracer->counters.filtered++;
    if (!found) return true;
    for (unsigned rest = certain; rest; rest &= rest - 1) {
        pl_query *query = &c->queries[__builtin_ctz(rest)];
        query->found = query->done = true;
    }
    b->answers += certain != 0;
    if (!gated_offer(tracer, index, ref, found & ~certain, c)) return false;
    if (f->each) go_on_each(f, b, found, c->queries, c->t_max, c->any);
    else go_on(f, b, c->queries, c->t_max, c->any);
    return true;
}

/* From frame 0 on, which has begun. */
static inline bool gated_visit_packet(pl_tracer *tracer, gated_crowd *c)
{
    pl_bvh_work *b = ((pl_gated_work *)tracer->work)->packets;
    pl_packet_frame *f = b->packets;
    packet_way way = way_of(b);
    uint32_t index = 0;
    push_front(&way, f->front);
    for (;;) {
        pl_ref ref;
        unsigned some;
        if (!go_through_nodes(&way, b, f, c->any, &ref, &some, c->queries->error)) return false;
        const uint32_t kind = ref >> PL_REF_SHIFT;
        if (kind == PL_KIND_RETURN) {
            if (index == 0) break;
            f = &b->packets[--index];
            go_on(f, b, c->queries, c->t_max, c->any);
            continue;
        }
        if (kind == PL_KIND_INSTANCE) {
            bool goes_on;
            if (c->queries->shadow && f->front->instances[ref & PL_REF_INDEX].front & PL_NO_SHADOW) continue;
            if (!gated_descend_lanes(tracer, index, ref & PL_REF_INDEX, some, c, &goes_on)) return false;
            f = &b->packets[index]; /* which may have moved */
            if (goes_on) {
                f = &b->packets[++index];
                push_front(&way, f->front);
            } else {
                go_on(f, b, c->queries, c->t_max, c->any);
            }
        } else if (!gated_meet_primitive(tracer, index, ref, some, c)) {
            return false;
        }
        if (++way.steps > PL_LIMIT_RAY_STEPS) return pl_query_fail_steps(c->queries, PL_LIMIT_RAY_STEPS);
    }
    tracer->counters.box_tests += way.steps * PL_FRONT_WIDTH;
    return true;
}

/* A packet in the scene's front. *alone: its rays are to be traced one by one, nothing is done yet. */
static bool gated_trace_packet(pl_tracer *tracer, const pl_ray *rays, unsigned lanes, gated_crowd *c, bool *alone)
{
    pl_gated_work *w = tracer->work;
    const pl_gated *gated = tracer->scene->structure;
    const pl_gated_state *state = &gated->states[0];
    pl_packet_frame *f = w->packets->packets;
    pl_gated_frame *root = w->frames;
    f->answers = w->packets->answers;
    const enum course course = begin_lanes(f, lanes, c->t_max);
    *alone = course > TOGETHER;
    if (*alone) return true;
    root->stretch = 1.0;
    root->hash = 0;
    root->depth = 0;
    root->serial = ++w->serial;
    root->to = course == TOGETHER ? packet_passage(f).to : INFINITY;
    root->at.distance = f->distance;
    root->rung = choose_rung(&gated->rungs[state->first], state->count, root, &c->largest);
    root->at.front = f->front = &root->rung->front;
    for (uint32_t i = 0; i < f->front->unbounded_count; i++)
        if (f->front->unbounded[i] >> PL_REF_SHIFT == PL_KIND_INSTANCE) return *alone = true;
    for (unsigned rest = lanes; rest; rest &= rest - 1) {
        w->lane = (unsigned)__builtin_ctz(rest);
        pl_gated_begin(w, &rays[w->lane], c->queries[w->lane].t_min);
    }
    for (uint32_t i = 0; i < f->front->unbounded_count; i++)
        if (!gated_offer(tracer, 0, f->front->unbounded[i], c->any ? lanes_left(c->queries, lanes) : lanes, c)) return false;
    if (c->any) f->lanes = lanes_left(c->queries, f->lanes);
    if (course == ASTRAY || !f->lanes) return true;
    set_t_max(f, c->t_max);
    f->each = !look_along(f);
    if (f->each) look_at_each(f);
    return gated_visit_packet(tracer, c);
}

/* The largest footprint of all rays, and the smallest one. */
static void gated_footprints(gated_crowd *c, unsigned count)
{
    c->largest = c->smallest = c->queries->footprint;
    for (unsigned i = 1; i < count; i++) {
        const pl_footprint *one = &c->queries[i].footprint;
        if (one->width > c->largest.width) c->largest.width = one->width;
        if (one->spread > c->largest.spread) c->largest.spread = one->spread;
        if (one->width < c->smallest.width) c->smallest.width = one->width;
        if (one->spread < c->smallest.spread) c->smallest.spread = one->spread;
    }
}

/* Rays that go different ways are traced one by one. */
bool GATED_PACKET(pl_tracer *tracer, const pl_ray *rays, pl_query *queries, unsigned count)
{
    pl_gated_work *w = tracer->work;
    pl_bvh_work *b = w->packets;
    const pl_gated *gated = tracer->scene->structure;
    const pl_front *front = &gated->rungs[gated->states[0].first].front;
    gated_crowd c = {.queries = queries, .any = queries->kind == PL_QUERY_ANY};
    bool ok = true, alone = true;
    if (!pl_bvh_grow_packets(b, 0, queries->error) || !pl_bvh_grow_packet_stack(b, 0, queries->error)) return false;
    if (make_packet(b->packets, front, rays, queries, count, c.t_max)) {
        gated_footprints(&c, count);
        ok = gated_trace_packet(tracer, rays, UINT32_MAX >> (32 - count), &c, &alone);
    }
    for (unsigned i = 0; alone && ok && i < count; i++) ok = GATED_KERNEL(tracer, &rays[i], &queries[i]);
    wide_end();
    return ok;
}
