/* program.h - bytecode in memory: what a file says, decoded, checked and ready to be derived.
 *
 *     pl_program *program = pl_program_load(bytes, length, &error);     file -> program, or NULL and *error
 *     const pl_node *node = &program->nodes[0];                         the root
 *     switch (node->kind) { case PL_NODE_SYMBOL: … program->nodes[node->as.symbol.body] …
 *     pl_program_free(program);
 *
 * A program that loads keeps all that bytecode.toml promises, so nobody checks again: indices are in range, names are
 * valid UTF-8 without NUL, constants are finite, code keeps its stack effect and ends, every cycle of nodes goes
 * through an enter node (whose symbol is a symbol node), every path draws at most PL_LIMIT_DRAWS_PER_APPLICATION
 * times between two symbols. A program is immutable and may be shared by threads; the caller's bytes aren't needed
 * after loading. */
#ifndef PL_PROGRAM_H
#define PL_PROGRAM_H

#include "affine.h"
#include "bytecode.h"
#include "plsys.h"

#include <math.h>
#include <string.h>

typedef struct pl_string {
    const char *text; /* NUL-terminated UTF-8 */
    uint32_t length;  /* bytes */
    uint64_t hash;    /* pl_name_hash */
} pl_string;

/* One node. Which member of `as` is meant follows from kind (PL_NODE_…); bytecode.h has the members:
 *
 *   symbol          name · live_first, live_count in program->slots · draws · body
 *   rule            index · body
 *   branch          test (code) · then · otherwise
 *   choose          cases_first, cases_count in program->cases
 *   calculate       name · code · child
 *   transform       name · matrix in program->transforms · child
 *   transform_code  name · code · child
 *   texture         name · texture in program->records · code · draws · child
 *   union_          children_first, children_count in program->children
 *   enter           symbol (a node of kind PL_NODE_SYMBOL)
 *   primitive       shape (PL_SHAPE_…) · code
 *   mesh            mesh in program->meshes
 *   object          name · ordinal · child
 *   no_shadow       child
 *
 * name: index in program->strings. body, child, then, otherwise, symbol: index in program->nodes. code: as in the
 * file, 0 for none, else offset + 1; give it to pl_run as it is. */
typedef struct pl_node {
    uint8_t kind;
    uint32_t symbol; /* of a symbol node: its index in program->symbols; else 0 */
    pl_node_fields as;
} pl_node;

/* A weighted alternative. */
typedef struct pl_case {
    uint32_t weight; /* code */
    uint32_t body;   /* node */
} pl_case;

/* A constant transformation, with its inverse. */
typedef struct pl_transform {
    uint64_t form : 3;     /* pl_form of to_object */
    uint64_t singular : 1; /* the subtree below is to be dropped and counted */
    uint64_t mild : 1;     /* the inverse changes no vector's length by more than 2^±4 */
    uint64_t codes : 48;   /* where it is PL_FORM_PACKED */
    pl_affine to_object;   /* the inverse; unspecified if singular */
    /* What follows is needed for building only: packed states (state.h) leave it out. */
    pl_affine to_parent; /* object to parent, as in the file */
    double stretch;      /* the largest singular value of to_parent, rounded up; set where detail cut-offs need it */
} pl_transform;

/* What of a map isn't trivial: rays through a translation or a scaling take less arithmetic. A packed map is a general one of
 * few different numbers, as that of a turn about an axis: to_object holds the sizes of those that are neither 0 nor 1, one
 * after another and no more, and each of its entries is a code of four bits: 0, 1, or 2 + the number of a size, and 8 where
 * it is negative. */
typedef enum pl_form { PL_FORM_GENERAL, PL_FORM_PACKED, PL_FORM_DIAGONAL, PL_FORM_TRANSLATION } pl_form;

enum { PL_PACKED_SIZES = 6 };

/* Unpacks the twelve numbers of a packed map; not in line, since few maps on a path are packed. Returns room. */
static __attribute__((noinline, unused)) const double *pl_transform_unpack(const pl_transform *transform, double room[12])
{
    double sizes[2 + PL_PACKED_SIZES] = {0.0, 1.0};
    memcpy(sizes + 2, transform->to_object.m, PL_PACKED_SIZES * sizeof *sizes); /* whatever stands behind the last */
    uint64_t codes = transform->codes;
#pragma GCC unroll 12
    for (int i = 0; i < 12; i++, codes >>= 4) {
        uint64_t bits;
        memcpy(&bits, &sizes[codes & 7], sizeof bits);
        bits |= (codes & 8) << 60;
        memcpy(&room[i], &bits, sizeof bits);
    }
    return room;
}

/* The twelve numbers of to_object, in `room` where they are packed. */
static inline const double *pl_transform_entries(const pl_transform *transform, double room[12])
{
    return transform->form == PL_FORM_PACKED ? pl_transform_unpack(transform, room) : transform->to_object.m;
}

