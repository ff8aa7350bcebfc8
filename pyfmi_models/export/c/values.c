/* Reading and setting variables by value reference. */
#include "core.h"

#include <math.h>
#include <string.h>

static int is_sampled(void) { return model.period > 0; }

static Status unknown_reference(Instance *instance, uint32_t reference) {
    return fail(instance, FAILED, "there is no variable with the value reference %u; they go from 0 to %d", reference,
                model.size - 1);
}

static const char *first_not_finite(const double *values, int first, int count) {
    for (int i = 0; i < count; i++)
        if (!(fabs(values[i]) < INFINITY)) return model.table[first + i].name;
    return NULL;
}

/* Outside its domain a model may be asked again with a smaller step in model exchange; in co-simulation it has failed. */
static Status not_finite(Instance *instance, const char *what, const char *name) {
    Status status = instance->memory->interface == MODEL_EXCHANGE ? DISCARD : FAILED;
    return fail(instance, status, "%s\"%s\" is not finite at t = %.17g s", what, name, instance->values[0]);
}

static Status refresh_rates(Instance *instance) {
    if (!model.rates || instance->memory->fresh & RATES_FRESH) return OK;
    evaluate(instance, model.rates_code, instance->values[0], instance->states, instance->rates, NULL);
    const char *name = first_not_finite(instance->rates, (int)(instance->rates - instance->values), model.rates);
    if (name) return not_finite(instance, "", name);
    instance->memory->fresh |= RATES_FRESH;
    return OK;
}

static Status refresh_outputs(Instance *instance) {
    if (instance->memory->fresh & OUTPUTS_FRESH) return OK;
    if (is_sampled()) {
        if (instance->memory->phase == EVENT && tick_is_due(instance)) return tick(instance, 0);
        return OK;
    }
    evaluate(instance, model.outputs_code, instance->values[0], instance->states, instance->outputs, NULL);
    const char *name = first_not_finite(instance->outputs, (int)(instance->outputs - instance->values), model.outputs);
    if (name) return not_finite(instance, "", name);
    instance->memory->fresh |= OUTPUTS_FRESH;
    return OK;
}

static Status refresh(Instance *instance, Kind kind) {
    if (kind == RATE) return refresh_rates(instance);
    if (kind == OUTPUT) return refresh_outputs(instance);
    return OK;
}

Status get_values(Instance *instance, const uint32_t *references, size_t count, double *values) {
    if (count && (!references || !values)) return fail(instance, FAILED, "getting values: an array is missing");
    for (size_t i = 0; i < count; i++)
        if (references[i] >= (uint32_t)model.size) return unknown_reference(instance, references[i]);
    for (size_t i = 0; i < count; i++) {
        int source = model.table[references[i]].same;
        Status status = refresh(instance, model.table[source].kind);
        if (status != OK) return status;
        values[i] = instance->values[source];
    }
    return OK;
}

/* The phases in which a kind of variable may be set. */
static int settable(const Variable *variable) {
    switch (variable->kind) {
    case INPUT: return ANY_PHASE - TERMINATED;
    case PARAMETER: return INSTANTIATED + INITIALIZATION + (variable->fixed ? 0 : EVENT + STEP);
    case STATE: return INSTANTIATED + INITIALIZATION;
    case OUTPUT: return is_sampled() ? INSTANTIATED + INITIALIZATION : 0;
    default: return 0;
    }
}

static Status check_setting(Instance *instance, const Variable *variable, double value) {
    int phases = settable(variable);
    if (instance->memory->phase == TERMINATED)
        return fail(instance, FAILED, "\"%s\" cannot be set after the end", variable->name);
    if (!phases) return fail(instance, FAILED, "\"%s\" is calculated and cannot be set", variable->name);
    if (!(phases & instance->memory->phase)) {
        if (variable->kind == PARAMETER && !variable->fixed)
            return fail(instance, FAILED, "parameter \"%s\" can be set before the start, in event mode and between "
                        "co-simulation steps only", variable->name);
        return fail(instance, FAILED, "%s\"%s\" can be set before the end of initialization only",
                    variable->fixed ? "fixed parameter " : "", variable->name);
    }
    if (!(fabs(value) < INFINITY)) return fail(instance, FAILED, "\"%s\" = %g is not finite", variable->name, value);
    if (variable->kind == PARAMETER && value < variable->low)
        return fail(instance, FAILED, "parameter \"%s\" = %.10g is below its least value %.10g", variable->name, value,
                    variable->low);
    if (variable->kind == PARAMETER && value > variable->high)
        return fail(instance, FAILED, "parameter \"%s\" = %.10g is above its largest value %.10g", variable->name, value,
                    variable->high);
    return OK;
}

Status set_values(Instance *instance, const uint32_t *references, size_t count, const double *values) {
    if (count && (!references || !values)) return fail(instance, FAILED, "setting values: an array is missing");
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= (uint32_t)model.size) return unknown_reference(instance, references[i]);
        Status status = check_setting(instance, &model.table[references[i]], values[i]);
        if (status != OK) return status;
    }
    for (size_t i = 0; i < count; i++) instance->values[references[i]] = values[i];
    instance->memory->fresh = 0;
    return OK;
}

static Status check_count(Instance *instance, const double *values, size_t count, int expected) {
    if (count == (size_t)expected && (values || !count)) return OK;
    return fail(instance, FAILED, "the model has %d continuous states, not %zu", expected, count);
}

