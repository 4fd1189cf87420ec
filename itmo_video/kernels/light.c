/* From Y'CbCr codes to linear light, and on to half floats by a gain. */

#include "light.h"

/* See compiled_light.ycbcr_rows. */
CLONED void itmo_ycbcr_rows(const uint8_t *luma, const uint8_t *cb, const uint8_t *cr,
                            int64_t luma_stride, const int64_t *chroma_strides, int64_t bytes,
                            int64_t width, int64_t chroma_width, int64_t chroma_height, int64_t first,
                            int64_t rows, int64_t site_x, int64_t site_y, const float *levels,
                            const float *matrix, const float *power, float *scratch, float *red,
                            float *green, float *blue)
{
    float *line = scratch, *wide[2] = {line + chroma_width + 2, line + 3 * chroma_width + 2};
    float *y = wide[1] + 2 * chroma_width;
    Picture picture = {luma, {cb, cr}, luma_stride, {chroma_strides[0], chroma_strides[1]}, bytes,
                       width, chroma_width, chroma_height, site_x, site_y, levels};
    for (int64_t row = 0; row < rows; row++) {
        code_lines(&picture, first + row, line, y, wide);
        float *line_out[3] = {red + row * width, green + row * width, blue + row * width};
        to_rgb(y, wide[0], wide[1], matrix, width, line_out[0], line_out[1], line_out[2]);
        for (int c = 0; power && c < 3; c++)
            itmo_power(line_out[c], width, power);
    }
}

/* See compiled_light.halved_light. */
CLONED void itmo_halved_light(const uint8_t *luma, const uint8_t *cb, const uint8_t *cr,
                              int64_t luma_stride, const int64_t *chroma_strides, int64_t bytes,
                              int64_t width, int64_t chroma_width, int64_t chroma_height,
                              int64_t first, int64_t rows, int64_t site_x, int64_t site_y,
                              const float *levels, const float *matrix, const float *power,
                              float *scratch, float *red, float *green, float *blue)
{
    enum { BLOCK = 256 }; /* pixels of both lines at a time, which stay in the first cache */
    float *line = scratch, *next = line + chroma_width + 2, *y[2], *wide[2][2], rgb[6 * BLOCK];
    for (int k = 0; k < 2; k++) {
        y[k] = next, wide[k][0] = y[k] + width, wide[k][1] = wide[k][0] + 2 * chroma_width;
        next = wide[k][1] + 2 * chroma_width;
    }
    Picture picture = {luma, {cb, cr}, luma_stride, {chroma_strides[0], chroma_strides[1]}, bytes,
                       width, chroma_width, chroma_height, site_x, site_y, levels};
    int64_t half = width / 2;
    float *out[3] = {red, green, blue};
    for (int64_t row = 0; row < rows; row++) {
        for (int k = 0; k < 2; k++)
            code_lines(&picture, 2 * (first + row) + k, line, y[k], wide[k]);
        for (int64_t at = 0; at < width; at += BLOCK) {
            int64_t size = width - at < BLOCK ? width - at : BLOCK;
            for (int k = 0; k < 2; k++) {
                float *part = rgb + 3 * size * k;
                to_rgb(y[k] + at, wide[k][0] + at, wide[k][1] + at, matrix, size, part, part + size,
                       part + 2 * size);
            }
            itmo_power(rgb, 6 * size, power);
            for (int c = 0; c < 3; c++) {
                const float *above = rgb + c * size, *below = above + 3 * size;
                float *restrict to = out[c] + row * half + at / 2;
                for (int64_t x = 0; x < size / 2; x++)
                    to[x] = ((above[2 * x] + above[2 * x + 1]) + (below[2 * x] + below[2 * x + 1])) *
                            0.25f;
            }
        }
    }
}

/* See compiled.weighted_sum. */
CLONED void itmo_weighted_sum(const float *red, const float *green, const float *blue,
                              const float *weights, const float *ratio, int64_t count,
                              float *restrict out)
{
    for (int64_t i = 0; i < count; i++) {
        float light = (red[i] * weights[0] + green[i] * weights[1]) + blue[i] * weights[2];
        out[i] = between(ratio ? light * ratio[i] : light, 0, 1);
    }
}

/* ---- gain, to half floats ---- */

/* See compiled.gain_banterle2006. */
CLONED void itmo_gain_banterle2006(const float *luminance, float slope, float factor, int64_t count,
                                   float *restrict out)
{
    for (int64_t i = 0; i < count; i++) {
        float rest = 1 - luminance[i];
        out[i] = factor / (sqrtf(rest * rest + slope * luminance[i]) + rest);
    }
}

/* See compiled.expand. */
CLONED void itmo_expand(const float *red, const float *green, const float *blue, const float *gain,
                        const float *map, float base, float strength, float rest, int64_t count,
                        uint16_t *red_out, uint16_t *green_out, uint16_t *blue_out)
{
    enum { BLOCK = 512 };
    const float *planes[3] = {red, green, blue};
    uint16_t *out[3] = {red_out, green_out, blue_out};
    float weighed[BLOCK], products[BLOCK];
    for (int64_t i = 0; i < count; i += BLOCK) {
        int64_t size = count - i < BLOCK ? count - i : BLOCK;
        for (int64_t x = 0; x < size; x++)
            weighed[x] = (gain[i + x] - base) * map[i + x] * strength + rest;
        for (int c = 0; c < 3; c++) {
            for (int64_t x = 0; x < size; x++)
                products[x] = planes[c][i + x] * weighed[x];
            itmo_halves(products, size, out[c] + i);
        }
    }
}
