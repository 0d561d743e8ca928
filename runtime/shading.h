/* shading.h - what shade.c and shadow.c share: samples on their way from a ray to a colour.
 *
 *     bounce ─ traced ─▶ spotted ─ one for each light that shines on it ─▶ shine ─ what arrives ─▶ spotted.total */
#ifndef PL_SHADING_H
#define PL_SHADING_H

#include "shade.h"
#include "texture.h"

/* POV-Ray's tolerances, in scene units (section 7). */
#define POVRAY_LEAST 1e-4
#define POVRAY_SHADOW 1e-3
#define POVRAY_FARTHEST 1e7

/* A ray that waits to be traced. */
typedef struct pl_bounce {
    double origin[3], direction[3], t_min;
    double share[3]; /* of the sample's colour that the ray's colour counts for */
    double width;    /* of the pixel's footprint at the origin; it goes on growing by the view's spread */
    double weight;   /* POV-Ray's measure of it: the product of largest channels */
    uint32_t level;
} pl_bounce;

/* One hit while it is shaded. */
typedef struct pl_spotted {
    const pl_bounce *ray;
    const pl_hit *hit;
    bool found;  /* false: the ray met nothing, and the rest is unspecified */
    bool convex; /* as of pl_surface */
    double depth;               /* t on the ray */
    double point[3], normal[3]; /* turned against the ray */
    double flat[3];             /* the surface's own normal, to either side */
    double width;               /* of the pixel's footprint here */
    double epsilon;             /* rounding error of the point, in our own tolerances */
    pl_pigment pigment;
    pl_finish finish;
    double total[3]; /* its own light, as far as it is added up */
} pl_spotted;

/* One light on one of several hits, while shadows are traced. */
typedef struct pl_shine {
    pl_spotted *at;
    double towards[3], distance;
    double color[3]; /* that arrives … */
    double share[3]; /* … and what the surface's own colour shows of it */
} pl_shine;

struct pl_shader {
    const pl_view *view;
    pl_tracer *tracer;
    pl_bounce *waiting;
    size_t count, capacity;
    uint32_t sample_rays;
    pl_ray_counts rays;
    /* Rays that are traced together, and what they meet: those of the eye, of one bounce, or towards one light. */
    pl_ray traced[PL_TRACE_MANY];
    pl_ray eye_rays[PL_TRACE_MANY]; /* as eyes: all but their directions is the same for all samples */
    bool blocked[PL_TRACE_MANY];
    /* Samples that are shaded together, and those of their hits that a light shines on. */
    pl_bounce eyes[PL_SHADE_MANY];
    pl_hit hits[PL_SHADE_MANY]; /* of rays that look for the foremost: of shadow rays, too, where not all is opaque */
    pl_spotted spotted[PL_SHADE_MANY];
    pl_shine shines[PL_SHADE_MANY], *sorted[PL_SHADE_MANY];
};

/* Sets where a ray in a direction leaves a surface: off it by its rounding error, in our own tolerances. */
void pl_leave(const pl_view *view, const pl_spotted *at, const double direction[3], double origin[3]);

/* Makes the colours of the shader's first `count` shines what of them arrives behind everything on the way from the light. */
bool pl_cast_shadows(pl_shader *shader, unsigned count, pl_error *error);

#endif
