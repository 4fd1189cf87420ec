/* Maps at analysis size weighed place by place, all channels of a place alike. */

#include "loops.h"

/* See native.add_weighed. */
CLONED void itmo_add_weighed(const float *values, const float *weight, int64_t count,
                             int64_t channels, float *restrict total)
{
    if (channels == 4) /* known beforehand, so that a place's channels go together */
        for (int64_t x = 0; x < count; x++)
            for (int c = 0; c < 4; c++)
                total[4 * x + c] += weight[x] * values[4 * x + c];
    else
        for (int64_t x = 0; x < count; x++)
            for (int64_t c = 0; c < channels; c++)
                total[channels * x + c] += weight[x] * values[channels * x + c];
}

/* See native.blend. */
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
