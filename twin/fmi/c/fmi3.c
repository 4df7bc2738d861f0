/* FMI 3.0 for Co-Simulation, without Event Mode, early return, clocks or structural parameters. */

#define GETTABLE (INITIALIZATION | STEP | STEP_FAILED | TERMINATED | FAILED)
#define WRITABLE (INSTANTIATED | INITIALIZATION | STEP)
#define ALIVE    (ANY & ~DEAD)

#define GET_AND_SET(X, Name, types) X(fmi3Get##Name, GETTABLE, types) X(fmi3Set##Name, WRITABLE, types)

/* fmi3FreeInstance is allowed after a fatal error too, or its place would be lost */
#define FUNCTIONS(X)                                               \
    X(fmi3SetDebugLogging,              ALIVE,              0)     \
    X(fmi3FreeInstance,                 ANY,                0)     \
    X(fmi3EnterInitializationMode,      INSTANTIATED,       0)     \
    X(fmi3ExitInitializationMode,       INITIALIZATION,     0)     \
    X(fmi3Terminate,                    STEP | STEP_FAILED, 0)     \
    X(fmi3Reset,                        ALIVE,              0)     \
    X(fmi3DoStep,                       STEP,               0)     \
    GET_AND_SET(X, Float32,             NO_TYPE)                   \
    GET_AND_SET(X, Float64,             FLOAT64)                   \
    GET_AND_SET(X, Int8,                NO_TYPE)                   \
    GET_AND_SET(X, UInt8,               NO_TYPE)                   \
    GET_AND_SET(X, Int16,               NO_TYPE)                   \
    GET_AND_SET(X, UInt16,              NO_TYPE)                   \
    GET_AND_SET(X, Int32,               INT32)                     \
    GET_AND_SET(X, UInt32,              NO_TYPE)                   \
    GET_AND_SET(X, Int64,               INT64)                     \
    GET_AND_SET(X, UInt64,              NO_TYPE)                   \
    GET_AND_SET(X, Boolean,             BOOLEAN)                   \
    GET_AND_SET(X, String,              NO_TYPE)                   \
    GET_AND_SET(X, Binary,              NO_TYPE)                   \
    GET_AND_SET(X, Clock,               NO_TYPE)                   \
    X(fmi3GetFMUState,                  ALIVE,              0)     \
    X(fmi3SetFMUState,                  ALIVE,              0)     \
    X(fmi3FreeFMUState,                 ALIVE,              0)     \
    X(fmi3SerializedFMUStateSize,       ALIVE,              0)     \
    X(fmi3SerializeFMUState,            ALIVE,              0)     \
    X(fmi3DeserializeFMUState,          ALIVE,              0)     \
    X(fmi3EnterEventMode,               0,                  0)     \
    X(fmi3EnterStepMode,                0,                  0)     \
    X(fmi3EnterConfigurationMode,       0,                  0)     \
    X(fmi3ExitConfigurationMode,        0,                  0)     \
    X(fmi3GetNumberOfVariableDependencies, 0,               0)     \
    X(fmi3GetVariableDependencies,      0,                  0)     \
    X(fmi3GetDirectionalDerivative,     0,                  0)     \
    X(fmi3GetAdjointDerivative,         0,                  0)     \
    X(fmi3GetOutputDerivatives,         0,                  0)     \
    X(fmi3GetIntervalDecimal,           0,                  0)     \
    X(fmi3GetIntervalFraction,          0,                  0)     \
    X(fmi3GetShiftDecimal,              0,                  0)     \
    X(fmi3GetShiftFraction,             0,                  0)     \
    X(fmi3SetIntervalDecimal,           0,                  0)     \
    X(fmi3SetIntervalFraction,          0,                  0)     \
    X(fmi3SetShiftDecimal,              0,                  0)     \
    X(fmi3SetShiftFraction,             0,                  0)     \
    X(fmi3EvaluateDiscreteStates,       0,                  0)     \
    X(fmi3UpdateDiscreteStates,         0,                  0)     \
    X(fmi3EnterContinuousTimeMode,      0,                  0)     \
    X(fmi3CompletedIntegratorStep,      0,                  0)     \
    X(fmi3SetTime,                      0,                  0)     \
    X(fmi3SetContinuousStates,          0,                  0)     \
    X(fmi3GetContinuousStateDerivatives, 0,                 0)     \
    X(fmi3GetEventIndicators,           0,                  0)     \
    X(fmi3GetContinuousStates,          0,                  0)     \
    X(fmi3GetNominalsOfContinuousStates, 0,                 0)     \
    X(fmi3GetNumberOfEventIndicators,   0,                  0)     \
    X(fmi3GetNumberOfContinuousStates,  0,                  0)     \
    X(fmi3ActivateModelPartition,       0,                  0)

