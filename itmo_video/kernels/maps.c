/* Maps at analysis size, weighted pixel by pixel, all channels alike. */

#include "loops.h"

/* See compiled_maps.add_weighed. */
CLONED void itmo_add_weighed(const float *values, const float *weight, int64_t count,
                             int64_t channels, float *restrict total)
{
    if (channels == 4) /* a constant, so that loops over a pixel's channels are unrolled */
        for (int64_t x = 0; x < count; x++)
            for (int c = 0; c < 4; c++)
                total[4 * x + c] += weight[x] * values[4 * x + c];
    else
        for (int64_t x = 0; x < count; x++)
            for (int64_t c = 0; c < channels; c++)
                total[channels * x + c] += weight[x] * values[channels * x + c];
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
