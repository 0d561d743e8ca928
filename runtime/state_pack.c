/* state_pack.c - states once they are only traced: one block of memory, without what building needed (state.h).
 *
 *     forest of 10,000 trees: 4.4 MB of states -> 1.2 MB
 *
 * Sites and lists of constant transformations are the same in many items, and are kept once. Where things are placed that
 * occur once, as a forest's trees, transformations are packed: a turn about an axis is 40 bytes instead of 104. The block
 * is laid out twice in the same order: for its size, then for good. */
#include "state.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "error.h"
#include "random.h"

/* Of a transformation that is only traced through. */
#define TRACED_BYTES offsetof(pl_transform, to_parent)

/* A list that may stand in the block already. */
typedef struct shared {
    const void *data; /* NULL: free */
    size_t bytes, offset;
} shared;

typedef struct packer {
    const pl_states *states;
    unsigned char *memory; /* NULL: only the size is wanted */
    bool *once;            /* states that occur once in the scene: few rays come to each */
    size_t used;
    shared *table;
    size_t table_size;
} packer;

/* Room for so many bytes: its offset. */
static size_t take(packer *p, size_t bytes)
{
    size_t offset = p->used;
    p->used += (bytes + 7) & ~(size_t)7;
    return offset;
}

static size_t put(packer *p, const void *data, size_t bytes)
{
    size_t offset = take(p, bytes);
    if (p->memory && bytes) memcpy(p->memory + offset, data, bytes);
    return offset;
}

/* The same for a list that others may have too. */
static size_t put_shared(packer *p, const void *data, size_t bytes)
{
    uint64_t hash = bytes;
    for (size_t i = 0; i < bytes; i += sizeof(uint32_t)) {
        uint32_t word;
        memcpy(&word, (const char *)data + i, sizeof word);
        hash = pl_mix(hash, word);
    }
    shared *at = &p->table[hash & (p->table_size - 1)];
    while (at->data && (at->bytes != bytes || memcmp(at->data, data, bytes) != 0))
        at = at + 1 < p->table + p->table_size ? at + 1 : p->table;
    if (!at->data) *at = (shared){data, bytes, put(p, data, bytes)};
    return at->offset;
}

static bool is_constant(const packer *p, const pl_transform *transform)
{
    const pl_program *program = p->states->program;
    return transform >= program->transforms && transform < program->transforms + program->transform_count;
}

/* The number of a size among those that are known, where it is added; PL_PACKED_SIZES: they are too many. */
static unsigned find_size(double sizes[PL_PACKED_SIZES], unsigned *count, double size)
{
    unsigned i = 0;
    while (i < *count && sizes[i] != size) i++;
    if (i == *count && i < PL_PACKED_SIZES) sizes[(*count)++] = size;
    return i;
}

/* Writes a general map of few different numbers as a packed one (program.h). 0: it isn't one; else its bytes. */
static size_t pack_transform(const pl_transform *transform, pl_transform *packed)
{
    if (transform->form != PL_FORM_GENERAL) return 0;
    uint64_t codes = 0;
    unsigned count = 0;
    for (int i = 0; i < 12; i++) {
        const double entry = transform->to_object.m[i], size = fabs(entry);
        const unsigned code = size == 0.0 ? 0 : size == 1.0 ? 1 : 2 + find_size(packed->to_object.m, &count, size);
        if (code == 2 + PL_PACKED_SIZES) return 0;
        codes |= (uint64_t)(code | (signbit(entry) ? 8 : 0)) << 4 * i;
    }
    packed->form = PL_FORM_PACKED;
    packed->singular = false;
    packed->mild = transform->mild;
    packed->codes = codes;
    return offsetof(pl_transform, to_object) + count * sizeof *packed->to_object.m;
}

/* A transformation without what only building needs: its offset. seldom: few rays are mapped through it. */
static size_t put_transform(packer *p, const pl_transform *transform, bool seldom)
{
    pl_transform packed = {0};
    const size_t bytes = seldom ? pack_transform(transform, &packed) : 0;
    return bytes ? put(p, &packed, bytes) : put(p, transform, TRACED_BYTES);
}

