/* quantise.h - linear light as the integers of picture files: floor(clip(x, 0, 1) * most + 1/2), NaN as 0.
 *
 *     pl_quantiser quantiser;
 *     pl_quantiser_init(&quantiser);
 *     byte = pl_srgb(&quantiser, 0.214f);      127
 *
 * Eight bits are sRGB (IEC 61966-2-1), 16 bits are linear. The power function of sRGB is evaluated once a byte, not once a
 * pixel: the byte of x is the number of thresholds that x reaches. Floats of the same upper half are a cell, whose first float's
 * byte is kept: there is hardly ever more than one threshold in a cell. */
#ifndef PL_QUANTISE_H
#define PL_QUANTISE_H

#include <stdint.h>

/* Cells of the floats from 2^-13, below all thresholds, to 1: their bits without the lower 16. */
enum { PL_FIRST_CELL = (127 - 13) << 7, PL_CELLS = (127 << 7) - PL_FIRST_CELL };

typedef struct pl_quantiser {
    double thresholds[256]; /* ascending: the least linear value of byte i + 1; infinity after the last */
    uint8_t cells[PL_CELLS];
} pl_quantiser;

void pl_quantiser_init(pl_quantiser *quantiser);
uint8_t pl_srgb(const pl_quantiser *quantiser, float linear);
uint16_t pl_linear_16(float linear);

#endif
