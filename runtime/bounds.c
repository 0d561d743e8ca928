/* bounds.c - boxes of items and states, and finding a primitive's index from its path (state.h). */
#include "state.h"

/* Items that a box may be computed from, instead of from the box of their state. */
enum { OPENED_ITEMS = 24 };

bool pl_item_unbounded(const pl_states *states, const pl_item *item)
{
    if (item->kind == PL_NODE_ENTER) return states->list[item->what].unbounded;
    return item->kind == PL_NODE_PRIMITIVE && !pl_shape_of(item->what)->support;
}

uint64_t pl_item_primitives(const pl_states *states, const pl_item *item)
{
    return item->kind == PL_NODE_ENTER ? states->list[item->what].primitives : 1;
}

pl_box pl_box_map(const pl_affine *map, const pl_box *box)
{
    pl_box out;
    if (pl_box_is_empty(box)) return pl_box_empty();
    for (int r = 0; r < 3; r++) {
        const double *row = map->m + 4 * r;
        out.lo[r] = out.hi[r] = row[3];
        for (int c = 0; c < 3; c++) {
            double a = row[c] * box->lo[c], b = row[c] * box->hi[c];
            out.lo[r] += a < b ? a : b;
            out.hi[r] += a < b ? b : a;
        }
    }
    return out;
}

static bool has_nan(const pl_box *box)
{
    for (int axis = 0; axis < 3; axis++)
        if (isnan(box->lo[axis]) || isnan(box->hi[axis])) return true;
    return false;
}

static pl_affine compose(const pl_affine *outer, const pl_item *item)
{
    pl_affine map = *outer;
    for (uint32_t i = 0; i < item->transform_count; i++)
        map = pl_affine_multiply(&map, &item->transforms[i]->to_parent);
    return map;
}

/* The box of an item's bounded primitives under `map`. The box of a box is loose where frames are turned against each
 * other, so states are opened breadth first until OPENED_ITEMS stand in the queue. */
pl_box pl_box_under(const pl_states *states, const pl_item *item, const pl_affine *map)
{
    struct {
        const pl_item *item;
        pl_affine map;
    } queue[OPENED_ITEMS];
    pl_box box = pl_box_empty();
    int head = 0, tail = 1;
    queue[0].item = item;
    queue[0].map = *map;
    while (head < tail) {
        const pl_item *it = queue[head].item;
        pl_affine at = queue[head++].map;
        pl_box part;
        if (it->kind == PL_NODE_PRIMITIVE) {
            if (!pl_shape_of(it->what)->support) continue;
            part = pl_shape_box(pl_shape_of(it->what), it->arguments, at.m);
        } else if (it->kind == PL_NODE_MESH) {
            part = pl_box_map(&at, pl_mesh_box(states->meshes[it->what]));
        } else {
            const pl_state *state = &states->list[it->what];
            if (tail + (int64_t)state->item_count <= OPENED_ITEMS) {
                for (uint32_t i = 0; i < state->item_count; i++) {
                    queue[tail].item = &state->items[i];
                    queue[tail++].map = compose(&at, &state->items[i]);
                }
                continue;
            }
            part = pl_box_map(&at, &state->bounds->box);
        }
        /* A composed map may overflow where the normative chain of mapped rays doesn't: no bounds are known then. */
        if (has_nan(&part)) return pl_box_everything();
        pl_box_join(&box, &part);
    }
    return box;
}

pl_reach pl_item_reach(const pl_states *states, const pl_item *item)
{
    if (item->kind == PL_NODE_ENTER) return states->list[item->what].bounds->gate;
    pl_box box = item->kind == PL_NODE_MESH ? *pl_mesh_box(states->meshes[item->what])
                                            : pl_shape_box(pl_shape_of(item->what), item->arguments, NULL);
    return pl_reach_leaf(pl_box_is_finite(&box) ? 1.7320508075688774 * pl_box_reach(&box) : 0.0);
}

static pl_affine item_map(const pl_states *states, const pl_item *item, pl_reach *reach)
{
    pl_affine identity = pl_affine_identity();
    *reach = pl_item_reach(states, item);
    for (uint32_t i = item->transform_count; i-- > 0;) *reach = pl_reach_through(item->transforms[i], reach);
    return compose(&identity, item);
}

pl_box pl_item_box_tight(const pl_states *states, const pl_item *item, pl_reach *reach)
{
    pl_affine map = item_map(states, item, reach);
    return pl_box_under(states, item, &map);
}

pl_box pl_item_box(const pl_states *states, const pl_item *item, pl_reach *reach)
{
    if (!states->cuts || item->kind != PL_NODE_ENTER) return pl_item_box_tight(states, item, reach);
    pl_affine map = item_map(states, item, reach);
    pl_box box = pl_box_map(&map, &states->list[item->what].bounds->box);
    return has_nan(&box) ? pl_box_everything() : box;
}

/* The item of a state whose terms stand at path[at …]; items are in path order. */
static const pl_item *find_item(const pl_state *state, const pl_path *path, uint32_t at)
{
    uint32_t lo = 0, hi = state->item_count;
    while (lo < hi) {
        uint32_t middle = lo + (hi - lo) / 2;
        const pl_item *item = &state->items[middle];
        int order = 0;
        for (uint32_t i = 0; i < item->site->term_count && order == 0; i++) {
            if (at + i >= path->length) return NULL;
            uint32_t mine = item->site->terms[i], wanted = path->terms[at + i];
            order = (mine > wanted) - (mine < wanted);
        }
        if (order == 0) return item;
        if (order < 0) lo = middle + 1;
        else hi = middle;
    }
    return NULL;
}

uint64_t pl_states_locate(const pl_states *states, const pl_path *path, uint32_t depth)
{
    const pl_state *state = &states->list[0];
    uint64_t primitive = 0;
    uint32_t at = 0;
    for (uint32_t entered = 1;; entered++) {
        const pl_item *item = find_item(state, path, at);
        if (!item) return UINT64_MAX;
        primitive = pl_add_saturating(primitive, item->first);
        at += item->site->term_count;
        if (item->kind != PL_NODE_ENTER || entered == depth) return primitive;
        state = &states->list[item->what];
    }
}
