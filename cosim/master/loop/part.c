/* One component and the wires that feed it: what loop.c takes in turn and coupling.c takes together.
 * A wire gives  y = quantise(gain * x + offset) + noise, then what faults make of it. part.py does the same in Python. */
#include "foreign.h"
#include "loop.h"

#include <math.h>

typedef int Set2(void *, const uint32_t *, size_t, const double *);
typedef int Get2(void *, const uint32_t *, size_t, double *);
typedef int Step2(void *, double, double, int);
typedef int Set3(void *, const uint32_t *, size_t, const double *, size_t);
typedef int Get3(void *, const uint32_t *, size_t, double *, size_t);
typedef int Step3(void *, double, double, bool, bool *, bool *, bool *, double *);

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

double carry(const Loop *loop, const Wire *wire)
{
    const double *bus = loop->bus;
    double value = wire->gain * bus[wire->source] + wire->offset;
    if (wire->quantum > 0.0) {
        value = wire->quantum * floor(value / wire->quantum + 0.5);
    }
    value = wire->noise < 0 ? value : value + bus[wire->noise];
    for (int64_t i = wire->faults ? look_up(wire, &value) : 0; i < wire->faults; i++) {
        value = broken(&wire->fault[i], loop->tick, bus, value);
    }
    return value;
}

int set_inputs(const Part *part)
{
    if (part->inputs == 0) {
        return 0;
    }
    if (part->version == 2) {
        return ((Set2 *)part->set)(part->instance, part->input_references, (size_t)part->inputs, part->input);
    }
    return ((Set3 *)part->set)(part->instance, part->input_references, (size_t)part->inputs, part->input,
                               (size_t)part->inputs);
}

int get_outputs(const Part *part)
{
    if (part->outputs == 0) {
        return 0;
    }
    if (part->version == 2) {
        return ((Get2 *)part->get)(part->instance, part->output_references, (size_t)part->outputs, part->output);
    }
    return ((Get3 *)part->get)(part->instance, part->output_references, (size_t)part->outputs, part->output,
                               (size_t)part->outputs);
}

/* `final`: the component will not be taken back to before this step. */
int do_step(const Part *part, double time, double size, bool final)
{
    if (part->version == 2) {
        return ((Step2 *)part->step)(part->instance, time, size, final);
    }
    bool event = false, terminate = false, early = false;
    double last = time;
    int status = ((Step3 *)part->step)(part->instance, time, size, final, &event, &terminate, &early, &last);
    if (status <= FMI_WARNING && terminate) {
        return TERMINATED;
    }
    return status <= FMI_WARNING && early ? EARLY : status; /* it was told that it must not */
}

int save_state(const Part *part)
{
    return after(part->altered, part->save(part->instance, part->state));
}

int restore_state(const Part *part)
{
    return after(part->altered, part->restore(part->instance, *part->state));
}

int worse(int one, int other)
{
    return one > other ? one : other;
}

/* Ends the calls of a component that `enter` returned: its arithmetic is put right, and its outputs must be finite. */
int leave(const Part *part, int status)
{
    after_all(part->altered);
    for (int64_t i = 0; status <= FMI_WARNING && i < part->outputs; i++) {
        if (!isfinite(part->output[i])) {
            status = NOT_FINITE;
        }
    }
    return status;
}

int fail(Loop *loop, int64_t part, int status, int64_t since)
{
    loop->failed = part;
    loop->status = status;
    loop->since = since;
    return 1;
}

/* Returns a part whose functions will be called now, and notes it: if it never comes back, another process can tell. */
const Part *enter(Loop *loop, int64_t part)
{
    loop->status = -1 - part;
    return &loop->part[part];
}
