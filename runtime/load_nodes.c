/* load_nodes.c - the nodes of bytecode and their places in the source (see reader.h). */
#include <string.h>

#include "reach.h"
#include "reader.h"
#include "table.h"

/* The pools that lists of nodes go to. Nodes are read twice: with `store` false to count what the pools must hold,
 * then with it true to fill them. */
typedef struct pools {
    bool store;
    pl_node *nodes;
    uint32_t *children, *slots;
    pl_case *cases;
    pl_transform *transforms;
    uint32_t child_count, slot_count, case_count, transform_count;
} pools;

static void read_children(pl_reader *r, pools *p, uint32_t words[2])
{
    words[0] = p->child_count;
    words[1] = pl_read_count(r, 1);
    for (uint32_t i = 0; i < words[1] && !r->failed; i++) {
        const uint32_t child = pl_read_index(r, r->program->node_count, "node");
        if (p->store)
            p->children[p->child_count + i] = child;
    }
    p->child_count += words[1];
}

static void read_slots(pl_reader *r, pools *p, uint32_t words[2])
{
    words[0] = p->slot_count;
    words[1] = pl_read_count(r, 1);
    uint32_t last = 0;
    for (uint32_t i = 0; i < words[1] && !r->failed; i++) {
        const uint32_t slot = pl_read_index(r, r->program->parameter_count, "parameter");
        if (!r->failed && i > 0 && slot <= last)
            pl_read_fail(r, "a symbol's live parameters don't rise: %u after %u", slot, last);
        last = slot;
        if (p->store)
            p->slots[p->slot_count + i] = slot;
    }
    p->slot_count += words[1];
}

static void read_cases(pl_reader *r, pools *p, uint32_t words[2])
{
    words[0] = p->case_count;
    words[1] = pl_read_count(r, 2);
    for (uint32_t i = 0; i < words[1] && !r->failed; i++) {
        const uint32_t weight = pl_read_u(r);
        const uint32_t body = pl_read_index(r, r->program->node_count, "node");
        if (p->store)
            p->cases[p->case_count + i] = (pl_case){.weight = weight, .body = body};
    }
    p->case_count += words[1];
}

static uint32_t read_matrix(pl_reader *r, pools *p)
{
    pl_affine matrix = pl_affine_identity();
    for (int i = 0; i < 12; i++) {
        const uint32_t constant = pl_read_index(r, r->program->constant_count, "constant");
        if (!r->failed)
            matrix.m[i] = r->program->constants[constant];
    }
    if (p->store && !r->failed) {
        pl_transform_set(&p->transforms[p->transform_count], &matrix);
        p->transforms[p->transform_count].stretch = pl_largest_stretch(&matrix);
    }
    return p->transform_count++;
}

/* A field -> its words. Codes and shapes are verify.c's to check. */
static void read_field(pl_reader *r, pools *p, uint8_t type, uint32_t *words)
{
    const pl_program *program = r->program;
    switch (type) {
    case PL_FIELD_NODE: words[0] = pl_read_index(r, program->node_count, "node"); break;
    case PL_FIELD_NODES: read_children(r, p, words); break;
    case PL_FIELD_STRING: words[0] = pl_read_index(r, program->string_count, "string"); break;
    case PL_FIELD_SLOTS: read_slots(r, p, words); break;
    case PL_FIELD_RECORD: words[0] = pl_read_index(r, program->record_count, "record"); break;
    case PL_FIELD_MESH: words[0] = pl_read_index(r, program->mesh_count, "mesh"); break;
    case PL_FIELD_MATRIX: words[0] = read_matrix(r, p); break;
    case PL_FIELD_CASES: read_cases(r, p, words); break;
    default: words[0] = pl_read_u(r); break;
    }
}

static void read_all(pl_reader *r, pools *p)
{
    for (uint32_t i = 0; i < r->program->node_count && !r->failed; i++) {
        const uint32_t kind = pl_read_u(r);
        const pl_node_row *row = pl_node_row_of(kind);
        if (r->failed)
            return;
        if (!row->name) {
            pl_read_fail(r, "node %u: there is no node kind %u", i, kind);
            return;
        }
        pl_node node = {.kind = (uint8_t)kind};
        uint32_t *words = node.as.words;
        for (int f = 0; f < row->field_count && !r->failed; f++) {
            read_field(r, p, row->fields[f].type, words);
            words += pl_field_words(row->fields[f].type);
        }
        if (p->store)
            p->nodes[i] = node;
    }
}

