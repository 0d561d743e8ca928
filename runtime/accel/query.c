/* query.c - the one place where a leaf is intersected and candidates are compared (accel.h). */
#include "query.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../coverage.h"
#include "../error.h"

bool pl_query_fail_steps(const pl_query *query, uint64_t limit)
{
    return pl_fail(query->error, PL_ERROR_LIMIT, "ray",
                   "work: one ray took more than %llu steps; do very many equal things lie in the same place?",
                   (unsigned long long)limit);
}

bool pl_items_path(const pl_items *items, pl_path *path)
{
    uint32_t length = 0;
    for (size_t i = 0; i < items->count; i++) {
        const pl_site *site = items->list[i]->site;
        for (uint32_t k = 0; k < site->term_count; k++)
            if (!pl_path_push(path, length++, site->terms[k])) return false;
    }
    path->length = length;
    return true;
}

static bool trail_path(const pl_query *query, const pl_path *trail, pl_path *path)
{
    const pl_scene *scene = query->tracer->scene;
    pl_items *items = &query->tracer->items;
    if (!scene->accel->items(scene, trail, items)) return false;
    return items->count ? pl_items_path(items, path) : scene->accel->path(scene, trail, path);
}

/* A leaf's path in union terms; where it has a trail, that too. */
static bool leaf_path(const pl_query *query, const pl_leaf *leaf, pl_path *trail, pl_path *path)
{
    if (leaf->path) return leaf->path(leaf->source, path);
    return leaf->trail(leaf->source, trail) && trail_path(query, trail, path);
}

/* Whether a leaf at the same t comes before the hit in path order; -1: no memory. */
static int comes_before(pl_query *query, const pl_leaf *leaf)
{
    pl_hit *hit = query->hit;
    if (leaf->trail && !trail_path(query, &hit->trail, &hit->path)) return -1;
    if (!leaf_path(query, leaf, &query->tracer->spare, &query->tracer->scratch)) return -1;
    return pl_path_compare(&query->tracer->scratch, &hit->path) < 0;
}

static void set_hit(pl_hit *hit, const pl_leaf *leaf, const pl_root *root)
{
    hit->t = root->t;
    hit->primitive = leaf->primitive;
    hit->part = root->part;
    for (int axis = 0; axis < 3; axis++) hit->local[axis] = leaf->o[axis] + root->t * leaf->d[axis];
    hit->cut_depth = leaf->cut_depth;
    hit->bound = leaf->cut_depth ? leaf->bound : NAN;
}

/* nextafter(t, INFINITY), a call less where t is an ordinary number. */
static inline double just_beyond(double t)
{
    uint64_t bits;
    if (!(t > 0.0 && t < INFINITY)) return nextafter(t, INFINITY);
    memcpy(&bits, &t, sizeof bits);
    bits++;
    memcpy(&t, &bits, sizeof t);
    return t;
}

static bool keep_nearest(pl_query *query, const pl_leaf *leaf, const pl_root *root)
{
    pl_hit *hit = query->hit;
    if (root->t == hit->t) {
        int before = comes_before(query, leaf);
        if (before < 0) return pl_fail_memory(query->error, "tracing a ray");
        if (!before) return true;
    }
    if (!(leaf->trail ? leaf->trail(leaf->source, &hit->trail) : leaf->path(leaf->source, &hit->path)))
        return pl_fail_memory(query->error, "tracing a ray");
    set_hit(hit, leaf, root);
    /* Just beyond, so that others at the same t are still compared; never beyond what was asked for. */
    double beyond = just_beyond(root->t);
    if (beyond < query->t_max) query->t_max = beyond;
    return true;
}

static bool keep_listed(pl_query *query, const pl_leaf *leaf, const pl_root *root)
{
    pl_hit_list *list = query->tracer->list;
    if (list->count == list->capacity) {
        size_t capacity = list->capacity ? 2 * list->capacity : 16;
        pl_hit *hits = realloc(list->hits, capacity * sizeof *hits);
        if (!hits) return pl_fail_memory(query->error, "tracing a ray");
        for (size_t i = list->capacity; i < capacity; i++) pl_hit_init(&hits[i]);
        list->hits = hits;
        list->capacity = capacity;
    }
    pl_hit *hit = &list->hits[list->count];
    if (!leaf_path(query, leaf, &hit->trail, &hit->path)) return pl_fail_memory(query->error, "tracing a ray");
    set_hit(hit, leaf, root);
    list->count++;
    return true;
}

