/* gated_build.c - which rungs there are, under the budget, and what their gates ask for (gated.h).
 *
 * The last rungs, of K = 1, are those of all states that items lead to. Larger ones cost memory, so they are made only of the
 * states that the largest fronts lead to, from the scene's own on: where a ray has come to a state between those, it
 * goes on by single items until it meets the next of them. Nor are there any of states that occur so small that gates within
 * them are closed in a picture of the whole scene. */
#include "gated.h"

#include <stdlib.h>
#include <string.h>

#include "../error.h"

enum { LARGEST_ITEMS = 1024, LEAST_ITEMS = 4, RATIO = 4, DEFAULT_BYTES = 280 << 10 };

/* Gates within a front are a few times smaller than its state: so many times what a thousandth of the scene takes, at one pixel
 * of detail, a state must be large to have fronts. */
#define WORTHY (2.0 / 1000.0)

/* So many rounds find how large all states occur, unless chains of them are very long. */
enum { MOST_ROUNDS = 64 };

/* So much larger gates are worth a rung. */
#define BETTER 1.1

/* A front's share of nodes an item. */
#define NODE_BYTES_AN_ITEM (sizeof(pl_front_node) / 5.0)

typedef struct building {
    pl_scene *scene;
    pl_gated *gated;
    pl_compositions *compositions;
    const bool *worthy; /* which states may have large fronts */
    size_t fixed;       /* bytes that don't depend on rungs */
    pl_error *error;
} building;

/* --- boxes within boxes --- */

/* How far out of a box another may stand that still lies within it, of its diameter: less than the room of spans. */
#define NEARLY 0x1p-32

static bool is_within(const pl_box *inner, const pl_state *outer)
{
    const double tolerance = NEARLY * outer->bounds->diameter;
    for (int axis = 0; axis < 3; axis++)
        if (!(inner->lo[axis] >= outer->bounds->box.lo[axis] - tolerance && inner->hi[axis] <= outer->bounds->box.hi[axis] + tolerance))
            return false;
    return true;
}

/* Whether what an item enters has its box within its state's: also as widened by the slacks of both (reach.h), so that the
 * span of the outer one, which has room for four times its slack, never ends within the inner one. */
static bool is_nested(const pl_states *states, const pl_state *state, const pl_item *item)
{
    if (item->kind != PL_NODE_ENTER) return true;
    const pl_state *below = &states->list[item->what];
    pl_affine to_parent = pl_affine_identity(), to_object = pl_affine_identity();
    for (uint32_t i = 0; i < item->transform_count; i++) {
        to_parent = pl_affine_multiply(&to_parent, &item->transforms[i]->to_parent);
        to_object = pl_affine_multiply(&item->transforms[i]->to_object, &to_object);
    }
    pl_box box = pl_box_map(&to_parent, &below->bounds->box);
    if (!is_within(&box, state)) return false;
    const double m = pl_largest_stretch(&to_parent), n = pl_largest_stretch(&to_object);
    const double *move = to_object.m;
    const double offset = sqrt(move[3] * move[3] + move[7] * move[7] + move[11] * move[11]);
    const pl_reach *inner = &below->bounds->gate, *outer = &state->bounds->gate;
    return m * n * inner->gain <= 3.0 * outer->gain && m * (inner->gain * offset + inner->base) <= 3.0 * outer->base;
}

/* Gates of endless states allow for some roundings (endless.c), not for all that maps which bend space could magnify: then a hit
 * may lie far outside the boxes around it, which isn't one of what these hold. Where what stands below has an end, the
 * slack of its gates tells what it magnifies. */
static float bend_of(const pl_states *states, const pl_state *state, const pl_item *item)
{
    if (!state->endless) return 1.0f;
    double bend = 1.0;
    for (uint32_t i = 0; i < item->transform_count; i++)
        bend *= pl_largest_stretch(&item->transforms[i]->to_parent) * pl_largest_stretch(&item->transforms[i]->to_object);
    const pl_state *below = item->kind == PL_NODE_ENTER ? &states->list[item->what] : NULL;
    if (below && !below->endless) bend *= fmax(1.0, below->bounds->gate.gain / PL_REACH_ROUNDINGS);
    return bend < 1e30 ? (float)bend : 1e30f;
}

static bool find_nested_and_bends(building *b)
{
    const pl_states *states = &b->scene->states;
    size_t total = 0;
    for (uint32_t i = 0; i < states->count; i++) total += states->list[i].item_count;
    const bool endless = states->list[0].endless;
    uint8_t *nested = b->gated->nested = malloc(total + 1);
    float *bends = b->gated->bends = endless ? malloc((total + 1) * sizeof *bends) : NULL;
    if (!nested || (endless && !bends)) return pl_fail_memory(b->error, "building the rungs");
    b->gated->bytes += (total + 1) * (sizeof *nested + (endless ? sizeof *bends : 0));
    for (uint32_t i = 0; i < states->count; i++) {
        const pl_state *state = &states->list[i];
        b->gated->states[i].nested = nested;
        b->gated->states[i].bends = bends;
        for (uint32_t k = 0; k < state->item_count; k++) {
            *nested++ = is_nested(states, state, &state->items[k]);
            if (endless) *bends++ = bend_of(states, state, &state->items[k]);
        }
    }
    return true;
}

