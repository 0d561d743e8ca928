/* load.c - bytecode -> program: the container, and the sections of plain lists.
 *
 * Nothing in the bytes is trusted: header, sentinels, checksum and every section's bounds are checked here, each
 * section's own contents where it is read (reader.h), and what needs more than one element to be judged by verify.c.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "error.h"
#include "program.h"
#include "random.h"
#include "reader.h"

enum { HEADER_BYTES = 28 };

/* --- strings, constants, parameters, code --- */

/* Whether the bytes are UTF-8 (Unicode, table 3-7) without control characters. */
static bool is_text(const uint8_t *s, size_t length)
{
    for (size_t i = 0; i < length;) {
        const uint8_t c = s[i++];
        if (c < 0x20 || c == 0x7F)
            return false;
        if (c < 0x80)
            continue;
        const int more = c >= 0xC2 && c < 0xE0 ? 1 : c >= 0xE0 && c < 0xF0 ? 2 : c >= 0xF0 && c < 0xF5 ? 3 : 0;
        if (more == 0 || length - i < (size_t)more)
            return false;
        const uint8_t low = c == 0xE0 ? 0xA0 : c == 0xF0 ? 0x90 : 0x80;
        const uint8_t high = c == 0xED ? 0x9F : c == 0xF4 ? 0x8F : 0xBF;
        if (s[i] < low || s[i] > high)
            return false;
        for (int k = 1; k < more; k++)
            if (s[i + k] < 0x80 || s[i + k] > 0xBF)
                return false;
        i += more;
    }
    return true;
}

static void read_strings(pl_reader *r)
{
    const uint32_t count = pl_read_count(r, 1);
    char *text = pl_read_allocate(r, pl_read_left(r) + count, 1); /* the bytes, and a NUL each */
    pl_string *strings = pl_read_allocate(r, count, sizeof *strings);
    for (uint32_t i = 0; i < count && !r->failed; i++) {
        const uint32_t length = pl_read_count(r, 1);
        if (r->failed)
            return;
        if (!is_text(r->at, length))
            pl_read_fail(r, "string %u isn't UTF-8 text", i);
        memcpy(text, r->at, length);
        strings[i] = (pl_string){.text = text, .length = length, .hash = pl_name_hash(text, length)};
        text += length + 1;
        r->at += length;
    }
    if (!r->failed && (count == 0 || strings[0].length != 0))
        pl_read_fail(r, "string 0 isn't empty");
    r->program->strings = strings;
    r->program->string_count = count;
}

static int compare_bits(const void *a, const void *b)
{
    uint64_t x, y;
    memcpy(&x, a, sizeof x);
    memcpy(&y, b, sizeof y);
    return (x > y) - (x < y);
}

static void read_constants(pl_reader *r)
{
    const uint32_t count = pl_read_count(r, 8);
    double *constants = pl_read_allocate(r, count, sizeof *constants);
    for (uint32_t i = 0; i < count && !r->failed; i++) {
        constants[i] = pl_read_f64(r);
        if (constants[i] == 0 && pl_bits(constants[i]) != pl_little_endian(r->at - 8, 8))
            pl_read_fail(r, "constant %u is -0", i);
    }
    if (r->failed)
        return;
    r->program->constants = constants;
    r->program->constant_count = count;
    double *sorted = malloc(count * sizeof *sorted + 1);
    if (!sorted) {
        pl_read_fail_as(r, PL_ERROR_MEMORY, "out of memory");
        return;
    }
    if (count)
        memcpy(sorted, constants, count * sizeof *sorted);
    qsort(sorted, count, sizeof *sorted, compare_bits);
    for (uint32_t i = 1; i < count && !r->failed; i++)
        if (compare_bits(sorted + i - 1, sorted + i) == 0)
            pl_read_fail(r, "the constant %.17g stands there twice", sorted[i]);
    free(sorted);
}

static void read_parameters(pl_reader *r)
{
    const uint32_t count = pl_read_count(r, 1);
    uint32_t *parameters = pl_read_allocate(r, count, sizeof *parameters);
    for (uint32_t i = 0; i < count && !r->failed; i++)
        parameters[i] = pl_read_index(r, r->program->string_count, "name");
    r->program->parameters = parameters;
    r->program->parameter_count = count;
}

static void read_code(pl_reader *r)
{
    const uint32_t length = pl_read_count(r, 1);
    uint8_t *code = pl_read_allocate(r, length, 1);
    if (r->failed)
        return;
    if (length)
        memcpy(code, r->at, length);
    r->at += length;
    r->program->code = code;
    r->program->code_length = length;
}

/* --- the container --- */

static const struct {
    const char *name;
    uint32_t id;
    void (*read)(pl_reader *r);
} SECTIONS[] = {
    {"strings", PL_SECTION_STRINGS, read_strings},
    {"constants", PL_SECTION_CONSTANTS, read_constants},
    {"parameters", PL_SECTION_PARAMETERS, read_parameters},
    {"code", PL_SECTION_CODE, read_code},
    {"records", PL_SECTION_RECORDS, pl_read_records},
    {"meshes", PL_SECTION_MESHES, pl_read_meshes},
    {"nodes", PL_SECTION_NODES, pl_read_nodes},
    {"sourcemap", PL_SECTION_SOURCEMAP, pl_read_sourcemap},
};

