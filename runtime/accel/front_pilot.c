/* front_pilot.c - a few hundred real rays through the cyclic graph: how often states are visited (front.h).
 *
 * Surface areas tell what a ray that meets a box meets inside it if nothing stood in its way. What does stand in its way is
 * seen best by trying: rays of the camera, towards a light from what they hit, and chords through the scene's box for those
 * who ask from anywhere. The graph is walked in double without any structure, item by item, near boxes first. The work
 * is limited, since all this is worth a per cent of a small picture: what wasn't visited is left to the areas. */
#include "front.h"

#include <stdlib.h>
#include <string.h>

#include "../camera.h"
#include "../error.h"
#include "../random.h"

enum { RAYS_ACROSS = 16, RAYS_DOWN = 12, CHORDS = 128, MOST_STEPS = 40000, MOST_ITEMS = 2048, MOST_PENDING = 4096 };

typedef struct frame {
    uint32_t state;
    double o[3], d[3];
} frame;

typedef struct pending {
    double t;
    uint32_t frame, item;
} pending;

typedef struct flight {
    const pl_scene *scene;
    const pl_compositions *compositions;
    pl_pilot *pilot;
    pl_box *boxes; /* of items, once their state was visited */
    frame *frames;
    pending *stack;
    size_t frame_count, frame_capacity, stack_count;
    uint64_t steps;
    bool failed; /* no memory, or beyond what a pilot is for */
} flight;

static bool room_for_frame(flight *f)
{
    if (f->frame_count < f->frame_capacity) return true;
    size_t more = 2 * f->frame_capacity + 64;
    frame *data = realloc(f->frames, more * sizeof *data);
    if (!data) return false;
    f->frames = data;
    f->frame_capacity = more;
    return true;
}

/* Boxes of a state's items, when a ray comes to it for the first time. */
static void find_boxes(flight *f, uint32_t index)
{
    const pl_states *states = f->compositions->states;
    const size_t first = f->compositions->first[index];
    for (uint32_t i = 0; i < states->list[index].item_count; i++) {
        const pl_item *item = &states->list[index].items[i];
        f->boxes[first + i] = pl_item_unbounded(states, item)
                                  ? pl_box_everything()
                                  : pl_box_under(states, item, &f->compositions->list[first + i].to_parent);
    }
}

/* Counts a visit and pushes the items that the ray meets, the nearest last. */
static void visit(flight *f, uint32_t index, double t_max)
{
    const frame *at = &f->frames[index];
    const pl_state *state = &f->compositions->states->list[at->state];
    const size_t first = f->compositions->first[at->state], below = f->stack_count;
    const pl_slab slab = pl_slab_of(at->o, at->d, 0.0);
    if (f->pilot->visits[at->state]++ == 0.0) find_boxes(f, at->state);
    f->steps += state->item_count;
    for (uint32_t i = 0; i < state->item_count; i++) {
        double t;
        if (!pl_slab_hits(&slab, &f->boxes[first + i], 0.0, t_max, &t)) continue;
        if (f->stack_count == MOST_PENDING) {
            f->failed = true;
            return;
        }
        size_t place = f->stack_count++;
        for (; place > below && f->stack[place - 1].t < t; place--) f->stack[place] = f->stack[place - 1];
        f->stack[place] = (pending){t, index, i};
    }
}

/* The nearest hit of a ray before t_max; t_max: none. any: the first that is found. */
static double trace(flight *f, const double o[3], const double d[3], double t_max, bool any)
{
    const pl_states *states = f->compositions->states;
    f->frame_count = f->stack_count = 0;
    if (!room_for_frame(f)) return f->failed = true, t_max;
    f->frames[f->frame_count++] = (frame){0, {o[0], o[1], o[2]}, {d[0], d[1], d[2]}};
    f->pilot->rays++;
    visit(f, 0, t_max);
    while (f->stack_count && f->steps < MOST_STEPS && !f->failed) {
        const pending at = f->stack[--f->stack_count];
        if (!(at.t < t_max)) continue;
        f->frame_count = at.frame + 1;
        if (!room_for_frame(f)) return f->failed = true, t_max;
        const frame *above = &f->frames[at.frame];
        const size_t index = f->compositions->first[above->state] + at.item;
        const pl_item *item = &states->list[above->state].items[at.item];
        frame below;
        pl_affine_point(&f->compositions->list[index].to_object, above->o, below.o);
        pl_affine_vector(&f->compositions->list[index].to_object, above->d, below.d);
        if (item->kind == PL_NODE_ENTER) {
            below.state = item->what;
            f->pilot->entries[index]++;
            f->frames[f->frame_count++] = below;
            visit(f, at.frame + 1, t_max);
            continue;
        }
        pl_root roots[PL_SHAPE_ROOTS];
        bool met = item->kind == PL_NODE_MESH
                       ? pl_mesh_nearest(states->meshes[item->what], below.o, below.d, 0.0, t_max, roots)
                       : pl_shape_of(item->what)->roots(item->arguments, below.o, below.d, 0.0, t_max, roots) > 0;
        if (met) t_max = roots[0].t;
        if (met && any) break;
    }
    return t_max;
}

