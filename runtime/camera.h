/* camera.h - from a point of the image to a ray of the eye: POV-Ray's perspective camera.
 *
 *     pl_camera camera;
 *     if (!pl_camera_create(pl_scene_camera(scene), &camera, error)) …
 *     pl_camera_direction(&camera, x + 0.5, y + 0.5, width, height, direction);     the centre of pixel (x, y) */
#ifndef PL_CAMERA_H
#define PL_CAMERA_H

#include "plsys.h"

/* The image is the rectangle location + forward ± right/2 ± up/2. */
typedef struct pl_camera {
    double location[3], forward[3], right[3], up[3];
} pl_camera;

/* From a camera record (NULL: the scene has none, an error). false also for a camera without a direction or extent. */
bool pl_camera_create(const double *record, pl_camera *camera, pl_error *error);

/* The unit direction through the image point (x, y) in pixels, (0, 0) being the upper left corner of the image. */
void pl_camera_direction(const pl_camera *camera, double x, double y, int width, int height, double direction[3]);

/* Through the centres of columns x rows pixels from (left, top) on, row by row; at most PL_CAMERA_COLUMNS a row. */
enum { PL_CAMERA_COLUMNS = 4 };
void pl_camera_directions(const pl_camera *camera, int left, int top, int columns, int rows, int width, int height,
                          double (*directions)[3]);

/* A pixel's width at unit distance from the eye, in the middle of the image: the larger of across and down. */
double pl_camera_spread(const pl_camera *camera, int width, int height);

#endif
