/* Small FMUs of FMI 3.0 with clocks, strict about what the standard forbids. The last digit of the token says which it is:
   Kinds: one clock of every kind, Co-Simulation; Follower: a triggered clock that sums what it is given, Co-Simulation;
   Partitions: three model partitions and an output clock, Scheduled Execution;
   Node: sends a message with a clock when it is time, and takes others, as in FMI-LS-BUS. */

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { KINDS, FOLLOWER, PARTITIONS, NODE };
enum { INSTANTIATED, INITIALIZING, EVENT, STEP, ACTIVATING };
enum { CLOCKS = 16, NUMBERS = 64 };
enum { OK = 0, ERROR = 3 };

/* clocks of Kinds have the references 1 to 9, of Follower 1 and 2, of Partitions 1 to 4; the others begin at 10 */
enum { CONSTANT = 1, FIXED, TUNABLE, PACED, CHANGING, COUNTDOWN, TRIGGERED, EVERY_SECOND, ALARM };
enum { TICK = 1, HALF = 2 };
enum { FIRST = 1, SECOND, THIRD, FIFTH };
enum { SEND = 1, SENT, TAKE, MESSAGE = 11, TAKEN, HEARD, WORD, ADDRESS = 20, LAST, ANNOUNCED };
enum { COUNT = 10, LATEST = 20, PERIOD = 30, PACE, SIGNAL_AT, WAIT, X = 40, U, D, SEEN, LAG, SIGNALLED };
enum { IN = 11, SUM, N, PLAIN, BIAS };
enum { TICKS = 10, TOTAL = 14, RESULT, INPUT, OUTPUT };

typedef void (*Logger)(void *, int, const char *, const char *);

typedef struct {
    int model, mode;
    double t, number[NUMBERS], interval[CLOCKS];
    uint8_t message[8], taken[8];
    size_t length;
    int64_t whole[NUMBERS];
    bool active[CLOCKS], known[CLOCKS], fresh[CLOCKS], signalled, was_signalled, may_return;
    void *environment;
    Logger log;
    void (*update)(void *);
    void (*lock)(void), (*unlock)(void);
} Model;

static int refuse(Model *m, const char *what)
{
    m->log(m->environment, ERROR, "logStatusError", what);
    return ERROR;
}

#define MODEL m->model

static bool is_clocked(const Model *m, uint32_t vr, uint32_t *clock)
{
    *clock = 0;
    if (MODEL == KINDS && vr > COUNT && vr <= COUNT + ALARM) *clock = vr - COUNT;
    if (MODEL == KINDS && vr == LATEST) *clock = COUNTDOWN;
    if (MODEL == FOLLOWER && vr >= IN && vr <= N) *clock = TICK;
    if (MODEL == PARTITIONS && vr > TICKS && vr <= TICKS + THIRD) *clock = vr - TICKS;
    if (MODEL == PARTITIONS && (vr == RESULT || vr == INPUT)) *clock = SECOND;
    if (MODEL == PARTITIONS && vr == OUTPUT) *clock = THIRD;
    if (MODEL == NODE && vr == MESSAGE) *clock = SENT;
    if (MODEL == NODE && (vr == TAKEN || vr == HEARD || vr == WORD)) *clock = TAKE;
    return *clock != 0;
}

/* A clocked variable exists only while its clock ticks. */
static bool may(const Model *m, uint32_t vr)
{
    uint32_t clock;
    return !is_clocked(m, vr, &clock) || m->mode < EVENT || (m->active[clock] && (m->mode == EVENT || m->mode == ACTIVATING));
}

static void tell(Model *m, int clock, double interval)
{
    m->interval[clock] = interval;
    m->known[clock] = m->fresh[clock] = true;
}

void *make(const char *token, void *environment, Logger log)
{
    if (strncmp(token, "clocks", 6)) return NULL;
    Model *m = calloc(1, sizeof(Model));
    m->model = token[6] - '0';
    m->environment = environment;
    m->log = log;
    m->number[PERIOD] = 0.25;
    m->number[PACE] = 0.4;
    m->number[SIGNAL_AT] = 1e9;
    m->number[WAIT] = 0.3;
    m->interval[TUNABLE] = 0.5;
    return m;
}

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                  bool events, bool early, const uint32_t *required, size_t n, void *environment,
                                  Logger log, void *update)
{
    Model *m = events ? make(token, environment, log) : NULL;
    if (m) m->may_return = early;
    if (events) return m;
    log(environment, ERROR, "logStatusError", "clocks need Event Mode");
    return NULL;
}

void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                   void *environment, Logger log)
{
    return make(token, environment, log);
}

