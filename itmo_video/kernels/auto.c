/* The gains of `auto`, alone or times the picture as half floats. */

#include "auto_gains.h"
#include "vectors.h"

/* See compiled_auto.ramps. */
CLONED void itmo_ramps(const float *values, float low, float scale, int64_t count,
                       float *restrict out)
{
    for (int64_t x = 0; x < count; x++)
        out[x] = ramp_of(values[x], low, scale);
}

/* A picture of `rows` x `width`, and where its maps and ratio are: pointers to the first line. */
typedef struct {
    const float *rgb[3], *ratio, *maps[4];
    int64_t rows, width;
} Given;

/* The gains of up to BLOCK pixels from `at` on in a line, as gain_block's; lines come in order. */
INLINE int gains_at(const Given *p, Separation *s, int64_t row, int64_t at, int64_t size,
                    const float *n, float gains[3][BLOCK])
{
    float apart[3][BLOCK];
    const float *here[3], *maps[4];
    for (int64_t line = row ? row + 1 : 0; !at && line <= row + 1 && line < p->rows; line++) {
        const float *whole[3];
        for (int c = 0; c < 3; c++)
            whole[c] = p->rgb[c] + line * p->width;
        add_line(s, line, whole, n);
    }
    for (int c = 0; c < 3; c++)
        here[c] = p->rgb[c] + row * p->width + at;
    for (int m = 0; m < 4; m++)
        maps[m] = p->maps[m] ? p->maps[m] + row * p->width + at : 0;
    int parts = separation_at(s, row, p->rows - 1, at, size, apart);
    return gain_block(here, p->ratio ? p->ratio + row * p->width + at : 0, maps, parts ? apart : 0, n,
                      size, gains);
}

/* See compiled_auto.gain_auto. */
CLONED void itmo_gain_auto(const float *red, const float *green, const float *blue, const float *ratio,
                           const float *map_red, const float *map_green, const float *map_blue,
                           const float *map_curve, const float *n, int64_t rows, int64_t width,
                           float *scratch, float *restrict out_red, float *restrict out_green,
                           float *restrict out_blue)
{
    Given given = {{red, green, blue}, ratio, {map_red, map_green, map_blue, map_curve}, rows, width};
    Separation separation = separation_of(scratch, width);
    float *out[3] = {out_red, out_green, out_blue}, gains[3][BLOCK];
    for (int64_t row = 0; row < rows; row++)
        for (int64_t i = 0; i < width; i += BLOCK) {
            int64_t size = width - i < BLOCK ? width - i : BLOCK;
            int made = gains_at(&given, &separation, row, i, size, n, gains);
            for (int c = 0; c < 3; c++)
                for (int64_t x = 0; x < size; x++)
                    out[c][row * width + i + x] = made ? gains[made > 1 ? c : 0][x] : 1;
        }
}

/* See compiled_auto.expand_auto. */
CLONED void itmo_expand_auto(const float *red, const float *green, const float *blue,
                             const float *ratio, const float *map_red, const float *map_green,
                             const float *map_blue, const float *map_curve, const float *n,
                             float strength, int64_t rows, int64_t width, float *scratch,
                             uint16_t *restrict out_red, uint16_t *restrict out_green,
                             uint16_t *restrict out_blue)
{
    Given given = {{red, green, blue}, ratio, {map_red, map_green, map_blue, map_curve}, rows, width};
    Separation separation = separation_of(scratch, width);
    uint16_t *out[3] = {out_red, out_green, out_blue};
    float gains[3][BLOCK], products[BLOCK];
    for (int64_t row = 0; row < rows; row++)
        for (int64_t i = 0; i < width; i += BLOCK) {
            int64_t size = width - i < BLOCK ? width - i : BLOCK, first = row * width + i;
            int made = gains_at(&given, &separation, row, i, size, n, gains);
            for (int c = 0; strength != 1 && c < made; c++)
                for (int64_t x = 0; x < size; x++)
                    gains[c][x] = (gains[c][x] - 1) * strength + 1;
            for (int c = 0; c < 3; c++) {
                const float *plane = given.rgb[c] + first, *gain = gains[made > 1 ? c : 0];
                for (int64_t x = 0; made && x < size; x++)
                    products[x] = plane[x] * gain[x];
                itmo_halves(made ? products : plane, size, out[c] + first);
            }
        }
}
