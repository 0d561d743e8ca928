/* probe.c - the runtime's lower half by hand, for tests: bytecode and a question in, lines of text out.
 *
 *     probe load FILE                         "ok", or "error CODE place: reason" and exit code 2, as all others do
 *     probe dump FILE                         the disassembly
 *     probe run FILE NODE KEY [name=value …]  runs the node's code (or takes its branch or choice) in a scope with
 * this random key: prints values, matrix, texture, parameters, key, draws, child probe flip FILE flips every bit,
 * checksum left and made right: "loaded N refused M" probe cut FILE                          the same for every
 * length shorter than the file
 */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "error.h"
#include "expression.h"
#include "program.h"

static int report(const pl_error *error)
{
    printf("error %d %s: %s\n", error->code, error->place, error->reason);
    return 2;
}

/* A file's bytes, at the end of their own allocation, so that reading beyond them is seen. */
static uint8_t *read_file(const char *path, size_t *length)
{
    FILE *file = fopen(path, "rb");
    if (!file || fseek(file, 0, SEEK_END) != 0)
        exit(3);
    *length = (size_t)ftell(file);
    rewind(file);
    uint8_t *bytes = malloc(*length ? *length : 1);
    if (!bytes || fread(bytes, 1, *length, file) != *length)
        exit(3);
    fclose(file);
    return bytes;
}

static void seal(uint8_t *bytes, size_t length)
{
    uint32_t crc = 0xFFFFFFFFu;
    for (size_t i = 28; i < length; i++) {
        crc ^= bytes[i];
        for (int k = 0; k < 8; k++)
            crc = crc & 1 ? 0xEDB88320u ^ (crc >> 1) : crc >> 1;
    }
    for (int i = 0; i < 4 && length >= 16; i++)
        bytes[12 + i] = (uint8_t)((crc ^ 0xFFFFFFFFu) >> (8 * i));
}

static bool loads(const uint8_t *bytes, size_t length)
{
    pl_error error = {0};
    char *text = pl_disassemble(bytes, length, &error);
    if (!text && (error.code == PL_OK || error.reason[0] == '\0' || error.place[0] == '\0')) {
        printf("refused without a reason\n");
        exit(4);
    }
    free(text);
    return text != NULL;
}

static int flip(uint8_t *bytes, size_t length)
{
    unsigned loaded = 0, refused = 0;
    uint8_t *copy = malloc(length);
    for (size_t bit = 0; copy && bit < 8 * length; bit++) {
        for (int sealed = 0; sealed < 2; sealed++) {
            memcpy(copy, bytes, length);
            copy[bit / 8] ^= (uint8_t)(1u << (bit % 8));
            if (sealed)
                seal(copy, length);
            const bool fine = loads(copy, length);
            if (fine && !sealed) {
                printf("bit %zu was flipped unseen\n", bit);
                return 4;
            }
            fine ? loaded++ : refused++;
        }
    }
    free(copy);
    printf("loaded %u refused %u\n", loaded, refused);
    return 0;
}

static int cut(uint8_t *bytes, size_t length)
{
    unsigned refused = 0;
    for (size_t shorter = 0; shorter < length; shorter++) {
        for (int sealed = 0; sealed < 2; sealed++) {
            uint8_t *copy = malloc(shorter ? shorter : 1);
            memcpy(copy, bytes, shorter);
            for (int i = 0; sealed && shorter >= 28 && i < 4; i++)
                copy[8 + i] = (uint8_t)(shorter >> (8 * i));
            if (sealed && shorter >= 28)
                seal(copy, shorter);
            refused += !loads(copy, shorter);
            free(copy);
        }
    }
    printf("refused %u of %zu\n", refused, 2 * length);
    return refused != 2 * length;
}

static void print_numbers(const char *name, const double *values, uint32_t count)
{
    printf("%s", name);
    for (uint32_t i = 0; i < count; i++)
        printf(" %.17g", values[i]);
    printf("\n");
}

static int run(const pl_program *program, uint32_t node, uint64_t key, char **assignments)
{
    static double parameters[256], texture[256];
    pl_scope scope = {.parameters = parameters, .key = key, .symbol = UINT32_MAX};
    pl_result result = {.texture = texture};
    pl_error error = {0};
    uint32_t child = UINT32_MAX;
    for (uint32_t i = 0; i < program->parameter_count; i++) {
        parameters[i] = NAN;
        const pl_string *name = &program->strings[program->parameters[i]];
        for (char **a = assignments; *a; a++)
            if (strncmp(*a, name->text, name->length) == 0 && (*a)[name->length] == '=')
                parameters[i] = strtod(*a + name->length + 1, NULL);
    }
    const pl_node *n = &program->nodes[node];
    bool fine = false;
    switch (n->kind) {
    case PL_NODE_BRANCH: fine = pl_branch(program, node, &scope, &child, &error); break;
    case PL_NODE_CHOOSE: fine = pl_choose(program, node, &scope, &child, &error); break;
    case PL_NODE_PRIMITIVE: fine = pl_run(program, node, n->as.primitive.code, &scope, &result, &error); break;
    case PL_NODE_TEXTURE: fine = pl_run(program, node, n->as.texture.code, &scope, &result, &error); break;
    case PL_NODE_CALCULATE: fine = pl_run(program, node, n->as.calculate.code, &scope, &result, &error); break;
    case PL_NODE_TRANSFORM_CODE:
        fine = pl_run(program, node, n->as.transform_code.code, &scope, &result, &error);
        break;
    case PL_NODE_OBJECT: pl_scope_object(program, node, &scope), fine = true; break;
    case PL_NODE_SYMBOL: pl_scope_enter(program, node, &scope), fine = true; break;
    case PL_NODE_UNION: pl_scope_term(&scope, 1), fine = true; break;
    default: return 3;
    }
    if (!fine)
        return report(&error);
    print_numbers("values", result.values, result.count);
    print_numbers("matrix", result.matrix.m, 12);
    print_numbers("texture", texture, PL_TEXTURE_VALUES + PL_TEXTURE_ENTRY);
    print_numbers("parameters", parameters, program->parameter_count);
    printf("key %" PRIu64 "\ndraws %u\nchild %d\n", scope.key, scope.draws, (int)child);
    return 0;
}

int main(int count, char **arguments)
{
    if (count < 3)
        return 3;
    size_t length;
    uint8_t *bytes = read_file(arguments[2], &length);
    pl_error error = {0};
    int code = 0;
    if (strcmp(arguments[1], "flip") == 0) {
        code = flip(bytes, length);
    } else if (strcmp(arguments[1], "cut") == 0) {
        code = cut(bytes, length);
    } else if (strcmp(arguments[1], "dump") == 0) {
        char *text = pl_disassemble(bytes, length, &error);
        text ? (void)fputs(text, stdout) : (void)(code = report(&error));
        free(text);
    } else {
        pl_program *program = pl_program_load(bytes, length, &error);
        if (!program)
            code = report(&error);
        else if (strcmp(arguments[1], "load") == 0)
            printf("ok\n");
        else if (count >= 5)
            code = run(program, (uint32_t)strtoul(arguments[3], NULL, 10), strtoull(arguments[4], NULL, 0),
                       arguments + 5);
        pl_program_free(program);
    }
    free(bytes);
    return code;
}