/* Model Exchange, without states: Continuous-Time Mode is here as Step Mode. */
int fmi3SetTime(Model *m, double t) { m->t = t; m->number[X] = t + m->number[U]; return OK; }
int fmi3GetNumberOfContinuousStates(Model *m, size_t *n) { *n = 0; return OK; }
int fmi3GetNumberOfEventIndicators(Model *m, size_t *n) { *n = 0; return OK; }
int fmi3CompletedIntegratorStep(Model *m, bool no_return, bool *event, bool *terminate) { *event = *terminate = false; return OK; }
int fmi3EnterContinuousTimeMode(Model *m)
{
    if (m->mode != EVENT) return refuse(m, "fmi3EnterContinuousTimeMode outside of Event Mode");
    m->mode = STEP;
    return OK;
}

void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources, bool visible,
                                        bool logging, void *environment, Logger log, void (*update)(void *),
                                        void (*lock)(void), void (*unlock)(void))
{
    Model *m = make(token, environment, log);
    if (m) { m->update = update; m->lock = lock; m->unlock = unlock; }
    return m;
}

void fmi3FreeInstance(Model *m) { free(m); }

int fmi3EnterInitializationMode(Model *m, bool has_tolerance, double tolerance, double t, bool has_stop, double stop)
{
    m->mode = INITIALIZING;
    m->t = t;
    if (MODEL == KINDS) {
        tell(m, FIXED, m->number[PERIOD]);
        tell(m, PACED, m->number[PACE]);
        tell(m, CHANGING, 0.1);
    }
    return OK;
}

int fmi3ExitInitializationMode(Model *m)
{
    if (MODEL == NODE) m->number[ANNOUNCED] = 0.35;
    m->mode = MODEL == PARTITIONS ? ACTIVATING : EVENT;
    return OK;
}

int fmi3EnterEventMode(Model *m)
{
    if (m->mode != STEP) return refuse(m, "fmi3EnterEventMode outside of Step Mode");
    m->mode = EVENT;
    m->active[ALARM] = MODEL == KINDS && m->signalled;
    if (m->active[ALARM]) { m->whole[COUNT + ALARM]++; m->number[SIGNALLED] = m->t; }
    m->signalled = false;
    return OK;
}

int fmi3EnterStepMode(Model *m)
{
    if (m->mode != EVENT) return refuse(m, "fmi3EnterStepMode outside of Event Mode");
    m->mode = STEP;
    return OK;
}

int fmi3Terminate(Model *m) { return OK; }

int fmi3SetClock(Model *m, const uint32_t vr[], size_t n, const bool v[])
{
    if (m->mode != EVENT) return refuse(m, "fmi3SetClock outside of Event Mode");
    for (size_t i = 0; i < n; i++) {
        if (vr[i] > TRIGGERED || m->active[vr[i]]) return refuse(m, "a clock is set that ticks already, or not an input");
        m->active[vr[i]] = v[i];
        if (MODEL == KINDS) m->whole[COUNT + vr[i]]++;
        if (MODEL == KINDS && vr[i] == CONSTANT && m->whole[COUNT + CONSTANT] % 2 == 0) {
            m->active[EVERY_SECOND] = true;
            m->whole[COUNT + EVERY_SECOND]++;
        }
        if (MODEL == KINDS && vr[i] == COUNTDOWN) { m->number[LATEST] = m->t; m->known[COUNTDOWN] = false; }
        if (MODEL == NODE && vr[i] == SEND) {
            m->message[0] = (uint8_t)m->whole[ADDRESS];
            m->message[1]++;
            m->active[SENT] = true;
        }
        if (MODEL == NODE && vr[i] == TAKE) m->whole[HEARD]++;
        if (MODEL == FOLLOWER && vr[i] == TICK) {
            m->whole[N]++;
            m->active[HALF] = m->whole[N] % 2 == 0;
        }
    }
    return OK;
}

/* The state of a clock of the FMU's own is told once. */
int fmi3GetClock(Model *m, const uint32_t vr[], size_t n, bool v[])
{
    if (m->mode != EVENT && m->mode != ACTIVATING) return refuse(m, "fmi3GetClock outside of Event Mode");
    for (size_t i = 0; i < n; i++) {
        v[i] = m->active[vr[i]];
        if (m->mode == ACTIVATING) m->active[vr[i]] = false;
    }
    return OK;
}

/* The messages of a node are one third of a second apart: its address, then how many there were. */
int fmi3GetIntervalFraction(Model *m, const uint32_t vr[], size_t n, uint64_t counter[], uint64_t resolution[], int qualifier[])
{
    if (MODEL != NODE || vr[0] != SEND || m->mode == STEP) return refuse(m, "fmi3GetIntervalFraction");
    counter[0] = 1;
    resolution[0] = 3;
    qualifier[0] = 2;
    return OK;
}

