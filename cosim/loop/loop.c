/* The stepping loop: gathers, sets, steps, gets and records for every component, one tick after the other.
 *
 * All values live on one bus: outputs and inputs of each component, then the signals of the tick. At tick k, t = k * step:
 *   1. the signals of the tick are put on the bus;
 *   2. every wire carries  y = quantise(gain * x + offset) + noise  from outputs and signals to inputs;
 *   3. the bus is recorded: row k holds outputs at t_k and the inputs that act from t_k to t_(k+1);
 *   4. every component is set, stepped to t_(k+1) and read (all inputs were gathered before: Jacobi).
 * interpreted.py does the same in Python, bit for bit. Nothing is allocated here. */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { FMI_WARNING = 1, NOT_FINITE = 100, TERMINATED = 101 };

typedef int Set2(void *, const uint32_t *, size_t, const double *);
typedef int Get2(void *, const uint32_t *, size_t, double *);
typedef int Step2(void *, double, double, int);
typedef int Set3(void *, const uint32_t *, size_t, const double *, size_t);
typedef int Get3(void *, const uint32_t *, size_t, double *, size_t);
typedef int Step3(void *, double, double, bool, bool *, bool *, bool *, double *);

typedef struct {
    int64_t version; /* of FMI: 2 or 3 */
    void *instance;
    void (*set)(void), (*get)(void), (*step)(void);
    int64_t inputs, outputs; /* how many */
    const uint32_t *input_references, *output_references;
    double *input, *output; /* their places on the bus */
} Part;

typedef struct {
    int64_t source, target, noise; /* places on the bus; noise < 0: none */
    double gain, offset, quantum;  /* quantum 0: not quantised */
} Wire;

typedef struct {
    int64_t source; /* place on the bus */
    int64_t mean;   /* 0: the sample at the row's tick; 1: mean over the sample interval centred there */
    double sample, sum;
} Column;

typedef struct {
    int64_t parts, wires, signals, columns, means;
    const Part *part;
    const Wire *wire;
    Column *column;
    double *bus, *signal; /* `signal` is the place of the first signal on the bus */
    double step;
    int64_t decimation, tick, warnings;
    int64_t half, edge, halves, sampled; /* of the running mean: time in half ticks, end of the window, length, row begun */
    int64_t failed, status;              /* part that failed (-1: none) and why */
} Loop;

static double carry(const Wire *wire, const double *bus)
{
    double value = wire->gain * bus[wire->source] + wire->offset;
    if (wire->quantum > 0.0) {
        value = wire->quantum * floor(value / wire->quantum + 0.5);
    }
    return wire->noise < 0 ? value : value + bus[wire->noise];
}

static int set_inputs(const Part *part)
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

static int get_outputs(const Part *part)
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

static int do_step(const Part *part, double time, double step)
{
    if (part->version == 2) {
        return ((Step2 *)part->step)(part->instance, time, step, 1);
    }
    bool event = false, terminate = false, early = false;
    double last = time;
    int status = ((Step3 *)part->step)(part->instance, time, step, true, &event, &terminate, &early, &last);
    return status <= FMI_WARNING && terminate ? TERMINATED : status;
}

static int worse(int one, int other)
{
    return one > other ? one : other;
}

/* Takes one component from `time` over one step; returns the worst status of its calls. */
static int advance(const Part *part, double time, double step)
{
    int status = set_inputs(part);
    if (status <= FMI_WARNING) {
        status = worse(status, do_step(part, time, step));
    }
    if (status <= FMI_WARNING) {
        status = worse(status, get_outputs(part));
    }
    for (int64_t i = 0; status <= FMI_WARNING && i < part->outputs; i++) {
        if (!isfinite(part->output[i])) {
            status = NOT_FINITE;
        }
    }
    return status;
}

/* Writes the row begun at the last multiple of `decimation`; rows are stored column by column, `capacity` apart. */
static void emit(Loop *loop, double *row, int64_t capacity)
{
    for (int64_t i = 0; i < loop->columns; i++) {
        Column *column = &loop->column[i];
        row[i * capacity] = column->mean ? column->sum / (double)loop->halves : column->sample;
        column->sum = 0.0;
    }
    loop->halves = 0;
    loop->sampled = 0;
}

/* Adds half a tick to the means, which ends a row when its window is full; returns the number of rows ended. */
static int64_t add_half(Loop *loop, double *row, int64_t capacity)
{
    int64_t ended = loop->half == loop->edge;
    if (ended) {
        emit(loop, row, capacity);
        loop->edge += 2 * loop->decimation;
    }
    for (int64_t i = 0; i < loop->columns; i++) {
        if (loop->column[i].mean) {
            loop->column[i].sum += loop->bus[loop->column[i].source];
        }
    }
    loop->halves++;
    loop->half++;
    return ended;
}

static int64_t record(Loop *loop, double *row, int64_t capacity)
{
    if (loop->tick % loop->decimation == 0) {
        for (int64_t i = 0; i < loop->columns; i++) {
            loop->column[i].sample = loop->bus[loop->column[i].source];
        }
        loop->sampled = 1;
        if (loop->means == 0) {
            emit(loop, row, capacity);
            return 1;
        }
    }
    if (loop->means == 0) {
        return 0;
    }
    int64_t ended = add_half(loop, row, capacity);
    return ended + add_half(loop, row + ended, capacity);
}

static void gather(Loop *loop, const double *signals, int64_t ticks)
{
    for (int64_t i = 0; i < loop->signals; i++) {
        loop->signal[i] = signals[i * ticks];
    }
    for (int64_t i = 0; i < loop->wires; i++) {
        loop->bus[loop->wire[i].target] = carry(&loop->wire[i], loop->bus);
    }
}

/* Reads all outputs once, before the first tick. */
EXPORT int64_t loop_start(Loop *loop)
{
    for (int64_t i = 0; i < loop->parts; i++) {
        int status = get_outputs(&loop->part[i]);
        if (status > FMI_WARNING) {
            loop->failed = i;
            loop->status = status;
            return 0;
        }
    }
    return 1;
}

/* Runs `ticks` ticks. `signals` holds one column of `ticks` values for each signal, `rows` one of `capacity` for each
 * recorded column. Returns the number of rows written; `failed` and `status` tell whether it got to the end. */
EXPORT int64_t loop_run(Loop *loop, int64_t ticks, const double *signals, double *rows, int64_t capacity)
{
    int64_t written = 0;
    for (int64_t k = 0; k < ticks; k++) {
        gather(loop, signals + k, ticks);
        written += record(loop, rows + written, capacity);
        double time = (double)loop->tick * loop->step;
        for (int64_t i = 0; i < loop->parts; i++) {
            int status = advance(&loop->part[i], time, loop->step);
            loop->warnings += status == FMI_WARNING;
            if (status > FMI_WARNING) {
                loop->failed = i;
                loop->status = status;
                return written;
            }
        }
        loop->tick++;
    }
    return written;
}

/* Ends a row whose window was cut short by the end of the run; its means are those of what there was. */
EXPORT int64_t loop_flush(Loop *loop, double *rows, int64_t capacity)
{
    if (!loop->sampled) {
        return 0;
    }
    emit(loop, rows, capacity);
    return 1;
}
