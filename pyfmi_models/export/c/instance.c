/* Life of an instance: memory, phases, messages. */
#include "core.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char category_error[] = "logStatusError", category_event[] = "logEvents";

/* All arrays come from one block, each a multiple of 8 bytes. */
static void *carve(char **block, size_t count, size_t size) {
    void *part = *block;
    *block += (count * size + 7) / 8 * 8;
    return part;
}

static void point_into_memory(Instance *instance) {
    instance->values = instance->memory->values;
    instance->inputs = instance->values + 1;
    instance->parameters = instance->inputs + model.inputs;
    instance->states = instance->parameters + model.parameters;
    instance->rates = instance->states + model.states;
    instance->outputs = instance->rates + model.rates;
}

static void carve_arrays(Instance *instance, char *block, size_t name_size) {
    instance->memory = carve(&block, 1, memory_size());
    instance->scratch = carve(&block, (size_t)(model.states + model.outputs), sizeof(double));
    instance->seeds = carve(&block, (size_t)model.size, sizeof(double));
    instance->trials = carve(&block, 2 * (size_t)model.rates, sizeof(double));
    instance->error = carve(&block, (size_t)model.rates, sizeof(double));
    instance->pivots = carve(&block, (size_t)model.rates, sizeof(double));
    instance->name = carve(&block, name_size, 1);
}

static Instance *allocate(const char *name) {
    size_t numbers = (size_t)(model.states + model.outputs + model.size + 4 * model.rates);
    size_t name_size = strlen(name) + 1, head = (sizeof(Instance) + 7) / 8 * 8;
    char *block = calloc(1, head + memory_size() + numbers * sizeof(double) + name_size + 16);
    if (!block) return NULL;
    Instance *instance = (Instance *)(void *)block;
    carve_arrays(instance, block + head, name_size);
    memcpy(instance->name, name, name_size);
    point_into_memory(instance);
    return instance;
}

void reset(Instance *instance) {
    Memory *memory = instance->memory;
    int32_t interface = memory->interface;
    memset(memory, 0, memory_size());
    memory->mark = hash_bytes(model.token, strlen(model.token));
    memory->stop = INFINITY;
    memory->tolerance = model.tolerance;
    memory->interface = interface;
    memory->phase = INSTANTIATED;
    for (int i = 0; i < model.size; i++) memory->values[i] = model.table[i].start;
}

Instance *instantiate(Interface interface, const char *name, const char *token, Emit emit, void (*logger)(void),
                      void *environment, int log_events) {
    Instance *instance = allocate(name ? name : "");
    if (!instance) return NULL;
    instance->emit = emit;
    instance->logger = logger;
    instance->environment = environment;
    instance->log_errors = 1;
    instance->log_events = log_events;
    instance->memory->interface = interface;
    reset(instance);
    if (token && strcmp(token, model.token) == 0) return instance;
    fail(instance, FAILED, "the token \"%s\" is not that of this binary, \"%s\": description and binary do not belong "
         "together", token ? token : "", model.token);
    free_instance(instance);
    return NULL;
}

void free_instance(Instance *instance) { free(instance); }

static void emit(Instance *instance, Status status, const char *category, const char *format, va_list arguments) {
    vsnprintf(instance->message, sizeof instance->message, format, arguments);
    if (instance->logger) instance->emit(instance, status, category, instance->message);
}

Status fail(Instance *instance, Status status, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    if (instance->log_errors) emit(instance, status, category_error, format, arguments);
    va_end(arguments);
    return status;
}

void note(Instance *instance, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    if (instance->log_events) emit(instance, OK, category_event, format, arguments);
    va_end(arguments);
}

/* No categories given means all of them. */
Status set_logging(Instance *instance, int on, size_t count, const char *const *categories) {
    int errors = count == 0, events = count == 0;
    for (size_t i = 0; i < count; i++) {
        int is_error = categories[i] && strcmp(categories[i], category_error) == 0;
        int is_event = categories[i] && strcmp(categories[i], category_event) == 0;
        if (!is_error && !is_event)
            return fail(instance, FAILED, "unknown log category \"%s\"; there are: %s, %s",
                        categories[i] ? categories[i] : "", category_error, category_event);
        errors |= is_error;
        events |= is_event;
    }
    if (errors) instance->log_errors = on;
    if (events) instance->log_events = on;
    return OK;
}

static const char *phase_name(int phase) {
    switch (phase) {
    case INSTANTIATED: return "instantiated";
    case INITIALIZATION: return "initialization";
    case EVENT: return "event";
    case CONTINUOUS: return "continuous time";
    case STEP: return "step";
    default: return "terminated";
    }
}

Status expect(Instance *instance, int phases, const char *what) {
    if (instance->memory->phase & phases) return OK;
    return fail(instance, FAILED, "%s is not allowed in the %s mode", what, phase_name(instance->memory->phase));
}

/* Whether a call is in order: there is an instance, the phase is one of these, no argument that is needed is NULL. */
int allowed(Instance *instance, int phases, int complete, const char *what) {
    if (!instance || expect(instance, phases, what) != OK) return 0;
    return complete || fail(instance, FAILED, "%s: an argument is missing", what) == OK;
}

/* The same for the functions of model exchange. */
int exchanging(Instance *instance, int phases, int complete, const char *what) {
    if (!allowed(instance, phases, complete, what)) return 0;
    if (instance->memory->interface == MODEL_EXCHANGE) return 1;
    return fail(instance, FAILED, "%s is for model exchange, and this is a co-simulation", what) == OK;
}

Status set_phase(Instance *instance, int from, Phase to, const char *what) {
    Status status = expect(instance, from, what);
    if (status != OK) return status;
    instance->memory->phase = to;
    note(instance, "%s mode at t = %.17g s", phase_name(to), instance->values[0]);
    return OK;
}

Status enter_initialization(Instance *instance, const char *what) {
    return set_phase(instance, INSTANTIATED, INITIALIZATION, what);
}

Status exit_initialization(Instance *instance, const char *what) {
    return set_phase(instance, INITIALIZATION, instance->memory->interface == CO_SIMULATION ? STEP : EVENT, what);
}

Status set_experiment(Instance *instance, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    Status status = expect(instance, INSTANTIATED, "setting up the experiment");
    if (status != OK) return status;
    if (!(fabs(start) < INFINITY)) return fail(instance, FAILED, "the start time %g is not finite", start);
    if (model.period > 0 && !resolves_ticks(start))
        return fail(instance, FAILED, "near the start time %.17g s a number cannot tell one tick from the next, %g s later",
                    start, model.period);
    if (has_stop && !(stop >= start))
        return fail(instance, FAILED, "the stop time %.17g s is before the start time %.17g s", stop, start);
    if (has_tolerance && !(tolerance > 0 && tolerance < 1))
        return fail(instance, FAILED, "the tolerance %g is not between 0 and 1", tolerance);
    instance->memory->start = instance->values[0] = start;
    instance->memory->stop = has_stop ? stop : INFINITY;
    if (has_tolerance) instance->memory->tolerance = tolerance;
    return OK;
}
