/* terrain_find.c - recognising terrains (terrain.h): a complete subdivision into triangles of one form.
 *
 * Nothing is assumed that isn't seen: the shape is read off the way to the first triangle, and each of the others has
 * to stand where the shape says, under a matrix of the same form and with the same bits. Errors of the derivation aren't
 * reported here: such a scene is no terrain, and whoever traces it meets them. */
#include <stdlib.h>
#include <string.h>

#include "../error.h"
#include "terrain.h"

enum { MOST_PLACES = 16, LEAST_TILES = 8 };

/* --- the form of a matrix --- */

#define NUMBER UINT32_MAX /* the slot of a cell that is a number */

/* The cell of a parameter or number; PL_TERRAIN_CELLS: there are too many. */
static uint8_t cell_of(pl_terrain_form *form, uint32_t slot, double number)
{
    for (uint32_t c = 0; c < form->cells; c++)
        if (form->slot[c] == slot && memcmp(&form->number[c], &number, sizeof number) == 0) return (uint8_t)c;
    if (form->cells == PL_TERRAIN_CELLS) return PL_TERRAIN_CELLS;
    form->slot[form->cells] = slot;
    form->number[form->cells] = number;
    return (uint8_t)form->cells++;
}

static uint32_t operand(const uint8_t **at)
{
    uint32_t value = 0;
    for (int shift = 0;; shift += 7) {
        value |= (uint32_t)(**at & 0x7F) << shift;
        if (!(*(*at)++ & 0x80)) return value;
    }
}

/* Brings the parameters to the front. */
static void order_cells(pl_terrain_form *form)
{
    const pl_terrain_form old = *form;
    uint8_t renamed[PL_TERRAIN_CELLS];
    uint32_t next = 0;
    for (int numbers = 0; numbers < 2; numbers++) {
        for (uint32_t c = 0; c < old.cells; c++) {
            if ((old.slot[c] == NUMBER) != numbers) continue;
            form->slot[next] = old.slot[c];
            form->number[next] = old.number[c];
            renamed[c] = (uint8_t)next++;
        }
        if (!numbers) form->slots = next;
    }
    for (int i = 0; i < 12; i++) {
        form->plus[i] = renamed[old.plus[i]];
        form->minus[i] = renamed[old.minus[i]];
    }
}

/* Sets what follows from the cells. */
static void settle_form(pl_terrain_form *form)
{
    form->signed_zeros = true;
    form->variables = 0;
    for (uint8_t i = 0; i < 12; i++) {
        const uint8_t plus = form->plus[i], minus = form->minus[i];
        if (plus < form->slots || minus < form->slots) form->variable[form->variables++] = i;
        else form->fixed.m[i] = form->number[plus] - form->number[minus];
    }
}

/* Code that is one matrix operation of numbers, parameters and differences of two of them; else false. */
static bool read_form(const pl_program *program, uint32_t node, pl_terrain_form *form)
{
    const uint8_t *at = program->code + program->nodes[node].as.transform_code.code - 1;
    uint8_t plus[13], minus[13];
    uint32_t top = 0;
    *form = (pl_terrain_form){.node = node};
    cell_of(form, NUMBER, 0.0);
    for (;;) {
        uint8_t opcode = *at++, cell;
        switch (opcode) {
        case PL_OP_CONST:
        case PL_OP_LOAD: {
            uint32_t index = operand(&at);
            cell = opcode == PL_OP_LOAD ? cell_of(form, index, 0.0)
                                        : cell_of(form, NUMBER, program->constants[index]);
            if (cell == PL_TERRAIN_CELLS || top == 13) return false;
            plus[top] = cell;
            minus[top++] = 0;
            break;
        }
        case PL_OP_SUBTRACT:
            top--;
            if (minus[top] || minus[top - 1]) return false;
            minus[top - 1] = plus[top];
            break;
        case PL_OP_MATRIX:
            if (top != 12 || *at != PL_OP_END) return false;
            /* POV-Ray's twelve numbers stand column by column. */
            for (int i = 0; i < 12; i++) {
                form->plus[4 * (i % 3) + i / 3] = plus[i];
                form->minus[4 * (i % 3) + i / 3] = minus[i];
            }
            order_cells(form);
            settle_form(form);
            return true;
        default: return false;
        }
    }
}

