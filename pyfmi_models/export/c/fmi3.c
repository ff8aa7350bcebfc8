/* FMI 3.0: translation of the API to core.h. What this model has no use for is in fmi3_unused.c. */
#include "fmi3Functions.h"

#include "core.h"

static void emit(void *instance, Status status, const char *category, const char *message) {
    Instance *sender = instance;
    ((fmi3LogMessageCallback)sender->logger)(sender->environment, (fmi3Status)status, category, message);
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t count, const fmi3String categories[]) {
    return c ? (fmi3Status)set_logging(c, on, categories ? count : 0, categories) : fmi3Error;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback logger) {
    (void)resources;
    (void)visible;
    return instantiate(MODEL_EXCHANGE, name, token, emit, (void (*)(void))logger, environment, logging);
}

/* Event mode and early return are optional offers of the importer; this model takes neither (hasEventMode is false). */
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t intermediate_count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                         fmi3IntermediateUpdateCallback update) {
    (void)resources;
    (void)visible;
    (void)early_return;
    (void)intermediate;
    (void)intermediate_count;
    (void)update;
    Instance *instance = instantiate(CO_SIMULATION, name, token, emit, (void (*)(void))logger, environment, logging);
    if (!instance || !event_mode) return instance;
    fail(instance, FAILED, "event mode is not available in co-simulation");
    free_instance(instance);
    return NULL;
}

