/* kernel_stream.h - rays that go different ways, a step of each in turn (part of the kernels; kernel.h has the steps).
 *
 * Nobody can foretell what a ray meets next, and a processor that guesses wrong begins again. So each round takes the
 * next entry of every ray and does all nodes one after another without a guess, then what is left, kind by kind; and no
 * ray waits for its own last step. Each ray's steps are those that it takes alone, so streams can't show in hits. */

/* Rays under way, and what each comes to in this round: sets of rays, a bit each. */
typedef struct crowd {
    walk walks[PL_LANES];
    uint32_t left, nodes, instances, primitives, returns;
    uint64_t steps; /* of all */
} crowd;

/* For each ray i of a set. */
#define EACH(i, set) \
    for (uint32_t rest_ = set, i = 0; rest_ && (i = (uint32_t)__builtin_ctz(rest_), true); rest_ &= rest_ - 1)

/* Where the set of a reference's kind lies in the 64 bits of four sets of sixteen rays: nodes, instances, returns, primitives. */
static const uint8_t SET_OF_KIND[16] = {0, 48, 48, 48, 48, 48, 48, 48, 48, 48, 48, 48, 48, 16, 32, 48};
_Static_assert(PL_LANES == 32, "two halves of sixteen");

/* Takes the next entry of some of sixteen rays, which stays above the tops of their stacks. Their four sets. */
static inline uint64_t sort_half(walk *walks, uint32_t left)
{
    uint64_t sets = 0;
    EACH(i, left) {
        walk *k = &walks[i];
        const uint64_t at = k->stack[--k->top];
        sets |= (uint64_t)!entry_is_beyond(at, k->t_max) << (SET_OF_KIND[(pl_ref)at >> PL_REF_SHIFT] + i);
    }
    return sets;
}

/* A set of all rays of those of the two halves. */
#define BOTH(low, high, shift) ((uint16_t)((low) >> (shift)) | (uint32_t)((high) >> (shift)) << 16)

/* Takes the next entry of each ray. */
static inline void sort_out(crowd *c)
{
    const uint64_t low = sort_half(c->walks, (uint16_t)c->left), high = sort_half(c->walks + 16, c->left >> 16);
    c->nodes = BOTH(low, high, 0);
    c->instances = BOTH(low, high, 16);
    c->returns = BOTH(low, high, 32);
    c->primitives = BOTH(low, high, 48);
}

static inline pl_ref next_of(const walk *k)
{
    return (pl_ref)k->stack[k->top];
}

/* What came of a ray's step. false: an error. */
static inline bool note(crowd *c, unsigned i, enum progress progress)
{
    if (progress == UNDER_WAY) return true;
    c->steps += c->walks[i].steps;
    c->left &= ~(1u << i);
    return progress != FAILED;
}

/* One step of each ray. false: an error. */
static inline bool make_round(pl_tracer *tracer, crowd *c, bool any)
{
    sort_out(c);
    EACH(i, c->nodes) {
        walk *k = &c->walks[i];
        const pl_front_node *node = &k->nodes[next_of(k)];
        wide enter, leave;
        meet(k->f, k->t_max, node, &enter, &leave);
        k->top += wide_list(enter, leave, node->child, k->stack + k->top);
        if (!make_room(k)) return false;
    }
    c->steps += (unsigned)__builtin_popcount(c->nodes);
    EACH(i, c->instances) {
        walk *k = &c->walks[i];
        if (!note(c, i, go_into(tracer, k, next_of(k) & PL_REF_INDEX))) return false;
    }
    EACH(i, c->primitives) {
        walk *k = &c->walks[i];
        const pl_ref ref = next_of(k);
        const enum kernel_verdict verdict = judge(tracer, k, ref, any);
        if (verdict != MISS && !note(c, i, settle_primitive(tracer, k, ref, any && verdict == CERTAIN))) return false;
    }
    EACH(i, c->returns) note(c, i, go_back(&c->walks[i]));
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
        c.left |= 1u << i;
    }
    const bool any = queries->kind == PL_QUERY_ANY;
    while (ok && c.left) ok = any ? make_round(tracer, &c, true) : make_round(tracer, &c, false);
    tracer->counters.box_tests += c.steps * PL_FRONT_WIDTH;
    wide_end();
    return ok;
}
