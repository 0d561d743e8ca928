/* verify.c - what must hold between the parts of a program, so that running it needs no checks.
 *
 * Code: one pass over the section follows each piece from its first byte to its `end` with the stack's depth on every
 * path (jumps only go forward, so one pass is enough), and remembers what the piece does. Nodes: each kind's fields,
 * and that its code does what such a node's code may do. Graph: a depth-first search without recursion shows that
 * edges other than enter's make no cycle, and sums up draws along the longest path of an application. Time and memory
 * are linear in the file's size. */
#include <stdlib.h>
#include <string.h>

#include "error.h"
#include "program.h"
#include "reader.h"
#include "table.h"

/* What a piece of code does. */
typedef struct piece {
    uint32_t start, length;  /* bytes in the code section */
    uint8_t results;         /* values that it leaves */
    uint8_t draws;           /* most draws on a path, at most LIMIT + 1 */
    bool assigns;            /* store, variants */
    bool transforms;         /* an operation on the matrix */
    bool paints;             /* texture_set */
    bool sets_positions;     /* texture_set in entries */
    uint32_t texture_values; /* largest index of texture_set + 1 */
} piece;

typedef struct verifier {
    const pl_program *program;
    pl_error *error;
    piece *pieces;
    uint32_t piece_count;
    uint8_t *depth;  /* of the stack before the instruction at each byte of code, + 1; 0: not reached */
    uint8_t *draws;  /* before it, at most */
    uint32_t *falls; /* of each record: the first colour map entry below the one before it; 0: none */
} verifier;

enum { DRAWS_TOO_MANY = PL_LIMIT_DRAWS_PER_APPLICATION + 1 };

static uint8_t add_draws(uint32_t a, uint32_t b)
{
    return (uint8_t)(a + b < DRAWS_TOO_MANY ? a + b : DRAWS_TOO_MANY);
}

#define BAD_CODE(v, offset, format, ...) \
    pl_fail((v)->error, PL_ERROR_BYTECODE, "code", "byte %u: " format, (unsigned)(offset), __VA_ARGS__)

/* --- code --- */

typedef struct instruction {
    uint32_t start, next; /* its bytes */
    uint8_t opcode;
    const pl_op_row *row;
    uint32_t operand;
} instruction;

static bool decode(const verifier *v, uint32_t at, instruction *in)
{
    const pl_program *program = v->program;
    *in = (instruction){.start = at, .opcode = program->code[at], .row = pl_op_row_of(program->code[at])};
    if (!in->row->name)
        return BAD_CODE(v, at, "there is no opcode %u", in->opcode);
    in->next = at + 1;
    if (in->row->operand == PL_OPERAND_NONE)
        return true;
    pl_reader r = {.at = program->code + at + 1,
                   .end = program->code + program->code_length,
                   .section = "code",
                   .error = v->error};
    switch (in->row->operand) {
    case PL_OPERAND_SLOT: in->operand = pl_read_index(&r, program->parameter_count, "parameter"); break;
    case PL_OPERAND_CONSTANT: in->operand = pl_read_index(&r, program->constant_count, "constant"); break;
    case PL_OPERAND_STRING: in->operand = pl_read_index(&r, program->string_count, "string"); break;
    default: in->operand = pl_read_u(&r); break;
    }
    in->next = (uint32_t)(r.at - program->code);
    return !r.failed;
}

/* Notes what the instruction does; draws is the number before it and becomes the number after it. */
static bool note(const verifier *v, const instruction *in, piece *p, uint8_t *draws)
{
    switch (in->opcode) {
    case PL_OP_RAND: *draws = add_draws(*draws, 1); break;
    case PL_OP_STORE:
    case PL_OP_VARIANTS: p->assigns = true; break;
    case PL_OP_TEXTURE_SET:
        p->paints = true;
        p->sets_positions |= in->operand >= PL_TEXTURE_VALUES;
        if (in->operand == PL_TEXTURE_PATTERN)
            return BAD_CODE(v, in->start, "%s changes the pattern", in->row->name);
        if (in->operand >= p->texture_values)
            p->texture_values = in->operand < UINT32_MAX ? in->operand + 1 : in->operand;
        break;
    case PL_OP_HASH:
        if (in->operand < 1 || in->operand > PL_LIMIT_HASH_ARGUMENTS)
            return BAD_CODE(v, in->start, "hash of %u arguments, not 1 to %d", in->operand, PL_LIMIT_HASH_ARGUMENTS);
        break;
    default: p->transforms |= in->opcode >= PL_OP_TRANS && in->opcode <= PL_OP_MATRIX; break;
    }
    return true;
}

