/* kernel_alone.h - rays that leave a packet (kernel_packet.h) and go on one by one.
 *
 *     visit_one_by_one(tracer, frame, lanes, course, queries, t_max, any)    → the queries of these lanes are answered
 *
 * They take along what the packet told of them: the ray in the frame's unit frame, whether it meets the front's box, and at
 * the first candidate its normative ray, which is mapped together with those of others that leave. */

/* How the rays of a packet go on in a frame. ONE_BY_ONE: from the frame's box on; APART: each from the beginning, as it can't be
 * told in single precision yet. */
enum course { ASTRAY, TOGETHER, ONE_BY_ONE, APART };

/* The normative ray of a lane that goes on alone, when it has a candidate: mapped with those of others that do. */
static bool map_alone(pl_tracer *tracer, pl_error *error)
{
    pl_bvh_work *w = tracer->work;
    const int lane = __builtin_ctz(w->alone);
    pl_frame *f = &w->lanes->frames[w->alone_from];
    const pl_packet_frame *from = &w->packets[w->alone_from];
    if (!map_packet(tracer->scene, w, w->alone_from, quads_of(w->alone) & ~from->mapped, error)) return false;
    f->mapped = true;
    for (int axis = 0; axis < 3; axis++) {
        f->normative_o[axis] = from->normative.o[axis][lane];
        f->normative_d[axis] = from->normative.d[axis][lane];
    }
    w->alone = 0;
    return true;
}

/* Begins a single ray's frame with a lane of a packet's that meets the box. */
static inline void begin_alone(pl_frame *f, const pl_packet_frame *from, int lane)
{
    float4 o = {0}, d = {0}, inverse = {0};
    for (int axis = 0; axis < 3; axis++) {
        f->o[axis] = from->o[axis][lane];
        f->d[axis] = from->d[axis][lane];
        o[axis] = from->origin[axis][lane];
        d[axis] = from->direction[axis][lane];
        inverse[axis] = from->inverse[axis][lane];
    }
    f->slack = from->slack;
    f->mapped = f->blind = false;
    set_ray(f, o, d, inverse);
}

/* The same, as the ray comes to the frame. false: nothing is met. */
static bool begin_apart(pl_frame *f, const pl_packet_frame *from, int lane, double t_max, bool *met)
{
    const double4 o = {from->o[0][lane], from->o[1][lane], from->o[2][lane]};
    const double4 d = {from->d[0][lane], from->d[1][lane], from->d[2][lane]};
    f->blind = false;
    float local_max = local_t_max(f, t_max);
    *met = begin_frame(f, o, d, t_max, &local_max);
    return *met || f->front->unbounded_count;
}

/* The rays of some lanes one by one through what lies below frame `index` of the packet; course: APART or ONE_BY_ONE. */
static bool visit_one_by_one(pl_tracer *tracer, uint32_t index, unsigned lanes, enum course course, pl_query *queries, double *t_max,
                             bool any)
{
    pl_bvh_work *w = tracer->work;
    const pl_packet_frame *from = &w->packets[index];
    for (; lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        pl_frame *f = &w->lanes->frames[index];
        bool met = true;
        f->front = from->front;
        f->error = from->error;
        f->distance = from->distance;
        f->t0 = from->t0;
        f->rate = from->rate;
        if (course == ONE_BY_ONE) begin_alone(f, from, lane);
        else if (!begin_apart(f, from, lane, t_max[lane], &met)) continue;
        w->alone = lanes;
        w->alone_from = index;
        walk k;
        const bool ok = set_off(&k, w->lanes, &queries[lane], index, met) &&
                        (any ? visit(tracer, &k, true) : visit(tracer, &k, false));
        w->alone = 0;
        if (!ok) return false;
        w->answers += queries[lane].done || queries[lane].t_max != t_max[lane];
        t_max[lane] = queries[lane].t_max;
    }
    return true;
}