int fmi3GetBinary(Model *m, const uint32_t vr[], size_t n, size_t sizes[], const uint8_t *v[], size_t nv)
{
    if (!may(m, vr[0]) || (m->whole[ADDRESS] < 0 && m->t > 0)) return refuse(m, "a message is read that is not sent");
    sizes[0] = 2;
    v[0] = m->message;
    return OK;
}

int fmi3SetBinary(Model *m, const uint32_t vr[], size_t n, const size_t sizes[], const uint8_t *const v[], size_t nv)
{
    if (!may(m, vr[0])) return refuse(m, "a message is given while its clock does not tick");
    m->length = sizes[0];
    if (sizes[0] <= sizeof m->taken) memcpy(m->taken, v[0], sizes[0]);
    return OK;
}

int fmi3GetIntervalDecimal(Model *m, const uint32_t vr[], size_t n, double interval[], int qualifier[])
{
    if (m->mode == STEP) return refuse(m, "fmi3GetIntervalDecimal in Step Mode");
    for (size_t i = 0; i < n; i++) {
        interval[i] = m->interval[vr[i]];
        qualifier[i] = !m->known[vr[i]] ? 0 : m->fresh[vr[i]] ? 2 : 1;
        m->fresh[vr[i]] = false;
    }
    return OK;
}

int fmi3GetShiftDecimal(Model *m, const uint32_t vr[], size_t n, double shift[])
{
    if (m->mode != INITIALIZING) return refuse(m, "fmi3GetShiftDecimal outside of Initialization Mode");
    for (size_t i = 0; i < n; i++) shift[i] = vr[i] == FIXED ? 0.05 : 0.0;
    return OK;
}

int fmi3SetIntervalDecimal(Model *m, const uint32_t vr[], size_t n, const double interval[])
{
    if (m->mode != INITIALIZING && m->mode != EVENT) return refuse(m, "fmi3SetIntervalDecimal in Step Mode");
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != TUNABLE) return refuse(m, "the interval is not the importer's to choose");
        m->interval[vr[i]] = interval[i];
    }
    return OK;
}

int fmi3UpdateDiscreteStates(Model *m, bool *needed, bool *terminate, bool *nominals, bool *values, bool *defined, double *next)
{
    if (m->mode != EVENT) return refuse(m, "fmi3UpdateDiscreteStates outside of Event Mode");
    *needed = *terminate = *nominals = *values = *defined = false;
    if (MODEL == KINDS) {
        if (m->active[CONSTANT] && m->whole[COUNT + CONSTANT] % 3 == 0) tell(m, COUNTDOWN, m->number[WAIT]);
        if (m->active[COUNTDOWN] && m->number[WAIT] == 0) tell(m, COUNTDOWN, 0);
        if (m->active[CHANGING]) tell(m, CHANGING, 0.1 * (double)(m->whole[COUNT + CHANGING] + 1));
        if (m->number[PACE] != m->interval[PACED]) tell(m, PACED, m->number[PACE]);
        if (m->whole[SEEN] != m->whole[D]) { m->whole[SEEN] = m->whole[D]; *needed = true; }
    }
    if (MODEL == FOLLOWER && m->active[TICK]) { m->number[SUM] += m->number[IN]; m->number[PLAIN] = m->number[SUM]; }
    if (MODEL == NODE) {
        *defined = m->t < m->number[ANNOUNCED] - 1e-12;
        *next = m->number[ANNOUNCED];
        if (!*defined && !m->was_signalled) { m->was_signalled = true; m->number[SIGNALLED] = m->t; }
        *terminate = m->t >= m->number[LAST] && m->number[LAST] > 0;
    }
    memset(m->active, 0, sizeof m->active);
    return OK;
}

int fmi3DoStep(Model *m, double t, double h, bool no_return, bool *event, bool *terminate, bool *early, double *last)
{
    if (m->mode != STEP) return refuse(m, "fmi3DoStep outside of Step Mode");
    *event = *terminate = *early = false;
    *early = MODEL == KINDS && m->may_return && !m->was_signalled && m->number[SIGNAL_AT] < t + h;
    *last = m->t = *early ? m->number[SIGNAL_AT] : t + h;
    m->number[X] = m->t + m->number[U];
    if (MODEL == KINDS && m->t >= m->number[SIGNAL_AT] && !m->was_signalled) m->was_signalled = m->signalled = *event = true;
    return OK;
}

#define GET(Type, type, array)                                                                                          \
    int fmi3Get##Type(Model *m, const uint32_t vr[], size_t n, type v[], size_t nv)                                     \
    {                                                                                                                   \
        for (size_t i = 0; i < n; i++) {                                                                                \
            if (!may(m, vr[i])) return refuse(m, "a clocked variable is read while no clock of it ticks");              \
            v[i] = (type)m->array[vr[i]];                                                                               \
            if (MODEL == NODE && vr[i] == WORD) v[i] = (type)(256 * m->taken[0] + m->taken[1]);                         \
            if (MODEL == FOLLOWER && vr[i] == SUM && m->mode == EVENT) v[i] += (type)(m->number[IN] + m->number[BIAS]);                     \
        }                                                                                                               \
        return OK;                                                                                                      \
    }

