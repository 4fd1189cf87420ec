/* The network of `auto` (docs/auto/network.py), for pictures of any size.

   Pixels have their channels side by side, eight to a vector; no multiplication is fused and each sum has
   one order, so that vectors of any width give the same bytes. */

#include "winograd.h"

enum { LEVELS = 5, GIVEN = 17, SHOWN = 30 };
enum { LINE = 16 }; /* pixels of planes at a time: a line of the cache each */
static const int64_t CHANNELS[LEVELS] = {24, 32, 48, 64, 96};

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

/* Sums over the channels of a few pixels, `vectors` times eight of each; `weights` are a row of all sums
   for each channel, then biases. */
INLINE void mixed(const float *in, int64_t channels, int vectors, int pixels, const float *weights,
                  Eight *out)
{
    Eight sums[MOST / LANES];
    for (int x = 0; x < pixels; x++)
        for (int k = 0; k < vectors; k++)
            sums[x * vectors + k] = EIGHT(weights + (channels * vectors + k) * LANES);
    for (int64_t c = 0; c < channels; c++)
        for (int x = 0; x < pixels; x++)
            for (int k = 0; k < vectors; k++)
                sums[x * vectors + k] +=
                    in[x * channels + c] * EIGHT(weights + (c * vectors + k) * LANES);
    for (int k = 0; k < pixels * vectors; k++)
        out[k] = sums[k];
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
    mixed((const float *)mean, DEEPEST, VECTORS, 1, weights, mixture);
    for (int k = 0; k < VECTORS; k++)
        leaky(mixture + k);
    weights += DEEPEST * (DEEPEST + 1);
    mixed((const float *)mixture, DEEPEST, VECTORS, 1, weights, mean);
    for (int64_t x = 0; x < count; x++)
        for (int k = 0; k < VECTORS; k++)
            pixels[x * VECTORS + k] += mean[k];
    return weights + DEEPEST * (DEEPEST + 1);
}

/* The levels' shares as planes, from the first level's channels. */
CLONED static void shares_of(const float *in, int64_t count, const float *weights, float *restrict out)
{
    enum { FIRST = 24, VECTORS = 4 };
    for (int64_t begin = 0; begin < count; begin += LINE) {
        float all[LINE * VECTORS * LANES];
        for (int x = 0; x < LINE; x += 2)
            mixed(in + (begin + x) * FIRST, FIRST, VECTORS, 2, weights, (Eight *)all + x * VECTORS);
        for (int i = 0; i < LINE * VECTORS * LANES; i++) {
            float power = between(all[i] * -1.44269504f, -120, 120);
            all[i] = 1 / (1 + two_to(power, nearest(power)));
        }
        for (int k = 0; k < SHOWN; k++)
            for (int x = 0; x < LINE; x++)
                out[k * count + begin + x] = all[x * VECTORS * LANES + k];
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
    for (int64_t begin = 0; begin < count; begin += LINE)
        for (int64_t c = 0; c < PADDED; c++)
            for (int64_t x = begin; x < begin + LINE; x++)
                given[x * PADDED + c] = c < GIVEN ? features[c * count + x] : 0;
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
