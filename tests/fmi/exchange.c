/* Small FMUs for Model Exchange with events, of FMI 2.0 and 3.0 in one library. A model is what -DMODEL=... names:
   Ball: falls and bounces (state events); Stair: counts seconds and ends (time events), without states;
   Relay: switches with its input when a step of the solver has ended (step events), and a lag that follows it. */

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { BALL, STAIR, RELAY };
enum { REALS = 8, WHOLES = 4, TRUTHS = 4 };

typedef struct {
    double t, real[REALS], due;
    int32_t whole[WHOLES];
    bool truth[TRUTHS], terminate, is_due, in_event_mode;
} Model;

/* value references: states first, then their derivatives; whole numbers and Booleans are counted from 100 and 200 */
enum { HEIGHT, SPEED, DER_HEIGHT, DER_SPEED, GRAVITY, RESTITUTION };
enum { LAG = 0, DER_LAG = 1, INPUT = 2, LEVEL = 3, TIME_CONSTANT = 4 };

static const int STATES[] = {2, 0, 1}, INDICATORS[] = {1, 0, 0};

static void start(Model *m)
{
    if (MODEL == BALL) { m->real[HEIGHT] = 1; m->real[GRAVITY] = -9.81; m->real[RESTITUTION] = 0.7; }
    if (MODEL == RELAY) { m->real[LEVEL] = 0.5; m->real[TIME_CONSTANT] = 0.1; }
}

static void evaluate(Model *m)
{
    if (MODEL == BALL) { m->real[DER_HEIGHT] = m->real[SPEED]; m->real[DER_SPEED] = m->real[GRAVITY]; }
    if (MODEL == RELAY) m->real[DER_LAG] = ((m->truth[0] ? 1 : 0) - m->real[LAG]) / m->real[TIME_CONSTANT];
}

static bool update(Model *m)
{
    if (MODEL == BALL && m->real[HEIGHT] <= 0 && m->real[SPEED] < 0) {
        m->real[HEIGHT] = 2.2250738585072014e-308;
        m->real[SPEED] = -m->real[RESTITUTION] * m->real[SPEED];
        m->whole[0]++;
    }
    if (MODEL == STAIR) {
        if (m->is_due && m->t >= m->due) m->whole[0]++;
        m->is_due = true;
        m->due = m->whole[0] + 1;
        m->terminate = m->whole[0] >= 5;
    }
    if (MODEL == RELAY) m->truth[0] = m->real[INPUT] > m->real[LEVEL];
    return false;
}

static bool wants_event(const Model *m) { return MODEL == RELAY && m->truth[0] != (m->real[INPUT] > m->real[LEVEL]); }

static int move(double *to, const double *from, size_t n) { memcpy(to, from, n * sizeof(double)); return 0; }

/* In Continuous-Time Mode nothing but continuous inputs may be set. */
static bool may_set(const Model *m, uint32_t reference) { return m->in_event_mode || (MODEL == RELAY && reference == INPUT); }

#define SHARED(V, Derivatives)                                                                                    \
    int V##SetTime(Model *m, double t) { m->t = t; return 0; }                                                       \
    int V##EnterEventMode(Model *m) { m->in_event_mode = true; return 0; }                                           \
    int V##EnterContinuousTimeMode(Model *m) { m->in_event_mode = false; return 0; }                                 \
    int V##ExitInitializationMode(Model *m) { return 0; }                                                            \
    int V##Terminate(Model *m) { return 0; }                                                                         \
    void V##FreeInstance(Model *m) { free(m); }                                                                      \
    int V##SetContinuousStates(Model *m, const double x[], size_t n) { return move(m->real, x, n); }                 \
    int V##GetContinuousStates(Model *m, double x[], size_t n) { return move(x, m->real, n); }                       \
    int V##Derivatives(Model *m, double x[], size_t n) { evaluate(m); return move(x, m->real + n, n); }              \
    int V##GetEventIndicators(Model *m, double z[], size_t n) { return move(z, m->real + HEIGHT, n); }               \
    int V##GetNominalsOfContinuousStates(Model *m, double x[], size_t n)                                             \
    {                                                                                                                \
        for (size_t i = 0; i < n; i++) x[i] = 1;                                                                     \
        return 0;                                                                                                    \
    }