#define SET(Type, type, array)                                                                                          \
    int fmi3Set##Type(Model *m, const uint32_t vr[], size_t n, const type v[], size_t nv)                               \
    {                                                                                                                   \
        for (size_t i = 0; i < n; i++) {                                                                                \
            bool is_continuous = MODEL == KINDS && vr[i] == U;                                                          \
            if (MODEL != PARTITIONS && m->mode == STEP && !is_continuous) return refuse(m, "a discrete variable is set in Step Mode"); \
            if (MODEL != PARTITIONS && !may(m, vr[i])) return refuse(m, "a clocked input is set while its clock does not tick"); \
            m->array[vr[i]] = v[i];                                                                                     \
        }                                                                                                               \
        return OK;                                                                                                      \
    }

GET(Float64, double, number)
SET(Float64, double, number)
GET(Int32, int32_t, whole)
SET(Int32, int32_t, whole)

/* The first partition lets the third tick 0 s after t = 4; the third gives what the second adds up; every fifth tick of any
   of them is one of the output clock. */
int fmi3ActivateModelPartition(Model *m, uint32_t clock, double t)
{
    if (m->mode != ACTIVATING || clock > THIRD) return refuse(m, "there is no such partition");
    m->lock();
    memset(m->active, 0, sizeof m->active);
    m->active[clock] = true;
    m->whole[TICKS + clock]++;
    m->whole[TOTAL]++;
    m->number[LAG] = 100 * m->number[LAG] + clock;
    if (clock == FIRST && t == 4) tell(m, THIRD, 0);
    if (clock == SECOND) m->whole[RESULT] += m->whole[INPUT];
    if (clock == THIRD) m->whole[OUTPUT] = 1000;
    m->active[FIFTH] = m->whole[TOTAL] % 5 == 0;
    m->unlock();
    if (m->active[FIFTH] || m->fresh[THIRD]) m->update(m->environment);
    return OK;
}

int fmi3GetFMUState(Model *m, void **state)
{
    if (!*state) *state = malloc(sizeof *m);
    memcpy(*state, m, sizeof *m);
    return OK;
}

int fmi3SetFMUState(Model *m, void *state) { memcpy(m, state, sizeof *m); return OK; }
int fmi3FreeFMUState(Model *m, void **state) { free(*state); *state = NULL; return OK; }

/* What the standard wants exported and these FMUs do not have. */
#define ABSENT(name) int name(void) { return ERROR; }
ABSENT(fmi3SetDebugLogging) ABSENT(fmi3Reset)
ABSENT(fmi3GetFloat32) ABSENT(fmi3GetInt8) ABSENT(fmi3GetUInt8) ABSENT(fmi3GetInt16) ABSENT(fmi3GetUInt16)
ABSENT(fmi3GetUInt32) ABSENT(fmi3GetInt64) ABSENT(fmi3GetUInt64) ABSENT(fmi3GetBoolean) ABSENT(fmi3GetString)
ABSENT(fmi3SetFloat32) ABSENT(fmi3SetInt8) ABSENT(fmi3SetUInt8) ABSENT(fmi3SetInt16) ABSENT(fmi3SetUInt16)
ABSENT(fmi3SetUInt32) ABSENT(fmi3SetInt64) ABSENT(fmi3SetUInt64) ABSENT(fmi3SetBoolean) ABSENT(fmi3SetString)
ABSENT(fmi3GetNumberOfVariableDependencies) ABSENT(fmi3GetVariableDependencies)
ABSENT(fmi3SerializedFMUStateSize) ABSENT(fmi3SerializeFMUState) ABSENT(fmi3DeserializeFMUState)
ABSENT(fmi3GetDirectionalDerivative) ABSENT(fmi3GetAdjointDerivative)
ABSENT(fmi3EnterConfigurationMode) ABSENT(fmi3ExitConfigurationMode)
ABSENT(fmi3GetShiftFraction) ABSENT(fmi3SetIntervalFraction) ABSENT(fmi3SetShiftDecimal) ABSENT(fmi3SetShiftFraction)
ABSENT(fmi3EvaluateDiscreteStates) ABSENT(fmi3GetOutputDerivatives)
ABSENT(fmi3SetContinuousStates) ABSENT(fmi3GetContinuousStateDerivatives) ABSENT(fmi3GetEventIndicators)
ABSENT(fmi3GetContinuousStates) ABSENT(fmi3GetNominalsOfContinuousStates)
const char *fmi3GetVersion(void) { return "3.0"; }
