/* Shared definitions and the prototypes of the kernels. library.py loads them; compiled*.py document
   what each does.

   Plain C11 on arrays: no Python, no allocation, no state, so that threads may call at will. */

#ifndef ITMO_LOOPS_H
#define ITMO_LOOPS_H

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
#define FMA(a, b, c) ((a) * (b) + (c)) /* the C library's takes twenty times as long */
#else
#define FMA fmaf
#endif
#define INLINE static inline __attribute__((always_inline))

INLINE float between(float value, float least, float most)
{
    value = value > least ? value : least;
    return value < most ? value : most;
}

/* library.py's table has the same arguments; a test compares. */
void itmo_pack_literals(const uint8_t *rows, int64_t count, int64_t size, uint8_t *out,
    int64_t *ends);
void itmo_guided_coefficients(const float *map, const float *guide, int64_t h, int64_t w,
    int64_t radius, float epsilon, const float *share, double *scratch, float *between_a,
    float *between_b, float *out_a, float *out_b);
void itmo_guide_rows(const uint8_t *luma, int64_t stride, int64_t bytes, float scale,
    float offset, int64_t height, int64_t top, int64_t rows, int64_t width, const float *small,
    int64_t planes, int64_t h, int64_t w, const int64_t *above, const float *parts,
    const int32_t *starts, const float *shares, int64_t guards, int64_t edge_aware,
    float *scratch, float *ratio, float *maps);
void itmo_ycbcr_rows(const uint8_t *luma, const uint8_t *cb, const uint8_t *cr,
    int64_t luma_stride, const int64_t *chroma_strides, int64_t bytes, int64_t width,
    int64_t chroma_width, int64_t chroma_height, int64_t first, int64_t rows, int64_t site_x,
    int64_t site_y, const float *levels, const float *matrix, const float *power, float *scratch,
    float *red, float *green, float *blue);
void itmo_halved_light(const uint8_t *luma, const uint8_t *cb, const uint8_t *cr,
    int64_t luma_stride, const int64_t *chroma_strides, int64_t bytes, int64_t width,
    int64_t chroma_width, int64_t chroma_height, int64_t first, int64_t rows, int64_t site_x,
    int64_t site_y, const float *levels, const float *matrix, const float *power, float *scratch,
    float *red, float *green, float *blue);
void itmo_weighted_sum(const float *red, const float *green, const float *blue,
    const float *weights, const float *ratio, int64_t count, float *restrict out);
void itmo_gain_banterle2006(const float *luminance, float slope, float factor, int64_t count,
    float *restrict out);
void itmo_gain_auto(const float *red, const float *green, const float *blue, const float *ratio,
    const float *map_red, const float *map_green, const float *map_blue, const float *map_curve,
    const float *n, int64_t rows, int64_t width, float *scratch, float *restrict out_red,
    float *restrict out_green, float *restrict out_blue);
void itmo_ramps(const float *values, float low, float scale, int64_t count, float *restrict out);
void itmo_expand_auto(const float *red, const float *green, const float *blue, const float *ratio,
    const float *map_red, const float *map_green, const float *map_blue, const float *map_curve,
    const float *n, float strength, int64_t rows, int64_t width, float *scratch,
    uint16_t *restrict out_red, uint16_t *restrict out_green, uint16_t *restrict out_blue);
void itmo_auto_from_codes(const uint8_t *luma, const uint8_t *cb, const uint8_t *cr,
    int64_t luma_stride, const int64_t *chroma_strides, const int64_t *sizes, const float *light,
    const float *power, const float *small, const int64_t *above, const float *parts,
    const int32_t *columns, const float *shares, const int64_t *which, const uint8_t *used,
    const float *n, float *scratch, uint16_t *out_red, uint16_t *out_green, uint16_t *out_blue);
void itmo_add_weighed(const float *values, const float *weight, int64_t count, int64_t channels,
    float *restrict total);
void itmo_blend(const float *left, const float *right, const float *share, int64_t count,
    int64_t channels, float *restrict out);
void itmo_halves(const float *values, int64_t count, uint16_t *out);
void itmo_expand(const float *red, const float *green, const float *blue, const float *gain,
    const float *map, float base, float strength, float rest, int64_t count, uint16_t *red_out,
    uint16_t *green_out, uint16_t *blue_out);
void itmo_to_codes(const uint8_t *red, const uint8_t *green, const uint8_t *blue,
    const int64_t *strides, const int64_t *sizes, const float *numbers,
    const float *factors, const float *noise, uint16_t *luma, uint16_t *cb, uint16_t *cr,
    double *light);
void itmo_camera_model(const double *across, const double *down, const double *vectors,
    const double *texture, int64_t count, const double *sigmas, int64_t rounds, double ridge,
    double *weight, double *model);
void itmo_area_means(const uint8_t *plane, int64_t stride, int64_t bytes, const int64_t *sizes,
    const int32_t *columns, const float *column_shares, const int32_t *rows,
    const float *row_shares, float *scratch, uint8_t *out);
void itmo_blurred(const float *planes, int64_t height, int64_t width, int64_t channels, int64_t half,
    const float *weights, float *scratch, float *out);
void itmo_greatest(const float *rgb, int64_t count, float *restrict out);
void itmo_luminance(const float *rgb, int64_t count, float *restrict out);
void itmo_weighed_by_light(const float *rgb, float low, float scale, int64_t count,
    float *restrict weight, float *restrict out);
void itmo_mean_colour(const float *around, const float *own, const float *weight, float trace,
    int64_t count, float *restrict out);
void itmo_share_ramps(const float *part, const float *all, float least, float low, float scale,
    int64_t count, float *restrict out);
void itmo_with_near(const float *known, const float *around, float low, float scale,
    int64_t count, float *restrict out);
void itmo_bounded_parting(const float *levels, const float *colour, const float *lost,
    const float *n, int64_t count, float *restrict out);
void itmo_held_together(const float *stops, const float *lost, const float *decided,
    int64_t count, float *restrict out);
void itmo_network(const float *features, int64_t height, int64_t width, const float *weights,
    float *scratch, float *out);
void itmo_network_features(const float *codes, int64_t height, int64_t width, float slope,
    float centre, float most, float step, float *restrict out);
void itmo_srgb_codes(const float *light, int64_t count, float *restrict out);
void itmo_network_filters(const float *filters, int64_t kept, int64_t channels, int64_t padded,
    float *out);
int itmo_version(void);

#endif
