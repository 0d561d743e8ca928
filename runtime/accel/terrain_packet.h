/* terrain_packet.h - up to PL_LANES rays through a terrain together (terrain_kernel.h has the single ray's; this is part of the
 * kernels of x86).
 *
 * Rays that go about the same way are a *beam* in nodes and tiles, as in kernel_packet.h; clusters tell them apart, and each ray
 * that meets a cluster's box is tested against its eight triangles. Other rays are a *stream*: each goes to its next tile, asks
 * for that tile's memory, and while it comes the others go on. Large terrains are waited for more than computed.
 *
 * Both filter only, and evaluate what is left as single rays do. */

/* Where the rays of a packet pass a tile: sight, lane by lane. */
typedef struct sights {
    float o[3][PL_LANES], d[3][PL_LANES], t0[PL_LANES], side[PL_LANES], depth[PL_LANES];
    float slack[3];
} sights;

static inline void sights_of(const pl_packet_frame *f, const pl_terrain_tile *tile, sights *s)
{
    float steps[3];
    for (int axis = 0; axis < 3; axis++) {
        steps[axis] = 1.0f / tile->step[axis];
        s->slack[axis] = f->slack * steps[axis];
    }
    for (int first = 0; first < PL_LANES; first += HALF) {
        wide t0 = wide_set(0.0f), square = wide_set(0.0f), size = wide_set(LEAST_SIZE), length = wide_set(0.0f);
#pragma GCC unroll 3
        for (int axis = 0; axis < 3; axis++) {
            const wide d = wide_load(f->direction[axis] + first);
            t0 += (wide_set(tile->lo[axis]) - wide_load(f->origin[axis] + first)) * d;
            square += d * d;
        }
        t0 /= square;
#pragma GCC unroll 3
        for (int axis = 0; axis < 3; axis++) {
            const wide along = wide_load(f->direction[axis] + first);
            const wide o = (wide_load(f->origin[axis] + first) + t0 * along - wide_set(tile->lo[axis])) * wide_set(steps[axis]);
            const wide d = along * wide_set(steps[axis]);
            _mm256_storeu_ps(s->o[axis] + first, o);
            _mm256_storeu_ps(s->d[axis] + first, d);
            size += wide_absolute(o);
            length += wide_absolute(d);
        }
        _mm256_storeu_ps(s->t0 + first, t0);
        _mm256_storeu_ps(s->side + first, size * length * wide_set(SIDE_ROUNDING));
        _mm256_storeu_ps(s->depth + first, size * wide_set(DEPTH_ROUNDING));
    }
}

static inline sight sight_in_lane(const sights *all, int lane)
{
    sight s = {.t0 = all->t0[lane], .side = all->side[lane], .depth = all->depth[lane]};
    for (int axis = 0; axis < 3; axis++) {
        s.o[axis] = all->o[axis][lane];
        s.d[axis] = all->d[axis][lane];
    }
    return s;
}

/* As meet_tile. */
static inline unsigned meet_tile_beam(const pl_beam *b, float t_max, const pl_terrain_tile *tile, uint64_t *entries, uint32_t *nearest)
{
    wide enter = wide_set(0.0f), leave = wide_set(t_max);
#pragma GCC unroll 3
    for (int axis = 0; axis < 3; axis++) {
        const wide lo = wide_set(tile->lo[axis]), step = wide_set(tile->step[axis]);
        const wide near = wide_multiply_add(wide_bytes(tile->planes[0] + b->near_row[axis]), step, lo) - b->near_o[axis];
        const wide far = wide_multiply_add(wide_bytes(tile->planes[0] + b->far_row[axis]), step, lo) - b->far_o[axis];
        enter = wide_max(wide_min(near * b->least[axis], near * b->most[axis]), enter);
        leave = wide_min(wide_max(far * b->least[axis], far * b->most[axis]), leave);
    }
    return wide_order(enter, leave, CLUSTERS, entries, nearest);
}

