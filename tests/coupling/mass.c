/* A mass that a force pushes, FMI 2.0 Co-Simulation: x' = v, v' = (f - d v) / m, by RK4 in steps of about 0.1 ms.
   What modelDescription.xml offers of it, its state or its directional derivatives, is the test's choice. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { X, V, DER_X, DER_V, FORCE, DAMPING };

typedef struct { double real[6]; } Mass;

static double acceleration(const Mass *m, double v) { return m->real[FORCE] - m->real[DAMPING] * v; }

void *fmi2Instantiate(const char *n, int kind, const char *g, const char *r, const void *c, int v, int l)
{
    Mass *m = calloc(1, sizeof(Mass));
    m->real[DAMPING] = 0.1;
    return m;
}
void fmi2FreeInstance(Mass *m) { free(m); }
int fmi2SetupExperiment(Mass *m, int a, double b, double c, int d, double e) { return 0; }
int fmi2EnterInitializationMode(Mass *m) { return 0; }
int fmi2ExitInitializationMode(Mass *m) { return 0; }
int fmi2Terminate(Mass *m) { return 0; }
int fmi2SetReal(Mass *m, const unsigned vr[], size_t n, const double v[])
{
    for (size_t i = 0; i < n; i++) m->real[vr[i]] = v[i];
    return 0;
}
int fmi2GetReal(Mass *m, const unsigned vr[], size_t n, double v[])
{
    m->real[DER_X] = m->real[V];
    m->real[DER_V] = acceleration(m, m->real[V]);
    for (size_t i = 0; i < n; i++) v[i] = m->real[vr[i]];
    return 0;
}
int fmi2DoStep(Mass *m, double t, double h, int keep)
{
    int count = (int)ceil(h / 1e-4 - 1e-9);
    double s = h / count;
    for (int i = 0; i < count; i++) {
        double v1 = m->real[V], a1 = acceleration(m, v1);
        double v2 = v1 + s / 2 * a1, a2 = acceleration(m, v2);
        double v3 = v1 + s / 2 * a2, a3 = acceleration(m, v3);
        double v4 = v1 + s * a3, a4 = acceleration(m, v4);
        m->real[X] += s / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
        m->real[V] += s / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }
    return 0;
}

int fmi2GetFMUstate(Mass *m, void **state)
{
    if (!*state) *state = malloc(sizeof(Mass));
    memcpy(*state, m, sizeof(Mass));
    return 0;
}
int fmi2SetFMUstate(Mass *m, void *state) { memcpy(m, state, sizeof(Mass)); return 0; }
int fmi2FreeFMUstate(Mass *m, void **state) { free(*state); *state = NULL; return 0; }

int fmi2GetDirectionalDerivative(Mass *m, const unsigned unknown[], size_t n, const unsigned known[], size_t k,
                                 const double seed[], double change[])
{
    for (size_t i = 0; i < n; i++) {
        change[i] = 0;
        for (size_t j = 0; j < k; j++) {
            if (unknown[i] == DER_X && known[j] == V) change[i] += seed[j];
            if (unknown[i] == DER_V && known[j] == FORCE) change[i] += seed[j];
            if (unknown[i] == DER_V && known[j] == V) change[i] -= m->real[DAMPING] * seed[j];
            if (unknown[i] == known[j]) change[i] += seed[j];
        }
    }
    return 0;
}
