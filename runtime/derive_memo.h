/* derive_memo.h - computed transformations kept for a while: siblings and their children often have the same.
 *
 * A transformation without draws is a function of the parameters that its code loads. A walk that has a memo looks there
 * first; a place for each hash, so that nothing has to be thrown out. One thread's. */
#ifndef PL_DERIVE_MEMO_H
#define PL_DERIVE_MEMO_H

#include "program.h"

typedef struct pl_memo pl_memo;

pl_memo *pl_memo_create(const pl_program *program);
void pl_memo_free(pl_memo *memo);

/* The transformation of a transform_code node; NULL: it isn't there. */
const pl_transform *pl_memo_find(pl_memo *memo, uint32_t node, const double *parameters);

/* Keeps the one that was looked for last, if it may be kept. */
void pl_memo_keep(pl_memo *memo, const pl_transform *transform);

#endif
