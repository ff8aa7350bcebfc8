/* A machine under a recorded reference, with the derivatives of its state by the free parameters.
 *
 * Each tick: control (s, S, r, p) -> (s, S, y, Y), then `substeps` times plant (s, S, p) -> (s, S). Capital letters are
 * derivatives, one column for each free parameter. functions.h is CasADi's, sizes.h beside it gives the dimensions.
 * Everything lives on the stack or in the caller's arrays, so that several threads may run at once.
 */
#include "functions.h"
#include "sizes.h"

#include <string.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef struct {
    double s[STATES], slopes[STATES * FREE], w[WORK];
    casadi_int iw[INT_WORK];
} Machine;

static void control(Machine *now, const double *r, const double *p, double *y, double *y_slopes) {
    double s[STATES], slopes[STATES * FREE];
    const double *arg[ARGUMENTS] = {now->s, now->slopes, r, p};
    double *res[RESULTS] = {s, slopes, y, y_slopes};
    identify_control(arg, res, now->iw, now->w, 0);
    memcpy(now->s, s, sizeof s);
    memcpy(now->slopes, slopes, sizeof slopes);
}

static void substep(Machine *now, const double *p) {
    double s[STATES], slopes[STATES * FREE];
    const double *arg[ARGUMENTS] = {now->s, now->slopes, p};
    double *res[RESULTS] = {s, slopes};
    identify_plant(arg, res, now->iw, now->w, 0);
    memcpy(now->s, s, sizeof s);
    memcpy(now->slopes, slopes, sizeof slopes);
}

/* `r` holds REFERENCES values a tick, `y` OUTPUTS values and then their derivatives by columns; `start` is the first
 * state. */
EXPORT void run(long long ticks, long long substeps, const double *start, const double *r, const double *p,
                double *y) {
    Machine now;
    memcpy(now.s, start, sizeof now.s);
    memset(now.slopes, 0, sizeof now.slopes);
    for (long long k = 0; k < ticks; k++) {
        control(&now, r + k * REFERENCES, p, y, y + OUTPUTS);
        y += OUTPUTS * (1 + FREE);
        for (long long i = 0; i < substeps; i++) substep(&now, p);
    }
}
