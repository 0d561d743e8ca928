/* coverage_rays.c - the parts of a state, and which rays meet them (coverage_rays.h). */
#include "coverage_rays.h"

#include <stdlib.h>
#include <string.h>

#include "random.h"

enum {
    MOST_PARTS = 1024,
    /* Parts times bundles, about each direction: shared by all states, but so many for one of them. */
    WORK = 1 << 16,
    LEAST_WORK = 512,
    MOST_WORK = 4096
};

#define TURN 0.5    /* widths of the square of directions about each of the thirteen */
#define PARTS 0.125 /* of the diameter: instances so small aren't opened */

/* Signs of the thirteen directions. */
static const signed char directions[PL_COVERAGE_DIRECTIONS][3] = {
    {1, 0, 0}, {0, 1, 0},  {0, 0, 1}, {1, 1, 0},  {1, -1, 0},  {1, 0, 1},  {1, 0, -1},
    {0, 1, 1}, {0, 1, -1}, {1, 1, 1}, {1, 1, -1}, {1, -1, 1}, {-1, 1, 1}};

/* The nearest of the directions: along the largest of |d|, its two largest or all three. */
int pl_coverage_direction(const double d[3])
{
    const double x = fabs(d[0]), y = fabs(d[1]), z = fabs(d[2]);
    const int least = x <= y && x <= z ? 0 : y <= z ? 1 : 2, most = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
    const double sum = x + y + z, two = (sum - fabs(d[least])) * 0.70710678118654752, three = sum * 0.57735026918962576;
    const bool nx = d[0] < 0.0, ny = d[1] < 0.0, nz = d[2] < 0.0;
    if (fabs(d[most]) >= two && fabs(d[most]) >= three) return most;
    if (two >= three) return least == 2 ? 3 + (nx != ny) : least == 1 ? 5 + (nx != nz) : 7 + (ny != nz);
    return nx == ny ? (nx == nz ? 9 : 10) : nx == nz ? 11 : 12;
}

/* --- parts --- */

typedef struct part {
    const pl_item *item; /* NULL: the state itself, as the first of the queue */
    pl_affine to_parent, to_object;
    double stretch;
    double centre[3], half[3][3]; /* of a box that holds it: half its edges, in the state's frame */
} part;

typedef struct parts {
    part *list; /* a queue: those before `head` were opened */
    size_t head, count, capacity;
} parts;

static void set_box(const pl_states *states, part *p)
{
    const pl_item *item = p->item;
    pl_box box;
    memset(p->half, 0, sizeof p->half);
    if (item->kind == PL_NODE_ENTER) {
        const pl_box *own = &states->list[item->what].bounds->box;
        double middle[3];
        for (int k = 0; k < 3; k++) {
            middle[k] = 0.5 * (own->lo[k] + own->hi[k]);
            for (int axis = 0; axis < 3; axis++)
                p->half[k][axis] = 0.5 * (own->hi[k] - own->lo[k]) * p->to_parent.m[4 * axis + k];
        }
        pl_affine_point(&p->to_parent, middle, p->centre);
        return;
    }
    if (item->kind == PL_NODE_MESH) box = pl_box_map(&p->to_parent, pl_mesh_box(states->meshes[item->what]));
    else box = pl_shape_box(pl_shape_of(item->what), item->arguments, p->to_parent.m);
    for (int axis = 0; axis < 3; axis++) {
        p->centre[axis] = 0.5 * (box.lo[axis] + box.hi[axis]);
        p->half[axis][axis] = 0.5 * (box.hi[axis] - box.lo[axis]);
    }
}

