/* gated.c - bvh where there are cut-offs: the cyclic graph itself, a tree a state, every instance passed through its gate
 * (cut.h). A stack of instances, each with the ray in its own frame.
 *
 * A frame is an instance of a state on the way from the root; an entry of the stack is a node or item of a frame that
 * is still to be visited. Entries are visited depth first, near ones first, so the frames in use form a stack as well:
 * when an entry is taken, all frames above its own are done. Both stacks grow on the heap and drop nothing. */
#include "gated.h"

#include <stdlib.h>
#include <string.h>

#include "../error.h"

typedef struct frame {
    const pl_state *state;
    const pl_gated_tree *tree;
    const pl_item *item; /* of the parent frame's state; NULL at the root */
    uint32_t parent, depth;
    uint64_t first; /* primitives before this instance */
    double o[3], d[3];
    double stretch; /* with cut-offs: the product of stretches, and the hash of the path (cut.h) */
    uint64_t hash;
    pl_span inside;
    pl_slab slab;
} frame;

typedef struct pending {
    double t_entry;
    uint32_t frame;
    int32_t reference;
} pending;

typedef struct work {
    frame *frames;
    pending *stack;
    size_t frame_count, frame_capacity, stack_count, stack_capacity;
} work;

static void *work_create(const pl_scene *scene, pl_error *error)
{
    (void)scene;
    work *w = calloc(1, sizeof *w);
    if (!w) pl_fail_memory(error, "preparing to trace");
    return w;
}

static void work_destroy(void *memory)
{
    work *w = memory;
    if (!w) return;
    free(w->frames);
    free(w->stack);
    free(w);
}

static bool push(work *w, pending entry, pl_error *error)
{
    if (w->stack_count == w->stack_capacity) {
        size_t capacity = w->stack_capacity ? 2 * w->stack_capacity : 64;
        pending *stack = realloc(w->stack, capacity * sizeof *stack);
        if (!stack) return pl_fail_memory(error, "tracing a ray");
        w->stack = stack;
        w->stack_capacity = capacity;
    }
    w->stack[w->stack_count++] = entry;
    return true;
}

/* The frame at the end of the stack, uninitialised. Moves the others, so pointers to frames don't survive. */
static frame *push_frame(work *w, pl_error *error)
{
    if (w->frame_count == w->frame_capacity) {
        size_t capacity = w->frame_capacity ? 2 * w->frame_capacity : 32;
        frame *frames = realloc(w->frames, capacity * sizeof *frames);
        if (!frames) {
            pl_fail_memory(error, "tracing a ray");
            return NULL;
        }
        w->frames = frames;
        w->frame_capacity = capacity;
    }
    return &w->frames[w->frame_count++];
}

/* Pushes what a frame begins with: its tree's root and, on top, what has no bounds. */
static bool begin_frame(const pl_scene *scene, work *w, uint32_t index, uint32_t state, double t_entry, pl_query *query)
{
    frame *f = &w->frames[index];
    f->state = &scene->states.list[state];
    f->tree = (const pl_gated_tree *)scene->structure + state;
    f->slab = pl_slab_of(f->o, f->d, pl_reach_slack(&f->state->reach, f->o));
    if (f->tree->root != PL_GATED_NOTHING && !push(w, (pending){t_entry, index, f->tree->root}, query->error))
        return false;
    for (uint32_t i = f->tree->unbounded_count; i-- > 0;)
        if (!push(w, (pending){query->t_min, index, ~f->tree->unbounded[i]}, query->error)) return false;
    return true;
}

/* Tests a node's children and pushes those that the ray meets, the nearest last. */
static bool visit_node(work *w, const frame *f, uint32_t index, const pl_gated_node *node, pl_query *query,
                       pl_counters *counters)
{
    const pl_slab *slab = &f->slab;
    double entry[PL_GATED_WIDTH], leave[PL_GATED_WIDTH];
    for (int i = 0; i < PL_GATED_WIDTH; i++) entry[i] = query->t_min, leave[i] = query->t_max;
    for (int axis = 0; axis < 3; axis++) {
        const double *near_plane = node->planes[slab->negative[axis]][axis];
        const double *far_plane = node->planes[!slab->negative[axis]][axis];
        double near_origin = slab->near_origin[axis], far_origin = slab->far_origin[axis], by = slab->inverse[axis];
        for (int i = 0; i < PL_GATED_WIDTH; i++) {
            double t_near = (near_plane[i] - near_origin) * by, t_far = (far_plane[i] - far_origin) * by;
            entry[i] = t_near > entry[i] ? t_near : entry[i];
            leave[i] = t_far < leave[i] ? t_far : leave[i];
        }
    }
    pending met[PL_GATED_WIDTH];
    int count = 0;
    for (int i = 0; i < PL_GATED_WIDTH && node->child[i] != PL_GATED_NOTHING; i++) {
        counters->box_tests++;
        if (!(entry[i] <= leave[i])) {
            if (f->depth > counters->miss_depth) counters->miss_depth = f->depth;
            continue;
        }
        int place = count++;
        for (; place > 0 && met[place - 1].t_entry < entry[i]; place--) met[place] = met[place - 1];
        met[place] = (pending){entry[i], index, node->child[i]};
    }
    for (int i = 0; i < count; i++)
        if (!push(w, met[i], query->error)) return false;
    return true;
}

