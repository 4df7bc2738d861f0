/* An FMI 2.0 FMU that costs time: y = 0.5 u + offset, after computing or sleeping for a while in every step.
   `count`: passes of the arithmetic, whose result goes into y; `pause`: sleep [s]; `crash`: time of a crash [s], if above 0.
   `what`: 0, 3 ERROR, 2 DISCARD or 4 FATAL from the time `crash` on, in place of a crash if not 0. */

/* START: start values of the parameters. */
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { U, Y, OFFSET, COUNT, PAUSE, CRASH, WHAT, REALS };

typedef struct {
    double real[REALS];
} Model;

void *fmi2Instantiate(const char *n, int kind, const char *g, const char *r, const void *c, int v, int l) 
{
    static const double start[REALS] = {0.0, 0.0, START};
    Model *m = calloc(1, sizeof(Model));
    memcpy(m->real, start, sizeof start);
    return m;
}
void fmi2FreeInstance(Model *m) { free(m); }
int fmi2SetupExperiment(Model *m, int a, double b, double t, int d, double e) { return 0; }
int fmi2EnterInitializationMode(Model *m) { return 0; }
int fmi2ExitInitializationMode(Model *m) { m->real[Y] = m->real[OFFSET]; return 0; }
int fmi2Terminate(Model *m) { return 0; }
int fmi2Reset(Model *m) { return 0; }
const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
int fmi2SetDebugLogging(Model *m, int on, size_t n, const char *const c[]) { return 0; }
int fmi2GetReal(Model *m, const uint32_t vr[], size_t n, double v[])
{
    for (size_t i = 0; i < n; i++) v[i] = m->real[vr[i]];
    return 0;
}
int fmi2SetReal(Model *m, const uint32_t vr[], size_t n, const double v[])
{
    for (size_t i = 0; i < n; i++) m->real[vr[i]] = v[i];
    return 0;
}
int fmi2GetFMUstate(Model *m, void **state)
{
    if (!*state) *state = malloc(sizeof *m);
    memcpy(*state, m, sizeof *m);
    return 0;
}
int fmi2SetFMUstate(Model *m, void *state) { memcpy(m, state, sizeof *m); return 0; }
int fmi2FreeFMUstate(Model *m, void **state) { free(*state); *state = NULL; return 0; }
int fmi2GetRealStatus(Model *m, int kind, double *value) { *value = 0.0; return 0; }
int fmi2GetBooleanStatus(Model *m, int kind, int *value) { *value = 0; return 0; }

int fmi2DoStep(Model *m, double t, double h, int set)
{
    if (m->real[CRASH] > 0.0 && t >= m->real[CRASH] - 1e-9) {
        if (m->real[WHAT] != 0.0) return (int)m->real[WHAT];
        *(volatile int *)0 = 0;
    }
    volatile double x = m->real[U];
    for (int i = 0; i < (int)m->real[COUNT]; i++) x = x + 1e-9 * (m->real[U] - x);
    if (m->real[PAUSE] > 0.0) {
        struct timespec time = {(time_t)m->real[PAUSE], (long)(1e9 * (m->real[PAUSE] - (time_t)m->real[PAUSE]))};
        nanosleep(&time, NULL);
    }
    m->real[Y] = 0.5 * x + m->real[OFFSET];
    return 0;
}

/* what importers look up in every library; no variable has such a type, and no step goes on in the background */
#define NOT_OFFERED(name) int name(Model *m) { return 3; }
NOT_OFFERED(fmi2GetInteger)
NOT_OFFERED(fmi2GetBoolean)
NOT_OFFERED(fmi2GetString)
NOT_OFFERED(fmi2SetInteger)
NOT_OFFERED(fmi2SetBoolean)
NOT_OFFERED(fmi2SetString)
NOT_OFFERED(fmi2SerializedFMUstateSize)
NOT_OFFERED(fmi2SerializeFMUstate)
NOT_OFFERED(fmi2DeSerializeFMUstate)
NOT_OFFERED(fmi2GetDirectionalDerivative)
NOT_OFFERED(fmi2SetRealInputDerivatives)
NOT_OFFERED(fmi2GetRealOutputDerivatives)
NOT_OFFERED(fmi2CancelStep)
NOT_OFFERED(fmi2GetStatus)
NOT_OFFERED(fmi2GetIntegerStatus)
NOT_OFFERED(fmi2GetStringStatus)