#include "core.h"

typedef void (*Logger)(void *environment, int status, const char *category, const char *message);

static void send(const Sink *sink, int status, const char *category, const char *text)
{
    ((Logger)sink->logger)(sink->environment, status, category, text);
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool event_mode_used, bool early_return_allowed,
                                         const uint32_t intermediate[], size_t intermediate_count, void *environment,
                                         Logger logger, void *intermediate_update)
{
    (void)resources, (void)visible, (void)early_return_allowed, (void)intermediate, (void)intermediate_update;
    Sink sink = {(void *)logger, environment, name ? name : MODEL, 0};
    if (event_mode_used || intermediate_count) {
        say(&sink, ERROR, "%s: has neither Event Mode nor intermediate updates. Instantiate it without them.", MODEL);
        return NULL;
    }
    return instantiate(sink, token, logging);
}

static void *refuse(Logger logger, void *environment, const char *interface)
{
    Sink sink = {(void *)logger, environment, MODEL, 0};
    say(&sink, ERROR, "%s: is for Co-Simulation, not for %s.", MODEL, interface);
    return NULL;
}

EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible,
                                          bool logging, void *environment, Logger logger)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    return refuse(logger, environment, "Model Exchange");
}

EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources, bool visible,
                                               bool logging, void *environment, Logger logger, void *clock_update,
                                               void *lock_preemption, void *unlock_preemption)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    (void)clock_update, (void)lock_preemption, (void)unlock_preemption;
    return refuse(logger, environment, "Scheduled Execution");
}

EXPORT void fmi3FreeInstance(void *instance)
{
    Slot *me = enter(instance, fmi3FreeInstance_number);
    if (me) release(me);
}

EXPORT int fmi3SetDebugLogging(void *instance, bool on, size_t count, const char *const names[])
{
    ENTER(fmi3SetDebugLogging);
    return set_logging(me, on, count, names);
}

EXPORT int fmi3EnterInitializationMode(void *instance, bool tolerance_defined, double tolerance_, double start_time,
                                       bool stop_defined, double stop_time)
{
    (void)tolerance_defined, (void)tolerance_;
    ENTER(fmi3EnterInitializationMode);
    return define_experiment(me, start_time, stop_defined, stop_time) ? enter_initialization(me) : ERROR;
}

EXPORT int fmi3ExitInitializationMode(void *instance)
{
    ENTER(fmi3ExitInitializationMode);
    return exit_initialization(me);
}

EXPORT int fmi3Terminate(void *instance)
{
    ENTER(fmi3Terminate);
    me->memory.mode = TERMINATED;
    return OK;
}

EXPORT int fmi3Reset(void *instance)
{
    ENTER(fmi3Reset);
    start(me);
    return OK;
}

EXPORT int fmi3DoStep(void *instance, double t, double h, bool no_rollback, bool *event_handling_needed,
                      bool *terminate_simulation, bool *early_return, double *last_successful_time)
{
    (void)no_rollback;
    ENTER(fmi3DoStep);
    int status = advance(me, t, h);
    if (event_handling_needed) *event_handling_needed = false;
    if (terminate_simulation) *terminate_simulation = false;
    if (early_return) *early_return = false;
    if (last_successful_time) *last_successful_time = me->memory.time;
    return status;
}

