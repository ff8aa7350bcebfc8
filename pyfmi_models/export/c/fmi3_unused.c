/* Functions that FMI 3.0 demands and this model has no use for: it has 64-bit floating point variables only, no clocks,
 * no configuration mode, no event mode in co-simulation, no scheduled execution. An empty request is granted. */
#include "fmi3Functions.h"

#include "core.h"

static fmi3Status refuse(fmi3Instance c, size_t count, const char *what) {
    if (!c) return fmi3Error;
    return count ? (fmi3Status)fail(c, FAILED, "the model has no %s", what) : fmi3OK;
}

/* These macros only spell the signatures. */
#define NO_VALUES(NAME, POINTER)                                                                              \
    fmi3Status NAME(fmi3Instance c, const fmi3ValueReference r[], size_t count, POINTER values, size_t n) {   \
        (void)r;                                                                                              \
        (void)values;                                                                                         \
        return refuse(c, count | n, "variables of another type than Float64");                                \
    }
#define NO_CLOCK(NAME, FIRST)                                                                                 \
    fmi3Status NAME(fmi3Instance c, const fmi3ValueReference r[], size_t count, FIRST first) {                \
        (void)r;                                                                                              \
        (void)first;                                                                                          \
        return refuse(c, count, "clocks");                                                                    \
    }
#define NO_CLOCK_FRACTION(NAME, POINTER)                                                                      \
    fmi3Status NAME(fmi3Instance c, const fmi3ValueReference r[], size_t count, POINTER counters, POINTER of) { \
        (void)r;                                                                                              \
        (void)counters;                                                                                       \
        (void)of;                                                                                             \
        return refuse(c, count, "clocks");                                                                    \
    }
#define NO_MODE(NAME, WHAT)                                                                                   \
    fmi3Status NAME(fmi3Instance c) { return refuse(c, 1, WHAT); }

NO_VALUES(fmi3GetFloat32, fmi3Float32 *)
NO_VALUES(fmi3GetInt8, fmi3Int8 *)
NO_VALUES(fmi3GetUInt8, fmi3UInt8 *)
NO_VALUES(fmi3GetInt16, fmi3Int16 *)
NO_VALUES(fmi3GetUInt16, fmi3UInt16 *)
NO_VALUES(fmi3GetInt32, fmi3Int32 *)
NO_VALUES(fmi3GetUInt32, fmi3UInt32 *)
NO_VALUES(fmi3GetInt64, fmi3Int64 *)
NO_VALUES(fmi3GetUInt64, fmi3UInt64 *)
NO_VALUES(fmi3GetBoolean, fmi3Boolean *)
NO_VALUES(fmi3GetString, fmi3String *)
NO_VALUES(fmi3SetFloat32, const fmi3Float32 *)
NO_VALUES(fmi3SetInt8, const fmi3Int8 *)
NO_VALUES(fmi3SetUInt8, const fmi3UInt8 *)
NO_VALUES(fmi3SetInt16, const fmi3Int16 *)
NO_VALUES(fmi3SetUInt16, const fmi3UInt16 *)
NO_VALUES(fmi3SetInt32, const fmi3Int32 *)
NO_VALUES(fmi3SetUInt32, const fmi3UInt32 *)
NO_VALUES(fmi3SetInt64, const fmi3Int64 *)
NO_VALUES(fmi3SetUInt64, const fmi3UInt64 *)
NO_VALUES(fmi3SetBoolean, const fmi3Boolean *)
NO_VALUES(fmi3SetString, const fmi3String *)

NO_CLOCK(fmi3GetClock, fmi3Clock *)
NO_CLOCK(fmi3SetClock, const fmi3Clock *)
NO_CLOCK(fmi3GetShiftDecimal, fmi3Float64 *)
NO_CLOCK(fmi3SetShiftDecimal, const fmi3Float64 *)
NO_CLOCK(fmi3SetIntervalDecimal, const fmi3Float64 *)
NO_CLOCK_FRACTION(fmi3GetShiftFraction, fmi3UInt64 *)
NO_CLOCK_FRACTION(fmi3SetShiftFraction, const fmi3UInt64 *)
NO_CLOCK_FRACTION(fmi3SetIntervalFraction, const fmi3UInt64 *)

NO_MODE(fmi3EnterConfigurationMode, "structural parameters")
NO_MODE(fmi3ExitConfigurationMode, "structural parameters")
NO_MODE(fmi3EvaluateDiscreteStates, "clocked states")
NO_MODE(fmi3EnterStepMode, "event mode in co-simulation")

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference r[], size_t count, size_t sizes[],
                         fmi3Binary values[], size_t n) {
    (void)sizes;
    (void)values;
    (void)r;
    return refuse(c, count | n, "binary variables");
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference r[], size_t count, const size_t sizes[],
                         const fmi3Binary values[], size_t n) {
    (void)sizes;
    (void)values;
    (void)r;
    return refuse(c, count | n, "binary variables");
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference r[], size_t count, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[]) {
    (void)r;
    (void)intervals;
    (void)qualifiers;
    return refuse(c, count, "clocks");
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference r[], size_t count, fmi3UInt64 counters[],
                                   fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]) {
    (void)r;
    (void)counters;
    (void)resolutions;
    (void)qualifiers;
    return refuse(c, count, "clocks");
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference r, size_t *count) {
    (void)r;
    (void)count;
    return refuse(c, 1, "dependencies that change (providesPerElementDependencies is false)");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent, size_t dependent_elements[],
                                       fmi3ValueReference independents[], size_t independent_elements[],
                                       fmi3DependencyKind kinds[], size_t count) {
    (void)dependent;
    (void)dependent_elements;
    (void)independents;
    (void)independent_elements;
    (void)kinds;
    (void)count;
    return refuse(c, 1, "dependencies that change (providesPerElementDependencies is false)");
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference r[], size_t count, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t n) {
    (void)r;
    (void)orders;
    (void)values;
    return refuse(c, count | n, "output derivatives");
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time) {
    (void)clock;
    (void)time;
    return refuse(c, 1, "model partitions");
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
    (void)name;
    (void)token;
    (void)resources;
    (void)visible;
    (void)logging;
    (void)update;
    (void)lock;
    (void)unlock;
    if (logger) logger(environment, fmi3Error, "logStatusError", "the model has no scheduled execution");
    return NULL;
}
