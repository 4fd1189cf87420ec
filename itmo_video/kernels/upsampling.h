/* Upsamples lines of planes at analysis size to a line of the picture. */

#ifndef ITMO_UPSAMPLING_H
#define ITMO_UPSAMPLING_H

#include "vectors.h"

/* Each plane's line between row `above` and the next, as `itmo_widen` takes it; `part` weights the next. */
INLINE void lines_between(const float *small, int64_t planes, int64_t h, int64_t w, int64_t above,
                          float part, float *lefts, float *steps)
{
    float rest = 1 - part;
    for (int64_t p = 0; p < planes; p++) {
        const float *upper = small + (p * h + above) * w;
        const float *lower = above + 1 < h ? upper + w : upper;
        float *restrict left = lefts + p * (w + 1), *restrict step = steps + p * (w + 1);
        for (int64_t x = 0; x < w; x++)
            left[x + 1] = upper[x] * rest + lower[x] * part;
        left[0] = left[1];
        for (int64_t x = 0; x < w; x++)
            step[x] = left[x + 1] - left[x];
        step[w] = 0;
    }
}

/* The ratio of smoothed to given luminance of a line, by the guard's coefficients and its codes. */
INLINE void guard_line(const float *slope, const float *offset, const float *code, int64_t width,
                       float *restrict out)
{
    for (int64_t x = 0; x < width; x++) {
        float light = code[x] > 0.02f ? code[x] : 0.02f;
        out[x] = between((slope[x] * code[x] + offset[x]) / light, -0.5f, 1) + 1;
    }
}

/* A line of codes of that many bytes, scaled from black at 0 to white at 1. */
INLINE void levels_of(const uint8_t *codes, int64_t bytes, float scale, float offset, int64_t width,
                      float *restrict out)
{
    const uint16_t *wide = (const uint16_t *)codes;
    const float *values = (const float *)codes;
    for (int64_t x = 0; bytes == 1 && x < width; x++)
        out[x] = FMA((float)codes[x], scale, offset);
    for (int64_t x = 0; bytes == 2 && x < width; x++)
        out[x] = FMA((float)wide[x], scale, offset);
    for (int64_t x = 0; bytes == 4 && x < width; x++)
        out[x] = FMA(values[x], scale, offset);
}

#endif