/* ------------------------------------------------------------------------------------------------------ variables */

/* Move the scalars of a variable. */
static void move(unsigned char *to, const unsigned char *from, const Field *field)
{
    for (uint32_t i = 0; i < field->count; i++) {
        switch (field->width) {
        case 8:  ((uint64_t *)to)[i] = ((const uint64_t *)from)[i]; break;
        case 4:  ((uint32_t *)to)[i] = ((const uint32_t *)from)[i]; break;
        default: to[i] = from[i]; break;
        }
    }
}

static NOINLINE int get(void *instance, int function, const uint32_t references[], size_t count, void *values, size_t size)
{
    Slot *me = enter(instance, function);
    if (!me || !accessible(me, function, false, references, count, values, size) || settle(me) != OK) return ERROR;
    unsigned char *to = values;
    for (size_t i = 0; i < count; i++) {
        const Field *field = &FIELDS[references[i]];
        move(to, me->memory.record + field->offset, field);
        to += (size_t)field->count * field->width;
    }
    return OK;
}

static NOINLINE int set(void *instance, int function, const uint32_t references[], size_t count, const void *values, size_t size)
{
    Slot *me = enter(instance, function);
    if (!me || !accessible(me, function, true, references, count, values, size)) return ERROR;
    const unsigned char *from = values;
    for (size_t i = 0; i < count; i++) {
        const Field *field = &FIELDS[references[i]];
        move(me->memory.record + field->offset, from, field);
        from += (size_t)field->count * field->width;
    }
    me->memory.stale = me->memory.mode == INITIALIZATION;
    return OK;
}

