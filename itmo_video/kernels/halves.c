/* A line of floats to half floats: by the processor's own instruction where it has one, else by
   integers; both to the nearest, of two as near the even one, so they give the same bytes. */

#include "numbers.h"

#if defined(__x86_64__) && !defined(ITMO_ONE_TARGET)
#include <immintrin.h>

__attribute__((target("avx,f16c"))) static int64_t by_instruction(const float *values, int64_t count,
                                                                  uint16_t *out)
{
    int64_t x = 0;
    for (; x + 8 <= count; x += 8) {
        __m128i halves = _mm256_cvtps_ph(_mm256_loadu_ps(values + x), _MM_FROUND_TO_NEAREST_INT);
        _mm_storeu_si128((__m128i *)(out + x), halves);
    }
    return x;
}
#endif

CLONED void itmo_halves(const float *values, int64_t count, uint16_t *restrict out)
{
    int64_t x = 0;
#if defined(__x86_64__) && !defined(ITMO_ONE_TARGET)
    if (__builtin_cpu_supports("f16c"))
        x = by_instruction(values, count, out);
#endif
    for (; x < count; x++)
        out[x] = half_of(values[x]);
}
