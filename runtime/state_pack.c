/* state_pack.c - states once they are only traced: one block of memory, without what building needed (state.h).
 *
 *     forest of 10,000 trees: 4.4 MB of states -> 2.4 MB
 *
 * Lists of terms and of constant transformations are the same in many items, and are kept once. The block is laid out
 * twice in the same order: for its size, then for good. */
#include "state.h"

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

static const pl_transform *const *put_transforms(packer *p, const pl_item *item)
{
    const size_t bytes = item->transform_count * sizeof *item->transforms;
    bool constant = true;
    for (uint32_t i = 0; i < item->transform_count; i++) constant = constant && is_constant(p, item->transforms[i]);
    size_t list = constant ? put_shared(p, item->transforms, bytes) : put(p, item->transforms, bytes);
    for (uint32_t i = 0; i < item->transform_count; i++) {
        if (is_constant(p, item->transforms[i])) continue;
        size_t offset = put(p, item->transforms[i], TRACED_BYTES);
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
            pl_item item = state->items[k];
            size_t terms = put_shared(p, item.terms, item.term_count * sizeof *item.terms);
            item.transforms = put_transforms(p, &item);
            if (!p->memory) continue;
            item.terms = (const uint32_t *)(p->memory + terms);
            ((pl_item *)(p->memory + items))[k] = item;
        }
        if (p->memory) state->items = (const pl_item *)(p->memory + items);
        if (p->memory) state->key = NULL;
        items += state->item_count * sizeof *state->items;
    }
}

static bool begin(packer *p, const pl_states *states, pl_error *error)
{
    *p = (packer){.states = states, .table_size = 16};
    while (p->table_size < 4 * states->item_count) p->table_size *= 2; /* two lists an item */
    p->table = malloc(p->table_size * sizeof *p->table);
    if (!p->table) return pl_fail_memory(error, "packing the states");
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
    free(p.table);
    return true;
}

bool pl_states_pack(pl_states *states, pl_error *error)
{
    packer p;
    if (!begin(&p, states, error)) return false;
    struct pl_block *block = malloc(sizeof *block + p.used);
    if (!block) {
        free(p.table);
        return pl_fail_memory(error, "packing the states");
    }
    *block = (struct pl_block){.used = p.used, .size = p.used};
    p.memory = block->memory;
    lay_out(&p);
    free(p.table);
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
