/* Planes smoothed by a Gaussian: along lines first, in the order of OpenCV's sums and so with its bytes (but
   for its last few of a line, which it does not fuse). Lines out of reach of any but 0 are left out. */

#include "numbers.h"

enum { VECTORS = 4, AT_A_TIME = LANES * VECTORS };

/* The place in a line of `size` that mirrors it at its ends, the last place included. */
INLINE int64_t mirrored(int64_t at, int64_t size)
{
    while (at < 0 || at >= size)
        at = at < 0 ? -1 - at : 2 * size - 1 - at;
    return at;
}

/* `weights` are those from the middle on; `line` begins `half` pixels earlier than `out`. */
INLINE void blur_along(const float *line, int64_t count, int64_t channels, int64_t half,
                       const float *weights, float *restrict out)
{
    for (int64_t x = 0; x < count; x += AT_A_TIME) {
        Eight sums[VECTORS];
        for (int v = 0; v < VECTORS; v++)
            sums[v] = EIGHT(line + x + LANES * v) * weights[half];
        for (int64_t k = 1; k <= 2 * half; k++) {
            const float *from = line + x + k * channels, weight = weights[k < half ? half - k : k - half];
            for (int v = 0; v < VECTORS; v++)
                for (int i = 0; i < LANES; i++)
                    sums[v][i] = FMA(from[LANES * v + i], weight, sums[v][i]);
        }
        for (int v = 0; v < VECTORS; v++)
            EIGHT(out + x + LANES * v) = sums[v];
    }
}

/* Of lines in `ring`, the sums for line y of `height`. */
INLINE void blur_down(const float *ring, int64_t kept, int64_t step, int64_t y, int64_t height,
                      int64_t count, int64_t half, const float *weights, float *restrict out)
{
    for (int64_t x = 0; x < count; x += AT_A_TIME) {
        Eight sums[VECTORS];
        for (int v = 0; v < VECTORS; v++)
            sums[v] = EIGHT(ring + y % kept * step + x + LANES * v) * weights[0];
        for (int64_t k = 1; k <= half; k++) {
            const float *above = ring + mirrored(y - k, height) % kept * step + x, weight = weights[k];
            const float *below = ring + mirrored(y + k, height) % kept * step + x;
            for (int v = 0; v < VECTORS; v++) {
                Eight both = EIGHT(above + LANES * v) + EIGHT(below + LANES * v);
                for (int i = 0; i < LANES; i++)
                    sums[v][i] = FMA(both[i], weight, sums[v][i]);
            }
        }
        int64_t left = count - x < AT_A_TIME ? count - x : AT_A_TIME;
        if (left == AT_A_TIME)
            memcpy(out + x, sums, sizeof sums);
        else
            memcpy(out + x, sums, (size_t)left * sizeof *out);
    }
}

/* A line between `half` mirrored pixels on both sides; returns whether any of it is not 0. */
INLINE int widened(const float *from, int64_t width, int64_t channels, int64_t half,
                   float *restrict line)
{
    float *inner = line + half * channels;
    uint32_t any = 0, bits;
    for (int64_t x = 0; x < width * channels; x++) {
        inner[x] = from[x];
        memcpy(&bits, from + x, 4);
        any |= bits;
    }
    for (int64_t x = -half; x < half; x++) {
        int64_t at = x < 0 ? x : width + x;
        for (int64_t c = 0; c < channels; c++)
            inner[at * channels + c] = from[mirrored(at, width) * channels + c];
    }
    return any != 0;
}

/* See compiled_blur.blurred. */
CLONED void itmo_blurred(const float *planes, int64_t height, int64_t width, int64_t channels,
                         int64_t half, const float *weights, float *scratch, float *out)
{
    int64_t count = width * channels, kept = 2 * half + 1, filled = -1; /* the last line not all 0 */
    /* Lines of the ring are an odd number of the cache's apart, so that they do not displace each other. */
    int64_t step = (count / AT_A_TIME + 1) * AT_A_TIME + 16;
    float *line = scratch, *ring = line + 2 * half * channels + step;
    for (int64_t next = 0; next < height + half; next++) {
        int64_t y = next - half;
        if (next < height) {
            float *to = ring + next % kept * step;
            if (widened(planes + next * count, width, channels, half, line)) {
                filled = next;
                blur_along(line, count, channels, half, weights, to);
            } else {
                memset(to, 0, (size_t)count * sizeof *to);
            }
        }
        if (y >= 0 && filled < y - half)
            memset(out + y * count, 0, (size_t)count * sizeof *out);
        else if (y >= 0)
            blur_down(ring, kept, step, y, height, count, half, weights, out + y * count);
    }
}
