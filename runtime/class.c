/* class.c - boxes of classes of states (class.h): the graph followed with intervals, memoised by class. */
#include "class.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "error.h"
#include "interval.h"
#include "random.h"

/* Nesting of symbols and of nodes after which nothing is known, so that the C stack is bounded. */
enum { DEEPEST_SYMBOL = 400, DEEPEST_NODE = 3000, GRID_BITS = 4 };

typedef struct entry {
    struct entry *next;
    uint64_t hash;
    uint32_t symbol;
    bool busy; /* being computed: reached again from itself */
    pl_bounds bounds;
    pl_range live[];
} entry;

struct pl_classes {
    const pl_program *program;
    pl_mesh_tree *const *meshes;
    pthread_mutex_t lock;
    entry **buckets;
    uint32_t bucket_count;
    size_t bytes, limit;
    uint64_t count, emptied;
    uint32_t symbols, nodes; /* nesting */
    pl_range_result result;
    pl_range *scope;
};

static const pl_bounds nothing = {.box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}}};

static pl_bounds unknown(void)
{
    return (pl_bounds){pl_box_everything(), {INFINITY, INFINITY, INFINITY}, UINT64_MAX, true};
}

pl_classes *pl_classes_create(const pl_program *program, pl_mesh_tree *const *meshes, size_t limit, pl_error *error)
{
    pl_classes *c = calloc(1, sizeof *c);
    if (c) {
        c->program = program;
        c->meshes = meshes;
        c->limit = limit;
        c->bucket_count = 1024;
        while (c->bucket_count < (1u << 20) && (size_t)c->bucket_count * 256 < limit) c->bucket_count *= 2;
        c->buckets = calloc(c->bucket_count, sizeof *c->buckets);
        c->scope = malloc((program->parameter_count + 1) * sizeof *c->scope);
        pthread_mutex_init(&c->lock, NULL);
    }
    if (c && c->buckets && c->scope) return c;
    pl_classes_free(c);
    pl_fail_memory(error, "bounding states");
    return NULL;
}

static void empty(pl_classes *c)
{
    for (uint32_t i = 0; i < c->bucket_count; i++)
        for (entry *e = c->buckets[i]; e;) {
            entry *next = e->next;
            free(e);
            e = next;
        }
    memset(c->buckets, 0, c->bucket_count * sizeof *c->buckets);
    c->bytes = 0;
    c->count = 0;
}

void pl_classes_free(pl_classes *c)
{
    if (!c) return;
    if (c->buckets) empty(c);
    pthread_mutex_destroy(&c->lock);
    free(c->buckets);
    free(c->scope);
    free(c);
}

void pl_classes_count(pl_classes *c, uint64_t *classes_now, uint64_t *emptied)
{
    pthread_mutex_lock(&c->lock);
    *classes_now = c->count;
    *emptied = c->emptied;
    pthread_mutex_unlock(&c->lock);
}

/* --- bounds --- */

void pl_bounds_of_leaf(const pl_box *box, bool unbounded, pl_bounds *bounds)
{
    bounds->box = *box;
    bounds->count = 1;
    bounds->unbounded = unbounded || !(pl_box_is_empty(box) || pl_box_is_finite(box));
    bounds->reach = pl_reach_leaf(pl_box_is_finite(box) ? 1.7320508075688774 * pl_box_reach(box) : 0.0);
}

static void join(pl_bounds *a, const pl_bounds *b, bool alternative)
{
    pl_box_join(&a->box, &b->box);
    pl_reach_join(&a->reach, &b->reach);
    a->unbounded = a->unbounded || b->unbounded;
    if (alternative) a->count = a->count == b->count ? a->count : UINT64_MAX;
    else a->count = pl_add_saturating(a->count, b->count);
}

/* A little wider than rounding of composing and mapping could make a box. */
static void widen(pl_box *box)
{
    double slack = 64.0 * DBL_EPSILON * pl_box_reach(box);
    if (pl_box_is_empty(box)) return;
    for (int axis = 0; axis < 3; axis++) {
        box->lo[axis] -= slack;
        box->hi[axis] += slack;
        if (isnan(box->lo[axis]) || isnan(box->hi[axis])) *box = pl_box_everything();
    }
}

/* A box turned again and again grows, though what is in it doesn't: so the distance from the frame's origin is followed as
 * well (reach.size), which turning leaves alone, and each bounds the other. */
