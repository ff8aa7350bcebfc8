/* The FMU proper, without an FMI version: both API sets are thin translations of these functions.
 *
 * Contract: a call that returns ERROR or DISCARD has logged one sentence and left the instance as it was. Nothing
 * allocates after `instantiate` except `save`, and nothing is shared between instances.
 */
#ifndef CORE_H
#define CORE_H

#include "model.h"

#include <stddef.h>
#include <stdint.h>

/* Equal in value to fmi2Status and fmi3Status. */
typedef enum { OK, WARNING, DISCARD, FAILED, FATAL } Status;

typedef enum { MODEL_EXCHANGE, CO_SIMULATION } Interface;

/* Sets of phases are sums. */
typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4,
    CONTINUOUS = 8,
    STEP = 16,
    TERMINATED = 32,
    RUNNING = 28,
    READABLE = 62, /* from initialization on */
    ANY_PHASE = 63
} Phase;

typedef enum { RATES_FRESH = 1, OUTPUTS_FRESH = 2 } Fresh;

typedef struct {
    enum { SOLVED, NOT_FINITE, STEP_TOO_SMALL, TOO_MANY_STEPS } result;
    int culprit; /* state */
    double time; /* that was reached */
} Advance;

/* Everything that `save` keeps. `ticks` counts the ticks of a sampled model that are done: time is counted, not summed. */
typedef struct {
    uint64_t mark; /* hash of the token: a state of another model is refused */
    double start, stop, tolerance, step;
    int64_t ticks;
    int32_t interface, phase, fresh, reserved;
    double values[]; /* by value reference; values[0] is time */
} Memory;

typedef void (*Emit)(void *instance, Status status, const char *category, const char *message);

typedef struct {
    Memory *memory;
    double *values, *inputs, *parameters, *states, *rates, *outputs; /* inside memory */
    double *scratch;         /* states + outputs */
    double *seeds;           /* size */
    double *trials;          /* states of two solver steps */
    double *error, *pivots;  /* of the last solver step */
    Emit emit;
    void (*logger)(void);
    void *environment;
    char *name;
    int log_errors, log_events;
    char message[512];
} Instance;

extern const char category_error[], category_event[];

/* instance.c */
Instance *instantiate(Interface interface, const char *name, const char *token, Emit emit, void (*logger)(void),
                      void *environment, int log_events);
void free_instance(Instance *instance);
void reset(Instance *instance);
Status fail(Instance *instance, Status status, const char *format, ...);
void note(Instance *instance, const char *format, ...);
Status set_logging(Instance *instance, int on, size_t count, const char *const *categories);
Status expect(Instance *instance, int phases, const char *what);
int allowed(Instance *instance, int phases, int complete, const char *what);
int exchanging(Instance *instance, int phases, int complete, const char *what);
Status enter_initialization(Instance *instance, const char *what);
Status exit_initialization(Instance *instance, const char *what);
Status set_experiment(Instance *instance, int has_tolerance, double tolerance, double start, int has_stop, double stop);
Status set_phase(Instance *instance, int from, Phase to, const char *what);

/* values.c */
Status get_values(Instance *instance, const uint32_t *references, size_t count, double *values);
Status set_values(Instance *instance, const uint32_t *references, size_t count, const double *values);
Status get_states(Instance *instance, double *states, size_t count);
Status set_states(Instance *instance, const double *states, size_t count);
Status get_nominals(Instance *instance, double *nominals, size_t count);
Status get_rates(Instance *instance, double *rates, size_t count);
Status set_time(Instance *instance, double time);
Status directional(Instance *instance, const uint32_t *unknowns, size_t unknown_count, const uint32_t *knowns,
                   size_t known_count, const double *seed, double *sensitivity);
Status adjoint(Instance *instance, const uint32_t *unknowns, size_t unknown_count, const uint32_t *knowns, size_t known_count,
               const double *seed, double *sensitivity);

/* step.c */
void evaluate(Instance *instance, Code *code, double time, const double *x, double *first, double *second);
int tick_is_due(const Instance *instance);
double next_tick_time(const Instance *instance);
int resolves_ticks(double time);
Status tick(Instance *instance, int advance);
Status update_discrete(Instance *instance);
Status do_step(Instance *instance, double time, double length);

/* solver.c */
/* From start to end, or on failure not at all. The proposed step size is kept in memory, so a restored run repeats its
 * bits. */
Advance solver_advance(Instance *instance, double start, double end);

/* memory.c */
size_t memory_size(void);
size_t serialized_size(void);
uint64_t hash_bytes(const void *bytes, size_t count);
Status save(Instance *instance, Memory **memory);
void release(Memory **memory);
Status restore(Instance *instance, const Memory *memory);
Status serialize(Instance *instance, const Memory *memory, unsigned char *bytes, size_t size);
Status deserialize(Instance *instance, const unsigned char *bytes, size_t size, Memory **memory);

#endif
