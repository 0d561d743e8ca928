/* class_walk.c - following the graph with intervals (class.h): depth first, each class once, on a stack of its own.
 *
 * A level of the stack is a node whose subtrees are being bounded, with the scope to go on from. The work for a class
 * is the number of nodes of all distinct classes below it: a fact of the class, however it is reached. A walk that takes
 * MOST_WORK goes on to twice that; then not only its own class is known to take too much, but all those on the way down
 * that were met in the first half. So a chain of recursion costs a few nodes a level, although each level fails. What
 * is unknown of a part is unknown of the whole, so a walk ends at the first class that contains itself. */
#include <stdlib.h>
#include <string.h>

#include "class.h"
#include "array.h"
#include "error.h"
#include "random.h"

enum { MOST_WORK = 4096, BUCKETS = 512, NONE = UINT32_MAX };

/* A class on this walk. */
typedef struct cell {
    uint32_t symbol, next; /* in its bucket */
    uint64_t hash;
    size_t live;           /* in `lives` */
    bool busy; /* on the stack: reached again, it contains itself */
    uint64_t discovered, done;
    pl_bounds bounds;
} cell;

/* What a map of ranges made of bounds: that of a repeated branch is asked for again at once. */
enum { KEPT_MAPS = 4 };
typedef struct mapped {
    pl_range_map map;
    pl_bounds below, above;
} mapped;

typedef struct level {
    uint32_t node, next; /* which of its subtrees comes next */
    uint32_t cell;       /* of an enter node */
    uint8_t kind;
    bool empty;          /* nothing joined yet */
    size_t scope, map;   /* in `scopes` and `maps` */
    pl_bounds bounds;
} level;

struct pl_class_walk {
    const pl_program *program;
    pl_mesh_tree *const *meshes;
    pl_class_grid grid;
    pl_array levels, scopes, maps, cells, lives;
    uint32_t buckets[BUCKETS];
    pl_range *scope, *live; /* at the current node; of the class being looked up */
    pl_range_result result;
    mapped *kept;
    unsigned kept_next;
    uint64_t work, visited;
    bool unknown; /* it came to something of which nothing can be known */
    bool (*known)(void *context, uint32_t symbol, const pl_range *live);
    void *context;
};

pl_class_walk *pl_class_walk_create(const pl_program *program, pl_mesh_tree *const *meshes)
{
    pl_class_walk *w = calloc(1, sizeof *w);
    if (!w) return NULL;
    w->program = program;
    w->meshes = meshes;
    w->levels.element = sizeof(level);
    w->scopes.element = w->lives.element = sizeof(pl_range);
    w->maps.element = sizeof(pl_range_map);
    w->cells.element = sizeof(cell);
    w->scope = malloc((program->parameter_count + 1) * sizeof *w->scope);
    w->live = malloc((program->parameter_count + 1) * sizeof *w->live);
    w->kept = calloc(KEPT_MAPS, sizeof *w->kept);
    if (w->scope && w->live && w->kept) return w;
    pl_class_walk_free(w);
    return NULL;
}

void pl_class_walk_free(pl_class_walk *w)
{
    if (!w) return;
    pl_array *arrays[] = {&w->levels, &w->scopes, &w->maps, &w->cells, &w->lives};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]->data);
    free(w->scope);
    free(w->live);
    free(w->kept);
    free(w);
}

uint64_t pl_class_walk_visited(const pl_class_walk *w)
{
    return w->visited;
}

static cell *cell_at(const pl_class_walk *w, uint32_t index)
{
    return (cell *)w->cells.data + index;
}

/* --- classes --- */

/* Outward to a grid of 2^bits steps an octave; whole numbers that are known and count stay. */
static pl_range on_grid(pl_range a, pl_class_grid grid)
{
    static const int bits[] = {[PL_GRID_CLASS] = 5, [PL_GRID_FINE] = 8, [PL_GRID_COARSE] = 4, [PL_GRID_COVER] = 2};
    int exponent;
    if (isnan(a.lo) || !isfinite(a.lo) || !isfinite(a.hi)) return a;
    if (a.lo == a.hi && a.lo == floor(a.lo) && fabs(a.lo) <= (grid == PL_GRID_COARSE ? 64.0 : 0x1p20)) return a;
    frexp(fmax(fabs(a.lo), fabs(a.hi)), &exponent);
    double step = ldexp(1.0, exponent - bits[grid]);
    if (!(step > 0.0)) return a;
    return (pl_range){floor(a.lo / step) * step, ceil(a.hi / step) * step};
}

