/* Linear light, or R'G'B', to dithered Y'CbCr codes in one pass, for films and Y4M: a run of pixels of
   a line at a time, which stays in the first cache. */

#include "runs.h"

/* The noise for a run of a row. The tile is stored twice, side by side. */
INLINE const float *noise_at(const float *noise, const int64_t *place, int64_t row, int64_t begin)
{
    return noise + (place[1] + row) % TILE * 2 * TILE + (place[0] + begin) % TILE;
}

/* See compiled_codes.light_to_codes. */
CLONED void itmo_to_codes(const uint8_t *red, const uint8_t *green, const uint8_t *blue,
                          const int64_t *strides, const int64_t *sizes, const float *n,
                          const float *factors, const float *noise, uint16_t *luma, uint16_t *cb,
                          uint16_t *cr, double *light)
{
    const uint8_t *planes[3] = {red, green, blue};
    uint16_t *chroma[2] = {cb, cr};
    int64_t bytes = sizes[BYTES], columns = sizes[COLUMNS], across = sizes[ACROSS] != 0;
    int64_t down = sizes[DOWN] != 0, chroma_columns = columns >> across;
    const int64_t *place = sizes + NOISE_AT;
    float rgb[3][RUN], y[RUN], apart[2][2][RUN], line[RUN + 1], narrow[RUN / 2], last[2] = {0};
    float share = (across ? 0.25f : 1) * (down ? 0.5f : 1) * 0.5f * n[CHROMA];
    const float scales[2] = {share / (1 - n[KB]), share / (1 - n[KR])};
    for (int64_t row = 0; row < sizes[ROWS]; row += 1 + down)
        for (int64_t begin = 0; begin < columns; begin += RUN) {
            int64_t left = sizes[WIDTH] - begin < RUN ? sizes[WIDTH] - begin : RUN;
            int64_t kept = columns - begin < RUN ? columns - begin : RUN;
            for (int64_t k = 0; k <= down; k++) {
                int64_t is_there = row + k < sizes[HEIGHT], at = is_there ? row + k : row + k - 1;
                double not_there[2] = {0};
                const uint8_t *lines[3];
                for (int c = 0; c < 3; c++)
                    lines[c] = planes[c] + at * strides[c] + begin * bytes;
                const float *own_noise = noise_at(noise, place, row + k, begin);
                uint16_t *out = luma + (row + k) * columns + begin;
                double *seen = is_there ? light : not_there;
                for (int c = 0; c < 3; c++)
                    load_run(lines[c], bytes, left, rgb[c]);
                if (sizes[CURVE] != AS_IT_IS)
                    to_nits(rgb, n, factors, left, seen);
                if (sizes[CURVE] == HLG)
                    to_scene_root(rgb, n);
                to_luma(rgb, n, sizes[CURVE], y, apart[k][0], apart[k][1]);
                quantised(y, RUN, n[LUMA], n[LUMA + 1], n, own_noise, kept, out);
            }
            for (int c = 0; c < 2; c++) {
                int64_t chroma_row = row >> down, chroma_begin = begin >> across;
                const float *own_noise = noise_at(noise, place + 2 + 2 * c, chroma_row, chroma_begin);
                uint16_t *out = chroma[c] + chroma_row * chroma_columns + chroma_begin;
                for (int64_t x = 0; x < RUN; x++)
                    line[x + 1] = down ? apart[0][c][x] + apart[1][c][x] : apart[0][c][x];
                line[0] = begin ? last[c] : line[1];
                last[c] = line[RUN];
                for (int64_t x = 0; across && x < RUN / 2; x++)
                    narrow[x] = (line[2 * x] + line[2 * x + 2]) + 2 * line[2 * x + 1];
                quantised(across ? narrow : line + 1, RUN >> across, scales[c], n[CHROMA + 1], n,
                          own_noise, kept >> across, out);
            }
        }
}
