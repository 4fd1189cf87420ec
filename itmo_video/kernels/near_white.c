/* A keyframe's picture near white: what clips, the colour around it, how far channels part. Pixels are
   R, G, B side by side; operators/auto_clipping.py and auto_parting.py have the plain forms. */

#include "numbers.h"

INLINE float larger(float a, float b)
{
    return a > b ? a : b;
}

INLINE float smaller(float a, float b)
{
    return a < b ? a : b;
}

/* See compiled_near_white.greatest. */
CLONED void itmo_greatest(const float *rgb, int64_t count, float *restrict out)
{
    for (int64_t x = 0; x < count; x++)
        out[x] = larger(larger(rgb[3 * x], rgb[3 * x + 1]), rgb[3 * x + 2]);
}

INLINE float luminance_of(const float *rgb)
{
    return 0.213f * rgb[0] + 0.715f * rgb[1] + 0.072f * rgb[2];
}

/* See compiled_near_white.luminance. */
CLONED void itmo_luminance(const float *rgb, int64_t count, float *restrict out)
{
    for (int64_t x = 0; x < count; x++)
        out[x] = luminance_of(rgb + 3 * x);
}

/* See compiled_near_white.weighed_by_light. */
CLONED void itmo_weighed_by_light(const float *rgb, float low, float scale, int64_t count,
                                  float *restrict weight, float *restrict out)
{
    for (int64_t x = 0; x < count; x++) {
        float red = rgb[3 * x], green = rgb[3 * x + 1], blue = rgb[3 * x + 2];
        float own = ramp_of(larger(larger(red, green), blue), low, scale);
        weight[x] = own;
        out[3 * x] = red * own, out[3 * x + 1] = green * own, out[3 * x + 2] = blue * own;
    }
}

/* See compiled_near_white.mean_colour. */
CLONED void itmo_mean_colour(const float *around, const float *own, const float *weight, float trace,
                             int64_t count, float *restrict out)
{
    for (int64_t x = 0; x < count; x++) {
        float all = weight[x] + trace;
        for (int c = 0; c < 3; c++)
            out[3 * x + c] = (around[3 * x + c] + trace * own[3 * x + c]) / all;
    }
}

/* See compiled_near_white.share_ramps. */
CLONED void itmo_share_ramps(const float *part, const float *all, float least, float low, float scale,
                             int64_t count, float *restrict out)
{
    for (int64_t x = 0; x < count; x++)
        out[x] = ramp_of(part[x] / (all[x] + least), low, scale);
}

/* See compiled_near_white.with_near. */
CLONED void itmo_with_near(const float *known, const float *around, float low, float scale,
                           int64_t count, float *restrict out)
{
    for (int64_t x = 0; x < count; x++) {
        float most = larger(larger(known[3 * x], known[3 * x + 1]), known[3 * x + 2]);
        for (int c = 0; c < 3; c++)
            out[3 * x + c] = larger(known[3 * x + c], ramp_of(around[3 * x + c], low, scale) * most);
    }
}

enum { BLOCK = 32 }; /* pixels at a time */

/* Of pixels from `at` on, a block's last or the last of `count`; what is 0 in a whole block stays so: it is
   cleared and passed over. */
INLINE int64_t block_of(const float *values, int64_t *at, int64_t count, float *restrict out)
{
    for (; count - *at >= BLOCK; *at += BLOCK) {
        int any = 0;
        for (int i = 0; i < 3 * BLOCK; i++)
            any |= values[3 * *at + i] != 0;
        if (any)
            return *at + BLOCK;
        memset(out + 3 * *at, 0, 3 * BLOCK * sizeof *out);
    }
    return count;
}

/* See compiled_near_white.bounded_parting. */
CLONED void itmo_bounded_parting(const float *levels, const float *colour, const float *lost,
                                 const float *n, int64_t count, float *restrict out)
{
    float apart = n[0], free_from = n[1], free_scale = n[2], dark = n[3];
    for (int64_t at = 0, end; at < count; at = end) {
        end = block_of(levels, &at, count, out);
        for (int64_t x = at; x < end; x++) {
            float red = colour[3 * x], green = colour[3 * x + 1], blue = colour[3 * x + 2];
            float greatest = larger(larger(red, green), blue);
            float least = smaller(smaller(red, green), blue);
            float second = red + green + blue - greatest - least;
            float span = log_two(larger(greatest, dark) / larger(least, dark));
            float most = apart * (span * sqrtf(larger(span, 0)));
            float free = ramp_of(second, free_from, free_scale);
            float common = smaller(smaller(levels[3 * x], levels[3 * x + 1]), levels[3 * x + 2]);
            for (int c = 0; c < 3; c++) {
                float parted = levels[3 * x + c] - common;
                float held = smaller(parted, larger(most, lost[3 * x + c]));
                out[3 * x + c] = common + held + free * (parted - held);
            }
        }
    }
}

/* See compiled_near_white.held_together. */
CLONED void itmo_held_together(const float *stops, const float *lost, const float *decided,
                               int64_t count, float *restrict out)
{
    for (int64_t at = 0, end; at < count; at = end) {
        end = block_of(stops, &at, count, out);
        for (int64_t x = at; x < end; x++) {
            const float *own = stops + 3 * x;
            float common = smaller(smaller(own[0], own[1]), own[2]), little[3];
            for (int c = 0; c < 3; c++)
                little[c] = smaller(own[c] - common, lost[3 * x + c]);
            float even = luminance_of(own) - luminance_of(little);
            for (int c = 0; c < 3; c++) {
                float together = even + little[c];
                out[3 * x + c] = together + decided[x] * (own[c] - together);
            }
        }
    }
}
