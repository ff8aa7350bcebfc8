/* Time of a system: whole ticks of its own step, by the loop of `cosim run`. */
#include "nest.h"

#include <math.h>

int64_t loop_run(Loop *loop, int64_t ticks, const double *signals, double *rows, int64_t capacity);

/* For the rounding of the importer, in steps of the system. */
static const double slack = 0.01;

double next_tick_time(const Instance *instance) { return instance->values[0]; }

int resolves_ticks(double time) { return time == time; }

int tick_is_due(const Instance *instance) {
    (void)instance;
    return 0;
}

Status update_discrete(Instance *instance) { return fail(instance, FAILED, "a system of components has no event mode"); }

/* Signals of `ticks` ticks from the tick of the loop on, one after the other. */
static void fill(Nest *nest, int64_t ticks) {
    for (int64_t i = 0; i < nested.signals; i++)
        for (int64_t k = 0; k < ticks; k++)
            nest->chunk[i * ticks + k] = nested.column[i] < 0
                                             ? nested.constant[i]
                                             : nest->table[(nest->loop.tick + k) * nested.varying + nested.column[i]];
}

static Status failed(Instance *instance, const Loop *loop) {
    const char *name = nested.piece[loop->failed].name;
    double when = (double)loop->since * nested.step;
    if (loop->status == LOOP_TERMINATED)
        return fail(instance, DISCARD, "%s asked to end the simulation at %.9g s", name, when);
    if (loop->status == LOOP_NOT_FINITE)
        return fail(instance, FAILED, "%s gave an output that is not a finite number at %.9g s", name, when);
    return fail(instance, FAILED, "%s failed at %.9g s with status %d", name, when, (int)loop->status);
}

static Status run(Instance *instance, int64_t ticks) {
    Nest *nest = nest_of(instance);
    double unused[2 * CHUNK];
    while (ticks > 0) {
        int64_t now = ticks < CHUNK ? ticks : CHUNK;
        fill(nest, now);
        loop_run(&nest->loop, now, nest->chunk, unused, 2 * CHUNK);
        if (nest->loop.failed >= 0) return failed(instance, &nest->loop);
        ticks -= now;
    }
    return OK;
}

Status do_step(Instance *instance, double time, double length) {
    Nest *nest = nest_of(instance);
    double whole = floor(length / nested.step + 0.5), now = (double)nest->loop.tick * nested.step;
    if (!(whole >= 1 && whole < 9e15 && fabs(length - whole * nested.step) <= slack * nested.step))
        return fail(instance, FAILED, "a step of %.17g s is no whole multiple of %.17g s, the step of the system", length,
                    nested.step);
    if (!(fabs(time - now) <= slack * nested.step))
        return fail(instance, FAILED, "a step from t = %.17g s: the system is at t = %.17g s", time, now);
    if (nested.limited && nest->loop.tick + (int64_t)whole > nested.ticks)
        return fail(instance, FAILED, "a step to t = %.17g s passes %.17g s, where the signals of the system end",
                    time + length, (double)nested.ticks * nested.step);
    Status status = run(instance, (int64_t)whole);
    if (status == OK) instance->values[0] = (double)nest->loop.tick * nested.step;
    return status;
}