/* A position on the stack of frames, and the item at its end. */
typedef struct source {
    const work *work;
    uint32_t frame;
    const pl_item *item;
} source;

/* The union terms from the root: the items' terms of the chain of frames, written from the end. */
static bool write_path(const void *context, pl_path *path)
{
    const source *s = context;
    uint32_t length = s->item->term_count, index = s->frame;
    for (; s->work->frames[index].item; index = s->work->frames[index].parent)
        length += s->work->frames[index].item->term_count;
    path->length = 0;
    if (length > path->capacity) {
        uint32_t *terms = realloc(path->terms, length * sizeof *terms);
        if (!terms) return false;
        path->terms = terms;
        path->capacity = length;
    }
    path->length = length;
    const pl_item *item = s->item;
    for (index = s->frame; item; index = s->work->frames[index].parent) {
        length -= item->term_count;
        memcpy(path->terms + length, item->terms, item->term_count * sizeof *item->terms);
        item = s->work->frames[index].item;
    }
    return true;
}

/* An item of a frame: a leaf is tested, a state becomes a frame. */
static bool visit_item(pl_tracer *tracer, const pending *at, const pl_item *item, pl_query *query)
{
    work *w = tracer->work;
    const pl_scene *scene = tracer->scene;
    if (query->shadow && item->no_shadow) return true;
    const frame *parent = &w->frames[at->frame];
    uint64_t first = pl_add_saturating(parent->first, item->first);
    uint32_t depth = parent->depth + 1;
    double o[3], d[3], stretch = parent->stretch;
    memcpy(o, parent->o, sizeof o);
    memcpy(d, parent->d, sizeof d);
    for (uint32_t i = 0; i < item->transform_count; i++) {
        pl_map_ray(item->transforms[i], o, d);
        stretch *= item->transforms[i]->stretch;
    }
    if (item->kind != PL_NODE_ENTER) {
        source s = {w, at->frame, item};
        pl_leaf leaf = {.arguments = item->arguments, .primitive = first, .path = write_path, .source = &s};
        if (item->kind == PL_NODE_MESH) leaf.mesh = scene->meshes[item->what];
        else leaf.shape = item->what;
        tracer->counters.primitive_tests++;
        leaf.o = o;
        leaf.d = d;
        return pl_query_leaf(query, &leaf);
    }
    uint64_t hash = 0;
    pl_span inside = parent->inside;
    if (scene->states.cuts) {
        pl_arrival arrival = {item->what, o, d, stretch, parent->inside, depth};
        double t_entry;
        pl_gate gate = pl_query_gate(query, &scene->states, &arrival, &t_entry, &inside);
        if (gate == PL_GATE_MISSED) return true;
        hash = pl_cut_hash(parent->hash, item->terms, item->term_count);
        if (gate == PL_GATE_CUT) {
            source s = {w, at->frame, item};
            pl_leaf leaf = {.path = write_path, .source = &s};
            return pl_query_cut(query, &scene->states, &arrival, hash, t_entry, &leaf);
        }
    }
    uint32_t index = (uint32_t)w->frame_count;
    frame *f = push_frame(w, query->error);
    if (!f) return false;
    f->item = item;
    f->parent = at->frame;
    f->depth = depth;
    f->first = first;
    f->stretch = stretch;
    f->hash = hash;
    f->inside = inside;
    memcpy(f->o, o, sizeof o);
    memcpy(f->d, d, sizeof d);
    return begin_frame(scene, w, index, item->what, at->t_entry, query);
}

static bool trace(pl_tracer *tracer, const pl_ray *ray, pl_query *query)
{
    work *w = tracer->work;
    w->frame_count = w->stack_count = 0;
    frame *root = push_frame(w, query->error);
    if (!root) return false;
    memset(root, 0, sizeof *root);
    root->stretch = 1.0;
    root->inside = (pl_span){query->t_min, INFINITY};
    memcpy(root->o, ray->origin, sizeof root->o);
    memcpy(root->d, ray->direction, sizeof root->d);
    if (!begin_frame(tracer->scene, w, 0, 0, query->t_min, query)) return false;
    for (uint64_t steps = 0; w->stack_count && !query->done; steps++) {
        if (steps > PL_LIMIT_RAY_STEPS) return pl_query_fail_steps(query, PL_LIMIT_RAY_STEPS);
        pending at = w->stack[--w->stack_count];
        if (at.t_entry > query->t_max) continue;
        w->frame_count = at.frame + 1;
        const frame *f = &w->frames[at.frame];
        bool ok = at.reference >= 0
                      ? visit_node(w, f, at.frame, &f->tree->nodes[at.reference], query, &tracer->counters)
                      : visit_item(tracer, &at, &f->state->items[~at.reference], query);
        if (!ok) return false;
    }
    return true;
}

const pl_accel pl_accel_gated = {.name = "bvh",
                               .states = true,
                               .build = pl_gated_build,
                               .destroy = pl_gated_destroy,
                               .work_create = work_create,
                               .work_destroy = work_destroy,
                               .trace = trace};
