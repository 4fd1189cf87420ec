/* Loops that NumPy and OpenCV do not have; native.py loads them and says what each promises.

   Plain C11 on arrays: no Python, no allocation, no state, so that threads may call at will. */

#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(__x86_64__) && !defined(__GLIBC__) && !defined(ITMO_ONE_TARGET)
#define ITMO_ONE_TARGET
#endif
#if defined(__x86_64__) && !defined(ITMO_ONE_TARGET)
#define CLONED __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define CLONED
#endif
#if defined(__x86_64__) && !defined(__FMA__) && defined(ITMO_ONE_TARGET)
#define FMA(a, b, c) ((a) * (b) + (c)) /* a library's would take twenty times as long */
#else
#define FMA fmaf
#endif
#define INLINE static inline __attribute__((always_inline))

/* ---- deflate with literals alone (RFC 1951, block type 10, no matches) ---- */

enum {
    LITERALS = 257,     /* the bytes and the end of the block */
    END = 256,
    LONGEST = 14,       /* bits: four codes and seven bits that wait go into a word of 64 */
    LENGTH_SYMBOLS = 19,
    LENGTH_LONGEST = 7, /* bits, by RFC 1951 3.2.7 */
    HEADER_ROOM = 1024
};

typedef struct {
    uint8_t *at;
    uint64_t bits;
    unsigned count;
} Writer;

typedef struct {
    uint32_t code[LITERALS]; /* bit-reversed code, its length in bits above bit 16 */
    uint8_t header[HEADER_ROOM];
    unsigned header_bits; /* without the bit that says whether the block is the last */
} Block;

/* Needs eight bytes of room; `count` bits at most 57 before the call. */
INLINE void flush(Writer *w)
{
    memcpy(w->at, &w->bits, 8); /* native.py keeps to little-endian machines */
    w->at += w->count >> 3;
    w->bits >>= w->count & ~7u;
    w->count &= 7;
}

INLINE void put(Writer *w, uint32_t bits, unsigned count)
{
    w->bits |= (uint64_t)bits << w->count;
    w->count += count;
    flush(w);
}

/* Code lengths of least total, none above `longest`, for symbols that occur; 0 for the others.

   The two-queue construction on sorted counts (Moffat and Katajainen 1995), then the lengths that
   are too long are brought down and paid for by the rarest symbols that are not. */
static void code_lengths(const uint32_t *counts, int symbols, int longest, uint8_t *lengths)
{
    uint32_t weight[LITERALS];
    uint16_t order[LITERALS], from[LITERALS];
    int parent[2 * LITERALS], depth[2 * LITERALS];
    uint64_t node[2 * LITERALS];
    uint32_t per_length[LITERALS + 1] = {0};
    int used = 0;
    memset(lengths, 0, symbols);
    for (int s = 0; s < symbols; s++)
        if (counts[s]) {
            weight[s] = counts[s];
            order[used++] = (uint16_t)s;
        }
    /* Sorted by bytes of the count, the least first; equal counts stay in the symbols' order. */
    for (int shift = 0; shift < 32; shift += 8) {
        int start[257] = {0};
        for (int i = 0; i < used; i++)
            start[(weight[order[i]] >> shift & 255) + 1]++;
        for (int i = 0; i < 256; i++)
            start[i + 1] += start[i];
        memcpy(from, order, used * sizeof *order);
        for (int i = 0; i < used; i++)
            order[start[weight[from[i]] >> shift & 255]++] = from[i];
    }
    for (int i = 0; i < used; i++)
        node[i] = weight[order[i]];
    int leaf = 0, inner = used;
    for (int made = used; made < 2 * used - 1; made++) {
        node[made] = 0;
        for (int child = 0; child < 2; child++) {
            int least = leaf < used && (inner >= made || node[leaf] <= node[inner]) ? leaf++ : inner++;
            node[made] += node[least];
            parent[least] = made;
        }
    }
    depth[2 * used - 2] = 0;
    for (int i = 2 * used - 3; i >= 0; i--)
        depth[i] = depth[parent[i]] + 1;
    uint64_t taken = 0, whole = (uint64_t)1 << longest; /* Kraft's sum in units of the longest code */
    for (int i = 0; i < used; i++) {
        int length = depth[i] < longest ? depth[i] : longest;
        per_length[length]++;
        taken += whole >> length;
    }
    while (taken > whole) { /* a shorter code made one longer gives room: the longest such gives least */
        int length = longest - 1;
        while (!per_length[length])
            length--;
        per_length[length]--;
        per_length[length + 1]++;
        taken -= whole >> (length + 1);
    }
    while (taken < whole) { /* what is left over shortens the longest codes that it can */
        int length = longest;
        while (!per_length[length] || taken + (whole >> length) > whole)
            length--;
        per_length[length]--;
        per_length[length - 1]++;
        taken += whole >> length;
    }
    for (int length = longest, i = 0; length > 0; length--)
        for (uint32_t n = 0; n < per_length[length]; n++)
            lengths[order[i++]] = (uint8_t)length;
}