/* Whether the program has a matrix of such a form at all: most scenes are told apart by this. */
static bool has_form(const pl_program *program)
{
    pl_terrain_form form;
    for (uint32_t i = 0; i < program->node_count; i++)
        if (program->nodes[i].kind == PL_NODE_TRANSFORM_CODE && read_form(program, i, &form)) return true;
    return false;
}

/* --- deriving parts --- */

bool pl_terrain_walk_begin(pl_terrain_walk *w, const pl_program *program)
{
    memset(w, 0, sizeof *w);
    w->scope.parameters = malloc((program->parameter_count + 1) * sizeof(double));
    w->entering = malloc((program->parameter_count + 1) * sizeof(double));
    return w->scope.parameters && w->entering && pl_walk_begin(&w->walk, program, 0, NULL, NULL);
}

void pl_terrain_walk_end(pl_terrain_walk *w)
{
    if (w->walk.program) pl_walk_end(&w->walk);
    free(w->scope.parameters);
    free(w->entering);
    free(w->path.terms);
}

static uint64_t leaves_below(const pl_terrain *terrain, uint32_t level)
{
    uint64_t leaves = 1;
    for (uint32_t i = level; i < terrain->levels; i++) leaves *= terrain->radix[i];
    return leaves;
}

/* The terms that lead to union `index` of a level. */
static bool set_path(const pl_terrain *terrain, uint32_t level, uint64_t index, pl_path *path)
{
    if (level && !pl_path_push(path, level - 1, 0)) return false;
    path->length = level;
    for (uint32_t i = level; i-- > 0; index /= terrain->radix[i]) path->terms[i] = (uint32_t)(index % terrain->radix[i]);
    return true;
}

/* Lets the walk stand before the symbol to which the terms lead; *entered: symbols above it. */
static bool seek(const pl_terrain *terrain, pl_terrain_walk *w, uint32_t level, uint64_t index, uint32_t *entered)
{
    pl_walk *walk = &w->walk;
    *entered = 0;
    pl_scope_unpack(walk->program, terrain->scope, &w->scope);
    pl_walk_restart(walk, terrain->symbol, &w->scope);
    if (level == 0) return true;
    if (!set_path(terrain, level, index, &w->path)) return false;
    walk->follow = &w->path;
    pl_event event;
    do {
        event = pl_walk_next(walk, NULL);
        w->textured = w->textured || event == PL_EVENT_TEXTURE;
    } while (event == PL_EVENT_TEXTURE || (event == PL_EVENT_ENTER && walk->at.terms < level));
    walk->follow = NULL;
    if (event != PL_EVENT_ENTER) return false;
    *entered = walk->at.depth;
    uint32_t symbol = walk->program->nodes[walk->node].as.enter.symbol;
    pl_scope_copy(walk->program, &walk->scope, &w->scope);
    pl_walk_restart(walk, symbol, &w->scope);
    return true;
}

/* Reads the cells that the walk's last transformation was computed from; false: it isn't of the form. */
static bool read_cells(const pl_terrain_form *form, const pl_walk *walk, double *cells)
{
    pl_affine matrix;
    if (walk->node != form->node) return false;
    for (uint32_t c = 0; c < form->slots; c++) cells[c] = walk->scope.parameters[form->slot[c]];
    for (uint32_t c = form->slots; c < form->cells; c++) cells[c] = form->number[c];
    pl_terrain_matrix(form, cells, &matrix);
    return memcmp(&matrix, &walk->transform->to_parent, sizeof matrix) == 0;
}

static void remember_entering(pl_terrain_walk *w)
{
    const pl_walk *walk = &w->walk;
    w->symbol = walk->program->nodes[walk->node].as.enter.symbol;
    w->terms = walk->at.terms;
    w->rule = walk->at.rule;
    memcpy(w->entering, walk->scope.parameters, walk->program->parameter_count * sizeof *w->entering);
}

/* A terrain of two levels counts 00, 01, 02, 03, 10, … */
static void next_place(const pl_terrain *terrain, uint32_t level, uint32_t *digits)
{
    for (uint32_t i = terrain->levels - level; i-- > 0;) {
        if (++digits[i] < terrain->radix[level + i]) return;
        digits[i] = 0;
    }
}

