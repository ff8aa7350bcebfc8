/* The zero-phase filter and linear recurrences, on several signals at once: each step of one waits for the step before
 * it, so a processor does as many signals in the same time as one. */
#include "kernels.h"

#include <stdlib.h>

enum { LANES = 8, SECTION = 6 };

typedef double Lane[LANES];

/* One way through second-order sections, in transposed direct form II, as SciPy's `sosfilt` orders the operations. */
INLINE void pass(Lane *rows, long long count, long long step, const double *sections,
                                                       const double *settled, long many) {
    Lane early[many], late[many];
    for (long s = 0; s < many; s++)
        for (int j = 0; j < LANES; j++) {
            early[s][j] = settled[2 * s] * rows[0][j];
            late[s][j] = settled[2 * s + 1] * rows[0][j];
        }
    for (long long k = 0; k != count * step; k += step) {
        Lane x;
        for (int j = 0; j < LANES; j++) x[j] = rows[k][j];
        for (long s = 0; s < many; s++) {
            const double *c = sections + SECTION * s;
            for (int j = 0; j < LANES; j++) {
                double y = c[0] * x[j] + early[s][j];
                early[s][j] = c[1] * x[j] - c[4] * y + late[s][j];
                late[s][j] = c[2] * x[j] - c[5] * y;
                x[j] = y;
            }
        }
        for (int j = 0; j < LANES; j++) rows[k][j] = x[j];
    }
}

INLINE void both_ways(Lane *rows, long long count, const double *sections,
                                                            const double *settled, long many) {
    pass(rows, count, 1, sections, settled, many);
    pass(rows + count - 1, count, -1, sections, settled, many);
}

static void both_ways_plain(Lane *rows, long long count, const double *sections, const double *settled, long many) {
    both_ways(rows, count, sections, settled, many);
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) static void both_ways_wide(Lane *rows, long long count, const double *sections,
                                                           const double *settled, long many) {
    both_ways(rows, count, sections, settled, many);
}
#else
#define both_ways_wide both_ways_plain
#endif

/* Filter `signals` of `rows` values each, one after the other in memory, in place, forward and backward, continued at
 * both ends by `edge` rows turned about the last one. */
EXPORT int filter_run(double *signals, long long many, long long rows, long long edge, const double *sections,
                      const double *settled, long long count) {
    long long whole = rows + 2 * edge;
    Lane *lanes = malloc((size_t)whole * sizeof *lanes);
    int wide = is_wide();
    if (!lanes) return 1;
    for (long long first = 0; first < many; first += LANES) {
        for (int j = 0; j < LANES; j++) { /* lanes without a signal repeat the last one */
            const double *x = signals + rows * (first + j < many ? first + j : many - 1);
            for (long long k = 0; k < edge; k++) {
                lanes[k][j] = 2 * x[0] - x[edge - k];
                lanes[edge + rows + k][j] = 2 * x[rows - 1] - x[rows - 2 - k];
            }
            for (long long k = 0; k < rows; k++) lanes[edge + k][j] = x[k];
        }
        (wide ? both_ways_wide : both_ways_plain)(lanes, whole, sections, settled, (long)count);
        for (int j = 0; j < LANES && first + j < many; j++)
            for (long long k = 0; k < rows; k++) signals[rows * (first + j) + k] = lanes[edge + k][j];
    }
    free(lanes);
    return 0;
}

/* y[0] = 0, y[k + 1] = keeps[k] y[k] + adds[k], for `many` signals of `rows` values each; y has one row more. */
EXPORT int recurrence_run(const double *keeps, const double *adds, long long many, long long rows, double *y) {
    for (long long first = 0; first < many; first += 4) {
        long long own = many - first < 4 ? many - first : 4;
        const double *a[4];
        double *out[4], now[4] = {0, 0, 0, 0};
        for (int j = 0; j < 4; j++) {
            a[j] = adds + rows * (first + (j < own ? j : own - 1));
            out[j] = y + (rows + 1) * (first + (j < own ? j : own - 1));
            out[j][0] = 0;
        }
        for (long long k = 0; k < rows; k++)
            for (int j = 0; j < 4; j++) out[j][k + 1] = now[j] = keeps[k] * now[j] + a[j][k];
    }
    return 0;
}