/* --- gates --- */

/* The |ray origin| in a state's frame, mapped on by to_object, up to which an endless state isn't cut for being a blur. */
static double farthest_of(const pl_state *state, const pl_affine *to_object)
{
    if (!state->endless) return INFINITY;
    const double *m = to_object->m;
    const double offset = sqrt(m[3] * m[3] + m[7] * m[7] + m[11] * m[11]);
    const double most = state->bounds->diameter / (PL_CUT_BLUR * DBL_EPSILON) - state->bounds->gate.base - state->bounds->gate.gain * offset;
    return 0.99 * most / (state->bounds->gate.gain * pl_largest_stretch(to_object));
}

/* A distance from the origin of a front's state, as one from the centre of its unit frame. */
static float in_unit_frame(const pl_front *front, double distance)
{
    double centre = 0.0;
    for (int axis = 0; axis < 3; axis++) centre += fabs(front->centre[axis]);
    const double unit = (distance - centre) * front->scale * (1.0 - 0x1p-20);
    return unit > 0.0 ? unit < FLT_MAX ? (float)unit : INFINITY : 0.0f;
}

static void extend(pl_gated_link *link, const pl_item *item)
{
    for (uint32_t i = 0; i < item->transform_count; i++) link->stretch *= item->transforms[i]->stretch;
    for (uint32_t i = 0; i < item->site->term_count; i++) link->power *= PL_CUT_BASE;
    link->hash = pl_cut_hash(link->hash, item->site->terms, item->site->term_count);
    link->depth++;
}

/* Of a front's opened nodes. */
typedef struct way {
    pl_gated_link link;
    pl_affine to_object;
} way;

/* What the gates inside a rung ask for, and the links of its instances. */
static bool set_gates(building *b, pl_gated_rung *rung, uint32_t opened_count)
{
    const pl_states *states = &b->scene->states;
    const pl_front *front = &rung->front;
    way *ways = malloc(opened_count * sizeof *ways);
    pl_gated_link *links = malloc((front->instance_count + 1) * sizeof *links);
    bool ok = ways && links;
    double farthest = INFINITY;
    rung->links = links;
    b->gated->bytes += (front->instance_count + 1) * sizeof *links;
    rung->least = INFINITY;
    for (uint32_t i = 0; ok && i < opened_count; i++) {
        ways[i] = i ? ways[front->opened[i].parent] : (way){{1.0, 0, 1, 0}, pl_affine_identity()};
        if (i == 0) continue;
        const pl_item *by = pl_front_item(states, front->opened[i].item);
        const pl_state *state = &states->list[by->what];
        extend(&ways[i].link, by);
        for (uint32_t k = 0; k < by->transform_count; k++)
            ways[i].to_object = pl_affine_multiply(&by->transforms[k]->to_object, &ways[i].to_object);
        if (state->unbounded) continue;
        rung->least = fmin(rung->least, state->bounds->diameter * ways[i].link.stretch);
        farthest = fmin(farthest, farthest_of(state, &ways[i].to_object));
    }
    rung->farthest = in_unit_frame(front, farthest);
    for (uint32_t i = 0; ok && i < front->instance_count; i++) {
        const pl_front_place *at = &front->places[i];
        links[i] = ways[at->opened].link;
        extend(&links[i], pl_front_item(states, at->item));
    }
    free(ways);
    return ok || pl_fail_memory(b->error, "building the rungs");
}

/* --- rungs --- */

static bool add_rung(building *b, uint32_t state, uint64_t most)
{
    pl_gated *gated = b->gated;
    if (gated->count == gated->capacity) {
        uint32_t capacity = gated->capacity ? 2 * gated->capacity : 16;
        pl_gated_rung *rungs = realloc(gated->rungs, capacity * sizeof *rungs);
        if (!rungs) return pl_fail_memory(b->error, "building the rungs");
        gated->rungs = rungs;
        gated->capacity = capacity;
    }
    pl_gated_rung *rung = &gated->rungs[gated->count++];
    const uint64_t before = gated->sums.opened;
    rung->links = NULL;
    return pl_front_make(b->scene, b->compositions, state, most, &gated->sums, &rung->front, b->error) &&
           set_gates(b, rung, (uint32_t)(gated->sums.opened - before));
}

