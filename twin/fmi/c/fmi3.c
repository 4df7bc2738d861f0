/* FMI 3.0 for Co-Simulation and Model Exchange, without clocks and structural parameters. */

#define EVALUABLE (INITIALIZATION | EVENT | CONTINUOUS | TERMINATED | FAILED)
#define GETTABLE  (EVALUABLE | STEP | STEP_FAILED)
#define WRITABLE  (INSTANTIATED | INITIALIZATION | STEP | EVENT)
#define ALIVE     (ANY & ~DEAD)

#define GET_AND_SET(X, Name, more, types) X(fmi3Get##Name, ALL, GETTABLE more, types) X(fmi3Set##Name, ALL, WRITABLE more, types)

/* fmi3FreeInstance is allowed after a fatal error too, or its place would be lost */
#define FUNCTIONS(X) \
    X(fmi3SetDebugLogging,                   ALL,           ALIVE,                                   0)       \
    X(fmi3FreeInstance,                      ALL,           ANY,                                     0)       \
    X(fmi3EnterInitializationMode,           ALL,           INSTANTIATED,                            0)       \
    X(fmi3ExitInitializationMode,            ALL,           INITIALIZATION,                          0)       \
    X(fmi3Terminate,                         ALL,           EVENT | CONTINUOUS | STEP | STEP_FAILED, 0)       \
    X(fmi3Reset,                             ALL,           ALIVE,                                   0)       \
    X(fmi3DoStep,                            STEPPED,       STEP,                                    0)       \
    GET_AND_SET(X, Float32,  | CONTINUOUS | INTERMEDIATE, NO_TYPE)                                          \
    GET_AND_SET(X, Float64,  | CONTINUOUS | INTERMEDIATE, FLOAT64)                                          \
    GET_AND_SET(X, Int8,     ,                            NO_TYPE)                                          \
    GET_AND_SET(X, UInt8,    ,                            NO_TYPE)                                          \
    GET_AND_SET(X, Int16,    ,                            NO_TYPE)                                          \
    GET_AND_SET(X, UInt16,   ,                            NO_TYPE)                                          \
    GET_AND_SET(X, Int32,    ,                            INT32)                                            \
    GET_AND_SET(X, UInt32,   ,                            NO_TYPE)                                          \
    GET_AND_SET(X, Int64,    ,                            INT64)                                            \
    GET_AND_SET(X, UInt64,   ,                            NO_TYPE)                                          \
    GET_AND_SET(X, Boolean,  ,                            BOOLEAN)                                          \
    GET_AND_SET(X, String,   ,                            NO_TYPE)                                          \
    GET_AND_SET(X, Binary,   ,                            NO_TYPE)                                          \
    GET_AND_SET(X, Clock,    ,                            NO_TYPE)                                          \
    X(fmi3GetFMUState,                       ALL,           ALIVE,                                   0)       \
    X(fmi3SetFMUState,                       ALL,           ALIVE,                                   0)       \
    X(fmi3FreeFMUState,                      ALL,           ALIVE,                                   0)       \
    X(fmi3SerializedFMUStateSize,            ALL,           ALIVE,                                   0)       \
    X(fmi3SerializeFMUState,                 ALL,           ALIVE,                                   0)       \
    X(fmi3DeserializeFMUState,               ALL,           ALIVE,                                   0)       \
    X(fmi3EnterEventMode,                    ME | EVENTFUL, CONTINUOUS | STEP,                       0)       \
    X(fmi3EnterStepMode,                     EVENTFUL,      PERIOD ? EVENT : 0,                      0)       \
    X(fmi3EnterConfigurationMode,            ALL,           0,                                       0)       \
    X(fmi3ExitConfigurationMode,             ALL,           0,                                       0)       \
    X(fmi3GetNumberOfVariableDependencies,   ALL,           0,                                       0)       \
    X(fmi3GetVariableDependencies,           ALL,           0,                                       0)       \
    X(fmi3GetDirectionalDerivative,          ALL,           DIRECTIONAL ? GETTABLE : 0,              FLOAT64) \
    X(fmi3GetAdjointDerivative,              ALL,           0,                                       0)       \
    X(fmi3GetOutputDerivatives,              STEPPED,       0,                                       0)       \
    X(fmi3GetIntervalDecimal,                ALL,           0,                                       0)       \
    X(fmi3GetIntervalFraction,               ALL,           0,                                       0)       \
    X(fmi3GetShiftDecimal,                   ALL,           0,                                       0)       \
    X(fmi3GetShiftFraction,                  ALL,           0,                                       0)       \
    X(fmi3SetIntervalDecimal,                ALL,           0,                                       0)       \
    X(fmi3SetIntervalFraction,               ALL,           0,                                       0)       \
    X(fmi3SetShiftDecimal,                   ALL,           0,                                       0)       \
    X(fmi3SetShiftFraction,                  ALL,           0,                                       0)       \
    X(fmi3EvaluateDiscreteStates,            ALL,           0,                                       0)       \
    X(fmi3UpdateDiscreteStates,              ME | EVENTFUL, EVENT,                                   0)       \
    X(fmi3EnterContinuousTimeMode,           ME,            EVENT,                                   0)       \
    X(fmi3CompletedIntegratorStep,           ME,            CONTINUOUS,                              0)       \
    X(fmi3SetTime,                           ME,            EVENT | CONTINUOUS,                      0)       \
    X(fmi3SetContinuousStates,               ME,            CONTINUOUS,                              0)       \
    X(fmi3GetContinuousStateDerivatives,     ME,            EVALUABLE,                               0)       \
    X(fmi3GetEventIndicators,                ME,            EVALUABLE,                               0)       \
    X(fmi3GetContinuousStates,               ME,            EVALUABLE,                               0)       \
    X(fmi3GetNominalsOfContinuousStates,     ME,            EVALUABLE,                               0)       \
    X(fmi3GetNumberOfEventIndicators,        ME,            EVALUABLE,                               0)       \
    X(fmi3GetNumberOfContinuousStates,       ME,            EVALUABLE,                               0)       \
    X(fmi3ActivateModelPartition,            ALL,           0,                                       0)