/* Lists the symbol and rule nodes. */
static void index_nodes(pl_reader *r, pl_node *nodes)
{
    pl_program *program = r->program;
    for (uint32_t i = 0; i < program->node_count; i++) {
        program->symbol_count += nodes[i].kind == PL_NODE_SYMBOL;
        program->rule_count += nodes[i].kind == PL_NODE_RULE;
    }
    uint32_t *symbols = pl_read_allocate(r, program->symbol_count, sizeof *symbols);
    uint32_t *rules = pl_read_allocate(r, program->rule_count, sizeof *rules);
    if (r->failed)
        return;
    program->symbols = symbols;
    program->rules = rules;
    for (uint32_t i = 0, symbol = 0; i < program->node_count; i++) {
        if (nodes[i].kind == PL_NODE_SYMBOL) {
            nodes[i].symbol = symbol;
            symbols[symbol++] = i;
        } else if (nodes[i].kind == PL_NODE_RULE) {
            *rules++ = i;
        }
    }
}

void pl_read_nodes(pl_reader *r)
{
    pl_program *program = r->program;
    program->node_count = pl_read_count(r, 1);
    if (!r->failed && program->node_count == 0)
        pl_read_fail(r, "there is no root");
    if (program->node_count > PL_LIMIT_NODES)
        pl_read_fail_as(r, PL_ERROR_LIMIT, "%u nodes, more than %d", program->node_count, PL_LIMIT_NODES);
    pl_reader first_pass = *r;
    pools p = {.store = false};
    read_all(&first_pass, &p);
    if (first_pass.failed) {
        *r = first_pass;
        return;
    }
    p.nodes = pl_read_allocate(r, program->node_count, sizeof *p.nodes);
    p.children = pl_read_allocate(r, p.child_count, sizeof *p.children);
    p.slots = pl_read_allocate(r, p.slot_count, sizeof *p.slots);
    p.cases = pl_read_allocate(r, p.case_count, sizeof *p.cases);
    p.transforms = pl_read_allocate(r, p.transform_count, sizeof *p.transforms);
    if (r->failed)
        return;
    p.store = true;
    p.child_count = p.slot_count = p.case_count = p.transform_count = 0;
    read_all(r, &p);
    program->nodes = p.nodes;
    program->children = p.children;
    program->slots = p.slots;
    program->cases = p.cases;
    program->transforms = p.transforms;
    program->child_count = p.child_count;
    program->slot_count = p.slot_count;
    program->case_count = p.case_count;
    program->transform_count = p.transform_count;
    index_nodes(r, p.nodes);
}

void pl_read_sourcemap(pl_reader *r)
{
    pl_program *program = r->program;
    const uint32_t file_count = pl_read_count(r, 1);
    const uint8_t *files_at = r->at;
    for (uint32_t i = 0; i < file_count && !r->failed; i++)
        pl_read_index(r, program->string_count, "string");
    uint32_t *files = pl_read_allocate(r, file_count, sizeof *files);
    pl_place *places = pl_read_allocate(r, program->node_count, sizeof *places);
    if (r->failed)
        return;
    r->at = files_at;
    for (uint32_t i = 0; i < file_count; i++)
        files[i] = pl_read_u(r);
    for (uint32_t i = 0; i < program->node_count && !r->failed; i++) {
        const uint32_t file = pl_read_index(r, file_count + 1, "file");
        if (r->failed || file == 0)
            continue;
        const uint32_t line = pl_read_u(r), column = pl_read_u(r), lines = pl_read_u(r), end_column = pl_read_u(r);
        if (!r->failed && (line == 0 || column == 0 || end_column == 0 || lines > UINT32_MAX - line))
            pl_read_fail(r, "node %u stands nowhere: line %u, column %u", i, line, column);
        places[i] = (pl_place){files[file - 1], line, column, line + lines, end_column};
    }
    program->places = places;
}
