/* `auto` from Y'CbCr codes to half floats in one pass, a line of the picture at a time.

   A line's codes, chroma and maps stay in the first caches; nothing is brought up for a line of which
   nothing stands open, and a block of places where nothing happens goes to halves as it is. */

#include "auto_gains.h"
#include "light.h"
#include "upsampling.h"

/* What `sizes` and `light` have by number: see compiled_auto.auto_from_codes. */
enum { BYTES, WIDTH, CHROMA_WIDTH, CHROMA_HEIGHT, FIRST, ROWS, SITE_X, SITE_Y, PLANES, SMALL_HEIGHT,
       SMALL_WIDTH, GUARDS };
enum { LEVELS, MATRIX = 4, EXPONENT = 8, SCALE, OFFSET, STRENGTH };

/* Whether anything of a block stands open. */
INLINE int is_bright(float rgb[3][BLOCK], float from)
{
    int bright = 0;
    for (int64_t x = 0; x < BLOCK; x++)
        bright |= (rgb[0][x] > from) | (rgb[1][x] > from) | (rgb[2][x] > from);
    return bright;
}

/* See native.auto_from_codes. */
CLONED void itmo_auto_from_codes(const uint8_t *luma, const uint8_t *cb, const uint8_t *cr,
                                 int64_t luma_stride, const int64_t *chroma_strides,
                                 const int64_t *sizes, const float *light, const float *small,
                                 const int64_t *above, const float *parts, const int32_t *starts,
                                 const float *shares, const int64_t *which, const float *n,
                                 float *scratch, uint16_t *out_red, uint16_t *out_green,
                                 uint16_t *out_blue)
{
    Picture picture = {luma, {cb, cr}, luma_stride, {chroma_strides[0], chroma_strides[1]},
                       sizes[BYTES], sizes[WIDTH], sizes[CHROMA_WIDTH], sizes[CHROMA_HEIGHT],
                       sizes[SITE_X], sizes[SITE_Y], light + LEVELS};
    int64_t width = sizes[WIDTH], planes = sizes[PLANES], h = sizes[SMALL_HEIGHT];
    int64_t w = sizes[SMALL_WIDTH], chroma_width = sizes[CHROMA_WIDTH], guards = sizes[GUARDS];
    int64_t across = (width + AT_ONCE + BLOCK) / BLOCK * BLOCK, curves = which[3] >= 0;
    float strength = light[STRENGTH], exponent = light[EXPONENT];
    float *y = scratch, *wide[2] = {y + across, y + 2 * across}, *ratio = y + 3 * across;
    float *code = y + 4 * across, *full = y + 5 * across, *lefts = full + planes * across;
    float *steps = lefts + planes * (w + 1), *line = steps + planes * (w + 1);
    uint16_t *out[3] = {out_red, out_green, out_blue};
    for (int64_t row = 0; row < sizes[ROWS]; row++) {
        int64_t at = sizes[FIRST] + row;
        int brought_up = planes == 0;
        code_lines(&picture, at, line, y, wide);
        for (int64_t i = 0; i < width; i += BLOCK) {
            int64_t size = width - i < BLOCK ? width - i : BLOCK;
            float rgb[3][BLOCK], gains[3][BLOCK], products[BLOCK];
            to_rgb(y + i, wide[0] + i, wide[1] + i, light + MATRIX, BLOCK, rgb[0], rgb[1], rgb[2]);
            for (int c = 0; c < 3; c++)
                to_light(rgb[c], BLOCK, exponent);
            int made = 0;
            if (curves || is_bright(rgb, n[OPEN_FROM])) {
                if (!brought_up) {
                    lines_between(small, planes, h, w, above[row], parts[row], lefts, steps);
                    widen(lefts, steps, planes, w, across, starts, shares, full);
                    if (guards && curves) {
                        levels_of(luma + at * luma_stride, sizes[BYTES], light[SCALE], light[OFFSET],
                                  width, code);
                        guard_line(full, full + across, code, width, ratio);
                    }
                    brought_up = 1;
                }
                const float *here[3] = {rgb[0], rgb[1], rgb[2]}, *maps[4];
                for (int m = 0; m < 4; m++)
                    maps[m] = which[m] < 0 ? 0 : full + which[m] * across + i;
                made = gain_block(here, guards && curves ? ratio + i : 0, maps, n, BLOCK, gains);
            }
            for (int c = 0; strength != 1 && c < made; c++)
                for (int64_t x = 0; x < BLOCK; x++)
                    gains[c][x] = (gains[c][x] - 1) * strength + 1;
            for (int c = 0; c < 3; c++) {
                const float *gain = gains[made > 1 ? c : 0];
                for (int64_t x = 0; made && x < BLOCK; x++)
                    products[x] = rgb[c][x] * gain[x];
                itmo_halves(made ? products : rgb[c], size, out[c] + row * width + i);
            }
        }
    }
}
