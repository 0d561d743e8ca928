/* quantise.c - see quantise.h. */
#include "quantise.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "elementary.h"
#include "plsys.h"

void pl_quantiser_init(pl_quantiser *quantiser)
{
    for (int i = 0; i < 255; i++) {
        const double srgb = (i + 0.5) / 255.0;
        quantiser->thresholds[i] = srgb <= 0.04045 ? srgb / 12.92 : pl_pow((srgb + 0.055) / 1.055, 2.4);
    }
    quantiser->thresholds[255] = INFINITY;
    unsigned reached = 0;
    for (uint32_t cell = 0; cell < PL_CELLS; cell++) {
        const uint32_t bits = (PL_FIRST_CELL + cell) << 16;
        float first;
        memcpy(&first, &bits, sizeof first);
        while ((double)first >= quantiser->thresholds[reached]) reached++;
        quantiser->cells[cell] = (uint8_t)reached;
    }
}

uint8_t pl_srgb(const pl_quantiser *quantiser, float linear)
{
    uint32_t bits;
    if (!(linear >= 0x1p-13f)) return 0;
    if (linear >= 1.0f) return 255;
    memcpy(&bits, &linear, sizeof bits);
    unsigned reached = quantiser->cells[(bits >> 16) - PL_FIRST_CELL];
    while ((double)linear >= quantiser->thresholds[reached]) reached++;
    return (uint8_t)reached;
}

uint16_t pl_linear_16(float linear)
{
    if (!(linear > 0.0f)) return 0;
    return linear >= 1.0f ? UINT16_MAX : (uint16_t)((double)linear * UINT16_MAX + 0.5);
}

void pl_quantise(size_t n, const float *linear, uint8_t *srgb, uint16_t *linear16)
{
    pl_quantiser quantiser;
    pl_quantiser_init(&quantiser);
    for (size_t i = 0; srgb && i < n; i++) srgb[i] = pl_srgb(&quantiser, linear[i]);
    for (size_t i = 0; linear16 && i < n; i++) linear16[i] = pl_linear_16(linear[i]);
}
