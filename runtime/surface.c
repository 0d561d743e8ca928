/* surface.c - from a hit to what shading needs of it (trace.h, pl_trace_surface).
 *
 * Two ways to the same bits. A hit with a path is walked down once more, with all parameters. A hit with a trail knows
 * the items on its path, whose transformations and textures the states have kept; only textures with values computed
 * from parameters need the walk there too. A cut instance has the texture of the first primitive below it, which the
 * first walk to each state finds. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "accel/accel.h"
#include "error.h"
#include "vector.h"

/* How far below a cut instance its first primitive is looked for. */
enum { CUT_DEPTH = 64, CUT_STEPS = 4096 };

/* So many mild maps change a length by less than 2^±150. */
enum { MILD_MAPS = 36 };

/* What is known of the texture of the first primitive below a state; from FIRST_NODE on: its node, and it has neither
 * pattern nor code. */
enum { FIRST_UNKNOWN, FIRST_WALK, FIRST_NONE, FIRST_NODE };

/* What is needed of a leaf. */
typedef struct leaf_surface {
    const pl_shape *shape; /* NULL: a mesh */
    const pl_mesh_tree *mesh;
    bool smooth; /* its surface has a flat normal as well */
    const double *arguments;
    uint32_t symbol; /* node, UINT32_MAX: none */
    int32_t rule;
    uint32_t depth;
} leaf_surface;

static bool remember(pl_chain *chain, const pl_transform *transform, pl_error *error)
{
    if (chain->count == chain->capacity) {
        size_t capacity = chain->capacity ? 2 * chain->capacity : 32;
        pl_transform *list = realloc(chain->list, capacity * sizeof *list);
        if (!list) return pl_fail_memory(error, "shading a hit");
        chain->list = list;
        chain->capacity = capacity;
    }
    chain->list[chain->count++] = *transform;
    return true;
}

/* At a texture node: its values, with those that depend on parameters computed here, and the frame it stands in. */
static bool take_texture(pl_tracer *tracer, double t, pl_surface *surface, pl_error *error)
{
    const pl_program *program = tracer->scene->program;
    const pl_node *node = &program->nodes[tracer->walk.node];
    const pl_record *record = &program->records[node->as.texture.texture];
    const double *o = tracer->walk.at.payload, *d = o + 3;
    for (int axis = 0; axis < 3; axis++) surface->pattern_point[axis] = o[axis] + t * d[axis];
    surface->entries = record->entries;
    surface->texture = record->values;
    if (!node->as.texture.code) return true;
    memcpy(tracer->texture, record->values, record->size * sizeof *tracer->texture);
    surface->texture = tracer->texture;
    tracer->walk.result.texture = tracer->texture;
    return pl_run(program, tracer->walk.node, node->as.texture.code, &tracer->walk.scope, &tracer->walk.result, error);
}

/* A normal above a transformation: by the inverse transpose (paper, section 2: only the foremost hit's normal is
 * transformed back). */
static inline __attribute__((always_inline)) void turn_normal_back(const pl_transform *transform, double n[3])
{
    pl_affine room;
    const double *m = transform->to_object.m;
    switch ((pl_form)transform->form) {
    case PL_FORM_PACKED: pl_transform_unpack(transform, room.m); pl_affine_normal(&room, n, n); return;
    case PL_FORM_GENERAL: pl_affine_normal(&transform->to_object, n, n); return;
    case PL_FORM_DIAGONAL:
        for (int axis = 0; axis < 3; axis++) n[axis] *= m[5 * axis];
        return;
    case PL_FORM_TRANSLATION: return;
    }
}

static inline double size_of(const double n[3])
{
    return fabs(n[0]) + fabs(n[1]) + fabs(n[2]);
}

/* The same, its length kept in range, so that no scale however deep overflows. */
static inline void map_normal_back(const pl_transform *transform, double n[3])
{
    turn_normal_back(transform, n);
    const double size = size_of(n);
    if (size > 0x1p-200 && size < 0x1p200) return;
    for (int axis = 0; axis < 3; axis++) n[axis] /= size;
}