/* Canonical codes (RFC 1951 3.2.2), first bit lowest, with their lengths above bit 16. */
static void codes_of(const uint8_t *lengths, int symbols, uint32_t *codes)
{
    uint32_t next[16] = {0}, count[16] = {0}, code = 0;
    for (int s = 0; s < symbols; s++)
        count[lengths[s]]++;
    count[0] = 0;
    for (int length = 1; length < 16; length++)
        next[length] = code = (code + count[length - 1]) << 1;
    for (int s = 0; s < symbols; s++) {
        uint32_t forward = lengths[s] ? next[lengths[s]]++ : 0, reversed = 0;
        for (int bit = 0; bit < lengths[s]; bit++)
            reversed |= (forward >> bit & 1) << (lengths[s] - 1 - bit);
        codes[s] = reversed | (uint32_t)lengths[s] << 16;
    }
}

/* Codes for these counts, and the block's header that tells them (RFC 1951 3.2.7). */
static void make_block(const uint32_t *counts, Block *block)
{
    static const uint8_t sent[LENGTH_SYMBOLS] = {16, 17, 18, 0, 8, 7, 9, 6, 10, 5,
                                                 11, 4, 12, 3, 13, 2, 14, 1, 15};
    uint8_t lengths[LITERALS + 2], symbol[LITERALS + 2], extra[LITERALS + 2];
    uint8_t length_lengths[LENGTH_SYMBOLS];
    uint32_t length_counts[LENGTH_SYMBOLS] = {0}, length_codes[LENGTH_SYMBOLS];
    int runs = 0, last = LENGTH_SYMBOLS;
    code_lengths(counts, LITERALS, LONGEST, lengths);
    codes_of(lengths, LITERALS, block->code);
    lengths[LITERALS] = lengths[LITERALS + 1] = 1; /* two distances, never used: some want a whole code */
    for (int i = 0, run; i < LITERALS + 2; i += run) {
        for (run = 1; i + run < LITERALS + 2 && lengths[i + run] == lengths[i];)
            run++;
        int repeats = i > 0 && lengths[i] == lengths[i - 1];
        if (lengths[i] == 0 && run >= 11) {
            run = run < 138 ? run : 138;
            symbol[runs] = 18, extra[runs] = (uint8_t)(run - 11);
        } else if (lengths[i] == 0 && run >= 3) {
            symbol[runs] = 17, extra[runs] = (uint8_t)(run - 3);
        } else if (lengths[i] != 0 && repeats && run >= 3) {
            run = run < 6 ? run : 6;
            symbol[runs] = 16, extra[runs] = (uint8_t)(run - 3);
        } else {
            run = 1;
            symbol[runs] = lengths[i], extra[runs] = 0;
        }
        length_counts[symbol[runs++]]++;
    }
    code_lengths(length_counts, LENGTH_SYMBOLS, LENGTH_LONGEST, length_lengths);
    codes_of(length_lengths, LENGTH_SYMBOLS, length_codes);
    while (!length_lengths[sent[last - 1]])
        last--;
    Writer w = {block->header, 0, 0};
    put(&w, 2, 2); /* codes of its own */
    put(&w, LITERALS - 257, 5);
    put(&w, 2 - 1, 5);
    put(&w, (uint32_t)last - 4, 4);
    for (int i = 0; i < last; i++)
        put(&w, length_lengths[sent[i]], 3);
    for (int i = 0; i < runs; i++) {
        uint32_t code = length_codes[symbol[i]];
        put(&w, code & 0xffff, code >> 16);
        if (symbol[i] >= 16)
            put(&w, extra[i], symbol[i] == 16 ? 2 : symbol[i] == 17 ? 3 : 7);
    }
    block->header_bits = (unsigned)(w.at - block->header) * 8 + w.count;
}

