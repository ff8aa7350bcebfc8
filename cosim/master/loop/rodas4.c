/* For a model that is known by its rates and a Jacobian only; our own FMUs have the step written out for their equations
 * (pyfmi_models/export/rodas4.py, with the same numbers).
 *
 * RODAS4: six-stage, stiffly accurate, L-stable Rosenbrock method of order 4(3).
 * Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.7, in the form without matrix products:
 *   (1/(h gamma) I - J) U_i = f(t + alpha_i h, x + sum a_ij U_j) + sum c_ij U_j / h + h gamma_i df/dt
 */
#include "rodas4.h"

#include "detmath.h"

#include <string.h>

enum { STAGES = 6, MOST_STEPS = 1000000 };

static const double gamma_diagonal = 0.25;
static const double alpha[STAGES] = {0, 0.386, 0.21, 0.63, 1, 1};
static const double gamma_time[STAGES] = {0.25, -0.1043, 0.1035, -0.03620000000000023, 0, 0};
static const double a[STAGES][5] = {
    {0},
    {1.544},
    {0.9466785280815826, 0.2557011698983284},
    {3.314825187068521, 2.896124015972201, 0.9986419139977817},
    {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895},
    {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895, 1},
};
static const double c[STAGES][5] = {
    {0},
    {-5.6688},
    {-2.430093356833875, -0.2063599157091915},
    {-0.1073529058151375, -9.594562251023355, -20.47028614809616},
    {7.496443313967647, -10.24680431464352, -33.99990352819905, 11.7089089320616},
    {8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054},
};

/* Parts of the work array. */
typedef struct {
    double *matrix, *by_time, *stages, *point, *right, *x_new, *error, *trial;
} Work;

static Work divide(const Solver *solver) {
    int n = solver->size;
    double *w = solver->work;
    Work work = {w, w + n * n, w + n * n + n, w + n * n + 7 * n, w + n * n + 8 * n, w + n * n + 9 * n,
                 w + n * n + 10 * n, w + n * n + 11 * n};
    return work;
}

size_t solver_work(int size) { return (size_t)size * (size_t)size + 12 * (size_t)size; }

static void swap(double *first, double *second) {
    double kept = *first;
    *first = *second;
    *second = kept;
}

static int largest_in_column(int n, const double *m, int column) {
    int pivot = column;
    for (int i = column + 1; i < n; i++)
        if (fabs(m[i + column * n]) > fabs(m[pivot + column * n])) pivot = i;
    return pivot;
}

/* LU with row exchange, in place, by columns; the diagonal keeps reciprocals, for `solve` to multiply six times.
 * Returns 0 if the matrix is regular. */
static int factorise(int n, double *m, int *pivots) {
    for (int k = 0; k < n; k++) {
        int pivot = pivots[k] = largest_in_column(n, m, k);
        if (!(fabs(m[pivot + k * n]) > 0)) return 1;
        if (pivot != k)
            for (int j = 0; j < n; j++) swap(&m[k + j * n], &m[pivot + j * n]);
        m[k + k * n] = 1 / m[k + k * n];
        for (int i = k + 1; i < n; i++) m[i + k * n] *= m[k + k * n];
        for (int j = k + 1; j < n; j++)
            for (int i = k + 1; i < n; i++) m[i + j * n] -= m[i + k * n] * m[k + j * n];
    }
    return 0;
}

static void solve(int n, const double *m, const int *pivots, double *b) {
    for (int k = 0; k < n; k++) swap(&b[k], &b[pivots[k]]);
    for (int k = 0; k < n; k++) {
        const double *column = m + k * n;
        double known = b[k];
        for (int i = k + 1; i < n; i++) b[i] -= column[i] * known;
    }
    for (int k = n - 1; k >= 0; k--) {
        const double *column = m + k * n;
        double known = b[k] *= column[k];
        for (int i = 0; i < k; i++) b[i] -= column[i] * known;
    }
}

/* matrix = 1/(h gamma) I - J, factorised. */
static SolverResult prepare(const Solver *solver, const Work *work, double time, double h, const double *x) {
    int n = solver->size;
    if (solver->jacobian(solver->context, time, x, work->matrix, work->by_time)) return NOT_FINITE;
    for (int i = 0; i < n * n; i++) work->matrix[i] = -work->matrix[i];
    for (int i = 0; i < n; i++) work->matrix[i * (n + 1)] += 1 / (h * gamma_diagonal);
    return factorise(n, work->matrix, solver->pivots) ? SINGULAR : SOLVED;
}

