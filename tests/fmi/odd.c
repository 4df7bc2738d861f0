/* An FMU with what is allowed and rare: clocks that tell intervals and shifts as fractions, arrays that a structural parameter
   sizes, clocked ones too, an enumeration of large and negative numbers, a clocked string, the largest UInt64.

   It refuses, with a message, whatever the standard forbids. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { OK, ERROR = 3 };
enum { INSTANTIATED, CONFIGURING, INITIALIZING, EVENT, STEP };
enum { THIRD = 1, FAST, TRIGGER, SECOND, DOWN, CLOCKS, COUNT = 10, GIVEN, SUM, GEAR, GEAR_OUT, WORD, SAID, SHOWN, LARGE = 19, TICKS, TIME = 99 };
enum { MOST = 8 };

typedef void (*Logger)(void *, int, const char *, const char *);
typedef struct {
    void *environment;
    Logger log;
    int mode, told, ticks[CLOCKS];
    bool active[CLOCKS];
    double t;
    uint64_t count;
    float given[MOST], sum[MOST];
    int64_t gear, gear_out;
    char word[64], said[64];
} Model;

static int refuse(Model *m, const char *what)
{
    m->log(m->environment, ERROR, "logStatusError", what);
    return ERROR;
}

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging, bool events,
                                  bool early, const uint32_t *required, size_t n, void *environment, Logger log, void *update)
{
    Model *m = events ? calloc(1, sizeof(Model)) : NULL;
    if (!m) return NULL;
    m->environment = environment;
    m->log = log;
    m->count = 3;
    m->gear = m->gear_out = -5;
    for (int i = 0; i < MOST; i++) m->given[i] = 2.5f;
    return m;
}

void fmi3FreeInstance(Model *m) { free(m); }
int fmi3EnterConfigurationMode(Model *m) { m->mode = CONFIGURING; return OK; }
int fmi3ExitConfigurationMode(Model *m) { m->mode = INSTANTIATED; return OK; }
int fmi3EnterInitializationMode(Model *m, bool has, double tolerance, double t, bool has_stop, double stop) { m->mode = INITIALIZING; m->t = t; return OK; }
int fmi3ExitInitializationMode(Model *m) { m->mode = EVENT; return OK; }
int fmi3EnterEventMode(Model *m) { m->mode = EVENT; return OK; }
int fmi3EnterStepMode(Model *m) { m->mode = STEP; return OK; }
int fmi3Terminate(Model *m) { return OK; }

int fmi3SetClock(Model *m, const uint32_t vr[], size_t n, const bool v[])
{
    for (size_t i = 0; i < n; i++) {
        if (m->mode != EVENT || vr[i] == SECOND || m->active[vr[i]]) return refuse(m, "fmi3SetClock");
        m->active[vr[i]] = true;
        m->ticks[vr[i]]++;
        if (vr[i] != THIRD) continue;
        for (uint64_t k = 0; k < m->count; k++) m->sum[k] += m->given[k];
        m->active[SECOND] = m->ticks[THIRD] % 2 == 0;
        m->ticks[SECOND] += m->active[SECOND];
    }
    return OK;
}

int fmi3GetClock(Model *m, const uint32_t vr[], size_t n, bool v[])
{
    if (m->mode != EVENT) return refuse(m, "fmi3GetClock");
    for (size_t i = 0; i < n; i++) v[i] = m->active[vr[i]];
    return OK;
}

/* Every third of a second; a tenth after each such tick. */
int fmi3GetIntervalFraction(Model *m, const uint32_t vr[], size_t n, uint64_t counter[], uint64_t resolution[], int qualifier[])
{
    if (n != 1 || (vr[0] != THIRD && vr[0] != DOWN)) return refuse(m, "fmi3GetIntervalFraction");
    counter[0] = 1;
    resolution[0] = vr[0] == THIRD ? 3 : 10;
    qualifier[0] = vr[0] == THIRD || m->ticks[THIRD] > m->told ? 2 : m->told ? 1 : 0;
    if (vr[0] == DOWN) m->told = m->ticks[THIRD];
    return OK;
}

int fmi3GetShiftFraction(Model *m, const uint32_t vr[], size_t n, uint64_t counter[], uint64_t resolution[])
{
    if (m->mode != INITIALIZING || vr[0] != THIRD) return refuse(m, "fmi3GetShiftFraction");
    counter[0] = 1;
    resolution[0] = 7;
    return OK;
}

int fmi3UpdateDiscreteStates(Model *m, bool *needed, bool *terminate, bool *nominals, bool *values, bool *defined, double *next)
{
    *needed = *terminate = *nominals = *values = *defined = false;
    m->gear_out = m->gear;
    strcpy(m->said, m->word);
    memset(m->active, 0, sizeof m->active);
    return OK;
}

int fmi3DoStep(Model *m, double t, double h, bool no_return, bool *event, bool *terminate, bool *early, double *last)
{
    if (m->mode != STEP || fabs(t - m->t) > 1e-12) return refuse(m, "fmi3DoStep");
    *event = *terminate = *early = false;
    *last = m->t = t + h;
    return OK;
}

