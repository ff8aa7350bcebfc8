/* The marginal likelihood of marginal.py, from Gram matrices of each band. */
#include "detmath.h"
#include "kernels.h"

#include <stdlib.h>

/* In four sums, which a processor adds side by side; always in this order. */
static double dot(const double *a, const double *b, long long n) {
    double sum[4] = {0, 0, 0, 0};
    long long k = 0;
    for (; k + 4 <= n; k += 4)
        for (int j = 0; j < 4; j++) sum[j] += a[k + j] * b[k + j];
    for (; k < n; k++) sum[0] += a[k] * b[k];
    return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}

static double larger(double a, double b) { return a > b ? a : b; }

/* Lower factor of a symmetric matrix in place, row by row; 0 where it is not positive definite. */
static int factorise(double *matrix, long long n) {
    for (long long i = 0; i < n; i++) {
        double *row = matrix + i * n;
        for (long long j = 0; j <= i; j++) {
            double rest = row[j] - dot(row, matrix + j * n, j);
            if (j < i) row[j] = rest / matrix[j * n + j];
            else if (rest > 0) row[i] = sqrt(rest);
            else return 0;
        }
    }
    return 1;
}

/* Inverse of a lower factor, transposed: row j holds column j of the inverse, zero up to the diagonal. */
static void invert(const double *factor, double *turned, long long n) {
    for (long long j = 0; j < n; j++) {
        double *column = turned + j * n;
        for (long long i = 0; i < j; i++) column[i] = 0;
        column[j] = 1 / factor[j * n + j];
        for (long long i = j + 1; i < n; i++)
            column[i] = -dot(factor + i * n + j, column + j, i - j) / factor[i * n + i];
    }
}

static double size_of(const double *beta, const double *covariance, const long long *columns, long long many,
                      long long n, double prior) {
    double sum = 0;
    for (long long k = 0; k < many; k++)
        sum += beta[columns[k]] * beta[columns[k]] + covariance[columns[k] * n + columns[k]];
    double count = (double)many, mean = sum / count;
    return sqrt(prior * prior / 2 * (-count + sqrt(count * count + 4 * count * mean / (prior * prior))));
}

/* Noise of each band, sizes of the groups and coefficients are found by so many rounds of expectation-maximisation.
 *
 * grams (bands, 1 + n, 1 + n), the target first; variance (n) of what is in no group; `edges` of each group among
 * `columns`; noise and sizes hold where to start. Returns 1 without memory, 2 where a matrix is not positive definite. */
EXPORT int marginal_run(const double *grams, double *variance, long long bands, long long n, const long long *columns,
                        const long long *edges, const double *prior, long long groups, const double *count,
                        const double *effective, const double *lowest, long long rounds, double *noise, double *sizes,
                        double *beta, double *log_likelihood) {
    long long full = n + 1;
    double *work = malloc((size_t)(3 * n * n + 2 * n + bands) * sizeof *work);
    if (!work) return 1;
    double *factor = work, *turned = factor + n * n, *covariance = turned + n * n, *scale = covariance + n * n;
    double *towards = scale + n, *left = towards + n, weighted = 0, log_normal = 0;
    for (long long last = 0; last <= rounds; last++) {
        for (long long g = 0; g < groups; g++) {
            double size = larger(sizes[g], 1e-6 * prior[g]);
            for (long long k = edges[g]; k < edges[g + 1]; k++) variance[columns[k]] = size * size;
        }
        for (long long k = 0; k < n * n; k++) factor[k] = 0;
        for (long long k = 0; k < n; k++) towards[k] = 0;
        for (long long b = 0; b < bands; b++) {
            double weight = effective[b] / larger(count[b], 1e-300) / noise[b];
            for (long long i = 0; i < n; i++) {
                const double *row = grams + (b * full + i + 1) * full;
                towards[i] += weight * row[0];
                for (long long j = 0; j <= i; j++) factor[i * n + j] += weight * row[1 + j];
            }
        }
        for (long long i = 0; i < n; i++) {
            factor[i * n + i] += 1 / variance[i];
            scale[i] = 1 / sqrt(factor[i * n + i]);
        }
        for (long long i = 0; i < n; i++) {
            for (long long j = 0; j <= i; j++) factor[i * n + j] *= scale[i] * scale[j];
            factor[i * n + i] += 1e-12;
        }
        if (!factorise(factor, n)) return free(work), 2;
        invert(factor, turned, n);
        for (long long i = 0; i < n; i++)
            for (long long j = 0; j <= i; j++) {
                double found = dot(turned + i * n + i, turned + j * n + i, n - i) * scale[i] * scale[j];
                covariance[i * n + j] = covariance[j * n + i] = found;
            }
        for (long long i = 0; i < n; i++) beta[i] = dot(covariance + i * n, towards, n);
        for (long long b = 0; b < bands; b++) {
            const double *gram = grams + b * full * full;
            double bent = 0;
            for (long long i = 0; i < n; i++) {
                const double *row = gram + (i + 1) * full;
                bent += beta[i] * (dot(row + 1, beta, n) - 2 * row[0]);
            }
            left[b] = gram[0] + bent;
        }
        if (last == rounds) break;
        for (long long b = 0; b < bands; b++) {
            double open = 0;
            for (long long i = 0; i < n; i++)
                open += dot(grams + (b * full + i + 1) * full + 1, covariance + i * n, n);
            noise[b] = larger((larger(left[b], 0) + open) / count[b], lowest[b]);
        }
        for (long long g = 0; g < groups; g++)
            sizes[g] = size_of(beta, covariance, columns + edges[g], edges[g + 1] - edges[g], n, prior[g]);
    }
    for (long long b = 0; b < bands; b++)
        weighted += effective[b] * (log(noise[b]) + left[b] / larger(count[b], 1e-300) / noise[b]);
    for (long long i = 0; i < n; i++) {
        weighted += beta[i] * beta[i] / variance[i] + log(variance[i]);
        log_normal += log(factor[i * n + i]) - log(scale[i]);
    }
    for (long long g = 0; g < groups; g++) weighted += sizes[g] / prior[g] * (sizes[g] / prior[g]);
    *log_likelihood = -weighted / 2 - log_normal;
    free(work);
    return 0;
}
