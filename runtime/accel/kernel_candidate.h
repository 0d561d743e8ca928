/* kernel_candidate.h - a ray mapped down the path to a primitive that it may meet, in double precision: part of kernel.h.
 *
 *     evaluate(tracer, lane, frame, ref, query)    → the query knows of the primitive
 *
 * It is the normative ray: the operations are those of pl_map_ray, in its order. */

/* One step of the normative chain (pl_map_ray): the same operations in the same order. */
static inline __attribute__((always_inline)) void map_step(const pl_transform *transform, double4 *o, double4 *d)
{
    if (transform->form <= PL_FORM_PACKED) {
        double room[12];
        const double *m = pl_transform_entries(transform, room);
        const double4 x = {m[0], m[4], m[8]}, y = {m[1], m[5], m[9]}, z = {m[2], m[6], m[10]};
        *o = x * (*o)[0] + y * (*o)[1] + z * (*o)[2] + (double4){m[3], m[7], m[11]};
        *d = x * (*d)[0] + y * (*d)[1] + z * (*d)[2];
    } else { /* a translation scales by 1 */
        const double *m = transform->to_object.m;
        const double4 scale = {m[0], m[5], m[10]}, offset = {m[3], m[7], m[11]};
        *o = *o * scale + offset;
        *d = *d * scale;
    }
}

/* Maps a ray from a front's state to an item of an opened node and the leaf that it leads to (NULL: it is an instance), one
 * transformation after another. */
static inline __attribute__((always_inline)) bool map_down(pl_bvh_work *w, const pl_front *front, uint32_t opened,
                                                           const pl_item *item, const pl_item *leaf, double4 *o, double4 *d,
                                                           pl_error *error)
{
    if (front->links) {
        const pl_front_list list = front->opened[opened].list;
        const uint8_t *links = front->links + list.first;
        for (uint32_t i = 0; i < list.length; i++) map_step(front->maps[links[i]], o, d);
        for (uint32_t i = 0; i < item->transform_count; i++) map_step(item->transforms[i], o, d);
        if (!leaf || leaf == item) return true;
        for (uint32_t i = 0; i < leaf->transform_count; i++) map_step(leaf->transforms[i], o, d);
        return true;
    }
    size_t count;
    if (!pl_bvh_chain(w, front, opened, item, leaf, &count, error)) return false;
    while (count > 0) map_step(w->chain[--count], o, d);
    return true;
}

#ifdef PACKET_KERNEL
static bool map_alone(pl_tracer *tracer, pl_error *error);
#endif

/* Evaluates a primitive of a frame normatively and offers it. The normative ray comes from the deepest frame above that knows
 * it. false: an error. */
static bool evaluate(pl_tracer *tracer, pl_bvh_lane *lane, uint32_t frame, pl_ref ref, pl_query *query)
{
    const pl_states *states = &tracer->scene->states;
    pl_bvh_work *w = tracer->work;
    uint32_t from = frame;
#ifdef PACKET_KERNEL
    if (w->alone && !map_alone(tracer, query->error)) return false;
#endif
    while (!lane->frames[from].mapped) from--;
    double4 o = *(const double4 *)lane->frames[from].normative_o, d = *(const double4 *)lane->frames[from].normative_d;
    for (; from < frame; from++) {
        const pl_front *front = lane->frames[from].front;
        pl_frame *below = &lane->frames[from + 1];
        const pl_front_place *at = &front->places[below->instance];
        if (!map_down(w, front, at->opened, pl_front_item(states, at->item), NULL, &o, &d, query->error)) return false;
        *(double4 *)below->normative_o = o;
        *(double4 *)below->normative_d = d;
        below->mapped = true;
    }
    const pl_front *front = lane->frames[frame].front;
    const pl_front_primitive *p = &front->primitives[ref & PL_REF_INDEX];
    const pl_item *item = pl_front_item(states, p->item), *leaf = pl_front_leaf_of(states, p, ref >> PL_REF_SHIFT);
    double in_o[4], in_d[4];
    if (!map_down(w, front, p->opened, item, leaf, &o, &d, query->error)) return false;
    *(double4 *)in_o = o;
    *(double4 *)in_d = d;
    wide_end();
    return pl_bvh_offer(tracer, lane, frame, ref, leaf, in_o, in_d, query);
}
