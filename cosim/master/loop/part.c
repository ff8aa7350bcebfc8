/* One component and the wires that feed it: what loop.c takes in turn and coupling.c takes together.
 * A wire gives  y = quantise(gain * x + offset) + noise, then what faults make of it. part.py does the same in Python. */
#include "part.h"

static double broken(Fault *fault, int64_t tick, const double *bus, double value)
{
    if (tick < fault->first || tick >= fault->last) {
        return value;
    }
    if (fault->freeze) {
        fault->held = fault->holds ? fault->held : value;
        fault->holds = 1;
        return fault->held;
    }
    value = fault->gain * value + fault->offset;
    return fault->noise < 0 ? value : value + bus[fault->noise];
}

/* Puts the value of the table in the place of one that it names; returns the number of the first fault behind it. */
static int64_t look_up(const Wire *wire, double *value)
{
    double found = *value;
    int64_t i = 0;
    for (bool done = false; i < wire->faults && wire->fault[i].freeze == TABLE; i++) {
        if (!done && wire->fault[i].gain == *value) {
            found = wire->fault[i].offset;
            done = true;
        }
    }
    *value = found;
    return i;
}

double with_faults(const Loop *loop, const Wire *wire, double value)
{
    for (int64_t i = look_up(wire, &value); i < wire->faults; i++) {
        value = broken(&wire->fault[i], loop->tick, loop->bus, value);
    }
    return value;
}

int save_state(const Part *part)
{
    return after(part->altered, part->save(part->instance, part->state));
}

int restore_state(const Part *part)
{
    return after(part->altered, part->restore(part->instance, *part->state));
}

int fail(Loop *loop, int64_t part, int status, int64_t since)
{
    loop->failed = part;
    loop->status = status;
    loop->since = since;
    return 1;
}
