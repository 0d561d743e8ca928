/* grid_fill.c - fills the grid of grid.h top down, with one walk over the derivation (paper, section 4, "Preprocessing").
 *
 * The walk carries the product of the transformations. It ends at an S-node whose box, seen in world space, is no larger
 * than a voxel, or that lies at the depth limit, or at a primitive; what it ends at is put into all voxels that its box
 * overlaps. Where a voxel already refers to another state, the ambiguity is resolved at the junction of their two
 * paths, which is the innermost +-node instance that both went through: the voxel then refers to that instance.
 *
 * The walk is depth first, so the junction stands on the walk's stack of +-nodes, and since time only goes on, it is the
 * innermost one that began before the other state was put in: no paths are compared. What comes later from below a junction that a
 * voxel refers to is contained in it already. So there are never more than two entries in a voxel, and one in the end.
 *
 * Departures: our +-nodes have any number of terms, so a junction may hold more than the two of the paper. The depth
 * limit follows from the number of instances (MOST_INSTANCES), not from the user. */
#include "grid.h"

#include <stdlib.h>
#include <string.h>

#include "../error.h"

enum { MOST_INSTANCES = 1 << 19, USUAL_SIZE = 16, USUAL_HEIGHT = 8 };

/* A transformation on the current path, and its link once a state needs it. */
typedef struct level {
    const pl_transform *constant; /* NULL: computed */
    pl_transform computed;
    uint32_t link;
} level;

/* A +-node on the current path. */
typedef struct junction {
    uint64_t time;
    uint32_t node, state;
    pl_spot at;
    size_t word_first, word_count;
} junction;

/* While filling, links and states refer to growing arrays by index. */
typedef struct draft_link {
    const pl_transform *constant;
    uint32_t computed, parent;
    const pl_grid_link *kept; /* once it is needed by a state that stays */
} draft_link;

typedef struct draft {
    pl_grid_state state;
    uint64_t time; /* when it was put in */
    uint32_t link, place; /* place: among the states that stay */
    size_t word_first, word_count, term_first;
} draft;

/* A growing array. */
typedef struct array {
    void *data;
    size_t count, capacity, element;
} array;

typedef struct filling {
    const pl_scene *scene;
    pl_grid *grid;
    pl_walk walk;
    uint32_t *voxels;
    array levels, junctions, scopes; /* of the current path; scopes: packed, of the junctions */
    array states, links, computed, words, terms;
    uint64_t time;
    uint32_t depth_limit;
    size_t limit;
    pl_error *error;
} filling;

/* `more` elements at the end; NULL: no memory, or more than is allowed. */
static void *extend(filling *f, array *a, size_t more)
{
    if (a->count + more > a->capacity || !a->data) {
        size_t capacity = 2 * (a->count + more) + 8;
        void *data = capacity * a->element > f->limit ? NULL : realloc(a->data, capacity * a->element);
        if (!data) {
            pl_fail(f->error, PL_ERROR_LIMIT, "grid", "memory: its states need more than the %zu bytes allowed; try fewer voxels",
                    f->limit);
            return NULL;
        }
        a->data = data;
        a->capacity = capacity;
    }
    void *place = (char *)a->data + a->count * a->element;
    a->count += more;
    return place;
}

/* --- states --- */

/* The link of the innermost of the path's first `count` transformations. */
static bool link_chain(filling *f, uint32_t count, uint32_t *link)
{
    level *levels = f->levels.data;
    uint32_t first = count;
    while (first > 0 && levels[first - 1].link == PL_GRID_NOTHING) first--;
    *link = first ? levels[first - 1].link : PL_GRID_NOTHING;
    for (; first < count; first++) {
        draft_link entry = {levels[first].constant, 0, *link, NULL};
        if (!entry.constant) {
            pl_transform *computed = extend(f, &f->computed, 1);
            if (!computed) return false;
            *computed = levels[first].computed;
            entry.computed = (uint32_t)(f->computed.count - 1);
        }
        draft_link *place = extend(f, &f->links, 1);
        if (!place) return false;
        *place = entry;
        *link = levels[first].link = (uint32_t)(f->links.count - 1);
    }
    return true;
}

