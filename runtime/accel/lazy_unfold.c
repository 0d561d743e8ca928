/* lazy_unfold.c - unfolding one application of a state (lazy.h): derived into growing arrays, then written to one block. */
#include <stdlib.h>
#include <string.h>

#include "../array.h"
#include "../error.h"
#include "../random.h"
#include "lazy.h"

/* Of an event of the derivation, in nodes visited by a walk over a class. */
enum { EVENT_WORK = 4 };

enum { KNOWN_BOUNDS = 64, MOST_LIVE = 8 };

/* What tracing needs of a computed transformation: all before to_parent (program.h). */
#define MAP_BYTES offsetof(pl_transform, to_parent)

/* Bounds of the classes that were asked for last; a place for each hash. */
typedef struct known_bounds {
    uint32_t symbol, count; /* of live parameters, + 1; 0: none */
    uint64_t live[MOST_LIVE];
    pl_bounds bounds;
    pl_gate_box gate;
} known_bounds;

/* Growing arrays of what is being unfolded; a draft refers to them by index. */
typedef struct draft {
    pl_lazy_item it;
    pl_box box, content;
    pl_affine map; /* the product of its transformations' to_parent … */
    double slack;  /* … and how far roundings of that may move a point */
    bool shrinks;
    pl_reach reach;
    pl_gate_box gate;
    double arguments[PL_SHAPE_ARGUMENTS];
    size_t transform_first, term_first, scope_first;
} draft;

struct pl_unfolder {
    const pl_scene *scene;
    pl_walk walk;
    pl_scope scope;
    pl_array drafts, chain, transforms, computed, terms, scopes, key;
    uint64_t work;
    known_bounds known[KNOWN_BOUNDS];
    size_t entered, primitives; /* drafts of states, of shapes */
    size_t entered_transforms;
};

/* A transformation of the current path: constant, or one of `computed`. */
typedef struct link_ {
    const pl_transform *constant;
    size_t computed;
} link_;

pl_unfolder *pl_unfolder_create(const pl_scene *scene, pl_error *error)
{
    pl_unfolder *u = calloc(1, sizeof *u);
    if (u) {
        u->scene = scene;
        u->drafts.element = sizeof(draft);
        u->chain.element = u->transforms.element = sizeof(link_);
        u->computed.element = sizeof(pl_transform);
        u->terms.element = sizeof(uint32_t);
        u->scopes.element = u->key.element = sizeof(uint64_t);
        u->scope.parameters = malloc((scene->program->parameter_count + 1) * sizeof(double));
    }
    if (u && u->scope.parameters && pl_walk_begin(&u->walk, scene->program, 0, NULL, error)) {
        u->walk.stretches = scene->gates != NULL;
        u->walk.memo = pl_memo_create(scene->program);
        if (u->walk.memo) return u;
    }
    pl_unfolder_free(u);
    pl_fail_memory(error, "preparing to unfold");
    return NULL;
}

void pl_unfolder_free(pl_unfolder *u)
{
    if (!u) return;
    pl_memo_free(u->walk.memo);
    pl_walk_end(&u->walk);
    free(u->scope.parameters);
    pl_array *arrays[] = {&u->drafts, &u->chain, &u->transforms, &u->computed, &u->terms, &u->scopes, &u->key};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]->data);
    free(u);
}

/* --- unfolding --- */

static bool add_transform(pl_unfolder *u)
{
    link_ l = {u->walk.transform, 0};
    if (l.constant == &u->walk.computed) {
        pl_transform *kept = pl_array_extend(&u->computed, 1);
        if (!kept) return false;
        *kept = u->walk.computed;
        l = (link_){NULL, u->computed.count - 1};
    }
    u->chain.count = u->walk.at.marks[0]++;
    link_ *place = pl_array_extend(&u->chain, 1);
    if (place) *place = l;
    return place != NULL;
}

static const pl_transform *link_transform(const pl_unfolder *u, const link_ *l)
{
    return l->constant ? l->constant : (const pl_transform *)u->computed.data + l->computed;
}