static inline pl_form pl_form_of(const pl_affine *map)
{
    const double *m = map->m;
    if (m[1] == 0.0 && m[2] == 0.0 && m[4] == 0.0 && m[6] == 0.0 && m[8] == 0.0 && m[9] == 0.0)
        return m[0] == 1.0 && m[5] == 1.0 && m[10] == 1.0 ? PL_FORM_TRANSLATION : PL_FORM_DIAGONAL;
    return PL_FORM_GENERAL;
}

/* Whether a map changes no vector's length by more than 2^±4: by its largest singular value, whose square is no larger than the sum of
 * its entries' squares, and its smallest, no less than the determinant over that sum. */
static inline bool pl_is_mild(const pl_affine *map)
{
    double squares = 0.0;
    for (int i = 0; i < 12; i++) squares += i % 4 == 3 ? 0.0 : map->m[i] * map->m[i];
    return squares < 256.0 && 16.0 * fabs(pl_affine_determinant(map)) > squares;
}

/* Sets to_parent and all that follows from it. */
static inline void pl_transform_set(pl_transform *transform, const pl_affine *to_parent)
{
    transform->to_parent = *to_parent;
    transform->singular = !pl_affine_inverse(to_parent, &transform->to_object);
    transform->form = transform->singular ? PL_FORM_GENERAL : pl_form_of(&transform->to_object);
    transform->mild = !transform->singular && pl_is_mild(&transform->to_object);
}

/* Settings, camera, light or texture: PL_<RECORD>_VALUES numbers, then PL_<RECORD>_ENTRY numbers an entry. What the
 * file doesn't set has its default; in entries that is 0. */
typedef struct pl_record {
    uint32_t kind; /* PL_RECORD_… */
    uint32_t entries;
    uint32_t size; /* of values */
    const double *values;
} pl_record;

/* A triangle mesh. */
typedef struct pl_mesh {
    uint32_t name; /* string */
    uint32_t vertex_count, normal_count, triangle_count;
    const double *vertices;           /* vertex_count * 3 */
    const double *normals;            /* normal_count * 3, not necessarily unit; NULL if flat */
    const uint32_t *triangles;        /* triangle_count * 3 vertex indices */
    const uint32_t *normal_triangles; /* triangle_count * 3 normal indices; NULL if flat */
} pl_mesh;

/* Where a node stands in the source: file is a string index, lines and columns count from 1 (columns in characters).
 * line 0: nowhere. */
typedef struct pl_place {
    uint32_t file, line, column, end_line, end_column;
} pl_place;

typedef struct pl_program {
    uint32_t string_count, constant_count, parameter_count, code_length, record_count, mesh_count, node_count;
    uint32_t symbol_count, light_count, rule_count;
    const pl_string *strings; /* string 0 is empty */
    const double *constants;
    const uint32_t *parameters; /* slot -> string */
    const uint8_t *code;
    const pl_record *records;
    const pl_mesh *meshes;
    const pl_node *nodes;    /* node 0 is the root */
    const pl_place *places;  /* of each node */
    const uint32_t *symbols; /* the symbol nodes, in node order */
    const uint32_t *rules;   /* the rule nodes, in node order */

    /* Pools that the nodes' lists stand in. */
    const uint32_t *children; /* nodes */
    const uint32_t *slots;
    const pl_case *cases;
    const pl_transform *transforms;
    uint32_t child_count, slot_count, case_count, transform_count;

    /* Settings always exist (the defaults if the file has none). The first camera counts; NULL: none. */
    const double *settings;
    const double *camera;
    const double *const *lights;

    uint64_t seed_key; /* pl_seed_key of the settings' seed */
    size_t bytes;      /* of memory that the program takes */
    void *blocks;      /* the memory itself (load.c) */
} pl_program;

/* Bytecode -> program. NULL, with *error set, if the bytes aren't valid bytecode (PL_ERROR_BYTECODE), exceed a limit
 * (PL_ERROR_LIMIT) or don't fit into memory (PL_ERROR_MEMORY). */
pl_program *pl_program_load(const void *bytes, size_t length, pl_error *error);

/* program may be NULL. */
void pl_program_free(pl_program *program);

/* "file:line:column" of a node, or "" if it has no place. Returns buffer. */
char *pl_program_place(const pl_program *program, uint32_t node, char *buffer, size_t size);

/* pl_fail at a node's place. Always returns false. */
bool pl_fail_at(pl_error *error, int code, const pl_program *program, uint32_t node, const char *format, ...)
    __attribute__((format(printf, 5, 6)));

/* Checks all that decoding alone doesn't (verify.c); pl_program_load calls it. */
bool pl_program_verify(const pl_program *program, pl_error *error);

#endif