#define ACCESS(V, Type, type, array, base, ...)                                                                      \
    int V##Get##Type(Model *m, const uint32_t vr[], size_t n, type v[] __VA_ARGS__)                                  \
    {                                                                                                                \
        evaluate(m);                                                                                                 \
        for (size_t i = 0; i < n; i++) v[i] = m->array[vr[i] - base];                                                \
        return 0;                                                                                                    \
    }                                                                                                                \
    int V##Set##Type(Model *m, const uint32_t vr[], size_t n, const type v[] __VA_ARGS__)                            \
    {                                                                                                                \
        for (size_t i = 0; i < n; i++) {                                                                             \
            if (!may_set(m, vr[i])) return 3;                                                                        \
            m->array[vr[i] - base] = v[i];                                                                           \
        }                                                                                                            \
        return 0;                                                                                                    \
    }

static Model *made(void)
{
    Model *m = calloc(1, sizeof(Model));
    m->in_event_mode = true;
    start(m);
    return m;
}

/* A finite difference of the equations, as some tools export it: the model stays at the point that was tried last, with
   another time and another state. */
static int difference(Model *m, const uint32_t unknown[], size_t n, const uint32_t known[], size_t k, const double seed[], double out[])
{
    double before[REALS];
    evaluate(m);
    memcpy(before, m->real, sizeof before);
    for (size_t i = 0; i < k; i++) m->real[known[i]] += 6.0 * seed[i];
    m->t += 0.5;
    evaluate(m);
    for (size_t i = 0; i < n; i++) out[i] = (m->real[unknown[i]] - before[unknown[i]]) / 6.0;
    return 0;
}

/* FMI 2.0 */

typedef struct { int needed, terminate, nominals, states, defined; double due; } Info;

SHARED(fmi2, GetDerivatives)
ACCESS(fmi2, Real, double, real, 0)
ACCESS(fmi2, Integer, int, whole, 100)
ACCESS(fmi2, Boolean, int, truth, 200)
void *fmi2Instantiate(const char *n, int kind, const char *g, const char *r, const void *c, int v, int l)
{
    return kind == 0 && !strcmp(g, "exchange") ? made() : NULL;
}
int fmi2SetupExperiment(Model *m, int a, double b, double t, int c, double d) { m->t = t; return 0; }
int fmi2EnterInitializationMode(Model *m) { return 0; }
int fmi2NewDiscreteStates(Model *m, Info *info)
{
    info->needed = update(m);
    info->terminate = m->terminate;
    info->nominals = 0;
    info->states = 1;
    info->defined = m->is_due;
    info->due = m->due;
    return 0;
}
int fmi2GetDirectionalDerivative(Model *m, const uint32_t z[], size_t nz, const uint32_t v[], size_t nv, const double dv[], double dz[])
{
    return difference(m, z, nz, v, nv, dv, dz);
}
int fmi2CompletedIntegratorStep(Model *m, int no, int *event, int *end) { *event = wants_event(m); *end = 0; return 0; }

/* FMI 3.0 */