/* The same up a leg; the copy stays in registers. A mild leg leaves a length in range that is far from its ends. */
static void map_up_leg(const pl_leg *leg, double normal[3])
{
    double n[3] = {normal[0], normal[1], normal[2]};
    const double size = size_of(n);
    if (leg->mild && leg->map_count <= MILD_MAPS && size > 0x1p-50 && size < 0x1p50)
        for (uint32_t i = 0; i < leg->map_count; i++) turn_normal_back(leg->maps[i], n);
    else
        for (uint32_t i = 0; i < leg->map_count; i++) map_normal_back(leg->maps[i], n);
    memcpy(normal, n, sizeof n);
}

/* The same up all items. */
static void map_normal_up(const pl_items *items, double normal[3])
{
    double n[3] = {normal[0], normal[1], normal[2]};
    for (size_t i = items->count; i-- > 0;) {
        const pl_item *item = items->list[i];
        for (uint32_t k = item->transform_count; k-- > 0;) map_normal_back(item->transforms[k], n);
    }
    memcpy(normal, n, sizeof n);
}

/* Sets the normals in the leaf's own frame. */
static void begin_normals(leaf_surface *leaf, const pl_hit *hit, pl_surface *surface)
{
    leaf->smooth = leaf->mesh && pl_mesh_is_smooth(leaf->mesh);
    if (leaf->mesh) pl_mesh_normal(leaf->mesh, hit->part, hit->local, surface->normal);
    else leaf->shape->normal(leaf->arguments, hit->part, hit->local, surface->normal);
    if (leaf->smooth) pl_mesh_flat_normal(leaf->mesh, hit->part, surface->flat);
}

/* A normal that was nothing but rounding, as of a shape seen from 1e16 times its size, is turned against the ray. */
static void set_unit(double n[3], const double direction[3])
{
    if (pl_normalize(n) > 0.0) return;
    for (int axis = 0; axis < 3; axis++) n[axis] = -direction[axis];
    pl_normalize(n);
}

static void finish_surface(const pl_scene *scene, const leaf_surface *leaf, const pl_ray *ray, const pl_hit *hit,
                           pl_surface *surface)
{
    set_unit(surface->normal, ray->direction);
    if (leaf->smooth) set_unit(surface->flat, ray->direction);
    else memcpy(surface->flat, surface->normal, sizeof surface->flat);
    for (int axis = 0; axis < 3; axis++) surface->point[axis] = ray->origin[axis] + hit->t * ray->direction[axis];
    surface->symbol = leaf->symbol == UINT32_MAX ? -1 : (int32_t)scene->program->nodes[leaf->symbol].symbol;
    surface->rule = leaf->rule;
    surface->depth = (int32_t)leaf->depth;
    surface->convex = leaf->shape && leaf->shape->convex;
}

static void begin_surface(pl_tracer *tracer, const pl_ray *ray, const pl_hit *hit, pl_surface *surface)
{
    static const double plain[PL_TEXTURE_VALUES + PL_TEXTURE_ENTRY] = PL_TEXTURE_DEFAULTS;
    tracer->chain.count = 0;
    surface->texture = plain;
    surface->entries = 1;
    for (int axis = 0; axis < 3; axis++)
        surface->pattern_point[axis] = ray->origin[axis] + hit->t * ray->direction[axis];
}

/* What a texture node tells of all instances of a state. */
static uint32_t told_by(const pl_program *program, uint32_t node)
{
    const pl_node *texture = &program->nodes[node];
    const bool solid = program->records[texture->as.texture.texture].values[PL_TEXTURE_PATTERN] == PL_PATTERN_SOLID;
    return texture->as.texture.code || !solid ? FIRST_WALK : FIRST_NODE + node;
}

/* The texture of the first primitive below a cut instance, where there is one within reach: an endless recursion may have
 * none at all. The walk stands at the instance. Sets *told, which may be FIRST_WALK for good. */