INLINE void put_block(Writer *w, const Block *block, const uint8_t *bytes, int64_t size, int is_last)
{
    put(w, (uint32_t)is_last, 1);
    for (unsigned bit = 0; bit < block->header_bits; bit += 8) {
        unsigned left = block->header_bits - bit;
        put(w, block->header[bit >> 3], left < 8 ? left : 8);
    }
    int64_t i = 0;
    for (; i + 4 <= size; i += 4) {
        uint32_t a = block->code[bytes[i]], b = block->code[bytes[i + 1]];
        uint32_t c = block->code[bytes[i + 2]], d = block->code[bytes[i + 3]];
        uint64_t ab = (a & 0xffff) | (uint64_t)(b & 0xffff) << (a >> 16);
        uint64_t cd = (c & 0xffff) | (uint64_t)(d & 0xffff) << (c >> 16);
        unsigned ab_count = (a >> 16) + (b >> 16);
        w->bits |= (ab | cd << ab_count) << w->count;
        w->count += ab_count + (c >> 16) + (d >> 16);
        flush(w);
    }
    for (; i < size; i++)
        put(w, block->code[bytes[i]] & 0xffff, block->code[bytes[i]] >> 16);
    put(w, block->code[END] & 0xffff, block->code[END] >> 16);
}

INLINE void count_bytes(const uint8_t *bytes, int64_t size, uint32_t counts[4][LITERALS])
{
    int64_t i = 0;
    for (; i + 4 <= size; i += 4)
        for (int k = 0; k < 4; k++) /* apart, as equal neighbours would wait for each other */
            counts[k][bytes[i + k]]++;
    for (; i < size; i++)
        counts[0][bytes[i]]++;
}

INLINE uint32_t adler32(const uint8_t *bytes, int64_t size)
{
    uint64_t one = 1, two = 0;
    while (size > 0) {
        int64_t part = size < 5536 ? size : 5536, i = 0;
        uint32_t sum[16] = {0}, sums[16] = {0};
        two += one * (uint64_t)part;
        for (; i + 16 <= part; i += 16)
            for (int k = 0; k < 16; k++) {
                sums[k] += sum[k];
                sum[k] += bytes[i + k];
            }
        int64_t tail = part - i;
        for (int k = 0; k < 16; k++) {
            one += sum[k];
            two += (uint64_t)16 * sums[k] + (uint64_t)(16 - k + tail) * sum[k];
        }
        for (; i < part; i++) {
            one += bytes[i];
            two += (uint64_t)(part - i) * bytes[i];
        }
        one %= 65521;
        two %= 65521;
        bytes += part;
        size -= part;
    }
    return (uint32_t)(two << 16 | one);
}

/* See native.pack_literals. `out` has room for each row's size * 14 / 8 + 2 * HEADER_ROOM. */
CLONED void itmo_pack_literals(const uint8_t *rows, int64_t count, int64_t size, uint8_t *out,
                               int64_t *ends)
{
    Block block[2];
    int64_t half = size / 2;
    for (int b = 0; b < 2; b++) {
        uint32_t counts[4][LITERALS] = {{0}};
        for (int64_t row = 0; row < count; row++)
            count_bytes(rows + row * size + b * half, b ? size - half : half, counts);
        for (int k = 1; k < 4; k++)
            for (int s = 0; s < 256; s++)
                counts[0][s] += counts[k][s];
        counts[0][END] = (uint32_t)count;
        make_block(counts[0], &block[b]);
    }
    Writer w = {out, 0, 0};
    for (int64_t row = 0; row < count; row++) {
        const uint8_t *bytes = rows + row * size;
        put(&w, 0x0178, 16); /* zlib's header: 32 KiB window, fastest */
        put_block(&w, &block[0], bytes, half, 0);
        put_block(&w, &block[1], bytes + half, size - half, 1);
        w.at += w.count > 0;
        w.bits = w.count = 0;
        uint32_t sum = adler32(bytes, size);
        for (int shift = 24; shift >= 0; shift -= 8)
            *w.at++ = (uint8_t)(sum >> shift);
        ends[row] = w.at - out;
    }
}

/* ---- from Y'CbCr codes to linear light ---- */

INLINE float between(float value, float least, float most)
{
    value = value > least ? value : least;
    return value < most ? value : most;
}

/* x to the power g, for x from 1e-8 to 1 and g from 1 to 4, within 6e-6, and 1 of 1.

   2 to the power g log2 x. The logarithm of a mantissa m around 1 by its series in (m - 1) / (m + 1),
   the power of a fraction by its own; fma is the same on every machine. */
