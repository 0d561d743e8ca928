/* bvh_legs.c - what a surface needs of the way through a front, found once for many hits.
 *
 *     pl_bvh_legs_of(tracer, &hit->trail, legs)    → of each term of the trail: textures, symbols, maps of normals
 *
 * Neighbouring hits share most of their way from the scene to the leaf. A leg is known by its front and its reference there;
 * the last few hundred are kept. Translations leave normals alone and aren't listed: in a sponge these are most. */
#include <stdlib.h>
#include <string.h>

#include "bvh.h"

enum {
    KEPT = 512,  /* a power of two */
    MAPS = 2048, /* of all legs … */
    ROOM = 256   /* … and at least of those of one trail */
};

typedef struct pl_bvh_legs {
    uint64_t keys[KEPT]; /* 0: none yet */
    pl_leg list[KEPT];
    const pl_transform *maps[MAPS];
    uint32_t used; /* of maps */
} pl_bvh_legs;

pl_bvh_legs *pl_bvh_legs_create(void)
{
    return calloc(1, sizeof(pl_bvh_legs));
}

/* Joins an item of a leg that lies above those joined before. false: a texture has code, or there is no room. */
static bool join_item(pl_bvh_legs *legs, pl_leg *leg, const pl_item *item)
{
    if (item->site->texture_code) return false;
    if (leg->rule < 0) leg->rule = item->site->rule;
    if (item->kind == PL_NODE_ENTER && leg->entered++ == 0) leg->state = item->what;
    if (item->site->texture >= 0 && !leg->texture) leg->texture = item->site;
    for (uint32_t i = item->transform_count; i-- > 0;) {
        if (item->transforms[i]->form == PL_FORM_TRANSLATION) continue;
        if (legs->used == MAPS) return false;
        legs->maps[legs->used++] = item->transforms[i];
        leg->mild = leg->mild && item->transforms[i]->mild;
    }
    return true;
}

static void make_leg(pl_bvh_legs *legs, const pl_states *states, const pl_front *front, pl_ref ref, pl_leg *leg)
{
    const bool enters = ref >> PL_REF_SHIFT == PL_KIND_INSTANCE;
    const uint32_t index = ref & PL_REF_INDEX, begin = legs->used;
    const uint32_t item = enters ? front->places[index].item : front->primitives[index].item;
    uint32_t at = enters ? front->places[index].opened : front->primitives[index].opened;
    const pl_item *last = pl_front_item(states, item), *leaf = enters ? last : pl_front_leaf(states, last);
    *leg = (pl_leg){.last = leaf, .rule = -1, .state = UINT32_MAX, .mild = true, .maps = legs->maps + begin};
    bool known = join_item(legs, leg, leaf) && (leaf == last || join_item(legs, leg, last));
    for (; known && at; at = front->opened[at].parent)
        known = join_item(legs, leg, pl_front_item(states, front->opened[at].item));
    leg->map_count = legs->used - begin;
    if (!known) leg->last = NULL;
}

bool pl_bvh_legs_of(pl_tracer *tracer, const pl_path *trail, pl_leg *found)
{
    pl_bvh_legs *legs = ((const pl_bvh_work *)tracer->work)->legs;
    const pl_front *list = ((const pl_fronts *)tracer->scene->structure)->list, *front = list;
    if (legs->used > MAPS - ROOM) {
        memset(legs->keys, 0, sizeof legs->keys);
        legs->used = 0;
    }
    for (uint32_t i = 0; i < trail->length; i++) {
        const bool enters = i + 1 < trail->length;
        const pl_ref ref = enters ? pl_ref_of(PL_KIND_INSTANCE, trail->terms[i]) : trail->terms[i];
        const uint64_t key = (uint64_t)(front - list + 1) << 32 | ref;
        const unsigned slot = (key * UINT64_C(0x9E3779B97F4A7C15)) >> 32 & (KEPT - 1);
        if (legs->keys[slot] != key) make_leg(legs, &tracer->scene->states, front, ref, &legs->list[slot]);
        legs->keys[slot] = key;
        found[i] = legs->list[slot];
        if (!found[i].last) return false;
        if (enters) front = &list[front->instances[trail->terms[i]].front & ~PL_NO_SHADOW];
    }
    return true;
}
