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

/* How far the highest channel of each pixel may separate from the others. */
INLINE void open_block(const float *const *rgb, const float *n, int64_t size, float *restrict open)
{
    float per_apart = 1 / (n[APART_WHOLLY] - n[APART_FROM]);
    const float *red = rgb[0], *green = rgb[1], *blue = rgb[2];
    for (int64_t x = 0; x < size; x++) {
        float greatest = red[x] > green[x] ? red[x] : green[x];
        greatest = greatest > blue[x] ? greatest : blue[x];
        float t = between((greatest - n[APART_FROM]) * per_apart, 0, 1);
        open[x] = t * t * (3 - 2 * t);
    }
}

/* The gains of up to BLOCK pixels; returns how many of `gains` are set: 0 if all are 1, 1 if channels
   share one, otherwise 3. */
INLINE int gain_block(const float *const *rgb, const float *ratio, const float *const *maps,
                      const float *n, int64_t size, float gains[3][BLOCK])
{
    float curve[BLOCK] = {0}, own[3][BLOCK], common[BLOCK], open[BLOCK];
    float peak = log_two(n[L_MAX]), per_with = 1 / (n[WITH_WHOLLY] - n[WITH_FROM]);
    int curves = 0, opens = 0, parts = 0;
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
        for (int64_t x = 0; x < size; x++)
            parts |= plane[x] > n[APART_FROM];
    }
    if (!opens && !curves)
        return 0;
    if (opens) {
        opened_block(rgb, maps, curve, n, size, own, common);
        for (int64_t x = 0; x < size; x++)
            curve[x] += common[x];
    }
    if (!opens || !parts || !(n[IS_APART] > 0)) {
        for (int64_t x = 0; x < size; x++)
            gains[0][x] = two_to(curve[x], nearest(curve[x]));
        return 1;
    }
    open_block(rgb, n, size, open);
    for (int c = 0; c < 3; c++) {
        const float *plane = rgb[c];
        for (int64_t x = 0; x < size; x++) {
            float t = between((plane[x] - n[WITH_FROM]) * per_with, 0, 1);
            float total = curve[x] + (own[c][x] - common[x]) * (t * t * (3 - 2 * t) * open[x]);
            gains[c][x] = two_to(total, nearest(total));
        }
    }
    return 3;
}

#endif
