/* number.c - the index of a hit's primitive where tracing doesn't count and there are no states: by the derivation. */
#include "../error.h"
#include "accel.h"

/* Nodes visited on the way. */
#define MOST_WORK (UINT64_C(1) << 26)

/* Whether the walk stands before the path, and not above it. */
static bool is_before(const pl_walk *walk, const pl_path *path)
{
    for (uint32_t i = 0; i < walk->at.terms && i < path->length; i++)
        if (walk->path.terms[i] != path->terms[i]) return true;
    return false;
}

bool pl_number_by_classes(pl_tracer *tracer, pl_classes *classes, pl_hit *hit, pl_error *error)
{
    const pl_program *program = tracer->scene->program;
    pl_walk *walk = &tracer->walk;
    walk->follow = NULL;
    pl_walk_restart(walk, 0, NULL);
    uint64_t index = 0, spent = 0;
    for (;;) {
        pl_bounds bounds;
        if (++spent > MOST_WORK)
            return pl_fail_at(error, PL_ERROR_LIMIT, program, walk->node,
                              "work: the number of a hit's primitive needs more than %llu nodes to be visited",
                              (unsigned long long)MOST_WORK);
        switch (pl_walk_next(walk, error)) {
        case PL_EVENT_ERROR: return false;
        case PL_EVENT_END: hit->primitive = UINT64_MAX; return true;
        case PL_EVENT_ENTER:
            if (!is_before(walk, &hit->path)) {
                if (!hit->cut_depth || walk->at.terms < hit->path.length || walk->at.depth + 1 < hit->cut_depth) break;
                hit->primitive = index;
                return true;
            }
            pl_classes_bound(classes, program->nodes[walk->node].as.enter.symbol,
                             &walk->scope, &bounds, &spent);
            if (bounds.count == UINT64_MAX) break;
            index += bounds.count;
            pl_walk_prune(walk);
            break;
        case PL_EVENT_PRIMITIVE:
        case PL_EVENT_MESH:
            if (!is_before(walk, &hit->path) && walk->at.terms == hit->path.length) {
                hit->primitive = index;
                return true;
            }
            index++;
            break;
        default: break;
        }
    }
}
