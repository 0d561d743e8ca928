/* hostile.c - bytecode with every byte changed in turn, its checksum made right, is refused or traced: never a crash.
 *
 *     hostile SCENE.plsb     prints "refused N traced M" */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check.h"
#include "plsys.h"

static void seal(uint8_t *bytes, size_t length)
{
    uint32_t crc = 0xFFFFFFFFu;
    for (size_t i = 28; i < length; i++) {
        crc ^= bytes[i];
        for (int k = 0; k < 8; k++) crc = crc & 1 ? 0xEDB88320u ^ (crc >> 1) : crc >> 1;
    }
    for (int i = 0; i < 4; i++) bytes[12 + i] = (uint8_t)((crc ^ 0xFFFFFFFFu) >> (8 * i));
}

/* A new allocation for each try, so that reading beyond the end is seen. */
static bool survives(const uint8_t *bytes, size_t length, int accelerator)
{
    static const double origins[] = {0.1, -30, 2, 9, 8, 7, 0, 0, 0.5}, directions[] = {0, 1, 0.01, -1, -0.8, -0.5, 0, 0, 1};
    double t[3], normal[9];
    int32_t depth[3];
    pl_error error;
    uint8_t *copy = malloc(length);
    memcpy(copy, bytes, length);
    pl_options options = {.accelerator = accelerator, .threads = 1, .memory = 1 << 20};
    pl_scene *scene = pl_scene_create(copy, length, &options, &error);
    free(copy);
    if (!scene) {
        CHECK(error.code != PL_OK && error.reason[0]);
        return false;
    }
    pl_hits hits = {.t = t, .normal = normal, .depth = depth};
    bool traced = pl_intersect(scene, 3, origins, directions, &hits, &error);
    CHECK(traced || (error.code != PL_OK && error.reason[0]));
    pl_scene_destroy(scene);
    return traced;
}

int main(int argc, char **argv)
{
    static uint8_t bytes[1 << 16];
    unsigned refused = 0, traced = 0;
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    if (!file) return 3;
    size_t length = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    for (size_t i = 28; i < length; i++)
        for (int bit = 0; bit < 8; bit++) {
            bytes[i] ^= (uint8_t)(1 << bit);
            seal(bytes, length);
            bool alive = survives(bytes, length, bit % 3 == 0 ? PL_BOXES : bit % 3 == 1 ? PL_BVH : PL_GRID);
            traced += alive;
            refused += !alive;
            bytes[i] ^= (uint8_t)(1 << bit);
        }
    printf("refused %u traced %u\n", refused, traced);
    return check_result();
}
