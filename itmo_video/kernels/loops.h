/* What the loops share. They do what NumPy and OpenCV do not; native.py loads them and says what
   each promises.

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
#define FMA(a, b, c) ((a) * (b) + (c)) /* a library's would take twenty times as long */
#else
#define FMA fmaf
#endif
#define INLINE static inline __attribute__((always_inline))

INLINE float between(float value, float least, float most)
{
    value = value > least ? value : least;
    return value < most ? value : most;
}

#endif
