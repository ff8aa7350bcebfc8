/* How time passes: the solver of a continuous model, the counted ticks of a sampled one.
 *
 * Tick k of a sampled model is due at start + k period. A co-simulation step over [t, t + h) executes the ticks that are
 * due in it, with the inputs set before the step: the tick at the start of the step belongs to it, that at its end does
 * not. Outputs read after the step are those of the last tick, so a command computed from the sample of tick k acts from
 * tick k + 1. Ticks are counted, and one hundredth of a period (or of the step) is allowed for the master's rounding of t.
 */
#include "core.h"
#include "detmath.h"

#include <string.h>

static const double slack = 0.01;

void evaluate(Instance *instance, Code *code, double time, const double *x, double *first, double *second) {
    const double *in[] = {&time, x, instance->inputs, instance->parameters};
    double *out[] = {first, second};
    code(in, out);
}

double next_tick_time(const Instance *instance) {
    return instance->memory->start + (double)instance->memory->ticks * model.period;
}

/* Rounding of time must stay within the slack. */
int resolves_ticks(double time) { return fabs(time) * 2.3e-16 < slack * model.period; }

int tick_is_due(const Instance *instance) {
    return model.period > 0 && instance->values[0] >= next_tick_time(instance) - slack * model.period;
}

/* Evaluate the tick that is due; with advance its new states are kept, without only its outputs are shown. */
Status tick(Instance *instance, int advance) {
    double *next = instance->scratch, *outputs = instance->scratch + model.states;
    evaluate(instance, model.tick_code, next_tick_time(instance), instance->states, next, outputs);
    int first_state = (int)(instance->states - instance->values), offset = first_state;
    for (int i = 0; i < model.states + model.outputs; i++)
        if (!(fabs(next[i]) < INFINITY))
            return fail(instance, FAILED, "\"%s\" is not finite after the tick at t = %.17g s",
                        model.table[offset + i].name, next_tick_time(instance));
    if (model.outputs) memcpy(instance->outputs, outputs, (size_t)model.outputs * sizeof(double));
    if (!advance) return OK;
    if (model.states) memcpy(instance->states, next, (size_t)model.states * sizeof(double));
    instance->memory->ticks++;
    return OK;
}

/* A call that would take minutes is an error instead: the time is wrong, or the master skips events. */
static Status check_ticks(Instance *instance, double ticks, double time) {
    if (ticks <= model.most_steps) return OK;
    return fail(instance, FAILED, "%.10g ticks of %g s are due at t = %.17g s; one call executes at most %d", ticks, model.period,
                time, model.most_steps);
}

/* Execute ticks until `due` are done since the start. On failure the states and outputs of those done are taken back. */
static Status execute_ticks(Instance *instance, double due, double time) {
    Memory *memory = instance->memory;
    int64_t before = memory->ticks;
    size_t bytes = (size_t)(model.states + model.outputs) * sizeof(double);
    Status status = check_ticks(instance, due - (double)before, time);
    if (due > (double)before + 1 && bytes) memcpy(instance->seeds, instance->states, bytes);
    while (status == OK && (double)memory->ticks < due) status = tick(instance, 1);
    if (status != OK && memory->ticks > before) {
        memcpy(instance->states, instance->seeds, bytes);
        memory->ticks = before;
    }
    return status;
}

Status update_discrete(Instance *instance) {
    if (!tick_is_due(instance)) return OK;
    double time = instance->values[0], due = floor((time - instance->memory->start) / model.period + slack) + 1;
    return execute_ticks(instance, fmax(due, (double)instance->memory->ticks + 1), time);
}

static Status step_sampled(Instance *instance, double time, double length) {
    double margin = slack * (length < model.period ? length / model.period : 1);
    double due = ceil((time + length - instance->memory->start) / model.period - margin);
    return execute_ticks(instance, due, time + length);
}

static Status explain(Instance *instance, Advance stuck) {
    const char *name = model.table[1 + model.inputs + model.parameters + stuck.culprit].name;
    if (stuck.result == TOO_MANY_STEPS)
        return fail(instance, FAILED, "%d solver steps reach t = %.17g s only, because of \"%s\"; take shorter steps or a "
                    "looser tolerance than %g", model.most_steps, stuck.time, name, instance->memory->tolerance);
    if (stuck.result == NOT_FINITE)
        return fail(instance, FAILED, "the rate of \"%s\" or a derivative of it is not finite near t = %.17g s", name,
                    stuck.time);
    return fail(instance, FAILED, "the solver step becomes too small at t = %.17g s, because of \"%s\"", stuck.time, name);
}

static Status step_continuous(Instance *instance, double time, double length) {
    if (!model.rates) return OK;
    Advance advance = solver_advance(instance, instance->values[0], time + length);
    return advance.result == SOLVED ? OK : explain(instance, advance);
}

static Status check_step(Instance *instance, double time, double length) {
    double now = instance->values[0], margin = 1e-6 * length + 1e-14 * fabs(now), stop = instance->memory->stop;
    if (!(fabs(time) < INFINITY) || !(length > 0 && time + length < INFINITY))
        return fail(instance, FAILED, "a step of %.17g s from t = %.17g s: the length must be positive and finite", length,
                    time);
    if (time < now - margin)
        return fail(instance, FAILED, "a step from t = %.17g s goes backwards: the model is at t = %.17g s", time, now);
    if (time > now + margin)
        return fail(instance, FAILED, "a step from t = %.17g s leaves a gap: the model is at t = %.17g s", time, now);
    if (time + length > stop + margin)
        return fail(instance, FAILED, "a step to t = %.17g s passes the stop time %.17g s", time + length, stop);
    if (!(time + length > now)) return fail(instance, FAILED, "a step of %.17g s is lost in rounding", length);
    return OK;
}

Status do_step(Instance *instance, double time, double length) {
    Status status = check_step(instance, time, length);
    if (status == OK)
        status = model.period > 0 ? step_sampled(instance, time, length) : step_continuous(instance, time, length);
    if (status != OK) return status;
    instance->values[0] = time + length;
    instance->memory->fresh = 0;
    return OK;
}
