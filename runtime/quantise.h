/* quantise.h - linear light as the integers of picture files: floor(clip(x, 0, 1) * most + 1/2), NaN as 0.
 *
 *     pl_quantiser quantiser;
 *     pl_quantiser_init(&quantiser);
 *     byte = pl_srgb(&quantiser, 0.214f);      127
 *
 * Eight bits are sRGB (IEC 61966-2-1), 16 bits are linear. The power function of sRGB is evaluated once a byte, not once a
 * pixel: the byte of x is the number of thresholds that x reaches. */
#ifndef PL_QUANTISE_H
#define PL_QUANTISE_H

#include <stdint.h>

typedef struct pl_quantiser {
    double thresholds[255]; /* ascending: the least linear value of byte i + 1 */
} pl_quantiser;

void pl_quantiser_init(pl_quantiser *quantiser);
uint8_t pl_srgb(const pl_quantiser *quantiser, float linear);
uint16_t pl_linear_16(float linear);

#endif