SHARED(fmi3, GetContinuousStateDerivatives)
ACCESS(fmi3, Float64, double, real, 0, , size_t nv)
ACCESS(fmi3, Int32, int32_t, whole, 100, , size_t nv)
ACCESS(fmi3, Boolean, bool, truth, 200, , size_t nv)
void *fmi3InstantiateModelExchange(const char *n, const char *g, const char *r, bool v, bool l, void *e, void *log)
{
    return strcmp(g, "exchange") ? NULL : made();
}
int fmi3EnterInitializationMode(Model *m, bool a, double b, double t, bool c, double d) { m->t = t; return 0; }
int fmi3GetNumberOfContinuousStates(Model *m, size_t *n) { *n = STATES[MODEL]; return 0; }
int fmi3GetNumberOfEventIndicators(Model *m, size_t *n) { *n = INDICATORS[MODEL]; return 0; }
int fmi3UpdateDiscreteStates(Model *m, bool *needed, bool *terminate, bool *nominals, bool *states, bool *defined,
                             double *due)
{
    *needed = update(m);
    *terminate = m->terminate;
    *nominals = false;
    *states = true;
    *defined = m->is_due;
    *due = m->due;
    return 0;
}
int fmi3GetDirectionalDerivative(Model *m, const uint32_t z[], size_t nz, const uint32_t v[], size_t nv, const double dv[], size_t ndv,
                                 double dz[], size_t ndz)
{
    return difference(m, z, nz, v, nv, dv, dz);
}
int fmi3CompletedIntegratorStep(Model *m, bool no, bool *event, bool *end) { *event = wants_event(m); *end = false; return 0; }

/* FMPy wants all functions to be there */

const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi3GetVersion(void) { return "3.0"; }
#define ABSENT(name) int name(void) { return 3; }
ABSENT(fmi2DeSerializeFMUstate) ABSENT(fmi2FreeFMUstate)
ABSENT(fmi2GetFMUstate) ABSENT(fmi2GetString) ABSENT(fmi2GetTypesPlatform)
 ABSENT(fmi2Reset) ABSENT(fmi2SerializeFMUstate) ABSENT(fmi2SerializedFMUstateSize)
ABSENT(fmi2SetDebugLogging) ABSENT(fmi2SetFMUstate) ABSENT(fmi2SetString) ABSENT(fmi3ActivateModelPartition)
ABSENT(fmi3DeserializeFMUState) ABSENT(fmi3DoStep) ABSENT(fmi3EnterConfigurationMode) ABSENT(fmi3EnterStepMode)
ABSENT(fmi3EvaluateDiscreteStates) ABSENT(fmi3ExitConfigurationMode) ABSENT(fmi3FreeFMUState)
ABSENT(fmi3GetAdjointDerivative) ABSENT(fmi3GetBinary) ABSENT(fmi3GetClock)
ABSENT(fmi3GetFMUState) ABSENT(fmi3GetFloat32) ABSENT(fmi3GetInt16)
ABSENT(fmi3GetInt64) ABSENT(fmi3GetInt8) ABSENT(fmi3GetIntervalDecimal) ABSENT(fmi3GetIntervalFraction)
ABSENT(fmi3GetNumberOfVariableDependencies) ABSENT(fmi3GetOutputDerivatives) ABSENT(fmi3GetShiftDecimal)
ABSENT(fmi3GetShiftFraction) ABSENT(fmi3GetString) ABSENT(fmi3GetUInt16) ABSENT(fmi3GetUInt32) ABSENT(fmi3GetUInt64)
ABSENT(fmi3GetUInt8) ABSENT(fmi3GetVariableDependencies)  ABSENT(fmi3InstantiateCoSimulation)
ABSENT(fmi3InstantiateScheduledExecution) ABSENT(fmi3Reset) ABSENT(fmi3SerializeFMUState)
ABSENT(fmi3SerializedFMUStateSize) ABSENT(fmi3SetBinary) ABSENT(fmi3SetClock) ABSENT(fmi3SetDebugLogging)
ABSENT(fmi3SetFMUState) ABSENT(fmi3SetFloat32) ABSENT(fmi3SetInt16) ABSENT(fmi3SetInt64) ABSENT(fmi3SetInt8)
ABSENT(fmi3SetIntervalDecimal) ABSENT(fmi3SetIntervalFraction) ABSENT(fmi3SetShiftDecimal)
ABSENT(fmi3SetShiftFraction) ABSENT(fmi3SetString) ABSENT(fmi3SetUInt16) ABSENT(fmi3SetUInt32) ABSENT(fmi3SetUInt64)
ABSENT(fmi3SetUInt8)