INLINE float power(float x, float g)
{
    int32_t bits, mantissa_bits, scale_bits;
    float mantissa, scale;
    memcpy(&bits, &x, 4);
    int32_t exponent = (bits - 0x3f3504f3) >> 23; /* the mantissa between the roots of 1/2 and 2 */
    mantissa_bits = bits - exponent * (1 << 23);
    memcpy(&mantissa, &mantissa_bits, 4);
    float s = (mantissa - 1) / (mantissa + 1), q = s * s;
    float series = FMA(FMA(FMA(FMA(0.32059889f, q, 0.41219859f), q, 0.57707802f), q, 0.96179669f),
                        q, 2.88539008f);
    float whole_and_rest = g * FMA(s, series, (float)exponent);
    int32_t whole = (int32_t)(whole_and_rest - 0.5f); /* the nearest, as none is above 0 */
    float f = whole_and_rest - (float)whole;
    float p = FMA(FMA(FMA(FMA(FMA(FMA(0.00015469f, f, 0.00133336f), f, 0.00961813f), f, 0.05550411f),
                             f, 0.24022651f), f, 0.69314718f), f, 1);
    scale_bits = (whole + 127) * (1 << 23);
    memcpy(&scale, &scale_bits, 4);
    return p * scale;
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

/* ---- the camera's motion ---- */

enum { LANES = 8, SUMS = 12 }; /* sums are added up side by side, in one order on all machines */

/* What a place adds to the upper half of the normal equations and to their two right sides. */
INLINE void add_place(double w, double x, double y, double u, double v, int lane,
                      double sums[SUMS][LANES])
{
    double wx = w * x, wy = w * y;
    sums[0][lane] += w;
    sums[1][lane] += wx;
    sums[2][lane] += wy;
    sums[3][lane] += wx * x;
    sums[4][lane] += wx * y;
    sums[5][lane] += wy * y;
    sums[6][lane] += w * u;
    sums[7][lane] += wx * u;
    sums[8][lane] += wy * u;
    sums[9][lane] += w * v;
    sums[10][lane] += wx * v;
    sums[11][lane] += wy * v;
}

/* Solve three symmetric, positive definite equations by elimination. */
INLINE void solve(const double *sum, const double *right, double *out)
{
    double a = sum[1] / sum[0], b = sum[2] / sum[0];
    double xx = sum[3] - a * sum[1], xy = sum[4] - a * sum[2], yy = sum[5] - b * sum[2];
    double rx = right[1] - a * right[0], ry = right[2] - b * right[0], c = xy / xx;
    out[2] = (ry - c * rx) / (yy - c * xy);
    out[1] = (rx - xy * out[2]) / xx;
    out[0] = (right[0] - sum[1] * out[1] - sum[2] * out[2]) / sum[0];
}

/* See native.camera_model. */
CLONED void itmo_camera_model(const double *across, const double *down, const double *vectors,
                              const double *texture, int64_t count, const double *sigmas,
                              int64_t rounds, double ridge, double *weight, double *model)
{
    const double *u = vectors, *v = vectors + count;
    memcpy(weight, texture, count * sizeof *weight);
    for (int64_t round = 0; round < rounds; round++) {
        double sums[SUMS][LANES] = {{0}}, sum[SUMS];
        int64_t i = 0;
        for (; i + LANES <= count; i += LANES)
            for (int k = 0; k < LANES; k++)
                add_place(weight[i + k], across[i + k], down[i + k], u[i + k], v[i + k], k, sums);
        for (; i < count; i++)
            add_place(weight[i], across[i], down[i], u[i], v[i], 0, sums);
        for (int s = 0; s < SUMS; s++) {
            sum[s] = 0;
            for (int k = 0; k < LANES; k++)
                sum[s] += sums[s][k];
        }
        sum[3] += ridge * sum[0];
        sum[5] += ridge * sum[0];
        solve(sum, sum + 6, model);
        solve(sum, sum + 9, model + 3);
        double scale = 1 / (sigmas[round] * sigmas[round]);
        for (i = 0; i < count; i++) {
            double off_x = u[i] - (model[0] + model[1] * across[i] + model[2] * down[i]);
            double off_y = v[i] - (model[3] + model[4] * across[i] + model[5] * down[i]);
            double far = 1 + (off_x * off_x + off_y * off_y) * scale;
            weight[i] = texture[i] / (far * far);
        }
    }
}

/* ---- the guided filter, at analysis size ---- */

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
        for (int p = 0; p < planes; p++) /* side by side, as each waits for its own last */
            sums[p * w + x] = sum[p] += steps[p * w + x];
}

/* A row of two planes, with `products` their guide * guide and guide * map as well, into the column
   sums or, by a sign of -1, out of them. */
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

