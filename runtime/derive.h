/* derive.h - walking the derivation: from a node and a scope to its primitives, in path order.
 *
 * The walk is a pull parser. It runs guards and calculations by itself and stops where its user has something to do;
 * the user's own data (a mapped ray, a composed matrix) ride in `at.payload`, which the walk saves at unions and brings
 * back for the next term. Nothing recurses: pending unions stand on the heap, so depth costs memory only, up to
 * PL_LIMIT_DEPTH.
 *
 *     pl_walk walk;
 *     if (!pl_walk_begin(&walk, program, 0, NULL, error)) …
 *     for (;;) switch (pl_walk_next(&walk, error)) {
 *     case PL_EVENT_TRANSFORM: compose(walk.at.payload, walk.transform); break;
 *     case PL_EVENT_PRIMITIVE: use(walk.shape, walk.arguments, walk.at.payload); break;
 *     case PL_EVENT_END: …
 *     }
 *     pl_walk_end(&walk);
 *
 * Paper, section 2: S-nodes evaluate their selection, C-nodes change parameters, T-nodes map, +-nodes go to both sides. */
#ifndef PL_DERIVE_H
#define PL_DERIVE_H

#include "derive_memo.h"
#include "expression.h"
#include "shapes/shape.h"
#include "trace.h"

enum {
    PL_PAYLOAD = 12,
    PL_NOWHERE = -1
};

typedef enum pl_event {
    PL_EVENT_ERROR = -1,
    PL_EVENT_END,
    PL_EVENT_NODE,      /* with announce set: about to do an S, T, + or P node */
    PL_EVENT_TRANSFORM, /* `transform` maps what follows */
    PL_EVENT_TEXTURE,   /* `node` replaces the texture of what follows */
    PL_EVENT_ENTER,     /* at an enter node; the walk goes into its symbol unless pruned */
    PL_EVENT_PRIMITIVE, /* a leaf: shape, arguments */
    PL_EVENT_MESH       /* a leaf: mesh */
} pl_event;

/* Where the walk stands, and what is inherited down the path. */
typedef struct pl_spot {
    uint32_t terms;       /* union terms taken so far */
    uint32_t depth;       /* symbols entered */
    uint32_t symbol;      /* node of the innermost symbol, UINT32_MAX: none */
    int32_t rule;         /* index of the innermost rule, -1: none */
    uint32_t marks[5];    /* the user's */
    bool no_shadow;
    double payload[PL_PAYLOAD];
} pl_spot;

typedef struct pl_pending {
    uint32_t node, term; /* a union and its next term */
    pl_spot at;
    size_t scope; /* in `scopes` */
} pl_pending;

typedef struct pl_walk {
    const pl_program *program;
    /* Options, to be set after pl_walk_begin. */
    bool announce;         /* report PL_EVENT_NODE */
    bool stretches;        /* find the stretch of computed transformations too */
    const pl_path *follow; /* take only these terms at unions */
    pl_memo *memo;         /* of computed transformations; NULL: none */

    /* The event. */
    uint32_t node;
    const pl_transform *transform;
    uint32_t shape;
    double arguments[PL_SHAPE_ARGUMENTS];
    uint32_t mesh;
    pl_spot at;
    pl_scope scope;
    pl_path path; /* terms taken; at.terms of them */

    uint64_t singular; /* subtrees dropped so far */

    /* The walk's own. */
    int64_t next; /* node to do next or PL_NOWHERE */
    bool announced;
    pl_pending *pending;
    size_t pending_count, pending_capacity;
    uint64_t *scopes; /* packed scopes of the pending unions */
    size_t scopes_used, scopes_capacity;
    pl_transform computed;
    pl_result result;
} pl_walk;

/* Begins at a node. scope: as it is on the way into that node (copied); NULL: nothing assigned, as at the root. */
bool pl_walk_begin(pl_walk *walk, const pl_program *program, uint32_t node, const pl_scope *scope, pl_error *error);

/* Begins again, keeping memory and options. */
void pl_walk_restart(pl_walk *walk, uint32_t node, const pl_scope *scope);

void pl_walk_end(pl_walk *walk);

pl_event pl_walk_next(pl_walk *walk, pl_error *error);

/* Leaves out what lies below the last event's node. */
static inline void pl_walk_prune(pl_walk *walk)
{
    walk->next = PL_NOWHERE;
}

/* A scope packed into words and back, for those who keep many. */
size_t pl_scope_words(const pl_program *program, const pl_scope *scope);
void pl_scope_pack(const pl_program *program, const pl_scope *scope, uint64_t *words);
void pl_scope_unpack(const pl_program *program, const uint64_t *words, pl_scope *scope);

/* Replaces a packed scope's random key. */
static inline void pl_scope_set_key(uint64_t *words, uint64_t key)
{
    words[0] = key;
}

bool pl_path_push(pl_path *path, uint32_t length, uint32_t term); /* sets path->terms[length]; false: no memory */
bool pl_path_copy(pl_path *path, const pl_path *from, uint32_t length);
/* -1, 0 or 1: the order of two leaves in the derivation is the lexicographic order of their terms. */
int pl_path_compare(const pl_path *a, const pl_path *b);

#endif
