/* Kernels that have a form by AVX2's and F16C's own instructions, which compilers do not find: lanes
   fetched by number from a register, and half floats. Both forms give the same bytes.
   The prototype of itmo_halves is in loops.h, as Python calls it, too. */

#ifndef ITMO_VECTORS_H
#define ITMO_VECTORS_H

#include "numbers.h"

enum { AT_ONCE = 8 }; /* places that are brought up at a time: what lines hold more than they need */

/* Values limited to [0, 1] and raised to a power, in place, by compiled.power_curve's numbers. */
void itmo_power(float *values, int64_t count, const float *curve);

/* Each of `planes` lines of w + 1 places, left + step * share, to one of width; each place lies
   between columns[x] - 1 and columns[x], which rise by 1 at most. `lefts` and `steps` have AT_ONCE
   more at the end, `columns` and `shares` are whole multiples of AT_ONCE, `out` is across apart. */
void itmo_widen(const float *lefts, const float *steps, int64_t planes, int64_t w, int64_t across,
                const int32_t *columns, const float *shares, int64_t width, float *out);

#endif
