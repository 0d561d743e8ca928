/* interval.c - interval arithmetic over the bytecode (interval.h; Moore 1966). */
#include "interval.h"

#include <math.h>
#include <string.h>

#include "elementary.h"
#include "table.h"

/* Undecided jumps that one piece of code may have. */
enum { MOST_FORKS = 10, MOST_PARAMETERS = 256 };

static const pl_range everything = {-INFINITY, INFINITY}, truths = {0.0, 1.0};

/* Our functions err by less than an ulp; two ulps outward, and a denormal one for zeros, are enough. */
static pl_range outward(double lo, double hi)
{
    lo -= fabs(lo) * 0x1p-51 + 0x1p-1074;
    hi += fabs(hi) * 0x1p-51 + 0x1p-1074;
    return isnan(lo) || isnan(hi) ? everything : (pl_range){lo, hi};
}

pl_range pl_range_add(pl_range a, pl_range b)
{
    return outward(a.lo + b.lo, a.hi + b.hi);
}

/* 0 · infinity counts as 0: the infinite end is no value itself. */
static double product(double a, double b)
{
    return a == 0.0 || b == 0.0 ? 0.0 : a * b;
}

pl_range pl_range_multiply(pl_range a, pl_range b)
{
    double p = product(a.lo, b.lo), q = product(a.lo, b.hi), r = product(a.hi, b.lo), s = product(a.hi, b.hi);
    return outward(fmin(fmin(p, q), fmin(r, s)), fmax(fmax(p, q), fmax(r, s)));
}

static pl_range divide(pl_range a, pl_range b)
{
    if (b.lo <= 0.0 && b.hi >= 0.0) return everything;
    return pl_range_multiply(a, outward(1.0 / b.hi, 1.0 / b.lo));
}

static bool contains(pl_range a, double x)
{
    return a.lo <= x && x <= a.hi;
}

static double most(pl_range a)
{
    return fmax(fabs(a.lo), fabs(a.hi));
}

static double least(pl_range a)
{
    return contains(a, 0.0) ? 0.0 : fmin(fabs(a.lo), fabs(a.hi));
}

/* sin where the phase is 90, cos where it is 0: between extremes, which stand at phase + k·180, it is monotone. */
static pl_range wave(int opcode, pl_range a, double phase)
{
    if (!(a.hi - a.lo < 360.0)) return (pl_range){-1.0, 1.0};
    double p = pl_elementary(opcode, a.lo, 0, 0), q = pl_elementary(opcode, a.hi, 0, 0);
    pl_range r = outward(fmin(p, q), fmax(p, q));
    if (!(most(a) < 0x1p40)) return (pl_range){-1.0, 1.0};
    for (double k = floor((a.lo - phase) / 180.0) - 1.0; k <= ceil((a.hi - phase) / 180.0) + 1.0; k++) {
        if (!contains(outward(a.lo, a.hi), phase + 180.0 * k)) continue;
        if (fmod(k, 2.0) == 0.0) r.hi = 1.0;
        else r.lo = -1.0;
    }
    return (pl_range){fmax(r.lo, -1.0), fmin(r.hi, 1.0)};
}

static pl_range rising(int opcode, pl_range a)
{
    return outward(pl_elementary(opcode, a.lo, 0, 0), pl_elementary(opcode, a.hi, 0, 0));
}

/* 1, 0 or either. */
static pl_range truth(bool surely, bool surely_not)
{
    return surely ? pl_range_of(1.0) : surely_not ? pl_range_of(0.0) : truths;
}

static pl_range compare(int opcode, pl_range a, pl_range b)
{
    switch (opcode) {
    case PL_OP_LESS: return truth(a.hi < b.lo, a.lo >= b.hi);
    case PL_OP_LESS_EQUAL: return truth(a.hi <= b.lo, a.lo > b.hi);
    case PL_OP_GREATER: return truth(a.lo > b.hi, a.hi <= b.lo);
    case PL_OP_GREATER_EQUAL: return truth(a.lo >= b.hi, a.hi < b.lo);
    case PL_OP_EQUAL: return truth(pl_range_is_point(a) && pl_range_is_point(b) && a.lo == b.lo, a.hi < b.lo || b.hi < a.lo);
    default: return truth(a.hi < b.lo || b.hi < a.lo, pl_range_is_point(a) && pl_range_is_point(b) && a.lo == b.lo);
    }
}