static void tighten(pl_bounds *bounds)
{
    double square = 0.0, size = bounds->reach.size * (1.0 + 1e-12);
    pl_box *box = &bounds->box;
    if (pl_box_is_empty(box)) return;
    for (int axis = 0; axis < 3; axis++) {
        box->lo[axis] = fmax(box->lo[axis], -size);
        box->hi[axis] = fmin(box->hi[axis], size);
        double far = fmax(fabs(box->lo[axis]), fabs(box->hi[axis]));
        square += far * far;
    }
    bounds->reach.size = fmin(bounds->reach.size, sqrt(square) * (1.0 + 1e-12));
}

void pl_bounds_through(const pl_transform *transform, pl_bounds *bounds)
{
    double reach = pl_box_is_empty(&bounds->box) ? 0.0 : pl_box_reach(&bounds->box), move = 0.0;
    for (int r = 0; r < 3; r++) move = fmax(move, fabs(transform->to_parent.m[4 * r + 3]));
    bounds->reach = pl_reach_through(transform, &bounds->reach);
    if (!bounds->unbounded) bounds->box = pl_box_map(&transform->to_parent, &bounds->box);
    double slack = 16.0 * DBL_EPSILON * (reach * pl_largest_stretch(&transform->to_parent) + move);
    for (int axis = 0; axis < 3 && !pl_box_is_empty(&bounds->box); axis++) {
        bounds->box.lo[axis] -= slack;
        bounds->box.hi[axis] += slack;
    }
    widen(&bounds->box);
    if (!pl_box_is_empty(&bounds->box) && !pl_box_is_finite(&bounds->box)) bounds->unbounded = true;
    if (!bounds->unbounded) tighten(bounds);
}

static void through_range(const pl_range_map *map, pl_bounds *bounds)
{
    const double c = 2.0 * PL_REACH_ROUNDINGS, m = map->stretch, n = map->inverse_stretch;
    double tau = 0.0;
    pl_reach below = bounds->reach, *above = &bounds->reach;
    for (int r = 0; r < 3; r++) tau = hypot(tau, fmax(fabs(map->m[4 * r + 3].lo), fabs(map->m[4 * r + 3].hi)));
    above->size = m * below.size + tau;
    above->gain = m * n * (c + below.gain);
    above->base = m * n * (2.0 * c * (above->size + tau) + below.gain * tau) + m * below.base +
                  c * (2.0 * m * below.size + tau);
    if (isnan(above->gain)) above->gain = INFINITY;
    if (isnan(above->base)) above->base = INFINITY;
    if (isnan(above->size)) above->size = INFINITY;
    if (bounds->unbounded || pl_box_is_empty(&bounds->box)) return;
    pl_box box;
    for (int r = 0; r < 3; r++) {
        pl_range sum = map->m[4 * r + 3];
        for (int k = 0; k < 3; k++)
            sum = pl_range_add(sum, pl_range_multiply(map->m[4 * r + k], (pl_range){bounds->box.lo[k], bounds->box.hi[k]}));
        box.lo[r] = sum.lo;
        box.hi[r] = sum.hi;
    }
    bounds->box = box;
    widen(&bounds->box);
    if (!pl_box_is_finite(&bounds->box)) bounds->unbounded = true;
    else tighten(bounds);
}

/* --- following the graph --- */

static pl_bounds bound_class(pl_classes *c, uint32_t symbol, const pl_range *scope);
static pl_bounds bound_node(pl_classes *c, uint32_t node, pl_range *scope);

/* A subtree with its own copy of the scope. */
static pl_bounds bound_copy(pl_classes *c, uint32_t node, const pl_range *scope)
{
    size_t bytes = (c->program->parameter_count + 1) * sizeof(pl_range);
    pl_range *copy = malloc(bytes);
    if (!copy) return unknown();
    memcpy(copy, scope, bytes);
    pl_bounds bounds = bound_node(c, node, copy);
    free(copy);
    return bounds;
}