bool pl_terrain_derive(const pl_terrain *terrain, pl_terrain_walk *w, uint32_t level, uint64_t index,
                       pl_terrain_take *take, void *context)
{
    pl_walk *walk = &w->walk;
    uint32_t digits[PL_TERRAIN_LEVELS] = {0}, entered;
    const uint64_t count = leaves_below(terrain, level), end = (index + 1) * count;
    const size_t digit_bytes = (terrain->levels - level) * sizeof *digits;
    double cells[PL_TERRAIN_CELLS];
    bool placed = false, texture = false;
    w->symbol = UINT32_MAX;
    if (!seek(terrain, w, level, index, &entered)) return false;
    for (uint64_t leaf = index * count; leaf < end;) {
        switch (pl_walk_next(walk, NULL)) {
        case PL_EVENT_TEXTURE: texture = true; break;
        case PL_EVENT_ENTER:
            if (placed) return false;
            w->textured = w->textured || texture;
            remember_entering(w);
            break;
        case PL_EVENT_TRANSFORM:
            if (placed || !read_cells(&terrain->form, walk, cells)) return false;
            placed = true;
            break;
        case PL_EVENT_PRIMITIVE:
            if (!placed || walk->shape != PL_SHAPE_TRIANGLE || walk->at.no_shadow ||
                walk->at.terms != terrain->levels - level || entered + walk->at.depth != terrain->depth ||
                (digit_bytes && memcmp(walk->path.terms, digits, digit_bytes) != 0) ||
                !take(context, leaf++, cells, walk->transform))
                return false;
            next_place(terrain, level, digits);
            placed = texture = false;
            break;
        default: return false;
        }
    }
    return pl_walk_next(walk, NULL) == PL_EVENT_END;
}

/* --- the shape --- */

static bool first_terms_only(const pl_walk *walk)
{
    for (uint32_t i = 0; i < walk->at.terms; i++)
        if (walk->path.terms[i]) return false;
    return true;
}

/* Divides the levels into those above and within tiles. */
static bool set_tiles(pl_terrain *terrain)
{
    terrain->tile_level = terrain->levels;
    terrain->tile_leaves = 1;
    while (terrain->tile_level && terrain->tile_leaves * terrain->radix[terrain->tile_level - 1] <= PL_TERRAIN_TILE)
        terrain->tile_leaves *= terrain->radix[--terrain->tile_level];
    terrain->tiles = terrain->leaves / terrain->tile_leaves;
    terrain->tile_row = (terrain->tile_leaves + PL_TERRAIN_CLUSTER - 1) / PL_TERRAIN_CLUSTER * PL_TERRAIN_CLUSTER;
    return terrain->tile_leaves >= PL_TERRAIN_CLUSTER && terrain->tiles >= LEAST_TILES;
}

/* The shape that the terrain must have if it is complete: that of the way to its first triangle. */
static bool read_shape(pl_terrain *terrain, pl_terrain_walk *w)
{
    pl_walk *walk = &w->walk;
    const pl_program *program = walk->program;
    uint32_t entered;
    pl_event event;
    if (!seek(terrain, w, 0, 0, &entered)) return false;
    do event = pl_walk_next(walk, NULL);
    while (event == PL_EVENT_TEXTURE || (event == PL_EVENT_ENTER && first_terms_only(walk)));
    if (event != PL_EVENT_TRANSFORM || program->nodes[walk->node].kind != PL_NODE_TRANSFORM_CODE ||
        !first_terms_only(walk) || !read_form(program, walk->node, &terrain->form))
        return false;
    if (walk->at.terms > PL_TERRAIN_LEVELS || walk->pending_count != walk->at.terms) return false;
    terrain->levels = walk->at.terms;
    terrain->depth = walk->at.depth;
    terrain->leaves = 1;
    for (uint32_t i = 0; i < terrain->levels; i++) {
        terrain->radix[i] = program->nodes[walk->pending[i].node].as.union_.children_count;
        if (terrain->leaves > PL_TERRAIN_MOST / terrain->radix[i]) return false;
        terrain->leaves *= terrain->radix[i];
        if ((terrain->radix[i] & (terrain->radix[i] - 1)) == 0) terrain->shift[i] = (uint8_t)__builtin_ctz(terrain->radix[i]);
    }
    return set_tiles(terrain);
}

/* --- the scene --- */

static void free_place(pl_terrain_place *place)
{
    free(place->transforms);
    free(place->terms);
}

