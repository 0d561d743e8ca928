/* kernel_stream.h - rays that go different ways, a step of each in turn (part of the kernels; kernel.h has the steps).
 *
 * Nobody can foretell what a ray meets next, and a processor that guesses wrong begins again. So each round takes the
 * next entry of every ray and does all nodes one after another without a guess, then what is left, kind by kind; no ray
 * waits for its own last step, nor for an instance or a primitive to come from memory. Each ray's steps are those that it
 * takes alone, so streams can't show in hits. */

/* Rays under way, and what each comes to in this round: sets of rays, a bit each. */
typedef struct crowd {
    _Alignas(32) pl_ref next[PL_LANES]; /* the entry that each takes next, which stays above the top of its stack … */
    uint32_t at[PL_LANES], limit[PL_LANES]; /* … and its t, which is beyond above the limit (limit_of) */
    walk walks[PL_LANES];
    uint32_t left, nodes, instances, primitives, returns, beyond;
    uint64_t steps; /* of all */
} crowd;

/* For each ray i of a set. */
#define EACH(i, set) \
    for (uint32_t rest_ = set, i = 0; rest_ && (i = (uint32_t)__builtin_ctz(rest_), true); rest_ &= rest_ - 1)

/* Sorts rays by what they take next, eight at a time. */
static inline void sort_out(crowd *c)
{
    uint32_t within = 0;
    c->nodes = c->instances = c->returns = 0;
    for (unsigned i = 0; i < PL_LANES; i += 8) {
        within |= wide_at_most(c->at + i, c->limit + i) << i;
        c->nodes |= wide_of_kind(c->next + i, PL_KIND_NODE) << i;
        c->instances |= wide_of_kind(c->next + i, PL_KIND_INSTANCE) << i;
        c->returns |= wide_of_kind(c->next + i, PL_KIND_RETURN) << i;
    }
    within &= c->left;
    c->beyond = c->left & ~within;
    c->primitives = within & ~(c->nodes | c->instances | c->returns);
    c->nodes &= within;
    c->instances &= within;
    c->returns &= within;
}

static inline void take_next(crowd *c, unsigned i)
{
    const uint64_t entry = *--c->walks[i].top;
    c->next[i] = (pl_ref)entry;
    c->at[i] = (uint32_t)(entry >> 32);
}

/* The same after a step that may have changed t_max. */
static inline void take_next_within(crowd *c, unsigned i)
{
    c->limit[i] = (uint32_t)(limit_of(c->walks[i].t_max) >> 32);
    take_next(c, i);
}

/* What came of a ray's step. false: an error. */
static inline bool note(crowd *c, unsigned i, enum progress progress)
{
    if (progress == UNDER_WAY) {
        take_next_within(c, i);
        return true;
    }
    c->steps += c->walks[i].steps;
    c->left &= ~(1u << i);
    return progress != FAILED;
}

/* Has instances and primitives brought from memory while nodes are done. Inline, since compilers take out calls of functions
 * that do nothing else. */
static inline __attribute__((always_inline)) void fetch_items(const crowd *c)
{
    enum { LINE = 64 };
    _Static_assert(sizeof(pl_front_instance) == LINE && sizeof(pl_front_primitive) == LINE, "a line of the cache each");
    EACH(i, c->instances | c->primitives) {
        const pl_front *front = c->walks[i].f->front;
        const char *list = c->instances >> i & 1 ? (const char *)front->instances : (const char *)front->primitives;
        __builtin_prefetch(list + LINE * (size_t)(c->next[i] & PL_REF_INDEX));
    }
}

/* One step of each ray. false: an error. */
static inline bool make_round(pl_tracer *tracer, crowd *c, bool any)
{
    sort_out(c);
    fetch_items(c);
    EACH(i, c->nodes) {
        walk *k = &c->walks[i];
        const pl_front_node *node = &k->nodes[c->next[i]];
        wide enter, leave;
        meet(k->f, k->t_max, node, &enter, &leave);
        k->top += wide_list(enter, leave, node->child, k->top);
        if (!make_room(k, 0)) return false;
        take_next(c, i);
    }
    c->steps += (unsigned)__builtin_popcount(c->nodes);
    EACH(i, c->instances) {
        if (!note(c, i, go_into(tracer, &c->walks[i], c->next[i] & PL_REF_INDEX))) return false;
    }
    EACH(i, c->primitives) {
        walk *k = &c->walks[i];
        const enum kernel_verdict verdict = judge(tracer, k, c->next[i], any);
        if (verdict == MISS) take_next(c, i);
        else if (!note(c, i, settle_primitive(tracer, k, c->next[i], any && verdict == CERTAIN))) return false;
    }
    EACH(i, c->returns) note(c, i, go_back(&c->walks[i]));
    EACH(i, c->beyond) take_next(c, i);
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
        ok = set_off(&c.walks[i], lane, &queries[i], 0, met);
        if (ok) take_next_within(&c, i);
        c.left |= 1u << i;
    }
    const bool any = queries->kind == PL_QUERY_ANY;
    while (ok && c.left) ok = any ? make_round(tracer, &c, true) : make_round(tracer, &c, false);
    tracer->counters.box_tests += c.steps * PL_FRONT_WIDTH;
    wide_end();
    return ok;
}
