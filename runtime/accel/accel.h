/* accel.h - the contract of an accelerator.
 *
 * An accelerator finds leaves that a ray may hit and hands each of them, with the ray mapped into the leaf's frame one
 * transformation after another (pl_map_ray), to pl_query_leaf. That call is the normative hit: it alone evaluates t and decides
 * between candidates (smaller t; on equal t the earlier path). So an accelerator may visit too many leaves, in any
 * order, but must never leave out one with a root in the query's range: its boxes are widened by reach.h's slack, and it
 * may skip a box only when the box lies beyond query->t_max, which shrinks as hits are found.
 *
 * To add one: a file here with its `const pl_accel`, a line in the table of scene.c, a name in plsys.h. */
#ifndef PL_ACCEL_H
#define PL_ACCEL_H

#include "../class.h"
#include "../scene.h"

/* Steps that one ray may take: entries of bvh's stack; nodes of a walk; nodes visited to unfold states and to bound classes, of
 * which a ray that grazes all trees of a forest needs less than a hundredth. Far beyond any ray that makes sense, they end those of
 * scenes in which 2^n equal instances lie in the same place. Tests may lower them. */
#ifndef PL_LIMIT_RAY_STEPS
#define PL_LIMIT_RAY_STEPS (UINT64_C(1) << 24)
#define PL_LIMIT_WALK_STEPS (UINT64_C(1) << 30)
#define PL_LIMIT_UNFOLD_STEPS (UINT64_C(1) << 24)
#endif

typedef enum pl_query_kind { PL_QUERY_NEAREST, PL_QUERY_ANY, PL_QUERY_ALL } pl_query_kind;

/* What is asked for. */
typedef struct pl_query {
    pl_query_kind kind;
    double t_min, t_max; /* open interval; t_max shrinks to just beyond the best hit */
    pl_footprint footprint; /* with cut-offs, for the gates of instances … */
    double length;          /* … of the ray's direction in the world … */
    uint64_t ray;           /* … and its key (pl_cut_ray) */
    bool shadow;         /* skip what stands below no_shadow */
    bool found, done;    /* done: no more leaves are wanted */
    const pl_hit *leaves; /* any: its primitive doesn't count (pl_ray); or NULL */
    pl_hit *hit;         /* nearest: the best so far */
    pl_tracer *tracer; /* all: its list */
    pl_error *error;
} pl_query;

/* The error of a ray that reached one of the limits on steps; returns false. */
bool pl_query_fail_steps(const pl_query *query, uint64_t limit);

/* A candidate. Where it is: path writes its union terms from the root; or trail the accelerator's own way to it, from
 * which pl_accel.items gives the items on its path, or pl_accel.path the path. */
typedef struct pl_leaf {
    uint32_t shape; /* unused when mesh is set */
    const double *arguments;
    const pl_mesh_tree *mesh;
    uint64_t primitive;
    bool (*path)(const void *source, pl_path *path); /* NULL: there is a trail */
    bool (*trail)(const void *source, pl_path *trail);
    const void *source;
    const double *o, *d; /* the ray in its frame */
    uint32_t cut_depth; /* 0, but for a cut instance (pl_query_cut) */
    double bound;
} pl_leaf;

/* Offers a leaf. false: an error. */
bool pl_query_leaf(pl_query *query, const pl_leaf *leaf);

/* An instance that a ray comes to in a scene with cut-offs. */
typedef struct pl_arrival {
    uint32_t state;
    const double *o, *d;
    double stretch;
    pl_span within; /* of the instances above */
    uint32_t depth; /* symbols entered, the state's own included */
} pl_arrival;

/* Whether the instance is to be gone into. Where it is cut, the box is offered at t_entry by pl_query_cut; the path's hash
 * (pl_cut_hash of all its terms) is wanted only then. */
static inline pl_gate pl_query_gate(const pl_query *query, const pl_states *states, const pl_arrival *at,
                                    double *t_entry, pl_span *inside)
{
    return pl_gate_of(states, at->state, at->o, at->d, at->stretch, &query->footprint, at->within, query->t_min,
                      query->t_max, t_entry, inside);
}

/* Offers a cut instance's box; leaf: path, source and primitive. false: an error. */
bool pl_query_cut(pl_query *query, const pl_states *states, const pl_arrival *at, uint64_t hash, double t_entry,
                  const pl_leaf *leaf);

