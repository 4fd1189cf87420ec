/* Kernels with a form in AVX2 and F16C intrinsics, which compilers do not find: permuting lanes of a
   register, and half floats. Both forms give the same bytes.
   The prototype of itmo_halves is in loops.h, as Python calls it, too. */

#ifndef ITMO_VECTORS_H
#define ITMO_VECTORS_H

#include "numbers.h"

enum { AT_ONCE = 8 }; /* pixels upsampled at a time, and the padding of lines */

/* Clip values to [0, 1] and raise them to a power, in place; compiled_light.power_curve's constants. */
void itmo_power(float *values, int64_t count, const float *curve);

/* Upsample each of `planes` lines of w + 1 samples, left + step * share, to `width`. Pixel x lies
   between columns[x] - 1 and columns[x], which increase by at most 1. `lefts` and `steps` are padded
   by AT_ONCE, `columns` and `shares` are multiples of AT_ONCE long, lines of `out` are `across` apart. */
void itmo_widen(const float *lefts, const float *steps, int64_t planes, int64_t w, int64_t across,
                const int32_t *columns, const float *shares, int64_t width, float *out);

#endif