/* A new state at a node of the current path; PL_GRID_NOTHING: an error. */
static uint32_t add_state(filling *f, uint32_t node, const pl_spot *at, uint64_t time, const uint64_t *words,
                          size_t word_count, const pl_box *box)
{
    draft d = {.state = {.node = node,
                         .link_count = at->marks[0],
                         .term_count = at->terms,
                         .depth = at->depth,
                         .symbol = at->symbol,
                         .rule = at->rule,
                         .no_shadow = at->no_shadow,
                         .box = *box},
               .time = time,
               .place = PL_GRID_NOTHING,
               .word_first = f->words.count,
               .word_count = word_count,
               .term_first = f->terms.count};
    memcpy(d.state.arguments, f->walk.arguments, sizeof d.state.arguments);
    uint64_t *kept = extend(f, &f->words, word_count);
    uint32_t *terms = extend(f, &f->terms, at->terms);
    if (!kept || !terms || !link_chain(f, at->marks[0], &d.link)) return PL_GRID_NOTHING;
    if (word_count) memcpy(kept, words, word_count * sizeof *kept);
    if (at->terms) memcpy(terms, f->walk.path.terms, at->terms * sizeof *terms);
    draft *place = extend(f, &f->states, 1);
    if (!place) return PL_GRID_NOTHING;
    *place = d;
    return (uint32_t)(f->states.count - 1);
}

/* A graph node's box in world space; everything where numbers overflow. */
static pl_box box_in_world(const filling *f, uint32_t node, const double matrix[12])
{
    pl_affine map;
    memcpy(map.m, matrix, sizeof map.m);
    pl_box box = pl_box_map(&map, &f->scene->states.node_boxes[node].box);
    return pl_box_is_empty(&box) || pl_box_is_finite(&box) ? box : pl_box_everything();
}

static uint32_t junction_state(filling *f, junction *j)
{
    if (j->state != PL_GRID_NOTHING) return j->state;
    pl_box box = box_in_world(f, j->node, j->at.payload);
    return j->state = add_state(f, j->node, &j->at, j->time, (uint64_t *)f->scopes.data + j->word_first, j->word_count, &box);
}

/* --- voxels --- */

/* Indices of the voxels that a coordinate range overlaps, widened by the margin; infinite ends are clamped. */
static void voxel_range(const pl_grid *grid, const pl_box *box, int axis, uint32_t *first, uint32_t *last)
{
    double end = grid->size[axis] - 1.0;
    double lo = floor((box->lo[axis] - grid->margin - grid->lo[axis]) / grid->step[axis]);
    double hi = floor((box->hi[axis] + grid->margin - grid->lo[axis]) / grid->step[axis]);
    *first = (uint32_t)fmin(fmax(lo, 0.0), end);
    *last = (uint32_t)fmin(fmax(hi, 0.0), end);
}

/* The innermost of the current path's junctions that a state put in at `time` lies below. The first one is the
 * scene's, or there is only one state. */
static junction *junction_with(filling *f, uint32_t count, uint64_t time)
{
    junction *list = f->junctions.data;
    uint32_t lo = 0, hi = count;
    while (hi - lo > 1) {
        uint32_t middle = lo + (hi - lo) / 2;
        if (list[middle].time <= time) lo = middle;
        else hi = middle;
    }
    return &list[lo];
}

/* Puts the node at which the walk stands into all voxels that its box overlaps. */
static bool put(filling *f, const pl_box *box, const uint64_t *words, size_t word_count)
{
    uint32_t first[3], last[3], index = PL_GRID_NOTHING;
    uint64_t time = ++f->time;
    if (pl_box_is_empty(box)) return true;
    for (int axis = 0; axis < 3; axis++) voxel_range(f->grid, box, axis, &first[axis], &last[axis]);
    for (uint32_t z = first[2]; z <= last[2]; z++)
        for (uint32_t y = first[1]; y <= last[1]; y++)
            for (uint32_t x = first[0]; x <= last[0]; x++) {
                uint32_t *voxel = &f->voxels[((size_t)z * f->grid->size[1] + y) * f->grid->size[0] + x];
                if (*voxel == PL_GRID_NOTHING) {
                    if (index == PL_GRID_NOTHING)
                        index = add_state(f, f->walk.node, &f->walk.at, time, words, word_count, box);
                    if ((*voxel = index) == PL_GRID_NOTHING) return false;
                    continue;
                }
                uint64_t other = ((draft *)f->states.data)[*voxel].time;
                junction *j = junction_with(f, f->walk.at.marks[1], other);
                if (j->time != other && (*voxel = junction_state(f, j)) == PL_GRID_NOTHING) return false;
            }
    return true;
}