Status get_states(Instance *instance, double *states, size_t count) {
    Status status = check_count(instance, states, count, model.rates);
    if (status == OK && count) memcpy(states, instance->states, count * sizeof(double));
    return status;
}

Status set_states(Instance *instance, const double *states, size_t count) {
    Status status = check_count(instance, states, count, model.rates);
    if (status != OK || !count) return status;
    const char *name = first_not_finite(states, (int)(instance->states - instance->values), model.rates);
    if (name) return fail(instance, FAILED, "state \"%s\" is not finite", name);
    memcpy(instance->states, states, count * sizeof(double));
    instance->memory->fresh = 0;
    return OK;
}

Status get_nominals(Instance *instance, double *nominals, size_t count) {
    Status status = check_count(instance, nominals, count, model.rates);
    if (status == OK && count) memcpy(nominals, model.nominals, count * sizeof(double));
    return status;
}

Status get_rates(Instance *instance, double *rates, size_t count) {
    Status status = check_count(instance, rates, count, model.rates);
    if (status == OK) status = refresh_rates(instance);
    if (status == OK && count) memcpy(rates, instance->rates, count * sizeof(double));
    return status;
}

Status set_time(Instance *instance, double time) {
    if (!(fabs(time) < INFINITY)) return fail(instance, FAILED, "the time %g is not finite", time);
    if (time < instance->memory->start)
        return fail(instance, FAILED, "the time %.17g s is before the start at %.17g s", time, instance->memory->start);
    if (time != instance->values[0]) instance->memory->fresh = is_sampled() ? instance->memory->fresh : 0;
    instance->values[0] = time;
    return OK;
}

/* What is calculated has derivatives with respect to what is not. */
static Status check_references(Instance *instance, const uint32_t *references, size_t count, int calculated) {
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= (uint32_t)model.size) return unknown_reference(instance, references[i]);
        const Variable *variable = &model.table[references[i]];
        if ((variable->kind >= RATE) == calculated) continue;
        return fail(instance, FAILED, calculated ? "\"%s\" is not calculated: it has no derivative"
                                                 : "\"%s\" is calculated: no derivative with respect to it", variable->name);
    }
    return OK;
}

static Status check_derivative(Instance *instance, const uint32_t *unknowns, size_t unknown_count, const uint32_t *knowns,
                               size_t known_count, const double *by_unknown, const double *by_known) {
    if (is_sampled()) return fail(instance, FAILED, "a sampled model has no partial derivatives");
    if ((unknown_count && (!unknowns || !by_unknown)) || (known_count && (!knowns || !by_known)))
        return fail(instance, FAILED, "partial derivatives: an array is missing");
    Status status = check_references(instance, unknowns, unknown_count, 1);
    return status == OK ? check_references(instance, knowns, known_count, 0) : status;
}

/* Adds the seeds to a column that has a place for each variable. */
static Status scatter(Instance *instance, const uint32_t *references, size_t count, const double *seed) {
    memset(instance->seeds, 0, (size_t)model.size * sizeof(double));
    for (size_t i = 0; i < count; i++) {
        if (!(fabs(seed[i]) < INFINITY))
            return fail(instance, FAILED, "the seed %g of \"%s\" is not finite", seed[i], model.table[references[i]].name);
        instance->seeds[references[i]] += seed[i];
    }
    return OK;
}

static Status gather(Instance *instance, const uint32_t *references, size_t count, const double *column, int first,
                     double *result) {
    for (size_t i = 0; i < count; i++)
        if (!(fabs(column[(int)references[i] - first]) < INFINITY))
            return not_finite(instance, "a derivative of ", model.table[references[i]].name);
    for (size_t i = 0; i < count; i++) result[i] = column[(int)references[i] - first];
    return OK;
}

/* sensitivity = d unknowns / d knowns * seed */
Status directional(Instance *instance, const uint32_t *unknowns, size_t unknown_count, const uint32_t *knowns,
                   size_t known_count, const double *seed, double *sensitivity) {
    Status status = check_derivative(instance, unknowns, unknown_count, knowns, known_count, sensitivity, seed);
    if (status == OK) status = scatter(instance, knowns, known_count, seed);
    if (status != OK) return status;
    const double *seeds = instance->seeds, *inputs = seeds + 1, *parameters = inputs + model.inputs;
    const double *in[] = {instance->values, instance->states, instance->inputs, instance->parameters,
                          seeds, parameters + model.parameters, inputs, parameters};
    double *out[] = {instance->scratch, instance->scratch + model.rates};
    model.directional_code(in, out);
    return gather(instance, unknowns, unknown_count, instance->scratch, (int)(instance->rates - instance->values), sensitivity);
}

/* sensitivity = seed * d unknowns / d knowns */
Status adjoint(Instance *instance, const uint32_t *unknowns, size_t unknown_count, const uint32_t *knowns, size_t known_count,
               const double *seed, double *sensitivity) {
    Status status = check_derivative(instance, unknowns, unknown_count, knowns, known_count, seed, sensitivity);
    if (status == OK) status = scatter(instance, unknowns, unknown_count, seed);
    if (status != OK) return status;
    const double *rates = instance->seeds + (instance->rates - instance->values);
    const double *in[] = {instance->values, instance->states, instance->inputs, instance->parameters, rates,
                          rates + model.rates};
    double *column = instance->seeds, *inputs = column + 1, *parameters = inputs + model.inputs;
    double *out[] = {column, parameters + model.parameters, inputs, parameters};
    model.adjoint_code(in, out);
    return gather(instance, knowns, known_count, column, 0, sensitivity);
}
