/* `auto` from Y'CbCr codes to half floats in one pass, a line of the picture at a time.

   A line's codes, chroma and maps stay in the first two caches, as does the light of the line below it,
   with which channels' separation is averaged; maps are not upsampled for a line in which nothing is
   expanded, and a block of unchanged pixels is converted to halves directly. */

#include "auto_gains.h"
#include "light.h"
#include "upsampling.h"

/* The indices of `sizes` and `light`: see compiled_auto.auto_from_codes. */
enum { BYTES, WIDTH, CHROMA_WIDTH, CHROMA_HEIGHT, FIRST, ROWS, SITE_X, SITE_Y, PLANES, SMALL_HEIGHT,
       SMALL_WIDTH, GUARDS, HEIGHT };
enum { LEVELS, MATRIX = 4, SCALE = 8, OFFSET, STRENGTH };
enum { RUN = 8 * BLOCK }; /* pixels whose light is computed at a time */

/* Whether anything in a block is near white. */
INLINE int is_bright(const float *const *rgb, float from)
{
    int bright = 0;
    for (int64_t x = 0; x < BLOCK; x++)
        bright |= (rgb[0][x] > from) | (rgb[1][x] > from) | (rgb[2][x] > from);
    return bright;
}

/* Whether a map has anything in the two rows between which a line lies. */
INLINE int is_used(const uint8_t *used, int64_t above, int64_t h)
{
    return used[above] | used[above + 1 < h ? above + 1 : above];
}

/* See compiled_auto.auto_from_codes. */
CLONED void itmo_auto_from_codes(const uint8_t *luma, const uint8_t *cb, const uint8_t *cr,
                                 int64_t luma_stride, const int64_t *chroma_strides,
                                 const int64_t *sizes, const float *light, const float *power,
                                 const float *small, const int64_t *above, const float *parts,
                                 const int32_t *columns, const float *shares, const int64_t *which,
                                 const uint8_t *used, const float *n, float *scratch, uint16_t *out_red,
                                 uint16_t *out_green, uint16_t *out_blue)
{
    Picture picture = {luma, {cb, cr}, luma_stride, {chroma_strides[0], chroma_strides[1]},
                       sizes[BYTES], sizes[WIDTH], sizes[CHROMA_WIDTH], sizes[CHROMA_HEIGHT],
                       sizes[SITE_X], sizes[SITE_Y], light + LEVELS};
    int64_t width = sizes[WIDTH], planes = sizes[PLANES], h = sizes[SMALL_HEIGHT];
    int64_t w = sizes[SMALL_WIDTH];
    int64_t across = (width + AT_ONCE + RUN) / BLOCK * BLOCK;
    float strength = light[STRENGTH];
    float *y = scratch, *wide[2] = {y + across, y + 2 * across}, *ratio = y + 3 * across;
    float *code = y + 4 * across, *full = y + 5 * across, *lefts = full + planes * across;
    float *steps = lefts + planes * (w + 1) + AT_ONCE, *apart = steps + planes * (w + 1) + AT_ONCE;
    float *lights = apart + 13 * across, *line = lights + 6 * across;
    Separation separation = separation_of(apart, width);
    int64_t last = sizes[HEIGHT] - 1, next = sizes[FIRST];
    int separates = n[UNKNOWN] > 0 || which[0] >= 0 || which[1] >= 0 || which[2] >= 0;
    next -= separates && next;
    uint16_t *out[3] = {out_red, out_green, out_blue};
    for (int64_t row = 0; row < sizes[ROWS]; row++) {
        int64_t at = sizes[FIRST] + row;
        int brought_up = planes == 0, maps_used[4], something = n[UNKNOWN] > 0;
        for (int m = 0; m < 4; m++) {
            maps_used[m] = which[m] >= 0 && is_used(used + which[m] * h, above[row], h);
            something |= maps_used[m];
        }
        int curves = maps_used[3], guards = sizes[GUARDS] && curves;
        /* The line below is needed, too, before this one's light is multiplied in place. */
        for (int64_t to = at < last && separates ? at + 1 : at; next <= to; next++) {
            float *whole = lights + next % 2 * 3 * across;
            const float *planes_of[3] = {whole, whole + across, whole + 2 * across};
            code_lines(&picture, next, line, y, wide);
            for (int64_t begin = 0; begin < width; begin += RUN) {
                int64_t left = width - begin, size = left < RUN ? (left + BLOCK - 1) / BLOCK * BLOCK : RUN;
                float *red = whole + begin;
                to_rgb(y + begin, wide[0] + begin, wide[1] + begin, light + MATRIX, size, red,
                       red + across, red + 2 * across);
                for (int c = 0; c < 3; c++)
                    itmo_power(red + c * across, size, power);
            }
            if (separates)
                add_line(&separation, next, planes_of, n);
        }
        for (int64_t begin = 0; begin < width; begin += RUN) {
            int64_t left = width - begin < RUN ? width - begin : RUN;
            int64_t blocks = (left + BLOCK - 1) / BLOCK, size = blocks * BLOCK;
            float *rgb = lights + at % 2 * 3 * across + begin, gains[3][BLOCK], open[3][BLOCK];
            for (int64_t i = 0; i < size; i += BLOCK) {
                const float *here[3] = {rgb + i, rgb + across + i, rgb + 2 * across + i}, *maps[4];
                if (!something || (!curves && !is_bright(here, n[OPEN_FROM])))
                    continue;
                if (!brought_up) {
                    lines_between(small, planes, h, w, above[row], parts[row], lefts, steps);
                    itmo_widen(lefts, steps, planes, w, across, columns, shares, width, full);
                    if (guards) {
                        levels_of(luma + at * luma_stride, sizes[BYTES], light[SCALE], light[OFFSET],
                                  width, code);
                        guard_line(full, full + across, code, width, ratio);
                    }
                    brought_up = 1;
                }
                for (int m = 0; m < 4; m++)
                    maps[m] = !maps_used[m] ? 0 : full + which[m] * across + begin + i;
                int64_t size_here = width - begin - i < BLOCK ? width - begin - i : BLOCK;
                int opens = separates &&
                            separation_at(&separation, at, last, begin + i, size_here, open);
                int made = gain_block(here, guards ? ratio + begin + i : 0, maps, opens ? open : 0, n,
                                      BLOCK, gains);
                for (int c = 0; strength != 1 && c < made; c++)
                    for (int64_t x = 0; x < BLOCK; x++)
                        gains[c][x] = (gains[c][x] - 1) * strength + 1;
                for (int c = 0; made && c < 3; c++) {
                    float *plane = rgb + c * across + i;
                    for (int64_t x = 0; x < BLOCK; x++)
                        plane[x] *= gains[made > 1 ? c : 0][x];
                }
            }
            for (int c = 0; c < 3; c++)
                itmo_halves(rgb + c * across, left, out[c] + row * width + begin);
        }
    }
}
