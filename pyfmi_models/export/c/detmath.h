/* Elementary functions with the same bits on every machine.
 *
 * libm differs between machines in the last bit; a controller fed by such bits differs in most of its samples. These
 * functions use only IEEE additions, multiplications, divisions and square roots in a fixed order, so they give equal
 * bits wherever the compiler is told not to contract (-ffp-contract=off).
 *
 * Errors, measured against mpmath by tests/test_detmath.py, in units in the last place:
 *   exp, exp2, expm1, log, log1p, log2, log10, pow   <= 1
 *   sin, cos                                         <= 1 for |x| <= 1e5; beyond 1.6e6 an absolute error of |x| 2^-52
 *   tan, asin, acos, atan, atan2, hypot              <= 2
 *   sinh, cosh, tanh, asinh, acosh, atanh            <= 2
 *   floor, ceil, trunc, fmod, remainder, fmin, fmax  exact
 * Special values follow C99 Annex F; errno is never set.
 */
#ifndef DETMATH_H
#define DETMATH_H

#include <math.h>

double det_exp(double x);
double det_exp2(double x);
double det_expm1(double x);
double det_log(double x);
double det_log2(double x);
double det_log10(double x);
double det_log1p(double x);
double det_pow(double x, double y);
double det_sin(double x);
double det_cos(double x);
double det_tan(double x);
double det_asin(double x);
double det_acos(double x);
double det_atan(double x);
double det_atan2(double y, double x);
double det_sinh(double x);
double det_cosh(double x);
double det_tanh(double x);
double det_asinh(double x);
double det_acosh(double x);
double det_atanh(double x);
double det_hypot(double x, double y);
double det_fmod(double x, double y);
double det_remainder(double x, double y);
double det_floor(double x);
double det_ceil(double x);
double det_trunc(double x);

/* As in C99: the number wins over NaN. */
static inline double det_fmin(double x, double y) { return x != x ? y : y < x ? y : x; }

static inline double det_fmax(double x, double y) { return x != x ? y : y > x ? y : x; }

/* -1, 1, or x where x is zero or no number. */
static inline double det_sign(double x) { return x < 0 ? -1 : x > 0 ? 1 : x; }

/* Code that includes this header after or before <math.h> calls ours by libm's names. detmath's own files opt out. */
#ifndef DETMATH_KEEP_NAMES
#define exp det_exp
#define exp2 det_exp2
#define expm1 det_expm1
#define log det_log
#define log2 det_log2
#define log10 det_log10
#define log1p det_log1p
#define pow det_pow
#define sin det_sin
#define cos det_cos
#define tan det_tan
#define asin det_asin
#define acos det_acos
#define atan det_atan
#define atan2 det_atan2
#define sinh det_sinh
#define cosh det_cosh
#define tanh det_tanh
#define asinh det_asinh
#define acosh det_acosh
#define atanh det_atanh
#define hypot det_hypot
#define fmod det_fmod
#define remainder det_remainder
#define floor det_floor
#define ceil det_ceil
#define trunc det_trunc
#define fmin det_fmin
#define fmax det_fmax
#define sign det_sign
#endif

#endif