/* What is known of the state that the walk enters. */
static const known_bounds *bounds_of(pl_unfolder *u, pl_classes *classes, uint32_t symbol)
{
    const pl_program *program = u->scene->program;
    const pl_node *node = &program->nodes[symbol];
    const uint32_t count = node->as.symbol.live_count;
    uint64_t live[MOST_LIVE], hash = symbol;
    for (uint32_t i = 0; i < count && i < MOST_LIVE; i++) {
        memcpy(&live[i], &u->walk.scope.parameters[program->slots[node->as.symbol.live_first + i]], sizeof live[i]);
        hash = (hash ^ live[i]) * UINT64_C(0x9E3779B97F4A7C15);
    }
    known_bounds *known = &u->known[(hash >> 32) % KNOWN_BOUNDS];
    if (count <= MOST_LIVE && known->count == count + 1 && known->symbol == symbol &&
        (!count || memcmp(known->live, live, count * sizeof *live) == 0))
        return known;
    pl_classes_bound(classes, symbol, &u->walk.scope, &known->bounds, &u->work);
    known->gate = pl_bounds_gate(&known->bounds);
    known->symbol = symbol;
    known->count = count <= MOST_LIVE ? count + 1 : 0;
    if (known->count) memcpy(known->live, live, count * sizeof *live);
    return known;
}

/* A bound of the largest stretch that is found at once, not much larger: items' reaches only filter. */
static double rough_stretch(const pl_affine *map)
{
    double square = 0.0;
    for (int i = 0; i < 12; i++) square += i % 4 == 3 ? 0.0 : map->m[i] * map->m[i];
    return sqrt(square) * (1.0 + 16.0 * DBL_EPSILON);
}

static pl_box widened(const pl_box *box, double slack)
{
    pl_box wide = *box;
    for (int axis = 0; axis < 3; axis++) {
        wide.lo[axis] -= slack;
        wide.hi[axis] += slack;
    }
    return wide;
}

/* The reach and box of a draft, which are those of its leaf or state, in the state's frame; and its map. */
static void bring_up(const pl_unfolder *u, draft *d)
{
    const link_ *links = u->chain.data;
    const pl_shape *shape = d->it.kind == PL_NODE_PRIMITIVE ? pl_shape_of(d->it.what) : NULL;
    d->map = pl_affine_identity();
    d->slack = 0.0;
    for (size_t i = d->it.transform_count; i-- > 0;) {
        const pl_transform *transform = link_transform(u, &links[i]);
        const double m = rough_stretch(&transform->to_parent), n = rough_stretch(&transform->to_object);
        d->reach = pl_reach_with(transform, m, n, &d->reach);
        d->slack = m * d->slack + 128.0 * DBL_EPSILON * d->reach.size;
        d->map = pl_affine_multiply(&transform->to_parent, &d->map);
    }
    if (d->it.unbounded || pl_box_is_empty(&d->box)) return;
    const pl_box box = shape ? pl_shape_box(shape, d->arguments, d->map.m) : pl_box_map(&d->map, &d->box);
    d->box = widened(&box, d->slack);
    d->it.unbounded = !pl_box_is_finite(&d->box);
}

/* The bounds of a draft in the state's frame. With a cut-off an instance may be drawn as its whole box, however little stands
 * in it. */
static void bound(pl_unfolder *u, pl_classes *classes, draft *d)
{
    pl_lazy_item *it = &d->it;
    pl_bounds leaf;
    if (it->kind == PL_NODE_ENTER) {
        const known_bounds *known = bounds_of(u, classes, it->what);
        const bool whole = u->scene->gates != NULL, empty = pl_box_is_empty(&known->bounds.box);
        d->gate = known->gate;
        d->box = known->bounds.box;
        d->reach = whole ? d->gate.reach : known->bounds.reach;
        it->unbounded = known->bounds.unbounded;
        bring_up(u, d);
        d->shrinks = !it->unbounded && !empty && !(whole && known->bounds.hollow);
        if (!d->shrinks) return;
        const pl_box content = pl_hull_box_under(&d->map, &known->bounds.hull);
        d->content = widened(&content, d->slack);
        return;
    }
    if (it->kind == PL_NODE_MESH) {
        pl_bounds_of_box(pl_mesh_box(u->scene->meshes[it->what]), &leaf);
    } else {
        const pl_shape *shape = pl_shape_of(it->what);
        const pl_box box = shape->support ? pl_shape_box(shape, d->arguments, NULL) : pl_box_everything();
        pl_bounds_of_box(&box, &leaf);
    }
    d->box = leaf.box;
    d->reach = leaf.reach;
    it->unbounded = leaf.unbounded;
    bring_up(u, d);
}

