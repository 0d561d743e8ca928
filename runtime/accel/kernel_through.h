/* kernel_through.h - a packet's way through the nodes of fronts, which kernel_packet.h and gated_packet.h share.
 *
 *     packet_way way = way_of(w);
 *     push_front(&way, f->front);
 *     while (go_through_nodes(&way, w, f, any, &ref, &some, error)) …    a primitive, an instance or the way back, for some lanes
 */

/* Where a packet goes on, on the work's stack; pointers to it are kept here, until it grows. */
typedef struct packet_way {
    uint64_t *stack;
    uint32_t *own; /* the lanes that an entry is for */
    size_t top;
    uint64_t steps;
} packet_way;

static inline __attribute__((always_inline)) packet_way way_of(const pl_bvh_work *w)
{
    return (packet_way){.stack = w->packet_stack, .own = w->packet_lanes};
}

/* Into a front, and back when all of it is done. */
static inline __attribute__((always_inline)) void push_front(packet_way *way, const pl_front *front)
{
    way->own[way->top] = way->own[way->top + 1] = UINT32_MAX;
    way->stack[way->top++] = entry_of(0.0f, pl_ref_of(PL_KIND_RETURN, 0));
    way->stack[way->top++] = entry_of(0.0f, front->root);
}

/* Through nodes to what comes next in a frame: *ref, for *some of its lanes. any: their t_max never changes, so no entry comes to lie
 * beyond it. false: no memory. */
static inline __attribute__((always_inline)) bool go_through_nodes(packet_way *way, pl_bvh_work *w, const pl_packet_frame *f, bool any,
                                                                  pl_ref *ref, unsigned *some, pl_error *error)
{
    for (;;) {
        const uint64_t at = way->stack[--way->top];
        *ref = (pl_ref)at;
        *some = f->lanes & way->own[way->top];
        if (!any && f->each) *some &= lanes_within(f, at);
        else if (!any && entry_is_beyond(at, f->most)) continue;
        if (!*some && *ref >> PL_REF_SHIFT != PL_KIND_RETURN) continue;
        for (;;) {
            if (*ref >> PL_REF_SHIFT != PL_KIND_NODE) return true;
            const pl_front_node *node = &f->front->nodes[*ref];
            const unsigned count = f->each ? meet_each(f, some, node, way->stack + way->top, way->own + way->top, ref)
                                           : meet_together(f, some, node, way->stack + way->top, way->own + way->top, ref);
            way->steps++;
            if (count == 0) break;
            way->top += count - 1;
            if (way->top + 16 <= w->packet_stack_capacity) continue;
            if (!pl_bvh_grow_packet_stack(w, way->top, error)) return false;
            way->stack = w->packet_stack;
            way->own = w->packet_lanes;
        }
    }
}
