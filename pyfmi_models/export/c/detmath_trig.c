/* Trigonometric, hyperbolic and their inverse functions, and the exact roundings. */
#define DETMATH_KEEP_NAMES
#define DETMATH_WITH_ATAN
#include "detmath.h"
#include "detmath_tables.h"

#include <stdint.h>
#include <string.h>

double det_trunc(double x) {
    if (!(fabs(x) < 4503599627370496.0)) return x;
    return copysign((double)(int64_t)x, x);
}

double det_floor(double x) {
    double whole = det_trunc(x);
    return whole > x ? whole - 1 : whole;
}

double det_ceil(double x) {
    double whole = det_trunc(x);
    return whole < x ? copysign(whole + 1, x) : whole;
}

/* Exact remainder by subtracting y 2^k, largest k first; each subtraction is exact (Sterbenz). */
double det_fmod(double x, double y) {
    double rest = fabs(x), size = fabs(y);
    if (x != x || y != y || rest == INFINITY || size == 0) return NAN;
    while (rest >= size) {
        double part = size;
        while (rest - part >= part) part *= 2;
        rest -= part;
    }
    return copysign(rest, x);
}

/* x - n y with the integer n nearest to x / y, the even one of two: exact, because fmod and the differences are. */
double det_remainder(double x, double y) {
    double size = fabs(y), rest = fabs(x);
    if (!(size < INFINITY)) return size == INFINITY && rest < INFINITY ? x : NAN;
    if (size < 8.9e307) rest = det_fmod(rest, 2 * size);
    if (size > 1e-290 ? rest > 0.5 * size : 2 * rest > size) {
        rest -= size;
        if (size > 1e-290 ? rest >= 0.5 * size : 2 * rest >= size) rest -= size;
    }
    return signbit(x) ? -rest : rest;
}

double det_hypot(double x, double y) {
    double a = fabs(x), b = fabs(y), scale = 1;
    if (a == INFINITY || b == INFINITY) return INFINITY;
    if (a > 1e150 || b > 1e150) scale = 1.3407807929942597e154; /* 2^512 */
    if (a < 1e-140 && b < 1e-140) scale = 7.458340731200207e-155; /* 2^-512 */
    a /= scale;
    b /= scale;
    return scale * sqrt(a * a + b * b);
}

/* r - r^3/3! + ..., |r| <= pi/4, plus the effect of the tail of r. */
static double sin_series(double r, double tail) {
    double square = r * r, series = 0;
    for (int i = 19; i >= 5; i -= 2) series = (series + (i % 4 == 1 ? 1 : -1) * inverse_factorial[i]) * square;
    return r + (r * square * (series - inverse_factorial[3]) + tail * (1 - 0.5 * square));
}

/* 1 - r^2/2! + ...: what 1 - r^2/2 loses is added back. */
static double cos_series(double r, double tail) {
    double square = r * r, half = 0.5 * square, head = 1 - half, series = 0;
    for (int i = 20; i >= 6; i -= 2) series = (series + (i % 4 == 0 ? 1 : -1) * inverse_factorial[i]) * square;
    return head + (((1 - head) - half) + (square * square * (series + inverse_factorial[4]) - r * tail));
}

/* x = n pi/2 + r + tail; pi/2 in three parts of 33 bits, so that n times the first two is exact for |x| < 1.6e6. */
static int quadrant(double x, double *r, double *tail) {
    double n = det_floor(x * TWO_OVER_PI + 0.5);
    double first = x - n * PI_2_A, second = n * PI_2_B, head = first - second;
    double lost = (first - head) - second, third = n * PI_2_C;
    *r = head - (third - lost);
    *tail = (head - *r) - (third - lost);
    return (int)(int64_t)(n - 4 * det_floor(n * 0.25));
}

double det_sin(double x) {
    double r, tail;
    if (!(fabs(x) < INFINITY)) return NAN;
    if (fabs(x) < 1e-8) return x;
    switch (quadrant(x, &r, &tail)) {
    case 0: return sin_series(r, tail);
    case 1: return cos_series(r, tail);
    case 2: return -sin_series(r, tail);
    default: return -cos_series(r, tail);
    }
}

