/* front_hull.c - tight boxes of the instances in fronts (front.h).
 *
 * A box that stands turned in another is loose: a ray enters a fifth more instances of a forest's branches than it need. A
 * convex hull (hull.h) is turned with what is in it. Hulls of states are made from those of their items, bottom up, once
 * for all instances; an instance's box is then six supports.
 *
 *     pl_front_hulls *hulls = pl_front_hulls_create(plan);
 *     box = pl_front_instance_box(hulls, states, item, &to_parent);
 *
 * Hulls are large, so one that only made others goes as soon as these are made. */
#include "front.h"

#include <stdlib.h>

#include "../hull.h"

/* Boxes of so many primitives are computed from these, and exact. */
enum { FEW = 12 };

struct pl_front_hulls {
    uint32_t alive;
    pl_hull *of[]; /* by state; NULL: not known */
};

size_t pl_front_hulls_bytes(const pl_states *states)
{
    const size_t count = states->count < PL_FRONT_MOST_HULLS ? states->count : PL_FRONT_MOST_HULLS;
    return count * sizeof(pl_hull) + states->count * (sizeof(pl_hull *) + sizeof(uint32_t));
}

static bool has_hull(const pl_states *states, uint32_t state)
{
    const pl_state *it = &states->list[state];
    return !it->endless && !pl_box_is_empty(&it->bounds->box) && pl_box_is_finite(&it->bounds->box);
}

/* How many items' hulls are made from each state's: of states with fronts and of what is below them. */
static void count_users(const pl_front_plan *plan, uint32_t *users)
{
    const pl_states *states = plan->compositions->states;
    for (uint32_t i = 1; i < states->count; i++) {
        const uint32_t index = plan->order[i];
        const pl_state *state = &states->list[index];
        if (!(plan->visits[index] > 0.0 || users[index])) continue;
        for (uint32_t k = 0; k < state->item_count; k++) {
            if (state->items[k].kind == PL_NODE_ENTER) users[state->items[k].what]++;
        }
    }
}

/* The hull of an item in its own frame. false: nothing is there, or (*known) it isn't known. */
static bool find_part(const pl_front_hulls *hulls, const pl_states *states, const pl_item *item, pl_hull *part, bool *known)
{
    if (item->kind == PL_NODE_MESH) {
        *part = pl_hull_of_box(pl_mesh_box(states->meshes[item->what]));
    } else if (item->kind == PL_NODE_PRIMITIVE) {
        const pl_shape *shape = pl_shape_of(item->what);
        if (!shape->support) return false;
        *part = pl_hull_of_shape(shape, item->arguments);
    } else {
        const pl_state *state = &states->list[item->what];
        if (state->primitives == 0 || pl_box_is_empty(&state->bounds->box)) return false;
        *known = *known && hulls->of[item->what];
        if (!*known) return false;
        *part = *hulls->of[item->what];
    }
    return true;
}

static void make_hull(pl_front_hulls *hulls, const pl_front_plan *plan, uint32_t index)
{
    const pl_states *states = plan->compositions->states;
    const pl_state *state = &states->list[index];
    const pl_composition *first = plan->compositions->list + plan->compositions->first[index];
    pl_hull part, *hull = hulls->alive < PL_FRONT_MOST_HULLS && has_hull(states, index) ? malloc(sizeof *hull) : NULL;
    if (!hull) return;
    bool known = true;
    *hull = pl_hull_empty();
    for (uint32_t k = 0; k < state->item_count && known; k++) {
        if (!find_part(hulls, states, &state->items[k], &part, &known)) continue;
        pl_hull_through(&first[k].to_parent, &part);
        pl_hull_join(hull, &part);
    }
    if (known) hulls->alive++;
    else free(hull);
    hulls->of[index] = known ? hull : NULL;
}

static void drop(pl_front_hulls *hulls, uint32_t state)
{
    hulls->alive -= hulls->of[state] != NULL;
    free(hulls->of[state]);
    hulls->of[state] = NULL;
}

pl_front_hulls *pl_front_hulls_create(const pl_front_plan *plan)
{
    const pl_states *states = plan->compositions->states;
    pl_front_hulls *hulls = calloc(1, sizeof *hulls + states->count * sizeof *hulls->of);
    uint32_t *users = calloc(states->count, sizeof *users);
    if (hulls && users) count_users(plan, users);
    for (uint32_t i = states->count; hulls && users && i-- > 1;) {
        const uint32_t index = plan->order[i];
        const pl_state *state = &states->list[index];
        if (!(plan->visits[index] > 0.0 || users[index])) continue;
        make_hull(hulls, plan, index);
        for (uint32_t k = 0; k < state->item_count; k++) {
            const uint32_t below = state->items[k].what;
            if (state->items[k].kind != PL_NODE_ENTER || --users[below] > 0 || plan->visits[below] > 0.0) continue;
            drop(hulls, below);
        }
    }
    free(users);
    return hulls;
}

void pl_front_hulls_free(pl_front_hulls *hulls, uint32_t states)
{
    for (uint32_t i = 0; hulls && i < states; i++) free(hulls->of[i]);
    free(hulls);
}

pl_box pl_front_instance_box(const pl_front_hulls *hulls, const pl_states *states, const pl_item *item, const pl_affine *to_parent)
{
    /* Where there are cut-offs the whole box may be drawn (cut.h). */
    if (states->cuts) return pl_box_map(to_parent, &states->list[item->what].bounds->box);
    if (hulls && hulls->of[item->what] && states->list[item->what].primitives > FEW) {
        const pl_box box = pl_hull_box_under(to_parent, hulls->of[item->what]);
        if (pl_box_is_finite(&box)) return box;
    }
    return pl_box_under(states, item, to_parent);
}