/* The same where gates are those of classes: coverage is the instance's (pl_covers_of). */
bool pl_query_cut_box(pl_query *query, const pl_gate_box *box, double coverage, const pl_arrival *at, uint64_t hash,
                      double t_entry, const pl_leaf *leaf);

/* Finds the index of a hit's primitive by the derivation up to it, without what classes can count. */
bool pl_number_by_classes(pl_tracer *tracer, pl_classes *classes, pl_hit *hit, pl_error *error);

/* What a surface needs of a leg: of the items from one place on a trail to the next. */
typedef struct pl_leg {
    const pl_item *last;    /* NULL: not all is known so */
    const pl_site *texture; /* of the innermost item that has one; NULL: none */
    int32_t rule;           /* the innermost one, -1: none */
    uint32_t state;         /* the innermost one that is entered, UINT32_MAX: none … */
    uint32_t entered;       /* … and how many are */
    bool mild;              /* none of its maps changes a normal's size by more than 2^±4 */
    uint32_t map_count;     /* transformations but translations, which leave normals alone … */
    const pl_transform *const *maps; /* … the innermost first */
} pl_leg;

struct pl_accel {
    const char *name;
    bool states, node_boxes; /* what it needs to be built before */
    bool (*build)(pl_scene *scene, pl_error *error); /* fills scene->structure; may be NULL */
    void (*destroy)(pl_scene *scene);
    /* A tracer's working memory. */
    void *(*work_create)(const pl_scene *scene, pl_error *error);
    void (*work_destroy)(void *work);
    /* Offers all leaves that matter. false: an error. */
    bool (*trace)(pl_tracer *tracer, const pl_ray *ray, pl_query *query);
    /* The same for up to PL_TRACE_MANY rays. NULL: one by one. */
    bool (*trace_many)(pl_tracer *tracer, const pl_ray *rays, pl_query *queries, unsigned count);
    /* true: no ray from the eye in a direction between these four, going round, meets anything. NULL: it can't tell. */
    bool (*misses)(const pl_scene *scene, const double eye[3], const double (*directions)[3]);
    /* The items from the scene's to the leaf's at a trail; none: there is a path. NULL: its hits have paths. false: no memory. */
    bool (*items)(const pl_scene *scene, const pl_path *trail, pl_items *items);
    /* The legs of a trail, one for each term; what they name stays until the next call. false: ask for the items. NULL: the same. */
    bool (*legs)(pl_tracer *tracer, const pl_path *trail, pl_leg *legs);
    /* The path in union terms at a trail that has no items. false: no memory. */
    bool (*path)(const pl_scene *scene, const pl_path *trail, pl_path *path);
    /* A walk that follows such a path to its leaf stands at an enter node: it may be moved to a later one. What isn't known
     * there has no value, so that whoever reads it gets an error and walks the whole path. NULL: it never is. */
    void (*skip)(const pl_scene *scene, const pl_path *trail, pl_walk *walk);
    /* Finds a hit's primitive index where tracing leaves it open; NULL: it doesn't. false: an error. */
    bool (*number)(pl_tracer *tracer, pl_hit *hit, pl_error *error);
};

/* The union terms of items, one after another. false: no memory. */
bool pl_items_path(const pl_items *items, pl_path *path);

extern const pl_accel pl_accel_none, pl_accel_boxes, pl_accel_bvh, pl_accel_gated, pl_accel_grid, pl_accel_lazy,
    pl_accel_terrain;

/* One step of the normative chain. The arithmetic follows the form of the map, which is a fact of its numbers. */
static inline void pl_map_ray(const pl_transform *transform, double o[3], double d[3])
{
    if (transform->form <= PL_FORM_PACKED) {
        pl_affine room;
        const pl_affine *map = (const pl_affine *)pl_transform_entries(transform, room.m);
        pl_affine_point(map, o, o);
        pl_affine_vector(map, d, d);
        return;
    }
    const double *m = transform->to_object.m;
    if (transform->form == PL_FORM_DIAGONAL)
        for (int axis = 0; axis < 3; axis++) {
            o[axis] *= m[5 * axis];
            d[axis] *= m[5 * axis];
        }
    for (int axis = 0; axis < 3; axis++) o[axis] += m[4 * axis + 3];
}

#endif
