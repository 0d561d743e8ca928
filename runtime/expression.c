/* expression.c - the stack machine (see expression.h, bytecode.toml).
 *
 * Code was verified when it was loaded: operands are in range, the stack neither under- nor overflows, jumps go
 * forward to instructions. What remains to be checked are values. */
#include "expression.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "elementary.h"
#include "error.h"
#include "random.h"
#include "table.h"

static bool is_finite(double a)
{
    return a - a == 0;
}

/* --- scopes --- */

static void copy_draws(const pl_scope *scope, pl_scope *target)
{
    target->key = scope->key;
    target->symbol = scope->symbol;
    target->draws = scope->draws;
    memcpy(target->drawn, scope->drawn, scope->draws * sizeof *scope->drawn);
}

void pl_scope_copy(const pl_program *program, const pl_scope *scope, pl_scope *target)
{
    copy_draws(scope, target);
    if (program->parameter_count)
        memcpy(target->parameters, scope->parameters, program->parameter_count * sizeof *scope->parameters);
}

void pl_scope_object(const pl_program *program, uint32_t node, pl_scope *scope)
{
    const pl_node *n = &program->nodes[node];
    for (uint32_t i = 0; i < program->parameter_count; i++)
        scope->parameters[i] = NAN;
    scope->key = pl_mix(pl_mix(program->seed_key, program->strings[n->as.object.name].hash), n->as.object.ordinal);
    scope->symbol = UINT32_MAX;
    scope->draws = 0;
}

void pl_scope_enter(const pl_program *program, uint32_t node, pl_scope *scope)
{
    scope->key = pl_mix(scope->key, program->strings[program->nodes[node].as.symbol.name].hash);
    scope->symbol = node;
    scope->draws = 0;
}

void pl_scope_term(pl_scope *scope, uint32_t term)
{
    scope->key = pl_term_key(scope->key, term);
}

/* The next draw on a stream of this application. */
static double draw(pl_scope *scope, uint64_t stream_bits)
{
    uint32_t ordinal = 0;
    for (uint32_t i = 0; i < scope->draws; i++)
        ordinal += scope->drawn[i] == stream_bits;
    scope->drawn[scope->draws++] = stream_bits;
    return pl_rand(scope->key, stream_bits, ordinal);
}

/* --- messages --- */

typedef struct machine {
    const pl_program *program;
    uint32_t node;
    pl_scope *scope;
    pl_result *result;
    pl_error *error;
} machine;

static const char *number(double value, char buffer[PL_NUMBER_TEXT])
{
    if (value != value)
        return "NaN";
    return is_finite(value) ? pl_number_text(value, buffer) : value > 0 ? "infinity" : "-infinity";
}

/* "Tree, C_Tree" or "Tree": where the code stands. */
static void say_where(const machine *m, char *text, size_t size)
{
    const pl_program *program = m->program;
    const pl_node *n = &program->nodes[m->node];
    uint32_t name = 0;
    if (n->kind == PL_NODE_CALCULATE || n->kind == PL_NODE_TRANSFORM_CODE || n->kind == PL_NODE_TEXTURE)
        name = n->as.words[0];
    const char *symbol = m->scope->symbol < program->node_count
                             ? program->strings[program->nodes[m->scope->symbol].as.symbol.name].text
                             : "";
    const char *operator_ = program->strings[name].text;
    snprintf(text, size, "%s%s%s%s", symbol, *symbol && *operator_ ? ", " : "", operator_,
             *symbol || *operator_ ? ": " : "");
}

/* " (betaBr = 60, cntTree = 10)": the parameters that have values, as far as there is room. */
static void say_values(const machine *m, char *text, size_t size)
{
    size_t used = 0;
    text[0] = '\0';
    for (uint32_t i = 0; i < m->program->parameter_count; i++) {
        char buffer[PL_NUMBER_TEXT];
        const pl_string *name = &m->program->strings[m->program->parameters[i]];
        if (m->scope->parameters[i] != m->scope->parameters[i])
            continue;
        if (used + name->length + PL_NUMBER_TEXT + 8 > size)
            break;
        used += (size_t)snprintf(text + used, size - used, "%s%s = %s", used ? ", " : " (", name->text,
                                 number(m->scope->parameters[i], buffer));
    }
    if (used)
        snprintf(text + used, size - used, ")");
}

