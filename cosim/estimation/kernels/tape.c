/* Expressions on whole rows: a tape of operations, each on a block of rows that stays in the cache.
 *
 * An operand is a register, or a number that all rows share (~index where it is below zero). What depends on shared
 * numbers alone is computed once. Additions to divisions are IEEE's and the functions are detmath's, so a row has the
 * same bits wherever it stands and on whichever machine. */
#include "detmath.h"
#include "kernels.h"
#include "rowmath.h"

#include <stdlib.h>

enum { BLOCK = 128 };

/* In the order of `CODES` in rowwise.py. */
enum {
    ASSIGN, ADD, SUB, MUL, DIV, NEG, EXP, LOG, LOG1P, EXPM1, POW, SQRT, SQ, TWICE, INV, SIN, COS, TAN, ASIN, ACOS, ATAN,
    ATAN2, SINH, COSH, TANH, HYPOT, LT, LE, EQ, NE, NOT, AND, OR, IF_ELSE_ZERO, FLOOR, CEIL, FMOD, FABS, SIGN, COPYSIGN,
    FMIN, FMAX
};

#define EACH _Pragma("clang loop vectorize(assume_safety)") for (long k = 0; k < rows; k++)
#define UNARY(CODE, VALUE)                                                                                             \
    case CODE:                                                                                                         \
        EACH { double x = a[k]; out[k] = VALUE; }                                                                      \
        return;
#define BINARY(CODE, VALUE)                                                                                            \
    case CODE:                                                                                                         \
        if (!a_moves) { double x = *a; EACH { double y = b[k]; out[k] = VALUE; } }                                     \
        else if (!b_moves) { double y = *b; EACH { double x = a[k]; out[k] = VALUE; } }                                \
        else { EACH { double x = a[k], y = b[k]; out[k] = VALUE; } }                                                   \
        return;

INLINE void operate(int code, const double *a, int a_moves, const double *b,
                                                          int b_moves, double *out, long rows) {
    switch (code) {
        BINARY(ASSIGN, x)
        BINARY(ADD, x + y)
        BINARY(SUB, x - y)
        BINARY(MUL, x * y)
        BINARY(DIV, x / y)
        UNARY(NEG, -x)
        UNARY(EXP, row_exp(x))
        UNARY(LOG, row_log(x))
        UNARY(LOG1P, row_log1p(x))
        UNARY(EXPM1, expm1(x))
        case POW: /* a Stribeck curve has the exponents 2 and 1: a product costs a tenth of a power, and is exact */
            if (!b_moves && *b == 2) EACH { double x = a[k]; out[k] = x * x; }
            else if (!b_moves && *b == 1) EACH { double x = a[k]; out[k] = x; }
            else if (!b_moves) { double y = *b; EACH { double x = a[k]; out[k] = row_pow(x, y); } }
            else if (!a_moves) { double x = *a; EACH { double y = b[k]; out[k] = row_pow(x, y); } }
            else EACH { double x = a[k], y = b[k]; out[k] = row_pow(x, y); }
            return;
        UNARY(SQRT, sqrt(x))
        UNARY(SQ, x * x)
        UNARY(TWICE, 2 * x)
        UNARY(INV, 1 / x)
        UNARY(SIN, row_sin(x))
        UNARY(COS, row_cos(x))
        UNARY(TAN, tan(x))
        UNARY(ASIN, asin(x))
        UNARY(ACOS, acos(x))
        UNARY(ATAN, atan(x))
        BINARY(ATAN2, atan2(x, y))
        UNARY(SINH, sinh(x))
        UNARY(COSH, cosh(x))
        UNARY(TANH, row_tanh(x))
        BINARY(HYPOT, hypot(x, y))
        BINARY(LT, x < y)
        BINARY(LE, x <= y)
        BINARY(EQ, x == y)
        BINARY(NE, x != y)
        UNARY(NOT, x == 0)
        BINARY(AND, x != 0 && y != 0)
        BINARY(OR, x != 0 || y != 0)
        BINARY(IF_ELSE_ZERO, x != 0 ? y : 0)
        UNARY(FLOOR, floor(x))
        UNARY(CEIL, ceil(x))
        BINARY(FMOD, fmod(x, y))
        UNARY(FABS, fabs(x))
        UNARY(SIGN, sign(x))
        BINARY(COPYSIGN, copysign(x, y))
        BINARY(FMIN, fmin(x, y))
        BINARY(FMAX, fmax(x, y))
    }
}

INLINE void block(const struct tape *tape, const double *numbers,
                                                        const double **at, long rows) {
    for (const struct operation *one = tape->rowwise; one < tape->rowwise + tape->rowwise_count; one++) {
        int a_moves = one->a >= 0, b_moves = one->b >= 0;
        const double *a = a_moves ? at[one->a] : numbers + ~one->a, *b = b_moves ? at[one->b] : numbers + ~one->b;
        operate(one->code, a, a_moves, b, b_moves, (double *)at[one->target], rows);
    }
}

static void block_plain(const struct tape *tape, const double *numbers, const double **at, long rows) {
    block(tape, numbers, at, rows);
}

#if defined(__x86_64__)
/* The same operations, four rows at once: no multiplication is contracted with an addition, so bits are the same. */
__attribute__((target("avx2"))) static void block_wide(const struct tape *tape, const double *numbers,
                                                       const double **at, long rows) {
    block(tape, numbers, at, rows);
}
#include <cpuid.h>

static int find_wide(void) {
    unsigned a, b, c, d, low, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & bit_OSXSAVE) == 0 || (c & bit_AVX) == 0) return 0;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return (low & 6) == 6 && __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & bit_AVX2) != 0;
}

int is_wide(void) {
    static int known = -1; /* a virtual machine takes longer to ask than a block takes */
    if (known < 0) known = find_wide();
    return known;
}
#else
#define block_wide block_plain

int is_wide(void) { return 0; }
#endif

EXPORT int tape_run(const struct tape *tape, double *numbers, const double *const *columns, long long rows, double *out) {
    for (const struct operation *one = tape->shared; one < tape->shared + tape->shared_count; one++)
        operate(one->code, numbers + ~one->a, 1, numbers + ~one->b, 1, numbers + ~one->target, 1);
    const double **at = malloc((size_t)tape->registers * sizeof *at);
    double *work = malloc((size_t)tape->slots * BLOCK * sizeof *work);
    if (!at || !work) return free(at), free(work), 1;
    for (long k = 0; k < tape->slots; k++) at[tape->inputs + k] = work + k * BLOCK;
    int wide = is_wide();
    for (long long first = 0; first < rows; first += BLOCK) {
        long many = (long)(rows - first < BLOCK ? rows - first : BLOCK);
        for (long k = 0; k < tape->inputs; k++) at[k] = columns[k] + first;
        for (long k = 0; k < tape->outputs; k++) at[tape->inputs + tape->slots + k] = out + k * rows + first;
        (wide ? block_wide : block_plain)(tape, numbers, at, many);
    }
    free(at), free(work);
    return 0;
}
