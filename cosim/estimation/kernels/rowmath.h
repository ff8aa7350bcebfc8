/* Elementary functions without branches and tables, so that a compiler does several rows at once.
 *
 * Only IEEE operations in a fixed order, as in detmath: the same bits on every machine. Errors, in units in the last
 * place: exp, log 1; log1p, tanh 3; sin, cos 2 for |x| <= 1e5 (nothing beyond 1e15); pow (1 + |y log x|). */
#ifndef ROWMATH_H
#define ROWMATH_H

#include "kernels.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#define ROUNDER 6755399441055744.0 /* 1.5 2^52: what is added to it is rounded to a whole number, in its last bits */
#define LN2_HIGH 0.69314718036912382     /* 32 bits */
#define LN2_LOW 1.9082149292705877e-10   /* ln 2 less the above */
#define HALF_PI_1 1.5707963267341256     /* 33 bits each */
#define HALF_PI_2 6.0771005063039660e-11
#define HALF_PI_3 2.0222662487959506e-21

INLINE uint64_t row_bits(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

INLINE double row_of_bits(uint64_t bits) {
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* 2^k e^r, |r| <= ln 2 / 2, Taylor of degree 13: error 4e-18. Beyond 1e-307 and 8e307 it is 0 and infinity. */
INLINE double row_exp(double x) {
    double inside = x < -708 ? -708 : x > 709 ? 709 : x;
    double whole = inside * 1.4426950408889634 + ROUNDER, k = whole - ROUNDER;
    double r = (inside - k * LN2_HIGH) - k * LN2_LOW, r2 = r * r, r4 = r2 * r2;
    double a = (1.0 / 6 + r * (1.0 / 24)) + r2 * (1.0 / 120 + r * (1.0 / 720));
    double b = (1.0 / 5040 + r * (1.0 / 40320)) + r2 * (1.0 / 362880 + r * (1.0 / 3628800));
    double c = (1.0 / 39916800 + r * (1.0 / 479001600)) + r2 * (1.0 / 6227020800.0);
    double sum = 1 + (r + r2 * (0.5 + r * (a + r4 * (b + r4 * c))));
    double scaled = sum * row_of_bits((row_bits(whole) + 1023) << 52);
    return x != x ? x : x < -708 ? 0 : x > 709 ? INFINITY : scaled;
}

/* k ln 2 + log(1 + f), sqrt(1/2) <= 1 + f < sqrt(2): f - s (f - 2 z (1/3 + z/5 + ...)), s = f / (2 + f), z = s^2. */
INLINE double row_log(double x) {
    double size = x < 2.2250738585072014e-308 ? x * 18014398509481984.0 : x;
    uint64_t bits = row_bits(size), exponent = (bits + 0x0009616200000000ull) >> 52; /* one more from sqrt(2) on */
    double k = row_of_bits(exponent | 0x4330000000000000ull) - (x < 2.2250738585072014e-308 ? 4503599627371573.0
                                                                                            : 4503599627371519.0);
    double f = row_of_bits(bits - (exponent << 52) + 0x3FF0000000000000ull) - 1;
    double s = f / (2 + f), z = s * s, z2 = z * z, z4 = z2 * z2;
    double low = (1.0 / 3 + z * (1.0 / 5)) + z2 * (1.0 / 7 + z * (1.0 / 9));
    double high = (1.0 / 11 + z * (1.0 / 13)) + z2 * (1.0 / 15 + z * (1.0 / 17)) + z4 * (1.0 / 19 + z * (1.0 / 21));
    double found = k * LN2_HIGH + (f - (s * (f - 2 * z * (low + z4 * high)) - k * LN2_LOW));
    return x == 0 ? -INFINITY : !(x >= 0) ? NAN : x == INFINITY ? x : found;
}

INLINE double row_log1p(double x) {
    double shifted = 1 + x, found = row_log(shifted) * (x / (shifted - 1));
    return shifted == 1 || x == INFINITY ? x : x == -1 ? -INFINITY : found;
}

INLINE double row_pow(double x, double y) {
    double size = row_exp(y * row_log(fabs(x))), whole = y + ROUNDER;
    double of_whole = row_of_bits(row_bits(size) ^ row_bits(whole) << 63), below = whole - ROUNDER == y ? of_whole : NAN;
    double found = x < 0 ? below : size;
    return y == 0 ? 1 : found;
}

/* sin(x + shift pi/2): x less whole quarters of a turn, |r| <= pi/4, and by the quarter sine or cosine of r. */
INLINE double row_wave(double x, uint64_t shift) {
    double whole = x * 0.63661977236758134 + ROUNDER, k = whole - ROUNDER;
    uint64_t quarter = row_bits(whole) + shift;
    double r = ((x - k * HALF_PI_1) - k * HALF_PI_2) - k * HALF_PI_3, z = r * r, z2 = z * z, z4 = z2 * z2;
    double s = (-1.0 / 6 + z * (1.0 / 120)) + z2 * (-1.0 / 5040 + z * (1.0 / 362880));
    s += z4 * ((-1.0 / 39916800 + z * (1.0 / 6227020800.0)) + z2 * (-1.0 / 1307674368000.0 + z * (1.0 / 355687428096000.0)));
    double c = (1.0 / 24 + z * (-1.0 / 720)) + z2 * (1.0 / 40320 + z * (-1.0 / 3628800));
    c += z4 * ((1.0 / 479001600 + z * (-1.0 / 87178291200.0)) + z2 * (1.0 / 20922789888000.0));
    double sine = r + r * z * s, cosine = 1 - (0.5 * z - z2 * c);
    double found = (quarter & 1) != 0 ? cosine : sine;
    return row_of_bits(row_bits(found) ^ (quarter & 2) << 62);
}

INLINE double row_sin(double x) { return row_wave(x, 0); }

INLINE double row_cos(double x) { return row_wave(x, 1); }

/* 1 - 2 / (e^2|x| + 1); near zero, where that loses digits, the quotient of the series of sinh and cosh. */
INLINE double row_tanh(double x) {
    double size = fabs(x), z = size * size, far = 1 - 2 / (row_exp(2 * (size > 22 ? 22 : size)) + 1);
    double sinh = 1.0 / 6 + z * (1.0 / 120 + z * (1.0 / 5040 + z * (1.0 / 362880 + z * (1.0 / 39916800 + z * (1.0 / 6227020800.0)))));
    double cosh = 1.0 / 24 + z * (1.0 / 720 + z * (1.0 / 40320 + z * (1.0 / 3628800 + z * (1.0 / 479001600))));
    double near = (size + size * z * sinh) / (1 + z * (0.5 + z * cosh));
    return x != x ? x : copysign(size < 0.4 ? near : far, x);
}

#endif
