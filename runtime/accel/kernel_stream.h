/* kernel_stream.h - rays that go different ways, a step of each in turn (part of the kernels; kernel.h has the steps).
 *
 * Nobody can foretell what a ray meets next, and a processor that guesses wrong begins again. So each round takes the
 * next entry of every ray and does all nodes one after another without a guess, then the rest; and no ray waits for
 * its own last step. Each ray's steps are those that it takes alone, so streams can't show in hits. */

/* The rays under way, going[0 … left), and which of them come to a node in this round, or to something else. */
typedef struct crowd {
    walk walks[PL_LANES], *going[PL_LANES], *at_node[PL_LANES];
    unsigned at_other[PL_LANES]; /* places in `going` */
    unsigned left, nodes, others;
    uint64_t steps; /* of all */
} crowd;

/* Takes the next entry of each ray, which stays above the top of its stack. */
static inline void sort_out(crowd *c)
{
    unsigned nodes = 0, others = 0;
    for (unsigned i = 0; i < c->left; i++) {
        walk *k = c->going[i];
        const uint64_t at = k->stack[--k->top];
        const bool near = !entry_is_beyond(at, k->t_max), node = (pl_ref)at >> PL_REF_SHIFT == PL_KIND_NODE;
        c->at_node[nodes] = k;
        c->at_other[others] = i;
        nodes += near & node;
        others += near & !node;
    }
    c->nodes = nodes;
    c->others = others;
}

static inline pl_ref next_of(const walk *k)
{
    return (pl_ref)k->stack[k->top];
}

/* One step of each ray. false: an error. */
static inline bool make_round(pl_tracer *tracer, crowd *c, bool any)
{
    sort_out(c);
    for (unsigned i = 0; i < c->nodes; i++) {
        walk *k = c->at_node[i];
        const pl_front_node *node = &k->nodes[next_of(k)];
        wide enter, leave;
        meet(k->f, k->t_max, node, &enter, &leave);
        k->top += wide_list(enter, leave, node->child, k->stack + k->top);
        if (!make_room(k)) return false;
    }
    c->steps += c->nodes;
    while (c->others > 0) { /* backwards: the last ray takes the place of one that has ended */
        const unsigned i = c->at_other[--c->others];
        walk *k = c->going[i];
        const enum progress progress = take(tracer, k, next_of(k), any);
        if (progress == FAILED) return false;
        if (progress == UNDER_WAY) continue;
        c->steps += k->steps;
        c->going[i] = c->going[--c->left];
    }
    return true;
}

bool STREAM_KERNEL(pl_tracer *tracer, const pl_ray *rays, pl_query *queries, unsigned count)
{
    pl_bvh_work *w = tracer->work;
    crowd c;
    bool met, ok = true;
    c.left = 0;
    c.steps = 0;
    for (unsigned i = 0; i < count && ok; i++) {
        pl_bvh_lane *lane = &w->lanes[i];
        ok = pl_bvh_grow_frames(lane, 0, queries->error) && pl_bvh_grow_stack(lane, 0, queries->error);
        if (!ok || !begin_root(tracer, lane, &rays[i], &queries[i], &met)) continue;
        walk *k = c.going[c.left] = &c.walks[c.left];
        ok = set_off(k, lane, &queries[i], 0, met);
        c.left++;
    }
    const bool any = queries->kind == PL_QUERY_ANY;
    while (ok && c.left > 0) ok = any ? make_round(tracer, &c, true) : make_round(tracer, &c, false);
    tracer->counters.box_tests += c.steps * PL_FRONT_WIDTH;
    wide_end();
    return ok;
}
