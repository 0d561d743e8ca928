/* state_table.c - states' memory, and the table in which a state is found by its key (state.h).
 *
 *     symbol node, scope -> symbol · live parameters · random key -> the state's number
 *
 * Open addressing with linear probing; at most half of the slots are taken. Memory comes in blocks of which each is twice as
 * large as the one before, within the limit, and goes with the states. */
#include "state.h"

#include <stdlib.h>
#include <string.h>

#include "coverage.h"
#include "error.h"
#include "random.h"

enum { FIRST_TABLE = 64, FIRST_BLOCK = 4096, LARGEST_BLOCK = 1 << 20 };

/* --- memory --- */

static bool over_limit(const pl_states *states, size_t more, pl_error *error)
{
    if (states->bytes + more <= states->limit) return false;
    pl_fail(error, PL_ERROR_LIMIT, "states", "memory: %u states need more than the %zu bytes allowed",
            (unsigned)states->count, states->limit);
    return true;
}

void *pl_states_allocate(pl_states *states, size_t bytes, pl_error *error)
{
    bytes = (bytes + 15) & ~(size_t)15;
    struct pl_block *block = states->blocks;
    if (!block || block->used + bytes > block->size) {
        size_t size = block ? 2 * block->size : FIRST_BLOCK;
        if (size > LARGEST_BLOCK) size = LARGEST_BLOCK;
        while (size > bytes && states->bytes + sizeof *block + size > states->limit) size /= 2;
        if (size < bytes) size = bytes;
        if (over_limit(states, size, error)) return NULL;
        struct pl_block *fresh = malloc(sizeof *fresh + size);
        if (!fresh) {
            pl_fail_memory(error, "building the states");
            return NULL;
        }
        *fresh = (struct pl_block){.next = block, .size = size};
        states->blocks = block = fresh;
        states->bytes += sizeof *fresh + size;
    }
    void *place = block->memory + block->used;
    block->used += bytes;
    return place;
}

void pl_blocks_free(struct pl_block *blocks)
{
    while (blocks) {
        struct pl_block *next = blocks->next;
        free(blocks);
        blocks = next;
    }
}

void pl_states_free(pl_states *states)
{
    pl_blocks_free(states->blocks);
    free(states->list);
    free(states->table);
    free(states->node_boxes);
    pl_coverage_free(states->coverage);
    memset(states, 0, sizeof *states);
}

/* --- the table --- */

size_t pl_states_key_words(const pl_states *states, uint32_t symbol)
{
    return states->program->nodes[symbol].as.symbol.live_count + 2;
}

/* Word i of the key of a scope at a symbol node. */
static uint64_t key_word(const pl_program *program, uint32_t symbol, const pl_scope *scope, uint32_t i)
{
    const pl_node *node = &program->nodes[symbol];
    if (i == 0) return symbol;
    if (i > node->as.symbol.live_count) return node->as.symbol.draws ? scope->key : 0;
    double value = scope->parameters[program->slots[node->as.symbol.live_first + i - 1]];
    return isnan(value) ? UINT64_MAX : pl_bits(value);
}

void pl_states_key(const pl_states *states, uint32_t symbol, const pl_scope *scope, uint64_t *key)
{
    const size_t words = pl_states_key_words(states, symbol);
    for (uint32_t i = 0; i < words; i++) key[i] = key_word(states->program, symbol, scope, i);
}

static uint64_t hash_key(const uint64_t *key, size_t words)
{
    uint64_t hash = 0;
    for (size_t i = 0; i < words; i++) hash = pl_mix(hash, key[i]);
    return hash;
}

uint32_t pl_states_find(const pl_states *states, uint32_t symbol, const pl_scope *scope)
{
    size_t words = pl_states_key_words(states, symbol);
    uint64_t hash = 0;
    for (uint32_t i = 0; i < words; i++) hash = pl_mix(hash, key_word(states->program, symbol, scope, i));
    uint32_t mask = states->table_size - 1;
    for (uint32_t slot = (uint32_t)hash & mask; states->table_size && states->table[slot]; slot = (slot + 1) & mask) {
        const pl_state *state = &states->list[states->table[slot] - 1];
        uint32_t i = 0;
        while (state->symbol == symbol && i < words && state->bounds->key[i] == key_word(states->program, symbol, scope, i)) i++;
        if (i == words) return states->table[slot] - 1;
    }
    return UINT32_MAX;
}

uint32_t pl_states_slot(const pl_states *states, const uint64_t *key)
{
    size_t words = pl_states_key_words(states, (uint32_t)key[0]);
    uint32_t mask = states->table_size - 1, slot = (uint32_t)hash_key(key, words) & mask;
    for (; states->table[slot]; slot = (slot + 1) & mask) {
        const pl_state *state = &states->list[states->table[slot] - 1];
        if (state->symbol == (uint32_t)key[0] && memcmp(state->bounds->key, key, words * sizeof *key) == 0) break;
    }
    return slot;
}

bool pl_states_grow_table(pl_states *states, pl_error *error)
{
    uint32_t size = states->table_size ? 2 * states->table_size : FIRST_TABLE;
    uint32_t *table = calloc(size, sizeof *table), *old = states->table;
    if (!table) return pl_fail_memory(error, "building the states");
    states->bytes += (size - states->table_size) * sizeof *table;
    states->table = table;
    states->table_size = size;
    for (uint32_t i = 0; i < states->count; i++)
        if (states->list[i].bounds->key) table[pl_states_slot(states, states->list[i].bounds->key)] = i + 1;
    free(old);
    return true;
}

bool pl_states_add(pl_states *states, uint32_t symbol, const uint64_t *key, pl_error *error)
{
    if (states->count >= states->most)
        return pl_fail(error, PL_ERROR_LIMIT, "states", "more than %u states", (unsigned)states->most);
    if (states->count == states->capacity) {
        uint32_t capacity = states->capacity ? 2 * states->capacity : 16;
        size_t more = (capacity - states->capacity) * sizeof *states->list;
        if (over_limit(states, more, error)) return false;
        pl_state *list = realloc(states->list, capacity * sizeof *list);
        if (!list) return pl_fail_memory(error, "building the states");
        states->list = list;
        states->capacity = capacity;
        states->bytes += more;
    }
    pl_state_bounds *bounds = pl_states_allocate(states, sizeof *bounds, error);
    if (!bounds) return false;
    *bounds = (pl_state_bounds){.box = pl_box_empty(), .key = key};
    states->list[states->count++] = (pl_state){.symbol = symbol, .bounds = bounds, .open = true};
    return true;
}