/* result = base + factor sum weights_j U_j */
static void combine(int n, int stages, const double *weights, const double *u, const double *base, double factor,
                    double *result) {
    for (int i = 0; i < n; i++) {
        const double *entry = u + i;
        double total = 0;
        for (int j = 0; j < stages; j++, entry += n) total += weights[j] * *entry;
        result[i] = base[i] + factor * total;
    }
}

static SolverResult stage(const Solver *solver, const Work *work, int s, double time, double h, const double *x) {
    int n = solver->size;
    double *u = work->stages + s * n;
    combine(n, s, a[s], work->stages, x, 1, work->point);
    if (solver->rates(solver->context, time + alpha[s] * h, work->point, work->right)) return NOT_FINITE;
    combine(n, s, c[s], work->stages, work->right, 1 / h, u);
    for (int i = 0; i < n; i++) u[i] += h * gamma_time[s] * work->by_time[i];
    solve(n, work->matrix, solver->pivots, u);
    return SOLVED;
}

SolverResult rodas4_step(const Solver *solver, double time, double h, const double *x, double *x_new, double *error) {
    int n = solver->size;
    Work work = divide(solver);
    SolverResult result = prepare(solver, &work, time, h, x);
    for (int s = 0; s < STAGES && result == SOLVED; s++) result = stage(solver, &work, s, time, h, x);
    if (result != SOLVED) return result;
    for (int i = 0; i < n; i++) {
        error[i] = work.stages[i + 5 * n];
        x_new[i] = work.point[i] + error[i];
    }
    return SOLVED;
}

/* Root mean square of the error in units of the tolerance; *culprit is its largest part. */
static double error_norm(const Solver *solver, const double *x, const Work *work, int *culprit) {
    double total = 0, largest = -1;
    for (int i = 0; i < solver->size; i++) {
        double before = fabs(x[i]), after = fabs(work->x_new[i]);
        double size = (before > after ? before : after) + 0.01 * solver->nominals[i];
        double part = work->error[i] / (solver->tolerance * size);
        total += part * part;
        if (!(part * part <= largest)) {
            largest = part * part;
            *culprit = i;
        }
    }
    return sqrt(total / solver->size);
}

/* A careful first step: one hundredth of the time in which the rates would change the state by its own size. */
static double first_step(const Solver *solver, double time, const double *x, double span) {
    Work work = divide(solver);
    double h = span;
    if (solver->rates(solver->context, time, x, work.right)) return span * 1e-6;
    for (int i = 0; i < solver->size; i++) {
        double size = fabs(x[i]) + 0.01 * solver->nominals[i], rate = fabs(work.right[i]);
        if (rate * h > 0.01 * size) h = 0.01 * size / rate;
    }
    return fmax(h, span * 1e-6);
}

/* Growth of the step for an error norm; fourth root by square roots only, so that no machine rounds it differently. */
static double growth(double norm) {
    double factor = 0.9 / sqrt(sqrt(norm));
    return factor > 5 ? 5 : factor < 0.2 ? 0.2 : factor;
}

SolverResult solver_advance(const Solver *solver, double start, double end, double *x, double *step, int *culprit) {
    Work work = divide(solver);
    size_t bytes = (size_t)solver->size * sizeof(double);
    double time = start, proposed = *step > 0 ? *step : first_step(solver, start, x, end - start);
    memcpy(work.trial, x, bytes);
    *culprit = 0;
    for (int steps = 0; time < end; steps++) {
        int last = time + 1.01 * proposed >= end;
        double h = last ? end - time : proposed;
        if (steps >= MOST_STEPS) return TOO_MANY_STEPS;
        if (h < 1e-15 * (fabs(time) + (end - start)) && !last) return STEP_TOO_SMALL;
        SolverResult result = rodas4_step(solver, time, h, work.trial, work.x_new, work.error);
        double norm = result == SOLVED ? error_norm(solver, work.trial, &work, culprit) : INFINITY;
        if (!(norm < INFINITY)) {
            if (h < 1e-15 * (fabs(time) + (end - start))) return result == SOLVED ? NOT_FINITE : result;
            proposed = 0.1 * h;
        } else if (norm > 1) {
            proposed = h * growth(norm);
        } else {
            memcpy(work.trial, work.x_new, bytes);
            proposed = last ? fmax(proposed, h * growth(norm)) : h * growth(norm);
            time = last ? end : time + h;
        }
    }
    memcpy(x, work.trial, bytes);
    *step = proposed;
    return SOLVED;
}
