/* FMI 2.0 for Co-Simulation and Model Exchange, slave side. */

#define EVALUABLE (INITIALIZATION | EVENT | CONTINUOUS | TERMINATED | FAILED)
#define GETTABLE  (EVALUABLE | STEP | STEP_FAILED)
#define WRITABLE  (INSTANTIATED | INITIALIZATION | STEP | EVENT)
#define STATUS    (STEP | STEP_FAILED | TERMINATED)
#define ALIVE     (ANY & ~DEAD)

/* sections 3.2.3 and 4.2.4 of the standard; fmi2FreeInstance is allowed after a fatal error too, or its place would be lost */
#define FUNCTIONS(X) \
    X(fmi2SetDebugLogging,               ALL, ALIVE,                                        0)             \
    X(fmi2FreeInstance,                  ALL, ANY,                                          0)             \
    X(fmi2SetupExperiment,               ALL, INSTANTIATED,                                 0)             \
    X(fmi2EnterInitializationMode,       ALL, INSTANTIATED,                                 0)             \
    X(fmi2ExitInitializationMode,        ALL, INITIALIZATION,                               0)             \
    X(fmi2Terminate,                     ALL, EVENT | CONTINUOUS | STEP | STEP_FAILED,      0)             \
    X(fmi2Reset,                         ALL, ALIVE,                                        0)             \
    X(fmi2GetReal,                       ALL, GETTABLE,                                     FLOAT64)       \
    X(fmi2GetInteger,                    ALL, GETTABLE,                                     INT32 | INT64) \
    X(fmi2GetBoolean,                    ALL, GETTABLE,                                     BOOLEAN)       \
    X(fmi2GetString,                     ALL, GETTABLE,                                     NO_TYPE)       \
    X(fmi2SetReal,                       ALL, WRITABLE | CONTINUOUS,                        FLOAT64)       \
    X(fmi2SetInteger,                    ALL, WRITABLE,                                     INT32 | INT64) \
    X(fmi2SetBoolean,                    ALL, WRITABLE,                                     BOOLEAN)       \
    X(fmi2SetString,                     ALL, WRITABLE,                                     NO_TYPE)       \
    X(fmi2GetFMUstate,                   ALL, ALIVE,                                        0)             \
    X(fmi2SetFMUstate,                   ALL, ALIVE,                                        0)             \
    X(fmi2FreeFMUstate,                  ALL, ALIVE,                                        0)             \
    X(fmi2SerializedFMUstateSize,        ALL, ALIVE,                                        0)             \
    X(fmi2SerializeFMUstate,             ALL, ALIVE,                                        0)             \
    X(fmi2DeSerializeFMUstate,           ALL, ALIVE,                                        0)             \
    X(fmi2DoStep,                        CS,  STEP,                                         0)             \
    X(fmi2GetStatus,                     CS,  STATUS,                                       0)             \
    X(fmi2GetRealStatus,                 CS,  STATUS,                                       0)             \
    X(fmi2GetIntegerStatus,              CS,  STATUS,                                       0)             \
    X(fmi2GetBooleanStatus,              CS,  STATUS,                                       0)             \
    X(fmi2GetStringStatus,               CS,  STATUS,                                       0)             \
    X(fmi2CancelStep,                    CS,  0,                                            0)             \
    X(fmi2SetRealInputDerivatives,       CS,  0,                                            0)             \
    X(fmi2GetRealOutputDerivatives,      CS,  0,                                            0)             \
    X(fmi2GetDirectionalDerivative,      ALL, GETTABLE,                                     FLOAT64)       \
    X(fmi2EnterEventMode,                ME,  EVENT | CONTINUOUS,                           0)             \
    X(fmi2NewDiscreteStates,             ME,  EVENT,                                        0)             \
    X(fmi2EnterContinuousTimeMode,       ME,  EVENT,                                        0)             \
    X(fmi2CompletedIntegratorStep,       ME,  CONTINUOUS,                                   0)             \
    X(fmi2SetTime,                       ME,  EVENT | CONTINUOUS,                           0)             \
    X(fmi2SetContinuousStates,           ME,  CONTINUOUS,                                   0)             \
    X(fmi2GetDerivatives,                ME,  EVALUABLE & ~INITIALIZATION,                  0)             \
    X(fmi2GetEventIndicators,            ME,  EVALUABLE,                                    0)             \
    X(fmi2GetContinuousStates,           ME,  EVALUABLE,                                    0)             \
    X(fmi2GetNominalsOfContinuousStates, ME,  INSTANTIATED | (EVALUABLE & ~INITIALIZATION), 0)

#include "core.h"

