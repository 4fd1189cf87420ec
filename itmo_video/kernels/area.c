/* Planes averaged over areas, in the order of OpenCV's INTER_AREA and so with its bytes. */

#include "loops.h"

/* The means of `count` areas of a line: up to `taps` neighbours from `starts` on, weighted by `shares`, a
   row of `count` for each neighbour. Pixels have `channels` side by side. */
INLINE void line_means(const float *line, int64_t count, int64_t channels, int64_t taps,
                       const int32_t *starts, const float *shares, float *restrict out)
{
    for (int64_t x = 0; x < count; x++) {
        const float *from = line + starts[x] * channels;
        for (int64_t c = 0; c < channels; c++) {
            float sum = from[c] * shares[x];
            for (int64_t k = 1; k < taps; k++)
                sum += from[k * channels + c] * shares[k * count + x];
            out[x * channels + c] = sum;
        }
    }
}

INLINE void line_of_floats(const uint8_t *codes, int64_t bytes, int64_t width, float *restrict out)
{
    const uint16_t *wide = (const uint16_t *)codes;
    for (int64_t x = 0; bytes == 1 && x < width; x++)
        out[x] = codes[x];
    for (int64_t x = 0; bytes == 2 && x < width; x++)
        out[x] = wide[x];
}

/* A line of sums as what the plane holds; codes are rounded to the nearest, halves to even. */
INLINE void put_line(const float *sums, int64_t bytes, int64_t width, uint8_t *restrict out)
{
    const float rounding = 12582912; /* 1.5 * 2^23: its last place is 1 */
    uint16_t *wide = (uint16_t *)out;
    for (int64_t x = 0; bytes == 1 && x < width; x++)
        out[x] = (uint8_t)(int32_t)((sums[x] + rounding) - rounding);
    for (int64_t x = 0; bytes == 2 && x < width; x++)
        wide[x] = (uint16_t)(int32_t)((sums[x] + rounding) - rounding);
    if (bytes == 4)
        memcpy(out, sums, 4 * (size_t)width);
}

/* See compiled_area.area_means. */
CLONED void itmo_area_means(const uint8_t *plane, int64_t stride, int64_t bytes, const int64_t *sizes,
                            const int32_t *columns, const float *column_shares, const int32_t *rows,
                            const float *row_shares, float *scratch, uint8_t *out)
{
    int64_t width = sizes[0], out_width = sizes[1], out_height = sizes[2], taps = sizes[3];
    int64_t down = sizes[4], channels = sizes[5], count = out_width * channels;
    float *line = scratch, *means = line + width * channels, *sums = means + count;
    int64_t held = -1; /* the row that `means` are of: the last of an area is often the next one's first */
    for (int64_t y = 0; y < out_height; y++) {
        for (int64_t k = 0; k < down; k++) {
            float share = row_shares[k * out_height + y];
            if (held != rows[y] + k) {
                held = rows[y] + k;
                const uint8_t *from = plane + held * stride;
                line_of_floats(from, bytes, width * channels, line);
                const float *given = bytes == 4 ? (const float *)from : line;
                if (taps == 2 && channels == 1)
                    line_means(given, out_width, 1, 2, columns, column_shares, means);
                else if (taps == 3 && channels == 1)
                    line_means(given, out_width, 1, 3, columns, column_shares, means);
                else if (taps == 3 && channels == 3)
                    line_means(given, out_width, 3, 3, columns, column_shares, means);
                else if (taps == 4 && channels == 3)
                    line_means(given, out_width, 3, 4, columns, column_shares, means);
                else
                    line_means(given, out_width, channels, taps, columns, column_shares, means);
            }
            for (int64_t x = 0; x < count; x++)
                sums[x] = k ? sums[x] + means[x] * share : means[x] * share;
        }
        put_line(sums, bytes, count, out + y * count * bytes);
    }
}