static bool add_draft(pl_unfolder *u, pl_classes *classes, uint8_t kind, uint32_t what)
{
    const pl_walk *walk = &u->walk;
    draft d = {.it = {.kind = kind,
                      .no_shadow = walk->at.no_shadow,
                      .what = what,
                      .transform_count = walk->at.marks[0],
                      .term_count = walk->at.terms},
               .transform_first = u->transforms.count,
               .term_first = u->terms.count,
               .scope_first = u->scopes.count};
    if (kind == PL_NODE_PRIMITIVE) memcpy(d.arguments, walk->arguments, sizeof d.arguments);
    bound(u, classes, &d);
    link_ *transforms = pl_array_extend(&u->transforms, d.it.transform_count);
    uint32_t *terms = pl_array_extend(&u->terms, d.it.term_count);
    if (!transforms || !terms) return false;
    if (d.it.transform_count) memcpy(transforms, u->chain.data, d.it.transform_count * sizeof *transforms);
    if (d.it.term_count) memcpy(terms, walk->path.terms, d.it.term_count * sizeof *terms);
    if (kind == PL_NODE_ENTER) {
        uint64_t *words = pl_array_extend(&u->scopes, pl_scope_words(walk->program, &walk->scope) - walk->scope.draws);
        if (!words) return false;
        u->entered++;
        u->entered_transforms += d.it.transform_count;
        /* Draws end with the application. */
        const uint32_t draws = u->walk.scope.draws;
        u->walk.scope.draws = 0;
        pl_scope_pack(walk->program, &walk->scope, words);
        u->walk.scope.draws = draws;
    }
    u->primitives += kind == PL_NODE_PRIMITIVE;
    draft *place = pl_array_extend(&u->drafts, 1);
    if (place) *place = d;
    return place != NULL;
}

static bool derive(pl_unfolder *u, pl_classes *classes, pl_error *error)
{
    bool ok = true;
    u->entered = u->primitives = u->entered_transforms = u->drafts.count = u->chain.count = u->transforms.count = u->computed.count = u->terms.count = u->scopes.count = 0;
    while (ok) {
        u->work += EVENT_WORK;
        switch (pl_walk_next(&u->walk, error)) {
        case PL_EVENT_ERROR: return false;
        case PL_EVENT_END: return true;
        case PL_EVENT_TRANSFORM: ok = add_transform(u); break;
        case PL_EVENT_ENTER:
            ok = add_draft(u, classes, PL_NODE_ENTER, u->scene->program->nodes[u->walk.node].as.enter.symbol);
            pl_walk_prune(&u->walk);
            break;
        case PL_EVENT_PRIMITIVE: ok = add_draft(u, classes, PL_NODE_PRIMITIVE, u->walk.shape); break;
        case PL_EVENT_MESH: ok = add_draft(u, classes, PL_NODE_MESH, u->walk.mesh); break;
        default: break;
        }
    }
    return pl_fail_memory(error, "unfolding a state");
}

/* The parts of a state's block, in this order; all sizes are multiples of 8. */
typedef struct layout {
    size_t items, enters, computed, transforms, stretches, scopes, key, arguments, terms, total;
} layout;

static layout layout_of(const pl_unfolder *u)
{
    layout l = {.items = u->drafts.count * sizeof(pl_lazy_item),
                .enters = u->entered * sizeof(pl_lazy_enter),
                .computed = u->computed.count * MAP_BYTES,
                .transforms = u->transforms.count * sizeof(pl_transform *),
                .stretches = u->scene->gates ? u->entered_transforms * sizeof(double) : 0,
                .scopes = u->scopes.count * sizeof(uint64_t),
                .key = u->key.count * sizeof(uint64_t),
                .arguments = u->primitives * PL_SHAPE_ARGUMENTS * sizeof(double),
                .terms = (u->terms.count + 1) / 2 * 2 * sizeof(uint32_t)};
    l.total = sizeof(pl_lazy_state) + l.items + l.enters + l.computed + l.transforms + l.stretches + l.scopes + l.key +
              l.arguments + l.terms;
    return l;
}

bool pl_unfolder_derive(pl_unfolder *u, uint32_t symbol, pl_classes *classes, size_t *bytes, uint64_t *work, pl_error *error)
{
    pl_walk_restart(&u->walk, symbol == UINT32_MAX ? 0 : symbol, symbol == UINT32_MAX ? NULL : &u->scope);
    u->work = 0;
    const bool ok = derive(u, classes, error);
    *work += u->work;
    *bytes = layout_of(u).total;
    return ok;
}

static void write_box(const pl_box *box, float planes[6])
{
    for (int axis = 0; axis < 3; axis++) {
        planes[axis] = pl_round_down(box->lo[axis]);
        planes[3 + axis] = pl_round_up(box->hi[axis]);
    }
}