static pl_range power(pl_range a, pl_range b)
{
    if (!(a.lo > 0.0)) return everything;
    pl_range r = {INFINITY, -INFINITY};
    for (int i = 0; i < 4; i++) {
        double p = pl_pow(i & 1 ? a.hi : a.lo, i & 2 ? b.hi : b.lo);
        r = (pl_range){fmin(r.lo, p), fmax(r.hi, p)};
    }
    if (contains(a, 1.0) || contains(b, 0.0)) r = pl_range_join(r, pl_range_of(1.0));
    return outward(r.lo, r.hi);
}

static pl_range modulo(pl_range a, pl_range b)
{
    double most = fmax(fabs(b.lo), fabs(b.hi));
    if (pl_range_is_point(b) && a.lo >= 0.0 && a.hi < fabs(b.lo)) return a;
    return (pl_range){a.lo < 0.0 ? fmax(a.lo, -most) : 0.0, a.hi > 0.0 ? fmin(a.hi, most) : 0.0};
}

pl_range pl_range_apply(int opcode, pl_range a, pl_range b, pl_range c)
{
    const int pops = pl_op_row_of((uint32_t)opcode)->pops;
    if (isnan(a.lo) || (pops > 1 && isnan(b.lo)) || (pops > 2 && isnan(c.lo))) return everything;
    if (pl_range_is_point(a) && (pops < 2 || pl_range_is_point(b)) && (pops < 3 || pl_range_is_point(c))) {
        double value = pl_elementary(opcode, a.lo, b.lo, c.lo);
        return isnan(value) ? everything : pl_range_of(value);
    }
    switch (opcode) {
    case PL_OP_ADD: return pl_range_add(a, b);
    case PL_OP_SUBTRACT: return pl_range_add(a, (pl_range){-b.hi, -b.lo});
    case PL_OP_MULTIPLY: return pl_range_multiply(a, b);
    case PL_OP_DIVIDE: return divide(a, b);
    case PL_OP_MODULO: return modulo(a, b);
    case PL_OP_NEGATE: return (pl_range){-a.hi, -a.lo};
    case PL_OP_BOOL: return truth(a.lo > 0.0 || a.hi < 0.0, false);
    case PL_OP_NOT: return truth(false, a.lo > 0.0 || a.hi < 0.0);
    case PL_OP_LESS:
    case PL_OP_LESS_EQUAL:
    case PL_OP_GREATER:
    case PL_OP_GREATER_EQUAL:
    case PL_OP_EQUAL:
    case PL_OP_NOT_EQUAL: return compare(opcode, a, b);
    case PL_OP_ABS:
        if (a.lo >= 0.0) return a;
        return (pl_range){a.hi <= 0.0 ? -a.hi : 0.0, fmax(-a.lo, a.hi)};
    case PL_OP_SIGN:
    case PL_OP_FLOOR:
    case PL_OP_CEIL:
    case PL_OP_ROUND:
        return (pl_range){pl_elementary(opcode, a.lo, 0, 0), pl_elementary(opcode, a.hi, 0, 0)};
    case PL_OP_MIN: return (pl_range){fmin(a.lo, b.lo), fmin(a.hi, b.hi)};
    case PL_OP_MAX: return (pl_range){fmax(a.lo, b.lo), fmax(a.hi, b.hi)};
    case PL_OP_CLAMP: return (pl_range){fmin(fmax(a.lo, b.lo), c.lo), fmin(fmax(a.hi, b.hi), c.hi)};
    case PL_OP_MIX: {
        pl_range rest = pl_range_add(pl_range_of(1.0), (pl_range){-c.hi, -c.lo});
        return pl_range_add(pl_range_multiply(a, rest), pl_range_multiply(b, c));
    }
    case PL_OP_POW: return power(a, b);
    case PL_OP_EXP: return rising(opcode, a);
    case PL_OP_LOG: return a.lo > 0.0 ? rising(opcode, a) : (pl_range){-INFINITY, outward(0, pl_log(a.hi)).hi};
    case PL_OP_SQRT: return a.hi >= 0.0 ? rising(opcode, (pl_range){fmax(a.lo, 0.0), a.hi}) : everything;
    case PL_OP_SIN: return wave(opcode, a, 90.0);
    case PL_OP_COS: return wave(opcode, a, 0.0);
    case PL_OP_ASIN: return rising(opcode, (pl_range){fmax(a.lo, -1.0), fmin(a.hi, 1.0)});
    case PL_OP_ACOS: {
        pl_range r = rising(opcode, (pl_range){fmax(a.lo, -1.0), fmin(a.hi, 1.0)});
        return (pl_range){fmin(r.lo, r.hi), fmax(r.lo, r.hi)};
    }
    case PL_OP_ATAN2: return (pl_range){-180.0, 180.0};
    default: return everything;
    }
}