#define FAIL(m, format, ...) \
    do { \
        char where[128], values[192]; \
        say_where(m, where, sizeof where); \
        say_values(m, values, sizeof values); \
        return pl_fail_at((m)->error, PL_ERROR_SCENE, (m)->program, (m)->node, "%s" format "%s", where, __VA_ARGS__, \
                          values); \
    } while (0)

static const char *parameter_name(const machine *m, uint32_t slot)
{
    return m->program->strings[m->program->parameters[slot]].text;
}

static bool fail_unset(const machine *m, uint32_t slot)
{
    FAIL(m, "the parameter %s is read before it has a value", parameter_name(m, slot));
}

static bool fail_value(const machine *m, const char *what, double value)
{
    char buffer[PL_NUMBER_TEXT];
    FAIL(m, "%s is %s", what, number(value, buffer));
}

static bool fail_store(const machine *m, uint32_t slot, double value)
{
    char buffer[PL_NUMBER_TEXT];
    FAIL(m, "the parameter %s would become %s", parameter_name(m, slot), number(value, buffer));
}

static bool fail_texture(const machine *m, uint32_t index, double value)
{
    char buffer[PL_NUMBER_TEXT];
    uint32_t first, size;
    const char *name = index < PL_TEXTURE_VALUES
                           ? pl_record_value_name(PL_RECORD_TEXTURE, index, &first, &size)
                           : pl_record_entry_name(PL_RECORD_TEXTURE, (index - PL_TEXTURE_VALUES) % PL_TEXTURE_ENTRY);
    FAIL(m, "the texture's %s would become %s", name, number(value, buffer));
}

static bool fail_argument(const machine *m, const char *operation, int position, double value)
{
    char buffer[PL_NUMBER_TEXT];
    FAIL(m, "argument %d of %s is %s", position, operation, number(value, buffer));
}

static bool fail_matrix(const machine *m)
{
    FAIL(m, "%s", "the transformation's matrix isn't finite");
}

static bool fail_axis(const machine *m)
{
    FAIL(m, "%s", "rot needs an axis, <0, 0, 0> is none");
}

static bool fail_variants(const machine *m, double count)
{
    char buffer[PL_NUMBER_TEXT];
    FAIL(m, "variants needs a whole number from 1 to 4294967296, not %s", number(count, buffer));
}

static bool fail_weights(const machine *m, double total)
{
    char buffer[PL_NUMBER_TEXT];
    FAIL(m, "the weights' sum is %s", number(total, buffer));
}

/* --- transformations --- */

/* M := M * R for a rotation in the plane of axes i and j, from i towards j. */
static void rotate_plane(pl_affine *matrix, int i, int j, double degrees)
{
    double c, s;
    pl_sin_cos(degrees, &s, &c);
    for (int r = 0; r < 3; r++) {
        double *row = matrix->m + 4 * r;
        const double a = row[i], b = row[j];
        row[i] = a * c + b * s;
        row[j] = b * c - a * s;
    }
}

/* Rodrigues' rotation by a[0] degrees about the axis a[1..3]; false if that is zero. The axis is scaled by its
 * largest component before it is normalised, so that no square over- or underflows. */
static bool rotation(const double a[4], pl_affine *out)
{
    const double largest = pl_max(fabs(a[1]), pl_max(fabs(a[2]), fabs(a[3])));
    if (largest == 0)
        return false;
    double x = a[1] / largest, y = a[2] / largest, z = a[3] / largest;
    const double length = sqrt(x * x + y * y + z * z);
    x /= length;
    y /= length;
    z /= length;
    double c, s;
    pl_sin_cos(a[0], &s, &c);
    const double t = 1 - c;
    *out = (pl_affine){{t * x * x + c, t * x * y - s * z, t * x * z + s * y, 0,
                        t * x * y + s * z, t * y * y + c, t * y * z - s * x, 0,
                        t * x * z - s * y, t * y * z + s * x, t * z * z + c, 0}};
    return true;
}

