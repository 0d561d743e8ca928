/* coverage.h - the table of coverages: for each state the share of its box's silhouette that it covers, by direction.
 *
 * Shares are found when they are first asked for (coverage.c), by whichever thread that is. They are pure functions of the
 * states, so it never shows. */
#ifndef PL_COVERAGE_H
#define PL_COVERAGE_H

#include "state.h"

/* Directions, up to sign: axes, diagonals of faces, diagonals of the box. */
enum { PL_COVERAGE_DIRECTIONS = 13 };

typedef struct pl_coverage pl_coverage;

/* An empty table for these states. NULL: no memory, or not within the states' limit. */
pl_coverage *pl_coverage_create(pl_states *states, pl_error *error);
void pl_coverage_free(pl_coverage *coverage);

/* The share of a state's silhouette that is covered from a direction of its frame; below 0: no memory. */
double pl_coverage_of(const pl_states *states, uint32_t state, const double d[3]);

/* Which of the directions is the nearest, and its unit vector s, with a and b across it. */
int pl_coverage_direction(const double d[3]);
void pl_coverage_frame(int direction, double s[3], double a[3], double b[3]);

/* The largest share from any direction; below 0: no memory. */
double pl_coverage_most(const pl_states *states, uint32_t state);

#endif