static pl_bounds bound_branch(pl_classes *c, const pl_node *it, pl_range *scope)
{
    if (!pl_range_run(c->program, it->as.branch.test, scope, &c->result)) return unknown();
    pl_range test = c->result.values[0];
    if (test.lo > 0.0 || test.hi < 0.0) return bound_node(c, it->as.branch.then, scope);
    if (test.lo == 0.0 && test.hi == 0.0) return bound_node(c, it->as.branch.otherwise, scope);
    pl_bounds then = bound_copy(c, it->as.branch.then, scope), otherwise = bound_copy(c, it->as.branch.otherwise, scope);
    join(&then, &otherwise, true);
    return then;
}

static pl_bounds bound_choose(pl_classes *c, const pl_node *it, pl_range *scope)
{
    pl_bounds all = nothing;
    bool first = true;
    for (uint32_t i = 0; i < it->as.choose.cases_count; i++) {
        const pl_case *one = &c->program->cases[it->as.choose.cases_first + i];
        if (!pl_range_run(c->program, one->weight, scope, &c->result)) return unknown();
        if (c->result.values[0].hi <= 0.0) continue;
        pl_bounds way = bound_copy(c, one->body, scope);
        if (first) all = way;
        else join(&all, &way, true);
        first = false;
    }
    return all;
}

/* A shape whose arguments aren't known exactly: radii of cones and tori lie between those at the ends. */
static pl_bounds bound_primitive(pl_classes *c, const pl_node *it, pl_range *scope)
{
    const pl_shape *shape = pl_shape_of(it->as.primitive.shape);
    double low[PL_SHAPE_ARGUMENTS] = {0}, high[PL_SHAPE_ARGUMENTS] = {0};
    pl_bounds bounds;
    pl_box box = pl_box_everything();
    if (!pl_range_run(c->program, it->as.primitive.code, scope, &c->result)) return unknown();
    if (shape->support) {
        for (uint32_t i = 0; i < c->result.count && i < PL_SHAPE_ARGUMENTS; i++) {
            low[i] = c->result.values[i].lo;
            high[i] = c->result.values[i].hi;
        }
        box = pl_shape_box(shape, low, NULL);
        pl_box other = pl_shape_box(shape, high, NULL);
        pl_box_join(&box, &other);
        widen(&box);
    }
    pl_bounds_of_leaf(&box, !shape->support, &bounds);
    return bounds;
}

static pl_bounds bound_one(pl_classes *c, uint32_t node, pl_range *scope)
{
    const pl_node *it = &c->program->nodes[node];
    pl_bounds bounds = nothing;
    pl_range_map map;
    switch (it->kind) {
    case PL_NODE_EMPTY: return bounds;
    case PL_NODE_SYMBOL: return bound_node(c, it->as.symbol.body, scope);
    case PL_NODE_RULE: return bound_node(c, it->as.rule.body, scope);
    case PL_NODE_BRANCH: return bound_branch(c, it, scope);
    case PL_NODE_CHOOSE: return bound_choose(c, it, scope);
    case PL_NODE_CALCULATE:
        if (!pl_range_run(c->program, it->as.calculate.code, scope, &c->result)) return unknown();
        return bound_node(c, it->as.calculate.child, scope);
    case PL_NODE_TRANSFORM:
        if (c->program->transforms[it->as.transform.matrix].singular) return bounds;
        bounds = bound_node(c, it->as.transform.child, scope);
        pl_bounds_through(&c->program->transforms[it->as.transform.matrix], &bounds);
        return bounds;
    case PL_NODE_TRANSFORM_CODE:
        if (!pl_range_run(c->program, it->as.transform_code.code, scope, &c->result)) return unknown();
        map = c->result.map;
        bounds = bound_node(c, it->as.transform_code.child, scope);
        through_range(&map, &bounds);
        if (!(map.inverse_stretch < INFINITY)) bounds.count = UINT64_MAX; /* may be singular and dropped */
        return bounds;
    case PL_NODE_TEXTURE: return bound_node(c, it->as.texture.child, scope);
    case PL_NODE_UNION:
        for (uint32_t i = 0; i < it->as.union_.children_count; i++) {
            pl_bounds term = bound_copy(c, c->program->children[it->as.union_.children_first + i], scope);
            join(&bounds, &term, false);
        }
        return bounds;
    case PL_NODE_ENTER: return bound_class(c, it->as.enter.symbol, scope);
    case PL_NODE_PRIMITIVE: return bound_primitive(c, it, scope);
    case PL_NODE_MESH: pl_bounds_of_leaf(pl_mesh_box(c->meshes[it->as.mesh.mesh]), false, &bounds); return bounds;
    case PL_NODE_OBJECT: return unknown();
    default: return bound_node(c, it->as.no_shadow.child, scope);
    }
}