/* Whether all voxels that a box overlaps refer to junctions of the current path: these contain what the box holds. */
static bool is_covered(filling *f, const pl_box *box)
{
    uint32_t first[3], last[3];
    if (pl_box_is_empty(box)) return true;
    for (int axis = 0; axis < 3; axis++) voxel_range(f->grid, box, axis, &first[axis], &last[axis]);
    for (uint32_t z = first[2]; z <= last[2]; z++)
        for (uint32_t y = first[1]; y <= last[1]; y++)
            for (uint32_t x = first[0]; x <= last[0]; x++) {
                uint32_t state = f->voxels[((size_t)z * f->grid->size[1] + y) * f->grid->size[0] + x];
                if (state == PL_GRID_NOTHING || f->walk.at.marks[1] == 0) return false;
                uint64_t time = ((draft *)f->states.data)[state].time;
                if (junction_with(f, f->walk.at.marks[1], time)->time != time) return false;
            }
    return true;
}

/* --- the walk --- */

static bool is_small(const pl_grid *grid, const pl_box *box)
{
    for (int axis = 0; axis < 3; axis++)
        if (!(box->hi[axis] - box->lo[axis] <= grid->step[axis])) return false;
    return true;
}

/* At an S-node: ends the walk here, or lets it go on. */
static bool reach_symbol(filling *f)
{
    pl_walk *walk = &f->walk;
    pl_box box = box_in_world(f, walk->node, walk->at.payload);
    if (is_covered(f, &box)) {
        pl_walk_prune(walk);
        return true;
    }
    if (!is_small(f->grid, &box) && walk->at.depth < f->depth_limit) return true;
    size_t words = pl_scope_words(walk->program, &walk->scope), before = f->scopes.count;
    uint64_t *packed = extend(f, &f->scopes, words);
    if (!packed) return false;
    pl_scope_pack(walk->program, &walk->scope, packed);
    bool ok = put(f, &box, packed, words);
    f->scopes.count = before;
    pl_walk_prune(walk);
    return ok;
}

static bool reach_union(filling *f)
{
    pl_walk *walk = &f->walk;
    junction *list = f->junctions.data;
    uint32_t index = walk->at.marks[1];
    size_t words = pl_scope_words(walk->program, &walk->scope);
    f->scopes.count = index ? list[index - 1].word_first + list[index - 1].word_count : 0;
    f->junctions.count = index;
    size_t first = f->scopes.count;
    uint64_t *packed = extend(f, &f->scopes, words);
    junction *place = extend(f, &f->junctions, 1);
    if (!packed || !place) return false;
    pl_scope_pack(walk->program, &walk->scope, packed);
    *place = (junction){++f->time, walk->node, PL_GRID_NOTHING, walk->at, first, words};
    walk->at.marks[1]++;
    return true;
}

static bool reach_transform(filling *f)
{
    pl_walk *walk = &f->walk;
    f->levels.count = walk->at.marks[0]++;
    level *place = extend(f, &f->levels, 1);
    if (!place) return false;
    bool computed = walk->transform == &walk->computed;
    place->constant = computed ? NULL : walk->transform;
    if (computed) place->computed = *walk->transform;
    place->link = PL_GRID_NOTHING;
    pl_affine map;
    memcpy(map.m, walk->at.payload, sizeof map.m);
    map = pl_affine_multiply(&map, &walk->transform->to_parent);
    memcpy(walk->at.payload, map.m, sizeof map.m);
    return true;
}

static bool reach_leaf(filling *f)
{
    pl_walk *walk = &f->walk;
    if (f->scene->states.node_boxes[walk->node].unbounded) return true;
    pl_affine map;
    memcpy(map.m, walk->at.payload, sizeof map.m);
    pl_box box = f->scene->program->nodes[walk->node].kind == PL_NODE_MESH
                     ? pl_box_map(&map, pl_mesh_box(f->scene->meshes[walk->mesh]))
                     : pl_shape_box(pl_shape_of(walk->shape), walk->arguments, map.m);
    if (!pl_box_is_empty(&box) && !pl_box_is_finite(&box)) box = pl_box_everything();
    return put(f, &box, NULL, 0);
}

