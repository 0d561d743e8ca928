/* terrain_end.c - what is known of the last symbol above a terrain's triangles (terrain.h).
 *
 * Shading a triangle asks for its texture, which may read any parameter. Deriving these from the root takes as many steps as
 * the terrain has levels. But the last symbol's parameters are mostly the triangle's own corners, and what isn't is mostly the
 * same everywhere; so they are compared with the cells while the tiles are filled. Example: of Patch(n, rough, xa, …, zc)
 * the corners are cells, n and rough are one number each. */
#include <stdlib.h>
#include <string.h>

#include "terrain.h"

#define CONSTANT (UINT32_C(1) << PL_TERRAIN_CELLS)

static bool are_same(double a, double b)
{
    return memcmp(&a, &b, sizeof a) == 0;
}

bool pl_terrain_common_begin(pl_terrain_common *common, uint32_t parameters)
{
    *common = (pl_terrain_common){.count = parameters, .same = true};
    common->agree = malloc((parameters + 1) * sizeof *common->agree);
    common->values = malloc((parameters + 1) * sizeof *common->values);
    return common->agree && common->values;
}

void pl_terrain_common_free(pl_terrain_common *common)
{
    free(common->agree);
    free(common->values);
}

static void add_first(pl_terrain_common *common, const pl_terrain *terrain, const pl_terrain_walk *w)
{
    common->any = true;
    common->symbol = w->symbol;
    common->rule = w->rule;
    memcpy(common->values, w->entering, common->count * sizeof *common->values);
    for (uint32_t slot = 0; slot < common->count; slot++)
        common->agree[slot] = CONSTANT | ((UINT32_C(1) << terrain->form.slots) - 1);
}

void pl_terrain_common_add(pl_terrain_common *common, const pl_terrain *terrain, const pl_terrain_walk *w, const double *cells)
{
    const pl_walk *walk = &w->walk;
    if (!common->same) return;
    if (!common->any) add_first(common, terrain, w);
    /* Draws depend on the key, which all terms above go into. */
    common->same = w->symbol == common->symbol && w->symbol != UINT32_MAX && w->terms == walk->at.terms && w->rule == common->rule &&
                   w->rule >= 0 && walk->scope.draws == 0 && !w->textured;
    for (uint32_t slot = 0; slot < common->count; slot++)
        for (uint32_t left = common->agree[slot]; left; left &= left - 1) {
            const uint32_t bit = left & -left;
            const double expected = bit == CONSTANT ? common->values[slot] : cells[__builtin_ctz(bit)];
            if (!are_same(w->entering[slot], expected)) common->agree[slot] &= ~bit;
        }
}

void pl_terrain_common_join(pl_terrain_common *common, const pl_terrain_common *other)
{
    if (!other->any) return;
    if (!common->any) {
        common->any = true;
        common->symbol = other->symbol;
        common->rule = other->rule;
        memcpy(common->agree, other->agree, common->count * sizeof *common->agree);
        memcpy(common->values, other->values, common->count * sizeof *common->values);
    }
    common->same = common->same && other->same && other->symbol == common->symbol && other->rule == common->rule;
    for (uint32_t slot = 0; slot < common->count; slot++) {
        common->agree[slot] &= other->agree[slot];
        if (!are_same(common->values[slot], other->values[slot])) common->agree[slot] &= ~CONSTANT;
    }
}

bool pl_terrain_end_set(pl_terrain *terrain, const pl_terrain_common *common)
{
    pl_terrain_end *end = &terrain->end;
    end->symbol = common->symbol;
    end->rule = common->rule;
    end->known = common->any && common->same;
    end->cells = malloc(common->count + 1);
    end->values = malloc((common->count + 1) * sizeof *end->values);
    if (!end->cells || !end->values) return false;
    for (uint32_t slot = 0; slot < common->count; slot++) {
        const uint32_t agree = common->agree[slot];
        const bool is_cell = agree && !(agree & CONSTANT);
        end->cells[slot] = is_cell ? (uint8_t)__builtin_ctz(agree) : PL_TERRAIN_CELLS;
        end->values[slot] = agree & CONSTANT ? common->values[slot] : NAN;
    }
    return true;
}

void pl_terrain_end_skip(const pl_terrain *terrain, uint32_t leaf, pl_walk *walk)
{
    const pl_terrain_end *end = &terrain->end;
    const pl_terrain_tile *tile = pl_terrain_tile_at(terrain, leaf / terrain->tile_leaves);
    double cells[PL_TERRAIN_CELLS];
    if (!end->known || walk->at.depth) return;
    pl_terrain_cells(terrain, tile->values, leaf % terrain->tile_leaves, cells);
    for (uint32_t slot = 0; slot < walk->program->parameter_count; slot++)
        walk->scope.parameters[slot] = end->cells[slot] < PL_TERRAIN_CELLS ? cells[end->cells[slot]] : end->values[slot];
    walk->scope.draws = 0;
    walk->at.terms += terrain->levels;
    walk->at.depth = terrain->depth - 1;
    walk->at.rule = end->rule;
    walk->next = end->symbol;
}