/* --- transformations --- */

static void identity(pl_range_map *map)
{
    for (int i = 0; i < 12; i++) map->m[i] = pl_range_of(i % 5 == 0 ? 1.0 : 0.0);
    map->stretch = map->inverse_stretch = 1.0;
    map->step_count = 0;
    memset(map->steps, 0, sizeof map->steps); /* maps are compared byte by byte */
}

/* Entries of matrices: zeros and ones, of which there are many, stay exact. */
static pl_range times(pl_range a, pl_range b)
{
    if (a.lo == a.hi && (a.lo == 0.0 || a.lo == 1.0)) return a.lo == 0.0 ? a : b;
    if (b.lo == b.hi && (b.lo == 0.0 || b.lo == 1.0)) return b.lo == 0.0 ? b : a;
    return pl_range_multiply(a, b);
}

static pl_range plus(pl_range a, pl_range b)
{
    if (a.lo == 0.0 && a.hi == 0.0) return b;
    if (b.lo == 0.0 && b.hi == 0.0) return a;
    return pl_range_add(a, b);
}

static void multiply(pl_range_map *map, const pl_range step[12])
{
    for (int r = 0; r < 3; r++) {
        pl_range row[4], *m = map->m + 4 * r;
        memcpy(row, m, sizeof row);
        for (int c = 0; c < 4; c++) {
            m[c] = plus(plus(times(row[0], step[c]), times(row[1], step[4 + c])), times(row[2], step[8 + c]));
            if (c == 3) m[3] = plus(m[3], row[3]);
        }
    }
}

/* Stretches of a general linear part: the Frobenius norm, and that of the adjugate over the determinant. */
static void general_stretch(const pl_range s[12], double *stretch, double *inverse)
{
    double square = 0.0, adjugate = 0.0;
    pl_range determinant = pl_range_of(0.0);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            const int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
            pl_range p = pl_range_multiply(s[4 * r1 + c1], s[4 * r2 + c2]);
            pl_range q = pl_range_multiply(s[4 * r1 + c2], s[4 * r2 + c1]);
            pl_range minor = pl_range_add(p, (pl_range){-q.hi, -q.lo});
            square += most(s[4 * r + c]) * most(s[4 * r + c]);
            adjugate += most(minor) * most(minor);
            if (r == 0) determinant = pl_range_add(determinant, pl_range_multiply(s[c], minor));
        }
    *stretch = sqrt(square) * (1.0 + 1e-12);
    *inverse = least(determinant) > 0.0 ? sqrt(adjugate) / least(determinant) * (1.0 + 1e-12) : INFINITY;
}