static bool fill(filling *f)
{
    pl_affine identity = pl_affine_identity();
    memcpy(f->walk.at.payload, identity.m, sizeof identity.m);
    for (;;) {
        bool ok = true;
        switch (pl_walk_next(&f->walk, f->error)) {
        case PL_EVENT_ERROR: return false;
        case PL_EVENT_END: return true;
        case PL_EVENT_NODE: {
            uint8_t kind = f->scene->program->nodes[f->walk.node].kind;
            if (kind == PL_NODE_SYMBOL) ok = reach_symbol(f);
            else if (kind == PL_NODE_UNION) ok = reach_union(f);
            break;
        }
        case PL_EVENT_TRANSFORM: ok = reach_transform(f); break;
        case PL_EVENT_PRIMITIVE:
        case PL_EVENT_MESH: ok = reach_leaf(f); break;
        case PL_EVENT_TEXTURE:
        case PL_EVENT_ENTER: break;
        }
        if (!ok) return false;
    }
}

/* --- before and after --- */

/* The depth down to which there are at most MOST_INSTANCES instances of symbols, counted level by level. */
static bool find_depth_limit(filling *f)
{
    const pl_states *states = &f->scene->states;
    uint64_t *counts = calloc(2 * (size_t)states->count, sizeof *counts), all = 0;
    uint32_t *active = malloc(2 * (size_t)states->count * sizeof *active), active_count = 1, level = 0;
    bool ok = counts && active;
    if (ok) counts[0] = 1, active[0] = 0;
    for (; ok && active_count && all <= MOST_INSTANCES; level++) {
        uint64_t *here = counts + level % 2 * states->count, *below = counts + (level + 1) % 2 * states->count;
        uint32_t *reached = active + (level + 1) % 2 * states->count, reached_count = 0;
        for (uint32_t i = 0; i < active_count; i++) {
            uint32_t index = active[level % 2 * states->count + i];
            const pl_state *state = &states->list[index];
            for (uint32_t k = 0; k < state->item_count; k++) {
                uint32_t what = state->items[k].what;
                if (state->items[k].kind != PL_NODE_ENTER) continue;
                if (below[what] == 0) reached[reached_count++] = what;
                below[what] = pl_add_saturating(below[what], here[index]);
                all = pl_add_saturating(all, here[index]);
            }
            here[index] = 0;
        }
        active_count = reached_count;
    }
    f->depth_limit = all <= MOST_INSTANCES ? UINT32_MAX : level > 2 ? level - 2 : 0;
    free(counts);
    free(active);
    return ok || pl_fail_memory(f->error, "building the grid");
}

/* Lays the grid around the scene, with some height around a flat one. There is none where the squares of distances
 * would leave the range of numbers. */
static void lay_out(const pl_scene *scene, pl_grid *grid)
{
    const pl_box *box = &scene->states.list[0].bounds->box;
    double widest = 0.0;
    if (pl_box_is_empty(box) || !pl_box_is_finite(box)) return;
    for (int axis = 0; axis < 3; axis++) widest = fmax(widest, box->hi[axis] - box->lo[axis]);
    widest = fmax(widest, 1e-9 * pl_box_reach(box));
    if (!(widest > 1e-150 && widest < 1e150)) return;
    double pad = 1e-3 * widest;
    grid->margin = 0.5 * pad;
    for (int axis = 0; axis < 3; axis++) {
        uint32_t wanted = scene->options.grid[axis];
        grid->size[axis] = wanted ? wanted : axis == 2 ? USUAL_HEIGHT : USUAL_SIZE;
        grid->lo[axis] = box->lo[axis] - pad;
        grid->step[axis] = (box->hi[axis] - box->lo[axis] + 2.0 * pad) / grid->size[axis];
        grid->margin = fmin(grid->margin, grid->step[axis] / 64.0);
    }
}

static void *keep_bytes(filling *f, const void *data, size_t bytes)
{
    void *place = pl_states_allocate((pl_states *)&f->scene->states, bytes ? bytes : 1, f->error);
    if (place && bytes) memcpy(place, data, bytes);
    return place;
}

