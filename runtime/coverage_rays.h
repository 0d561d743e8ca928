/* coverage_rays.h - which parts of a state are met by bundles of parallel rays (coverage.c).
 *
 *     pl_meetings found;
 *     bool ok = pl_meetings_find(states, state, &found);     false: no memory
 *     free(found.list);                                      either way */
#ifndef PL_COVERAGE_RAYS_H
#define PL_COVERAGE_RAYS_H

#include "coverage.h"

enum {
    PL_BUNDLE_SIDE = 8, /* of a bundle's square of rays */
    PL_BUNDLE_RAYS = PL_BUNDLE_SIDE * PL_BUNDLE_SIDE,
    /* Bundles go in squares about a direction: 2·2 to 6·6. What is sparse needs many rays, and has few parts. */
    PL_FEWEST_BUNDLES = 2,
    PL_MOST_BUNDLES = 6,
    PL_ALL_BUNDLES = PL_COVERAGE_DIRECTIONS * PL_MOST_BUNDLES * PL_MOST_BUNDLES
};

/* A ray meets a part. */
typedef struct pl_meeting {
    uint32_t part; /* a state; 0: a primitive */
    uint16_t bundle;
    uint8_t ray, direction; /* the direction in the part's frame */
} pl_meeting;

/* By bundle, those about the first direction first. */
typedef struct pl_meetings {
    pl_meeting *list;
    size_t count, capacity;
    uint16_t bundles; /* about each direction; squared */
    uint64_t counted[PL_ALL_BUNDLES]; /* bits of the rays that meet the box at all */
} pl_meetings;

bool pl_meetings_find(const pl_states *states, uint32_t state, pl_meetings *found);

#endif