static void rotate(pl_range_map *map, int i, int j, pl_range degrees)
{
    const pl_range c = pl_range_apply(PL_OP_COS, degrees, degrees, degrees), s = pl_range_apply(PL_OP_SIN, degrees, degrees, degrees);
    for (int r = 0; r < 3; r++) {
        pl_range *row = map->m + 4 * r, a = row[i], b = row[j];
        row[i] = plus(times(a, c), times(b, s));
        row[j] = plus(times(b, c), times(a, (pl_range){-s.hi, -s.lo}));
    }
}

static void scale_columns(pl_range_map *map, const pl_range *a, int step)
{
    double largest = 0.0, smallest = INFINITY;
    for (int c = 0; c < 3; c++) {
        for (int r = 0; r < 3; r++) map->m[4 * r + c] = times(map->m[4 * r + c], a[step * c]);
        largest = fmax(largest, most(a[step * c]));
        smallest = fmin(smallest, least(a[step * c]));
    }
    map->stretch *= largest;
    map->inverse_stretch *= smallest > 0.0 ? 1.0 / smallest : INFINITY;
}

static void general_step(pl_range_map *map, const pl_range step[12])
{
    double stretch, inverse;
    general_stretch(step, &stretch, &inverse);
    map->stretch *= stretch;
    map->inverse_stretch *= inverse;
    multiply(map, step);
}

static void note_step(pl_range_map *map, uint8_t opcode, const pl_range *a)
{
    const bool simple = opcode >= PL_OP_TRANS && opcode <= PL_OP_SCALE_UNIFORM && opcode != PL_OP_ROT;
    if (!simple || map->step_count == PL_RANGE_STEPS) map->step_count = -1;
    if (map->step_count < 0) return;
    pl_range_step *step = &map->steps[map->step_count++];
    step->opcode = opcode;
    for (int i = 0; i < 3; i++) step->arguments[i] = i < pl_op_row_of(opcode)->pops ? a[i] : a[0];
}

/* M := M · step; false: nothing is known. */
static bool transform(pl_range_map *map, uint8_t opcode, const pl_range *a)
{
    pl_range step[12];
    for (int i = 0; i < 12; i++) step[i] = pl_range_of(i % 5 == 0 ? 1.0 : 0.0);
    for (int i = 0; i < pl_op_row_of(opcode)->pops; i++)
        if (!(isfinite(a[i].lo) && isfinite(a[i].hi))) return false;
    note_step(map, opcode, a);
    switch (opcode) {
    case PL_OP_TRANS:
        for (int r = 0; r < 3; r++) {
            pl_range *row = map->m + 4 * r;
            row[3] = plus(plus(plus(times(row[0], a[0]), times(row[1], a[1])), times(row[2], a[2])), row[3]);
        }
        break;
    case PL_OP_ROTX: rotate(map, 1, 2, a[0]); break;
    case PL_OP_ROTY: rotate(map, 2, 0, a[0]); break;
    case PL_OP_ROTZ: rotate(map, 0, 1, a[0]); break;
    case PL_OP_SCALE: scale_columns(map, a, 1); break;
    case PL_OP_SCALE_UNIFORM: scale_columns(map, a, 0); break;
    case PL_OP_ROT: /* any rotation: entries are within [-1, 1] */
        for (int i = 0; i < 12; i++)
            if (i % 4 != 3) step[i] = (pl_range){-1.0, 1.0};
        multiply(map, step);
        break;
    case PL_OP_SHEAR:
        for (int i = 0; i < 6; i++) step[(const int[]){1, 2, 4, 6, 8, 9}[i]] = a[i];
        general_step(map, step);
        break;
    default:
        for (int i = 0; i < 12; i++) step[4 * (i % 3) + i / 3] = a[i];
        general_step(map, step);
        break;
    }
    return true;
}

/* --- the machine --- */

typedef struct machine {
    const pl_program *program;
    pl_range *parameters;
    pl_range_result *result;
    int forks;
} machine;

