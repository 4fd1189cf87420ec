/* Deflate with literals alone (RFC 1951, block type 10, no matches). */

#include "loops.h"

enum {
    LITERALS = 257,     /* the bytes and the end of the block */
    END = 256,
    LONGEST = 14,       /* bits: four codes and seven pending bits fit into 64 bits */
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
    memcpy(w->at, &w->bits, 8); /* library.py accepts little-endian machines only */
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

/* Code lengths with the smallest total, at most `longest`, for symbols that occur; 0 for others.

   The two-queue construction on sorted counts (Moffat and Katajainen 1995); then lengths above the
   limit are reduced and the rarest symbols below it lengthened in return. */
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
    /* Sorted by bytes of the count, lowest first; equal counts stay in symbol order. */
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
    while (taken > whole) { /* lengthening a shorter code frees space; the longest such code frees least */
        int length = longest - 1;
        while (!per_length[length])
            length--;
        per_length[length]--;
        per_length[length + 1]++;
        taken -= whole >> (length + 1);
    }
    while (taken < whole) { /* the remaining space shortens the longest codes possible */
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

/* Canonical codes (RFC 1951 3.2.2), first bit lowest, with their lengths from bit 16 on. */
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

/* Codes for these counts, and the block header that encodes them (RFC 1951 3.2.7). */
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
    lengths[LITERALS] = lengths[LITERALS + 1] = 1; /* two, never used: some decoders require a complete code */
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
        for (int k = 0; k < 4; k++) /* separate, as equal neighbours would depend on each other */
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

/* See compiled.pack_literals. `out` has room for each row's size * 14 / 8 + 2 * HEADER_ROOM. */
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