/* memory of a component holds its variables as FMI 3.0 passes them, so one copy serves every type */
#define ACCESSORS(Name, type)                                                                                          \
    EXPORT int fmi3Get##Name(void *instance, const uint32_t references[], size_t count, type values[], size_t size)    \
    { return get(instance, fmi3Get##Name##_number, references, count, values, size); }                                 \
    EXPORT int fmi3Set##Name(void *instance, const uint32_t references[], size_t count, const type values[], size_t size) \
    { return set(instance, fmi3Set##Name##_number, references, count, values, size); }
ACCESSORS(Float32, float)
ACCESSORS(Float64, double)
ACCESSORS(Int8, int8_t)
ACCESSORS(UInt8, uint8_t)
ACCESSORS(Int16, int16_t)
ACCESSORS(UInt16, uint16_t)
ACCESSORS(Int32, int32_t)
ACCESSORS(UInt32, uint32_t)
ACCESSORS(Int64, int64_t)
ACCESSORS(UInt64, uint64_t)
ACCESSORS(Boolean, bool)
typedef const char *String;
ACCESSORS(String, String)

/* binaries carry their sizes, clocks no number of values: neither type exists here, so only empty calls succeed */
typedef const uint8_t *Binary;
EXPORT int fmi3GetBinary(void *instance, const uint32_t references[], size_t count, size_t sizes[], Binary values[], size_t size)
{
    (void)sizes;
    return get(instance, fmi3GetBinary_number, references, count, values, size);
}

EXPORT int fmi3SetBinary(void *instance, const uint32_t references[], size_t count, const size_t sizes[],
                         const Binary values[], size_t size)
{
    (void)sizes;
    return set(instance, fmi3SetBinary_number, references, count, values, size);
}

EXPORT int fmi3GetClock(void *instance, const uint32_t references[], size_t count, bool values[])
{
    return get(instance, fmi3GetClock_number, references, count, values, count);
}

EXPORT int fmi3SetClock(void *instance, const uint32_t references[], size_t count, const bool values[])
{
    return set(instance, fmi3SetClock_number, references, count, values, count);
}

/* --------------------------------------------------------------------------------------------------- saved states */

EXPORT int fmi3GetFMUState(void *instance, void **state)
{
    ENTER(fmi3GetFMUState);
    return save(me, state);
}

EXPORT int fmi3SetFMUState(void *instance, void *state)
{
    ENTER(fmi3SetFMUState);
    return restore(me, state);
}

EXPORT int fmi3FreeFMUState(void *instance, void **state)
{
    ENTER(fmi3FreeFMUState);
    return drop(me, state);
}

EXPORT int fmi3SerializedFMUStateSize(void *instance, void *state, size_t *size)
{
    ENTER(fmi3SerializedFMUStateSize);
    return serialized_size(me, state, size);
}

EXPORT int fmi3SerializeFMUState(void *instance, void *state, uint8_t bytes[], size_t size)
{
    ENTER(fmi3SerializeFMUState);
    return serialize(me, state, bytes, size);
}

EXPORT int fmi3DeserializeFMUState(void *instance, const uint8_t bytes[], size_t size, void **state)
{
    ENTER(fmi3DeserializeFMUState);
    return deserialize(me, bytes, size, state);
}

/* ------------------------------------------------------------------------------------------- interfaces not offered */

ABSENT(fmi3EnterEventMode)
ABSENT(fmi3EnterStepMode)
ABSENT(fmi3EnterConfigurationMode)
ABSENT(fmi3ExitConfigurationMode)
ABSENT(fmi3GetNumberOfVariableDependencies, uint32_t, size_t *)
ABSENT(fmi3GetVariableDependencies, uint32_t, size_t *, uint32_t *, size_t *, int *, size_t)
ABSENT(fmi3GetDirectionalDerivative, const uint32_t *, size_t, const uint32_t *, size_t, const double *, size_t, double *, size_t)
ABSENT(fmi3GetAdjointDerivative, const uint32_t *, size_t, const uint32_t *, size_t, const double *, size_t, double *, size_t)
ABSENT(fmi3GetOutputDerivatives, const uint32_t *, size_t, const int32_t *, double *, size_t)
ABSENT(fmi3GetIntervalDecimal, const uint32_t *, size_t, double *, int *)
ABSENT(fmi3GetIntervalFraction, const uint32_t *, size_t, uint64_t *, uint64_t *, int *)
ABSENT(fmi3GetShiftDecimal, const uint32_t *, size_t, double *)
ABSENT(fmi3GetShiftFraction, const uint32_t *, size_t, uint64_t *, uint64_t *)
ABSENT(fmi3SetIntervalDecimal, const uint32_t *, size_t, const double *)
ABSENT(fmi3SetIntervalFraction, const uint32_t *, size_t, const uint64_t *, const uint64_t *)
ABSENT(fmi3SetShiftDecimal, const uint32_t *, size_t, const double *)
ABSENT(fmi3SetShiftFraction, const uint32_t *, size_t, const uint64_t *, const uint64_t *)
ABSENT(fmi3EvaluateDiscreteStates)
ABSENT(fmi3UpdateDiscreteStates, bool *, bool *, bool *, bool *, bool *, double *)
ABSENT(fmi3EnterContinuousTimeMode)
ABSENT(fmi3CompletedIntegratorStep, bool, bool *, bool *)
ABSENT(fmi3SetTime, double)
ABSENT(fmi3SetContinuousStates, const double *, size_t)
ABSENT(fmi3GetContinuousStateDerivatives, double *, size_t)
ABSENT(fmi3GetEventIndicators, double *, size_t)
ABSENT(fmi3GetContinuousStates, double *, size_t)
ABSENT(fmi3GetNominalsOfContinuousStates, double *, size_t)
ABSENT(fmi3GetNumberOfEventIndicators, size_t *)
ABSENT(fmi3GetNumberOfContinuousStates, size_t *)
ABSENT(fmi3ActivateModelPartition, uint32_t, double)