static uint32_t operand(const uint8_t **at)
{
    uint32_t value = 0;
    for (int shift = 0;; shift += 7) {
        const uint8_t byte = *(*at)++;
        value |= (uint32_t)(byte & 0x7F) << shift;
        if (!(byte & 0x80)) return value;
    }
}

static bool run(machine *m, const uint8_t *at, pl_range *top);

/* Both ways of an undecided jump, joined. */
static bool run_both(machine *m, const uint8_t *there, const uint8_t *here, pl_range *top)
{
    const uint32_t count = m->program->parameter_count;
    pl_range before[MOST_PARAMETERS];
    pl_range_result kept = *m->result;
    const size_t height = (size_t)(top - m->result->values);
    if (++m->forks > MOST_FORKS || count > MOST_PARAMETERS) return false;
    memcpy(before, m->parameters, count * sizeof *before);
    if (!run(m, there, m->result->values + height)) return false;
    for (uint32_t i = 0; i < count; i++) {
        pl_range first = m->parameters[i];
        m->parameters[i] = before[i];
        before[i] = first;
    }
    pl_range_result first = *m->result;
    *m->result = kept;
    if (!run(m, here, m->result->values + height)) return false;
    if (first.count != m->result->count) return false;
    for (uint32_t i = 0; i < count; i++) {
        if (isnan(before[i].lo) != isnan(m->parameters[i].lo)) return false;
        if (!isnan(before[i].lo)) m->parameters[i] = pl_range_join(m->parameters[i], before[i]);
    }
    for (uint32_t i = 0; i < first.count; i++)
        m->result->values[i] = pl_range_join(m->result->values[i], first.values[i]);
    for (int i = 0; i < 12; i++) m->result->map.m[i] = pl_range_join(m->result->map.m[i], first.map.m[i]);
    m->result->map.step_count = -1;
    m->result->map.stretch = fmax(m->result->map.stretch, first.map.stretch);
    m->result->map.inverse_stretch = fmax(m->result->map.inverse_stretch, first.map.inverse_stretch);
    return true;
}

static bool run(machine *m, const uint8_t *at, pl_range *top)
{
    for (;;) {
        const uint8_t opcode = *at++;
        uint32_t index;
        switch (opcode) {
        case PL_OP_END: m->result->count = (uint32_t)(top - m->result->values); return true;
        case PL_OP_CONST: *top++ = pl_range_of(m->program->constants[operand(&at)]); break;
        case PL_OP_LOAD:
            *top = m->parameters[operand(&at)];
            if (isnan(top->lo)) return false;
            top++;
            break;
        case PL_OP_STORE:
            index = operand(&at);
            m->parameters[index] = *--top;
            break;
        case PL_OP_JUMP:
            index = operand(&at);
            at += index;
            break;
        case PL_OP_JUMP_IF_ZERO:
            index = operand(&at);
            top--;
            if (!contains(*top, 0.0)) break;
            if (!pl_range_is_point(*top)) return run_both(m, at + index, at, top);
            at += index;
            break;
        case PL_OP_RAND: top[-1] = truths; break;
        case PL_OP_HASH:
            top -= operand(&at);
            *top++ = truths;
            break;
        case PL_OP_VARIANTS:
            operand(&at);
            top--;
            break;
        case PL_OP_TEXTURE_SET:
            operand(&at);
            top--;
            break;
        default: {
            const pl_op_row *row = pl_op_row_of(opcode);
            top -= row->pops;
            if (!row->pushes) {
                if (!transform(&m->result->map, opcode, top)) return false;
                break;
            }
            const pl_range a = top[0], b = row->pops > 1 ? top[1] : a, c = row->pops > 2 ? top[2] : a;
            *top++ = pl_range_apply(opcode, a, b, c);
        }
        }
    }
}

bool pl_range_run(const pl_program *program, uint32_t code, pl_range *parameters, pl_range_result *result)
{
    machine m = {program, parameters, result, 0};
    result->count = 0;
    identity(&result->map);
    return code == 0 || run(&m, program->code + code - 1, result->values);
}
