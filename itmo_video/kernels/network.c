/* The network of `auto` (docs/auto/network.py), for pictures of any size.

   Convolutions of 3 x 3 by Winograd's F(4 x 4, 3 x 3) (Lavin and Gray 2015, arXiv:1509.09308), which
   needs a quarter of the multiplications: 6 x 6 pixels are transformed, multiplied with transformed
   weights, and transformed back to 4 x 4. Pixels have their channels side by side, eight to a vector; no
   multiplication is fused and each sum has one order, so that vectors of any width give the same bytes. */

#include "numbers.h"

enum { LEVELS = 5, TILES = 12, LANES = 8, MOST = 160, PLACES = 36, GIVEN = 17, SHOWN = 30 };
static const int64_t CHANNELS[LEVELS] = {24, 32, 48, 64, 96};

typedef float Eight __attribute__((vector_size(32), aligned(4), may_alias));

#define EIGHT(at) (*(Eight *)(at)) /* not a function, as vectors are returned differently without AVX */

/* Channels of a layer's input: those of a picture of `width`, or of one of half the size if `shift`. */
typedef struct {
    const float *at;
    int64_t channels, shift;
} Source;

/* ---- Winograd's transforms ---- */

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
   a place every TILES * MOST floats. */
INLINE void transform_tile(const Source *sources, int count, int64_t h, int64_t w, int64_t tile_y,
                           int64_t tile_x, float *out)
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
            Eight d[PLACES], half[PLACES];
            for (int p = 0; p < PLACES; p++)
                d[p] = EIGHT(pixels[p] + c);
            for (int i = 0; i < 6; i++)
                six_of_pixels(d + i, 6, half + i, 6);
            for (int i = 0; i < 6; i++)
                six_of_pixels(half + 6 * i, 1, d + 6 * i, 1);
            for (int p = 0; p < PLACES; p++)
                EIGHT(out + p * TILES * MOST + c) = d[p];
        }
        out += from->channels;
    }
}

/* At one of the 36 places: eight output channels of all tiles, summed over the input's channels. */
INLINE void multiply_tiles(const float *tiles, const float *weights, int64_t channels, Eight *m)
{
    Eight sums[TILES];
    for (int t = 0; t < TILES; t++)
        sums[t] = (Eight){0};
    for (int64_t c = 0; c < channels; c++) {
        Eight weight = EIGHT(weights + LANES * c);
        for (int t = 0; t < TILES; t++)
            sums[t] += tiles[t * MOST + c] * weight;
    }
    for (int t = 0; t < TILES; t++)
        m[t] = sums[t];
}

INLINE void leaky(Eight *x)
{
    typedef int32_t Bits __attribute__((vector_size(32)));
    Eight little = 0.1f * *x;
    Bits above = *x > little;
    *x = (Eight)(((Bits)*x & above) | ((Bits)little & ~above));
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
    for (int64_t first = 0; first < all; first += TILES) {
        int64_t here = all - first < TILES ? all - first : TILES;
        for (int64_t t = 0; t < here; t++)
            transform_tile(sources, count, h, w, (first + t) / across, (first + t) % across,
                           tiles + t * MOST);
        for (int64_t k = 0; k < kept; k += LANES) {
            Eight m[PLACES][TILES], half[4][6], done[4][4];
            for (int64_t p = 0; p < PLACES; p++)
                multiply_tiles(tiles + p * TILES * MOST,
                               weights + (k * PLACES + p * LANES) * channels, channels, m[p]);
            for (int64_t t = 0; t < here; t++) {
                for (int64_t i = 0; i < 6; i++)
                    four_of_six(&m[i][t], 6 * TILES, &half[0][i], 6);
                for (int64_t i = 0; i < 4; i++)
                    four_of_six(half[i], 1, done[i], 1);
                int64_t y = (first + t) / across * 4, x = (first + t) % across * 4;
                for (int64_t i = 0; i < 4 && y + i < h; i++)
                    for (int64_t j = 0; j < 4 && x + j < w; j++) {
                        done[i][j] += EIGHT(biases + k);
                        leaky(&done[i][j]);
                        EIGHT(out + ((y + i) * w + x + j) * kept + k) = done[i][j];
                    }
            }
        }
    }
}