/* Says that `target` is reached from `in` with this depth (of the stack) and so many draws. */
static bool reach(verifier *v, const instruction *in, uint32_t target, uint32_t depth, uint8_t draws)
{
    if (v->depth[target] && v->depth[target] != depth + 1)
        return BAD_CODE(v, in->start, "leads to byte %u with %u values on the stack, another path with %u", target,
                        depth, v->depth[target] - 1u);
    v->depth[target] = (uint8_t)(depth + 1);
    if (draws > v->draws[target])
        v->draws[target] = draws;
    return true;
}

/* One instruction: its effect on the stack, and where it leads. *last becomes the farthest byte jumped to. */
static bool step(verifier *v, const instruction *in, piece *p, uint32_t *last)
{
    if (!v->depth[in->start])
        return BAD_CODE(v, in->start, "%s can't be reached", in->row->name);
    uint32_t depth = v->depth[in->start] - 1u;
    uint8_t draws = v->draws[in->start];
    if (!note(v, in, p, &draws))
        return false;
    const uint32_t pops = in->row->pops < 0 ? in->operand : (uint32_t)in->row->pops;
    if (depth < pops)
        return BAD_CODE(v, in->start, "%s takes %u values, the stack has %u", in->row->name, pops, depth);
    depth = depth - pops + (uint32_t)in->row->pushes;
    if (depth > PL_LIMIT_STACK)
        return BAD_CODE(v, in->start, "more than %d values on the stack", PL_LIMIT_STACK);
    for (uint32_t i = in->start + 1; i < in->next; i++)
        if (v->depth[i])
            return BAD_CODE(v, i, "a jump leads into the middle of %s", in->row->name);
    if (in->opcode == PL_OP_END) {
        p->results = (uint8_t)depth;
        p->draws = draws;
        return true;
    }
    if (in->next >= v->program->code_length)
        return BAD_CODE(v, in->start, "no end follows %s", in->row->name);
    if (in->opcode == PL_OP_JUMP || in->opcode == PL_OP_JUMP_IF_ZERO) {
        if (in->operand >= v->program->code_length - in->next)
            return BAD_CODE(v, in->start, "%s leaves the code", in->row->name);
        if (in->next + in->operand > *last)
            *last = in->next + in->operand;
        if (!reach(v, in, in->next + in->operand, depth, draws))
            return false;
    }
    return in->opcode == PL_OP_JUMP || reach(v, in, in->next, depth, draws);
}

static bool verify_piece(verifier *v, piece *p)
{
    uint32_t at = p->start, last = p->start;
    v->depth[at] = 1;
    for (;;) {
        instruction in;
        if (!decode(v, at, &in) || !step(v, &in, p, &last))
            return false;
        at = in.next;
        if (in.opcode == PL_OP_END)
            break;
    }
    p->length = at - p->start;
    return last < at || BAD_CODE(v, at - 1, "end stands before the byte %u that is jumped to", last);
}

/* Splits the code into pieces. */
static bool verify_code(verifier *v)
{
    const uint32_t length = v->program->code_length;
    uint32_t capacity = 0;
    for (uint32_t at = 0; at < length;
         at = v->pieces[v->piece_count - 1].start + v->pieces[v->piece_count - 1].length) {
        if (v->piece_count == capacity) {
            capacity = capacity ? 2 * capacity : 16;
            piece *grown = realloc(v->pieces, capacity * sizeof *grown);
            if (!grown)
                return pl_fail_memory(v->error, "code");
            v->pieces = grown;
        }
        piece *p = &v->pieces[v->piece_count++];
        *p = (piece){.start = at};
        if (!verify_piece(v, p))
            return false;
    }
    return true;
}