/* Takes back the last rung. before: what there was without. */
static void drop_rung(pl_gated *gated, const pl_fronts *sums, size_t bytes)
{
    pl_gated_rung *rung = &gated->rungs[--gated->count];
    pl_front_free(&rung->front);
    free((void *)rung->links);
    gated->sums = *sums;
    gated->bytes = bytes;
}

/* Whether rays hardly ever may enter a rung where they mayn't enter the larger one: its gates are about as small. */
static bool is_no_better(const pl_gated_rung *rung, const pl_gated_rung *larger)
{
    return rung->least < BETTER * larger->least && rung->farthest < BETTER * larger->farthest;
}

/* The rungs of a state, the largest first. Those that hold no more than the next, or are no better than the one before, are
 * left out. */
static bool add_rungs(building *b, uint32_t index, uint64_t most)
{
    pl_gated *gated = b->gated;
    pl_gated_state *state = &gated->states[index];
    const pl_state *it = &b->scene->states.list[index];
    const pl_affine identity = pl_affine_identity();
    state->first = b->gated->count;
    state->diameter = it->bounds->diameter;
    state->unbounded = it->unbounded;
    for (; most >= LEAST_ITEMS && most > it->item_count; most /= RATIO) {
        const pl_fronts sums = gated->sums;
        const size_t bytes = gated->bytes;
        if (!add_rung(b, index, most)) return false;
        const pl_gated_rung *last = &gated->rungs[gated->count - 1];
        if (gated->count > state->first + 1 && is_no_better(last, last - 1)) drop_rung(gated, &sums, bytes);
    }
    if (!add_rung(b, index, 0)) return false;
    state->count = b->gated->count - state->first;
    const pl_gated_rung *first = &b->gated->rungs[state->first];
    state->farthest = in_unit_frame(&first->front, farthest_of(it, &identity));
    state->least = state->unbounded ? first->least : fmin(first->least, state->diameter);
    state->farthest_inside = fminf(first->farthest, state->farthest);
    return true;
}

/* --- the budget --- */

/* How large each state occurs in the scene at most, of its own size: the product of stretches. Cycles shrink. */
static bool find_stretches(const building *b, double *stretch)
{
    const pl_states *states = &b->scene->states;
    bool grew = true;
    stretch[0] = 1.0;
    for (uint32_t round = 0; grew && round < MOST_ROUNDS; round++) {
        grew = false;
        for (uint32_t i = 0; i < states->count; i++)
            for (uint32_t k = 0; k < states->list[i].item_count; k++) {
                const pl_item *item = &states->list[i].items[k];
                if (item->kind != PL_NODE_ENTER) continue;
                double found = stretch[i];
                for (uint32_t t = 0; t < item->transform_count; t++) found *= item->transforms[t]->stretch;
                if (!(found > stretch[item->what] * (1.0 + 0x1p-20))) continue;
                stretch[item->what] = found;
                grew = true;
            }
    }
    return !grew;
}

/* The states that are large enough for fronts: in a picture that shows the whole scene, gates within them may be open. */
static bool *find_worthy(const building *b)
{
    const pl_states *states = &b->scene->states;
    const double least = WORTHY * b->scene->detail * states->list[0].bounds->diameter;
    double *stretch = calloc(states->count, sizeof *stretch);
    bool *worthy = calloc(states->count, sizeof *worthy);
    if (stretch && worthy) {
        const bool known = find_stretches(b, stretch);
        for (uint32_t i = 0; i < states->count; i++)
            worthy[i] = !known || states->list[i].unbounded || !(stretch[i] * states->list[i].bounds->diameter < least);
    } else {
        free(worthy);
        worthy = NULL;
    }
    free(stretch);
    return worthy;
}

/* Marks in `large` the worthy states that fronts of `most` items lead to, from the scene's on; *bytes: what
 * those fronts take at least. */
static bool follow(const building *b, uint64_t most, bool *large, double *bytes)
{
    pl_state_list reached = {0};
    size_t done = 0;
    uint32_t state = 0;
    bool ok = true;
    memset(large, 0, b->scene->states.count * sizeof *large);
    *bytes = 0.0;
    for (; ok; state = reached.list[done++]) {
        if (!large[state] && b->worthy[state]) {
            pl_front_counts counts;
            large[state] = true;
            ok = pl_front_count(b->compositions, state, most, &counts, &reached, b->error);
            *bytes += sizeof(pl_gated_rung) + (double)counts.primitives * sizeof(pl_front_primitive) +
                      (double)counts.instances * (pl_front_instance_bytes(false) + sizeof(pl_gated_link)) +
                      (double)counts.opened * sizeof(pl_opened) +
                      (double)(counts.primitives + counts.instances) * NODE_BYTES_AN_ITEM;
        }
        if (done == reached.count) break;
    }
    free(reached.list);
    return ok;
}

