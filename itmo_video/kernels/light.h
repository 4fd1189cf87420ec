/* Y'CbCr codes to linear light, a line at a time: the first step of several kernels. */

#ifndef ITMO_LIGHT_H
#define ITMO_LIGHT_H

#include "vectors.h"

/* One line of codes, (code * own + other * share - black) * scale for a line and its neighbour; the
   sum of the two is exact. */
INLINE void line_of(const uint8_t *here, const uint8_t *neighbour, int64_t width, int64_t bytes,
                    float share, float black, float scale, float *restrict out)
{
    float own = 1 - share;
    if (bytes == 1)
        for (int64_t x = 0; x < width; x++)
            out[x] = ((float)here[x] * own + (float)neighbour[x] * share - black) * scale;
    else {
        const uint16_t *wide = (const uint16_t *)here, *beside = (const uint16_t *)neighbour;
        for (int64_t x = 0; x < width; x++)
            out[x] = ((float)wide[x] * own + (float)beside[x] * share - black) * scale;
    }
}

/* One line of codes, (code - black) * scale. */
INLINE void plain_line(const uint8_t *codes, int64_t width, int64_t bytes, float black, float scale,
                       float *restrict out)
{
    const uint16_t *wide = (const uint16_t *)codes;
    for (int64_t x = 0; bytes == 1 && x < width; x++)
        out[x] = ((float)codes[x] - black) * scale;
    for (int64_t x = 0; bytes == 2 && x < width; x++)
        out[x] = ((float)wide[x] - black) * scale;
}

INLINE void to_rgb(const float *y, const float *cb, const float *cr, const float *matrix, int64_t width,
                   float *restrict red, float *restrict green, float *restrict blue)
{
    float cr_red = matrix[0], cb_blue = matrix[1], cr_green = matrix[2], cb_green = matrix[3];
    for (int64_t x = 0; x < width; x++) {
        red[x] = cr[x] * cr_red + y[x];
        blue[x] = cb[x] * cb_blue + y[x];
        green[x] = cb[x] * cb_green + (cr[x] * cr_green + y[x]);
    }
}

/* Double a line, by the weights that even pixels have for the sample before and odd ones for the
   sample after; `line` has one more sample at either end. */
INLINE void double_line(const float *line, int64_t width, float before, float behind,
                        float *restrict out)
{
    for (int64_t x = 0; x < width; x++) {
        out[2 * x] = line[x + 1] * (1 - before) + line[x] * before;
        out[2 * x + 1] = line[x + 1] * (1 - behind) + line[x + 2] * behind;
    }
}

/* The weights of the sample before for even, and of the one after for odd pixels, by the siting. */
static const float LEAN_BEFORE[3] = {0, 0.25f, 0.5f}, LEAN_BEHIND[3] = {0.5f, 0.25f, 0};

/* A picture in Y'CbCr: `bytes` per code, chroma sited as in compiled_light.ycbcr_rows. */
typedef struct {
    const uint8_t *luma, *chroma[2];
    int64_t luma_stride, chroma_strides[2], bytes, width, chroma_width, chroma_height, site_x, site_y;
    const float *levels;
} Picture;

/* Line `at` of the picture: luma into `y`, chroma as wide into `wide`; `line` holds chroma_width + 2. */
INLINE void code_lines(const Picture *p, int64_t at, float *line, float *y, float *const *wide)
{
    int64_t here = p->site_y < 0 ? at : at / 2, beside = here;
    float share = 0;
    if (p->site_y >= 0) {
        share = at % 2 ? LEAN_BEHIND[p->site_y] : LEAN_BEFORE[p->site_y];
        beside = at % 2 ? here + 1 : here - 1;
        beside = beside < 0 ? 0 : beside < p->chroma_height ? beside : p->chroma_height - 1;
    }
    for (int c = 0; c < 2; c++) {
        const uint8_t *plane = p->chroma[c];
        int64_t stride = p->chroma_strides[c];
        line_of(plane + here * stride, plane + beside * stride, p->chroma_width, p->bytes, share,
                p->levels[2], p->levels[3], p->site_x < 0 ? wide[c] : line + 1);
        if (p->site_x < 0)
            continue;
        line[0] = line[1];
        line[p->chroma_width + 1] = line[p->chroma_width];
        double_line(line, p->chroma_width, LEAN_BEFORE[p->site_x], LEAN_BEHIND[p->site_x], wide[c]);
    }
    plain_line(p->luma + at * p->luma_stride, p->width, p->bytes, p->levels[0], p->levels[1], y);
}

#endif