/* The piece that a node's code field means; NULL if no piece starts there. */
static const piece *find_piece(const verifier *v, uint32_t code)
{
    uint32_t low = 0, high = v->piece_count;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        if (v->pieces[middle].start < code - 1)
            low = middle + 1;
        else
            high = middle;
    }
    return low < v->piece_count && v->pieces[low].start == code - 1 ? &v->pieces[low] : NULL;
}

/* --- nodes --- */

#define BAD_NODE(v, node, format, ...) \
    pl_fail((v)->error, PL_ERROR_BYTECODE, "nodes", "node %u (%s): " format, (unsigned)(node), \
            pl_node_row_of((v)->program->nodes[node].kind)->name, __VA_ARGS__)

/* What a node's code may do. */
typedef struct use {
    uint8_t results;
    bool assigns, transforms, paints;
} use;

/* *found becomes what the code does; without code a piece that does nothing. */
static bool verify_use(const verifier *v, uint32_t node, uint32_t code, use allowed, const piece **found)
{
    static const piece nothing = {0};
    const piece *p = code ? find_piece(v, code) : &nothing;
    *found = p;
    if (!p)
        return BAD_NODE(v, node, "no code starts at byte %u", code - 1);
    if (p->results != allowed.results)
        return BAD_NODE(v, node, "its code leaves %u values, not %u", p->results, allowed.results);
    if (p->assigns && !allowed.assigns)
        return BAD_NODE(v, node, "%s", "its code assigns, as only a calculation may");
    if (p->transforms && !allowed.transforms)
        return BAD_NODE(v, node, "%s", "its code transforms, as only a transformation may");
    if (p->paints && !allowed.paints)
        return BAD_NODE(v, node, "%s", "its code sets a texture, as only a texture may");
    return true;
}

static bool verify_texture(const verifier *v, uint32_t node, const piece *code)
{
    const pl_node *n = &v->program->nodes[node];
    const pl_record *record = &v->program->records[n->as.texture.texture];
    if (record->kind != PL_RECORD_TEXTURE)
        return BAD_NODE(v, node, "record %u is no texture", n->as.texture.texture);
    if (code->texture_values > record->size)
        return BAD_NODE(v, node, "its code sets value %u of %u", code->texture_values - 1, record->size);
    if (n->as.texture.draws != (code->draws > 0))
        return BAD_NODE(v, node, "draws is %u, but its code draws %u times", n->as.texture.draws, code->draws);
    const uint32_t falls = v->falls[n->as.texture.texture];
    return falls == 0 || code->sets_positions ||
           BAD_NODE(v, node, "the colour map's position %u is below the one before it", falls);
}

/* A node's own fields. *draws becomes the most draws that its code makes. */
static bool verify_node(const verifier *v, uint32_t node, uint8_t *draws)
{
    const pl_program *program = v->program;
    const pl_node *n = &program->nodes[node];
    const piece *code = NULL;
    *draws = 0;
    switch (n->kind) {
    case PL_NODE_SYMBOL:
        return n->as.symbol.draws <= 1 || BAD_NODE(v, node, "draws is %u, not 0 or 1", n->as.symbol.draws);
    case PL_NODE_RULE:
        return n->as.rule.index < PL_LIMIT_NODES || BAD_NODE(v, node, "its index %u is too large", n->as.rule.index);
    case PL_NODE_BRANCH:
        if (!verify_use(v, node, n->as.branch.test, (use){.results = 1}, &code))
            return false;
        break;
    case PL_NODE_CHOOSE:
        if (n->as.choose.cases_count == 0)
            return BAD_NODE(v, node, "%s", "there are no cases");
        *draws = 1;
        for (uint32_t i = 0; i < n->as.choose.cases_count; i++) {
            if (!verify_use(v, node, program->cases[n->as.choose.cases_first + i].weight, (use){.results = 1}, &code))
                return false;
            *draws = add_draws(*draws, code->draws);
        }
        return true;
    case PL_NODE_CALCULATE:
        if (!verify_use(v, node, n->as.calculate.code, (use){.assigns = true}, &code))
            return false;
        break;
    case PL_NODE_TRANSFORM_CODE:
        if (!verify_use(v, node, n->as.transform_code.code, (use){.transforms = true}, &code))
            return false;
        break;
    case PL_NODE_TEXTURE:
        if (!verify_use(v, node, n->as.texture.code, (use){.paints = true}, &code) || !verify_texture(v, node, code))
            return false;
        break;
    case PL_NODE_UNION:
        return n->as.union_.children_count >= 2 ||
               BAD_NODE(v, node, "%u terms, at least 2", n->as.union_.children_count);
    case PL_NODE_ENTER:
        return program->nodes[n->as.enter.symbol].kind == PL_NODE_SYMBOL ||
               BAD_NODE(v, node, "node %u is no symbol", n->as.enter.symbol);
    case PL_NODE_PRIMITIVE: {
        const pl_shape_row *shape = pl_shape_row_of(n->as.primitive.shape);
        if (!shape->name)
            return BAD_NODE(v, node, "there is no shape %u", n->as.primitive.shape);
        if (!verify_use(v, node, n->as.primitive.code, (use){.results = shape->arguments}, &code))
            return false;
        break;
    }
    default: return true;
    }
    *draws = code->draws;
    return true;
}

