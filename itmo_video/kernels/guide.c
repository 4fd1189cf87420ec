/* The guided filter at analysis size, and its result upsampled to rows of the picture. */

#include "upsampling.h"

/* Window sums of one row of column sums: `columns` hold w + 2 * radius + 1 for each plane, zeros
   left of the picture (radius + 1) and right of it (radius). */
INLINE void window_sums(const double *columns, int planes, int64_t w, int64_t radius,
                        double *restrict steps, double *restrict sums)
{
    int64_t across = w + 2 * radius + 1;
    double sum[4] = {0};
    for (int p = 0; p < planes; p++) {
        const double *column = columns + p * across;
        for (int64_t x = 0; x < (radius < w ? radius : w); x++)
            sum[p] += column[radius + 1 + x];
        for (int64_t x = 0; x < w; x++)
            steps[p * w + x] = column[x + 2 * radius + 1] - column[x];
    }
    for (int64_t x = 0; x < w; x++)
        for (int p = 0; p < planes; p++) /* interleaved, as each depends on its previous value */
            sums[p * w + x] = sum[p] += steps[p * w + x];
}

/* Add a row of two planes, and with `products` also guide * guide and guide * map, to the column
   sums; with a sign of -1, subtract it. */
INLINE void add_row(const float *one, const float *other, int products, double sign, int64_t w,
                    int64_t across, double *restrict columns)
{
    for (int64_t x = 0; x < w; x++)
        columns[x] += sign * one[x];
    for (int64_t x = 0; x < w; x++)
        columns[across + x] += sign * other[x];
    for (int64_t x = 0; products && x < w; x++)
        columns[2 * across + x] += sign * (one[x] * one[x]);
    for (int64_t x = 0; products && x < w; x++)
        columns[3 * across + x] += sign * (one[x] * other[x]);
}

/* See compiled.guided_coefficients. `scratch` holds 4 * (3 * w + 2 * radius + 1) doubles. */
CLONED void itmo_guided_coefficients(const float *map, const float *guide, int64_t h, int64_t w,
                                     int64_t radius, float epsilon, const float *share,
                                     double *scratch, float *between_a, float *between_b,
                                     float *out_a, float *out_b)
{
    int64_t across = w + 2 * radius + 1;
    double *columns = scratch, *inner = columns + radius + 1, *steps = columns + 4 * across;
    double *sums = steps + 4 * w;
    for (int pass = 0; pass < 2; pass++) {
        const float *one = pass ? between_a : guide, *other = pass ? between_b : map;
        memset(columns, 0, 4 * across * sizeof *columns);
        for (int64_t y = -radius; y < h; y++) {
            int64_t enters = y + radius, leaves = y - radius - 1;
            if (enters < h)
                add_row(one + enters * w, other + enters * w, !pass, 1, w, across, inner);
            if (leaves >= 0)
                add_row(one + leaves * w, other + leaves * w, !pass, -1, w, across, inner);
            if (y < 0)
                continue;
            const float *part = share + y * w;
            float *restrict a = (pass ? out_a : between_a) + y * w;
            float *restrict b = (pass ? out_b : between_b) + y * w;
            if (pass) {
                window_sums(columns, 2, w, radius, steps, sums);
                for (int64_t x = 0; x < w; x++) {
                    a[x] = (float)sums[x] * part[x];
                    b[x] = (float)sums[w + x] * part[x];
                }
                continue;
            }
            window_sums(columns, 4, w, radius, steps, sums);
            for (int64_t x = 0; x < w; x++) {
                float mean = (float)sums[x] * part[x], map_mean = (float)sums[w + x] * part[x];
                float variance = (float)sums[2 * w + x] * part[x] - mean * mean;
                float covariance = (float)sums[3 * w + x] * part[x] - mean * map_mean;
                variance = variance > 0 ? variance : 0;
                covariance = map == guide ? variance : covariance;
                a[x] = covariance / (variance + epsilon);
                b[x] = map_mean - a[x] * mean;
            }
        }
    }
}