/* The lanes whose rays meet a cluster's box. */
static inline unsigned lanes_in_cluster(const pl_packet_frame *f, const pl_beam *b, const pl_terrain_tile *tile, uint32_t cluster)
{
    float near[3], far[3];
    unsigned met = 0;
    for (int axis = 0; axis < 3; axis++) {
        const float toward = b->near_row[axis] < b->far_row[axis] ? f->slack : -f->slack;
        near[axis] = tile->lo[axis] + tile->step[axis] * tile->planes[b->near_row[axis] / PL_FRONT_WIDTH][cluster] - toward;
        far[axis] = tile->lo[axis] + tile->step[axis] * tile->planes[b->far_row[axis] / PL_FRONT_WIDTH][cluster] + toward;
    }
    for (int first = 0; first < PL_LANES; first += HALF) {
        wide enter = wide_set(0.0f), leave = wide_load(f->t_max + first);
#pragma GCC unroll 3
        for (int axis = 0; axis < 3; axis++) {
            const wide inverse = wide_load(f->inverse[axis] + first), o = wide_load(f->origin[axis] + first);
            enter = wide_max((wide_set(near[axis]) - o) * inverse, enter);
            leave = wide_min((wide_set(far[axis]) - o) * inverse, leave);
        }
        met |= wide_mask_of(_mm256_cmp_ps(enter, leave, _CMP_LE_OQ)) << first;
    }
    return met & f->lanes;
}

/* A packet on its way through a terrain. */
typedef struct convoy {
    const pl_terrain *terrain;
    pl_packet_frame *frame;
    const pl_ray *rays; /* in the terrain's frame */
    pl_query *queries;
    double t_max[PL_LANES];
} convoy;

/* Tests a cluster's triangles with the rays that meet its box. false: an error. First all filters and then the candidates: so
 * processors needn't guess, a ray at a time, whether there is one. */
static inline bool visit_cluster_beam(pl_tracer *tracer, convoy *c, const sights *all, uint32_t tile, uint32_t cluster)
{
    const pl_terrain_tile *it = pl_terrain_tile_at(c->terrain, tile);
    const unsigned there = facets_of(c->terrain, cluster);
    unsigned lanes = there ? lanes_in_cluster(c->frame, &c->frame->beam, it, cluster) : 0, left[PL_LANES], hit = 0;
    facets f;
    if (!lanes) return true;
    unpack_cluster(it, cluster, all->slack, &f);
    tracer->counters.filtered += PL_TERRAIN_CLUSTER * (unsigned)__builtin_popcount(lanes);
    for (; lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        const sight s = sight_in_lane(all, lane);
        left[lane] = filter_eight(&s, &f, c->frame->t_max[lane], false, NULL) & there;
        hit |= (unsigned)(left[lane] != 0) << lane;
    }
    if (!hit) return true;
    wide_end();
    for (; hit; hit &= hit - 1) {
        const int lane = __builtin_ctz(hit);
        const pl_ray *ray = &c->rays[lane];
        for (unsigned rest = left[lane]; rest; rest &= rest - 1) {
            const uint32_t leaf = cluster * PL_TERRAIN_CLUSTER + (uint32_t)__builtin_ctz(rest);
            if (!pl_terrain_candidate(tracer, c->terrain, tile, leaf, ray->origin, ray->direction, &c->queries[lane])) return false;
        }
        c->t_max[lane] = c->queries[lane].t_max;
    }
    set_t_max(c->frame, c->t_max);
    return true;
}

static inline bool visit_tile_beam(pl_tracer *tracer, convoy *c, uint32_t index)
{
    const pl_terrain_tile *tile = pl_terrain_tile_at(c->terrain, index);
    uint64_t entries[PL_TERRAIN_CLUSTERS];
    uint32_t cluster;
    unsigned count = meet_tile_beam(&c->frame->beam, c->frame->most, tile, entries, &cluster);
    sights s;
    if (count == 0) return true;
    sights_of(c->frame, tile, &s);
    for (;;) {
        if (!visit_cluster_beam(tracer, c, &s, index, cluster)) return false;
        if (--count == 0 || entry_is_beyond(entries[count - 1], c->frame->most)) return true;
        cluster = (uint32_t)entries[count - 1];
    }
}

