/* class_cover.c - how much of its box's silhouette a state covers that isn't unfolded (class.h, cut.h).
 *
 * The coverage is that of representatives: states in the middle of a coarse class, with a few random keys. Rays are sent through
 * a representative's box as coverage.c does it, down the derivation to instances of an eighth of its size. What those cover
 * isn't looked up but taken to be what the whole covers, as plants repeat themselves in their branches: a ray that
 * meets k of them is let through with (1 - c)^k, and c is the fixpoint. So a coverage is a pure function of the coarse class. */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "class.h"
#include "coverage.h"
#include "error.h"
#include "random.h"

enum { KEYS = 3, SIDE = 4, RAYS = KEYS * SIDE * SIDE, MOST_EVENTS = 1024, ROUNDS = 24, KNOWN = 512 };

#define TURN 0.5
#define PARTS 0.125

typedef struct cover {
    uint64_t low, high; /* of its class's hash */
    float share[PL_COVERAGE_DIRECTIONS]; /* NaN: not measured yet */
} cover;

struct pl_covers {
    const pl_program *program;
    pl_mesh_tree *const *meshes;
    pl_classes *classes;
    pthread_mutex_t lock;
    pl_walk walk;
    pl_scope scope;
    pl_range *ranges, *live;
    cover known[KNOWN]; /* a place for each hash; another class takes it over */
};

pl_covers *pl_covers_create(const pl_program *program, pl_mesh_tree *const *meshes, pl_classes *classes, pl_error *error)
{
    pl_covers *c = calloc(1, sizeof *c);
    if (c) {
        c->program = program;
        c->meshes = meshes;
        c->classes = classes;
        pthread_mutex_init(&c->lock, NULL);
        c->scope.parameters = malloc((program->parameter_count + 1) * sizeof(double));
        c->ranges = malloc((program->parameter_count + 1) * sizeof *c->ranges);
        c->live = malloc((program->parameter_count + 1) * sizeof *c->live);
    }
    if (c && c->scope.parameters && c->ranges && c->live && pl_walk_begin(&c->walk, program, 0, NULL, error)) {
        c->walk.stretches = true;
        return c;
    }
    pl_covers_free(c);
    pl_fail_memory(error, "measuring coverages");
    return NULL;
}

void pl_covers_free(pl_covers *c)
{
    if (!c) return;
    pl_walk_end(&c->walk);
    pthread_mutex_destroy(&c->lock);
    free(c->scope.parameters);
    free(c->ranges);
    free(c->live);
    free(c);
}

/* --- a ray --- */

static bool is_met(const pl_gate_box *gate, const double o[3], const double d[3])
{
    const pl_span all = {-INFINITY, INFINITY}, span = pl_gate_span(gate, o, d, all);
    return span.enter <= span.leave;
}

/* At an instance: whether the ray goes on into it; small ones are counted in *met. */
static bool opens(pl_covers *c, double smallest, bool may_open, int *met)
{
    const pl_walk *walk = &c->walk;
    const double *o = walk->at.payload;
    pl_bounds bounds;
    uint64_t work = 0;
    pl_classes_bound(c->classes, c->program->nodes[walk->node].as.enter.symbol, &walk->scope, &bounds, &work);
    if (bounds.unbounded) return may_open;
    const pl_gate_box gate = pl_bounds_gate(&bounds);
    if (pl_box_is_empty(&bounds.box) || !is_met(&gate, o, o + 3)) return false;
    if (may_open && gate.diameter * walk->at.payload[6] > smallest) return true;
    ++*met;
    return false;
}

/* How many small instances a ray through the representative meets; -1: a primitive stands in its way. */
static int cast(pl_covers *c, uint32_t symbol, const double o[3], const double d[3], double smallest)
{
    pl_walk *walk = &c->walk;
    pl_root roots[PL_SHAPE_ROOTS];
    pl_error error = {.code = PL_OK};
    double *at = walk->at.payload, *along = at + 3;
    int met = 0;
    pl_walk_restart(walk, symbol, &c->scope);
    memcpy(at, o, 3 * sizeof *at);
    memcpy(along, d, 3 * sizeof *at);
    at[6] = 1.0;
    for (int events = 0; events < 4 * MOST_EVENTS; events++) {
        switch (pl_walk_next(walk, &error)) {
        case PL_EVENT_ERROR: return -1;
        case PL_EVENT_END: return met;
        case PL_EVENT_TRANSFORM:
            pl_affine_point(&walk->transform->to_object, at, at);
            pl_affine_vector(&walk->transform->to_object, along, along);
            at[6] *= walk->transform->stretch;
            break;
        case PL_EVENT_ENTER:
            if (!opens(c, smallest, events < MOST_EVENTS, &met)) pl_walk_prune(walk);
            break;
        case PL_EVENT_PRIMITIVE:
            if (pl_shape_of(walk->shape)->roots(walk->arguments, at, along, -INFINITY, INFINITY, roots)) return -1;
            break;
        case PL_EVENT_MESH:
            if (pl_mesh_nearest(c->meshes[walk->mesh], at, along, -INFINITY, INFINITY, roots)) return -1;
            break;
        default: break;
        }
    }
    return met;
}

