/* From Y'CbCr codes to linear light, and from that by a gain to half floats. */

#include "numbers.h"

/* x to the power g, for x from 1e-8 to 1 and g from 1 to 4, within 6e-6, and 1 of 1.

   2 to the power g log2 x. The logarithm of a mantissa m around 1 by its series in (m - 1) / (m + 1),
   the power of a fraction by its own; fma is the same on every machine. */
INLINE float power(float x, float g)
{
    int32_t bits, mantissa_bits;
    float mantissa;
    memcpy(&bits, &x, 4);
    int32_t exponent = (bits - 0x3f3504f3) >> 23; /* the mantissa between the roots of 1/2 and 2 */
    mantissa_bits = bits - exponent * (1 << 23);
    memcpy(&mantissa, &mantissa_bits, 4);
    float s = (mantissa - 1) / (mantissa + 1), q = s * s;
    float series = FMA(FMA(FMA(FMA(0.32059889f, q, 0.41219859f), q, 0.57707802f), q, 0.96179669f),
                        q, 2.88539008f);
    float whole_and_rest = g * FMA(s, series, (float)exponent);
    /* The nearest whole, as none is above 0. */
    return two_to(whole_and_rest, (int32_t)(whole_and_rest - 0.5f));
}

/* One line of codes, (code * own + other * share - black) / span for a line and its neighbour. */
INLINE void line_of(const uint8_t *here, const uint8_t *neighbour, int64_t width, int64_t bytes,
                    float share, float black, float span, float *restrict out)
{
    float own = 1 - share;
    if (bytes == 1)
        for (int64_t x = 0; x < width; x++)
            out[x] = ((float)here[x] * own + (float)neighbour[x] * share - black) / span;
    else {
        const uint16_t *wide = (const uint16_t *)here, *beside = (const uint16_t *)neighbour;
        for (int64_t x = 0; x < width; x++)
            out[x] = ((float)wide[x] * own + (float)beside[x] * share - black) / span;
    }
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

INLINE void to_light(float *restrict values, int64_t width, float exponent)
{
    for (int64_t x = 0; x < width; x++) {
        float light = power(between(values[x], 1e-8f, 1), exponent);
        values[x] = light > 1e-15f ? light : 0;
    }
}

/* One line to twice as many, by the shares that even places have of the one before and odd ones of
   the one behind; `line` has a place more at either end. */
INLINE void double_line(const float *line, int64_t width, float before, float behind,
                        float *restrict out)
{
    for (int64_t x = 0; x < width; x++) {
        out[2 * x] = line[x + 1] * (1 - before) + line[x] * before;
        out[2 * x + 1] = line[x + 1] * (1 - behind) + line[x + 2] * behind;
    }
}

/* How far even and odd places lean on the sample before and on the one behind, by the siting. */
static const float LEAN_BEFORE[3] = {0, 0.25f, 0.5f}, LEAN_BEHIND[3] = {0.5f, 0.25f, 0};

/* See native.ycbcr_rows. */
CLONED void itmo_ycbcr_rows(const uint8_t *luma, const uint8_t *cb, const uint8_t *cr,
                            int64_t luma_stride, const int64_t *chroma_strides, int64_t bytes,
                            int64_t width, int64_t chroma_width, int64_t chroma_height, int64_t first,
                            int64_t rows, int64_t site_x, int64_t site_y, const float *levels,
                            const float *matrix, float exponent, float *scratch, float *red,
                            float *green, float *blue)
{
    float *line = scratch, *wide[2] = {line + chroma_width + 2, line + 3 * chroma_width + 2};
    float *y = wide[1] + 2 * chroma_width;
    for (int64_t row = 0; row < rows; row++) {
        int64_t at = first + row, here = site_y < 0 ? at : at / 2, beside = here;
        float share = 0;
        if (site_y >= 0) {
            share = at % 2 ? LEAN_BEHIND[site_y] : LEAN_BEFORE[site_y];
            beside = at % 2 ? here + 1 : here - 1;
            beside = beside < 0 ? 0 : beside < chroma_height ? beside : chroma_height - 1;
        }
        for (int c = 0; c < 2; c++) {
            const uint8_t *plane = c ? cr : cb;
            int64_t stride = chroma_strides[c];
            float *restrict out = wide[c];
            line_of(plane + here * stride, plane + beside * stride, chroma_width, bytes, share,
                    levels[2], levels[3], site_x < 0 ? out : line + 1);
            if (site_x < 0)
                continue;
            line[0] = line[1];
            line[chroma_width + 1] = line[chroma_width];
            double_line(line, chroma_width, LEAN_BEFORE[site_x], LEAN_BEHIND[site_x], out);
        }
        line_of(luma + at * luma_stride, luma + at * luma_stride, width, bytes, 0, levels[0], levels[1], y);
        float *line_out[3] = {red + row * width, green + row * width, blue + row * width};
        to_rgb(y, wide[0], wide[1], matrix, width, line_out[0], line_out[1], line_out[2]);
        for (int c = 0; exponent > 0 && c < 3; c++)
            to_light(line_out[c], width, exponent);
    }
}

/* See native.drive. */
CLONED void itmo_drive(const float *red, const float *green, const float *blue, const float *weights,
                       const float *ratio, int64_t count, float *restrict out)
{
    for (int64_t i = 0; i < count; i++) {
        float light = (red[i] * weights[0] + green[i] * weights[1]) + blue[i] * weights[2];
        out[i] = between(ratio ? light * ratio[i] : light, 0, 1);
    }
}

/* ---- gain, to half floats ---- */

/* See native.gain_banterle2006. */
CLONED void itmo_gain_banterle2006(const float *luminance, float slope, float factor, int64_t count,
                                   float *restrict out)
{
    for (int64_t i = 0; i < count; i++) {
        float rest = 1 - luminance[i];
        out[i] = factor / (sqrtf(rest * rest + slope * luminance[i]) + rest);
    }
}

INLINE void to_halves(const float *values, const float *gain, int64_t count, uint16_t *restrict out)
{
    for (int64_t x = 0; x < count; x++)
        out[x] = half_of(values[x] * gain[x]);
}

/* See native.expand. */
CLONED void itmo_expand(const float *red, const float *green, const float *blue, const float *gain,
                        const float *map, float base, float strength, float rest, int64_t count,
                        uint16_t *red_out, uint16_t *green_out, uint16_t *blue_out)
{
    enum { BLOCK = 512 };
    float weighed[BLOCK];
    for (int64_t i = 0; i < count; i += BLOCK) {
        int64_t size = count - i < BLOCK ? count - i : BLOCK;
        for (int64_t x = 0; x < size; x++)
            weighed[x] = (gain[i + x] - base) * map[i + x] * strength + rest;
        to_halves(red + i, weighed, size, red_out + i);
        to_halves(green + i, weighed, size, green_out + i);
        to_halves(blue + i, weighed, size, blue_out + i);
    }
}
