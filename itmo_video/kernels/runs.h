/* The steps of itmo_to_codes, each for a run of pixels of one line. */

#ifndef ITMO_RUNS_H
#define ITMO_RUNS_H

#include "curves.h"

enum { TILE = 256, RUN = TILE / 2 }; /* pixels across a tile of noise, and pixels at a time */

/* The indices of `sizes` and `numbers`: see compiled_codes._to_codes. */
enum { BYTES, WIDTH, HEIGHT, COLUMNS, ROWS, ACROSS, DOWN, CURVE, NOISE_AT };
enum { MATRIX, PEAK = 9, HLG_POWER, DISPLAY_PEAK, KR, KB, LUMA, CHROMA = 16, LEAST = 18, MOST };
enum { AS_IT_IS, PQ, HLG };

/* A run of halves or floats as floats; the last pixel is repeated beyond the end of the line. */
INLINE void load_run(const uint8_t *line, int64_t bytes, int64_t left, float *restrict out)
{
    int16_t halves[RUN];
    if (bytes == 4)
        memcpy(out, line, 4 * (size_t)left);
    else if (left < RUN)
        line = memcpy(memset(halves, 0, sizeof halves), line, 2 * (size_t)left);
    const int16_t *from = (const int16_t *)line;
    for (int64_t x = 0; bytes == 2 && x < RUN; x++) {
        /* Exact, for subnormal halves, too; infinity becomes 65536. */
        int32_t bits = (int32_t)((uint32_t)(int32_t)from[x] << 13 & 0x8fffe000);
        float value;
        memcpy(&value, &bits, 4);
        out[x] = value * 0x1p112f;
    }
    for (int64_t x = left; x < RUN; x++)
        out[x] = out[left - 1];
}

/* Nits times the factor for each pixel's max(R, G, B), `most`, which is updated. */
INLINE void to_display(float rgb[3][RUN], const float *factors, float peak, float *restrict most)
{
    float factor[RUN];
    for (int64_t x = 0; x < RUN; x++)
        factor[x] = factors[half_of(most[x])], most[x] = 0;
    for (int c = 0; c < 3; c++)
        for (int64_t x = 0; x < RUN; x++) {
            rgb[c][x] = between(rgb[c][x] * factor[x], 0, peak);
            most[x] = rgb[c][x] > most[x] ? rgb[c][x] : most[x];
        }
}

/* Add the maximum and the sum of the first `left` nits, none below 0, to the light levels. The order
   of the sum does not depend on the width of vectors. */
INLINE void add_light(float most[RUN], int64_t left, double *light)
{
    for (int64_t x = left; x < RUN; x++)
        most[x] = 0;
    int32_t top = 0, bits; /* floats from 0 up are ordered like their bits as integers */
    for (int64_t x = 0; x < RUN; x++) {
        memcpy(&bits, most + x, 4);
        top = bits > top ? bits : top;
    }
    float greatest;
    memcpy(&greatest, &top, 4);
    for (int64_t half = RUN / 2; half > 0; half /= 2)
        for (int64_t x = 0; x < half; x++)
            most[x] += most[x + half];
    light[0] = (double)greatest > light[0] ? (double)greatest : light[0];
    light[1] += (double)most[0];
}

/* Linear light to nits in BT.2020, limited to the peak; updates the light levels. */
INLINE void to_nits(float rgb[3][RUN], const float *n, const float *factors, int64_t left,
                    double *light)
{
    float most[RUN];
    float *restrict red = rgb[0], *restrict green = rgb[1], *restrict blue = rgb[2];
    const float *m = n + MATRIX, peak = n[PEAK];
    for (int64_t x = 0; x < RUN; x++) {
        float r = red[x], g = green[x], b = blue[x];
        red[x] = between(FMA(m[2], b, FMA(m[1], g, m[0] * r)), 0, peak);
        green[x] = between(FMA(m[5], b, FMA(m[4], g, m[3] * r)), 0, peak);
        blue[x] = between(FMA(m[8], b, FMA(m[7], g, m[6] * r)), 0, peak);
        float more = red[x] > green[x] ? red[x] : green[x];
        most[x] = more > blue[x] ? more : blue[x];
    }
    if (factors)
        to_display(rgb, factors, n[DISPLAY_PEAK], most);
    add_light(most, left, light);
}

/* Display light to the square root of scene light, 0 to 1: BT.2100's inverse OOTF, without black lift. */
INLINE void to_scene_root(float rgb[3][RUN], const float *n)
{
    const float per_peak = 1 / n[PEAK], power = n[HLG_POWER];
    for (int64_t x = 0; x < RUN; x++) {
        float y = FMA(0.0593017f, rgb[2][x], FMA(0.6779981f, rgb[1][x], 0.2627002f * rgb[0][x]));
        y *= per_peak;
        float stops = rough_log_two(y > 1e-8f ? y : 1e-8f) * power;
        float scale = two_to(stops, nearest(stops)) * per_peak;
        for (int c = 0; c < 3; c++)
            rgb[c][x] = sqrtf(between(rgb[c][x] * scale, 0, 1));
    }
}

/* Values times scale, plus noise and offset, rounded to codes: the first `kept` of `count`. */
INLINE void quantised(const float *values, int64_t count, float scale, float offset, const float *n,
                      const float *noise, int64_t kept, uint16_t *out)
{
    const float least = n[LEAST] + 0.5f, most = n[MOST] + 0.5f;
    uint16_t codes[RUN];
    offset += 0.5f;
    for (int64_t x = 0; x < count; x++)
        codes[x] = (uint16_t)(int32_t)between(FMA(values[x], scale, noise[x]) + offset, least, most);
    memcpy(out, codes, 2 * (size_t)kept);
}

/* Nits, or the root of scene light, by the curve to luma, blue minus luma and red minus luma. */
INLINE void to_luma(float rgb[3][RUN], const float *n, int64_t curve, float *restrict y,
                    float *restrict blue_apart, float *restrict red_apart)
{
    const float kr = n[KR], kb = n[KB], kg = 1 - kr - kb;
    float *all = rgb[0], *red = rgb[0], *green = rgb[1], *blue = rgb[2];
    for (int64_t x = 0; curve == PQ && x < 3 * RUN; x++)
        all[x] = pq_of(all[x]);
    for (int64_t x = 0; curve == HLG && x < 3 * RUN; x++)
        all[x] = hlg_of_root(all[x]);
    for (int64_t x = 0; x < RUN; x++) {
        float r = red[x], g = green[x], b = blue[x];
        float luma = FMA(kb, b, FMA(kg, g, kr * r));
        y[x] = luma, blue_apart[x] = b - luma, red_apart[x] = r - luma;
    }
}

#endif
