/* y follows u with a time constant of 0.1 s, by explicit Euler; a step over the time `at` is not made, or not in whole.
   FMI 2.0 and 3.0 in one library; `what` says how:
   REFUSES: ERROR; DISCARDS: DISCARD, and it tells how far it came; RETURNS: comes back early (3.0);
   TERMINATES: comes to `at` and wants the simulation to end; DIES: FATAL. It counts what is done to it. */

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { REFUSES = 1, DISCARDS, RETURNS, TERMINATES, DIES };
enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { U, Y, T, AT, STEPS, REALS };

typedef struct {
    double real[REALS], came;
    int what;
    bool may_return, has_terminated;
} Follower;

static Follower *made(bool may_return)
{
    Follower *m = calloc(1, sizeof(Follower));
    m->may_return = may_return;
    return m;
}

static void go(Follower *m, double t, double h)
{
    m->real[Y] += h / 0.1 * (m->real[U] - m->real[Y]);
    m->real[T] = m->came = t + h;
    m->real[STEPS] += 1;
}

static bool passes(const Follower *m, double t, double h) { return t + 1e-9 < m->real[AT] && m->real[AT] < t + h - 1e-9; }
static bool meets(const Follower *m, double t, double h) { return t + 1e-9 < m->real[AT] && m->real[AT] < t + h + 1e-9; }

static int get(Follower *m, const uint32_t vr[], size_t n, double v[])
{
    for (size_t i = 0; i < n; i++) v[i] = m->real[vr[i]];
    return OK;
}
static int set(Follower *m, const uint32_t vr[], size_t n, const double v[])
{
    for (size_t i = 0; i < n; i++) m->real[vr[i]] = v[i];
    return OK;
}
static int keep(Follower *m, void **state)
{
    if (!*state) *state = malloc(sizeof *m);
    memcpy(*state, m, sizeof *m);
    return OK;
}
static int release(void **state) { free(*state); *state = NULL; return OK; }

/* FMI 2.0 */
void *fmi2Instantiate(const char *n, int kind, const char *g, const char *r, const void *c, int v, int l) { return made(false); }
void fmi2FreeInstance(Follower *m) { free(m); }
int fmi2SetupExperiment(Follower *m, int a, double b, double t, int d, double e) { m->came = t; return OK; }
int fmi2EnterInitializationMode(Follower *m) { return OK; }
int fmi2ExitInitializationMode(Follower *m) { return OK; }
int fmi2Terminate(Follower *m) { return OK; }
int fmi2GetReal(Follower *m, const uint32_t vr[], size_t n, double v[]) { return get(m, vr, n, v); }
int fmi2SetReal(Follower *m, const uint32_t vr[], size_t n, const double v[]) { return set(m, vr, n, v); }
int fmi2SetInteger(Follower *m, const uint32_t vr[], size_t n, const int v[]) { m->what = v[0]; return OK; }
int fmi2GetInteger(Follower *m, const uint32_t vr[], size_t n, int v[]) { v[0] = m->what; return OK; }
int fmi2GetFMUstate(Follower *m, void **state) { return keep(m, state); }
int fmi2SetFMUstate(Follower *m, void *state) { memcpy(m, state, sizeof *m); return OK; }
int fmi2FreeFMUstate(Follower *m, void **state) { return release(state); }
int fmi2GetRealStatus(Follower *m, int kind, double *v) { *v = m->came; return kind == 2 ? OK : DISCARD; }
int fmi2GetBooleanStatus(Follower *m, int kind, int *v) { *v = m->has_terminated; return kind == 3 ? OK : DISCARD; }
int fmi2DoStep(Follower *m, double t, double h, int keep_state)
{
    m->has_terminated = false;
    if (m->what == REFUSES && passes(m, t, h)) return ERROR;
    if (m->what == DIES && passes(m, t, h)) return FATAL;
    if (m->what == DISCARDS && passes(m, t, h)) { m->came = m->real[AT]; return DISCARD; }
    if (m->what == TERMINATES && meets(m, t, h)) {
        go(m, t, m->real[AT] - t);
        m->has_terminated = true;
        return DISCARD;
    }
    go(m, t, h);
    return OK;
}

/* FMI 3.0 */
void *fmi3InstantiateCoSimulation(const char *n, const char *g, const char *r, bool v, bool l, bool events, bool early,
                                  const uint32_t *required, size_t k, void *e, void *log, void *update) { return made(early); }
void fmi3FreeInstance(Follower *m) { free(m); }
int fmi3EnterInitializationMode(Follower *m, bool a, double b, double t, bool d, double e) { m->came = t; return OK; }
int fmi3ExitInitializationMode(Follower *m) { return OK; }
int fmi3Terminate(Follower *m) { return OK; }
int fmi3GetFloat64(Follower *m, const uint32_t vr[], size_t n, double v[], size_t k) { return get(m, vr, n, v); }
int fmi3SetFloat64(Follower *m, const uint32_t vr[], size_t n, const double v[], size_t k) { return set(m, vr, n, v); }
int fmi3SetInt32(Follower *m, const uint32_t vr[], size_t n, const int32_t v[], size_t k) { m->what = v[0]; return OK; }
int fmi3GetInt32(Follower *m, const uint32_t vr[], size_t n, int32_t v[], size_t k) { v[0] = m->what; return OK; }
int fmi3GetFMUState(Follower *m, void **state) { return keep(m, state); }
int fmi3SetFMUState(Follower *m, void *state) { memcpy(m, state, sizeof *m); return OK; }
int fmi3FreeFMUState(Follower *m, void **state) { return release(state); }
int fmi3DoStep(Follower *m, double t, double h, bool prior, bool *event, bool *terminate, bool *early, double *last)
{
    *event = *terminate = *early = false;
    *last = t;
    if (m->what == REFUSES && passes(m, t, h)) return ERROR;
    if (m->what == DIES && passes(m, t, h)) return FATAL;
    if (m->what == DISCARDS && passes(m, t, h)) { *last = m->real[AT]; return DISCARD; }
    if (m->what == RETURNS && m->may_return && passes(m, t, h)) { h = m->real[AT] - t; *early = true; }
    if (m->what == TERMINATES && meets(m, t, h)) { h = m->real[AT] - t; *terminate = true; }
    go(m, t, h);
    *last = t + h;
    return OK;
}