/* --- a class --- */

/* Half of the box's width along a unit vector. */
static double half_width(const pl_box *box, const double a[3])
{
    double sum = 0.0;
    for (int axis = 0; axis < 3; axis++) sum += 0.5 * (box->hi[axis] - box->lo[axis]) * fabs(a[axis]);
    return sum;
}

/* The fixpoint of c = mean over rays of 1 - (1 - c)^met. */
static double fixpoint(const int *met, int count)
{
    double c = 0.5;
    for (int round = 0; round < ROUNDS && count; round++) {
        double covered = 0.0;
        for (int i = 0; i < count; i++) {
            double light = met[i] >= 0;
            for (int k = 0; k < met[i]; k++) light *= 1.0 - c;
            covered += 1.0 - light;
        }
        c = covered / count;
    }
    return count ? c : 1.0;
}

static double measure(pl_covers *c, uint32_t symbol, int direction)
{
    double s[3], a[3], b[3];
    int met[RAYS], count = 0;
    pl_bounds bounds;
    uint64_t work = 0;
    pl_coverage_frame(direction, s, a, b);
    for (int k = 0; k < KEYS; k++) {
        c->scope.key = pl_mix(symbol, (uint64_t)k);
        pl_classes_bound(c->classes, symbol, &c->scope, &bounds, &work);
        if (bounds.unbounded || pl_box_is_empty(&bounds.box)) return 1.0;
        const pl_gate_box gate = pl_bounds_gate(&bounds);
        const double wide = half_width(&bounds.box, a), high = half_width(&bounds.box, b);
        for (int i = 0; i < SIDE * SIDE; i++) {
            double u[4], o[3], d[3];
            for (int n = 0; n < 4; n++) u[n] = pl_unit(pl_mix(pl_mix(c->scope.key, (uint64_t)(16 * direction + n)), (uint64_t)i));
            const double x = wide * (2.0 * (i % SIDE + u[0]) / SIDE - 1.0), y = high * (2.0 * (i / SIDE + u[1]) / SIDE - 1.0);
            for (int axis = 0; axis < 3; axis++) {
                o[axis] = 0.5 * (bounds.box.lo[axis] + bounds.box.hi[axis]) + x * a[axis] + y * b[axis];
                d[axis] = s[axis] + TURN * ((u[2] - 0.5) * a[axis] + (u[3] - 0.5) * b[axis]);
            }
            if (!is_met(&gate, o, d)) continue;
            met[count++] = cast(c, symbol, o, d, PARTS * gate.diameter);
        }
    }
    return fixpoint(met, count);
}

/* The middle of a state's coarse class. */
static void take_middle(pl_covers *c, uint32_t symbol)
{
    const pl_node *node = &c->program->nodes[symbol];
    for (uint32_t i = 0; i < c->program->parameter_count; i++) c->scope.parameters[i] = NAN;
    for (uint32_t i = 0; i < node->as.symbol.live_count; i++)
        c->scope.parameters[c->program->slots[node->as.symbol.live_first + i]] = 0.5 * (c->live[i].lo + c->live[i].hi);
    c->scope.symbol = UINT32_MAX;
    c->scope.draws = 0;
}

double pl_covers_of(pl_covers *c, uint32_t symbol, const pl_scope *scope, const double d[3])
{
    const int direction = pl_coverage_direction(d);
    pthread_mutex_lock(&c->lock);
    for (uint32_t i = 0; i < c->program->parameter_count; i++) c->ranges[i] = pl_range_of(scope->parameters[i]);
    pl_class_of(c->program, symbol, c->ranges, PL_GRID_COVER, c->live);
    uint64_t low = pl_mix(1, symbol), high = pl_mix(2, symbol);
    for (uint32_t i = 0; i < c->program->nodes[symbol].as.symbol.live_count; i++) {
        low = pl_mix(pl_mix(low, pl_bits(c->live[i].lo)), pl_bits(c->live[i].hi));
        high = pl_mix(pl_mix(high, pl_bits(c->live[i].lo)), pl_bits(c->live[i].hi));
    }
    cover *known = &c->known[low % KNOWN];
    if (known->low != low || known->high != high) {
        known->low = low;
        known->high = high;
        for (int i = 0; i < PL_COVERAGE_DIRECTIONS; i++) known->share[i] = NAN;
    }
    if (isnan(known->share[direction])) {
        take_middle(c, symbol);
        known->share[direction] = (float)measure(c, symbol, direction);
    }
    double share = known->share[direction];
    pthread_mutex_unlock(&c->lock);
    return share;
}
