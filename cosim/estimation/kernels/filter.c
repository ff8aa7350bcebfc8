/* The zero-phase filter and linear recurrences, on several signals at once: each step of one waits for the step before
 * it, so a processor does as many signals in the same time as one. */
#include "kernels.h"

#include <stdlib.h>

enum { LANES = 8, SECTION = 6 };

/* One way through second-order sections, in transposed direct form II, as SciPy's `sosfilt` orders the operations;
 * `wide` signals stand side by side in each row. */
INLINE void pass(double *rows, long long count, long long step, const double *sections, const double *settled,
                 long many, int wide) {
    double early[many][wide], late[many][wide];
    for (long s = 0; s < many; s++)
        for (int j = 0; j < wide; j++) {
            early[s][j] = settled[2 * s] * rows[j];
            late[s][j] = settled[2 * s + 1] * rows[j];
        }
    for (double *row = rows; row != rows + wide * step * count; row += wide * step) {
        double x[wide];
        for (int j = 0; j < wide; j++) x[j] = row[j];
        for (long s = 0; s < many; s++) {
            const double *c = sections + SECTION * s;
            for (int j = 0; j < wide; j++) {
                double y = c[0] * x[j] + early[s][j];
                early[s][j] = c[1] * x[j] - c[4] * y + late[s][j];
                late[s][j] = c[2] * x[j] - c[5] * y;
                x[j] = y;
            }
        }
        for (int j = 0; j < wide; j++) row[j] = x[j];
    }
}

INLINE void to_and_fro(double *rows, long long count, const double *sections, const double *settled, long many,
                       int wide) {
    pass(rows, count, 1, sections, settled, many, wide);
    pass(rows + wide * (count - 1), count, -1, sections, settled, many, wide);
}

/* One pass of a filter has two sections: where a compiler knows their number, states stay in registers. */
INLINE void both_ways(double *rows, long long count, const double *sections, const double *settled, long many,
                      int wide) {
    if (many == 2) to_and_fro(rows, count, sections, settled, 2, wide);
    else to_and_fro(rows, count, sections, settled, many, wide);
}

static void both_ways_one(double *rows, long long count, const double *sections, const double *settled, long many) {
    both_ways(rows, count, sections, settled, many, 1);
}

static void both_ways_plain(double *rows, long long count, const double *sections, const double *settled, long many) {
    both_ways(rows, count, sections, settled, many, LANES);
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) static void both_ways_wide(double *rows, long long count, const double *sections,
                                                           const double *settled, long many) {
    both_ways(rows, count, sections, settled, many, LANES);
}
#else
#define both_ways_wide both_ways_plain
#endif

/* Filter `signals` of `rows` values each, one after the other in memory, in place, forward and backward, continued at
 * both ends by `edge` rows turned about the last one. */
EXPORT int filter_run(double *signals, long long many, long long rows, long long edge, const double *sections,
                      const double *settled, long long count) {
    long long whole = rows + 2 * edge;
    int wide = many == 1 ? 1 : LANES; /* one signal alone, which may be long, takes no more memory than it must */
    double *lanes = malloc((size_t)(whole * wide) * sizeof *lanes);
    if (!lanes) return 1;
    for (long long first = 0; first < many; first += wide) {
        double *x[LANES];
        for (int j = 0; j < wide; j++) /* lanes without a signal repeat the last one */
            x[j] = signals + rows * (first + j < many ? first + j : many - 1);
        for (long long k = 0; k < edge; k++) /* row by row: eight signals are read along, one is not written across */
            for (int j = 0; j < wide; j++) {
                lanes[wide * k + j] = 2 * x[j][0] - x[j][edge - k];
                lanes[wide * (edge + rows + k) + j] = 2 * x[j][rows - 1] - x[j][rows - 2 - k];
            }
        for (long long k = 0; k < rows; k++)
            for (int j = 0; j < wide; j++) lanes[wide * (edge + k) + j] = x[j][k];
        (wide == 1 ? both_ways_one : is_wide() ? both_ways_wide : both_ways_plain)(lanes, whole, sections, settled, (long)count);
        int own = (int)(first + wide < many ? wide : many - first);
        for (long long k = 0; k < rows; k++)
            for (int j = 0; j < own; j++) x[j][k] = lanes[wide * (edge + k) + j];
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