/* The list of an item's transformations. Of what is entered through one of its own the item itself, at `place`, is the list. */
static const pl_transform *const *put_transforms(packer *p, const pl_item *item, bool seldom, pl_item *place)
{
    const size_t bytes = item->transform_count * sizeof *item->transforms;
    bool constant = true;
    if (item->kind == PL_NODE_ENTER && item->transform_count == 1 && !is_constant(p, item->transforms[0])) {
        const size_t offset = put_transform(p, item->transforms[0], seldom);
        if (p->memory) place->only = (const pl_transform *)(p->memory + offset);
        return &place->only;
    }
    for (uint32_t i = 0; i < item->transform_count; i++) constant = constant && is_constant(p, item->transforms[i]);
    size_t list = constant ? put_shared(p, item->transforms, bytes) : put(p, item->transforms, bytes);
    for (uint32_t i = 0; i < item->transform_count; i++) {
        if (is_constant(p, item->transforms[i])) continue;
        const size_t offset = put_transform(p, item->transforms[i], seldom);
        if (p->memory) ((const void **)(p->memory + list))[i] = p->memory + offset;
    }
    return p->memory ? (const pl_transform *const *)(p->memory + list) : NULL;
}

/* Lays out all items; with memory, fills it and turns each state to its new items. */
static void lay_out(packer *p)
{
    const pl_states *states = p->states;
    p->used = 0;
    memset(p->table, 0, p->table_size * sizeof *p->table);
    size_t items = take(p, states->item_count * sizeof *states->items);
    for (uint32_t i = 0; i < states->count; i++) {
        pl_state *state = &states->list[i];
        for (uint32_t k = 0; k < state->item_count; k++) {
            const pl_item *item = &state->items[k];
            pl_item none, *place = p->memory ? (pl_item *)(p->memory + items) + k : &none;
            const size_t terms = item->site->term_count * sizeof *item->site->terms;
            const size_t site = put_shared(p, item->site, sizeof *item->site + terms);
            *place = *item;
            place->transforms = put_transforms(p, item, p->once[i], place);
            if (p->memory) place->site = (const pl_site *)(p->memory + site);
        }
        if (p->memory) state->items = (const pl_item *)(p->memory + items);
        if (i == 0 || states->cuts) {
            const size_t bounds = put(p, state->bounds, sizeof *state->bounds);
            if (p->memory) state->bounds = (pl_state_bounds *)(p->memory + bounds);
            if (p->memory) state->bounds->key = NULL;
        } else if (p->memory) {
            state->bounds = NULL;
        }
        items += state->item_count * sizeof *state->items;
    }
    take(p, PL_PACKED_SIZES * sizeof(double)); /* as many are read of the last packed transformation, too */
}

/* Finds the states that occur once, or seem to: a state that is entered again after those below it were seen leaves these. */
static void find_once(packer *p)
{
    const pl_states *states = p->states;
    bool *entered = p->once + states->count;
    p->once[0] = entered[0] = true;
    for (uint32_t i = 0; i < states->count; i++)
        for (uint32_t k = 0; k < states->list[i].item_count; k++) {
            const pl_item *item = &states->list[i].items[k];
            if (item->kind != PL_NODE_ENTER) continue;
            p->once[item->what] = p->once[i] && !entered[item->what];
            entered[item->what] = true;
        }
}

static void end(packer *p)
{
    free(p->table);
    free(p->once);
}

static bool begin(packer *p, const pl_states *states, pl_error *error)
{
    *p = (packer){.states = states, .table_size = 16};
    while (p->table_size < 4 * states->item_count) p->table_size *= 2; /* two lists an item */
    p->table = malloc(p->table_size * sizeof *p->table);
    p->once = calloc(2 * states->count, sizeof *p->once);
    if (!p->table || !p->once) {
        end(p);
        return pl_fail_memory(error, "packing the states");
    }
    find_once(p);
    lay_out(p);
    return true;
}

static size_t whole_bytes(const packer *p)
{
    return sizeof(struct pl_block) + p->used + p->states->count * sizeof *p->states->list;
}

bool pl_states_packed_bytes(const pl_states *states, size_t *bytes, pl_error *error)
{
    packer p;
    if (!begin(&p, states, error)) return false;
    *bytes = whole_bytes(&p);
    end(&p);
    return true;
}

bool pl_states_pack(pl_states *states, pl_error *error)
{
    packer p;
    if (!begin(&p, states, error)) return false;
    struct pl_block *block = malloc(sizeof *block + p.used);
    if (!block) {
        end(&p);
        return pl_fail_memory(error, "packing the states");
    }
    *block = (struct pl_block){.used = p.used, .size = p.used};
    p.memory = block->memory;
    lay_out(&p);
    end(&p);
    free(states->table);
    states->table = NULL;
    states->table_size = 0;
    pl_blocks_free(states->blocks);
    states->blocks = block;
    states->items = (const pl_item *)block->memory;
    pl_state *list = realloc(states->list, states->count * sizeof *list);
    if (list) states->list = list;
    states->capacity = states->count;
    states->bytes = whole_bytes(&p);
    return true;
}
