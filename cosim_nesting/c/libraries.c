/* The components as shared libraries: opened, instantiated, initialised and closed as FMI 2.0 and 3.0 have it.
 *
 * Each lies in a folder of its own in resources/parts, so two instances of one FMU share nothing. Linux. */
#define _GNU_SOURCE
#include "fmi2Functions.h"
#include "fmi3Functions.h"
#include "foreign.h"
#include "nest.h"

#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef void (*Any)(void);

/* resources/ of the FMU that this library is in: binaries/PLATFORM/library -> ../../resources/. 0: found. */
int resources_of(char *path, size_t size) {
    Dl_info info;
    char full[4096];
    if (!dladdr((void *)resources_of, &info) || !realpath(info.dli_fname, full)) return 1;
    for (int up = 0; up < 3; up++) {
        char *slash = strrchr(full, '/');
        if (!slash) return 1;
        *slash = 0;
    }
    return snprintf(path, size, "%s/resources/", full) >= (int)size;
}

static Any function(const Nest *nest, int part, const char *name) {
    char full[128];
    snprintf(full, sizeof full, "fmi%d%s", nested.piece[part].version, name);
    void *found = dlsym(nest->library[part], full);
    Any typed;
    memcpy(&typed, &found, sizeof typed);
    return typed;
}

/* What a component says of warnings and errors is passed on, where it says whose it is. */
static void hear2(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                  fmi2String message, ...) {
    (void)category;
    char text[400];
    if (!environment || status == fmi2OK || !message) return;
    va_list arguments;
    va_start(arguments, message);
    vsnprintf(text, sizeof text, message, arguments);
    va_end(arguments);
    fail(environment, (Status)status, "%s: %s", name ? name : "component", text);
}

static void hear3(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message) {
    (void)category;
    if (environment && status != fmi3OK && message) fail(environment, (Status)status, "%s", message);
}

static void *start2(Instance *instance, int part, const char *resources) {
    Nest *nest = nest_of(instance);
    if (!nest->callbacks) {
        fmi2CallbackFunctions callbacks = {hear2, calloc, free, NULL, instance};
        nest->callbacks = malloc(sizeof callbacks);
        if (!nest->callbacks) return NULL;
        memcpy(nest->callbacks, &callbacks, sizeof callbacks);
    }
    char uri[4200];
    const Piece *piece = &nested.piece[part];
    fmi2InstantiateTYPE *instantiate = (fmi2InstantiateTYPE *)function(nest, part, "Instantiate");
    snprintf(uri, sizeof uri, "file://%s", resources);
    return instantiate ? instantiate(piece->name, fmi2CoSimulation, piece->token, uri, nest->callbacks, fmi2False, fmi2False)
                       : NULL;
}

static void *start3(Instance *instance, int part, const char *resources) {
    const Nest *nest = nest_of(instance);
    const Piece *piece = &nested.piece[part];
    fmi3InstantiateCoSimulationTYPE *instantiate =
        (fmi3InstantiateCoSimulationTYPE *)function(nest, part, "InstantiateCoSimulation");
    return instantiate ? instantiate(piece->name, piece->token, resources, fmi3False, fmi3False, fmi3False, fmi3False,
                                     NULL, 0, instance, hear3, NULL)
                       : NULL;
}

/* What the loop knows of a part. */
static int describe(Instance *instance, int number) {
    Nest *nest = nest_of(instance);
    const Piece *piece = &nested.piece[number];
    Part *part = &nest->loop.part[number];
    int two = piece->version == 2;
    part->version = piece->version;
    part->instance = nest->instance[number];
    part->set = function(nest, number, two ? "SetReal" : "SetFloat64");
    part->get = function(nest, number, two ? "GetReal" : "GetFloat64");
    part->step = function(nest, number, "DoStep");
    Any save = piece->can_save ? function(nest, number, two ? "GetFMUstate" : "GetFMUState") : NULL;
    Any restore = piece->can_save ? function(nest, number, two ? "SetFMUstate" : "SetFMUState") : NULL;
    memcpy(&part->save, &save, sizeof save);
    memcpy(&part->restore, &restore, sizeof restore);
    part->inputs = piece->inputs, part->outputs = piece->outputs;
    part->input_references = piece->input_references, part->output_references = piece->output_references;
    part->input = nest->loop.bus + piece->input, part->output = nest->loop.bus + piece->output;
    part->wire = piece->wire, part->wires = piece->wires, part->every = piece->every;
    part->state = &nest->state[number];
    return part->set && part->get && part->step ? 0
                                                : fail(instance, FAILED, "%s lacks functions of FMI", piece->name) != OK;
}

static int open_part(Instance *instance, int number, const char *resources) {
    Nest *nest = nest_of(instance);
    const Piece *piece = &nested.piece[number];
    char path[4400], own[4200];
    snprintf(own, sizeof own, "%sparts/%s/resources/", resources, piece->folder);
    snprintf(path, sizeof path, "%sparts/%s/%s", resources, piece->folder, piece->library);
    nest->library[number] = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!nest->library[number]) return fail(instance, FAILED, "%s does not load: %s", piece->name, dlerror()) != OK;
    nest->instance[number] = piece->version == 2 ? start2(instance, number, own) : start3(instance, number, own);
    after(NULL, 0);
    if (!nest->instance[number]) return fail(instance, FAILED, "%s cannot be instantiated", piece->name) != OK;
    return describe(instance, number);
}

int open_parts(Instance *instance) {
    char resources[4096];
    if (resources_of(resources, sizeof resources)) return fail(instance, FAILED, "the resources are not found") != OK;
    for (int i = 0; i < nested.parts; i++)
        if (open_part(instance, i, resources)) return 1;
    return 0;
}

