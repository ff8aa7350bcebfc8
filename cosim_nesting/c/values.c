/* Values of a system: those of its components, by value reference. There are no states and no derivatives here. */
#include "nest.h"

#include <math.h>

static int is_known(Instance *instance, uint32_t reference) {
    if (reference < (uint32_t)model.size) return 1;
    fail(instance, FAILED, "there is no variable with the value reference %u; they go from 0 to %d", reference,
         model.size - 1);
    return 0;
}

static Status get_value(Instance *instance, uint32_t reference, double *value) {
    if (!is_known(instance, reference)) return FAILED;
    if (reference == 0 || instance->memory->phase == INSTANTIATED) {
        *value = instance->values[reference];
        return OK;
    }
    const Meaning *of = &nested.meaning[reference - 1];
    Nest *nest = nest_of(instance);
    if (of->part < 0) {
        int column = nested.column[of->reference];
        *value = column < 0 ? nested.constant[of->reference]
                            : nest->table[nest->loop.tick * nested.varying + column];
        return OK;
    }
    return take_real(instance, of->part, of->reference, value) ? FAILED : OK;
}

Status get_values(Instance *instance, const uint32_t *references, size_t count, double *values) {
    if (count && (!references || !values)) return fail(instance, FAILED, "getting values: an array is missing");
    Status status = OK;
    for (size_t i = 0; i < count && status == OK; i++) status = get_value(instance, references[i], &values[i]);
    return status;
}

/* Parameters until initialisation, inputs always. */
static Status set_value(Instance *instance, uint32_t reference, double value) {
    if (!is_known(instance, reference)) return FAILED;
    const Variable *variable = &model.table[reference];
    int early = instance->memory->phase == INSTANTIATED;
    if (variable->kind != INPUT && !(variable->kind == PARAMETER && early))
        return fail(instance, FAILED, "\"%s\" cannot be set %s", variable->name,
                    variable->kind == PARAMETER ? "after initialisation has begun" : "at all");
    if (!(fabs(value) < INFINITY)) return fail(instance, FAILED, "\"%s\" is set to what is no finite number", variable->name);
    instance->values[reference] = value;
    if (early) {
        nest_of(instance)->touched[reference] = 1;
        return OK;
    }
    const Meaning *of = &nested.meaning[reference - 1];
    return put_real(instance, of->part, of->reference, value) ? FAILED : OK;
}

Status set_values(Instance *instance, const uint32_t *references, size_t count, const double *values) {
    if (count && (!references || !values)) return fail(instance, FAILED, "setting values: an array is missing");
    Status status = OK;
    for (size_t i = 0; i < count && status == OK; i++) status = set_value(instance, references[i], values[i]);
    return status;
}

static Status lacks(Instance *instance, const char *what) {
    return fail(instance, FAILED, "a system of components has no %s", what);
}

Status get_states(Instance *instance, double *states, size_t count) {
    (void)states;
    return count ? lacks(instance, "continuous states") : OK;
}

Status set_states(Instance *instance, const double *states, size_t count) {
    (void)states;
    return count ? lacks(instance, "continuous states") : OK;
}

Status get_nominals(Instance *instance, double *nominals, size_t count) {
    (void)nominals;
    return count ? lacks(instance, "continuous states") : OK;
}

Status get_rates(Instance *instance, double *rates, size_t count) {
    (void)rates;
    return count ? lacks(instance, "derivatives") : OK;
}

Status set_time(Instance *instance, double time) {
    (void)time;
    return lacks(instance, "model exchange");
}

/* FMI 2.0 and 3.0, "Getting Partial Derivatives": these may be called only where the model description provides them, and it does
   not: what an output of the whole does with an input is in the states of the components, which the functions cannot ask
   for, and not all components give derivatives. */
Status directional(Instance *instance, const uint32_t *unknowns, size_t unknown_count, const uint32_t *knowns,
                   size_t known_count, const double *seed, double *sensitivity) {
    (void)unknowns, (void)unknown_count, (void)knowns, (void)known_count, (void)seed, (void)sensitivity;
    return lacks(instance, "directional derivatives");
}

Status adjoint(Instance *instance, const uint32_t *unknowns, size_t unknown_count, const uint32_t *knowns,
               size_t known_count, const double *seed, double *sensitivity) {
    (void)unknowns, (void)unknown_count, (void)knowns, (void)known_count, (void)seed, (void)sensitivity;
    return lacks(instance, "adjoint derivatives");
}

/* The state of a system is that of its components, which not all can give. */
size_t memory_size(void) { return sizeof(Memory) + (size_t)model.size * sizeof(double) + sizeof(Nest); }

Nest *nest_of(Instance *instance) { return (Nest *)(void *)(instance->memory->values + model.size); }

size_t serialized_size(void) { return 0; }

uint64_t hash_bytes(const void *bytes, size_t count) {
    const unsigned char *byte = bytes;
    uint64_t hash = 0xCBF29CE484222325ull;
    for (size_t i = 0; i < count; i++) hash = (hash ^ byte[i]) * 0x100000001B3ull;
    return hash;
}

Status save(Instance *instance, Memory **memory) {
    (void)memory;
    return lacks(instance, "state that can be saved");
}

void release(Memory **memory) { (void)memory; }

Status restore(Instance *instance, const Memory *memory) {
    (void)memory;
    return lacks(instance, "state that can be restored");
}

Status serialize(Instance *instance, const Memory *memory, unsigned char *bytes, size_t size) {
    (void)memory, (void)bytes, (void)size;
    return lacks(instance, "state that can be saved");
}

Status deserialize(Instance *instance, const unsigned char *bytes, size_t size, Memory **memory) {
    (void)bytes, (void)size, (void)memory;
    return lacks(instance, "state that can be restored");
}