/* As next_tile and travel. */
static bool travel_as_beam(pl_tracer *tracer, convoy *c, uint64_t *stack)
{
    const pl_front_node *nodes = c->terrain->front.nodes;
    uint64_t steps = 0;
    size_t top = 0;
    stack[top++] = entry_of(0.0f, c->terrain->front.root);
    while (top) {
        const uint64_t entry = stack[--top];
        pl_ref ref = (pl_ref)entry;
        if (entry_is_beyond(entry, c->frame->most)) continue;
        while (ref >> PL_REF_SHIFT == PL_KIND_NODE) {
            const unsigned count = meet_beam(&c->frame->beam, c->frame->most, &nodes[ref], stack + top, &ref);
            steps++;
            if (count == 0) goto next;
            top += count - 1;
        }
        steps++;
        fetch_tile(c->terrain, ref);
        if (!visit_tile_beam(tracer, c, ref & PL_REF_INDEX)) return false;
    next:;
    }
    tracer->counters.box_tests += steps * PL_FRONT_WIDTH;
    return true;
}

/* The rays of some lanes, each with a stack of its own. */
static bool travel_as_stream(pl_tracer *tracer, const pl_terrain *terrain, const pl_ray *rays, pl_query *queries, unsigned count,
                             uint64_t *stacks)
{
    traveller travellers[PL_LANES];
    pl_frame frames[PL_LANES];
    pl_ref next[PL_LANES];
    uint64_t steps = 0;
    unsigned going = 0;
    for (unsigned i = 0; i < count; i++) {
        traveller *r = &travellers[going];
        if (!set_out(r, terrain, &frames[going], rays[i].origin, rays[i].direction, &queries[i], stacks + i * terrain->stack_need) ||
            (next[going] = next_tile(r, &steps)) == PL_NOTHING)
            continue;
        fetch_tile(terrain, next[going++]);
    }
    while (going) {
        for (unsigned i = 0; i < going;) {
            traveller *r = &travellers[i];
            if (visit_tile(tracer, r, next[i], false) < 0) return false;
            next[i] = next_tile(r, &steps);
            if (next[i] != PL_NOTHING) {
                fetch_tile(terrain, next[i++]);
            } else if (i < --going) {
                travellers[i] = travellers[going];
                next[i] = next[going];
            }
        }
    }
    tracer->counters.box_tests += steps * PL_FRONT_WIDTH;
    return true;
}

bool TERRAIN_PACKET(pl_tracer *tracer, const pl_terrain *terrain, const pl_ray *rays, pl_query *queries, unsigned count)
{
    pl_bvh_work *w = tracer->work;
    if (!pl_bvh_grow_packets(w, 0, queries->error) ||
        (w->packet_stack_capacity < PL_LANES * terrain->stack_need &&
         !pl_bvh_grow_packet_stack(w, PL_LANES * terrain->stack_need, queries->error)))
        return false;
    convoy c = {.terrain = terrain, .frame = w->packets, .rays = rays, .queries = queries};
    bool ok = true, beams = false;
    if (count >= PL_LEAST_LANES && make_packet(c.frame, &terrain->front, rays, queries, count, c.t_max)) {
        const enum course course = begin_lanes(c.frame, UINT32_MAX >> (32 - count), c.t_max);
        if (course == ASTRAY) goto end;
        beams = course == TOGETHER && look_along(c.frame);
    }
    if (!beams && count > PL_LANES / 2)
        return TERRAIN_PACKET(tracer, terrain, rays, queries, PL_LANES / 2) &&
               TERRAIN_PACKET(tracer, terrain, rays + PL_LANES / 2, queries + PL_LANES / 2, count - PL_LANES / 2);
    ok = beams ? travel_as_beam(tracer, &c, w->packet_stack)
               : travel_as_stream(tracer, terrain, rays, queries, count, w->packet_stack);
end:
    wide_end();
    return ok;
}