static void free_terrain(pl_terrain *terrain)
{
    free_place(&terrain->place);
    free(terrain->scope);
    free(terrain->classes);
    free(terrain->end.cells);
    free(terrain->end.values);
    free(terrain->memory);
    free((void *)terrain->front.nodes);
}

void pl_terrains_free(pl_scene *scene)
{
    pl_terrains *terrains = scene->terrains;
    scene->terrains = NULL;
    if (!terrains) return;
    for (uint32_t i = 0; terrains->list && i < terrains->count; i++) free_terrain(&terrains->list[i]);
    for (uint32_t i = 0; terrains->singles && i < terrains->single_count; i++) free_place(&terrains->singles[i].place);
    free(terrains->list);
    free(terrains->singles);
    free(terrains);
}

static bool set_place(pl_terrain_place *place, const pl_walk *walk, const pl_transform *chain, uint64_t first)
{
    place->transform_count = walk->at.marks[0];
    place->term_count = walk->at.terms;
    place->no_shadow = walk->at.no_shadow;
    place->first = first;
    place->transforms = malloc((place->transform_count + 1) * sizeof *place->transforms);
    place->terms = malloc((place->term_count + 1) * sizeof *place->terms);
    if (!place->transforms || !place->terms) return false;
    if (place->transform_count) memcpy(place->transforms, chain, place->transform_count * sizeof *chain);
    if (place->term_count) memcpy(place->terms, walk->path.terms, place->term_count * sizeof *place->terms);
    return true;
}

static bool add_single(const pl_scene *scene, pl_terrains *terrains, const pl_walk *walk, bool mesh,
                       const pl_transform *chain, uint64_t first)
{
    if (terrains->single_count == MOST_PLACES) return false;
    pl_terrain_single *single = &terrains->singles[terrains->single_count++];
    single->shape = walk->shape;
    single->mesh = mesh ? scene->meshes[walk->mesh] : NULL;
    memcpy(single->arguments, walk->arguments, sizeof single->arguments);
    return set_place(&single->place, walk, chain, first);
}

/* The terrain of the symbol that the walk is about to enter; false: it isn't one. */
static bool add_terrain(const pl_scene *scene, pl_terrains *terrains, const pl_walk *walk, const pl_transform *chain,
                        uint64_t first)
{
    const pl_program *program = scene->program;
    pl_terrain_walk w;
    if (terrains->count == MOST_PLACES) return false;
    pl_terrain *terrain = &terrains->list[terrains->count++];
    terrain->symbol = program->nodes[walk->node].as.enter.symbol;
    terrain->scope = malloc(pl_scope_words(program, &walk->scope) * sizeof *terrain->scope);
    bool ok = terrain->scope && set_place(&terrain->place, walk, chain, first);
    if (ok) {
        pl_scope_pack(program, &walk->scope, terrain->scope);
        ok = pl_terrain_walk_begin(&w, program) && read_shape(terrain, &w) &&
             terrains->generated + terrain->leaves <= PL_TERRAIN_MOST;
        pl_terrain_walk_end(&w);
    }
    if (ok) {
        terrains->generated += terrain->leaves;
        return true;
    }
    free_terrain(terrain);
    *terrain = (pl_terrain){0};
    terrains->count--;
    return false;
}

/* Lists what stands at the scene's root. */
static bool list_places(const pl_scene *scene, pl_terrains *terrains, pl_walk *walk)
{
    enum { MOST_TRANSFORMS = 64, MOST_ENTERED = 64 /* bits of those that states are built without */ };
    pl_transform chain[MOST_TRANSFORMS];
    uint64_t first = 0;
    for (uint32_t entered = 0;;) {
        switch (pl_walk_next(walk, NULL)) {
        case PL_EVENT_END: return terrains->count > 0;
        case PL_EVENT_TEXTURE: break;
        case PL_EVENT_TRANSFORM:
            if (walk->at.marks[0] == MOST_TRANSFORMS) return false;
            chain[walk->at.marks[0]++] = *walk->transform;
            break;
        case PL_EVENT_PRIMITIVE:
            terrains->fronts = !add_single(scene, terrains, walk, false, chain, first++) || terrains->fronts;
            break;
        case PL_EVENT_MESH:
            terrains->fronts = !add_single(scene, terrains, walk, true, chain, first++) || terrains->fronts;
            break;
        case PL_EVENT_ENTER:
            if (entered < MOST_ENTERED && add_terrain(scene, terrains, walk, chain, first)) {
                terrains->list[terrains->count - 1].entered = entered;
                first += terrains->list[terrains->count - 1].leaves;
            } else {
                terrains->fronts = true;
            }
            entered++;
            pl_walk_prune(walk);
            break;
        default: return false;
        }
    }
}

