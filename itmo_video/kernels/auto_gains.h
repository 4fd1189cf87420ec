/* The gains of `auto`; operators/auto.py has the plain form.

   64 pixels at a time, computing only what is needed: where no level of the network exceeds eq. 11's,
   all channels have its gain, and channels do not separate where none is near white. */

#ifndef ITMO_AUTO_GAINS_H
#define ITMO_AUTO_GAINS_H

#include "numbers.h"

enum { BLOCK = 64 };

/* The indices of gain_block's constants: see compiled_auto.GainAuto. */
enum { OPEN_FROM, CENTRE, STEEP, LOW, WHITE, APART_FROM, APART_WHOLLY, IS_APART, L_MAX, WITH_FROM,
       WITH_WHOLLY, UNKNOWN };

/* The stops of eq. 11, for a weight that is not 0 everywhere. */
INLINE void curve_block(const float *const *rgb, const float *ratio, const float *weights,
                        const float *n, int64_t size, float *restrict curve)
{
    float greatest[BLOCK], even[BLOCK];
    float peak = log_two(n[L_MAX]), slope = 4 / (n[L_MAX] * n[L_MAX]);
    const float *red = rgb[0], *green = rgb[1], *blue = rgb[2];
    int heavy = 0;
    for (int64_t x = 0; x < size; x++)
        even[x] = 1;
    for (int64_t x = 0; ratio && x < size; x++)
        even[x] = between(ratio[x], 0.7f, 2);
    for (int64_t x = 0; x < size; x++) {
        float r = between(red[x], 0, 1), g = between(green[x], 0, 1), b = between(blue[x], 0, 1);
        float most = r > g ? r : g;
        greatest[x] = most = most > b ? most : b;
        float light = (r * 0.213f + g * 0.715f + b * 0.072f + most) * 0.5f * even[x];
        light = between(light, 2e-3f, 1);
        float rest = 1 - light;
        curve[x] = log_two(2 / (sqrtf(rest * rest + slope * light) + rest));
        heavy |= weights[x] * 2.5f > 1;
    }
    /* A weight of at most 1 keeps eq. 11's gain below the peak, so no soft knee is needed. */
    for (int64_t x = 0; !heavy && x < size; x++)
        curve[x] = between(weights[x] * 2.5f * curve[x], 0, peak);
    for (int64_t x = 0; heavy && x < size; x++) {
        float weight = weights[x] * 2.5f, gain = curve[x];
        float room = peak - log_two(between(greatest[x] * even[x], 2e-3f, 1)) - gain;
        room = room > 0 ? room : 0;
        float more = (weight > 1 ? weight - 1 : 0) * gain;
        float bent = (weight < 1 ? weight : 1) * gain + room * more / (room + more + 1e-6f);
        float most = peak - log_two(greatest[x] > 2e-3f ? greatest[x] : 2e-3f);
        curve[x] = between(bent, 0, most);
    }
}

/* The stops that the network's levels add to the curve: `common` to all channels, `own` to each. */
INLINE void opened_block(const float *const *rgb, const float *const *maps, const float *curve,
                         const float *n, int64_t size, float own[3][BLOCK], float *restrict common)
{
    float peak = log_two(n[L_MAX]), open = 1 / (n[WHITE] - n[LOW]);
    for (int c = 0; c < 3; c++) {
        const float *plane = rgb[c], *map = maps[c];
        for (int64_t x = 0; x < size; x++)
            own[c][x] = n[UNKNOWN] * peak;
        for (int64_t x = 0; map && x < size; x++)
            own[c][x] = peak * map[x];
        for (int64_t x = 0; x < size; x++) {
            float light = between(plane[x], 0, 1), closed = (n[CENTRE] - light) * n[STEEP];
            float gate = 1 / (1 + two_to(closed, nearest(closed))) - n[LOW];
            /* Exactly 0 below: no pixel may depend on whether others of its block are near white. */
            gate = gate > 0 && plane[x] > n[OPEN_FROM] ? gate : 0;
            float known = own[c][x] - curve[x];
            own[c][x] = (known > 0 ? known : 0) * (gate * open);
        }
    }
    for (int64_t x = 0; x < size; x++) {
        float least = own[0][x] < own[1][x] ? own[0][x] : own[1][x];
        common[x] = least < own[2][x] ? least : own[2][x];
    }
}

/* How far channels may separate in three successive lines, averaged along each: by line three planes of
   `width` in `planes`, and in `parts` whether that may not be 0 for each block. `own` holds three planes
   of width + 2, not averaged. All in 12 width + 6 + 4 blocks floats, which are 0 at first. */
typedef struct {
    float *planes, *own, *parts;
    int64_t width, blocks;
} Separation;

INLINE Separation separation_of(float *scratch, int64_t width)
{
    int64_t blocks = (width + BLOCK - 1) / BLOCK;
    return (Separation){scratch, scratch + 9 * width, scratch + 12 * width + 6, width, blocks};
}

/* Whether any channel of a block is above a level. */
INLINE int reaches(const float *const *rgb, int64_t at, int64_t size, float level)
{
    const float *red = rgb[0] + at, *green = rgb[1] + at, *blue = rgb[2] + at;
    int found = 0;
    for (int64_t x = 0; x < size; x++)
        found |= (red[x] > level) | (green[x] > level) | (blue[x] > level);
    return found;
}

