/* camera.c - see camera.h; the formulas are in SHADING.md, "Camera". */
#include "camera.h"

#include <string.h>

#include "bytecode.h"
#include "elementary.h"
#include "error.h"
#include "vector.h"

static void scale(double v[3], double factor)
{
    for (int axis = 0; axis < 3; axis++) v[axis] *= factor;
}

static double length(const double v[3])
{
    double copy[3] = {v[0], v[1], v[2]};
    return pl_normalize(copy);
}

/* Turns the camera towards the record's look_at: the lengths and the handedness of the frame stay. */
static bool look_at(const double *record, pl_camera *camera, pl_error *error)
{
    const double *sky = record + PL_CAMERA_SKY;
    double normal[3];
    pl_cross(camera->up, camera->forward, normal);
    const double handedness = pl_dot(normal, camera->right) > 0.0 ? 1.0 : -1.0;
    const double forward_length = length(camera->forward), right_length = length(camera->right);
    const double up_length = length(camera->up);
    for (int axis = 0; axis < 3; axis++)
        camera->forward[axis] = record[PL_CAMERA_LOOK_AT + axis] - camera->location[axis];
    if (pl_normalize(camera->forward) == 0.0)
        return pl_fail(error, PL_ERROR_SCENE, "camera", "location and look_at are the same point");
    pl_cross(sky, camera->forward, camera->right);
    if (pl_normalize(camera->right) == 0.0)
        return pl_fail(error, PL_ERROR_SCENE, "camera", "it looks straight along sky");
    pl_cross(camera->forward, camera->right, camera->up);
    pl_normalize(camera->up);
    scale(camera->forward, forward_length);
    scale(camera->right, handedness * right_length);
    scale(camera->up, up_length);
    return true;
}

bool pl_camera_create(const double *record, pl_camera *camera, pl_error *error)
{
    if (!record)
        return pl_fail(error, PL_ERROR_SCENE, "camera", "the scene has no camera, so there is nothing to render");
    memcpy(camera->location, record + PL_CAMERA_LOCATION, sizeof camera->location);
    memcpy(camera->forward, record + PL_CAMERA_DIRECTION, sizeof camera->forward);
    memcpy(camera->right, record + PL_CAMERA_RIGHT, sizeof camera->right);
    memcpy(camera->up, record + PL_CAMERA_UP, sizeof camera->up);
    if (record[PL_CAMERA_HAS_LOOK_AT] != 0.0 && !look_at(record, camera, error)) return false;
    const double angle = record[PL_CAMERA_ANGLE];
    if (angle != 0.0) {
        if (!(angle > 0.0 && angle < 180.0))
            return pl_fail(error, PL_ERROR_SCENE, "camera", "angle is %g degrees, not between 0 and 180", angle);
        pl_normalize(camera->forward);
        scale(camera->forward, length(camera->right) / pl_tan(angle / 2.0) / 2.0);
    }
    if (length(camera->forward) == 0.0 || length(camera->right) == 0.0 || length(camera->up) == 0.0)
        return pl_fail(error, PL_ERROR_SCENE, "camera",
                       "direction, right and up must be vectors of finite, positive length");
    double across[3];
    pl_cross(camera->up, camera->forward, across);
    if (!(fabs(pl_dot(across, camera->right)) > 0.0))
        return pl_fail(error, PL_ERROR_SCENE, "camera", "direction, right and up lie in one plane");
    return true;
}

/* Through the point that lies by so much of the image's width and height right of and above its middle. */
static inline void set_direction(const pl_camera *camera, double across, double above, double direction[3])
{
    for (int axis = 0; axis < 3; axis++)
        direction[axis] = camera->forward[axis] + across * camera->right[axis] + above * camera->up[axis];
    pl_normalize(direction);
}

void pl_camera_direction(const pl_camera *camera, double x, double y, int width, int height, double direction[3])
{
    set_direction(camera, x / width - 0.5, 0.5 - y / height, direction);
}

typedef double pl_row __attribute__((vector_size(8 * PL_CAMERA_COLUMNS)));

/* set_direction in a row of columns: a square root or quotient in a vector has the bits of one alone. */
static void set_row(const pl_camera *camera, pl_row across, double above, int columns, double (*row)[3])
{
    pl_row d[3], length;
    for (int axis = 0; axis < 3; axis++) d[axis] = camera->forward[axis] + across * camera->right[axis] + above * camera->up[axis];
    const pl_row square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    bool usual = true;
    for (int i = 0; i < PL_CAMERA_COLUMNS; i++) {
        usual = usual && square[i] > PL_LEAST_SQUARE && square[i] < PL_MOST_SQUARE;
        length[i] = sqrt(square[i]);
    }
    for (int axis = 0; axis < 3; axis++) d[axis] /= length;
    for (int i = 0; i < columns; i++) {
        if (!usual) set_direction(camera, across[i], above, row[i]);
        else
            for (int axis = 0; axis < 3; axis++) row[i][axis] = d[axis][i];
    }
}

void pl_camera_directions(const pl_camera *camera, int left, int top, int columns, int rows, int width, int height,
                          double (*directions)[3])
{
    pl_row across;
    for (int i = 0; i < PL_CAMERA_COLUMNS; i++) across[i] = (left + i + 0.5) / width - 0.5;
    for (int row = 0; row < rows; row++, directions += columns)
        set_row(camera, across, 0.5 - (top + row + 0.5) / height, columns, directions);
}

double pl_camera_spread(const pl_camera *camera, int width, int height)
{
    const double across = length(camera->right) / width, down = length(camera->up) / height;
    return (across > down ? across : down) / length(camera->forward);
}