void fmi3FreeInstance(fmi3Instance c) { free_instance(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop) {
    if (!allowed(c, INSTANTIATED, 1, "fmi3EnterInitializationMode")) return fmi3Error;
    Status status = set_experiment(c, has_tolerance, tolerance, start, has_stop, stop);
    return (fmi3Status)(status == OK ? enter_initialization(c, "fmi3EnterInitializationMode") : status);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    return c ? (fmi3Status)exit_initialization(c, "fmi3ExitInitializationMode") : fmi3Error;
}

fmi3Status fmi3Terminate(fmi3Instance c) {
    return c ? (fmi3Status)set_phase(c, RUNNING, TERMINATED, "fmi3Terminate") : fmi3Error;
}

fmi3Status fmi3Reset(fmi3Instance c) {
    if (!c) return fmi3Error;
    reset(c);
    return fmi3OK;
}

/* All variables are scalar: as many values as references. */
static int same_count(fmi3Instance c, size_t references, size_t values) {
    if (c && references == values) return 1;
    if (c) fail(c, FAILED, "%zu values for %zu scalar variables", values, references);
    return 0;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3Float64 values[],
                          size_t value_count) {
    if (!allowed(c, READABLE, 1, "fmi3GetFloat64") || !same_count(c, count, value_count)) return fmi3Error;
    return (fmi3Status)get_values(c, references, count, values);
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                          const fmi3Float64 values[], size_t value_count) {
    return same_count(c, count, value_count) ? (fmi3Status)set_values(c, references, count, values) : fmi3Error;
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
    return c ? (fmi3Status)save(c, (Memory **)state) : fmi3Error;
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
    return c ? (fmi3Status)restore(c, state) : fmi3Error;
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
    if (!c) return fmi3Error;
    release((Memory **)state);
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    (void)state;
    if (!allowed(c, ANY_PHASE, size != NULL, "fmi3SerializedFMUStateSize")) return fmi3Error;
    *size = serialized_size();
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    return c ? (fmi3Status)serialize(c, state, bytes, size) : fmi3Error;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    return c ? (fmi3Status)deserialize(c, bytes, size, (Memory **)state) : fmi3Error;
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t unknown_count,
                                        const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seed[],
                                        size_t seed_count, fmi3Float64 sensitivity[], size_t sensitivity_count) {
    if (!allowed(c, READABLE, 1, "fmi3GetDirectionalDerivative")) return fmi3Error;
    if (!same_count(c, known_count, seed_count) || !same_count(c, unknown_count, sensitivity_count)) return fmi3Error;
    return (fmi3Status)directional(c, unknowns, unknown_count, knowns, known_count, seed, sensitivity);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t unknown_count,
                                    const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seed[],
                                    size_t seed_count, fmi3Float64 sensitivity[], size_t sensitivity_count) {
    if (!allowed(c, READABLE, 1, "fmi3GetAdjointDerivative")) return fmi3Error;
    if (!same_count(c, unknown_count, seed_count) || !same_count(c, known_count, sensitivity_count)) return fmi3Error;
    return (fmi3Status)adjoint(c, unknowns, unknown_count, knowns, known_count, seed, sensitivity);
}

/* Model exchange. */

fmi3Status fmi3EnterEventMode(fmi3Instance c) {
    const char *what = "fmi3EnterEventMode";
    return exchanging(c, CONTINUOUS + EVENT, 1, what) ? (fmi3Status)set_phase(c, ANY_PHASE, EVENT, what) : fmi3Error;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *states_changed,
                                    fmi3Boolean *next_time_defined, fmi3Float64 *next_time) {
    int complete = again && terminate && nominals_changed && states_changed && next_time_defined && next_time;
    if (!exchanging(c, EVENT, complete, "fmi3UpdateDiscreteStates")) return fmi3Error;
    Status status = update_discrete(c);
    *again = *terminate = *nominals_changed = *states_changed = fmi3False;
    *next_time_defined = model.period > 0;
    *next_time = model.period > 0 ? next_tick_time(c) : 0;
    return (fmi3Status)status;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) {
    const char *what = "fmi3EnterContinuousTimeMode";
    return exchanging(c, EVENT, 1, what) ? (fmi3Status)set_phase(c, ANY_PHASE, CONTINUOUS, what) : fmi3Error;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_set, fmi3Boolean *enter_event_mode,
                                       fmi3Boolean *terminate) {
    (void)no_set;
    if (!exchanging(c, CONTINUOUS, enter_event_mode && terminate, "fmi3CompletedIntegratorStep")) return fmi3Error;
    *enter_event_mode = *terminate = fmi3False;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) {
    return exchanging(c, EVENT + CONTINUOUS, 1, "fmi3SetTime") ? (fmi3Status)set_time(c, time) : fmi3Error;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t count) {
    return exchanging(c, CONTINUOUS, 1, "fmi3SetContinuousStates") ? (fmi3Status)set_states(c, x, count) : fmi3Error;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 derivatives[], size_t count) {
    if (!exchanging(c, READABLE, 1, "fmi3GetContinuousStateDerivatives")) return fmi3Error;
    return (fmi3Status)get_rates(c, derivatives, count);
}

fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 indicators[], size_t count) {
    (void)indicators;
    if (!exchanging(c, READABLE, 1, "fmi3GetEventIndicators")) return fmi3Error;
    return count ? (fmi3Status)fail(c, FAILED, "the model has no event indicators") : fmi3OK;
}

fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t count) {
    if (!exchanging(c, READABLE, 1, "fmi3GetContinuousStates")) return fmi3Error;
    return (fmi3Status)get_states(c, x, count);
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 nominals[], size_t count) {
    if (!exchanging(c, READABLE, 1, "fmi3GetNominalsOfContinuousStates")) return fmi3Error;
    return (fmi3Status)get_nominals(c, nominals, count);
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *count) {
    if (!exchanging(c, ANY_PHASE, count != NULL, "fmi3GetNumberOfEventIndicators")) return fmi3Error;
    *count = 0;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *count) {
    if (!exchanging(c, ANY_PHASE, count != NULL, "fmi3GetNumberOfContinuousStates")) return fmi3Error;
    *count = (size_t)model.rates;
    return fmi3OK;
}

/* Co-simulation. */

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 length, fmi3Boolean no_set, fmi3Boolean *event_needed,
                      fmi3Boolean *terminate, fmi3Boolean *early_return, fmi3Float64 *last_time) {
    (void)no_set;
    int complete = event_needed && terminate && early_return && last_time;
    if (!allowed(c, STEP, complete, "fmi3DoStep")) return fmi3Error;
    Status status = do_step(c, time, length);
    *event_needed = *terminate = *early_return = fmi3False;
    *last_time = ((Instance *)c)->values[0];
    return (fmi3Status)status;
}
