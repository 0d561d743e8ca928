/* table.h - the rows of bytecode.h as arrays, for whoever loops over them: loader, verifier, disassembler. */
#ifndef PL_TABLE_H
#define PL_TABLE_H

#include "bytecode.h"

typedef struct pl_field_row {
    const char *name;
    uint8_t type; /* PL_FIELD_… */
} pl_field_row;

typedef struct pl_node_row {
    const char *name; /* NULL: there is no such kind */
    const pl_field_row *fields;
    uint8_t field_count;
} pl_node_row;

typedef struct pl_op_row {
    const char *name; /* NULL: there is no such opcode */
    uint8_t operand;  /* PL_OPERAND_… */
    int8_t pops;      /* -1: as many as the operand says */
    int8_t pushes;
} pl_op_row;

typedef struct pl_shape_row {
    const char *name; /* NULL: there is no such shape */
    uint8_t arguments;
    bool unbounded;
} pl_shape_row;

typedef struct pl_record_row {
    const char *name; /* NULL: there is no such kind */
    uint32_t values;  /* numbers without entries */
    uint32_t entry;   /* numbers an entry; 0: no entries */
    const double *defaults;
} pl_record_row;

/* By id; a number that no row has gives a row whose name is NULL. */
const pl_node_row *pl_node_row_of(uint32_t kind);
const pl_op_row *pl_op_row_of(uint32_t opcode);
const pl_shape_row *pl_shape_row_of(uint32_t shape);
const pl_record_row *pl_record_row_of(uint32_t kind);
const char *pl_pattern_name(uint32_t pattern);

/* The name of the value at an offset of a record kind; *first becomes the value's own offset, *size its size. */
const char *pl_record_value_name(uint32_t kind, uint32_t offset, uint32_t *first, uint32_t *size);

/* Name of number k of an entry of a record kind. */
const char *pl_record_entry_name(uint32_t kind, uint32_t k);

/* 32-bit words that a field of this type takes in pl_node_fields. */
static inline int pl_field_words(uint8_t type)
{
    return type == PL_FIELD_NODES || type == PL_FIELD_SLOTS || type == PL_FIELD_CASES ? 2 : 1;
}

#endif