typedef void (*Logger)(void *environment, const char *instance, int status, const char *category, const char *message, ...);

typedef struct {
    Logger logger;
    void  *(*allocate_memory)(size_t count, size_t size);
    void   (*free_memory)(void *memory);
    void   (*step_finished)(void *environment, int status);
    void  *environment;
} Callbacks;

static void send(const Sink *sink, int status, const char *category, const char *text)
{
    ((Logger)sink->logger)(sink->environment, sink->name, status, category, text);
}

EXPORTED(const char *, fmi2GetTypesPlatform, (void)) { return "default"; }
EXPORTED(const char *, fmi2GetVersion, (void)) { return "2.0"; }

EXPORTED(void *, fmi2Instantiate, (const char *name, int type, const char *guid, const char *resources,
                                   const Callbacks *callbacks, int visible, int logging))
{
    Sink sink = {NULL, NULL, name ? name : model.name, 0};
    if (callbacks) sink.logger = (Function)callbacks->logger, sink.environment = callbacks->environment;
    return instantiate(sink, type == 1 ? CS : ME, guid, logging);
}

EXPORTED(void, fmi2FreeInstance, (void *instance))
{
    Slot *me = enter(instance, fmi2FreeInstance_number);
    if (me) release(me);
}

EXPORTED(int, fmi2SetDebugLogging, (void *instance, int on, size_t count, const char *const names[]))
{
    ENTER(fmi2SetDebugLogging);
    return set_logging(me, on, count, names);
}

EXPORTED(int, fmi2SetupExperiment, (void *instance, int tolerance_defined, double tolerance_, double start_time,
                                    int stop_defined, double stop_time))
{
    ENTER(fmi2SetupExperiment);
    return define_experiment(me, start_time, stop_defined, stop_time) ? OK : ERROR;
}

EXPORTED(int, fmi2EnterInitializationMode, (void *instance))
{
    ENTER(fmi2EnterInitializationMode);
    return enter_initialization(me);
}

EXPORTED(int, fmi2ExitInitializationMode, (void *instance))
{
    ENTER(fmi2ExitInitializationMode);
    return exit_initialization(me);
}

EXPORTED(int, fmi2Terminate, (void *instance))
{
    ENTER(fmi2Terminate);
    return terminate(me);
}

EXPORTED(int, fmi2Reset, (void *instance))
{
    ENTER(fmi2Reset);
    start(me);
    return OK;
}

EXPORTED(int, fmi2DoStep, (void *instance, double t, double h, int no_rollback))
{
    ENTER(fmi2DoStep);
    return advance(me, t, h);
}

/* ------------------------------------------------------------------------------------------------------ variables */

EXPORTED(int, fmi2GetReal, (void *instance, const uint32_t references[], size_t count, double values[]))
{
    Slot *me = reading(instance, fmi2GetReal_number, references, count, values, count);
    if (!me) return ERROR;
    for (size_t i = 0; i < count; i++)
        values[i] = *(const double *)place_of(&me->memory, model.fields[references[i]].offset);
    return OK;
}

EXPORTED(int, fmi2SetReal, (void *instance, const uint32_t references[], size_t count, const double values[]))
{
    Slot *me = writing(instance, fmi2SetReal_number, references, count, values, count);
    if (!me) return ERROR;
    for (size_t i = 0; i < count; i++)
        *(double *)place_of(&me->memory, model.fields[references[i]].offset) = values[i];
    return OK;
}

EXPORTED(int, fmi2GetInteger, (void *instance, const uint32_t references[], size_t count, int values[]))
{
    Slot *me = reading(instance, fmi2GetInteger_number, references, count, values, count);
    if (!me) return ERROR;
    for (size_t i = 0; i < count; i++) {
        const Field *field = &model.fields[references[i]];
        const void *from = place_of(&me->memory, field->offset);
        int64_t value = field->type == INT64 ? *(const int64_t *)from : *(const int32_t *)from;
        values[i] = (int)value;
        if (value != values[i]) {
            say(&me->sink, ERROR, "%s is %i, which does not fit the 32 bits of FMI 2.0. Use FMI 3.0.", field->name, value);
            return ERROR;
        }
    }
    return OK;
}

EXPORTED(int, fmi2SetInteger, (void *instance, const uint32_t references[], size_t count, const int values[]))
{
    Slot *me = writing(instance, fmi2SetInteger_number, references, count, values, count);
    if (!me) return ERROR;
    for (size_t i = 0; i < count; i++) {
        const Field *field = &model.fields[references[i]];
        void *to = place_of(&me->memory, field->offset);
        if (field->type == INT64) *(int64_t *)to = values[i];
        else *(int32_t *)to = values[i];
    }
    return OK;
}

