/* The gains of `auto`, alone or times the picture as half floats. */

#include "auto_gains.h"
#include "vectors.h"

/* See compiled_auto.ramps. */
CLONED void itmo_ramps(const float *values, float low, float scale, int64_t count,
                       float *restrict out)
{
    for (int64_t x = 0; x < count; x++) {
        float t = between((values[x] - low) * scale, 0, 1);
        out[x] = t * t * (3 - 2 * t);
    }
}

/* The part of a strip that a block covers: the start of its planes. */
INLINE void begin(const float *const *planes, int count, int64_t at, const float **out)
{
    for (int p = 0; p < count; p++)
        out[p] = planes[p] ? planes[p] + at : 0;
}

/* See compiled_auto.gain_auto. */
CLONED void itmo_gain_auto(const float *red, const float *green, const float *blue, const float *ratio,
                           const float *map_red, const float *map_green, const float *map_blue,
                           const float *map_curve, const float *n, int64_t count,
                           float *restrict out_red, float *restrict out_green,
                           float *restrict out_blue)
{
    const float *rgb[3] = {red, green, blue};
    const float *maps[4] = {map_red, map_green, map_blue, map_curve};
    float *out[3] = {out_red, out_green, out_blue}, gains[3][BLOCK];
    for (int64_t i = 0; i < count; i += BLOCK) {
        int64_t size = count - i < BLOCK ? count - i : BLOCK;
        const float *here[3], *known[4];
        begin(rgb, 3, i, here);
        begin(maps, 4, i, known);
        int made = gain_block(here, ratio ? ratio + i : 0, known, n, size, gains);
        for (int c = 0; c < 3; c++)
            for (int64_t x = 0; x < size; x++)
                out[c][i + x] = made ? gains[made > 1 ? c : 0][x] : 1;
    }
}

/* See compiled_auto.expand_auto. */
CLONED void itmo_expand_auto(const float *red, const float *green, const float *blue,
                             const float *ratio, const float *map_red, const float *map_green,
                             const float *map_blue, const float *map_curve, const float *n,
                             float strength, int64_t count, uint16_t *restrict out_red,
                             uint16_t *restrict out_green, uint16_t *restrict out_blue)
{
    const float *rgb[3] = {red, green, blue};
    const float *maps[4] = {map_red, map_green, map_blue, map_curve};
    uint16_t *out[3] = {out_red, out_green, out_blue};
    float gains[3][BLOCK], products[BLOCK];
    for (int64_t i = 0; i < count; i += BLOCK) {
        int64_t size = count - i < BLOCK ? count - i : BLOCK;
        const float *here[3], *known[4];
        begin(rgb, 3, i, here);
        begin(maps, 4, i, known);
        int made = gain_block(here, ratio ? ratio + i : 0, known, n, size, gains);
        for (int c = 0; strength != 1 && c < made; c++)
            for (int64_t x = 0; x < size; x++)
                gains[c][x] = (gains[c][x] - 1) * strength + 1;
        for (int c = 0; c < 3; c++) {
            const float *plane = here[c], *gain = gains[made > 1 ? c : 0];
            for (int64_t x = 0; made && x < size; x++)
                products[x] = plane[x] * gain[x];
            itmo_halves(made ? products : plane, size, out[c] + i);
        }
    }
}
