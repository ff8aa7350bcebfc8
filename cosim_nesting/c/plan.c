/* The plan of the system in an instance: its own copy of everything that the loop writes to. */
#include "nest.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int resources_of(char *path, size_t size);

static int lacks_memory(Instance *instance) { return fail(instance, FAILED, "there is no memory for the system") != OK; }

static void *copy(const void *from, size_t count, size_t size) {
    void *to = calloc(count + 1, size);
    if (to && count) memcpy(to, from, count * size);
    return to;
}

/* Varying signals: a row of doubles for each tick from 0 to the last. */
static int read_table(Instance *instance, Nest *nest) {
    if (!nested.varying) return 0;
    char path[4096];
    size_t count = (size_t)(nested.ticks + 1) * (size_t)nested.varying;
    FILE *file = resources_of(path, sizeof path - 16) ? NULL : fopen(strcat(path, "signals.bin"), "rb");
    nest->table = malloc(count * sizeof(double));
    size_t found = file && nest->table ? fread(nest->table, sizeof(double), count, file) : 0;
    if (file) fclose(file);
    return found == count ? 0 : fail(instance, FAILED, "the signals of the system cannot be read from its resources") != OK;
}

static void wire_faults(Loop *loop, Fault *faults) {
    for (int i = 0; i < nested.wires; i++) {
        loop->wire[i].faults = nested.faults[2 * i + 1];
        loop->wire[i].fault = faults + nested.faults[2 * i];
    }
}

static void lay_stages(Loop *loop, Inner *inner, Bond *bond) {
    for (int i = 0; i < nested.stages; i++) {
        Stage *stage = &loop->stage[i];
        stage->inner = inner;
        stage->bond = bond;
        inner += stage->inners;
        bond += stage->bonds;
        stage->relaxation = stage->size = 1.0;
    }
}

int lay_out(Instance *instance) {
    Nest *nest = nest_of(instance);
    Loop *loop = &nest->loop;
    memset(nest, 0, sizeof *nest);
    size_t parts = (size_t)nested.parts;
    nest->library = calloc(parts, sizeof(void *));
    nest->instance = calloc(parts, sizeof(void *));
    nest->state = calloc(parts, sizeof(void *));
    nest->touched = calloc((size_t)model.size, 1);
    nest->chunk = calloc((size_t)nested.signals * CHUNK + 1, sizeof(double));
    loop->part = calloc(parts, sizeof(Part));
    loop->wire = copy(nested.wire, (size_t)nested.wires, sizeof(Wire));
    loop->stage = copy(nested.stage, (size_t)nested.stages, sizeof(Stage));
    loop->bus = copy(nested.start, (size_t)nested.bus, sizeof(double));
    Fault *faults = copy(nested.fault, (size_t)nested.all_faults, sizeof(Fault));
    Inner *inner = copy(nested.inner, (size_t)nested.inners, sizeof(Inner));
    Bond *bond = copy(nested.bond, (size_t)nested.bonds, sizeof(Bond));
    if (!nest->library || !nest->instance || !nest->state || !nest->touched || !nest->chunk || !loop->part ||
        !loop->wire || !loop->stage || !loop->bus || !faults || !inner || !bond) {
        free(faults), free(inner), free(bond);
        free(loop->stage);
        loop->stage = NULL;
        return lacks_memory(instance);
    }
    wire_faults(loop, faults);
    lay_stages(loop, inner, bond);
    loop->parts = nested.parts, loop->wires = nested.wires, loop->stages = nested.stages;
    loop->signals = nested.signals, loop->signal = loop->bus + nested.signal;
    loop->step = nested.step, loop->decimation = loop->edge = 1, loop->failed = -1;
    return read_table(instance, nest);
}

void clear_plan(Nest *nest) {
    Loop *loop = &nest->loop;
    if (loop->stage && nested.wires) free(loop->wire[0].fault - nested.faults[0]);
    if (loop->stage && nested.stages) {
        free(loop->stage[0].inner);
        free(loop->stage[0].bond);
    }
    free(loop->part), free(loop->wire), free(loop->stage), free(loop->bus);
    free(nest->library), free(nest->instance), free(nest->state), free(nest->touched), free(nest->chunk), free(nest->table);
    free(nest->callbacks);
    memset(nest, 0, sizeof *nest);
}

/* Wires that feed a place bring what the bus has. */
static void feed(const Loop *loop, const Part *part, int64_t place) {
    for (int64_t i = part->wire; i < part->wire + part->wires; i++)
        if (loop->wire[i].target == place) loop->bus[place] = carry(loop, &loop->wire[i]);
}

static int begin_one(Instance *instance, const Start *one) {
    Nest *nest = nest_of(instance);
    const Piece *piece = &nested.piece[one->part];
    if (one->kind == LEAVE) return leave_part(instance, one->part);
    for (int i = 0; i < one->count; i++) {
        Part part = nest->loop.part[one->part];
        int64_t place = one->places[i];
        if (one->kind == FEED) {
            feed(&nest->loop, &part, piece->input + place);
            part.inputs = 1, part.input += place, part.input_references += place;
            if (set_inputs(&part) > FMI_WARNING)
                return fail(instance, FAILED, "%s refuses an input in initialisation mode", piece->name) != OK;
        } else {
            part.outputs = 1, part.output += place, part.output_references += place;
            int status = get_outputs(&part);
            if (status > FMI_WARNING && status != DISCARD)
                return fail(instance, FAILED, "%s gives no output in initialisation mode", piece->name) != OK;
            if (status == DISCARD) *part.output = NAN;
        }
    }
    return 0;
}

/* Values at the start go along the wires, in the order that `cosim run` found. */
int begin_parts(Instance *instance) {
    Nest *nest = nest_of(instance);
    for (int i = 0; i < nested.signals; i++)
        nest->loop.signal[i] = nested.column[i] < 0 ? nested.constant[i] : nest->table[nested.column[i]];
    for (int i = 0; i < nested.starts; i++)
        if (begin_one(instance, &nested.begin[i])) return 1;
    for (int i = 0; i < nested.wires; i++)
        for (int k = 0; k < nest->loop.wire[i].faults; k++) nest->loop.wire[i].fault[k].holds = 0;
    return 0;
}
