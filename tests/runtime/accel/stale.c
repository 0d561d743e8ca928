/* stale.c - what an earlier call left on the stack doesn't change a hit: no ray has a field that nobody set.
 *
 *     stale SCENE.plsb     exit code 0, or lines that say what differs */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "check.h"
#include "plsys.h"

enum { WORDS = 1 << 14, RAYS = 40 };

/* Leaves a value where the frames of the next calls will be. */
__attribute__((noinline)) static double stain(double value)
{
    volatile double words[WORDS];
    for (int i = 0; i < WORDS; i++) words[i] = value;
    return words[0];
}

int main(int argc, char **argv)
{
    static uint8_t bytes[1 << 16];
    static const double stains[] = {0.0, 1e300, INFINITY, NAN}, origin[3] = {0.5, -3.0, 0.5};
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    if (!file) return 3;
    size_t length = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    for (int accelerator = PL_NONE; accelerator <= PL_GRID; accelerator++) {
        pl_options options = {.accelerator = accelerator, .threads = 1, .detail = -1.0};
        pl_error error;
        pl_scene *scene = pl_scene_create(bytes, length, &options, &error);
        CHECK(scene != NULL);
        for (int i = 0; scene && i < RAYS; i++) {
            const double direction[3] = {0.013 * (i % 7 - 3), 1.0, 0.017 * (i / 7 - 3)};
            double t[4] = {0.0};
            for (int k = 0; k < 4; k++) {
                pl_hits hits = {.t = &t[k]};
                (void)stain(stains[k]);
                CHECK(pl_intersect(scene, 1, origin, direction, &hits, &error));
            }
            CHECK(t[1] == t[0] && t[2] == t[0] && t[3] == t[0]);
        }
        pl_scene_destroy(scene);
    }
    return check_result();
}
