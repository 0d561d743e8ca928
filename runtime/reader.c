/* reader.c - see reader.h; and the memory of programs. */
#include "reader.h"

#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "error.h"

typedef struct block {
    struct block *next;
    max_align_t memory[];
} block;

void *pl_read_allocate(pl_reader *r, size_t count, size_t size)
{
    if (r->failed)
        return NULL;
    block *fresh = NULL;
    if (count <= (SIZE_MAX / 2 - sizeof *fresh) / size)
        fresh = calloc(1, sizeof *fresh + count * size);
    if (!fresh) {
        pl_read_fail_as(r, PL_ERROR_MEMORY, "out of memory");
        return NULL;
    }
    fresh->next = r->program->blocks;
    r->program->blocks = fresh;
    r->program->bytes += sizeof *fresh + count * size;
    return fresh->memory;
}

void pl_program_free(pl_program *program)
{
    if (!program)
        return;
    for (block *b = program->blocks, *next; b; b = next) {
        next = b->next;
        free(b);
    }
    free(program);
}

static void fail(pl_reader *r, int code, const char *format, va_list arguments)
{
    char reason[256];
    vsnprintf(reason, sizeof reason, format, arguments);
    r->failed = true;
    pl_fail(r->error, code, r->section, "%s", reason);
}

void pl_read_fail(pl_reader *r, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    fail(r, PL_ERROR_BYTECODE, format, arguments);
    va_end(arguments);
}

void pl_read_fail_as(pl_reader *r, int code, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    fail(r, code, format, arguments);
    va_end(arguments);
}

size_t pl_read_left(const pl_reader *r)
{
    return (size_t)(r->end - r->at);
}

uint32_t pl_read_u(pl_reader *r)
{
    if (r->failed)
        return 0;
    uint64_t value = 0;
    for (int i = 0; i < 5; i++) {
        if (r->at == r->end) {
            pl_read_fail(r, "ends in the middle of a number");
            return 0;
        }
        const uint8_t byte = *r->at++;
        value |= (uint64_t)(byte & 0x7F) << (7 * i);
        if (byte & 0x80)
            continue;
        if ((i > 0 && byte == 0) || value > UINT32_MAX)
            break;
        return (uint32_t)value;
    }
    pl_read_fail(r, "has a number that isn't in its shortest form or has more than 32 bits");
    return 0;
}

uint32_t pl_read_index(pl_reader *r, uint32_t limit, const char *what)
{
    const uint32_t index = pl_read_u(r);
    if (!r->failed && index >= limit)
        pl_read_fail(r, "%s %u, but there are %u", what, index, limit);
    return r->failed ? 0 : index;
}

uint32_t pl_read_count(pl_reader *r, size_t bytes)
{
    const uint32_t count = pl_read_u(r);
    if (!r->failed && count > pl_read_left(r) / bytes)
        pl_read_fail(r, "says it has %u elements, more than fit into its bytes", count);
    return r->failed ? 0 : count;
}

uint64_t pl_little_endian(const uint8_t *bytes, int count)
{
    uint64_t value = 0;
    for (int i = 0; i < count; i++)
        value |= (uint64_t)bytes[i] << (8 * i);
    return value;
}

double pl_read_f64(pl_reader *r)
{
    if (!r->failed && pl_read_left(r) < 8)
        pl_read_fail(r, "ends in the middle of a number");
    if (r->failed)
        return 0;
    const uint64_t bits = pl_little_endian(r->at, 8);
    r->at += 8;
    double value;
    memcpy(&value, &bits, sizeof value);
    if (!(value - value == 0))
        pl_read_fail(r, "has a number that is NaN or infinite");
    return r->failed ? 0 : value;
}
