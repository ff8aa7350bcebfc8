/* What each tick does with one component and the wires that feed it, in place where it is called: a call of each costs as
 * much as what it does. part.c has the rest. */
#ifndef PART_H
#define PART_H

#include "foreign.h"
#include "loop.h"

#include <math.h>

typedef int SetReals2(void *, const uint32_t *, size_t, const double *);
typedef int GetReals2(void *, const uint32_t *, size_t, double *);
typedef int Step2(void *, double, double, int);
typedef int SetReals3(void *, const uint32_t *, size_t, const double *, size_t);
typedef int GetReals3(void *, const uint32_t *, size_t, double *, size_t);
typedef int Step3(void *, double, double, bool, bool *, bool *, bool *, double *);

static inline double carry(const Loop *loop, const Wire *wire)
{
    double value = wire->gain * loop->bus[wire->source] + wire->offset;
    if (wire->quantum > 0.0) {
        value = wire->quantum * floor(value / wire->quantum + 0.5);
    }
    value = wire->noise < 0 ? value : value + loop->bus[wire->noise];
    return wire->faults ? with_faults(loop, wire, value) : value;
}

static inline int set_inputs(const Part *part)
{
    if (part->inputs == 0) {
        return 0;
    }
    if (part->version == 2) {
        return ((SetReals2 *)part->set)(part->instance, part->input_references, (size_t)part->inputs, part->input);
    }
    return ((SetReals3 *)part->set)(part->instance, part->input_references, (size_t)part->inputs, part->input,
                               (size_t)part->inputs);
}

static inline int get_outputs(const Part *part)
{
    if (part->outputs == 0) {
        return 0;
    }
    if (part->version == 2) {
        return ((GetReals2 *)part->get)(part->instance, part->output_references, (size_t)part->outputs, part->output);
    }
    return ((GetReals3 *)part->get)(part->instance, part->output_references, (size_t)part->outputs, part->output,
                               (size_t)part->outputs);
}

/* `final`: the component will not be taken back to before this step. */
static inline int do_step(const Part *part, double time, double size, bool final)
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

static inline int worse(int one, int other)
{
    return one > other ? one : other;
}

/* Ends the calls of a component that `enter` returned: its arithmetic is put right, and its outputs must be finite. */
static inline int leave(const Part *part, int status)
{
    after_all(part->altered);
    for (int64_t i = 0; status <= FMI_WARNING && i < part->outputs; i++) {
        if (!isfinite(part->output[i])) {
            status = NOT_FINITE;
        }
    }
    return status;
}

/* Returns a part whose functions will be called now, and notes it: if it never comes back, another process can tell. */
static inline const Part *enter(Loop *loop, int64_t part)
{
    loop->status = -1 - part;
    return &loop->part[part];
}

#endif