static void write_enter(const draft *d, pl_lazy_enter *enter)
{
    float content[6];
    write_box(d->shrinks ? &d->content : &d->box, content);
    enter->gate = d->gate;
    enter->shrinks = d->shrinks;
    atomic_init(&enter->state, NULL);
    for (int i = 0; i < 6; i++) atomic_init(&enter->content[i], content[i]);
    for (int i = 0; i < 12; i++) enter->to_parent[i] = (float)d->map.m[i];
    enter->slack = pl_round_up(d->slack);
}

pl_lazy_state *pl_unfolder_write(pl_unfolder *u, uint32_t symbol, uint64_t hash, void *memory)
{
    const layout l = layout_of(u);
    pl_lazy_state *state = memory;
    pl_lazy_item *items = (pl_lazy_item *)(state + 1);
    char *at = (char *)items + l.items;
    pl_lazy_enter *enter = (pl_lazy_enter *)at;
    char *maps = at += l.enters;
    const pl_transform **list = (const pl_transform **)(at += l.computed);
    double *stretches = (double *)(at += l.transforms);
    uint64_t *words = (uint64_t *)(at += l.stretches);
    uint64_t *key = (uint64_t *)(at += l.scopes);
    double *arguments = (double *)(at += l.key);
    uint32_t *terms = (uint32_t *)(at + l.arguments);
    for (size_t i = 0; i < u->computed.count; i++)
        memcpy(maps + i * MAP_BYTES, (const pl_transform *)u->computed.data + i, MAP_BYTES);
    if (l.scopes) memcpy(words, u->scopes.data, l.scopes);
    if (l.key) memcpy(key, u->key.data, l.key);
    if (u->terms.count) memcpy(terms, u->terms.data, u->terms.count * sizeof *terms);
    for (size_t i = 0; i < u->transforms.count; i++) {
        const link_ *link = (const link_ *)u->transforms.data + i;
        list[i] = link->constant ? link->constant : (const pl_transform *)(maps + link->computed * MAP_BYTES);
    }
    *state = (pl_lazy_state){.hash = hash, .symbol = symbol, .key_words = (uint32_t)u->key.count,
                             .item_count = (uint32_t)u->drafts.count, .key = key, .items = items};
    for (size_t i = 0; i < u->drafts.count; i++) {
        draft *d = (draft *)u->drafts.data + i;
        write_box(&d->box, d->it.box);
        d->it.transforms = list + d->transform_first;
        d->it.terms = terms + d->term_first;
        if (d->it.kind == PL_NODE_PRIMITIVE) {
            memcpy(arguments, d->arguments, sizeof d->arguments);
            d->it.arguments = arguments;
            arguments += PL_SHAPE_ARGUMENTS;
        } else if (d->it.kind == PL_NODE_ENTER) {
            write_enter(d, enter);
            enter->scope = words + d->scope_first;
            enter->stretches = l.stretches ? stretches : NULL;
            for (uint32_t k = 0; l.stretches && k < d->it.transform_count; k++)
                *stretches++ = link_transform(u, (const link_ *)u->transforms.data + d->transform_first + k)->stretch;
            d->it.enter = enter++;
        }
        items[i] = d->it;
        if (d->it.unbounded) state->unbounded = true;
        else pl_reach_join(&state->reach, &d->reach);
    }
    return state;
}

double pl_lazy_coverage(pl_unfolder *u, uint32_t symbol, const uint64_t *scope, const double d[3])
{
    pl_scope_unpack(u->scene->program, scope, &u->scope);
    return pl_covers_of(u->scene->covers, symbol, &u->scope, d);
}

const uint64_t *pl_unfolder_key(pl_unfolder *u, uint32_t symbol, const uint64_t *scope, uint32_t *words)
{
    const pl_program *program = u->scene->program;
    if (scope) pl_scope_unpack(program, scope, &u->scope);
    u->key.count = 0;
    const pl_node *node = symbol == UINT32_MAX ? NULL : &program->nodes[symbol];
    uint64_t *key = pl_array_extend(&u->key, node ? node->as.symbol.live_count + 1 : 0);
    if (!key) return NULL;
    *words = (uint32_t)u->key.count;
    if (!node) return key;
    key[0] = node->as.symbol.draws ? u->scope.key : 0;
    for (uint32_t i = 0; i < node->as.symbol.live_count; i++) {
        double value = u->scope.parameters[program->slots[node->as.symbol.live_first + i]];
        key[i + 1] = isnan(value) ? UINT64_MAX : pl_bits(value);
    }
    return key;
}