static bool verify_records(const verifier *v)
{
    static const uint32_t colours[] = {[PL_PATTERN_SOLID] = 1, [PL_PATTERN_CHECKER] = 2};
    for (uint32_t i = 0; i < v->program->record_count; i++) {
        const pl_record *record = &v->program->records[i];
        if (record->kind != PL_RECORD_TEXTURE)
            continue;
        const double pattern = record->values[PL_TEXTURE_PATTERN];
        if (!(pattern >= 0 && pattern <= PL_PATTERN_GRADIENT && pattern == (uint32_t)pattern))
            return pl_fail(v->error, PL_ERROR_BYTECODE, "records", "record %u: there is no pattern %.17g", i,
                           pattern);
        const bool fits =
            pattern == PL_PATTERN_GRADIENT ? record->entries >= 1 : record->entries == colours[(uint32_t)pattern];
        if (!fits)
            return pl_fail(v->error, PL_ERROR_BYTECODE, "records", "record %u: %u colours don't fit the pattern %s",
                           i, record->entries, pl_pattern_name((uint32_t)pattern));
        for (uint32_t k = 1; pattern == PL_PATTERN_GRADIENT && k < record->entries && !v->falls[i]; k++) {
            const double *entry = record->values + PL_TEXTURE_VALUES + (size_t)k * PL_TEXTURE_ENTRY;
            if (entry[PL_TEXTURE_ENTRY_POSITION] < (entry - PL_TEXTURE_ENTRY)[PL_TEXTURE_ENTRY_POSITION])
                v->falls[i] = k;
        }
    }
    return true;
}

/* --- graph --- */

/* Child i of a node in derivation order, without an enter node's symbol; UINT32_MAX: there are no more. */
static uint32_t child_of(const pl_program *program, uint32_t node, uint32_t i)
{
    const pl_node *n = &program->nodes[node];
    switch (n->kind) {
    case PL_NODE_BRANCH: return i == 0 ? n->as.branch.then : i == 1 ? n->as.branch.otherwise : UINT32_MAX;
    case PL_NODE_CHOOSE:
        return i < n->as.choose.cases_count ? program->cases[n->as.choose.cases_first + i].body : UINT32_MAX;
    case PL_NODE_UNION:
        return i < n->as.union_.children_count ? program->children[n->as.union_.children_first + i] : UINT32_MAX;
    default: break;
    }
    if (i > 0)
        return UINT32_MAX;
    switch (n->kind) {
    case PL_NODE_SYMBOL: return n->as.symbol.body;
    case PL_NODE_RULE: return n->as.rule.body;
    case PL_NODE_CALCULATE: return n->as.calculate.child;
    case PL_NODE_TRANSFORM: return n->as.transform.child;
    case PL_NODE_TRANSFORM_CODE: return n->as.transform_code.child;
    case PL_NODE_TEXTURE: return n->as.texture.child;
    case PL_NODE_OBJECT: return n->as.object.child;
    case PL_NODE_NO_SHADOW: return n->as.no_shadow.child;
    default: return UINT32_MAX;
    }
}

typedef struct visit {
    uint32_t node, next; /* child to look at next */
} visit;

enum { NEW = 0, OPEN, DONE };

/* Depth first from `start` through nodes not visited before. draws[n] becomes the most draws from n to the end of the
 * application that n stands in. */