/* M := M * step; a holds the opcode's arguments. */
static bool transform(const machine *m, uint8_t opcode, const double *a)
{
    pl_affine *matrix = &m->result->matrix, step = pl_affine_identity();
    const pl_op_row *row = pl_op_row_of(opcode);
    for (int i = 0; i < row->pops; i++)
        if (!is_finite(a[i]))
            /* In the text both kinds of scale are one word. */
            return fail_argument(m, opcode == PL_OP_SCALE_UNIFORM ? "scale" : row->name, i + 1, a[i]);
    switch (opcode) {
    case PL_OP_TRANS:
        for (int r = 0; r < 3; r++) {
            double *to = matrix->m + 4 * r;
            to[3] = to[0] * a[0] + to[1] * a[1] + to[2] * a[2] + to[3];
        }
        return true;
    case PL_OP_ROTX: rotate_plane(matrix, 1, 2, a[0]); return true;
    case PL_OP_ROTY: rotate_plane(matrix, 2, 0, a[0]); return true;
    case PL_OP_ROTZ: rotate_plane(matrix, 0, 1, a[0]); return true;
    case PL_OP_SCALE:
    case PL_OP_SCALE_UNIFORM:
        for (int i = 0; i < 12; i++)
            if (i % 4 != 3)
                matrix->m[i] *= opcode == PL_OP_SCALE ? a[i % 4] : a[0];
        return true;
    case PL_OP_ROT:
        if (!rotation(a, &step))
            return fail_axis(m);
        break;
    case PL_OP_SHEAR: step = (pl_affine){{1, a[0], a[1], 0, a[2], 1, a[3], 0, a[4], a[5], 1, 0}}; break;
    default: /* matrix: images of x, y, z, then the origin's */
        for (int i = 0; i < 12; i++)
            step.m[4 * (i % 3) + i / 3] = a[i];
        break;
    }
    *matrix = pl_affine_multiply(matrix, &step);
    return true;
}

/* --- the machine --- */

static uint32_t operand(const uint8_t **at)
{
    uint32_t value = 0;
    for (int shift = 0;; shift += 7) {
        const uint8_t byte = *(*at)++;
        value |= (uint32_t)(byte & 0x7F) << shift;
        if (!(byte & 0x80))
            return value;
    }
}

static bool variants(const machine *m, uint32_t name, double count)
{
    if (!(count >= 1 && count <= 0x1p32 && count == pl_floor(count)))
        return fail_variants(m, count);
    m->scope->key =
        pl_mix(pl_mix(m->program->seed_key, m->program->strings[name].hash), m->scope->key % (uint64_t)count);
    return true;
}

static bool check_finite(const machine *m, const char *function, const double *values, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        if (!is_finite(values[i]))
            return fail_argument(m, function, (int)i + 1, values[i]);
    return true;
}

/* Runs from `at` to the end. `top` is the first free place of the stack. */
static bool run(const machine *m, const uint8_t *at)
{
    const pl_program *program = m->program;
    double *top = m->result->values;
    uint32_t index;
    for (;;) {
        const uint8_t opcode = *at++;
        switch (opcode) {
        case PL_OP_END: m->result->count = (uint32_t)(top - m->result->values); return true;
        case PL_OP_CONST: *top++ = program->constants[operand(&at)]; break;
        case PL_OP_LOAD:
            index = operand(&at);
            *top = m->scope->parameters[index];
            if (*top != *top)
                return fail_unset(m, index);
            top++;
            break;
        case PL_OP_STORE:
            index = operand(&at);
            top--;
            if (!is_finite(*top))
                return fail_store(m, index, *top);
            m->scope->parameters[index] = *top;
            break;
        case PL_OP_JUMP:
            index = operand(&at);
            at += index;
            break;
        case PL_OP_JUMP_IF_ZERO:
            index = operand(&at);
            if (*--top == 0)
                at += index;
            break;
        case PL_OP_RAND:
            if (!check_finite(m, "rand", top - 1, 1))
                return false;
            top[-1] = draw(m->scope, pl_bits(top[-1]));
            break;
        case PL_OP_HASH:
            index = operand(&at);
            top -= index;
            if (!check_finite(m, "hash", top, index))
                return false;
            *top = pl_hash(program->seed_key, index, top);
            top++;
            break;
        case PL_OP_VARIANTS:
            index = operand(&at);
            if (!variants(m, index, *--top))
                return false;
            break;
        case PL_OP_TEXTURE_SET:
            index = operand(&at);
            top--;
            if (!is_finite(*top))
                return fail_texture(m, index, *top);
            m->result->texture[index] = *top;
            break;
        case PL_OP_ADD: top--, top[-1] += *top; break;
        case PL_OP_SUBTRACT: top--, top[-1] -= *top; break;
        case PL_OP_MULTIPLY: top--, top[-1] *= *top; break;
        default: {
            const pl_op_row *row = pl_op_row_of(opcode);
            top -= row->pops;
            if (row->pushes) {
                const double a = top[0], b = row->pops > 1 ? top[1] : 0, c = row->pops > 2 ? top[2] : 0;
                *top++ = pl_elementary(opcode, a, b, c);
            } else if (!transform(m, opcode, top)) {
                return false;
            }
        }
        }
    }
}

