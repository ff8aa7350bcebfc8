/* Saving, restoring and serializing everything an instance remembers. */
#include "core.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

size_t memory_size(void) { return sizeof(Memory) + (size_t)model.size * sizeof(double); }

size_t serialized_size(void) { return memory_size() + sizeof(uint64_t); }

/* FNV-1a, 64 bits: a check against accidents, not against intent. */
uint64_t hash_bytes(const void *bytes, size_t count) {
    const unsigned char *byte = bytes;
    uint64_t hash = 0xCBF29CE484222325ull;
    for (size_t i = 0; i < count; i++) hash = (hash ^ byte[i]) * 0x100000001B3ull;
    return hash;
}

/* An array that *memory already holds is used again. */
static Status provide(Instance *instance, Memory **memory) {
    if (!memory) return fail(instance, FAILED, "there is no place for the state");
    if (!*memory) *memory = malloc(memory_size());
    return *memory ? OK : fail(instance, FAILED, "no memory for a state of %zu bytes", memory_size());
}

/* What is calculated anew when it is asked for; outputs of a sampled model hold from tick to tick and are remembered. */
static int first_forgotten(void) { return model.period > 0 ? model.size : model.size - model.rates - model.outputs; }

/* One point, one state: what happens to have been calculated at it is left out. */
Status save(Instance *instance, Memory **memory) {
    Status status = provide(instance, memory);
    if (status != OK) return status;
    memcpy(*memory, instance->memory, memory_size());
    (*memory)->fresh = 0;
    for (int i = first_forgotten(); i < model.size; i++) (*memory)->values[i] = 0;
    return OK;
}

void release(Memory **memory) {
    if (!memory) return;
    free(*memory);
    *memory = NULL;
}

static Status check(Instance *instance, const Memory *memory) {
    if (!memory) return fail(instance, FAILED, "there is no state to restore");
    if (memory->mark != instance->memory->mark) return fail(instance, FAILED, "the state belongs to another model");
    if (memory->interface != instance->memory->interface)
        return fail(instance, FAILED, "the state belongs to the other interface (model exchange or co-simulation)");
    return OK;
}

/* What no run can have left behind: the next call could not rely on it. */
static int plausible(const Memory *memory) {
    const double *values = memory->values, times[] = {memory->start, memory->tolerance, memory->step, values[0]};
    for (size_t i = 0; i < sizeof times / sizeof *times; i++)
        if (!(times[i] > -INFINITY && times[i] < INFINITY)) return 0;
    for (int i = 0; i < model.size; i++) {
        const Variable *variable = &model.table[i];
        if (!(fabs(values[i]) < INFINITY)) return 0;
        if (variable->kind == PARAMETER && !(values[i] >= variable->low && values[i] <= variable->high)) return 0;
    }
    int phase = memory->phase, alien = memory->interface == CO_SIMULATION ? EVENT + CONTINUOUS : STEP;
    if (phase <= 0 || phase >= ANY_PHASE || (phase & (phase - 1)) || (phase & alien)) return 0;
    if (memory->fresh) return 0;
    if (memory->ticks < 0 || memory->ticks >= INT64_C(1) << 53 || (model.period > 0 && !resolves_ticks(memory->start))) return 0;
    return memory->tolerance > 0 && memory->step >= 0 && memory->stop >= memory->start;
}

Status restore(Instance *instance, const Memory *memory) {
    Status status = check(instance, memory);
    if (status == OK) memcpy(instance->memory, memory, memory_size());
    return status;
}

Status serialize(Instance *instance, const Memory *memory, unsigned char *bytes, size_t size) {
    Status status = check(instance, memory);
    if (status != OK) return status;
    if (!bytes || size < serialized_size())
        return fail(instance, FAILED, "a serialized state needs %zu bytes, not %zu", serialized_size(), size);
    uint64_t hash = hash_bytes(memory, memory_size());
    memcpy(bytes, memory, memory_size());
    memcpy(bytes + memory_size(), &hash, sizeof hash);
    return OK;
}

Status deserialize(Instance *instance, const unsigned char *bytes, size_t size, Memory **memory) {
    uint64_t hash, mark;
    if (!bytes || size != serialized_size())
        return fail(instance, FAILED, "a serialized state of %zu bytes cannot be right: this model's has %zu", size,
                    serialized_size());
    memcpy(&hash, bytes + memory_size(), sizeof hash);
    memcpy(&mark, bytes, sizeof mark);
    if (hash != hash_bytes(bytes, memory_size())) return fail(instance, FAILED, "the serialized state is corrupted");
    if (mark != instance->memory->mark) return fail(instance, FAILED, "the state belongs to another model");
    Memory *loaded = NULL;
    if (!memory) return fail(instance, FAILED, "there is no place for the state");
    if (provide(instance, &loaded) != OK) return FAILED;
    memcpy(loaded, bytes, memory_size());
    if (!plausible(loaded)) {
        release(&loaded);
        return fail(instance, FAILED, "the serialized state is corrupted: no run ends in such a state");
    }
    /* Only now: a refusal leaves the state that is there. */
    if (*memory) {
        memcpy(*memory, loaded, memory_size());
        release(&loaded);
    } else {
        *memory = loaded;
    }
    return OK;
}