static bool add_part(const pl_states *states, parts *all, const part *parent, const pl_item *item)
{
    if (pl_item_primitives(states, item) == 0 || pl_item_unbounded(states, item)) return true;
    if (item->kind == PL_NODE_ENTER && pl_box_is_empty(&states->list[item->what].bounds->box)) return true;
    if (all->count == all->capacity) {
        size_t capacity = all->capacity ? 2 * all->capacity : 256;
        part *list = realloc(all->list, capacity * sizeof *list);
        if (!list) return false;
        all->list = list;
        all->capacity = capacity;
    }
    part *p = &all->list[all->count++];
    *p = *parent;
    p->item = item;
    for (uint32_t i = 0; i < item->transform_count; i++) {
        p->to_parent = pl_affine_multiply(&p->to_parent, &item->transforms[i]->to_parent);
        p->to_object = pl_affine_multiply(&item->transforms[i]->to_object, &p->to_object);
        p->stretch *= item->transforms[i]->stretch;
    }
    set_box(states, p);
    return true;
}

/* The parts of a state, those of no matter what size if there are too many: breadth first, so that all are opened alike. */
static bool find_parts(const pl_states *states, uint32_t state, parts *all)
{
    const double smallest = PARTS * states->list[state].bounds->diameter;
    const part whole = {.to_parent = pl_affine_identity(), .to_object = pl_affine_identity(), .stretch = 1.0};
    *all = (parts){0};
    for (uint32_t i = 0; i < states->list[state].item_count; i++)
        if (!add_part(states, all, &whole, &states->list[state].items[i])) return false;
    size_t kept = 0;
    while (all->head < all->count) {
        const part p = all->list[all->head++];
        const pl_state *below = p.item->kind == PL_NODE_ENTER ? &states->list[p.item->what] : NULL;
        if (!below || below->bounds->diameter * p.stretch <= smallest || all->count - all->head + kept >= MOST_PARTS) {
            all->list[kept++] = p;
            continue;
        }
        for (uint32_t i = 0; i < below->item_count; i++)
            if (!add_part(states, all, &p, &below->items[i])) return false;
    }
    all->count = kept;
    return true;
}

/* --- rays --- */

/* Parallel rays: ray i starts at origins[i], on the plane through the box's middle. */
typedef struct bundle {
    double d[3];
    double across[3], up[3]; /* of a point, moved along d onto the plane: its place there, in strata, from the middle */
    double origins[3][PL_BUNDLE_RAYS], enter[PL_BUNDLE_RAYS], leave[PL_BUNDLE_RAYS]; /* of the box */
} bundle;

/* Unit vectors along a direction and across it. */
void pl_coverage_frame(int direction, double s[3], double a[3], double b[3])
{
    double square = 0.0, norm = 0.0;
    for (int axis = 0; axis < 3; axis++) s[axis] = directions[direction][axis], square += s[axis] * s[axis];
    for (int axis = 0; axis < 3; axis++) s[axis] /= sqrt(square);
    int least = fabs(s[0]) <= fabs(s[1]) && fabs(s[0]) <= fabs(s[2]) ? 0 : fabs(s[1]) <= fabs(s[2]) ? 1 : 2;
    for (int axis = 0; axis < 3; axis++) a[axis] = (axis == least) - s[least] * s[axis], norm += a[axis] * a[axis];
    for (int axis = 0; axis < 3; axis++) a[axis] /= sqrt(norm);
    for (int axis = 0; axis < 3; axis++)
        b[axis] = s[(axis + 1) % 3] * a[(axis + 2) % 3] - s[(axis + 2) % 3] * a[(axis + 1) % 3];
}

/* Half of the box's width along a unit vector; not 0. */
static double half_width(const pl_box *box, const double a[3])
{
    double sum = 0.0;
    for (int axis = 0; axis < 3; axis++) sum += 0.5 * (box->hi[axis] - box->lo[axis]) * fabs(a[axis]);
    return sum > 1e-300 ? sum : 1e-300;
}

static void reciprocals(const double d[3], double by[3])
{
    for (int axis = 0; axis < 3; axis++) by[axis] = 1.0 / d[axis];
}

/* Narrows [enter, leave] by the slab of a box along an axis; by: the reciprocal of the direction there. */
static inline void clip(double lo, double hi, double o, double by, double *enter, double *leave)
{
    const double a = (lo - o) * by, b = (hi - o) * by;
    const double near_t = a < b ? a : b, far_t = a < b ? b : a;
    *enter = near_t > *enter ? near_t : *enter;
    *leave = far_t < *leave ? far_t : *leave;
}

