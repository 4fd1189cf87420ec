/* From Y'CbCr codes to linear light, and from that by a gain to half floats. */

#include "loops.h"

/* 2 to the power x, from -126 to 127, within 2e-7; `whole` is a whole number near x. */
INLINE float two_to(float x, int32_t whole)
{
    float f = x - (float)whole, scale;
    float p = FMA(FMA(FMA(FMA(FMA(FMA(0.00015469f, f, 0.00133336f), f, 0.00961813f), f, 0.05550411f),
                             f, 0.24022651f), f, 0.69314718f), f, 1);
    int32_t scale_bits = (whole + 127) * (1 << 23);
    memcpy(&scale, &scale_bits, 4);
    return p * scale;
}

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

/* The nearest whole number to x from -1000 to 1000, or the next; without a branch. */
INLINE int32_t nearest(float x)
{
    return (int32_t)(x + 1000.5f) - 1000;
}

/* The binary logarithm of x from 1e-8 on, within 4e-7. */
INLINE float log_two(float x)
{
    int32_t bits, mantissa_bits;
    float mantissa;
    memcpy(&bits, &x, 4);
    int32_t exponent = (bits - 0x3f3504f3) >> 23;
    mantissa_bits = bits - exponent * (1 << 23);
    memcpy(&mantissa, &mantissa_bits, 4);
    float s = (mantissa - 1) / (mantissa + 1), q = s * s;
    float series = FMA(FMA(FMA(FMA(0.32059889f, q, 0.41219859f), q, 0.57707802f), q, 0.96179669f),
                        q, 2.88539008f);
    return FMA(s, series, (float)exponent);
}

/* See native.gain_auto; 64 places at most. `n` holds from, centre, slope, low, white, apart from,
   apart wholly, whether apart, L'max, stops apart a stop of colour, clipped from, wholly. */
INLINE void gain_block(const float *const *rgb, const float *ratio, const float *const *maps,
                       const float *n, int64_t size, float *const *out)
{
    enum { BLOCK = 64 };
    float curve[BLOCK] = {0}, own[3][BLOCK], common[BLOCK], even[BLOCK];
    float most[BLOCK];
    float peak = log_two(n[8]), slope = 4 / (n[8] * n[8]), open = 1 / (n[4] - n[3]);
    float per_apart = 1 / (n[6] - n[5]), from = n[5], apart = n[7];
    float centre = n[1], steep = n[2], low = n[3];
    float per_stop = n[9], near_from = n[10], per_near = 1 / (n[11] - n[10]);
    const float *red = rgb[0], *green = rgb[1], *blue = rgb[2], *weights = maps[3];
    for (int64_t x = 0; x < size; x++)
        even[x] = 1;
    for (int64_t x = 0; ratio && x < size; x++)
        even[x] = between(ratio[x], 0.7f, 2);
    for (int64_t x = 0; weights && x < size; x++) {
        float r = between(red[x], 0, 1), g = between(green[x], 0, 1), b = between(blue[x], 0, 1);
        float greatest = r > g ? r : g, weight = weights[x] * 2.5f;
        greatest = greatest > b ? greatest : b;
        float light = (r * 0.213f + g * 0.715f + b * 0.072f + greatest) * 0.5f * even[x];
        light = between(light, 2e-3f, 1);
        float rest = 1 - light;
        float gain = log_two(2 / (sqrtf(rest * rest + slope * light) + rest));
        float room = peak - log_two(between(greatest * even[x], 2e-3f, 1)) - gain;
        room = room > 0 ? room : 0;
        float more = (weight > 1 ? weight - 1 : 0) * gain;
        float bent = (weight < 1 ? weight : 1) * gain + room * more / (room + more + 1e-6f);
        float most = peak - log_two(greatest > 2e-3f ? greatest : 2e-3f);
        curve[x] = between(bent, 0, most);
    }
    for (int c = 0; c < 3; c++) {
        const float *plane = rgb[c], *map = maps[c];
        for (int64_t x = 0; x < size; x++)
            own[c][x] = peak;
        for (int64_t x = 0; map && x < size; x++)
            own[c][x] = peak * map[x];
        for (int64_t x = 0; x < size; x++) {
            float light = between(plane[x], 0, 1), closed = (centre - light) * steep;
            float gate = 1 / (1 + two_to(closed, nearest(closed))) - low;
            float known = own[c][x] - curve[x];
            own[c][x] = (known > 0 ? known : 0) * ((gate > 0 ? gate : 0) * open);
        }
    }
    for (int64_t x = 0; x < size; x++) {
        float least = own[0][x] < own[1][x] ? own[0][x] : own[1][x];
        common[x] = least < own[2][x] ? least : own[2][x];
    }
    for (int64_t x = 0; x < size; x++) {
        float r = between(red[x], 0, 1), g = between(green[x], 0, 1), b = between(blue[x], 0, 1);
        float less = r < g ? r : g, more = r < g ? g : r, greatest = more > b ? more : b;
        float middle = more < b ? more : b;
        middle = less > middle ? less : middle;
        float least = less < b ? less : b, near = between((middle - near_from) * per_near, 0, 1);
        float above = (greatest > 1e-3f ? greatest : 1e-3f) / (least > 1e-3f ? least : 1e-3f);
        most[x] = near * near * (3 - 2 * near) * peak + per_stop * log_two(above);
    }
    for (int c = 0; c < 3; c++) {
        const float *plane = rgb[c];
        float *restrict to = out[c];
        for (int64_t x = 0; x < size; x++) {
            float t = between((plane[x] - from) * per_apart, 0, 1);
            float parted = own[c][x] - common[x];
            parted = (parted < most[x] ? parted : most[x]) * (t * t * (3 - 2 * t) * apart);
            float total = curve[x] + common[x] + parted;
            to[x] = two_to(total, nearest(total));
        }
    }
}

