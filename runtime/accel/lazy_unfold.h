/* lazy_unfold.h - what a thread keeps while it unfolds states (lazy.h): the derivation of one application as growing arrays
 * (lazy_unfold.c), of which a pattern is written, and the patterns that it used last (lazy_pattern.c). */
#ifndef PL_LAZY_UNFOLD_H
#define PL_LAZY_UNFOLD_H

#include "../array.h"
#include "lazy.h"

enum { KNOWN_BOUNDS = 64, KNOWN_PATTERNS = 512, MOST_LIVE = 8 };

/* Bounds of the classes that were asked for last; a place for each hash. */
typedef struct known_bounds {
    uint32_t symbol, count; /* of live parameters, + 1; 0: none */
    uint64_t live[MOST_LIVE];
    pl_bounds bounds;
    pl_gate_box gate;
} known_bounds;

/* The same for patterns. NULL: its states are too different to share one. */
typedef struct known_pattern {
    uint64_t epoch; /* of the half that it is in; 0: none */
    uint32_t symbol;
    uint64_t live[MOST_LIVE];
    const pl_lazy_pattern *pattern;
} known_pattern;

/* An item; what it consists of stands in the unfolder's arrays. */
typedef struct draft {
    pl_lazy_item it;
    pl_box box;
    pl_affine map; /* the product of its transformations' to_parent … */
    double slack;  /* … and how far roundings of that may move a point */
    pl_reach reach;
    pl_gate_box gate;
    double arguments[PL_SHAPE_ARGUMENTS];
    size_t link_first, term_first, scope_first;
} draft;

/* A transformation of the current path: constant, or one of `computed`; what draws is one of `draws`, too. */
typedef struct link_ {
    const pl_transform *constant;
    size_t computed;
    bool drawn;
    uint32_t draw;
} link_;

/* A pl_lazy_draw, by indices. */
typedef struct draw_draft {
    uint32_t node, term_count;
    size_t term_first, parameter_first;
} draw_draft;

struct pl_unfolder {
    const pl_scene *scene;
    pl_walk walk;
    pl_scope scope;
    pl_array drafts, chain, links, computed, terms, scopes, draws, parameters, key;
    uint64_t work, bounding; /* of the derivation; of that, for classes */
    known_bounds known[KNOWN_BOUNDS];
    size_t primitives, gates; /* what the drafts will need */
    size_t last_entered;      /* the last draft of a state, + 1; 0: none */
    bool sharing;             /* the pattern is to be shared … */
    bool apart;               /* … which can't be */

    uint8_t *sharable; /* of each node that is a symbol; 0: not looked at yet */
    known_pattern *patterns;
    known_pattern *place;           /* for the state that is prepared; NULL: none */
    const pl_lazy_pattern *pattern; /* its, if it is known */
    pl_scope drawing;
    pl_result result;
};

/* Derives the application of a symbol in u->scope. */
bool pl_unfolder_derive(pl_unfolder *u, uint32_t symbol, pl_classes *classes, pl_error *error);

/* Whether both enter states of the same bounds: then they share them. */
static inline bool is_gate_of(const draft *d, const draft *before)
{
    return before && memcmp(&d->gate, &before->gate, sizeof d->gate) == 0;
}

/* Whether a transformation's code draws. */
bool pl_lazy_code_draws(const pl_program *program, uint32_t code);

#endif