/* The links of a chain from the innermost outward, up to one that is kept already; *innermost is NULL without links. */
static bool keep_chain(filling *f, uint32_t link, const pl_grid_link **innermost)
{
    const pl_grid_link **place = innermost;
    *innermost = NULL;
    while (link != PL_GRID_NOTHING) {
        draft_link *d = (draft_link *)f->links.data + link;
        if (d->kept) {
            *place = d->kept;
            return true;
        }
        pl_grid_link fresh = {d->constant, NULL};
        const pl_transform *computed = (const pl_transform *)f->computed.data + d->computed;
        if (!fresh.transform && !(fresh.transform = keep_bytes(f, computed, sizeof *computed))) return false;
        pl_grid_link *kept = keep_bytes(f, &fresh, sizeof fresh);
        if (!kept) return false;
        d->kept = *place = kept;
        place = &kept->parent;
        link = d->parent;
    }
    return true;
}

/* Moves what voxels still refer to into the states' memory; entries that were replaced are left behind. */
static bool keep(filling *f)
{
    pl_grid *grid = f->grid;
    size_t voxels = (size_t)grid->size[0] * grid->size[1] * grid->size[2];
    draft *drafts = f->states.data;
    for (size_t i = 0; i < voxels; i++) {
        if (f->voxels[i] == PL_GRID_NOTHING) continue;
        draft *d = &drafts[f->voxels[i]];
        if (d->place == PL_GRID_NOTHING) d->place = grid->state_count++;
        f->voxels[i] = d->place;
    }
    pl_states *states = (pl_states *)&f->scene->states;
    pl_grid_state *kept = pl_states_allocate(states, ((size_t)grid->state_count + 1) * sizeof *kept, f->error);
    grid->voxels = keep_bytes(f, f->voxels, voxels * sizeof *f->voxels);
    grid->states = kept;
    if (!kept || !grid->voxels) return false;
    for (size_t i = 0; i < f->states.count; i++) {
        const draft *d = &drafts[i];
        if (d->place == PL_GRID_NOTHING) continue;
        pl_grid_state *state = &kept[d->place];
        *state = d->state;
        state->words = keep_bytes(f, (uint64_t *)f->words.data + d->word_first, d->word_count * sizeof(uint64_t));
        state->terms = keep_bytes(f, (uint32_t *)f->terms.data + d->term_first, state->term_count * sizeof(uint32_t));
        if (!state->words || !state->terms || !keep_chain(f, d->link, &state->link)) return false;
        if (state->link_count > grid->longest) grid->longest = state->link_count;
    }
    return true;
}

bool pl_grid_build(pl_scene *scene, pl_error *error)
{
    pl_grid *grid = pl_states_allocate(&scene->states, sizeof *grid, error);
    scene->structure = grid;
    if (!grid) return false;
    memset(grid, 0, sizeof *grid);
    lay_out(scene, grid);
    if (grid->size[0] == 0) return true;

    filling f = {.scene = scene, .grid = grid, .error = error, .limit = scene->states.limit};
    f.levels.element = sizeof(level);
    f.junctions.element = sizeof(junction);
    f.scopes.element = f.words.element = sizeof(uint64_t);
    f.states.element = sizeof(draft);
    f.links.element = sizeof(draft_link);
    f.computed.element = sizeof(pl_transform);
    f.terms.element = sizeof(uint32_t);
    size_t voxels = (size_t)grid->size[0] * grid->size[1] * grid->size[2];
    f.voxels = malloc(voxels * sizeof *f.voxels);
    bool ok = pl_walk_begin(&f.walk, scene->program, 0, NULL, error);
    if (!f.voxels) ok = pl_fail_memory(error, "building the grid");
    if (ok) memset(f.voxels, 0xFF, voxels * sizeof *f.voxels);
    f.walk.announce = true;
    ok = ok && find_depth_limit(&f) && fill(&f) && keep(&f);
    pl_walk_end(&f.walk);
    array *arrays[] = {&f.levels, &f.junctions, &f.scopes, &f.states, &f.links, &f.computed, &f.words, &f.terms};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]->data);
    free(f.voxels);
    return ok;
}
