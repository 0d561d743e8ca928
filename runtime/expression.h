/* expression.h - running code: a scope's parameters and random key in, values, a matrix or a texture out.
 *
 *     pl_scope scope;  double parameters[…];                        the caller owns the parameters' array
 *     pl_scope_object(program, 0, &scope);                          at an object node: no parameter set, key from the
 * seed pl_scope_enter(program, symbol_node, &scope);                 at a symbol node: new key, no draws yet if
 * (!pl_run(program, node, code, &scope, &result, error)) …   runs a piece of code
 *
 * Copying a scope is copying its struct and its parameters: `+` copies it for each term, calculate nodes change the
 * operand's copy. Guards, weights, transformations and textures draw from the same scope, so ordinals of draws go on
 * along the path. */
#ifndef PL_EXPRESSION_H
#define PL_EXPRESSION_H

#include "affine.h"
#include "program.h"

typedef struct pl_scope {
    double *parameters; /* program->parameter_count numbers; a NaN: not assigned (a NaN is never stored) */
    uint64_t key;
    uint32_t symbol;                                /* the symbol node last entered, for messages; UINT32_MAX: none */
    uint32_t draws;                                 /* draws so far in this application */
    uint64_t drawn[PL_LIMIT_DRAWS_PER_APPLICATION]; /* their streams' bits; only the first `draws` mean anything */
} pl_scope;

/* What a piece of code leaves. Set `texture` before pl_run on a texture node's code: texture_set writes there (a copy
 * of the record's values). matrix is set to the identity by pl_run and then multiplied. */
typedef struct pl_result {
    uint32_t count;
    double values[PL_LIMIT_STACK];
    pl_affine matrix;
    double *texture;
} pl_result;

/* Copies a scope; target->parameters must have room and stays target's own. */
void pl_scope_copy(const pl_program *program, const pl_scope *scope, pl_scope *target);

/* At an object node: forgets all parameters and draws, sets the key. */
void pl_scope_object(const pl_program *program, uint32_t node, pl_scope *scope);

/* At a symbol node: mixes its name into the key and starts a new application. */
void pl_scope_enter(const pl_program *program, uint32_t node, pl_scope *scope);

/* At term i of a union. Draws of the operators before the union stay counted. */
void pl_scope_term(pl_scope *scope, uint32_t term);

/* Runs code (a node's field: 0 means none and does nothing) on the scope. Errors (PL_ERROR_SCENE) stand at node's
 * place: a NaN or infinity is stored, set, multiplied into the matrix or left; a parameter is read before it is
 * assigned; a bad number of variants; a rotation about a zero axis; a stream or hash argument that isn't finite. */
bool pl_run(const pl_program *program, uint32_t node, uint32_t code, pl_scope *scope, pl_result *result,
            pl_error *error);

/* At a branch node: *child becomes the node that its test leads to. */
bool pl_branch(const pl_program *program, uint32_t node, pl_scope *scope, uint32_t *child, pl_error *error);

/* At a choose node: *child becomes the body of the case drawn. Errors: a negative or non-finite weight, all weights
 * 0. */
bool pl_choose(const pl_program *program, uint32_t node, pl_scope *scope, uint32_t *child, pl_error *error);

#endif
