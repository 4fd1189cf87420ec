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

/* The binary logarithm of a positive x, within 9e-5: a polynomial in the mantissa (a minimax fit). */
INLINE float rough_log_two(float x)
{
    uint32_t bits, mantissa_bits;
    float m;
    memcpy(&bits, &x, 4);
    mantissa_bits = (bits & 0x007fffff) | 0x3f800000;
    memcpy(&m, &mantissa_bits, 4);
    float square = m * m, whole = (float)((int32_t)(bits >> 23) - 127) - 2.51285462f;
    float upper = FMA(-0.08161581f, square, FMA(0.64514236f, m, -2.12067513f));
    return FMA(upper, square, FMA(4.07009079f, m, whole));
}

/* HLG's code, 0 to 1, of the square root of scene light from 0 to 1 (BT.2100-2, table 5), within 2.4e-5,
   which is 0.021 of a 10-bit step. Above 1/12, where it is a logarithm, a polynomial in the root, scaled
   to -1 to 1 (a minimax fit). */
static const float HLG_CODE[9] = {0.836550255f, 0.209237424f, -0.0641894674f, 0.029890111f, -0.0178993221f,
                                  0.00188102237f, 0.00339583852f, 0.00896802647f, -0.00785730566f};

INLINE float hlg_of_root(float root)
{
    const float *c = HLG_CODE, root_three = 1.73205081f, knee = 0.288675135f;
    float s = FMA(root, 2.81165484f, -1.81165484f), square = s * s;
    float even = FMA(FMA(FMA(c[8], square, c[6]), square, c[4]), square, c[2]);
    float odd = FMA(FMA(FMA(c[7], square, c[5]), square, c[3]), square, c[1]);
    float above = FMA(odd, s, FMA(even, square, c[0]));
    return root <= knee ? root_three * root : above;
}

#endif