/* ---- the other layers ---- */

/* Means of 2 x 2 pixels; h and w are those of `out`. */
INLINE void halved(const float *in, int64_t h, int64_t w, int64_t channels, float *restrict out)
{
    for (int64_t y = 0; y < h; y++)
        for (int64_t x = 0; x < w; x++) {
            const float *a = in + (4 * y * w + 2 * x) * channels, *b = a + 2 * w * channels;
            for (int64_t c = 0; c < channels; c++)
                out[(y * w + x) * channels + c] =
                    ((a[c] + a[channels + c]) + (b[c] + b[channels + c])) * 0.25f;
        }
}

/* Sums over a pixel's channels, `vectors` times eight of them; `weights` are a row of all sums for each
   channel, then biases. */
INLINE void mixed(const float *in, int64_t channels, int vectors, const float *weights, Eight *out)
{
    for (int k = 0; k < vectors; k++)
        out[k] = EIGHT(weights + (channels * vectors + k) * LANES);
    for (int64_t c = 0; c < channels; c++)
        for (int k = 0; k < vectors; k++)
            out[k] += in[c] * EIGHT(weights + (c * vectors + k) * LANES);
}

/* Add what two layers make of the whole picture's mean to each pixel; returns the weights behind them. */
CLONED static const float *add_whole(float *picture, int64_t count, const float *weights)
{
    enum { DEEPEST = 96, VECTORS = DEEPEST / LANES };
    Eight mean[VECTORS] = {{0}}, mixture[VECTORS], *pixels = (Eight *)picture;
    for (int64_t x = 0; x < count; x++)
        for (int k = 0; k < VECTORS; k++)
            mean[k] += pixels[x * VECTORS + k];
    for (int k = 0; k < VECTORS; k++)
        mean[k] *= 1 / (float)count;
    mixed((const float *)mean, DEEPEST, VECTORS, weights, mixture);
    for (int k = 0; k < VECTORS; k++)
        leaky(mixture + k);
    weights += DEEPEST * (DEEPEST + 1);
    mixed((const float *)mixture, DEEPEST, VECTORS, weights, mean);
    for (int64_t x = 0; x < count; x++)
        for (int k = 0; k < VECTORS; k++)
            pixels[x * VECTORS + k] += mean[k];
    return weights + DEEPEST * (DEEPEST + 1);
}

/* The levels' shares as planes, from the first level's channels. */
CLONED static void shares_of(const float *in, int64_t count, const float *weights, float *restrict out)
{
    enum { FIRST = 24, VECTORS = 4, LINE = 16 }; /* a line of the cache of each plane at a time */
    for (int64_t begin = 0; begin < count; begin += LINE) {
        float logits[LINE][VECTORS * LANES];
        for (int x = 0; x < LINE; x++)
            mixed(in + (begin + x) * FIRST, FIRST, VECTORS, weights, (Eight *)logits[x]);
        for (int k = 0; k < SHOWN; k++)
            for (int x = 0; x < LINE; x++)
                out[k * count + begin + x] = logits[x][k];
    }
    for (int64_t i = 0; i < SHOWN * count; i++) {
        float power = between(out[i] * -1.44269504f, -120, 120);
        out[i] = 1 / (1 + two_to(power, nearest(power)));
    }
}

CLONED static void pooled(const float *in, int64_t h, int64_t w, int64_t channels, float *out)
{
    halved(in, h, w, channels, out);
}

/* Two layers, by way of `between_them`; returns the weights behind theirs. */
INLINE const float *block(const Source *sources, int count, int64_t h, int64_t w, int64_t kept,
                          const float *weights, float *tiles, float *between_them, float *out)
{
    int64_t channels = 0;
    for (int s = 0; s < count; s++)
        channels += sources[s].channels;
    layer(sources, count, h, w, kept, weights, tiles, between_them);
    weights += kept * (channels * PLACES + 1);
    Source inner = {between_them, kept, 0};
    layer(&inner, 1, h, w, kept, weights, tiles, out);
    return weights + kept * (kept * PLACES + 1);
}