static bool search(const verifier *v, uint32_t start, uint8_t *state, uint8_t *draws, visit *stack)
{
    const pl_program *program = v->program;
    uint32_t height = 0;
    stack[height++] = (visit){start, 0};
    state[start] = OPEN;
    while (height > 0) {
        visit *top = &stack[height - 1];
        const uint32_t child = child_of(program, top->node, top->next);
        if (child == UINT32_MAX) {
            uint8_t own = 0, below = 0, found;
            if (!verify_node(v, top->node, &own))
                return false;
            for (uint32_t i = 0, c; (c = child_of(program, top->node, i)) != UINT32_MAX; i++) {
                found = program->nodes[c].kind == PL_NODE_SYMBOL ? 0 : draws[c];
                below = found > below ? found : below;
            }
            draws[top->node] = add_draws(own, below);
            if (draws[top->node] == DRAWS_TOO_MANY)
                return BAD_NODE(v, top->node, "more than %d draws in one application",
                                PL_LIMIT_DRAWS_PER_APPLICATION);
            state[top->node] = DONE;
            height--;
        } else if (state[child] == OPEN) {
            return BAD_NODE(v, child, "%s", "it contains itself without entering a symbol");
        } else {
            top->next++;
            if (state[child] == NEW) {
                state[child] = OPEN;
                stack[height++] = (visit){child, 0};
            }
        }
    }
    return true;
}

/* Objects stand at the top and nowhere else. top[n] is set for the unions from the root down to the objects. */
static bool verify_top(const verifier *v, uint8_t *top, visit *stack)
{
    const pl_program *program = v->program;
    uint32_t height = 0;
    const uint8_t root = program->nodes[0].kind;
    if (root != PL_NODE_EMPTY && root != PL_NODE_OBJECT && root != PL_NODE_UNION)
        return BAD_NODE(v, 0, "%s", "the root is no object, nor a union of objects");
    if (root == PL_NODE_UNION) {
        top[0] = 1;
        stack[height++] = (visit){0, 0};
    }
    while (height > 0) {
        visit *visited = &stack[height - 1];
        const uint32_t child = child_of(program, visited->node, visited->next++);
        if (child == UINT32_MAX) {
            height--;
            continue;
        }
        const uint8_t kind = program->nodes[child].kind;
        if (kind != PL_NODE_EMPTY && kind != PL_NODE_OBJECT && kind != PL_NODE_UNION)
            return BAD_NODE(v, child, "%s", "it stands beside objects, but is none");
        if (kind == PL_NODE_UNION && !top[child]) {
            top[child] = 1;
            stack[height++] = (visit){child, 0};
        }
    }
    for (uint32_t node = 0; node < program->node_count; node++)
        for (uint32_t i = 0, c; !top[node] && (c = child_of(program, node, i)) != UINT32_MAX; i++)
            if (program->nodes[c].kind == PL_NODE_OBJECT || top[c])
                return BAD_NODE(v, node, "%s", "an object stands below it");
    return true;
}

static bool verify_graph(const verifier *v)
{
    const uint32_t count = v->program->node_count;
    uint8_t *state = calloc(count, 1), *draws = calloc(count, 1), *top = calloc(count, 1);
    visit *stack = malloc(count * sizeof *stack);
    bool fine = state && draws && top && stack;
    if (!fine)
        pl_fail_memory(v->error, "nodes");
    for (uint32_t node = 0; node < count && fine; node++)
        fine = state[node] != NEW || search(v, node, state, draws, stack);
    fine = fine && verify_top(v, top, stack);
    free(state);
    free(draws);
    free(top);
    free(stack);
    return fine;
}

bool pl_program_verify(const pl_program *program, pl_error *error)
{
    verifier v = {.program = program, .error = error};
    v.depth = calloc((size_t)program->code_length + 1, 1);
    v.draws = calloc((size_t)program->code_length + 1, 1);
    v.falls = calloc((size_t)program->record_count + 1, sizeof *v.falls);
    bool fine = v.depth && v.draws && v.falls;
    if (!fine)
        pl_fail_memory(error, "bytecode");
    fine = fine && verify_code(&v) && verify_records(&v) && verify_graph(&v);
    free(v.depth);
    free(v.draws);
    free(v.falls);
    free(v.pieces);
    return fine;
}