void pl_class_of(const pl_program *program, uint32_t symbol, const pl_range *scope, pl_class_grid grid, pl_range *live)
{
    const pl_node *node = &program->nodes[symbol];
    for (uint32_t i = 0; i < node->as.symbol.live_count; i++) {
        live[i] = on_grid(scope[program->slots[node->as.symbol.live_first + i]], grid);
        if (isnan(live[i].lo)) live[i] = (pl_range){NAN, NAN};
        live[i].lo += 0.0; /* one zero */
        live[i].hi += 0.0;
    }
}

bool pl_class_is_of_a_state(const pl_range *live, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        pl_range same = on_grid(live[i], PL_GRID_CLASS);
        if (!(isnan(live[i].lo) || (same.lo == live[i].lo && same.hi == live[i].hi))) return false;
    }
    return true;
}

/* The class's cell, and whether it is new; NONE: no memory. */
static uint32_t find_cell(pl_class_walk *w, uint32_t symbol, const pl_range *live, bool *is_new)
{
    const uint32_t count = w->program->nodes[symbol].as.symbol.live_count;
    uint64_t hash = symbol;
    for (uint32_t i = 0; i < count; i++) hash = pl_mix(pl_mix(hash, pl_bits(live[i].lo)), pl_bits(live[i].hi));
    uint32_t *bucket = &w->buckets[hash % BUCKETS];
    *is_new = false;
    for (uint32_t i = *bucket; i != NONE; i = cell_at(w, i)->next) {
        const cell *c = cell_at(w, i);
        if (c->hash == hash && c->symbol == symbol &&
            (!count || memcmp((pl_range *)w->lives.data + c->live, live, count * sizeof *live) == 0))
            return i;
    }
    pl_range *kept = pl_array_extend(&w->lives, count);
    cell *place = pl_array_extend(&w->cells, 1);
    if (!kept || !place) return NONE;
    if (count) memcpy(kept, live, count * sizeof *live);
    *is_new = true;
    *place = (cell){symbol, *bucket, hash, w->lives.count - count, true, w->work, 0, pl_bounds_nothing()};
    return *bucket = (uint32_t)w->cells.count - 1;
}

/* --- the stack --- */

static level *push(pl_class_walk *w, uint8_t kind, uint32_t node)
{
    level *l = pl_array_extend(&w->levels, 1);
    if (l)
        *l = (level){.node = node, .kind = kind, .empty = true, .scope = w->scopes.count, .map = w->maps.count,
                     .bounds = pl_bounds_nothing()};
    return l;
}

/* The same, with the scope, for what has several subtrees. */
static level *push_scope(pl_class_walk *w, uint32_t node)
{
    const uint32_t count = w->program->parameter_count;
    level *l = push(w, w->program->nodes[node].kind, node);
    pl_range *kept = l ? pl_array_extend(&w->scopes, count) : NULL;
    if (!kept) return NULL;
    if (count) memcpy(kept, w->scope, count * sizeof *kept);
    return l;
}

static void load_scope(pl_class_walk *w, const level *l)
{
    const uint32_t count = w->program->parameter_count;
    if (count) memcpy(w->scope, (pl_range *)w->scopes.data + l->scope, count * sizeof *w->scope);
}

/* --- going down --- */

typedef enum step { GO_ON, RESULT, FAILED } step;

static bool run(pl_class_walk *w, uint32_t code)
{
    return pl_range_run(w->program, code, w->scope, &w->result);
}

static step nothing_known(pl_class_walk *w)
{
    w->unknown = true;
    return FAILED;
}

static step enter_symbol(pl_class_walk *w, uint32_t *node, pl_bounds *bounds)
{
    const uint32_t symbol = w->program->nodes[*node].as.enter.symbol;
    const pl_node *it = &w->program->nodes[symbol];
    bool is_new;
    pl_class_of(w->program, symbol, w->scope, w->grid, w->live);
    uint32_t found = find_cell(w, symbol, w->live, &is_new);
    if (found == NONE) return FAILED;
    if (is_new ? w->known(w->context, symbol, w->live) : cell_at(w, found)->busy) return nothing_known(w);
    if (!is_new) {
        *bounds = cell_at(w, found)->bounds;
        return RESULT;
    }
    level *l = push(w, PL_NODE_ENTER, *node);
    if (!l) return FAILED;
    l->cell = found;
    /* What isn't live can't matter: it is anything, as it would be in another instance. */
    for (uint32_t i = 0; i < w->program->parameter_count; i++) w->scope[i] = (pl_range){-INFINITY, INFINITY};
    for (uint32_t i = 0; i < it->as.symbol.live_count; i++)
        w->scope[w->program->slots[it->as.symbol.live_first + i]] = w->live[i];
    *node = symbol;
    return GO_ON;
}