void close_parts(Instance *instance) {
    Nest *nest = nest_of(instance);
    for (int i = 0; i < nested.parts && nest->library; i++) {
        if (nest->instance[i]) {
            int two = nested.piece[i].version == 2;
            typedef int FreeState(void *, void **);
            FreeState *forget = (FreeState *)function(nest, i, two ? "FreeFMUstate" : "FreeFMUState");
            if (nest->state[i] && forget) forget(nest->instance[i], &nest->state[i]);
            fmi2FreeInstanceTYPE *release = (fmi2FreeInstanceTYPE *)function(nest, i, "FreeInstance");
            if (release) release(nest->instance[i]);
        }
        if (nest->library[i]) dlclose(nest->library[i]);
        nest->instance[i] = nest->library[i] = nest->state[i] = NULL;
    }
}

static int refused(Instance *instance, int part, int status, const char *what) {
    after(NULL, 0);
    if (status <= FMI_WARNING) return 0;
    return fail(instance, FAILED, "%s refuses %s (status %d)", nested.piece[part].name, what, status) != OK;
}

int put_real(Instance *instance, int part, uint32_t reference, double value) {
    Nest *nest = nest_of(instance);
    Part one = nest->loop.part[part];
    one.inputs = 1, one.input = &value, one.input_references = &reference;
    return refused(instance, part, set_inputs(&one), "a value");
}

int take_real(Instance *instance, int part, uint32_t reference, double *value) {
    Part one = nest_of(instance)->loop.part[part];
    one.outputs = 1, one.output = value, one.output_references = &reference;
    return refused(instance, part, get_outputs(&one), "to give a value");
}

/* A setting of the scenario, through the set function of its type. */
static int put(Instance *instance, const Setting *one) {
    Nest *nest = nest_of(instance);
    void *to = nest->instance[one->part];
    int two = nested.piece[one->part].version == 2, status = 3;
    Any set = function(nest, one->part, one->function);
    const uint32_t *r = &one->reference;
    size_t n = one->count;
    if (!set) return refused(instance, one->part, status, one->function);
    if (!strcmp(one->function, "SetReal")) {
        status = ((fmi2SetRealTYPE *)set)(to, r, 1, one->numbers);
    } else if (!strcmp(one->function, "SetFloat64")) {
        status = ((fmi3SetFloat64TYPE *)set)(to, r, 1, one->numbers, n);
    } else if (!strcmp(one->function, "SetString")) {
        status = two ? (int)((fmi2SetStringTYPE *)set)(to, r, 1, one->texts)
                     : (int)((fmi3SetStringTYPE *)set)(to, r, 1, one->texts, n);
    } else {
        fmi3Int64 wide = (fmi3Int64)one->numbers[0];
        fmi3Int32 narrow = (fmi3Int32)wide;
        fmi3Boolean truth = wide != 0;
        if (!strcmp(one->function, "SetInteger")) status = ((fmi2SetIntegerTYPE *)set)(to, r, 1, &narrow);
        if (!strcmp(one->function, "SetInt32")) status = ((fmi3SetInt32TYPE *)set)(to, r, 1, &narrow, 1);
        if (!strcmp(one->function, "SetInt64")) status = ((fmi3SetInt64TYPE *)set)(to, r, 1, &wide, 1);
        if (!strcmp(one->function, "SetBoolean"))
            status = two ? (int)((fmi2SetBooleanTYPE *)set)(to, r, 1, &narrow)
                         : (int)((fmi3SetBooleanTYPE *)set)(to, r, 1, &truth, 1);
    }
    return refused(instance, one->part, status, "a parameter of the system");
}

static int put_all(Instance *instance, int part, int late) {
    for (int i = 0; i < nested.settings; i++)
        if (nested.setting[i].part == part && nested.setting[i].late == late && put(instance, &nested.setting[i])) return 1;
    return 0;
}

/* What the importer set before initialisation. */
static int put_touched(Instance *instance, int part, Kind kind) {
    for (int i = 1; i < model.size; i++) {
        const Meaning *of = &nested.meaning[i - 1];
        if (nest_of(instance)->touched[i] && model.table[i].kind == kind && of->part == part &&
            put_real(instance, part, of->reference, instance->values[i]))
            return 1;
    }
    return 0;
}

static int enter_part(Instance *instance, int part, double start) {
    Nest *nest = nest_of(instance);
    void *to = nest->instance[part];
    Any enter_mode = function(nest, part, "EnterInitializationMode");
    int status = 3;
    if (nested.piece[part].version == 2) {
        fmi2SetupExperimentTYPE *setup = (fmi2SetupExperimentTYPE *)function(nest, part, "SetupExperiment");
        status = setup ? (int)setup(to, fmi2False, 0.0, start, fmi2False, 0.0) : 3;
        if (status <= FMI_WARNING && enter_mode) status = ((fmi2EnterInitializationModeTYPE *)enter_mode)(to);
    } else if (enter_mode) {
        status = ((fmi3EnterInitializationModeTYPE *)enter_mode)(to, fmi3False, 0.0, start, fmi3False, 0.0);
    }
    return refused(instance, part, status, "initialisation mode");
}

int enter_parts(Instance *instance, double start) {
    for (int i = 0; i < nested.parts; i++)
        if (put_all(instance, i, 0) || put_touched(instance, i, PARAMETER) || enter_part(instance, i, start) ||
            put_all(instance, i, 1) || put_touched(instance, i, INPUT))
            return 1;
    return 0;
}

int leave_part(Instance *instance, int part) {
    Nest *nest = nest_of(instance);
    fmi2ExitInitializationModeTYPE *leave = (fmi2ExitInitializationModeTYPE *)function(nest, part, "ExitInitializationMode");
    return refused(instance, part, leave ? (int)leave(nest->instance[part]) : 3, "to leave initialisation mode");
}