/* zlib's CRC-32. */
static uint32_t checksum(const uint8_t *bytes, size_t length)
{
    uint32_t table[256];
    for (uint32_t i = 0; i < 256; i++) {
        uint32_t c = i;
        for (int k = 0; k < 8; k++)
            c = c & 1 ? 0xEDB88320u ^ (c >> 1) : c >> 1;
        table[i] = c;
    }
    uint32_t crc = 0xFFFFFFFFu;
    for (size_t i = 0; i < length; i++)
        crc = table[(crc ^ bytes[i]) & 0xFF] ^ (crc >> 8);
    return crc ^ 0xFFFFFFFFu;
}

static bool check_header(const uint8_t *bytes, size_t length, pl_error *error)
{
    const char *const place = "bytecode";
    if (length < 4 || memcmp(bytes, PL_MAGIC, 4) != 0)
        return pl_fail(error, PL_ERROR_BYTECODE, place, "this isn't plsys bytecode: it doesn't begin with " PL_MAGIC);
    if (length < HEADER_BYTES)
        return pl_fail(error, PL_ERROR_BYTECODE, place, "truncated: %zu bytes, the header alone has %d", length,
                       HEADER_BYTES);
    const uint32_t version = (uint32_t)pl_little_endian(bytes + 4, 2),
                   flags = (uint32_t)pl_little_endian(bytes + 6, 2);
    if (version != PL_VERSION)
        return pl_fail(error, PL_ERROR_BYTECODE, place,
                       "version %u, but this program reads version %d: compile again", version, PL_VERSION);
    if (flags != 0)
        return pl_fail(error, PL_ERROR_BYTECODE, place, "unknown flags %u", flags);
    if (length > PL_LIMIT_BYTES)
        return pl_fail(error, PL_ERROR_LIMIT, place, "%zu bytes, more than %d", length, PL_LIMIT_BYTES);
    const uint64_t stated = pl_little_endian(bytes + 8, 4);
    if (stated != length)
        return pl_fail(error, PL_ERROR_BYTECODE, place, "%s: %zu bytes, the header says %llu",
                       stated > length ? "truncated" : "something follows the end", length,
                       (unsigned long long)stated);
    const uint32_t found = checksum(bytes + HEADER_BYTES, length - HEADER_BYTES);
    if (found != pl_little_endian(bytes + 12, 4))
        return pl_fail(error, PL_ERROR_BYTECODE, place, "damaged: the checksum is %08x, the header says %08x", found,
                       (uint32_t)pl_little_endian(bytes + 12, 4));
    const uint64_t float_bits = pl_little_endian(bytes + 16, 8);
    double sentinel;
    memcpy(&sentinel, &float_bits, sizeof sentinel);
    if (sentinel != PL_SENTINEL_FLOAT || pl_little_endian(bytes + 24, 4) != PL_SENTINEL_INTEGER)
        return pl_fail(error, PL_ERROR_BYTECODE, place, "damaged: the sentinels are wrong");
    return true;
}

static bool read_sections(const uint8_t *at, const uint8_t *end, pl_program *program, pl_error *error)
{
    pl_reader file = {.at = at, .end = end, .section = "bytecode", .program = program, .error = error};
    for (size_t i = 0; i < sizeof SECTIONS / sizeof *SECTIONS; i++) {
        const uint32_t id = pl_read_u(&file);
        if (!file.failed && id != SECTIONS[i].id)
            pl_read_fail(&file, "section %u stands where the %s (%u) should", id, SECTIONS[i].name, SECTIONS[i].id);
        const uint32_t length = pl_read_count(&file, 1);
        if (file.failed)
            return false;
        pl_reader section = file;
        section.section = SECTIONS[i].name;
        section.end = file.at + length;
        SECTIONS[i].read(&section);
        if (!section.failed && section.at != section.end)
            pl_read_fail(&section, "%zu bytes too many", pl_read_left(&section));
        if (section.failed)
            return false;
        file.at = section.end;
    }
    if (file.at != file.end)
        pl_read_fail(&file, "%zu bytes after the last section", pl_read_left(&file));
    return !file.failed;
}

pl_program *pl_program_load(const void *bytes, size_t length, pl_error *error)
{
    const uint8_t *const file = bytes;
    if (!check_header(file, length, error))
        return NULL;
    pl_program *program = calloc(1, sizeof *program);
    if (!program) {
        pl_fail_memory(error, "bytecode");
        return NULL;
    }
    program->bytes = sizeof *program;
    if (read_sections(file + HEADER_BYTES, file + length, program, error) && pl_program_verify(program, error))
        return program;
    pl_program_free(program);
    return NULL;
}

char *pl_program_place(const pl_program *program, uint32_t node, char *buffer, size_t size)
{
    const pl_place *place = node < program->node_count && program->places ? &program->places[node] : NULL;
    if (place && place->line)
        snprintf(buffer, size, "%s:%u:%u", program->strings[place->file].text, place->line, place->column);
    else if (size)
        buffer[0] = '\0';
    return buffer;
}