static bool take_first_texture(pl_tracer *tracer, double t, pl_surface *surface, uint32_t *told, pl_error *error)
{
    pl_walk *walk = &tracer->walk;
    uint32_t first = FIRST_NONE;
    const double *texture = surface->texture;
    const uint32_t entries = surface->entries, deepest = walk->at.depth + CUT_DEPTH;
    double point[3], *o = walk->at.payload;
    memcpy(point, surface->pattern_point, sizeof point);
    walk->follow = NULL;
    for (int steps = 0; steps < CUT_STEPS && walk->at.depth < deepest; steps++) {
        switch (pl_walk_next(walk, error)) {
        case PL_EVENT_ERROR: return false;
        case PL_EVENT_PRIMITIVE:
        case PL_EVENT_MESH: *told = first; return true;
        case PL_EVENT_TRANSFORM: pl_map_ray(walk->transform, o, o + 3); break;
        case PL_EVENT_TEXTURE:
            if (!take_texture(tracer, t, surface, error)) return false;
            if (first != FIRST_WALK) first = told_by(walk->program, walk->node);
            break;
        case PL_EVENT_END: steps = CUT_STEPS; break;
        default: break;
        }
    }
    surface->texture = texture;
    surface->entries = entries;
    memcpy(surface->pattern_point, point, sizeof point);
    *told = first == FIRST_WALK ? FIRST_WALK : FIRST_NONE;
    return true;
}

/* A cut instance's box has no sides, so the normal is turned against the ray. symbol: its node. */
static void set_cut(const pl_scene *scene, const pl_ray *ray, const pl_hit *hit, uint32_t symbol, int32_t rule,
                    pl_surface *surface)
{
    double length = 0.0;
    for (int axis = 0; axis < 3; axis++) length += ray->direction[axis] * ray->direction[axis];
    for (int axis = 0; axis < 3; axis++) {
        surface->flat[axis] = surface->normal[axis] = -ray->direction[axis] / sqrt(length);
        surface->point[axis] = ray->origin[axis] + hit->t * ray->direction[axis];
    }
    surface->symbol = (int32_t)scene->program->nodes[symbol].symbol;
    surface->rule = rule;
    surface->depth = (int32_t)hit->cut_depth;
    surface->convex = false;
}

/* Where a cut instance's state keeps what was found below it. NULL: no memory. */
static uint32_t *place_of_told(pl_tracer *tracer, pl_error *error)
{
    const pl_items *items = &tracer->items;
    if (!tracer->first_textures)
        tracer->first_textures = calloc(tracer->scene->states.count, sizeof *tracer->first_textures);
    if (!tracer->first_textures) pl_fail_memory(error, "shading a hit");
    return tracer->first_textures ? &tracer->first_textures[items->list[items->count - 1]->what] : NULL;
}

/* By the path: the derivation once more, or as much of it as the accelerator can't skip. */
static bool walk_surface(pl_tracer *tracer, const pl_ray *ray, const pl_hit *hit, const pl_path *path, bool skips,
                         pl_surface *surface, pl_error *error)
{
    const pl_accel *accel = tracer->scene->accel;
    pl_walk *walk = &tracer->walk;
    double *o = walk->at.payload, *d = o + 3;
    pl_walk_restart(walk, 0, NULL);
    walk->follow = path;
    begin_surface(tracer, ray, hit, surface);
    memcpy(o, ray->origin, 3 * sizeof *o);
    memcpy(d, ray->direction, 3 * sizeof *d);
    leaf_surface leaf = {0};
    uint32_t unused, *told = &unused;
    for (bool found = false; !found;) {
        switch (pl_walk_next(walk, error)) {
        case PL_EVENT_ERROR: return false;
        case PL_EVENT_END: return pl_fail(error, PL_ERROR_ARGUMENT, "path", "the path doesn't exist in this scene");
        case PL_EVENT_TRANSFORM:
            pl_map_ray(walk->transform, o, d);
            if (!remember(&tracer->chain, walk->transform, error)) return false;
            break;
        case PL_EVENT_TEXTURE:
            if (!take_texture(tracer, hit->t, surface, error)) return false;
            break;
        case PL_EVENT_ENTER:
            if (hit->cut_depth && walk->at.terms == path->length && walk->at.depth + 1 == hit->cut_depth) {
                if (accel->items && !(told = place_of_told(tracer, error))) return false;
                set_cut(tracer->scene, ray, hit, walk->program->nodes[walk->node].as.enter.symbol, walk->at.rule, surface);
                return take_first_texture(tracer, hit->t, surface, told, error);
            }
            if (skips) accel->skip(tracer->scene, &hit->trail, walk);
            break;
        case PL_EVENT_PRIMITIVE:
            leaf.shape = pl_shape_of(walk->shape);
            leaf.arguments = walk->arguments;
            found = true;
            break;
        case PL_EVENT_MESH:
            leaf.mesh = tracer->scene->meshes[walk->mesh];
            found = true;
            break;
        default: break;
        }
    }
    leaf.symbol = walk->at.symbol;
    leaf.rule = walk->at.rule;
    leaf.depth = walk->at.depth;
    begin_normals(&leaf, hit, surface);
    for (size_t i = tracer->chain.count; i-- > 0;) {
        map_normal_back(&tracer->chain.list[i], surface->normal);
        if (leaf.smooth) map_normal_back(&tracer->chain.list[i], surface->flat);
    }
    finish_surface(tracer->scene, &leaf, ray, hit, surface);
    return true;
}

