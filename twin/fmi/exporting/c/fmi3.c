/* FMI 3.0 for Co-Simulation, Model Exchange and Scheduled Execution, without structural parameters. */

#define EVALUABLE (INITIALIZATION | EVENT | CONTINUOUS | TERMINATED | FAILED)
#define GETTABLE  (EVALUABLE | STEP | STEP_FAILED | ACTIVATION)
#define WRITABLE  (INSTANTIATED | INITIALIZATION | STEP | EVENT | ACTIVATION)
#define ALIVE     (ANY & ~DEAD)

#define GET_AND_SET(X, Name, more, types) X(fmi3Get##Name, ALL, GETTABLE more, types) X(fmi3Set##Name, ALL, WRITABLE more, types)

/* fmi3FreeInstance is allowed after a fatal error too, or its place would be lost */
#define FUNCTIONS(X) \
    X(fmi3SetDebugLogging,                   ALL,           ALIVE,                                   0)       \
    X(fmi3FreeInstance,                      ALL,           ANY,                                     0)       \
    X(fmi3EnterInitializationMode,           ALL,           INSTANTIATED,                            0)       \
    X(fmi3ExitInitializationMode,            ALL,           INITIALIZATION,                          0)       \
    X(fmi3Terminate,                         ALL,           EVENT | CONTINUOUS | STEP | STEP_FAILED | ACTIVATION, 0) \
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
    X(fmi3GetClock,                          ALL,           GETTABLE,                                NO_TYPE) \
    X(fmi3SetClock,                          ME | EVENTFUL, EVENT,                                   CLOCK)   \
    X(fmi3GetFMUState,                       SAVED,         ALIVE,                                   0)       \
    X(fmi3SetFMUState,                       SAVED,         ALIVE,                                   0)       \
    X(fmi3FreeFMUState,                      SAVED,         ALIVE,                                   0)       \
    X(fmi3SerializedFMUStateSize,            SAVED,         ALIVE,                                   0)       \
    X(fmi3SerializeFMUState,                 SAVED,         ALIVE,                                   0)       \
    X(fmi3DeserializeFMUState,               SAVED,         ALIVE,                                   0)       \
    X(fmi3EnterEventMode,                    ME | EVENTFUL, CONTINUOUS | STEP,                       0)       \
    X(fmi3EnterStepMode,                     EVENTFUL,      EVENT,                                   0)       \
    X(fmi3EnterConfigurationMode,            ALL,           0,                                       0)       \
    X(fmi3ExitConfigurationMode,             ALL,           0,                                       0)       \
    X(fmi3GetNumberOfVariableDependencies,   ALL,           0,                                       0)       \
    X(fmi3GetVariableDependencies,           ALL,           0,                                       0)       \
    X(fmi3GetDirectionalDerivative,          ALL,           GETTABLE,                                FLOAT64) \
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
    X(fmi3ActivateModelPartition,            SCHEDULED,     ACTIVATION,                              CLOCK)

#include "core.h"

typedef void (*Logger)(void *environment, int status, const char *category, const char *message);

static void send(const Sink *sink, int status, const char *category, const char *text)
{
    ((Logger)sink->logger)(sink->environment, status, category, text);
}

#include "fmi3_steps.h"

EXPORTED(const char *, fmi3GetVersion, (void)) { return "3.0"; }

EXPORTED(void *, fmi3InstantiateCoSimulation, (const char *name, const char *token, const char *resources, bool visible,
                                               bool logging, bool event_mode_used, bool early_return_allowed,
                                               const uint32_t intermediate[], size_t intermediate_count, void *environment,
                                               Logger logger, Update intermediate_update))
{
    Sink sink = {(Function)logger, environment, name ? name : model.name, 0};
    if (!are_possible(&sink, event_mode_used, intermediate, intermediate_count)) return NULL;
    Slot *me = instantiate(sink, event_mode_used ? EVENTFUL : CS, token, logging);
    if (me) wish(me, intermediate_update, early_return_allowed, intermediate, intermediate_count);
    return me;
}

EXPORTED(void *, fmi3InstantiateModelExchange, (const char *name, const char *token, const char *resources, bool visible,
                                                bool logging, void *environment, Logger logger))
{
    Sink sink = {(Function)logger, environment, name ? name : model.name, 0};
    return instantiate(sink, ME, token, logging);
}

EXPORTED(void *, fmi3InstantiateScheduledExecution, (const char *name, const char *token, const char *resources, bool visible,
                                                     bool logging, void *environment, Logger logger, void *clock_update,
                                                     void *lock_preemption, void *unlock_preemption))
{
    Sink sink = {(Function)logger, environment, name ? name : model.name, 0};
    if (model.has_clock) return instantiate(sink, SCHEDULED, token, logging);
    say(&sink, ERROR, "%s: is not for Scheduled Execution.", model.name);
    return NULL;
}

EXPORTED(void, fmi3FreeInstance, (void *instance))
{
    Slot *me = enter(instance, fmi3FreeInstance_number);
    if (me) release(me);
}

