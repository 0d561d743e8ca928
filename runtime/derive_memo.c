/* derive_memo.c - see derive_memo.h. */
#include "derive_memo.h"

#include <stdlib.h>
#include <string.h>

#include "random.h"
#include "table.h"

enum { PLACES = 128, MOST_LOADED = 6, UNKNOWN = 0, IMPURE = 255 };

/* What a node's code loads. */
typedef struct loads {
    uint8_t count; /* + 1; UNKNOWN: not looked at yet, IMPURE: it draws, or loads too much */
    uint32_t slots[MOST_LOADED];
} loads;

typedef struct key {
    uint32_t node; /* + 1 */
    double values[MOST_LOADED]; /* of what isn't loaded 0 */
} key;

typedef struct place {
    key key;
    pl_transform transform;
} place;

struct pl_memo {
    const pl_program *program;
    loads *loads; /* of each node */
    key sought;
    place *found; /* the place for it; NULL: it can't be kept */
    place places[PLACES];
};

pl_memo *pl_memo_create(const pl_program *program)
{
    pl_memo *memo = calloc(1, sizeof *memo);
    if (!memo) return NULL;
    memo->program = program;
    memo->loads = calloc(program->node_count, sizeof *memo->loads);
    if (memo->loads) return memo;
    free(memo);
    return NULL;
}

void pl_memo_free(pl_memo *memo)
{
    if (memo) free(memo->loads);
    free(memo);
}

/* Verified code: operands are complete and it ends. */
static void look_at(const pl_program *program, uint32_t code, loads *l)
{
    const uint8_t *at = program->code + (code - 1);
    uint8_t count = 0;
    while (*at != PL_OP_END) {
        const uint8_t opcode = *at++;
        uint32_t value = 0;
        if (pl_op_row_of(opcode)->operand != PL_OPERAND_NONE)
            for (int shift = 0;; shift += 7) {
                value |= (uint32_t)(*at & 0x7F) << shift;
                if (!(*at++ & 0x80)) break;
            }
        if (opcode == PL_OP_RAND || opcode == PL_OP_STORE || opcode == PL_OP_VARIANTS ||
            (opcode == PL_OP_LOAD && count == MOST_LOADED)) {
            l->count = IMPURE;
            return;
        }
        if (opcode == PL_OP_LOAD) l->slots[count++] = value;
    }
    l->count = count + 1;
}

const pl_transform *pl_memo_find(pl_memo *memo, uint32_t node, const double *parameters)
{
    loads *l = &memo->loads[node];
    memo->found = NULL;
    if (l->count == UNKNOWN) look_at(memo->program, memo->program->nodes[node].as.transform_code.code, l);
    if (l->count == IMPURE) return NULL;
    memset(&memo->sought, 0, sizeof memo->sought);
    memo->sought.node = node + 1;
    uint64_t hash = node;
    for (uint8_t i = 0; i + 1 < l->count; i++) {
        uint64_t bits;
        memo->sought.values[i] = parameters[l->slots[i]];
        memcpy(&bits, &memo->sought.values[i], sizeof bits);
        hash = pl_quick_hash(hash, bits);
    }
    memo->found = &memo->places[pl_quick_place(hash, PLACES)];
    return memcmp(&memo->found->key, &memo->sought, sizeof memo->sought) == 0 ? &memo->found->transform : NULL;
}

void pl_memo_keep(pl_memo *memo, const pl_transform *transform)
{
    if (!memo->found) return;
    memo->found->key = memo->sought;
    memo->found->transform = *transform;
}