/* The bits of a bundle's rays that meet the box. */
static uint64_t clip_bundle(const pl_box *box, bundle *rays)
{
    uint64_t met = 0;
    double by[3];
    reciprocals(rays->d, by);
    for (int i = 0; i < PL_BUNDLE_RAYS; i++) {
        rays->enter[i] = -INFINITY;
        rays->leave[i] = INFINITY;
    }
    for (int axis = 0; axis < 3; axis++)
        for (int i = 0; i < PL_BUNDLE_RAYS; i++)
            clip(box->lo[axis], box->hi[axis], rays->origins[axis][i], by[axis], &rays->enter[i], &rays->leave[i]);
    for (int i = 0; i < PL_BUNDLE_RAYS; i++) met |= (uint64_t)(rays->enter[i] <= rays->leave[i]) << i;
    return met;
}

/* The bits of its rays that meet the box. */
static uint64_t make_bundle(const pl_states *states, uint32_t state, int index, int bundles, bundle *made)
{
    const pl_box *box = &states->list[state].bounds->box;
    const int direction = index / (bundles * bundles), at = index % (bundles * bundles);
    const uint64_t key = pl_mix(state, (uint64_t)index);
    double s[3], a[3], b[3], x[PL_BUNDLE_RAYS], y[PL_BUNDLE_RAYS];
    pl_coverage_frame(direction, s, a, b);
    const double p = TURN * ((at % bundles + pl_unit(pl_mix(key, 2 * PL_BUNDLE_RAYS))) / bundles - 0.5);
    const double q = TURN * (((double)(at / bundles) + pl_unit(pl_mix(key, 2 * PL_BUNDLE_RAYS + 1))) / bundles - 0.5);
    const double wide = half_width(box, a), high = half_width(box, b);
    for (int i = 0; i < PL_BUNDLE_RAYS; i++) {
        x[i] = wide * (2.0 * (i % PL_BUNDLE_SIDE + pl_unit(pl_mix(key, 2 * (uint64_t)i))) / PL_BUNDLE_SIDE - 1.0);
        y[i] = high * (2.0 * ((double)(i / PL_BUNDLE_SIDE) + pl_unit(pl_mix(key, 2 * (uint64_t)i + 1))) / PL_BUNDLE_SIDE - 1.0);
    }
    for (int axis = 0; axis < 3; axis++) {
        made->d[axis] = s[axis] + p * a[axis] + q * b[axis];
        made->across[axis] = (a[axis] - p * s[axis]) * (0.5 * PL_BUNDLE_SIDE / wide);
        made->up[axis] = (b[axis] - q * s[axis]) * (0.5 * PL_BUNDLE_SIDE / high);
        for (int i = 0; i < PL_BUNDLE_RAYS; i++)
            made->origins[axis][i] = 0.5 * (box->lo[axis] + box->hi[axis]) + x[i] * a[axis] + y[i] * b[axis];
    }
    return clip_bundle(box, made);
}

/* The strata that a part's projection touches, along one of the sides. */
static void touched(const double middle[3], const part *p, const double along[3], int *first, int *last)
{
    double at = 0.5 * PL_BUNDLE_SIDE, half = 0.0;
    for (int axis = 0; axis < 3; axis++) at += (p->centre[axis] - middle[axis]) * along[axis];
    for (int k = 0; k < 3; k++)
        half += fabs(p->half[k][0] * along[0] + p->half[k][1] * along[1] + p->half[k][2] * along[2]);
    const double lo = floor(at - half), hi = floor(at + half);
    *first = lo > 0.0 ? lo < PL_BUNDLE_SIDE ? (int)lo : PL_BUNDLE_SIDE : 0;
    *last = hi < PL_BUNDLE_SIDE - 1 ? hi >= 0.0 ? (int)hi : -1 : PL_BUNDLE_SIDE - 1;
}

/* A bundle's direction in a part's frame. */
typedef struct aim {
    const part *part;
    const pl_shape *shape; /* of a primitive */
    double d[3], by[3];
} aim;