/* How far each channel of a block may separate, to planes `across` apart. */
INLINE void separation_of_block(const float *const *rgb, const float *n, int64_t at, int64_t size,
                                int64_t across, float *own)
{
    const float *red = rgb[0] + at, *green = rgb[1] + at, *blue = rgb[2] + at;
    float apart_from = n[APART_FROM], per_apart = 1 / (n[APART_WHOLLY] - apart_from), open[BLOCK];
    float with_from = n[WITH_FROM], per_with = 1 / (n[WITH_WHOLLY] - with_from);
    for (int64_t x = 0; x < size; x++) {
        float greatest = red[x] > green[x] ? red[x] : green[x];
        greatest = greatest > blue[x] ? greatest : blue[x];
        open[x] = ramp_of(greatest, apart_from, per_apart);
    }
    for (int c = 0; c < 3; c++) {
        const float *plane = rgb[c] + at;
        float *restrict out = own + c * across;
        for (int64_t x = 0; x < size; x++)
            out[x] = ramp_of(plane[x], with_from, per_with) * open[x];
    }
}

/* Lines come in order; only the last three are known. */
INLINE void add_line(Separation *s, int64_t line, const float *const *rgb, const float *n)
{
    int64_t across = s->width + 2, blocks = s->blocks;
    float *smooth = s->planes + line % 3 * 3 * s->width, *parts = s->parts + line % 3 * blocks;
    float *near = s->parts + 3 * blocks, any = 0;
    for (int64_t b = 0; b < blocks; b++) {
        int64_t at = b * BLOCK, left = s->width - at, size = left < BLOCK ? left : BLOCK;
        float was_near = near[b];
        near[b] = n[IS_APART] > 0 && reaches(rgb, at, size, n[APART_FROM]);
        any += near[b];
        if (near[b] > 0)
            separation_of_block(rgb, n, at, size, across, s->own + 1 + at);
        for (int c = 0; was_near > near[b] && c < 3; c++)
            for (int64_t x = 0; x < size; x++)
                s->own[c * across + 1 + at + x] = 0;
    }
    for (int64_t b = 0; b < blocks; b++)
        parts[b] = near[b] + (b ? near[b - 1] : 0) + (b + 1 < blocks ? near[b + 1] : 0);
    for (int c = 0; any > 0 && c < 3; c++) {
        float *own = s->own + c * across;
        own[0] = own[1];
        own[across - 1] = own[across - 2];
        for (int64_t b = 0; b < blocks; b++) {
            int64_t at = b * BLOCK, left = s->width - at, size = left < BLOCK ? left : BLOCK;
            float *restrict out = smooth + c * s->width + at;
            const float *here = own + at;
            if (parts[b] > 0)
                for (int64_t x = 0; x < size; x++)
                    out[x] = (here[x] + here[x + 2]) * 0.25f + here[x + 1] * 0.5f;
        }
    }
}

/* The average over 3 x 3 pixels of `size` of them, from the block at `at` on in `line`; `last` is the
   picture's last line. Returns 0, and sets nothing, if none may separate. */
INLINE int separation_at(const Separation *s, int64_t line, int64_t last, int64_t at, int64_t size,
                         float out[3][BLOCK])
{
    int64_t slots[3] = {(line > 0 ? line - 1 : 0) % 3, line % 3, (line < last ? line + 1 : last) % 3};
    const float shares[3] = {0.25f, 0.5f, 0.25f};
    int parts = 0;
    for (int i = 0; i < 3; i++)
        parts |= s->parts[slots[i] * s->blocks + at / BLOCK] > 0;
    if (!parts)
        return 0;
    parts = 0;
    for (int c = 0; c < 3; c++) {
        float *restrict sum = out[c];
        for (int64_t x = 0; x < size; x++)
            sum[x] = 0;
        for (int i = 0; i < 3; i++) {
            const float *plane = s->planes + (slots[i] * 3 + c) * s->width + at;
            float share = shares[i];
            if (s->parts[slots[i] * s->blocks + at / BLOCK] > 0)
                for (int64_t x = 0; x < size; x++)
                    sum[x] += plane[x] * share;
        }
        for (int64_t x = 0; x < size; x++)
            parts |= sum[x] > 0;
        for (int64_t x = size; x < BLOCK; x++)
            sum[x] = 0;
    }
    return parts;
}

/* The gains of up to BLOCK pixels, whose channels separate by `apart` unless that is null. Returns how
   many of `gains` are set: 0 if all are 1, 1 if channels share one, otherwise 3. */
INLINE int gain_block(const float *const *rgb, const float *ratio, const float *const *maps,
                      const float (*apart)[BLOCK], const float *n, int64_t size,
                      float gains[3][BLOCK])
{
    float curve[BLOCK] = {0}, own[3][BLOCK], common[BLOCK];
    float peak = log_two(n[L_MAX]);
    int curves = 0, opens = 0;
    for (int64_t x = 0; maps[3] && x < size; x++)
        curves |= maps[3][x] > 0;
    if (curves)
        curve_block(rgb, ratio, maps[3], n, size, curve);
    for (int c = 0; c < 3; c++) {
        const float *plane = rgb[c], *map = maps[c];
        int bright = 0;
        for (int64_t x = 0; x < size; x++)
            bright |= plane[x] > n[OPEN_FROM];
        for (int64_t x = 0; bright && map && x < size; x++)
            opens |= (peak * map[x] > curve[x]) & (plane[x] > n[OPEN_FROM]);
        opens |= bright & !map & (n[UNKNOWN] > 0);
    }
    if (!opens && !curves)
        return 0;
    if (opens) {
        opened_block(rgb, maps, curve, n, size, own, common);
        for (int64_t x = 0; x < size; x++)
            curve[x] += common[x];
    }
    if (!opens || !apart) {
        for (int64_t x = 0; x < size; x++)
            gains[0][x] = two_to(curve[x], nearest(curve[x]));
        return 1;
    }
    for (int c = 0; c < 3; c++)
        for (int64_t x = 0; x < size; x++) {
            float total = curve[x] + (own[c][x] - common[x]) * apart[c][x];
            gains[c][x] = two_to(total, nearest(total));
        }
    return 3;
}

#endif
