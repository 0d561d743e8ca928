/* dump.c - bytecode -> text: the disassembly that `plsys disassemble` and `plsys-rt --dump` print.
 *
 * compiler/bytecode/disassemble.py writes the same text, and golden cases (tests/cases/disassembly/) hold both to it:
 *
 *     bytecode version 1
 *     parameter 0 "cntTree"
 *     record 0 settings seed=7
 *     record 1 texture pattern=gradient diffuse=0.7 entry=<0, 1, 0, 0, 0, 0> entry=<1, 0, 0, 1, 0, 0>
 *     mesh 0 "leaf.obj" vertices=4 normals=0 triangles=2
 *     node 0 object name="Tree" ordinal=0 child=1  ; tree.plsys:12:1-12:14
 *     node 1 calculate name="C_init" code=@0 child=2
 *             0  const 10
 *             2  store cntTree
 *             4  end
 *     node 2 enter symbol=3
 *     node 3 symbol name="Tree" live=[cntTree] draws=0 body=4
 *     node 4 branch test=@5 then=5 otherwise=6
 *
 * Records show the values that differ from their defaults, whole vectors as <a, b>, then all entries. A node shows
 * its fields in file order: code by its first byte (`none` without code), cases as [@weight: node, …], shapes,
 * patterns and parameters by name; then its place, if it has one. Below the first node that uses a piece of code
 * stands the piece, an instruction a line: first byte, opcode, operand. A jump shows the byte that it leads to,
 * texture_set the value (diffuse, ambient[1], entry[0].red). Numbers are pl_number_text's. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "error.h"
#include "program.h"
#include "table.h"

typedef struct dump {
    const pl_program *program;
    char *text;
    size_t length, capacity;
    uint8_t *shown; /* by byte of code: a piece that starts here has been shown */
    bool failed;
} dump;

__attribute__((format(printf, 2, 3))) static void put(dump *d, const char *format, ...)
{
    if (d->failed)
        return;
    va_list arguments, again;
    va_start(arguments, format);
    va_copy(again, arguments);
    const int needed = vsnprintf(NULL, 0, format, arguments);
    va_end(arguments);
    if (needed < 0) {
        d->failed = true;
    } else if (d->length + (size_t)needed + 1 > d->capacity) {
        const size_t capacity = 2 * d->capacity + (size_t)needed + 1;
        char *grown = realloc(d->text, capacity);
        d->failed = !grown;
        if (grown) {
            d->text = grown;
            d->capacity = capacity;
        }
    }
    if (!d->failed)
        d->length += (size_t)vsnprintf(d->text + d->length, d->capacity - d->length, format, again);
    va_end(again);
}

static void put_number(dump *d, double value)
{
    char buffer[PL_NUMBER_TEXT];
    put(d, "%s", pl_number_text(value, buffer));
}

/* "7" or "<1, 2, 3>". */
static void put_vector(dump *d, const double *values, uint32_t count)
{
    if (count > 1)
        put(d, "<");
    for (uint32_t i = 0; i < count; i++) {
        if (i)
            put(d, ", ");
        put_number(d, values[i]);
    }
    if (count > 1)
        put(d, ">");
}

static const char *parameter(const dump *d, uint32_t slot)
{
    return d->program->strings[d->program->parameters[slot]].text;
}

static void put_record(dump *d, uint32_t index)
{
    const pl_record *record = &d->program->records[index];
    const pl_record_row *row = pl_record_row_of(record->kind);
    put(d, "record %u %s", index, row->name);
    for (uint32_t offset = 0, first, size; offset < row->values; offset += size) {
        const char *name = pl_record_value_name(record->kind, offset, &first, &size);
        const double *value = record->values + offset;
        if (memcmp(value, row->defaults + offset, size * sizeof *value) == 0)
            continue;
        put(d, " %s=", name);
        if (record->kind == PL_RECORD_TEXTURE && offset == PL_TEXTURE_PATTERN)
            put(d, "%s", pl_pattern_name((uint32_t)*value));
        else
            put_vector(d, value, size);
    }
    for (uint32_t i = 0; i < record->entries; i++) {
        put(d, " entry=");
        put_vector(d, record->values + row->values + (size_t)i * row->entry, row->entry);
    }
    put(d, "\n");
}

static void put_texture_value(dump *d, uint32_t index)
{
    uint32_t first, size;
    if (index >= PL_TEXTURE_VALUES) {
        const uint32_t entry = (index - PL_TEXTURE_VALUES) / PL_TEXTURE_ENTRY;
        const uint32_t k = (index - PL_TEXTURE_VALUES) % PL_TEXTURE_ENTRY;
        put(d, " entry[%u].%s", entry, pl_record_entry_name(PL_RECORD_TEXTURE, k));
        return;
    }
    put(d, " %s", pl_record_value_name(PL_RECORD_TEXTURE, index, &first, &size));
    if (size > 1)
        put(d, "[%u]", index - first);
}

