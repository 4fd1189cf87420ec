/* Layers of 3 x 3 by Winograd's F(4 x 4, 3 x 3) (Lavin and Gray 2015, arXiv:1509.09308), which needs a
   quarter of the multiplications: 6 x 6 pixels are transformed, multiplied with transformed weights, and
   transformed back to 4 x 4. */

#ifndef ITMO_WINOGRAD_H
#define ITMO_WINOGRAD_H

#include "numbers.h"

enum { TILES = 12, MOST = 160, MOST_VECTORS = 3, PLACES = 36 };

/* Channels of a layer's input: those of a picture of `width`, or of one of half the size if `shift`. */
typedef struct {
    const float *at;
    int64_t channels, shift;
} Source;

INLINE void six_of_pixels(const Eight *d, int64_t step, Eight *restrict out, int64_t out_step)
{
    Eight d0 = d[0], d1 = d[step], d2 = d[2 * step], d3 = d[3 * step], d4 = d[4 * step];
    Eight even = d4 - 4 * d2, odd = d3 - 4 * d1, less = d4 - d2, twice = 2 * (d3 - d1);
    out[0] = 4 * d0 - 5 * d2 + d4;
    out[out_step] = even + odd;
    out[2 * out_step] = even - odd;
    out[3 * out_step] = less + twice;
    out[4 * out_step] = less - twice;
    out[5 * out_step] = 4 * d1 - 5 * d3 + d[5 * step];
}

INLINE void four_of_six(const Eight *m, int64_t step, Eight *restrict out, int64_t out_step)
{
    Eight sum = m[step] + m[2 * step], apart = m[step] - m[2 * step];
    Eight more = m[3 * step] + m[4 * step], most = m[3 * step] - m[4 * step];
    out[0] = m[0] + sum + more;
    out[out_step] = apart + 2 * most;
    out[2 * out_step] = sum + 4 * more;
    out[3 * out_step] = apart + 8 * most + m[5 * step];
}

INLINE void six_of_filter(double first, double middle, double last, double *out, int64_t out_step)
{
    double far = first / 24 + last / 6;
    out[0] = first / 4;
    out[out_step] = -(first + middle + last) / 6;
    out[2 * out_step] = -(first - middle + last) / 6;
    out[3 * out_step] = far + middle / 12;
    out[4 * out_step] = far - middle / 12;
    out[5 * out_step] = last;
}

/* The 6 x 6 pixels around the tile at (4 tile_x, 4 tile_y), 0 outside the picture, transformed to `out`:
   a place every `step` vectors. */
INLINE void transform_tile(const Source *sources, int count, int64_t h, int64_t w, int64_t tile_y,
                           int64_t tile_x, int64_t step, float *out)
{
    static const float nothing[MOST] = {0};
    for (int s = 0; s < count; s++) {
        const Source *from = sources + s;
        int64_t wide = w >> from->shift;
        const float *pixels[PLACES];
        for (int64_t i = 0; i < 6; i++)
            for (int64_t j = 0; j < 6; j++) {
                int64_t y = 4 * tile_y + i - 1, x = 4 * tile_x + j - 1;
                int inside = y >= 0 && y < h && x >= 0 && x < w;
                int64_t at = (y >> from->shift) * wide + (x >> from->shift);
                pixels[6 * i + j] = inside ? from->at + at * from->channels : nothing;
            }
        for (int64_t c = 0; c < from->channels; c += LANES) {
            Eight half[PLACES];
            for (int j = 0; j < 6; j++) {
                Eight column[6];
                for (int i = 0; i < 6; i++)
                    column[i] = EIGHT(pixels[6 * i + j] + c);
                six_of_pixels(column, 1, half + j, 6);
            }
            for (int i = 0; i < 6; i++)
                six_of_pixels(half + 6 * i, 1, &EIGHT(out + c) + 6 * i * step, step);
        }
        out += from->channels;
    }
}

/* At one of the 36 places: `vectors` times eight output channels of `tiles` tiles, summed over the input's
   channels. Weights of eight output channels are `apart` floats from those of the next. */
