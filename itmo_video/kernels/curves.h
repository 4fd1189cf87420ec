/* PQ and HLG for single numbers, without a branch or a library's call, like numbers.h. */

#ifndef ITMO_CURVES_H
#define ITMO_CURVES_H

#include "numbers.h"

/* PQ's code, 0 to 1, of light in nits from 0 to 10000, within 1.7e-5, which is 0.015 of a 10-bit
   step; 0 below 2^-20 nits, a tenth of a step.

   One polynomial in the mantissa, plus the exponent, gives the logarithm, scaled to -1 to 1 over the
   range; a second one in that gives the code. Both are minimax fits; tests/delivery/test_to_codes.py compares
   with ST 2084. */
static const float PQ_LEAST = 1.0f / (1 << 20), PQ_PER_OCTAVE = 0.0600822303f;
static const float PQ_MANTISSA[5] = {-7.5801956f, 0.245519014f, -0.128223579f, 0.039036125f,
                                     -0.00493459467f};
static const float PQ_CODE[12] = {
    0.0617081372f, 0.30157362f, 0.590067096f, 0.466458405f, -0.137586944f, -0.462743102f,
    -0.0639839913f, 0.292135035f, 0.0709862211f, -0.122193831f, -0.0211404018f, 0.02471162f};

/* Without inner loops, so that compilers vectorise the loop around it, and as two sums, which processors
   calculate at the same time. */
INLINE float pq_of(float nits)
{
    const float *a = PQ_MANTISSA, *c = PQ_CODE;
    uint32_t bits, mantissa_bits;
    float m;
    memcpy(&bits, &nits, 4);
    mantissa_bits = (bits & 0x007fffff) | 0x3f800000;
    memcpy(&m, &mantissa_bits, 4);
    float square = m * m, whole = FMA((float)(int32_t)(bits >> 23), PQ_PER_OCTAVE, a[0]);
    float s = FMA(FMA(a[4], square, FMA(a[3], m, a[2])), square, FMA(a[1], m, whole));
    square = s * s;
    float even = FMA(FMA(FMA(c[10], square, c[8]), square, c[6]), square, c[4]);
    float odd = FMA(FMA(FMA(c[11], square, c[9]), square, c[7]), square, c[5]);
    even = FMA(FMA(even, square, c[2]), square, c[0]);
    odd = FMA(FMA(odd, square, c[3]), square, c[1]);
    return nits >= PQ_LEAST ? FMA(odd, s, even) : 0;
}

/* HLG's code, 0 to 1, of scene light from 0 to 1: BT.2100-2, table 5. */
INLINE float hlg_of(float scene)
{
    const float a = 0.17883277f, b = 0.28466892f, c = 0.55991073f, ln_two = 0.69314718f;
    float above = FMA(12, scene, -b);
    float log = FMA(log_two(above > 0.5f ? above : 0.5f), a * ln_two, c);
    return scene <= 1.0f / 12 ? sqrtf(3 * scene) : log;
}

#endif
