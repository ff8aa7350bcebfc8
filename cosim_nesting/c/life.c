/* Life of an instance: that of our other FMUs, with the components in it. */
#include "nest.h"

#define instantiate plain_instantiate
#define free_instance plain_free_instance
#define reset plain_reset
#define enter_initialization plain_enter_initialization
#define exit_initialization plain_exit_initialization
void reset(Instance *instance);
void free_instance(Instance *instance);
#include "instance.inc"
#undef instantiate
#undef free_instance
#undef reset
#undef enter_initialization
#undef exit_initialization

Instance *instantiate(Interface interface, const char *name, const char *token, Emit emit, void (*logger)(void),
                      void *environment, int log_events) {
    Instance *instance = plain_instantiate(interface, name, token, emit, logger, environment, log_events);
    if (!instance) return NULL;
    if (interface == MODEL_EXCHANGE) {
        fail(instance, FAILED, "a system of components is for co-simulation");
        plain_free_instance(instance);
        return NULL;
    }
    if (lay_out(instance) || open_parts(instance)) {
        free_instance(instance);
        return NULL;
    }
    return instance;
}

void free_instance(Instance *instance) {
    if (!instance) return;
    close_parts(instance);
    clear_plan(nest_of(instance));
    plain_free_instance(instance);
}

/* The components are opened anew: not every FMU comes back from fmi2Reset as it was. */
void reset(Instance *instance) {
    close_parts(instance);
    clear_plan(nest_of(instance));
    plain_reset(instance);
    if (lay_out(instance) || open_parts(instance)) instance->memory->phase = TERMINATED;
}

Status enter_initialization(Instance *instance, const char *what) {
    Status status = plain_enter_initialization(instance, what);
    if (status == OK && instance->memory->start != 0)
        return fail(instance, FAILED, "the system starts at 0 s, not at %.17g s: its signals count from there",
                    instance->memory->start);
    return status == OK && enter_parts(instance, 0.0) ? FAILED : status;
}

Status exit_initialization(Instance *instance, const char *what) {
    Status status = expect(instance, INITIALIZATION, what);
    if (status == OK && begin_parts(instance)) return FAILED;
    return status == OK ? plain_exit_initialization(instance, what) : status;
}