/* The texture that counts on a path of items: the innermost one. -1: none. */
static int64_t innermost_texture(const pl_items *items, bool *code)
{
    int64_t innermost = -1;
    *code = false;
    for (size_t i = 0; i < items->count; i++) {
        if (items->list[i]->site->texture >= 0) innermost = (int64_t)i;
        *code = *code || items->list[i]->site->texture_code;
    }
    return innermost;
}

/* The texture of a site, and whether it is all: it has neither pattern nor code. */
static bool take_plain_texture(const pl_scene *scene, const pl_site *site, pl_surface *surface)
{
    const pl_node *node = &scene->program->nodes[site->texture];
    const pl_record *record = &scene->program->records[node->as.texture.texture];
    surface->texture = record->values;
    surface->entries = record->entries;
    return record->values[PL_TEXTURE_PATTERN] == PL_PATTERN_SOLID;
}

/* The texture of item `textured`, and where it has a pattern the hit point in the frame where it stands. */
static void take_items_texture(const pl_scene *scene, const pl_ray *ray, const pl_hit *hit, const pl_items *items,
                               size_t textured, pl_surface *surface)
{
    double o[3], d[3];
    if (take_plain_texture(scene, items->list[textured]->site, surface)) return;
    memcpy(o, ray->origin, sizeof o);
    memcpy(d, ray->direction, sizeof d);
    for (size_t i = 0; i <= textured; i++) {
        const pl_item *item = items->list[i];
        uint32_t count = i == textured ? item->site->texture_transforms : item->transform_count;
        for (uint32_t k = 0; k < count; k++) pl_map_ray(item->transforms[k], o, d);
    }
    for (int axis = 0; axis < 3; axis++) surface->pattern_point[axis] = o[axis] + hit->t * d[axis];
}

static void set_leaf(const pl_scene *scene, const pl_item *last, leaf_surface *leaf)
{
    leaf->arguments = last->arguments;
    if (last->kind == PL_NODE_MESH) leaf->mesh = scene->meshes[last->what];
    else leaf->shape = pl_shape_of(last->what);
}

/* By the items on the path. */
static void items_surface(pl_tracer *tracer, const pl_ray *ray, const pl_hit *hit, const pl_items *items,
                          int64_t textured, pl_surface *surface)
{
    const pl_scene *scene = tracer->scene;
    leaf_surface leaf = {.symbol = UINT32_MAX, .rule = -1};
    set_leaf(scene, items->list[items->count - 1], &leaf);
    begin_surface(tracer, ray, hit, surface);
    begin_normals(&leaf, hit, surface);
    map_normal_up(items, surface->normal);
    if (leaf.smooth) map_normal_up(items, surface->flat);
    for (size_t i = items->count; i-- > 0;) {
        const pl_item *item = items->list[i];
        if (leaf.rule < 0) leaf.rule = item->site->rule;
        if (item->kind != PL_NODE_ENTER) continue;
        if (leaf.depth++ == 0) leaf.symbol = scene->states.list[item->what].symbol;
    }
    if (textured >= 0) take_items_texture(scene, ray, hit, items, (size_t)textured, surface);
    finish_surface(scene, &leaf, ray, hit, surface);
}

