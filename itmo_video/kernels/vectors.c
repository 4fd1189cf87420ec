/* See vectors.h. */

#include "vectors.h"

#if defined(__x86_64__) && !defined(ITMO_ONE_TARGET)
#include <immintrin.h>
#define BY_AVX2 __attribute__((target("avx2,fma,f16c")))
#define HAS_AVX2                                                                                      \
    (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("f16c"))
#endif

/* ---- powers ---- */

/* x to the power g, for x from 2^-15, 0 below, to 1, within 7e-7, and 1 of 1.

   x is (1 + t) * 2^e: `curve` has the coefficients of (1 + t)^g from t on, which is smooth and so
   close to a polynomial, and 2^(g e) for e from -15 to 0. */
enum { DEGREE = 5, LEAST_EXPONENT = 127 - 15 };
static const float LEAST = 1.0f / (1 << 15);

CLONED static void power_plainly(float *restrict values, int64_t count, const float *curve)
{
    const float *scales = curve + DEGREE;
    for (int64_t x = 0; x < count; x++) {
        float value = between(values[x], LEAST, 1), mantissa;
        uint32_t bits, mantissa_bits;
        memcpy(&bits, &value, 4);
        mantissa_bits = (bits & 0x007fffff) | 0x3f800000;
        memcpy(&mantissa, &mantissa_bits, 4);
        float t = mantissa - 1, p = curve[4];
        p = FMA(FMA(FMA(FMA(p, t, curve[3]), t, curve[2]), t, curve[1]), t, curve[0]);
        float light = FMA(p, t, 1) * scales[(bits >> 23) - LEAST_EXPONENT];
        values[x] = values[x] >= LEAST ? light : 0;
    }
}

#ifdef HAS_AVX2
BY_AVX2 static int64_t power_avx2(float *values, int64_t count, const float *curve)
{
    const __m256 least = _mm256_set1_ps(LEAST), one = _mm256_set1_ps(1);
    const __m256i fraction = _mm256_set1_epi32(0x007fffff);
    __m256 low = _mm256_loadu_ps(curve + DEGREE), high = _mm256_loadu_ps(curve + DEGREE + 8), c[DEGREE];
    for (int k = 0; k < DEGREE; k++)
        c[k] = _mm256_set1_ps(curve[k]);
    int64_t x = 0;
    for (; x + 8 <= count; x += 8) {
        __m256 given = _mm256_loadu_ps(values + x);
        __m256 value = _mm256_min_ps(_mm256_max_ps(given, least), one);
        __m256i bits = _mm256_castps_si256(value), number = _mm256_srli_epi32(bits, 23);
        __m256 t = _mm256_or_ps(_mm256_castsi256_ps(_mm256_and_si256(bits, fraction)), one);
        t = _mm256_sub_ps(t, one);
        /* The exponent's last three bits are the lane, the fourth selects the register. */
        __m256 scale = _mm256_blendv_ps(_mm256_permutevar8x32_ps(low, number),
                                        _mm256_permutevar8x32_ps(high, number),
                                        _mm256_castsi256_ps(_mm256_slli_epi32(bits, 5)));
        __m256 p = _mm256_fmadd_ps(c[4], t, c[3]);
        p = _mm256_fmadd_ps(p, t, c[2]);
        p = _mm256_fmadd_ps(p, t, c[1]);
        p = _mm256_fmadd_ps(p, t, c[0]);
        p = _mm256_mul_ps(_mm256_fmadd_ps(p, t, one), scale);
        p = _mm256_and_ps(p, _mm256_cmp_ps(given, least, _CMP_GE_OQ));
        _mm256_storeu_ps(values + x, p);
    }
    return x;
}
#endif

void itmo_power(float *values, int64_t count, const float *curve)
{
    int64_t done = 0;
#ifdef HAS_AVX2
    if (HAS_AVX2)
        done = power_avx2(values, count, curve);
#endif
    power_plainly(values + done, count - done, curve);
}

/* ---- upsampling lines ---- */

#ifdef HAS_AVX2
BY_AVX2 static void widen_avx2(const float *lefts, const float *steps, int64_t planes, int64_t w,
                               int64_t across, const int32_t *columns, const float *shares,
                               int64_t width, float *out)
{
    for (int64_t x = 0; x < width; x += AT_ONCE) {
        int64_t first = columns[x];
        __m256i lane = _mm256_loadu_si256((const __m256i *)(columns + x));
        lane = _mm256_sub_epi32(lane, _mm256_set1_epi32(columns[x]));
        __m256 share = _mm256_loadu_ps(shares + x);
        for (int64_t p = 0; p < planes; p++) {
            const float *left = lefts + p * (w + 1) + first, *step = steps + p * (w + 1) + first;
            __m256 a = _mm256_permutevar8x32_ps(_mm256_loadu_ps(left), lane);
            __m256 b = _mm256_permutevar8x32_ps(_mm256_loadu_ps(step), lane);
            _mm256_storeu_ps(out + p * across + x, _mm256_fmadd_ps(b, share, a));
        }
    }
}
#endif

CLONED static void widen_plainly(const float *lefts, const float *steps, int64_t planes, int64_t w,
                                 int64_t across, const int32_t *columns, const float *shares,
                                 int64_t width, float *restrict out)
{
    for (int64_t x = 0; x < width;) {
        int64_t i = columns[x], next = x;
        while (next < width && columns[next] == i)
            next++;
        for (; x < next; x += AT_ONCE) /* what is written beyond the end is overwritten by the next */
            for (int64_t p = 0; p < planes; p++) {
                float left = lefts[p * (w + 1) + i], step = steps[p * (w + 1) + i];
                for (int k = 0; k < AT_ONCE; k++)
                    out[p * across + x + k] = FMA(step, shares[x + k], left);
            }
        x = next;
    }
}

void itmo_widen(const float *lefts, const float *steps, int64_t planes, int64_t w, int64_t across,
                const int32_t *columns, const float *shares, int64_t width, float *out)
{
#ifdef HAS_AVX2
    if (HAS_AVX2) {
        widen_avx2(lefts, steps, planes, w, across, columns, shares, width, out);
        return;
    }
#endif
    widen_plainly(lefts, steps, planes, w, across, columns, shares, width, out);
}

/* ---- half floats ---- */

#ifdef HAS_AVX2
BY_AVX2 static int64_t halves_f16c(const float *values, int64_t count, uint16_t *out)
{
    int64_t x = 0;
    for (; x + 8 <= count; x += 8) {
        __m128i halves = _mm256_cvtps_ph(_mm256_loadu_ps(values + x), _MM_FROUND_TO_NEAREST_INT);
        _mm_storeu_si128((__m128i *)(out + x), halves);
    }
    return x;
}
#endif

CLONED static void halves_plainly(const float *values, int64_t count, uint16_t *restrict out)
{
    for (int64_t x = 0; x < count; x++)
        out[x] = half_of(values[x]);
}

void itmo_halves(const float *values, int64_t count, uint16_t *out)
{
    int64_t done = 0;
#ifdef HAS_AVX2
    if (HAS_AVX2)
        done = halves_f16c(values, count, out);
#endif
    halves_plainly(values + done, count - done, out + done);
}
