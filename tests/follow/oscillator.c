/* The oscillator of van der Pol by explicit Euler with a step of 1 ms, written as a reference FMU is: FMI 2.0 and 3.0 in one library.
   `mu` is tunable; `FORGETS` says that a saved state leaves the speed out, which is wrong. */

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

#ifndef FORGETS
#define FORGETS 0
#endif

enum { TIME, U, Y, MU, START, REALS };

typedef struct {
    double real[REALS], x, v;
    bool running;
} Oscillator;

static Oscillator *made(void)
{
    Oscillator *m = calloc(1, sizeof *m);
    m->real[MU] = m->real[START] = 1.0;
    return m;
}
static int get(Oscillator *m, const uint32_t vr[], size_t n, double v[])
{
    for (size_t i = 0; i < n; i++) v[i] = m->real[vr[i]];
    return 0;
}
static int set(Oscillator *m, const uint32_t vr[], size_t n, const double v[])
{
    for (size_t i = 0; i < n; i++) {
        if (m->running && vr[i] != U && vr[i] != MU) return 3;
        m->real[vr[i]] = v[i];
    }
    return 0;
}
static int begin(Oscillator *m)
{
    m->x = m->real[Y] = m->real[START];
    m->running = true;
    return 0;
}
static int keep(Oscillator *m, void **state)
{
    if (!*state) *state = malloc(sizeof *m);
    *(Oscillator *)*state = *m;
    return 0;
}
static int back(Oscillator *m, const void *state)
{
    double v = m->v;
    *m = *(const Oscillator *)state;
    if (FORGETS) m->v = v;
    return 0;
}
static int drop(void **state) { free(*state); *state = NULL; return 0; }
static int go(Oscillator *m, double t, double h)
{
    int count = (int)(h / 1e-3 + 0.5);
    for (int i = 0; i < count; i++) {
        double x = m->x, v = m->v;
        m->x = x + 1e-3 * v;
        m->v = v + 1e-3 * (m->real[MU] * (1.0 - x * x) * v - x + m->real[U]);
    }
    m->real[TIME] = t + h;
    m->real[Y] = m->x;
    return 0;
}

/* FMI 2.0 */
void *fmi2Instantiate(const char *n, int kind, const char *g, const char *r, const void *c, int v, int l) { return made(); }
void fmi2FreeInstance(Oscillator *m) { free(m); }
int fmi2SetupExperiment(Oscillator *m, int a, double b, double t, int d, double e) { return 0; }
int fmi2EnterInitializationMode(Oscillator *m) { return 0; }
int fmi2ExitInitializationMode(Oscillator *m) { return begin(m); }
int fmi2Terminate(Oscillator *m) { return 0; }
int fmi2GetReal(Oscillator *m, const uint32_t vr[], size_t n, double v[]) { return get(m, vr, n, v); }
int fmi2SetReal(Oscillator *m, const uint32_t vr[], size_t n, const double v[]) { return set(m, vr, n, v); }
int fmi2GetFMUstate(Oscillator *m, void **state) { return keep(m, state); }
int fmi2SetFMUstate(Oscillator *m, void *state) { return back(m, state); }
int fmi2FreeFMUstate(Oscillator *m, void **state) { return drop(state); }
int fmi2DoStep(Oscillator *m, double t, double h, int prior) { return go(m, t, h); }

/* FMI 3.0 */
void *fmi3InstantiateCoSimulation(const char *n, const char *g, const char *r, bool v, bool l, bool events, bool early,
                                  const uint32_t *required, size_t k, void *e, void *log, void *update) { return made(); }
void fmi3FreeInstance(Oscillator *m) { free(m); }
int fmi3EnterInitializationMode(Oscillator *m, bool a, double b, double t, bool d, double e) { return 0; }
int fmi3ExitInitializationMode(Oscillator *m) { return begin(m); }
int fmi3Terminate(Oscillator *m) { return 0; }
int fmi3GetFloat64(Oscillator *m, const uint32_t vr[], size_t n, double v[], size_t k) { return get(m, vr, n, v); }
int fmi3SetFloat64(Oscillator *m, const uint32_t vr[], size_t n, const double v[], size_t k) { return set(m, vr, n, v); }
int fmi3GetFMUState(Oscillator *m, void **state) { return keep(m, state); }
int fmi3SetFMUState(Oscillator *m, void *state) { return back(m, state); }
int fmi3FreeFMUState(Oscillator *m, void **state) { return drop(state); }
int fmi3DoStep(Oscillator *m, double t, double h, bool prior, bool *event, bool *terminate, bool *early, double *last)
{
    *event = *terminate = *early = false;
    *last = t + h;
    return go(m, t, h);
}