/* -1, 0 or 1: the order in which an item of the scene and a terrain stand there. */
static int compare_places(const pl_item *item, const pl_terrain_place *place)
{
    const pl_path a = {(uint32_t *)item->site->terms, item->site->term_count, 0}, b = {place->terms, place->term_count, 0};
    return pl_path_compare(&a, &b);
}

/* Primitives are counted through: items come after the terrains before them, and terrains after such items. */
static void number(pl_scene *scene, pl_terrains *terrains)
{
    const pl_state *root = &scene->states.list[0];
    for (uint32_t i = 0, k = 0; i < terrains->count; i++) {
        uint64_t first = 0;
        for (k = 0; k < root->item_count && compare_places(&root->items[k], &terrains->list[i].place) < 0; k++)
            first = pl_add_saturating(first, pl_item_primitives(&scene->states, &root->items[k]));
        for (uint32_t before = 0; before < i; before++) first = pl_add_saturating(first, terrains->list[before].leaves);
        terrains->list[i].place.first = first;
        for (; k < root->item_count; k++) {
            pl_item *item = (pl_item *)&root->items[k];
            item->first = pl_add_saturating(item->first, terrains->list[i].leaves);
        }
    }
}

/* States of what isn't terrain. false: there are too many, or they have no end. */
static bool build_states(pl_scene *scene, pl_terrains *terrains, uint32_t most)
{
    uint64_t omitted = 0;
    for (uint32_t i = 0; i < terrains->single_count; i++) free_place(&terrains->singles[i].place);
    terrains->single_count = 0;
    for (uint32_t i = 0; i < terrains->count; i++) omitted |= UINT64_C(1) << terrains->list[i].entered;
    if (!pl_states_build_without(&scene->states, omitted, scene->program, scene->meshes, false, scene->memory, most, NULL))
        return false;
    number(scene, terrains);
    return !scene->states.list[0].endless;
}

/* false without an error: they aren't terrain, or don't pay. */
static bool fill_all(const pl_scene *scene, pl_terrains *terrains, pl_error *error)
{
    size_t used = scene->program->bytes + scene->mesh_bytes + scene->states.bytes;
    terrains->bytes = sizeof *terrains + MOST_PLACES * (sizeof *terrains->list + sizeof *terrains->singles);
    for (uint32_t i = 0; i < terrains->count; i++) {
        pl_terrain *terrain = &terrains->list[i];
        const size_t taken = used + terrains->bytes, room = scene->memory > taken ? scene->memory - taken : 0;
        double lacking;
        if (!pl_terrain_fill(scene, terrain, room, &lacking))
            return lacking > 0.0 && pl_fail_allowed(error, (double)scene->memory + lacking, (double)scene->memory);
        terrains->bytes += terrain->tiles * terrain->stride + terrain->node_bytes +
                           terrain->form.slots * terrain->tile_row * sizeof *terrain->classes +
                           scene->program->parameter_count * (sizeof *terrain->end.cells + sizeof *terrain->end.values);
    }
    return true;
}

bool pl_terrains_build(pl_scene *scene, uint32_t most, pl_error *error)
{
    if (!has_form(scene->program)) return false;
    pl_terrains *terrains = calloc(1, sizeof *terrains);
    pl_walk walk;
    bool ok = terrains && (terrains->list = calloc(MOST_PLACES, sizeof *terrains->list)) &&
              (terrains->singles = calloc(MOST_PLACES, sizeof *terrains->singles));
    if (ok && (ok = pl_walk_begin(&walk, scene->program, 0, NULL, NULL))) {
        ok = list_places(scene, terrains, &walk) && walk.singular == 0;
        pl_walk_end(&walk);
    }
    ok = ok && (!terrains->fronts || build_states(scene, terrains, most)) && fill_all(scene, terrains, error);
    scene->terrains = terrains;
    if (ok) return true;
    pl_terrains_free(scene);
    pl_states_free(&scene->states);
    return false;
}