/* See native.gain_auto. */
CLONED void itmo_gain_auto(const float *red, const float *green, const float *blue, const float *ratio,
                           const float *map_red, const float *map_green, const float *map_blue,
                           const float *map_curve, const float *n, int64_t count,
                           float *restrict out_red, float *restrict out_green,
                           float *restrict out_blue)
{
    enum { BLOCK = 64 };
    for (int64_t i = 0; i < count; i += BLOCK) {
        int64_t size = count - i < BLOCK ? count - i : BLOCK;
        const float *rgb[3] = {red + i, green + i, blue + i};
        const float *maps[4] = {map_red ? map_red + i : 0, map_green ? map_green + i : 0,
                                map_blue ? map_blue + i : 0, map_curve ? map_curve + i : 0};
        float *out[3] = {out_red + i, out_green + i, out_blue + i};
        int active = 0;
        for (int64_t x = i; x < i + size; x++)
            active |= (red[x] > n[0]) | (green[x] > n[0]) | (blue[x] > n[0]) |
                      (map_curve ? map_curve[x] > 0 : 0);
        if (active)
            gain_block(rgb, ratio ? ratio + i : 0, maps, n, size, out);
        else
            for (int c = 0; c < 3; c++)
                for (int64_t x = 0; x < size; x++)
                    out[c][x] = 1;
    }
}

/* To the nearest half, of two as near the even one; what is too large becomes infinite. For
   finite values: by integers, as not every compiler knows the instruction. */
INLINE uint16_t half_of(float value)
{
    const float subnormal_step = 0.5f; /* one in whose last place is the least half */
    uint32_t bits, magnitude, shifted;
    memcpy(&bits, &value, 4);
    magnitude = bits & 0x7fffffff;
    float size;
    memcpy(&size, &magnitude, 4);
    size += subnormal_step;
    memcpy(&shifted, &size, 4);
    uint32_t normal = (magnitude - 0x37fff001 + (magnitude >> 13 & 1)) >> 13;
    uint32_t half = magnitude < 0x38800000 ? shifted - 0x3f000000 : normal;
    half = magnitude < 0x477ff000 ? half : 0x7c00;
    return (uint16_t)(half | (bits >> 16 & 0x8000));
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