EXPORTED(int, fmi3SetDebugLogging, (void *instance, bool on, size_t count, const char *const names[]))
{
    ENTER(fmi3SetDebugLogging);
    return set_logging(me, on, count, names);
}

EXPORTED(int, fmi3EnterInitializationMode, (void *instance, bool tolerance_defined, double tolerance_, double start_time,
                                            bool stop_defined, double stop_time))
{
    ENTER(fmi3EnterInitializationMode);
    return define_experiment(me, start_time, stop_defined, stop_time) ? enter_initialization(me) : ERROR;
}

EXPORTED(int, fmi3ExitInitializationMode, (void *instance))
{
    ENTER(fmi3ExitInitializationMode);
    return exit_initialization(me);
}

EXPORTED(int, fmi3Terminate, (void *instance))
{
    ENTER(fmi3Terminate);
    return terminate(me);
}

EXPORTED(int, fmi3Reset, (void *instance))
{
    ENTER(fmi3Reset);
    start(me);
    return OK;
}

EXPORTED(int, fmi3DoStep, (void *instance, double t, double h, bool no_rollback, bool *event_handling_needed,
                           bool *terminate_simulation, bool *early_return, double *last_successful_time))
{
    ENTER(fmi3DoStep);
    if (event_handling_needed) *event_handling_needed = false;
    if (terminate_simulation) *terminate_simulation = false;
    if (early_return) *early_return = false;
    int status;
    if (me->memory.kind == CS && !me->wishes.update) status = advance(me, t, h);
    else {
        status = me->wishes.update ? advance_in_sight(me, t, h) : advance_to_event(me, t, h, event_handling_needed);
        if (early_return) *early_return = status < DISCARD && me->memory.time < t + h;
    }
    if (last_successful_time) *last_successful_time = me->memory.time;
    return status;
}

/* ------------------------------------------------------------------------------------------------------ variables */

