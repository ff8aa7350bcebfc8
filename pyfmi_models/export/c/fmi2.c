/* FMI 2.0: translation of the API to core.h. */
#include "fmi2Functions.h"

#include "core.h"

#include <string.h>

/* The message is the format of a printf-like callback: a percent sign in it is doubled. */
static void emit(void *instance, Status status, const char *category, const char *message) {
    Instance *sender = instance;
    char escaped[2 * sizeof sender->message];
    char *end = escaped;
    for (const char *c = message; *c; c++) {
        *end++ = *c;
        if (*c == '%') *end++ = '%';
    }
    *end = 0;
    ((fmi2CallbackLogger)sender->logger)(sender->environment, sender->name, (fmi2Status)status, category, escaped);
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[]) {
    return c ? (fmi2Status)set_logging(c, on, categories ? count : 0, categories) : fmi2Error;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources;
    (void)visible;
    void (*logger)(void) = callbacks ? (void (*)(void))callbacks->logger : NULL;
    void *environment = callbacks ? callbacks->componentEnvironment : NULL;
    Interface interface = type == fmi2CoSimulation ? CO_SIMULATION : MODEL_EXCHANGE;
    return instantiate(interface, name, guid, emit, logger, environment, logging);
}

void fmi2FreeInstance(fmi2Component c) { free_instance(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop) {
    return c ? (fmi2Status)set_experiment(c, has_tolerance, tolerance, start, has_stop, stop) : fmi2Error;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    return c ? (fmi2Status)enter_initialization(c, "fmi2EnterInitializationMode") : fmi2Error;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    return c ? (fmi2Status)exit_initialization(c, "fmi2ExitInitializationMode") : fmi2Error;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    return c ? (fmi2Status)set_phase(c, RUNNING, TERMINATED, "fmi2Terminate") : fmi2Error;
}

fmi2Status fmi2Reset(fmi2Component c) {
    if (!c) return fmi2Error;
    reset(c);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2Real values[]) {
    if (!allowed(c, READABLE, 1, "fmi2GetReal")) return fmi2Error;
    return (fmi2Status)get_values(c, references, count, values);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, const fmi2Real values[]) {
    return c ? (fmi2Status)set_values(c, references, count, values) : fmi2Error;
}

/* The model has real variables only: any request for another type that is not empty is wrong. */
static fmi2Status only_real(fmi2Component c, size_t count, const char *type) {
    if (!c) return fmi2Error;
    return count ? (fmi2Status)fail(c, FAILED, "the model has no %s variables", type) : fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference r[], size_t count, fmi2Integer values[]) {
    (void)r;
    (void)values;
    return only_real(c, count, "integer");
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t count, fmi2Boolean values[]) {
    (void)r;
    (void)values;
    return only_real(c, count, "boolean");
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference r[], size_t count, fmi2String values[]) {
    (void)r;
    (void)values;
    return only_real(c, count, "string");
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference r[], size_t count, const fmi2Integer values[]) {
    (void)r;
    (void)values;
    return only_real(c, count, "integer");
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t count, const fmi2Boolean values[]) {
    (void)r;
    (void)values;
    return only_real(c, count, "boolean");
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference r[], size_t count, const fmi2String values[]) {
    (void)r;
    (void)values;
    return only_real(c, count, "string");
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    return c ? (fmi2Status)save(c, (Memory **)state) : fmi2Error;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    return c ? (fmi2Status)restore(c, state) : fmi2Error;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (!c) return fmi2Error;
    release((Memory **)state);
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)state;
    if (!allowed(c, ANY_PHASE, size != NULL, "fmi2SerializedFMUstateSize")) return fmi2Error;
    *size = serialized_size();
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    return c ? (fmi2Status)serialize(c, state, (unsigned char *)bytes, size) : fmi2Error;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    return c ? (fmi2Status)deserialize(c, (const unsigned char *)bytes, size, (Memory **)state) : fmi2Error;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t unknown_count,
                                        const fmi2ValueReference knowns[], size_t known_count, const fmi2Real seed[],
                                        fmi2Real sensitivity[]) {
    if (!allowed(c, READABLE, 1, "fmi2GetDirectionalDerivative")) return fmi2Error;
    return (fmi2Status)directional(c, unknowns, unknown_count, knowns, known_count, seed, sensitivity);
}

