/* Adaptive step size around the step of RODAS4 that the generator wrote out for the model (step_code). Included by model.c,
 * so that the compiler knows the number of states. */
#include "core.h"
#include "detmath.h"

/* 1/(h gamma) without a Jacobian; a pivot below one hundredth of it does not define the step. */
static const double gamma_diagonal = 0.25, smallest_pivot = 0.01;

static int usable(const double *reciprocals, double h) {
    double largest = h * gamma_diagonal / smallest_pivot;
    for (int i = 0; i < model.rates; i++)
        if (!(fabs(reciprocals[i]) <= largest) || reciprocals[i] == 0) return 0;
    return 1;
}

/* One step from x to x_new: the mean square of its error in units of the tolerance, not finite if there is no such step. */
static double attempt(Instance *instance, double time, double h, const double *x, double *x_new) {
    double square, tolerance = instance->memory->tolerance;
    const double *in[] = {&time, x, instance->inputs, instance->parameters, &h};
    double *out[] = {x_new, instance->error, &square, instance->pivots};
    model.step_code(in, out);
    if (!usable(instance->pivots, h)) return INFINITY;
    for (int i = 0; i < model.rates; i++) square += 0 * x_new[i]; /* not a number where x_new is infinite */
    return square / (model.rates * tolerance * tolerance);
}

/* The state whose rate is not finite at the start of the step, else the one with the largest error. */
static int worst_state(Instance *instance, double time, const double *x) {
    const double *error = instance->error;
    double *rates = instance->scratch;
    int worst = 0;
    evaluate(instance, model.rates_code, time, x, rates, NULL);
    for (int i = 0; i < model.rates; i++) {
        if (!(fabs(rates[i]) < INFINITY)) return i;
        if (fabs(error[i]) > fabs(error[worst])) worst = i;
    }
    return worst;
}

/* A careful first step: one hundredth of the time in which the rates would change the state by its own size. */
static double first_step(Instance *instance, double time, double span) {
    double h = span, *rates = instance->error;
    evaluate(instance, model.rates_code, time, instance->states, rates, NULL);
    for (int i = 0; i < model.rates; i++) {
        double size = fabs(instance->states[i]) + 0.01 * model.nominals[i], rate = fabs(rates[i]);
        if (rate * h > 0.01 * size) h = 0.01 * size / rate;
    }
    return fmax(h, span * 1e-6);
}

/* Growth of the step for a mean square error; the eighth root by square roots only, so that no machine rounds it
 * differently. */
static double growth(double square) {
    double factor = 0.9 / sqrt(sqrt(sqrt(square)));
    return factor > 5 ? 5 : factor < 0.2 ? 0.2 : factor;
}

static double propose(double square, double h, int last, double proposed) {
    if (!(square < INFINITY)) return 0.1 * h;
    if (!(square <= 1 && last)) return h * growth(square);
    return proposed >= 5 * h ? proposed : fmax(proposed, h * growth(square));
}

Advance solver_advance(Instance *instance, double start, double end) {
    const double *x = instance->states;
    double *x_new = instance->trials, *spare = x_new + model.rates, time = start, proposed = instance->memory->step;
    if (!(proposed > 0)) proposed = first_step(instance, start, end - start);
    for (int steps = 0; time < end; steps++) {
        double left = end - time, h = left <= 1.01 * proposed ? left : proposed;
        double square = attempt(instance, time, h, x, x_new);
        int accepted = square <= 1, tiny = !accepted && h <= 1e-15 * (fabs(time) + (end - start));
        if (tiny || steps >= model.most_steps) {
            Advance stuck = {tiny ? STEP_TOO_SMALL : TOO_MANY_STEPS, worst_state(instance, time, x), time};
            if (tiny && !(square < INFINITY)) stuck.result = NOT_FINITE;
            return stuck;
        }
        proposed = propose(square, h, h == left, proposed);
        if (!accepted) continue;
        time = h == left ? end : time + h;
        x = x_new;
        x_new = spare;
        spare = (double *)x;
    }
    for (int i = 0; i < model.rates; i++) instance->states[i] = x[i];
    instance->memory->step = proposed;
    Advance done = {SOLVED, 0, end};
    return done;
}
