/* Maps at analysis size, weighted pixel by pixel, all channels alike. */

#include "loops.h"

enum { BLOCK = 128 }; /* pixels at a time, which stay in the first cache */

INLINE void add_weighed(const float *values, const float *weight, int64_t size, int64_t channels,
                        float *restrict total)
{
    for (int64_t x = 0; x < size; x++)
        for (int64_t c = 0; c < channels; c++)
            total[channels * x + c] += weight[x] * values[channels * x + c];
}

/* See compiled_maps.mean_of_maps: `maps` and `weights` are addresses. */
CLONED void itmo_mean_of_maps(const float *own, const int64_t *maps, const int64_t *weights,
                              int64_t others, int64_t count, int64_t channels, float *out)
{
    for (int64_t at = 0; at < count; at += BLOCK) {
        int64_t size = count - at < BLOCK ? count - at : BLOCK;
        float whole[BLOCK], *restrict total = out + channels * at;
        memcpy(total, own + channels * at, (size_t)(channels * size) * sizeof *own);
        for (int64_t x = 0; x < size; x++)
            whole[x] = 1;
        for (int64_t i = 0; i < others; i++) {
            const float *values = (const float *)(intptr_t)maps[i] + channels * at;
            const float *weight = (const float *)(intptr_t)weights[i] + at;
            for (int64_t x = 0; x < size; x++)
                whole[x] += weight[x];
            if (channels == 4) /* a constant, so that loops over a pixel's channels are unrolled */
                add_weighed(values, weight, size, 4, total);
            else
                add_weighed(values, weight, size, channels, total);
        }
        for (int64_t x = 0; channels == 4 && x < size; x++)
            for (int c = 0; c < 4; c++)
                total[4 * x + c] /= whole[x];
        for (int64_t x = 0; channels != 4 && x < size; x++)
            for (int64_t c = 0; c < channels; c++)
                total[channels * x + c] /= whole[x];
    }
}

/* See compiled_maps.blend. */
CLONED void itmo_blend(const float *left, const float *right, const float *share, int64_t count,
                       int64_t channels, float *restrict out)
{
    if (channels == 4)
        for (int64_t x = 0; x < count; x++)
            for (int c = 0; c < 4; c++)
                out[4 * x + c] = (right[4 * x + c] - left[4 * x + c]) * share[x] + left[4 * x + c];
    else
        for (int64_t x = 0; x < count; x++)
            for (int64_t c = 0; c < channels; c++) {
                int64_t at = channels * x + c;
                out[at] = (right[at] - left[at]) * share[x] + left[at];
            }
}