EXPORTED(int, fmi2GetBoolean, (void *instance, const uint32_t references[], size_t count, int values[]))
{
    Slot *me = reading(instance, fmi2GetBoolean_number, references, count, values, count);
    if (!me) return ERROR;
    for (size_t i = 0; i < count; i++)
        values[i] = *(const unsigned char *)place_of(&me->memory, model.fields[references[i]].offset) != 0;
    return OK;
}

EXPORTED(int, fmi2SetBoolean, (void *instance, const uint32_t references[], size_t count, const int values[]))
{
    Slot *me = writing(instance, fmi2SetBoolean_number, references, count, values, count);
    if (!me) return ERROR;
    for (size_t i = 0; i < count; i++)
        *(unsigned char *)place_of(&me->memory, model.fields[references[i]].offset) = values[i] != 0;
    return OK;
}

EXPORTED(int, fmi2GetString, (void *instance, const uint32_t references[], size_t count, const char *values[]))
{
    return get_none(instance, fmi2GetString_number, references, count, values, count);
}

EXPORTED(int, fmi2SetString, (void *instance, const uint32_t references[], size_t count, const char *const values[]))
{
    return set_none(instance, fmi2SetString_number, references, count, values, count);
}

/* --------------------------------------------------------------------------------------------------- saved states */

EXPORTED(int, fmi2GetFMUstate, (void *instance, void **state))
{
    ENTER(fmi2GetFMUstate);
    return save(me, state);
}

EXPORTED(int, fmi2SetFMUstate, (void *instance, void *state))
{
    ENTER(fmi2SetFMUstate);
    return restore(me, state);
}

EXPORTED(int, fmi2FreeFMUstate, (void *instance, void **state))
{
    ENTER(fmi2FreeFMUstate);
    return drop(me, state);
}

EXPORTED(int, fmi2SerializedFMUstateSize, (void *instance, void *state, size_t *size))
{
    ENTER(fmi2SerializedFMUstateSize);
    return serialized_size(me, state, size);
}

EXPORTED(int, fmi2SerializeFMUstate, (void *instance, void *state, char bytes[], size_t size))
{
    ENTER(fmi2SerializeFMUstate);
    return serialize(me, state, bytes, size);
}

EXPORTED(int, fmi2DeSerializeFMUstate, (void *instance, const char bytes[], size_t size, void **state))
{
    ENTER(fmi2DeSerializeFMUstate);
    return deserialize(me, bytes, size, state);
}

/* ---------------------------------------------------------------------------------------------- status of a step */

enum { DO_STEP_STATUS, PENDING_STATUS, LAST_SUCCESSFUL_TIME, TERMINATED_STATUS };

/* FMI's answer to a question that has no answer here: nothing runs asynchronously. */
static int unknown(Slot *me, int function, int kind)
{
    say(&me->sink, DISCARD, "%s: status kind %i is not available.", LEGAL[function].name, (int64_t)kind);
    return DISCARD;
}

#define STATUS_FUNCTION(Name, type, kind, answer)                                         \
    EXPORTED(int, fmi2Get##Name, (void *instance, int asked, type *value))                \
    {                                                                                     \
        ENTER(fmi2Get##Name);                                                             \
        if (asked != (kind) || !value) return unknown(me, fmi2Get##Name##_number, asked); \
        *value = (answer);                                                                \
        return OK;                                                                        \
    }
STATUS_FUNCTION(Status, int, DO_STEP_STATUS, me->memory.mode == STEP_FAILED ? DISCARD : OK)
STATUS_FUNCTION(RealStatus, double, LAST_SUCCESSFUL_TIME, me->memory.time)
STATUS_FUNCTION(BooleanStatus, int, TERMINATED_STATUS, 0)
STATUS_FUNCTION(IntegerStatus, int, -1, 0)
STATUS_FUNCTION(StringStatus, const char *, PENDING_STATUS, "")

/* ------------------------------------------------------------------------------------------- interfaces not offered */

EXPORTED(int, fmi2CancelStep, (void *instance)) { return absent(instance, fmi2CancelStep_number); }

EXPORTED(int, fmi2SetRealInputDerivatives, (void *instance, const uint32_t references[], size_t count, const int orders[],
                                            const double values[]))
{
    return absent(instance, fmi2SetRealInputDerivatives_number);
}

EXPORTED(int, fmi2GetRealOutputDerivatives, (void *instance, const uint32_t references[], size_t count,
                                             const int orders[], double values[]))
{
    return absent(instance, fmi2GetRealOutputDerivatives_number);
}

#include "fmi2_exchange.h"