/* A piece of code, if it hasn't been shown. */
static void put_code(dump *d, uint32_t code)
{
    if (code == 0 || d->shown[code - 1])
        return;
    d->shown[code - 1] = 1;
    const uint8_t *const start = d->program->code, *at = start + code - 1;
    for (uint8_t opcode = UINT8_MAX; opcode != PL_OP_END && !d->failed;) {
        const uint32_t offset = (uint32_t)(at - start);
        opcode = *at++;
        const pl_op_row *row = pl_op_row_of(opcode);
        uint32_t operand = 0;
        for (int shift = 0; row->operand != PL_OPERAND_NONE; shift += 7) {
            operand |= (uint32_t)(*at & 0x7F) << shift;
            if (!(*at++ & 0x80))
                break;
        }
        put(d, "%9u  %s", offset, row->name);
        switch (row->operand) {
        case PL_OPERAND_NONE: break;
        case PL_OPERAND_SLOT: put(d, " %s", parameter(d, operand)); break;
        case PL_OPERAND_CONSTANT:
            put(d, " ");
            put_number(d, d->program->constants[operand]);
            break;
        case PL_OPERAND_STRING: put(d, " \"%s\"", d->program->strings[operand].text); break;
        case PL_OPERAND_OFFSET: put(d, " %u", (uint32_t)(at - start) + operand); break;
        default:
            if (opcode == PL_OP_TEXTURE_SET)
                put_texture_value(d, operand);
            else
                put(d, " %u", operand);
        }
        put(d, "\n");
    }
}

static void put_code_reference(dump *d, uint32_t code)
{
    if (code)
        put(d, "@%u", code - 1);
    else
        put(d, "none");
}

static void put_field(dump *d, uint8_t type, const uint32_t *words)
{
    const pl_program *program = d->program;
    switch (type) {
    case PL_FIELD_NODES:
        for (uint32_t i = 0; i < words[1]; i++)
            put(d, "%s%u", i ? ", " : "[", program->children[words[0] + i]);
        put(d, words[1] ? "]" : "[]");
        break;
    case PL_FIELD_SLOTS:
        for (uint32_t i = 0; i < words[1]; i++)
            put(d, "%s%s", i ? ", " : "[", parameter(d, program->slots[words[0] + i]));
        put(d, words[1] ? "]" : "[]");
        break;
    case PL_FIELD_CASES:
        for (uint32_t i = 0; i < words[1]; i++) {
            put(d, i ? ", " : "[");
            put_code_reference(d, program->cases[words[0] + i].weight);
            put(d, ": %u", program->cases[words[0] + i].body);
        }
        put(d, "]");
        break;
    case PL_FIELD_CODE: put_code_reference(d, words[0]); break;
    case PL_FIELD_STRING: put(d, "\"%s\"", program->strings[words[0]].text); break;
    case PL_FIELD_SHAPE: put(d, "%s", pl_shape_row_of(words[0])->name); break;
    case PL_FIELD_MATRIX: put_vector(d, program->transforms[words[0]].to_parent.m, 12); break;
    default: put(d, "%u", words[0]); break;
    }
}

static void put_node(dump *d, uint32_t index)
{
    const pl_program *program = d->program;
    const pl_node *node = &program->nodes[index];
    const pl_node_row *row = pl_node_row_of(node->kind);
    const uint32_t *words = node->as.words;
    put(d, "node %u %s", index, row->name);
    for (int f = 0; f < row->field_count; f++) {
        put(d, " %s=", row->fields[f].name);
        put_field(d, row->fields[f].type, words);
        words += pl_field_words(row->fields[f].type);
    }
    const pl_place *place = &program->places[index];
    if (place->line)
        put(d, "  ; %s:%u:%u-%u:%u", program->strings[place->file].text, place->line, place->column, place->end_line,
            place->end_column);
    put(d, "\n");
    words = node->as.words;
    for (int f = 0; f < row->field_count; f++) {
        if (row->fields[f].type == PL_FIELD_CODE)
            put_code(d, words[0]);
        for (uint32_t i = 0; row->fields[f].type == PL_FIELD_CASES && i < words[1]; i++)
            put_code(d, program->cases[words[0] + i].weight);
        words += pl_field_words(row->fields[f].type);
    }
}

static void put_program(dump *d)
{
    const pl_program *program = d->program;
    put(d, "bytecode version %d\n", PL_VERSION);
    for (uint32_t i = 0; i < program->parameter_count; i++)
        put(d, "parameter %u \"%s\"\n", i, parameter(d, i));
    for (uint32_t i = 0; i < program->record_count; i++)
        put_record(d, i);
    for (uint32_t i = 0; i < program->mesh_count; i++) {
        const pl_mesh *mesh = &program->meshes[i];
        put(d, "mesh %u \"%s\" vertices=%u normals=%u triangles=%u\n", i, program->strings[mesh->name].text,
            mesh->vertex_count, mesh->normal_count, mesh->triangle_count);
    }
    for (uint32_t i = 0; i < program->node_count && !d->failed; i++)
        put_node(d, i);
}

char *pl_disassemble(const void *bytecode, size_t length, pl_error *error)
{
    pl_error_clear(error);
    pl_program *program = pl_program_load(bytecode, length, error);
    if (!program)
        return NULL;
    dump d = {.program = program, .shown = calloc((size_t)program->code_length + 1, 1)};
    d.failed = !d.shown;
    put_program(&d);
    free(d.shown);
    pl_program_free(program);
    if (!d.failed)
        return d.text;
    free(d.text);
    pl_fail_memory(error, "disassembly");
    return NULL;
}