static pl_bounds bound_node(pl_classes *c, uint32_t node, pl_range *scope)
{
    if (c->nodes >= DEEPEST_NODE) return unknown();
    c->nodes++;
    pl_bounds bounds = bound_one(c, node, scope);
    c->nodes--;
    return bounds;
}

/* --- classes --- */

/* Outward to a grid of 2^GRID_BITS steps an octave; whole numbers that are known stay. */
static pl_range on_grid(pl_range a)
{
    if (isnan(a.lo) || !isfinite(a.lo) || !isfinite(a.hi)) return a;
    if (a.lo == a.hi && a.lo == floor(a.lo) && fabs(a.lo) < 0x1p20) return a;
    int exponent;
    frexp(fmax(fabs(a.lo), fabs(a.hi)), &exponent);
    double step = ldexp(1.0, exponent - GRID_BITS);
    return (pl_range){floor(a.lo / step) * step, ceil(a.hi / step) * step};
}

static entry *find(pl_classes *c, uint32_t symbol, const pl_range *live, uint32_t count, uint64_t hash)
{
    for (entry *e = c->buckets[hash & (c->bucket_count - 1)]; e; e = e->next)
        if (e->hash == hash && e->symbol == symbol && memcmp(e->live, live, count * sizeof *live) == 0) return e;
    return NULL;
}

/* Adds a class that is being computed; NULL: no memory. */
static entry *add(pl_classes *c, uint32_t symbol, const pl_range *live, uint32_t count, uint64_t hash)
{
    size_t bytes = sizeof(entry) + count * sizeof *live;
    entry *e = malloc(bytes);
    if (!e) return NULL;
    entry **bucket = &c->buckets[hash & (c->bucket_count - 1)];
    *e = (entry){.next = *bucket, .hash = hash, .symbol = symbol, .busy = true};
    memcpy(e->live, live, count * sizeof *live);
    *bucket = e;
    c->bytes += bytes + 16;
    c->count++;
    return e;
}

static pl_bounds bound_class(pl_classes *c, uint32_t symbol, const pl_range *scope)
{
    const pl_node *node = &c->program->nodes[symbol];
    const uint32_t count = node->as.symbol.live_count;
    size_t bytes = (c->program->parameter_count + 1) * sizeof(pl_range);
    pl_range *inner = malloc(bytes), *live = malloc((count + 1) * sizeof *live);
    pl_bounds bounds = unknown();
    if (!inner || !live || c->symbols >= DEEPEST_SYMBOL) goto done;
    /* What isn't live can't matter: it is left unassigned, as it would be in any other instance. */
    for (uint32_t i = 0; i < c->program->parameter_count; i++) inner[i] = (pl_range){-INFINITY, INFINITY};
    uint64_t hash = symbol;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t slot = c->program->slots[node->as.symbol.live_first + i];
        live[i] = on_grid(scope[slot]);
        if (isnan(live[i].lo)) live[i] = (pl_range){NAN, NAN};
        live[i].lo += 0.0; /* one zero */
        live[i].hi += 0.0;
        inner[slot] = live[i];
        hash = pl_mix(pl_mix(hash, pl_bits(live[i].lo)), pl_bits(live[i].hi));
    }
    entry *e = find(c, symbol, live, count, hash);
    if (e) {
        if (!e->busy) bounds = e->bounds;
        goto done;
    }
    if (!(e = add(c, symbol, live, count, hash))) goto done;
    c->symbols++;
    bounds = bound_node(c, symbol, inner);
    c->symbols--;
    e->bounds = bounds;
    e->busy = false;
done:
    free(inner);
    free(live);
    return bounds;
}

void pl_classes_bound(pl_classes *c, uint32_t symbol, const pl_scope *scope, pl_bounds *bounds)
{
    pthread_mutex_lock(&c->lock);
    if (c->bytes > c->limit) {
        empty(c);
        c->emptied++;
    }
    for (uint32_t i = 0; i < c->program->parameter_count; i++) c->scope[i] = pl_range_of(scope->parameters[i]);
    c->symbols = c->nodes = 0;
    *bounds = bound_class(c, symbol, c->scope);
    pthread_mutex_unlock(&c->lock);
}
