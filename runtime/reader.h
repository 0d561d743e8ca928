/* reader.h - reading one section of bytecode (private to loading).
 *
 * A reader never leaves its section, and fails once and for good: after a failure every function gives zero or NULL,
 * so that decoding needs no check after every number, and loops end by `failed`. Counts are never larger than the
 * bytes left allow, so memory grows in proportion to the file. */
#ifndef PL_READER_H
#define PL_READER_H

#include "program.h"

typedef struct pl_reader {
    const uint8_t *at, *end;
    const char *section; /* what is being read, for messages */
    pl_program *program; /* owns what is allocated */
    pl_error *error;
    bool failed;
} pl_reader;

/* Fails with PL_ERROR_BYTECODE, or with a code of the caller's. */
void pl_read_fail(pl_reader *r, const char *format, ...) __attribute__((format(printf, 2, 3)));
void pl_read_fail_as(pl_reader *r, int code, const char *format, ...) __attribute__((format(printf, 3, 4)));

/* count * size zeroed bytes that live as long as the program; NULL after a failure. */
void *pl_read_allocate(pl_reader *r, size_t count, size_t size);

/* Bytes left in the section. */
size_t pl_read_left(const pl_reader *r);

/* An unsigned LEB128 number in its shortest form. */
uint32_t pl_read_u(pl_reader *r);

/* A number below limit; what names it in messages. */
uint32_t pl_read_index(pl_reader *r, uint32_t limit, const char *what);

/* The count of elements that take at least `bytes` bytes each. */
uint32_t pl_read_count(pl_reader *r, size_t bytes);

/* A finite double. */
double pl_read_f64(pl_reader *r);

uint64_t pl_little_endian(const uint8_t *bytes, int count);

/* The sections: load.c, load_records.c and load_nodes.c. */
void pl_read_records(pl_reader *r);
void pl_read_meshes(pl_reader *r);
void pl_read_nodes(pl_reader *r);
void pl_read_sourcemap(pl_reader *r);

#endif