INLINE void multiply_tiles(const float *pixels, const float *weights, int64_t apart, int64_t channels,
                           int vectors, int tiles, Eight m[][PLACES][TILES])
{
    Eight sums[MOST_VECTORS][TILES];
    for (int v = 0; v < vectors; v++)
        for (int t = 0; t < tiles; t++)
            sums[v][t] = (Eight){0};
    for (int64_t c = 0; c < channels; c++)
        for (int t = 0; t < tiles; t++)
            for (int v = 0; v < vectors; v++)
                sums[v][t] += pixels[t * channels + c] * EIGHT(weights + v * apart + LANES * c);
    for (int v = 0; v < vectors; v++)
        for (int t = 0; t < tiles; t++)
            m[v][0][t] = sums[v][t];
}

INLINE void leaky(Eight *x)
{
    typedef int32_t Bits __attribute__((vector_size(32)));
    Eight little = 0.1f * *x;
    Bits above = *x > little;
    *x = (Eight)(((Bits)*x & above) | ((Bits)little & ~above));
}

/* The 4 x 4 pixels of a tile at (x, y), or those inside the picture, from what its places came to: every
   TILES vectors in `m`. */
INLINE void put_tile(const Eight *m, const float *biases, int64_t y, int64_t x, int64_t h, int64_t w,
                     int64_t kept, float *out)
{
    Eight half[4][6], done[4][4];
    for (int i = 0; i < 6; i++)
        four_of_six(m + i * TILES, 6 * TILES, &half[0][i], 6);
    for (int i = 0; i < 4; i++)
        four_of_six(half[i], 1, done[i], 1);
    for (int64_t i = 0; i < 4 && y + i < h; i++)
        for (int64_t j = 0; j < 4 && x + j < w; j++) {
            done[i][j] += EIGHT(biases);
            leaky(&done[i][j]);
            EIGHT(out + ((y + i) * w + x + j) * kept) = done[i][j];
        }
}

/* A layer: 3 x 3 to `kept` channels, a bias, and LeakyReLU. `weights` are, for eight output channels at a
   time, each place's rows of eight, one per input channel; after all of them the biases. */
CLONED static void layer(const Source *sources, int count, int64_t h, int64_t w, int64_t kept,
                         const float *weights, float *tiles, float *out)
{
    int64_t across = (w + 3) / 4, all = across * ((h + 3) / 4), channels = 0;
    for (int s = 0; s < count; s++)
        channels += sources[s].channels;
    const float *biases = weights + kept * channels * PLACES;
    /* As many sums as a processor has registers: 3 x 3 or 2 x 6 vectors. */
    const int wide = kept % (3 * LANES) == 0, vectors = wide ? 3 : 2;
    const int64_t apart = PLACES * LANES * channels;
    for (int64_t first = 0; first < all; first += TILES) {
        int64_t here = all - first < TILES ? all - first : TILES;
        for (int64_t t = 0; t < here; t++)
            transform_tile(sources, count, h, w, (first + t) / across, (first + t) % across,
                           TILES * channels / LANES, tiles + t * channels);
        for (int64_t k = 0; k < kept; k += vectors * LANES) {
            Eight m[MOST_VECTORS][PLACES][TILES];
            for (int64_t p = 0; p < PLACES; p++) {
                const float *from = tiles + p * TILES * channels;
                const float *by = weights + k / LANES * apart + p * LANES * channels;
                for (int64_t t = 0; wide && t < here; t += 3)
                    multiply_tiles(from + t * channels, by, apart, channels, 3, 3,
                                   (Eight(*)[PLACES][TILES])&m[0][p][t]);
                for (int64_t t = 0; !wide && t < here; t += 6)
                    multiply_tiles(from + t * channels, by, apart, channels, 2, 6,
                                   (Eight(*)[PLACES][TILES])&m[0][p][t]);
            }
            for (int v = 0; v < vectors; v++)
                for (int64_t t = 0; t < here; t++)
                    put_tile(&m[v][0][t], biases + k + v * LANES, (first + t) / across * 4,
                             (first + t) % across * 4, h, w, kept, out + k + v * LANES);
        }
    }
}

#endif