static bool meets_part(const pl_states *states, const aim *a, const bundle *rays, int ray)
{
    const pl_item *item = a->part->item;
    const double o[3] = {rays->origins[0][ray], rays->origins[1][ray], rays->origins[2][ray]};
    pl_root roots[PL_SHAPE_ROOTS];
    double at[3];
    pl_affine_point(&a->part->to_object, o, at);
    if (a->shape) return a->shape->roots(item->arguments, at, a->d, -INFINITY, INFINITY, roots) > 0;
    if (item->kind == PL_NODE_MESH) return pl_mesh_nearest(states->meshes[item->what], at, a->d, -INFINITY, INFINITY, roots);
    const pl_box *box = &states->list[item->what].bounds->box;
    double enter = rays->enter[ray], leave = rays->leave[ray];
    for (int axis = 0; axis < 3; axis++) clip(box->lo[axis], box->hi[axis], at[axis], a->by[axis], &enter, &leave);
    return enter <= leave;
}

static bool add_meeting(pl_meetings *all, pl_meeting m)
{
    if (all->count == all->capacity) {
        size_t capacity = all->capacity ? 2 * all->capacity : 4096;
        pl_meeting *list = realloc(all->list, capacity * sizeof *list);
        if (!list) return false;
        all->list = list;
        all->capacity = capacity;
    }
    all->list[all->count++] = m;
    return true;
}

/* Sends a bundle of rays through the parts. */
static bool send(const pl_states *states, const double middle[3], const parts *all, const bundle *rays, uint16_t index,
                 pl_meetings *found)
{
    uint64_t open = found->counted[index]; /* rays that meet the box and no primitive so far */
    for (size_t i = 0; i < all->count && open; i++) {
        const part *p = &all->list[i];
        int left, right, low, high;
        touched(middle, p, rays->across, &left, &right);
        touched(middle, p, rays->up, &low, &high);
        if (left > right || low > high) continue;
        aim a = {.part = p, .shape = p->item->kind == PL_NODE_PRIMITIVE ? pl_shape_of(p->item->what) : NULL};
        pl_affine_vector(&p->to_object, rays->d, a.d);
        reciprocals(a.d, a.by);
        const bool enters = p->item->kind == PL_NODE_ENTER;
        pl_meeting m = {enters ? p->item->what : 0, index, 0, (uint8_t)pl_coverage_direction(a.d)};
        for (int y = low; y <= high; y++)
            for (int x = left; x <= right; x++) {
                const int ray = y * PL_BUNDLE_SIDE + x;
                if (!(open >> ray & 1) || !meets_part(states, &a, rays, ray)) continue;
                m.ray = (uint8_t)ray;
                if (!enters) open &= ~(UINT64_C(1) << ray);
                if (!add_meeting(found, m)) return false;
            }
    }
    return true;
}

bool pl_meetings_find(const pl_states *states, uint32_t state, pl_meetings *found)
{
    const pl_box *box = &states->list[state].bounds->box;
    const double middle[3] = {0.5 * (box->lo[0] + box->hi[0]), 0.5 * (box->lo[1] + box->hi[1]),
                              0.5 * (box->lo[2] + box->hi[2])};
    parts all;
    *found = (pl_meetings){0};
    bool ok = find_parts(states, state, &all);
    const size_t share = WORK / states->count, work = share < LEAST_WORK ? LEAST_WORK : share > MOST_WORK ? MOST_WORK : share;
    found->bundles = PL_FEWEST_BUNDLES;
    while (found->bundles < PL_MOST_BUNDLES && (found->bundles + 1u) * (found->bundles + 1u) * all.count <= work) found->bundles++;
    for (uint16_t i = 0; ok && i < PL_COVERAGE_DIRECTIONS * found->bundles * found->bundles; i++) {
        bundle rays;
        found->counted[i] = make_bundle(states, state, i, found->bundles, &rays);
        ok = send(states, middle, &all, &rays, i, found);
    }
    free(all.list);
    return ok;
}
