/* table.c - see table.h. */
#include "table.h"

#include <stddef.h>

#define COUNT(array) (sizeof(array) / sizeof *(array))

static const pl_field_row FIELDS[] = {
#define ROW(NODE, name, type) {name, type},
    PL_NODE_FIELDS(ROW)
#undef ROW
};

static const pl_node_row NODES[] = {
#define ROW(ENUM, name, id, letter, first, count) [id] = {name, FIELDS + first, count},
    PL_NODES(ROW)
#undef ROW
};

static const pl_op_row OPCODES[] = {
#define ROW(ENUM, name, id, operand, pops, pushes) [id] = {name, operand, pops, pushes},
    PL_OPCODES(ROW)
#undef ROW
};

static const pl_shape_row SHAPES[] = {
#define ROW(ENUM, name, id, arguments, unbounded) [id] = {name, arguments, unbounded},
    PL_SHAPES(ROW)
#undef ROW
};

static const char *const PATTERNS[] = {
#define ROW(ENUM, name, id) [id] = name,
    PL_PATTERNS(ROW)
#undef ROW
};

static const double SETTINGS[] = PL_SETTINGS_DEFAULTS, CAMERA[] = PL_CAMERA_DEFAULTS, LIGHT[] = PL_LIGHT_DEFAULTS,
                    TEXTURE[] = PL_TEXTURE_DEFAULTS;

static const pl_record_row RECORDS[] = {
#define ROW(ENUM, name, values, entry) [PL_RECORD_##ENUM] = {name, values, entry, ENUM},
    PL_RECORDS(ROW)
#undef ROW
};

static const struct {
    uint32_t kind;
    const char *name;
    uint32_t offset, size;
} VALUES[] = {
#define ROW(RECORD, name, offset, size) {PL_RECORD_##RECORD, name, offset, size},
    PL_RECORD_FIELDS(ROW)
#undef ROW
};

static const struct {
    uint32_t kind;
    const char *name;
    uint32_t offset;
} ENTRIES[] = {
#define ROW(RECORD, name, offset) {PL_RECORD_##RECORD, name, offset},
    PL_RECORD_ENTRIES(ROW)
#undef ROW
};

const pl_node_row *pl_node_row_of(uint32_t kind)
{
    static const pl_node_row none = {NULL, NULL, 0};
    return kind < COUNT(NODES) ? &NODES[kind] : &none;
}

const pl_op_row *pl_op_row_of(uint32_t opcode)
{
    static const pl_op_row none = {NULL, 0, 0, 0};
    return opcode < COUNT(OPCODES) ? &OPCODES[opcode] : &none;
}

const pl_shape_row *pl_shape_row_of(uint32_t shape)
{
    static const pl_shape_row none = {NULL, 0, false};
    return shape < COUNT(SHAPES) ? &SHAPES[shape] : &none;
}

const pl_record_row *pl_record_row_of(uint32_t kind)
{
    static const pl_record_row none = {NULL, 0, 0, NULL};
    return kind < COUNT(RECORDS) ? &RECORDS[kind] : &none;
}

const char *pl_pattern_name(uint32_t pattern)
{
    return pattern < COUNT(PATTERNS) ? PATTERNS[pattern] : NULL;
}

const char *pl_record_value_name(uint32_t kind, uint32_t offset, uint32_t *first, uint32_t *size)
{
    for (size_t i = 0; i < COUNT(VALUES); i++) {
        if (VALUES[i].kind == kind && offset >= VALUES[i].offset && offset - VALUES[i].offset < VALUES[i].size) {
            *first = VALUES[i].offset;
            *size = VALUES[i].size;
            return VALUES[i].name;
        }
    }
    return NULL;
}

const char *pl_record_entry_name(uint32_t kind, uint32_t k)
{
    for (size_t i = 0; i < COUNT(ENTRIES); i++)
        if (ENTRIES[i].kind == kind && ENTRIES[i].offset == k)
            return ENTRIES[i].name;
    return NULL;
}