double det_cos(double x) {
    double r, tail;
    if (!(fabs(x) < INFINITY)) return NAN;
    switch (quadrant(x, &r, &tail)) {
    case 0: return cos_series(r, tail);
    case 1: return -sin_series(r, tail);
    case 2: return -cos_series(r, tail);
    default: return sin_series(r, tail);
    }
}

double det_tan(double x) { return det_sin(x) / det_cos(x); }

/* t - t^3/3 + ..., |t| <= 1/64. */
static double atan_series(double t) {
    double square = t * t, series = 0;
    for (int i = 13; i >= 3; i -= 2) series = (series + (i % 4 == 1 ? 1 : -1) * inverse[i]) * square;
    return t * series;
}

/* atan(y / x) for 0 <= y <= x: atan(c) + atan((y - c x) / (x + c y)) with c the nearest multiple of 1/32. */
static double atan_of_ratio(double y, double x) {
    int entry = (int)(y / x * 32 + 0.5);
    if (entry == 0) return y / x + atan_series(y / x);
    double c = entry / 32.0, t = (y - c * x) / (x + c * y);
    return atan_table[entry][0] + (t + (atan_series(t) + atan_table[entry][1]));
}

double det_atan(double x) {
    double size = fabs(x);
    if (x != x) return x;
    if (size < 1e-8) return x;
    return copysign(size <= 1 ? atan_of_ratio(size, 1) : (PI_2 - atan_of_ratio(1, size)) + PI_2_TAIL, x);
}

/* y / x <= 1, both not negative; 0 for an infinite x. */
static double small_angle(double y, double x) { return x == INFINITY ? 0 : atan_of_ratio(y, x); }

/* Counted from the nearest axis, so that pi/2 and pi are rounded once. */
double det_atan2(double y, double x) {
    double height = fabs(y), width = fabs(x), angle;
    if (x != x || y != y) return NAN;
    if (height == 0 && width == 0) width = 1;
    if (height == INFINITY && width == INFINITY) height = width = 1;
    if ((height > 1e300 || width > 1e300) && height != INFINITY && width != INFINITY) {
        height *= 0x1p-100; /* keeps x + c y finite */
        width *= 0x1p-100;
    }
    if (height <= width) {
        angle = small_angle(height, width);
        if (signbit(x)) angle = (2 * PI_2 - angle) + 2 * PI_2_TAIL;
    } else {
        angle = small_angle(width, height);
        angle = (signbit(x) ? PI_2 + angle : PI_2 - angle) + PI_2_TAIL;
    }
    return copysign(angle, y);
}

double det_asin(double x) {
    if (!(fabs(x) <= 1)) return NAN;
    return det_atan2(x, sqrt((1 - x) * (1 + x)));
}

double det_acos(double x) {
    if (!(fabs(x) <= 1)) return NAN;
    return det_atan2(sqrt((1 - x) * (1 + x)), x);
}

double det_sinh(double x) {
    double size = fabs(x), grown;
    if (!(size < 700)) {
        grown = det_exp(size * 0.5);
        return copysign(0.5 * grown * grown, x);
    }
    grown = det_expm1(size);
    return copysign(0.5 * (grown + grown / (grown + 1)), x);
}

double det_cosh(double x) {
    double size = fabs(x), grown = det_exp(size < 700 ? size : size * 0.5);
    return size < 700 ? 0.5 * grown + 0.5 / grown : 0.5 * grown * grown;
}

double det_tanh(double x) {
    double size = fabs(x), grown;
    if (x != x) return x;
    if (size > 22) return copysign(1, x);
    grown = det_expm1(2 * size);
    return copysign(grown / (grown + 2), x);
}

double det_asinh(double x) {
    double size = fabs(x);
    if (!(size < 1e8)) return copysign(det_log(size) + LN2, x);
    return copysign(det_log1p(size + size * size / (1 + sqrt(1 + size * size))), x);
}

double det_acosh(double x) {
    if (!(x >= 1)) return NAN;
    if (x > 1e8) return det_log(x) + LN2;
    return det_log1p((x - 1) + sqrt((x - 1) * (x + 1)));
}

double det_atanh(double x) {
    double size = fabs(x);
    return copysign(0.5 * det_log1p(2 * size / (1 - size)), x);
}