/* See compiled_network.shares. */
void itmo_network(const float *features, int64_t height, int64_t width, const float *weights,
                  float *scratch, float *out)
{
    enum { PADDED = 24 };
    int64_t count = height * width;
    float *tiles = scratch, *given = tiles + PLACES * TILES * MOST, *aside = given + count * PADDED;
    float *kept[LEVELS], *next = aside + count * PADDED;
    for (int n = 0; n < LEVELS; n++) {
        kept[n] = next;
        next += (count >> 2 * n) * CHANNELS[n];
    }
    memset(given, 0, (size_t)(count * PADDED) * sizeof *given);
    for (int64_t c = 0; c < GIVEN; c++)
        for (int64_t x = 0; x < count; x++)
            given[x * PADDED + c] = features[c * count + x];
    Source sources[2] = {{given, PADDED, 0}};
    for (int n = 0; n < LEVELS; n++) {
        int64_t h = height >> n, w = width >> n;
        if (n) {
            pooled(kept[n - 1], h, w, CHANNELS[n - 1], given);
            sources[0].channels = CHANNELS[n - 1];
        }
        weights = block(sources, 1, h, w, CHANNELS[n], weights, tiles, aside, kept[n]);
    }
    weights = add_whole(kept[LEVELS - 1], count >> 2 * (LEVELS - 1), weights);
    float *below = kept[LEVELS - 1];
    for (int n = LEVELS - 2; n >= 0; n--) {
        sources[0] = (Source){below, CHANNELS[n + 1], 1};
        sources[1] = (Source){kept[n], CHANNELS[n], 0};
        below = n % 2 ? given : next;
        weights = block(sources, 2, height >> n, width >> n, CHANNELS[n], weights, tiles, aside, below);
    }
    shares_of(below, count, weights, out);
}

/* See compiled_network.packed. */
void itmo_network_filters(const float *filters, int64_t kept, int64_t channels, int64_t padded,
                          float *out)
{
    for (int64_t k = 0; k < kept; k++)
        for (int64_t c = 0; c < channels; c++) {
            const float *filter = filters + (k * channels + c) * 9;
            double half[6][3], whole[6][6];
            for (int j = 0; j < 3; j++)
                six_of_filter(filter[j], filter[3 + j], filter[6 + j], &half[0][j], 3);
            for (int i = 0; i < 6; i++)
                six_of_filter(half[i][0], half[i][1], half[i][2], whole[i], 1);
            float *to = out + (k / LANES * PLACES * padded + c) * LANES + k % LANES;
            for (int p = 0; p < PLACES; p++)
                to[p * padded * LANES] = (float)whole[p / 6][p % 6];
        }
}

/* See compiled_network.features: `codes` of (2 height, 2 width), R, G, B side by side. */
CLONED void itmo_network_features(const float *codes, int64_t height, int64_t width, float slope,
                                  float centre, float most, float step, float *restrict out)
{
    int64_t count = height * width;
    for (int64_t y = 0; y < height; y++) {
        for (int part = 0; part < 4; part++) { /* left and right above, left and right below */
            const float *line = codes + ((2 * y + part / 2) * 2 * width + part % 2) * 3;
            float *to = out + part * count + y * width;
            for (int64_t x = 0; x < width; x++) {
                float red = line[6 * x], green = line[6 * x + 1], blue = line[6 * x + 2];
                float greatest = red > green ? red : green;
                greatest = greatest > blue ? greatest : blue;
                float power = between((centre - greatest) * slope, -120, 120);
                to[x] = red - 0.5f;
                to[4 * count + x] = green - 0.5f;
                to[8 * count + x] = blue - 0.5f;
                to[12 * count + x] = most / (1 + two_to(power, nearest(power)));
            }
        }
        for (int64_t x = 0; x < width; x++)
            out[16 * count + y * width + x] = (float)y * step - 1;
    }
}

/* See compiled_network.srgb_codes. */
CLONED void itmo_srgb_codes(const float *light, int64_t count, float *restrict out)
{
    const float toe = 0.0031308f;
    for (int64_t x = 0; x < count; x++) {
        float power = log_two(light[x] > toe ? light[x] : toe) * (1 / 2.4f);
        float curve = 1.055f * two_to(power, nearest(power)) - 0.055f;
        out[x] = light[x] <= toe ? 12.92f * light[x] : curve;
    }
}