/* The record holds variables as FMI 3.0 passes them; a Boolean as a byte. */
#define ACCESSORS(Name, type, word)                                                                                    \
    EXPORTED(int, fmi3Get##Name, (void *instance, const uint32_t references[], size_t count, type values[], size_t size)) \
    {                                                                                                                  \
        Slot *me = reading(instance, fmi3Get##Name##_number, references, count, values, size);                         \
        if (!me) return ERROR;                                                                                         \
        word *to = (word *)values;                                                                                     \
        for (size_t i = 0; i < count; i++) {                                                                           \
            const Field *field = &model.fields[references[i]];                                                         \
            const word *from = place_of(&me->memory, field->offset);                                                   \
            if (field->count == 1) *to++ = *from;                                                                      \
            else for (uint32_t j = 0; j < field->count; j++) *to++ = from[j];                                          \
        }                                                                                                              \
        return OK;                                                                                                     \
    }                                                                                                                  \
    EXPORTED(int, fmi3Set##Name, (void *instance, const uint32_t references[], size_t count, const type values[],      \
                                  size_t size))                                                                        \
    {                                                                                                                  \
        Slot *me = writing(instance, fmi3Set##Name##_number, references, count, values, size);                         \
        if (!me) return ERROR;                                                                                         \
        const word *from = (const word *)values;                                                                       \
        for (size_t i = 0; i < count; i++) {                                                                           \
            const Field *field = &model.fields[references[i]];                                                         \
            word *to = place_of(&me->memory, field->offset);                                                           \
            if (field->count == 1) *to = *from++;                                                                      \
            else for (uint32_t j = 0; j < field->count; j++) to[j] = *from++;                                          \
        }                                                                                                              \
        return OK;                                                                                                     \
    }
ACCESSORS(Float64, double, double)
ACCESSORS(Int32, int32_t, int32_t)
ACCESSORS(Int64, int64_t, int64_t)
ACCESSORS(Boolean, bool, unsigned char)

/* types that no variable has */
#define NO_ACCESSORS(Name, type)                                                                                       \
    EXPORTED(int, fmi3Get##Name, (void *instance, const uint32_t references[], size_t count, type values[], size_t size)) \
    { return get_none(instance, fmi3Get##Name##_number, references, count, values, size); }                            \
    EXPORTED(int, fmi3Set##Name, (void *instance, const uint32_t references[], size_t count, const type values[],      \
                                  size_t size))                                                                        \
    { return set_none(instance, fmi3Set##Name##_number, references, count, values, size); }
typedef const char *String;
NO_ACCESSORS(Float32, float)
NO_ACCESSORS(Int8, int8_t)
NO_ACCESSORS(UInt8, uint8_t)
NO_ACCESSORS(Int16, int16_t)
NO_ACCESSORS(UInt16, uint16_t)
NO_ACCESSORS(UInt32, uint32_t)
NO_ACCESSORS(UInt64, uint64_t)
NO_ACCESSORS(String, String)

/* the same; binaries carry their sizes, clocks no number of values */
typedef const uint8_t *Binary;
EXPORTED(int, fmi3GetBinary, (void *instance, const uint32_t references[], size_t count, size_t sizes[],
                              Binary values[], size_t size))
{
    return get_none(instance, fmi3GetBinary_number, references, count, values, size);
}

EXPORTED(int, fmi3SetBinary, (void *instance, const uint32_t references[], size_t count, const size_t sizes[],
                              const Binary values[], size_t size))
{
    return set_none(instance, fmi3SetBinary_number, references, count, values, size);
}

EXPORTED(int, fmi3GetClock, (void *instance, const uint32_t references[], size_t count, bool values[]))
{
    return get_none(instance, fmi3GetClock_number, references, count, values, count);
}

EXPORTED(int, fmi3SetClock, (void *instance, const uint32_t references[], size_t count, const bool values[]))
{
    Slot *me = writing(instance, fmi3SetClock_number, references, count, values, count);
    if (!me) return ERROR;
    bool is_tick = is_at(me->memory.time, tick_begin(&me->memory)); /* it has published already, and takes inputs soon */
    for (size_t i = 0; i < count; i++)
        if (values[i] && !is_tick) return fail(me, fmi3SetClock_number, "the clock does not tick now.");
    return OK;
}

/* --------------------------------------------------------------------------------------------------- saved states */

EXPORTED(int, fmi3GetFMUState, (void *instance, void **state))
{
    ENTER(fmi3GetFMUState);
    return save(me, state);
}

EXPORTED(int, fmi3SetFMUState, (void *instance, void *state))
{
    ENTER(fmi3SetFMUState);
    return restore(me, state);
}

EXPORTED(int, fmi3FreeFMUState, (void *instance, void **state))
{
    ENTER(fmi3FreeFMUState);
    return drop(me, state);
}

EXPORTED(int, fmi3SerializedFMUStateSize, (void *instance, void *state, size_t *size))
{
    ENTER(fmi3SerializedFMUStateSize);
    return serialized_size(me, state, size);
}

EXPORTED(int, fmi3SerializeFMUState, (void *instance, void *state, uint8_t bytes[], size_t size))
{
    ENTER(fmi3SerializeFMUState);
    return serialize(me, state, bytes, size);
}

EXPORTED(int, fmi3DeserializeFMUState, (void *instance, const uint8_t bytes[], size_t size, void **state))
{
    ENTER(fmi3DeserializeFMUState);
    return deserialize(me, bytes, size, state);
}

EXPORTED(int, fmi3ActivateModelPartition, (void *instance, uint32_t clock, double t))
{
    if (!model.has_clock) return absent(instance, fmi3ActivateModelPartition_number);
    ENTER(fmi3ActivateModelPartition);
    return activate(me, fmi3ActivateModelPartition_number, clock, t);
}

/* ------------------------------------------------------------------------------------------- interfaces not offered */

/* A function that only says so; its arguments in parentheses. */
#define ABSENT(name, arguments) EXPORTED(int, name, arguments) { return absent(instance, name##_number); }
ABSENT(fmi3EnterConfigurationMode, (void *instance))
ABSENT(fmi3ExitConfigurationMode, (void *instance))
ABSENT(fmi3GetNumberOfVariableDependencies, (void *instance, uint32_t reference, size_t *count))
ABSENT(fmi3GetVariableDependencies, (void *instance, uint32_t dependent, size_t dependent_elements[],
                                     uint32_t independents[], size_t independent_elements[], int kinds[], size_t count))
ABSENT(fmi3GetAdjointDerivative, (void *instance, const uint32_t unknowns[], size_t unknown_count,
                                  const uint32_t knowns[], size_t known_count, const double seeds[], size_t seed_count,
                                  double sensitivities[], size_t sensitivity_count))
ABSENT(fmi3GetOutputDerivatives, (void *instance, const uint32_t references[], size_t count, const int32_t orders[],
                                  double values[], size_t size))
ABSENT(fmi3GetIntervalDecimal, (void *instance, const uint32_t references[], size_t count, double intervals[],
                                int qualifiers[]))
ABSENT(fmi3GetIntervalFraction, (void *instance, const uint32_t references[], size_t count, uint64_t counters[],
                                 uint64_t resolutions[], int qualifiers[]))
ABSENT(fmi3GetShiftDecimal, (void *instance, const uint32_t references[], size_t count, double shifts[]))
ABSENT(fmi3GetShiftFraction, (void *instance, const uint32_t references[], size_t count, uint64_t counters[],
                              uint64_t resolutions[]))
ABSENT(fmi3SetIntervalDecimal, (void *instance, const uint32_t references[], size_t count, const double intervals[]))
ABSENT(fmi3SetIntervalFraction, (void *instance, const uint32_t references[], size_t count, const uint64_t counters[],
                                 const uint64_t resolutions[]))
ABSENT(fmi3SetShiftDecimal, (void *instance, const uint32_t references[], size_t count, const double shifts[]))
ABSENT(fmi3SetShiftFraction, (void *instance, const uint32_t references[], size_t count, const uint64_t counters[],
                              const uint64_t resolutions[]))
ABSENT(fmi3EvaluateDiscreteStates, (void *instance))

#include "fmi3_exchange.h"