#include "core.h"

typedef void (*Logger)(void *environment, int status, const char *category, const char *message);

static void send(const Sink *sink, int status, const char *category, const char *text)
{
    ((Logger)sink->logger)(sink->environment, status, category, text);
}

#include "fmi3_steps.h"

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool event_mode_used, bool early_return_allowed,
                                         const uint32_t intermediate[], size_t intermediate_count, void *environment,
                                         Logger logger, void *intermediate_update)
{
    (void)resources, (void)visible;
    Sink sink = {(void *)logger, environment, name ? name : MODEL, 0};
    if (!are_possible(&sink, event_mode_used, intermediate, intermediate_count)) return NULL;
    Slot *me = instantiate(sink, event_mode_used ? EVENTFUL : CS, token, logging);
    if (me) wish(&me->wishes, EXCHANGE ? intermediate_update : NULL, early_return_allowed, intermediate, intermediate_count);
    return me;
}

EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible,
                                          bool logging, void *environment, Logger logger)
{
    (void)resources, (void)visible;
    Sink sink = {(void *)logger, environment, name ? name : MODEL, 0};
    return instantiate(sink, ME, token, logging);
}

EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources, bool visible,
                                               bool logging, void *environment, Logger logger, void *clock_update,
                                               void *lock_preemption, void *unlock_preemption)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    (void)clock_update, (void)lock_preemption, (void)unlock_preemption;
    Sink sink = {(void *)logger, environment, MODEL, 0};
    say(&sink, ERROR, "%s: is not for Scheduled Execution.", MODEL);
    return NULL;
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
    return terminate(me);
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
    bool event = false;
    int status = PERIOD && me->memory.kind == EVENTFUL ? advance_to_event(me, t, h, &event)
               : EXCHANGE && me->wishes.update         ? advance_in_sight(me, t, h)
                                                       : advance(me, t, h);
    if (event_handling_needed) *event_handling_needed = event;
    if (terminate_simulation) *terminate_simulation = false;
    if (early_return) *early_return = (PERIOD || EXCHANGE) && status < DISCARD && me->memory.time < t + h;
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
    touch(me);
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

ABSENT(fmi3EnterConfigurationMode)
ABSENT(fmi3ExitConfigurationMode)
ABSENT(fmi3GetNumberOfVariableDependencies, uint32_t, size_t *)
ABSENT(fmi3GetVariableDependencies, uint32_t, size_t *, uint32_t *, size_t *, int *, size_t)
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
ABSENT(fmi3ActivateModelPartition, uint32_t, double)

#include "fmi3_exchange.h"
