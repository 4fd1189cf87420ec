/* Powers, logarithms and half floats of single numbers, without branches or library calls, so that
   compilers vectorise the loops around them; the same results on every machine with FMA. And eight numbers
   at once, for loops that compilers do not vectorise. */

#ifndef ITMO_NUMBERS_H
#define ITMO_NUMBERS_H

#include "loops.h"

enum { LANES = 8 };
typedef float Eight __attribute__((vector_size(32), aligned(4), may_alias));

#define EIGHT(at) (*(Eight *)(at)) /* not a function, as vectors are returned differently without AVX */

/* 2 to the power x, from -126 to 127, within 2e-7; `whole` is a whole number near x. */
INLINE float two_to(float x, int32_t whole)
{
    float f = x - (float)whole, scale;
    float p = FMA(FMA(FMA(FMA(FMA(FMA(0.00015469f, f, 0.00133336f), f, 0.00961813f), f, 0.05550411f),
                             f, 0.24022651f), f, 0.69314718f), f, 1);
    int32_t scale_bits = (whole + 127) * (1 << 23);
    memcpy(&scale, &scale_bits, 4);
    return p * scale;
}

/* 0 up to `low`, 1 from 1 / `scale` above it on, smooth in between. */
INLINE float ramp_of(float value, float low, float scale)
{
    float t = between((value - low) * scale, 0, 1);
    return t * t * (3 - 2 * t);
}

/* A whole number nearest to x, from -1000 to 1000, or next to that; without a branch. */
INLINE int32_t nearest(float x)
{
    return (int32_t)(x + 1000.5f) - 1000;
}

/* The binary logarithm of x from 1e-8 on, within 4e-7. */
INLINE float log_two(float x)
{
    int32_t bits, mantissa_bits;
    float mantissa;
    memcpy(&bits, &x, 4);
    int32_t exponent = (bits - 0x3f3504f3) >> 23;
    mantissa_bits = bits - exponent * (1 << 23);
    memcpy(&mantissa, &mantissa_bits, 4);
    float s = (mantissa - 1) / (mantissa + 1), q = s * s;
    float series = FMA(FMA(FMA(FMA(0.32059889f, q, 0.41219859f), q, 0.57707802f), q, 0.96179669f),
                        q, 2.88539008f);
    return FMA(s, series, (float)exponent);
}

/* Round to the nearest half, ties to even; overflow becomes infinity. For finite values; with
   integers, as not every compiler has the instruction. */
INLINE uint16_t half_of(float value)
{
    const float subnormal_step = 0.5f; /* its last place is the smallest half */
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

#endif
