/* unfold.c - the whole derivation, primitive by primitive, with composed matrices (plsys.h, pl_unfold_…). Memory doesn't
 * grow with the number of primitives. */
#include <stdlib.h>
#include <string.h>

#include "error.h"
#include "scene.h"

struct pl_unfolding {
    const pl_scene *scene;
    pl_walk walk;
    bool finished;
};

pl_unfolding *pl_unfold_begin(pl_scene *scene, pl_error *error)
{
    pl_error_clear(error);
    pl_unfolding *unfolding = calloc(1, sizeof *unfolding);
    if (!unfolding) {
        pl_fail_memory(error, "unfolding");
        return NULL;
    }
    unfolding->scene = scene;
    if (!pl_walk_begin(&unfolding->walk, scene->program, 0, NULL, error)) {
        free(unfolding);
        return NULL;
    }
    pl_affine identity = pl_affine_identity();
    memcpy(unfolding->walk.at.payload, identity.m, sizeof identity.m);
    return unfolding;
}

void pl_unfold_end(pl_unfolding *unfolding)
{
    if (!unfolding) return;
    pl_walk_end(&unfolding->walk);
    free(unfolding);
}

static void compose(pl_walk *walk)
{
    pl_affine so_far;
    memcpy(so_far.m, walk->at.payload, sizeof so_far.m);
    so_far = pl_affine_multiply(&so_far, &walk->transform->to_parent);
    memcpy(walk->at.payload, so_far.m, sizeof so_far.m);
}

int64_t pl_unfold_next(pl_unfolding *unfolding, size_t capacity, int32_t *kind, double *matrix, double *argument,
                       int32_t *texture, int32_t *symbol, int32_t *depth, pl_error *error)
{
    pl_walk *walk = &unfolding->walk;
    const pl_program *program = unfolding->scene->program;
    size_t count = 0;
    pl_error_clear(error);
    while (count < capacity && !unfolding->finished) {
        pl_event event = pl_walk_next(walk, error);
        switch (event) {
        case PL_EVENT_ERROR: unfolding->finished = true; return -1;
        case PL_EVENT_END: unfolding->finished = true; continue;
        case PL_EVENT_TRANSFORM: compose(walk); continue;
        case PL_EVENT_TEXTURE: walk->at.marks[0] = program->nodes[walk->node].as.texture.texture + 1; continue;
        case PL_EVENT_PRIMITIVE:
        case PL_EVENT_MESH: break;
        default: continue;
        }
        bool mesh = event == PL_EVENT_MESH;
        if (kind) kind[count] = mesh ? 0 : (int32_t)walk->shape;
        if (matrix) memcpy(matrix + 12 * count, walk->at.payload, 12 * sizeof *matrix);
        if (argument) argument[count] = mesh ? walk->mesh : walk->arguments[0];
        if (texture) texture[count] = (int32_t)walk->at.marks[0] - 1;
        if (symbol)
            symbol[count] = walk->at.symbol == UINT32_MAX ? -1 : (int32_t)program->nodes[walk->at.symbol].symbol;
        if (depth) depth[count] = (int32_t)walk->at.depth;
        count++;
    }
    return (int64_t)count;
}