/* See native.guided_coefficients. `scratch` holds 4 * (3 * w + 2 * radius + 1) doubles. */
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

/* ---- maps and the noise guard, brought up to rows of the picture ---- */

enum { AT_ONCE = 8, REACH = 2, WINDOW = 2 * REACH + 1 }; /* WINDOW: the softening's five taps */

/* Each plane's line of w to one of width: between columns i - 1 and i from starts[i] on, AT_ONCE
   at a time; what is written too far is written again by the next. `lefts` and `steps` hold w + 1
   for each plane, `out` across. */
INLINE void widen(const float *lefts, const float *steps, int64_t planes, int64_t w, int64_t across,
                  const int32_t *starts, const float *shares, float *restrict out)
{
    for (int64_t i = 0; i <= w; i++) {
        int32_t x = starts[i];
        do
            for (int64_t p = 0; p < planes; p++) {
                float left = lefts[p * (w + 1) + i], step = steps[p * (w + 1) + i];
                for (int k = 0; k < AT_ONCE; k++)
                    out[p * across + x + k] = left + step * shares[x + k];
            }
        while ((x += AT_ONCE) < starts[i + 1]);
    }
}

/* Where a line of the picture is kept: WINDOW lines in turn. `y` may be down to -REACH. */
INLINE float *slot(float *lines, int64_t y, int64_t width)
{
    return lines + (y + WINDOW) % WINDOW * width;
}

/* A line of codes from black at 0 to white at 1 into its slot; beyond the picture its edge's. */
INLINE void code_line(const uint8_t *luma, int64_t stride, int64_t bytes, float scale, float offset,
                      int64_t height, int64_t y, int64_t width, float *lines)
{
    const uint8_t *narrow = luma + (y < 0 ? 0 : y < height ? y : height - 1) * stride;
    const uint16_t *wide = (const uint16_t *)narrow;
    const float *values = (const float *)narrow;
    float *restrict out = slot(lines, y, width);
    for (int64_t x = 0; bytes == 1 && x < width; x++)
        out[x] = FMA((float)narrow[x], scale, offset);
    for (int64_t x = 0; bytes == 2 && x < width; x++)
        out[x] = FMA((float)wide[x], scale, offset);
    for (int64_t x = 0; bytes == 4 && x < width; x++)
        out[x] = FMA(values[x], scale, offset);
}

/* See native.guide_rows. */
CLONED void itmo_guide_rows(const uint8_t *luma, int64_t stride, int64_t bytes, float scale,
                            float offset, int64_t height, int64_t top, int64_t rows,
                            int64_t width, const float *small, int64_t planes, int64_t h, int64_t w,
                            const int64_t *above, const float *parts, const int32_t *starts,
                            const float *shares, int64_t guards, int64_t edge_aware, float *scratch,
                            float *ratio, float *maps)
{
    int64_t across = width + 2 * AT_ONCE, after = guards ? 2 : 0;
    float *lefts = scratch, *steps = lefts + planes * (w + 1), *soft = steps + planes * (w + 1);
    float *summed = soft + across, *lines = summed + across, *wide = lines + WINDOW * width;
    for (int64_t y = top - REACH; y < top + REACH; y++)
        code_line(luma, stride, bytes, scale, offset, height, y, width, lines);
    for (int64_t row = 0; row < rows; row++) {
        int64_t y = top + row;
        const float *code = slot(lines, y, width);
        code_line(luma, stride, bytes, scale, offset, height, y + REACH, width, lines);
        for (int64_t p = 0; p < planes; p++) {
            const float *upper = small + (p * h + above[row]) * w;
            const float *lower = above[row] + 1 < h ? upper + w : upper;
            float part = parts[row], rest = 1 - part;
            float *restrict left = lefts + p * (w + 1), *restrict step = steps + p * (w + 1);
            for (int64_t x = 0; x < w; x++)
                left[x + 1] = upper[x] * rest + lower[x] * part;
            left[0] = left[1];
            for (int64_t x = 0; x < w; x++)
                step[x] = left[x + 1] - left[x];
            step[w] = 0;
        }
        widen(lefts, steps, planes, w, across, starts, shares, wide);
        if (guards) {
            float *restrict out = ratio + row * width;
            const float *slope = wide, *offset = wide + across;
            for (int64_t x = 0; x < width; x++) {
                float light = code[x] > 0.02f ? code[x] : 0.02f;
                out[x] = between((slope[x] * code[x] + offset[x]) / light, -0.5f, 1) + 1;
            }
        }
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

int itmo_version(void)
{
    return 7;
}
