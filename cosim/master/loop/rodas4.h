/* Adaptive RODAS4 for x' = f(t, x): stiff, one step, exact Jacobian, no memory but the step size. */
#ifndef RODAS4_H
#define RODAS4_H

#include <stddef.h>

typedef struct {
    int size;
    void *context;
    /* Both return 0, or anything else when they cannot be evaluated. The Jacobian is dense by columns, by_time = df/dt. */
    int (*rates)(void *context, double time, const double *x, double *rates);
    int (*jacobian)(void *context, double time, const double *x, double *jacobian, double *by_time);
    const double *nominals;
    double tolerance; /* relative; absolute per state: 0.01 tolerance nominal */
    double *work;     /* solver_work(size) numbers */
    int *pivots;      /* size integers */
} Solver;

typedef enum { SOLVED, SINGULAR, NOT_FINITE, STEP_TOO_SMALL, TOO_MANY_STEPS } SolverResult;

size_t solver_work(int size);

/* One step of length h from x to x_new; error is the difference to the embedded third order. */
SolverResult rodas4_step(const Solver *solver, double time, double h, const double *x, double *x_new, double *error);

/* From start to end. *step is the proposed step size, 0 if none is known yet; kept between calls it makes a restored
 * run repeat its bits. On failure x and *step are as before and *culprit is the worst state. */
SolverResult solver_advance(const Solver *solver, double start, double end, double *x, double *step, int *culprit);

#endif