/* Whether a leaf is the primitive that the ray leaves: without cut-offs each has one trail. -1: no memory. */
static int is_left(pl_query *query, const pl_leaf *leaf)
{
    const pl_hit *hit = query->leaves;
    pl_path *place = &query->tracer->scratch;
    if (!hit) return false;
    if (!(leaf->trail ? leaf->trail(leaf->source, place) : leaf->path(leaf->source, place))) return -1;
    return pl_path_compare(place, leaf->trail ? &hit->trail : &hit->path) == 0;
}

/* One is enough: what goes together with others' rays needn't go on. */
static bool keep_any(pl_query *query, const pl_leaf *leaf)
{
    const int left = is_left(query, leaf);
    if (left < 0) return pl_fail_memory(query->error, "tracing a ray");
    if (left) return true;
    query->found = query->done = true;
    query->t_max = query->t_min;
    return true;
}

static bool keep(pl_query *query, const pl_leaf *leaf, const pl_root *root)
{
    if (query->kind == PL_QUERY_ANY) return keep_any(query, leaf);
    query->found = true;
    return query->kind == PL_QUERY_NEAREST ? keep_nearest(query, leaf, root) : keep_listed(query, leaf, root);
}

typedef struct mesh_visit {
    pl_query *query;
    const pl_leaf *leaf;
    bool ok;
} mesh_visit;

static bool keep_mesh_root(void *context, pl_root root)
{
    mesh_visit *v = context;
    v->ok = keep(v->query, v->leaf, &root);
    return v->ok;
}

bool pl_query_leaf(pl_query *query, const pl_leaf *leaf)
{
    const double *o = leaf->o, *d = leaf->d;
    pl_root roots[PL_SHAPE_ROOTS];
    if (leaf->mesh && query->kind == PL_QUERY_ALL) {
        mesh_visit v = {query, leaf, true};
        pl_mesh_each(leaf->mesh, o, d, query->t_min, query->t_max, keep_mesh_root, &v);
        return v.ok;
    }
    if (leaf->mesh) {
        return !pl_mesh_nearest(leaf->mesh, o, d, query->t_min, query->t_max, roots) || keep(query, leaf, roots);
    }
    int count = pl_shape_of(leaf->shape)->roots(leaf->arguments, o, d, query->t_min, query->t_max, roots);
    if (query->kind != PL_QUERY_ALL && count > 1) count = 1;
    for (int i = 0; i < count; i++)
        if (!keep(query, leaf, &roots[i])) return false;
    return true;
}

static bool keep_cut(pl_query *query, double diameter, const pl_arrival *at, double t_entry, const pl_leaf *leaf)
{
    pl_leaf cut = *leaf;
    cut.o = at->o;
    cut.d = at->d;
    cut.cut_depth = at->depth;
    cut.bound = diameter * at->stretch / query->length;
    return keep(query, &cut, &(pl_root){t_entry, 0});
}

bool pl_query_cut(pl_query *query, const pl_states *states, const pl_arrival *at, uint64_t hash, double t_entry,
                  const pl_leaf *leaf)
{
    if (!(t_entry < query->t_max)) return true;
    const double share = pl_coverage_of(states, at->state, at->d);
    if (share < 0.0) return pl_fail_memory(query->error, "measuring coverages");
    if (!(pl_cut_chance(hash, at->depth, query->ray) < share)) return true;
    return keep_cut(query, states->list[at->state].bounds->diameter, at, t_entry, leaf);
}

bool pl_query_cut_box(pl_query *query, const pl_gate_box *box, double coverage, const pl_arrival *at, uint64_t hash,
                      double t_entry, const pl_leaf *leaf)
{
    if (!(t_entry < query->t_max) || !(pl_cut_chance(hash, at->depth, query->ray) < coverage)) return true;
    return keep_cut(query, box->diameter, at, t_entry, leaf);
}

/* (t, path), then the root's order on its leaf. */
static int compare_hits(const void *a, const void *b)
{
    const pl_hit *x = a, *y = b;
    if (x->t != y->t) return x->t < y->t ? -1 : 1;
    int order = pl_path_compare(&x->path, &y->path);
    return order ? order : (x->part > y->part) - (x->part < y->part);
}

void pl_hit_list_sort(pl_hit_list *list)
{
    if (list->count > 1) qsort(list->hits, list->count, sizeof *list->hits, compare_hits);
}

void pl_hit_list_free(pl_hit_list *list)
{
    if (!list) return;
    for (size_t i = 0; i < list->capacity; i++) pl_hit_free(&list->hits[i]);
    free(list->hits);
    free(list);
}