/* What the last rungs take. */
static double least_bytes(const pl_states *states)
{
    double bytes = states->count * (double)(sizeof(pl_gated_state) + sizeof(pl_gated_rung) + sizeof(pl_front_node));
    for (uint32_t i = 0; i < states->count; i++)
        bytes += states->list[i].item_count * (pl_front_instance_bytes(true) + sizeof(pl_gated_link) + NODE_BYTES_AN_ITEM);
    return bytes;
}

/* What may be taken beside the states. */
static double budget_of(const pl_scene *scene)
{
    const double used = (double)scene->states.bytes;
    if (scene->options.memory) return (double)scene->options.memory - used;
    /* What has no end looks alike at every scale: small fronts do for it. */
    return scene->states.list[0].endless ? 4.0 * used : fmax(DEFAULT_BYTES - used, used);
}

/* Builds all rungs, in the place of others. */
static bool build_rungs(building *b, const bool *large, uint64_t most)
{
    pl_gated *gated = b->gated;
    while (gated->count) {
        pl_gated_rung *rung = &gated->rungs[--gated->count];
        pl_front_free(&rung->front);
        free((void *)rung->links);
    }
    gated->bytes = b->fixed;
    gated->sums = (pl_fronts){.limit_items = most};
    for (uint32_t i = 0; i < b->scene->states.count; i++)
        if (!add_rungs(b, i, large[i] ? most : 0)) return false;
    return true;
}

/* The largest K whose rungs fit. large: working memory. */
static bool choose_rungs(building *b, bool *large)
{
    const pl_options *options = &b->scene->options;
    const double budget = budget_of(b->scene), least = least_bytes(&b->scene->states);
    uint64_t most = options->front_items > LARGEST_ITEMS ? LARGEST_ITEMS : options->front_items;
    double bytes;
    if (most) return follow(b, most, large, &bytes) && build_rungs(b, large, most);
    if (options->memory && least > budget)
        return pl_fail_allowed(b->error, (double)b->scene->states.bytes + least, (double)options->memory);
    for (most = LARGEST_ITEMS; most >= LEAST_ITEMS; most /= 2) {
        if (!follow(b, most, large, &bytes)) return false;
        if (bytes > budget) continue;
        if (!build_rungs(b, large, most)) return false;
        const pl_gated *gated = b->gated;
        const size_t taken = gated->sums.node_bytes + gated->sums.item_bytes + gated->bytes + gated->count * sizeof *gated->rungs;
        if ((double)taken <= budget) return true;
    }
    memset(large, 0, b->scene->states.count * sizeof *large);
    return build_rungs(b, large, 0);
}

bool pl_gated_build(pl_scene *scene, pl_error *error)
{
    const uint32_t count = scene->states.count;
    pl_gated *gated = calloc(1, sizeof *gated);
    building b = {.scene = scene, .gated = gated, .compositions = pl_compositions_create(&scene->states, error), .error = error};
    bool *large = calloc(count, sizeof *large), ok = b.compositions != NULL;
    scene->structure = gated;
    if (ok && (!gated || !large || !(gated->states = calloc(count, sizeof *gated->states)) || !(b.worthy = find_worthy(&b))))
        ok = pl_fail_memory(error, "building the rungs");
    ok = ok && find_nested_and_bends(&b);
    if (ok) b.fixed = gated->bytes + sizeof *gated + count * sizeof *gated->states;
    ok = ok && choose_rungs(&b, large);
    pl_compositions_free(b.compositions);
    free(large);
    free((void *)b.worthy);
    if (!ok) return false;
    pl_gated_rung *exact = realloc(gated->rungs, gated->count * sizeof *exact);
    if (exact) gated->rungs = exact, gated->capacity = gated->count;
    gated->bytes += gated->capacity * sizeof *gated->rungs;
    return true;
}

void pl_gated_destroy(pl_scene *scene)
{
    pl_gated *gated = scene->structure;
    scene->structure = NULL;
    if (!gated) return;
    for (uint32_t i = 0; i < gated->count; i++) {
        pl_front_free(&gated->rungs[i].front);
        free((void *)gated->rungs[i].links);
    }
    free(gated->rungs);
    free(gated->states);
    free(gated->nested);
    free(gated->bends);
    free(gated);
}

void pl_gated_count(const pl_scene *scene, pl_statistics *counts)
{
    const pl_gated *gated = scene->structure;
    counts->front_count = gated->count;
    counts->front_items = gated->sums.items;
    counts->front_instances = gated->sums.instances;
    counts->front_limit = gated->sums.limit_items ? gated->sums.limit_items : 1;
    counts->bytes_nodes = gated->sums.node_bytes;
    counts->bytes_items = gated->sums.item_bytes + gated->bytes;
    counts->isa = scene->isa;
}
