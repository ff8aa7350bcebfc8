/* A system inside one FMU: what the generator writes about it (system.c), and what lives in an instance of it.
 *
 * The functions of FMI are those of our own FMUs (fmi2.c, fmi3.c); life.c, values.c and advance.c are what is behind them
 * here. The components are shared libraries in resources/parts, found from where this library lies itself; the loop that
 * steps them is that of `cosim run` (loop.c, part.c, coupling.c). */
#ifndef NEST_H
#define NEST_H

#include "core.h"

/* Loop and core have some names in common; here those of the loop begin with its own. */
#define do_step part_do_step
#define fail loop_fail
#define TERMINATED LOOP_TERMINATED
#define NOT_FINITE LOOP_NOT_FINITE
#define STEP LOOP_STEP
#include "part.h"
#undef do_step
#undef fail
#undef TERMINATED
#undef NOT_FINITE
#undef STEP

/* A component: its folder in resources/parts, which is an unpacked FMU, and its places on the bus, see Part in loop.h. */
typedef struct {
    const char *name, *folder, *library, *token; /* library: its path in the folder */
    int version, can_save;
    int64_t every, input, inputs, output, outputs, wire, wires;
    const uint32_t *input_references, *output_references;
} Piece;

/* A parameter or start value that the scenario gives; `late`: an input, which is set in initialisation mode. */
typedef struct {
    int part, late;
    const char *function; /* of FMI, without prefix: SetReal, SetInt64 ... */
    uint32_t reference;
    size_t count;
    const double *numbers;
    const char *const *texts;
} Setting;

/* What happens at the start, in this order: inputs of a part are fed by their wires and set, outputs are read, a part
 * leaves initialisation mode. `places` are numbers among its inputs or outputs. */
typedef struct {
    enum { FEED, READ, LEAVE } kind;
    int part, count;
    const int *places;
} Start;

/* What a value reference of this FMU means: a variable of a part, or a signal (part < 0). */
typedef struct {
    int part;
    uint32_t reference;
} Meaning;

typedef struct {
    double step;
    int64_t ticks; /* for which there are signals */
    int limited;   /* whether signals say nothing beyond them */
    int parts, wires, stages, signals, varying, bus, signal, settings, starts;
    const Piece *piece;
    const Wire *wire; /* their faults are shared: what is held there is kept by the instance */
    const int *faults; /* of each wire: its first in `fault`, and how many */
    const Fault *fault;
    int all_faults;
    const Stage *stage;
    const Inner *inner;
    const Bond *bond;
    int inners, bonds;
    const double *start;    /* the bus before the start */
    const double *constant; /* of each signal its value, where it is constant */
    const int *column;      /* of each signal its column in signals.bin, -1: constant */
    const Setting *setting;
    const Start *begin;
    const Meaning *meaning; /* by value reference - 1 */
} System;

extern const System nested;

/* What an instance has beside its Memory. */
typedef struct {
    void **library;   /* of each part */
    void **instance;
    void **state;     /* saved within a step, by a coupling */
    char *touched;    /* by value reference: set by the importer */
    double *table;    /* varying signals, tick by tick */
    double *chunk;    /* signals of CHUNK ticks, signal by signal */
    void *callbacks;  /* of FMI 2.0, with the instance as environment */
    Loop loop;
} Nest;

enum { CHUNK = 256 };

Nest *nest_of(Instance *instance);

/* libraries.c: 0 is success; on failure one sentence has been logged. */
int open_parts(Instance *instance);
void close_parts(Instance *instance);
int enter_parts(Instance *instance, double start);
int put_real(Instance *instance, int part, uint32_t reference, double value);
int take_real(Instance *instance, int part, uint32_t reference, double *value);
int leave_part(Instance *instance, int part);

/* plan.c */
int lay_out(Instance *instance);
void clear_plan(Nest *nest);
int begin_parts(Instance *instance);

#endif