/* A ray of the camera, and one from what it hits to the first light. */
static void look(flight *f, const pl_camera *camera, double x, double y)
{
    const double *const *lights;
    double direction[3], from[3], towards[3];
    pl_camera_direction(camera, x, y, RAYS_ACROSS, RAYS_DOWN, direction);
    double t = trace(f, camera->location, direction, INFINITY, false);
    if (f->failed || t == INFINITY || !pl_scene_lights(f->scene, &lights)) return;
    for (int axis = 0; axis < 3; axis++) {
        from[axis] = camera->location[axis] + t * (1.0 - 1e-6) * direction[axis];
        towards[axis] = lights[0][PL_LIGHT_LOCATION + axis] - from[axis];
    }
    trace(f, from, towards, 1.0, true);
}

/* From a random point of one sphere around the box to a point in it. */
static void cross(flight *f, const pl_box *box, uint64_t number)
{
    double random[6], o[3], d[3], length = 0.0, size = 0.0;
    for (int i = 0; i < 6; i++) random[i] = (double)(pl_mix(number, (uint64_t)i) >> 11) * 0x1p-53;
    for (int axis = 0; axis < 3; axis++) {
        size += box->hi[axis] - box->lo[axis];
        o[axis] = 2.0 * random[axis] - 1.0;
        length += o[axis] * o[axis];
    }
    if (!(length > 1e-6)) return;
    for (int axis = 0; axis < 3; axis++) {
        o[axis] = 0.5 * (box->lo[axis] + box->hi[axis]) + size / sqrt(length) * o[axis];
        d[axis] = box->lo[axis] + random[3 + axis] * (box->hi[axis] - box->lo[axis]) - o[axis];
    }
    trace(f, o, d, INFINITY, false);
}

static void fly(flight *f)
{
    const pl_box *box = &f->compositions->states->list[0].bounds->box;
    const bool chords = !pl_box_is_empty(box) && pl_box_is_finite(box);
    pl_camera camera;
    const bool looks = pl_camera_create(pl_scene_camera(f->scene), &camera, NULL);
    const uint64_t pixels = RAYS_ACROSS * RAYS_DOWN;
    /* In an order that is everywhere from the beginning: 77 is prime to the number of pixels. */
    for (uint64_t i = 0; i < pixels && f->steps < MOST_STEPS && !f->failed; i++) {
        uint64_t at = i * 77 % pixels;
        if (looks) look(f, &camera, (double)(at % RAYS_ACROSS) + 0.5, (double)(at / RAYS_ACROSS) + 0.5);
        if (chords && i < CHORDS && !f->failed) cross(f, box, i);
    }
}

bool pl_pilot_fly(pl_pilot *pilot, const pl_scene *scene, const pl_compositions *compositions, pl_error *error)
{
    const pl_states *states = compositions->states;
    const size_t items = compositions->first[states->count];
    *pilot = (pl_pilot){.visits = calloc(states->count + 1, sizeof *pilot->visits),
                        .entries = calloc(items + 1, sizeof *pilot->entries)};
    if (!pilot->visits || !pilot->entries) return pl_fail_memory(error, "planning the fronts");
    for (uint32_t i = 0; i < states->count; i++)
        if (states->list[i].item_count > MOST_ITEMS) return true;
    flight f = {.scene = scene,
                .compositions = compositions,
                .pilot = pilot,
                .boxes = malloc((items + 1) * sizeof *f.boxes),
                .stack = malloc(MOST_PENDING * sizeof *f.stack)};
    bool ok = f.boxes && f.stack;
    if (ok) fly(&f);
    free(f.boxes);
    free(f.stack);
    free(f.frames);
    return ok || pl_fail_memory(error, "planning the fronts");
}

void pl_pilot_free(pl_pilot *pilot)
{
    free(pilot->visits);
    free(pilot->entries);
}
