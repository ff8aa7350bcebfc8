/* Exponential, logarithm and power: table of 128 entries, Taylor polynomial on the short rest, the lost bits carried
 * along as a second double ("tail") where they matter. */
#define DETMATH_KEEP_NAMES
#define DETMATH_WITH_EXP_LOG
#include "detmath.h"
#include "detmath_tables.h"

#include <stdint.h>
#include <string.h>

typedef struct {
    double head, tail;
} Double2;

static uint64_t bits_of(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static double of_bits(uint64_t bits) {
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* Exact: head + tail = a + b. */
static Double2 sum(double a, double b) {
    double head = a + b, from_a = head - b, from_b = head - from_a;
    Double2 result = {head, (a - from_a) + (b - from_b)};
    return result;
}

/* The upper 26 bits of the mantissa: the product of two such numbers is exact. */
static double upper_half(double x) { return of_bits(bits_of(x) & 0xFFFFFFFFF8000000ull); }

/* Exact for factors whose product neither overflows nor underflows. */
static Double2 product(double a, double b) {
    double ah = upper_half(a), bh = upper_half(b), al = a - ah, bl = b - bh, head = a * b;
    Double2 result = {head, ((ah * bh - head) + ah * bl + al * bh) + al * bl};
    return result;
}

static double power_of_two(int exponent) { return of_bits((uint64_t)(exponent + 1023) << 52); }

/* x 2^exponent for x near 1 and -1100 < exponent < 1100, rounded once. */
static double scaled(double x, int exponent) {
    if (exponent < -1000) return x * power_of_two(exponent + 200) * power_of_two(-200);
    if (exponent > 1000) return x * power_of_two(exponent - 200) * power_of_two(200);
    return x * power_of_two(exponent);
}

/* exp(x + tail) = (head + tail) 2^exponent for |x| < 800. Taylor of degree 5 on |r| <= ln 2 / 256: error 6e-19. */
static Double2 exp_parts(double x, double tail, int *exponent) {
    int index = (int)(x * INV_LN2_128 + (x < 0 ? -0.5 : 0.5)), entry = index & 127;
    double r = (x - index * LN2_128_HIGH) - index * LN2_128_LOW + tail, square = r * r;
    double rest = r + square * ((0.5 + r * (1.0 / 6)) + square * (1.0 / 24 + r * (1.0 / 120)));
    Double2 result = {exp_table[entry][0], exp_table[entry][1] + exp_table[entry][0] * rest};
    *exponent = (index - entry) / 128;
    return result;
}

static double exp_with_tail(double x, double tail) {
    if (x > 710) return INFINITY;
    if (x < -746) return 0;
    int exponent;
    Double2 parts = exp_parts(x, tail, &exponent);
    return scaled(parts.head + parts.tail, exponent);
}

double det_exp(double x) {
    if (x != x) return x;
    return exp_with_tail(x, 0);
}

double det_exp2(double x) {
    if (x != x) return x;
    if (x > 1100) return INFINITY;
    if (x < -1100) return 0;
    Double2 exponent = product(x, LN2);
    return exp_with_tail(exponent.head, fabs(x) < 1e-200 ? 0 : exponent.tail + x * LN2_TAIL);
}

/* x + x^2/2! + ... + x^14/14!, |x| <= 0.25. */
static double expm1_series(double x) {
    double sum_of_rest = 0;
    for (int i = 14; i >= 3; i--) sum_of_rest = (sum_of_rest + inverse_factorial[i]) * x;
    return x + x * x * (0.5 + sum_of_rest);
}

double det_expm1(double x) {
    if (x != x || x == 0) return x;
    if (fabs(x) < 0.25) return expm1_series(x);
    if (x > 710) return INFINITY;
    if (x < -60) return -1;
    int exponent;
    Double2 parts = exp_parts(x, 0, &exponent);
    if (exponent > 60) return scaled(parts.head + parts.tail, exponent);
    double scale = power_of_two(exponent);
    Double2 less_one = sum(parts.head * scale, -1);
    return less_one.head + (less_one.tail + parts.tail * scale);
}

/* log(1 + r) - r + r^2/2 for |r| <= 1/128: r^3/3 - r^4/4 ... + r^11/11, in pairs that a processor can overlap. */
static double log1p_rest(double r) {
    double r2 = r * r, r4 = r2 * r2;
    double low = (inverse[3] - r * inverse[4]) + r2 * (inverse[5] - r * inverse[6]);
    double high = (inverse[7] - r * inverse[8]) + r2 * (inverse[9] - r * inverse[10]) + r4 * inverse[11];
    return r * r2 * (low + r4 * high);
}

/* log(x) of a positive finite x, relative error below 2^-65: z = x 2^-k in [0.7, 1.42), r = z inverse - 1. */
static Double2 log_parts(double x) {
    int k = -1023;
    if (x < 2.2250738585072014e-308) {
        x *= 18014398509481984.0;
        k -= 54;
    }
    uint64_t bits = bits_of(x);
    int entry = (int)(bits >> 45 & 127);
    k += (int)(bits >> 52) + (entry >= LOG_TABLE_HALVES);
    double z = of_bits((bits & 0xFFFFFFFFFFFFFull) | (entry >= LOG_TABLE_HALVES ? 0x3FEull : 0x3FFull) << 52);
    double z_upper = of_bits(bits_of(z) & 0xFFFFFFFFFFE00000ull); /* 32 bits: z_upper * inverse is exact */
    const double *row = log_table[entry];
    Double2 r = sum(z_upper * row[0] - 1, (z - z_upper) * row[0]);
    double half = upper_half(r.head), rest = r.head - half;
    Double2 first = sum(k * LN2_HIGH + row[1], r.head);
    Double2 second = sum(first.head, -0.5 * half * half);
    double tail = k * LN2_LOW + row[2] + first.tail + second.tail + r.tail * (1 - r.head);
    tail += log1p_rest(r.head) - (half + 0.5 * rest) * rest;
    return sum(second.head, tail);
}

double det_log(double x) {
    if (x != x || x == INFINITY) return x;
    if (x == 0) return -INFINITY;
    if (x < 0) return NAN;
    return log_parts(x).head;
}

static double log_in_base(double x, double factor, double factor_tail) {
    if (!(x > 0) || x == INFINITY || x == 1) return det_log(x);
    Double2 natural = log_parts(x), result = product(natural.head, factor);
    return result.head + (result.tail + natural.head * factor_tail + natural.tail * factor);
}

double det_log2(double x) { return log_in_base(x, INV_LN2, INV_LN2_TAIL); }

double det_log10(double x) { return log_in_base(x, INV_LN10, INV_LN10_TAIL); }

double det_log1p(double x) {
    if (x != x || x == INFINITY || fabs(x) < 1e-17) return x;
    if (x == -1) return -INFINITY;
    if (x < -1) return NAN;
    Double2 shifted = sum(1, x), result = log_parts(shifted.head);
    return result.head + (result.tail + shifted.tail / shifted.head);
}

static int is_integer(double y) { return fabs(y) >= 4503599627370496.0 || det_floor(y) == y; }

static int is_odd(double y) { return fabs(y) < 9007199254740992.0 && is_integer(y) && ((int64_t)y & 1); }

/* x^y for x > 0, x != 1, both finite. */
static double pow_positive(double x, double y) {
    Double2 base = log_parts(x);
    if (fabs(y) > 1e19) return (base.head > 0) == (y > 0) ? INFINITY : 0;
    if (fabs(y) < 1e-20) return 1 + y * base.head;
    Double2 exponent = product(y, base.head);
    return exp_with_tail(exponent.head, exponent.tail + y * base.tail);
}

/* x^y where x or y is zero or infinite: only the sign of y and the size of x count. */
static double pow_extreme(double x, double y) {
    double size = fabs(x), magnitude;
    if (fabs(y) == INFINITY && size == 1) return 1;
    magnitude = (size > 1) == (y > 0) ? INFINITY : 0;
    return x == 0 || size == INFINITY ? (signbit(x) && is_odd(y) ? -magnitude : magnitude) : magnitude;
}

double det_pow(double x, double y) {
    if (y == 0 || x == 1) return 1;
    if (x != x || y != y) return x + y;
    if (y == 2) return x * x; /* the usual exponent of a Stribeck curve, and that of its slope */
    if (y == 1) return x;
    if (x == 0 || fabs(x) == INFINITY || fabs(y) == INFINITY) return pow_extreme(x, y);
    if (x < 0 && !is_integer(y)) return NAN;
    double size = x == -1 ? 1 : pow_positive(fabs(x), y);
    return x < 0 && is_odd(y) ? -size : size;
}