bool pl_run(const pl_program *program, uint32_t node, uint32_t code, pl_scope *scope, pl_result *result,
            pl_error *error)
{
    const machine m = {program, node, scope, result, error};
    result->count = 0;
    result->matrix = pl_affine_identity();
    if (code == 0)
        return true;
    if (!run(&m, program->code + code - 1))
        return false;
    for (int i = 0; i < 12; i++)
        if (!is_finite(result->matrix.m[i]))
            return fail_matrix(&m);
    const uint8_t kind = program->nodes[node].kind;
    for (uint32_t i = 0; i < result->count; i++) {
        if (is_finite(result->values[i]))
            continue;
        if (kind == PL_NODE_PRIMITIVE)
            return fail_argument(&m, pl_shape_row_of(program->nodes[node].as.primitive.shape)->name, (int)i + 1,
                                 result->values[i]);
        return fail_value(&m, kind == PL_NODE_BRANCH ? "the condition" : "a weight", result->values[i]);
    }
    return true;
}

bool pl_branch(const pl_program *program, uint32_t node, pl_scope *scope, uint32_t *child, pl_error *error)
{
    const pl_node *n = &program->nodes[node];
    pl_result result;
    result.texture = NULL;
    if (!pl_run(program, node, n->as.branch.test, scope, &result, error))
        return false;
    *child = result.values[0] != 0 ? n->as.branch.then : n->as.branch.otherwise;
    return true;
}

/* Two passes over the weights, so that no case needs memory: the first sums them up, the second, from the same scope
 * and so with the same draws, finds the case. */
bool pl_choose(const pl_program *program, uint32_t node, pl_scope *scope, uint32_t *child, pl_error *error)
{
    const pl_node *n = &program->nodes[node];
    const pl_case *cases = program->cases + n->as.choose.cases_first;
    const uint32_t count = n->as.choose.cases_count, draws_before = scope->draws;
    const machine m = {program, node, scope, NULL, error};
    pl_result result;
    double total = 0, sum = 0;
    result.texture = NULL;
    for (uint32_t i = 0; i < count; i++) {
        if (!pl_run(program, node, cases[i].weight, scope, &result, error))
            return false;
        if (result.values[0] < 0)
            return fail_value(&m, "a weight", result.values[0]);
        total += result.values[0];
    }
    if (!(total > 0) || !is_finite(total))
        return fail_weights(&m, total);
    const double threshold = draw(scope, PL_RANDOM_CHOICE_STREAM) * total;
    const uint32_t draws_after = scope->draws;
    scope->draws = draws_before;
    for (uint32_t i = 0; i < count && !(sum > threshold); i++) {
        if (!pl_run(program, node, cases[i].weight, scope, &result, error))
            return false;
        sum += result.values[0];
        if (result.values[0] > 0) /* the product of a denormal total may round up to it: then the last one counts */
            *child = cases[i].body;
    }
    scope->draws = draws_after;
    return true;
}