/* By the legs of the trail, from the leaf up. false: not all is known so. */
static bool legs_surface(pl_tracer *tracer, const pl_ray *ray, const pl_hit *hit, pl_surface *surface)
{
    enum { MOST = 16 };
    const pl_scene *scene = tracer->scene;
    const uint32_t count = hit->trail.length;
    const pl_site *texture = NULL;
    leaf_surface leaf = {.symbol = UINT32_MAX, .rule = -1};
    pl_leg legs[MOST];
    if (count > MOST || !scene->accel->legs(tracer, &hit->trail, legs)) return false;
    begin_surface(tracer, ray, hit, surface);
    set_leaf(scene, legs[count - 1].last, &leaf);
    begin_normals(&leaf, hit, surface);
    for (const pl_leg *leg = legs + count; leg-- > legs;) {
        map_up_leg(leg, surface->normal);
        if (leaf.smooth) map_up_leg(leg, surface->flat);
        if (leaf.rule < 0) leaf.rule = leg->rule;
        if (!leaf.depth && leg->entered) leaf.symbol = scene->states.list[leg->state].symbol;
        leaf.depth += leg->entered;
        if (!texture) texture = leg->texture;
    }
    finish_surface(scene, &leaf, ray, hit, surface);
    if (!texture || take_plain_texture(scene, texture, surface)) return true;
    bool code;
    if (!scene->accel->items(scene, &hit->trail, &tracer->items)) return false;
    take_items_texture(scene, ray, hit, &tracer->items, (size_t)innermost_texture(&tracer->items, &code), surface);
    return true;
}

/* A cut instance by the items on its path, `told` of its state. */
static void items_cut(pl_tracer *tracer, const pl_ray *ray, const pl_hit *hit, const pl_items *items, int64_t textured,
                      uint32_t told, pl_surface *surface)
{
    const pl_scene *scene = tracer->scene;
    const pl_program *program = scene->program;
    int32_t rule = -1;
    for (size_t i = items->count; i-- > 0 && rule < 0;) rule = items->list[i]->site->rule;
    begin_surface(tracer, ray, hit, surface);
    set_cut(scene, ray, hit, scene->states.list[items->list[items->count - 1]->what].symbol, rule, surface);
    if (told >= FIRST_NODE) {
        const pl_record *record = &program->records[program->nodes[told - FIRST_NODE].as.texture.texture];
        surface->texture = record->values;
        surface->entries = record->entries;
    } else if (textured >= 0) {
        take_items_texture(scene, ray, hit, items, (size_t)textured, surface);
    }
}

bool pl_trace_surface(pl_tracer *tracer, const pl_ray *ray, const pl_hit *hit, pl_surface *surface, pl_error *error)
{
    const pl_accel *accel = tracer->scene->accel;
    bool code;
    if (accel->legs && !hit->cut_depth && legs_surface(tracer, ray, hit, surface)) return true;
    if (!accel->items) return walk_surface(tracer, ray, hit, &hit->path, false, surface, error);
    if (!accel->items(tracer->scene, &hit->trail, &tracer->items)) return pl_fail_memory(error, "shading a hit");
    if (!tracer->items.count) {
        if (!accel->path(tracer->scene, &hit->trail, &tracer->scratch)) return pl_fail_memory(error, "shading a hit");
        return (accel->skip && walk_surface(tracer, ray, hit, &tracer->scratch, true, surface, NULL)) ||
               walk_surface(tracer, ray, hit, &tracer->scratch, false, surface, error);
    }
    const int64_t textured = innermost_texture(&tracer->items, &code);
    if (!code && !hit->cut_depth) {
        items_surface(tracer, ray, hit, &tracer->items, textured, surface);
        return true;
    }
    const uint32_t *told = hit->cut_depth ? place_of_told(tracer, error) : NULL;
    if (hit->cut_depth && !told) return false;
    if (told && !code && (*told == FIRST_NONE || *told >= FIRST_NODE)) {
        items_cut(tracer, ray, hit, &tracer->items, textured, *told, surface);
        return true;
    }
    if (!pl_items_path(&tracer->items, &tracer->scratch)) return pl_fail_memory(error, "shading a hit");
    return walk_surface(tracer, ray, hit, &tracer->scratch, false, surface, error);
}