int fmi3SetUInt64(Model *m, const uint32_t vr[], size_t n, const uint64_t v[], size_t nv)
{
    if (m->mode != CONFIGURING || vr[0] != COUNT || v[0] > MOST) return refuse(m, "fmi3SetUInt64");
    m->count = v[0];
    return OK;
}

int fmi3GetUInt64(Model *m, const uint32_t vr[], size_t n, uint64_t v[], size_t nv)
{
    for (size_t i = 0; i < n; i++) v[i] = vr[i] == COUNT ? m->count : UINT64_MAX;
    return OK;
}

int fmi3SetFloat32(Model *m, const uint32_t vr[], size_t n, const float v[], size_t nv)
{
    if (m->mode == STEP || n != 1 || vr[0] != GIVEN || nv != m->count) return refuse(m, "fmi3SetFloat32");
    memcpy(m->given, v, nv * sizeof *v);
    return OK;
}

int fmi3GetFloat32(Model *m, const uint32_t vr[], size_t n, float v[], size_t nv)
{
    if (nv != n * m->count) return refuse(m, "fmi3GetFloat32: so many elements there are not");
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == SUM && m->mode >= EVENT && !m->active[THIRD]) return refuse(m, "fmi3GetFloat32: the clock does not tick");
        memcpy(v + i * m->count, vr[i] == SUM ? m->sum : m->given, m->count * sizeof *v);
    }
    return OK;
}

int fmi3GetFloat64(Model *m, const uint32_t vr[], size_t n, double v[], size_t nv)
{
    if (vr[0] == TIME) { v[0] = m->t; return OK; }
    for (size_t i = 0; i < nv; i++) v[i] = m->t * (double)(i + 1); /* two of each */
    return nv == 2 * m->count ? OK : refuse(m, "fmi3GetFloat64");
}

int fmi3SetInt64(Model *m, const uint32_t vr[], size_t n, const int64_t v[], size_t nv)
{
    if (v[0] != -5 && v[0] != 7 && v[0] != 1ll << 40) return refuse(m, "fmi3SetInt64: there is no such gear");
    m->gear = v[0];
    return OK;
}

int fmi3GetInt64(Model *m, const uint32_t vr[], size_t n, int64_t v[], size_t nv)
{
    for (size_t i = 0; i < n; i++) v[i] = vr[i] == GEAR ? m->gear : m->gear_out;
    return OK;
}

int fmi3GetInt32(Model *m, const uint32_t vr[], size_t n, int32_t v[], size_t nv)
{
    for (size_t i = 0; i < n; i++) v[i] = m->ticks[vr[i] - TICKS];
    return OK;
}

int fmi3SetString(Model *m, const uint32_t vr[], size_t n, const char *const v[], size_t nv)
{
    if (m->mode >= EVENT && !m->active[TRIGGER]) return refuse(m, "fmi3SetString: the clock does not tick");
    snprintf(m->word, sizeof m->word, "%s", v[0]);
    return OK;
}

int fmi3GetString(Model *m, const uint32_t vr[], size_t n, const char *v[], size_t nv)
{
    for (size_t i = 0; i < n; i++) v[i] = vr[i] == WORD ? m->word : m->said;
    return OK;
}

/* What the standard wants exported and this FMU does not have. */
#define ABSENT(name) int name(void) { return ERROR; }
void *fmi3InstantiateModelExchange(void) { return NULL; }
void *fmi3InstantiateScheduledExecution(void) { return NULL; }
ABSENT(fmi3SetDebugLogging) ABSENT(fmi3Reset) ABSENT(fmi3SetFloat64) ABSENT(fmi3GetInt8) ABSENT(fmi3GetUInt8)
ABSENT(fmi3GetInt16) ABSENT(fmi3GetUInt16) ABSENT(fmi3GetUInt32) ABSENT(fmi3GetBoolean) ABSENT(fmi3GetBinary)
ABSENT(fmi3SetInt8) ABSENT(fmi3SetUInt8) ABSENT(fmi3SetInt16) ABSENT(fmi3SetUInt16) ABSENT(fmi3SetInt32)
ABSENT(fmi3SetUInt32) ABSENT(fmi3SetBoolean) ABSENT(fmi3SetBinary) ABSENT(fmi3GetIntervalDecimal)
ABSENT(fmi3GetShiftDecimal) ABSENT(fmi3SetIntervalDecimal) ABSENT(fmi3SetIntervalFraction) ABSENT(fmi3SetShiftDecimal)
ABSENT(fmi3SetShiftFraction) ABSENT(fmi3EvaluateDiscreteStates) ABSENT(fmi3GetFMUState) ABSENT(fmi3SetFMUState)
ABSENT(fmi3FreeFMUState) ABSENT(fmi3SerializedFMUStateSize) ABSENT(fmi3SerializeFMUState) ABSENT(fmi3DeserializeFMUState)
ABSENT(fmi3GetDirectionalDerivative) ABSENT(fmi3GetAdjointDerivative) ABSENT(fmi3GetNumberOfVariableDependencies)
ABSENT(fmi3GetVariableDependencies) ABSENT(fmi3GetOutputDerivatives) ABSENT(fmi3ActivateModelPartition)
const char *fmi3GetVersion(void) { return "3.0"; }