/* ---- maps and the noise guard, upsampled to rows of the picture ---- */

enum { REACH = 2, WINDOW = 2 * REACH + 1 }; /* WINDOW: the softening's five taps */

/* The slot of a line of the picture, in a ring of WINDOW lines. `y` may be as low as -REACH. */
INLINE float *slot(float *lines, int64_t y, int64_t width)
{
    return lines + (y + WINDOW) % WINDOW * width;
}

/* Write a line of codes, black 0 to white 1, to its slot; outside the picture the edge line. */
INLINE void code_line(const uint8_t *luma, int64_t stride, int64_t bytes, float scale, float offset,
                      int64_t height, int64_t y, int64_t width, float *lines)
{
    const uint8_t *line = luma + (y < 0 ? 0 : y < height ? y : height - 1) * stride;
    levels_of(line, bytes, scale, offset, width, slot(lines, y, width));
}

/* See compiled.guide_rows. */
CLONED void itmo_guide_rows(const uint8_t *luma, int64_t stride, int64_t bytes, float scale,
                            float offset, int64_t height, int64_t top, int64_t rows,
                            int64_t width, const float *small, int64_t planes, int64_t h, int64_t w,
                            const int64_t *above, const float *parts, const int32_t *columns,
                            const float *shares, int64_t guards, int64_t edge_aware, float *scratch,
                            float *ratio, float *maps)
{
    int64_t across = width + 2 * AT_ONCE, after = guards ? 2 : 0;
    float *lefts = scratch, *steps = lefts + planes * (w + 1) + AT_ONCE;
    float *soft = steps + planes * (w + 1) + AT_ONCE;
    float *summed = soft + across, *lines = summed + across, *wide = lines + WINDOW * width;
    int64_t needs_codes = guards || edge_aware;
    for (int64_t y = top - REACH; needs_codes && y < top + REACH; y++)
        code_line(luma, stride, bytes, scale, offset, height, y, width, lines);
    for (int64_t row = 0; row < rows; row++) {
        int64_t y = top + row;
        const float *code = slot(lines, y, width);
        if (needs_codes)
            code_line(luma, stride, bytes, scale, offset, height, y + REACH, width, lines);
        lines_between(small, planes, h, w, above[row], parts[row], lefts, steps);
        itmo_widen(lefts, steps, planes, w, across, columns, shares, width, wide);
        if (guards)
            guard_line(wide, wide + across, code, width, ratio + row * width);
        if (!edge_aware) {
            for (int64_t p = after; p < planes; p++)
                memcpy(maps + ((p - after) * rows + row) * width, wide + p * across,
                       width * sizeof *maps);
            continue;
        }
        const float *line[WINDOW];
        for (int64_t k = 0; k < WINDOW; k++)
            line[k] = slot(lines, y + k - REACH, width);
        for (int64_t x = 0; x < width; x++)
            summed[REACH + x] = ((line[0][x] + line[4][x]) + 4 * (line[1][x] + line[3][x])
                                 + 6 * line[2][x]) * (1 / 16.0f);
        for (int64_t k = 0; k < REACH; k++) {
            summed[k] = summed[REACH];
            summed[REACH + width + k] = summed[REACH + width - 1];
        }
        for (int64_t x = 0; x < width; x++)
            soft[x] = ((summed[x] + summed[x + 4]) + 4 * (summed[x + 1] + summed[x + 3])
                       + 6 * summed[x + 2]) * (1 / 16.0f);
        for (int64_t p = after; p + 1 < planes; p += 2) {
            float *restrict out = maps + ((p - after) / 2 * rows + row) * width;
            const float *slope = wide + p * across, *offset = slope + across;
            for (int64_t x = 0; x < width; x++)
                out[x] = between(slope[x] * soft[x] + offset[x], 0, 1);
        }
    }
}
