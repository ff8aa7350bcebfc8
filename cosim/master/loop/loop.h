/* What the loop executes. All values live on one bus: outputs and inputs of each component, then the signals of the tick.
 *
 * A tick is a programme of stages (cosim/system/plan.py names them): GATHER carries values to the inputs of some
 * components, STEP takes some over their step, ITERATE and BALANCE take some together (coupling.c). Jacobi is one GATHER
 * and one STEP of all; Gauss-Seidel a GATHER and a STEP for each in its order.
 *
 * Everything here is laid out by compiled.py, which compares sizes before it trusts a library. */
#ifndef LOOP_H
#define LOOP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { FMI_WARNING = 1, NOT_FINITE = 100, TERMINATED = 101, NOT_AGREED = 102, EARLY = 105 };

enum { GATHER, STEP, ITERATE, BALANCE };

typedef struct {
    int64_t version; /* of FMI: 2 or 3 */
    void *instance;
    void (*set)(void), (*get)(void), (*step)(void);
    int (*save)(void *, void **), (*restore)(void *, void *); /* NULL where it cannot be taken back */
    int64_t inputs, outputs; /* how many */
    const uint32_t *input_references, *output_references;
    double *input, *output; /* their places on the bus */
    int64_t wire, wires;    /* those that feed it, one after the other */
    int64_t every;          /* ticks of a step; inputs are taken at its first tick, outputs shown after its last */
    void **state;           /* where the component keeps what was saved */
    int64_t *altered;       /* where it keeps what its calls changed that they must not, see foreign.h; NULL: nowhere */
} Part;

/* y = gain x + offset + bus[noise] in the ticks from `first` to before `last`; or the value of the first of them
 * (`freeze` 1). The faults of a wire may begin with its table of values (`freeze` TABLE): `offset` in place of `gain`. */
enum { TABLE = 2 };
typedef struct {
    int64_t first, last, noise, freeze;
    double gain, offset;
    int64_t holds;
    double held;
} Fault;

typedef struct {
    int64_t source, target, noise; /* places on the bus; noise < 0: none */
    double gain, offset, quantum;  /* quantum 0: not quantised */
    int64_t faults;
    Fault *fault;
} Wire;

/* A wire between two components that are coupled; `back`: its source comes after its target in their order. */
typedef struct {
    int64_t wire, back;
    double from, held, guess, residual, scale, slope;
} Inner;

/* Two inner wires (by number) whose sources multiply to a power; the greatest power so far is their scale. */
typedef struct {
    int64_t one, other;
    double scale;
} Bond;

typedef struct {
    int64_t kind, part, parts; /* GATHER, STEP, ITERATE, BALANCE; the first component and how many */
    int64_t inners, bonds;
    Inner *inner;
    Bond *bond;
    double tolerance, theta;
    int64_t most;                       /* iterations, or pieces of a tick */
    int64_t rounds, greatest, at_limit; /* statistics: iterations or pieces in all, the most in a tick, limits met */
    double relaxation, error, size;     /* memory: of Aitken's method; of the control of the piece size */
} Stage;

typedef struct {
    int64_t source; /* place on the bus */
    int64_t mean;   /* 0: the sample at the row's tick; 1: mean over the sample interval centred there */
    int64_t late;   /* 0: an output or signal, as it is at the start of the tick; 1: an input, as it acts in the tick */
    double value, sample, sum;
} Column;

typedef struct {
    int64_t parts, wires, stages, signals, columns, means;
    Part *part;
    Wire *wire;
    Stage *stage;
    Column *column;
    double *bus, *signal; /* `signal` is the place of the first signal on the bus */
    double step;
    int64_t decimation, tick, warnings;
    int64_t half, edge, halves, sampled; /* of the running mean: time in half ticks, end of the window, length, row begun */
    int64_t failed, status, since;       /* part that failed (-1: none), why, and the tick in which its step began */
    /* while none has failed, `status` is -1 - the part whose functions are called: see enter */
} Loop;

/* part.c: status codes are those of FMI; `fail` notes who failed and returns 1. part.h has what each tick needs. */
double with_faults(const Loop *loop, const Wire *wire, double value);
int save_state(const Part *part);
int restore_state(const Part *part);
int fail(Loop *loop, int64_t part, int status, int64_t since);

/* coupling.c: both take the components of a stage over one tick and return 0, or what `fail` returned. */
int iterate(Loop *loop, Stage *stage);
int balance(Loop *loop, Stage *stage);

#endif