/* Model exchange. */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    const char *what = "fmi2EnterEventMode";
    return exchanging(c, CONTINUOUS + EVENT, 1, what) ? (fmi2Status)set_phase(c, ANY_PHASE, EVENT, what) : fmi2Error;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    if (!exchanging(c, EVENT, info != NULL, "fmi2NewDiscreteStates")) return fmi2Error;
    memset(info, 0, sizeof *info);
    Status status = update_discrete(c);
    info->nextEventTimeDefined = model.period > 0;
    info->nextEventTime = model.period > 0 ? next_tick_time(c) : 0;
    return (fmi2Status)status;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    const char *what = "fmi2EnterContinuousTimeMode";
    return exchanging(c, EVENT, 1, what) ? (fmi2Status)set_phase(c, ANY_PHASE, CONTINUOUS, what) : fmi2Error;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_set, fmi2Boolean *enter_event_mode,
                                       fmi2Boolean *terminate) {
    (void)no_set;
    if (!exchanging(c, CONTINUOUS, enter_event_mode && terminate, "fmi2CompletedIntegratorStep")) return fmi2Error;
    *enter_event_mode = *terminate = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    return exchanging(c, EVENT + CONTINUOUS, 1, "fmi2SetTime") ? (fmi2Status)set_time(c, time) : fmi2Error;
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t count) {
    return exchanging(c, CONTINUOUS, 1, "fmi2SetContinuousStates") ? (fmi2Status)set_states(c, x, count) : fmi2Error;
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t count) {
    if (!exchanging(c, READABLE, 1, "fmi2GetDerivatives")) return fmi2Error;
    return (fmi2Status)get_rates(c, derivatives, count);
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real indicators[], size_t count) {
    (void)indicators;
    if (!exchanging(c, READABLE, 1, "fmi2GetEventIndicators")) return fmi2Error;
    return count ? (fmi2Status)fail(c, FAILED, "the model has no event indicators") : fmi2OK;
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t count) {
    if (!exchanging(c, READABLE, 1, "fmi2GetContinuousStates")) return fmi2Error;
    return (fmi2Status)get_states(c, x, count);
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominals[], size_t count) {
    if (!exchanging(c, READABLE, 1, "fmi2GetNominalsOfContinuousStates")) return fmi2Error;
    return (fmi2Status)get_nominals(c, nominals, count);
}

/* Co-simulation. */

static fmi2Status no_derivatives(fmi2Component c, size_t count, const char *of) {
    if (!c) return fmi2Error;
    return count ? (fmi2Status)fail(c, FAILED, "the model has no derivatives of %s", of) : fmi2OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t count,
                                       const fmi2Integer orders[], const fmi2Real values[]) {
    (void)references;
    (void)orders;
    (void)values;
    return no_derivatives(c, count, "inputs");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t count,
                                        const fmi2Integer orders[], fmi2Real values[]) {
    (void)references;
    (void)orders;
    (void)values;
    return no_derivatives(c, count, "outputs");
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real length, fmi2Boolean no_set) {
    (void)no_set;
    return allowed(c, STEP, 1, "fmi2DoStep") ? (fmi2Status)do_step(c, time, length) : fmi2Error;
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    return c ? (fmi2Status)fail(c, FAILED, "no step can be cancelled: steps are not asynchronous") : fmi2Error;
}

static fmi2Status not_pending(fmi2Component c) {
    return c ? (fmi2Status)fail(c, DISCARD, "there is no such status: steps are not asynchronous") : fmi2Error;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)kind;
    (void)value;
    return not_pending(c);
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    if (!c || !value || kind != fmi2LastSuccessfulTime) return not_pending(c);
    *value = ((Instance *)c)->values[0];
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)kind;
    (void)value;
    return not_pending(c);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    if (!c || !value || kind != fmi2Terminated) return not_pending(c);
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)kind;
    (void)value;
    return not_pending(c);
}