static step branch(pl_class_walk *w, uint32_t *node)
{
    const pl_node *it = &w->program->nodes[*node];
    if (!run(w, it->as.branch.test)) return nothing_known(w);
    pl_range test = w->result.values[0];
    if (test.lo == 0.0 && test.hi == 0.0) {
        *node = it->as.branch.otherwise;
        return GO_ON;
    }
    if (!(test.lo > 0.0 || test.hi < 0.0) && !push_scope(w, *node)) return FAILED;
    *node = it->as.branch.then;
    return GO_ON;
}

static step bound_primitive(pl_class_walk *w, const pl_node *it, pl_bounds *bounds)
{
    double low[PL_SHAPE_ARGUMENTS] = {0}, high[PL_SHAPE_ARGUMENTS] = {0};
    if (!run(w, it->as.primitive.code)) return nothing_known(w);
    for (uint32_t i = 0; i < w->result.count && i < PL_SHAPE_ARGUMENTS; i++) {
        low[i] = w->result.values[i].lo;
        high[i] = w->result.values[i].hi;
    }
    pl_bounds_of_shape(pl_shape_of(it->as.primitive.shape), low, high, bounds);
    return RESULT;
}

/* One node: *node becomes the next one, or *bounds is known. */
static step descend(pl_class_walk *w, uint32_t *node, pl_bounds *bounds)
{
    const pl_node *it = &w->program->nodes[*node];
    *bounds = pl_bounds_nothing();
    switch (it->kind) {
    case PL_NODE_EMPTY: return RESULT;
    case PL_NODE_SYMBOL: *node = it->as.symbol.body; return GO_ON;
    case PL_NODE_RULE: *node = it->as.rule.body; return GO_ON;
    case PL_NODE_TEXTURE: *node = it->as.texture.child; return GO_ON;
    case PL_NODE_BRANCH: return branch(w, node);
    case PL_NODE_CALCULATE:
        *node = it->as.calculate.child;
        return run(w, it->as.calculate.code) ? GO_ON : nothing_known(w);
    case PL_NODE_TRANSFORM:
        if (w->program->transforms[it->as.transform.matrix].singular) return RESULT;
        if (!push(w, it->kind, *node)) return FAILED;
        *node = it->as.transform.child;
        return GO_ON;
    case PL_NODE_TRANSFORM_CODE:
        if (!run(w, it->as.transform_code.code)) return nothing_known(w);
        if (!push(w, it->kind, *node)) return FAILED;
        pl_range_map *map = pl_array_extend(&w->maps, 1);
        if (!map) return FAILED;
        *map = w->result.map;
        *node = it->as.transform_code.child;
        return GO_ON;
    case PL_NODE_CHOOSE:
    case PL_NODE_UNION:
        if (!push_scope(w, *node)) return FAILED;
        return RESULT; /* of nothing yet: the first subtree is taken on the way up */
    case PL_NODE_ENTER: return enter_symbol(w, node, bounds);
    case PL_NODE_PRIMITIVE: return bound_primitive(w, it, bounds);
    case PL_NODE_MESH: pl_bounds_of_box(pl_mesh_box(w->meshes[it->as.mesh.mesh]), bounds); return RESULT;
    case PL_NODE_OBJECT: return nothing_known(w);
    default: *node = it->as.no_shadow.child; return GO_ON;
    }
}

/* --- going up --- */

/* The next subtree of a level's node that may be chosen or belongs to the union; NONE: there is no more. */
static uint32_t next_subtree(pl_class_walk *w, level *l)
{
    const pl_node *it = &w->program->nodes[l->node];
    if (l->kind == PL_NODE_UNION)
        return l->next < it->as.union_.children_count ? w->program->children[it->as.union_.children_first + l->next++]
                                                      : NONE;
    if (l->kind == PL_NODE_BRANCH) return l->next++ == 0 ? it->as.branch.otherwise : NONE;
    while (l->next < it->as.choose.cases_count) {
        const pl_case *one = &w->program->cases[it->as.choose.cases_first + l->next++];
        w->work++;
        load_scope(w, l);
        /* A weight that can't be told may be anything. */
        if (!run(w, one->weight) || w->result.values[0].hi > 0.0) return one->body;
    }
    return NONE;
}

static void pass_range(pl_class_walk *w, const pl_range_map *map, pl_bounds *bounds)
{
    for (unsigned i = 0; i < KEPT_MAPS; i++) {
        const mapped *m = &w->kept[i];
        if (memcmp(&m->below, bounds, sizeof *bounds) || memcmp(&m->map, map, sizeof *map)) continue;
        *bounds = m->above;
        return;
    }
    mapped *m = &w->kept[w->kept_next++ % KEPT_MAPS];
    m->map = *map;
    m->below = *bounds;
    pl_bounds_through_range(map, bounds);
    m->above = *bounds;
}

/* Takes a subtree's bounds to the level above. true: *node is to be bounded next. */
static bool ascend(pl_class_walk *w, pl_bounds *bounds, bool fresh, uint32_t *node)
{
    level *l = (level *)w->levels.data + w->levels.count - 1;
    switch (l->kind) {
    case PL_NODE_TRANSFORM:
        pl_bounds_through(&w->program->transforms[w->program->nodes[l->node].as.transform.matrix], false, bounds);
        break;
    case PL_NODE_TRANSFORM_CODE: {
        const pl_range_map *map = (const pl_range_map *)w->maps.data + l->map;
        pass_range(w, map, bounds);
        if (!(map->inverse_stretch < INFINITY)) { /* may be singular and dropped */
            bounds->count = UINT64_MAX;
            bounds->fewest = 0;
        }
        break;
    }
    case PL_NODE_ENTER: {
        cell *c = cell_at(w, l->cell);
        bounds->hollow = bounds->hollow || bounds->fewest == 0;
        c->bounds = *bounds;
        c->busy = false;
        c->done = w->work;
        break;
    }
    default:
        if (!fresh) {
            if (l->empty) l->bounds = *bounds;
            else pl_bounds_join(&l->bounds, bounds, l->kind != PL_NODE_UNION);
            l->empty = false;
        }
        if ((*node = next_subtree(w, l)) != NONE) {
            load_scope(w, l);
            return true;
        }
        *bounds = l->bounds;
    }
    w->scopes.count = l->scope;
    w->maps.count = l->map;
    w->levels.count--;
    return false;
}

/* Bounds the first class, whose level is on the stack. */
static bool walk(pl_class_walk *w, uint32_t node, pl_bounds *bounds)
{
    for (;;) {
        if (++w->work > 2 * MOST_WORK) return false;
        const size_t before = w->levels.count;
        step s = descend(w, &node, bounds);
        if (s == GO_ON) continue;
        if (s == FAILED) return false;
        bool fresh = w->levels.count > before;
        while (!ascend(w, bounds, fresh, &node)) {
            if (w->levels.count == 0) return w->work <= MOST_WORK;
            fresh = false;
        }
    }
}

/* Tells what was learnt: classes that are done, and those of which nothing can be known, be it that the second half of the
 * walk's work lies below them. */
static void tell(const pl_class_walk *w, void (*found)(void *context, const pl_class_found *found))
{
    for (uint32_t i = 0; i < w->cells.count; i++) {
        const cell *c = cell_at(w, i);
        const uint64_t work = (c->busy ? w->work : c->done) - c->discovered;
        const bool unknown = work > MOST_WORK || (c->busy && w->unknown);
        pl_class_found fact = {c->symbol, (pl_range *)w->lives.data + c->live, unknown ? NULL : &c->bounds, work};
        if (unknown || (!c->busy && c->done <= MOST_WORK)) found(w->context, &fact);
    }
}

bool pl_class_walk_bound(pl_class_walk *w, uint32_t symbol, const pl_range *live, pl_class_grid grid,
                         bool (*known)(void *context, uint32_t symbol, const pl_range *live),
                         void (*found)(void *context, const pl_class_found *found), void *context, pl_bounds *bounds)
{
    const pl_node *it = &w->program->nodes[symbol];
    bool is_new;
    w->grid = grid;
    w->known = known;
    w->context = context;
    w->levels.count = w->scopes.count = w->maps.count = w->cells.count = w->lives.count = 0;
    w->work = 0;
    w->unknown = false;
    memset(w->buckets, 0xFF, sizeof w->buckets);
    for (uint32_t i = 0; i < w->program->parameter_count; i++) w->scope[i] = (pl_range){-INFINITY, INFINITY};
    for (uint32_t i = 0; i < it->as.symbol.live_count; i++)
        w->scope[w->program->slots[it->as.symbol.live_first + i]] = live[i];
    bool ok = find_cell(w, symbol, live, &is_new) != NONE && push(w, PL_NODE_ENTER, symbol) && walk(w, symbol, bounds);
    w->visited += w->work;
    tell(w, found);
    return ok;
}
