/* The yardstick: a hand-written co-simulation loop over a ring of FMI 2.0 or 3.0 FMUs, recording every step.
 *
 * usage: ring VERSION(2|3) LIBRARY TOKEN MEMBERS STEPS INPUT OUTPUT   prints ns per member and step, and a checksum
 */
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef void *Instance;
typedef unsigned int Reference;

static void log2_(void *env, const char *name, int status, const char *category, const char *message, ...) {
    (void)env; (void)name; (void)status; (void)category; fprintf(stderr, "%s\n", message);
}
static void log3_(void *env, int status, const char *category, const char *message) {
    (void)env; (void)status; (void)category; fprintf(stderr, "%s\n", message);
}

static struct {
    void (*log)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished, *environment;
} callbacks = {log2_, calloc, free, 0, 0};

#define SYMBOL(name) name##_t name = (name##_t)dlsym(library, #name)

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * t.tv_sec + t.tv_nsec;
}

int main(int argc, char **argv) {
    if (argc < 8) return 2;
    int version = atoi(argv[1]), n = atoi(argv[4]);
    int64_t steps = atoll(argv[5]);
    Reference input = atoi(argv[6]), output = atoi(argv[7]);
    void *library = dlopen(argv[2], RTLD_NOW | RTLD_LOCAL);
    if (!library) { fprintf(stderr, "%s\n", dlerror()); return 1; }

    Instance *c = calloc(n, sizeof *c);
    double *y = calloc(n, sizeof *y), h = 1e-3;
    double *rows = malloc((steps + 1) * (n + 1) * sizeof *rows);
    double begin = 0.0, stop = steps * h;
    memset(rows, 0, (steps + 1) * (n + 1) * sizeof *rows);
    int failed = 0;

    if (version == 2) {
        typedef Instance (*fmi2Instantiate_t)(const char *, int, const char *, const char *, const void *, int, int);
        typedef int (*fmi2SetupExperiment_t)(Instance, int, double, double, int, double);
        typedef int (*fmi2EnterInitializationMode_t)(Instance);
        typedef int (*fmi2ExitInitializationMode_t)(Instance);
        typedef int (*fmi2SetReal_t)(Instance, const Reference *, size_t, const double *);
        typedef int (*fmi2GetReal_t)(Instance, const Reference *, size_t, double *);
        typedef int (*fmi2DoStep_t)(Instance, double, double, int);
        SYMBOL(fmi2Instantiate); SYMBOL(fmi2SetupExperiment); SYMBOL(fmi2EnterInitializationMode);
        SYMBOL(fmi2ExitInitializationMode); SYMBOL(fmi2SetReal); SYMBOL(fmi2GetReal); SYMBOL(fmi2DoStep);
        for (int i = 0; i < n; i++) {
            c[i] = fmi2Instantiate("member", 1, argv[3], "", &callbacks, 0, 0);
            if (!c[i]) return 1;
            fmi2SetupExperiment(c[i], 0, 0, 0, 1, stop);
            fmi2EnterInitializationMode(c[i]);
            fmi2ExitInitializationMode(c[i]);
            fmi2GetReal(c[i], &output, 1, &y[i]);
        }
        begin = now();
        for (int64_t k = 0; k < steps; k++) {
            for (int i = 0; i < n; i++) failed |= fmi2SetReal(c[i], &input, 1, &y[i ? i - 1 : n - 1]) > 1;
            for (int i = 0; i < n; i++) failed |= fmi2DoStep(c[i], k * h, h, 1) > 1;
            for (int i = 0; i < n; i++) failed |= fmi2GetReal(c[i], &output, 1, &y[i]) > 1;
            double *row = rows + k * (n + 1);
            row[0] = (k + 1) * h;
            for (int i = 0; i < n; i++) row[i + 1] = y[i];
            if (failed) return 1;
        }
    } else {
        typedef Instance (*fmi3InstantiateCoSimulation_t)(const char *, const char *, const char *, uint8_t, uint8_t, uint8_t,
                                                          uint8_t, const Reference *, size_t, void *, void *, void *);
        typedef int (*fmi3EnterInitializationMode_t)(Instance, uint8_t, double, double, uint8_t, double);
        typedef int (*fmi3ExitInitializationMode_t)(Instance);
        typedef int (*fmi3SetFloat64_t)(Instance, const Reference *, size_t, const double *, size_t);
        typedef int (*fmi3GetFloat64_t)(Instance, const Reference *, size_t, double *, size_t);
        typedef int (*fmi3DoStep_t)(Instance, double, double, uint8_t, uint8_t *, uint8_t *, uint8_t *, double *);
        SYMBOL(fmi3InstantiateCoSimulation); SYMBOL(fmi3EnterInitializationMode);
        SYMBOL(fmi3ExitInitializationMode); SYMBOL(fmi3SetFloat64); SYMBOL(fmi3GetFloat64); SYMBOL(fmi3DoStep);
        uint8_t event, terminate, early;
        double last;
        for (int i = 0; i < n; i++) {
            c[i] = fmi3InstantiateCoSimulation("member", argv[3], "", 0, 0, 0, 0, 0, 0, 0, log3_, 0);
            if (!c[i]) return 1;
            fmi3EnterInitializationMode(c[i], 0, 0, 0, 1, stop);
            fmi3ExitInitializationMode(c[i]);
            fmi3GetFloat64(c[i], &output, 1, &y[i], 1);
        }
        begin = now();
        for (int64_t k = 0; k < steps; k++) {
            for (int i = 0; i < n; i++) failed |= fmi3SetFloat64(c[i], &input, 1, &y[i ? i - 1 : n - 1], 1) > 1;
            for (int i = 0; i < n; i++) {
                failed |= fmi3DoStep(c[i], k * h, h, 1, &event, &terminate, &early, &last) > 1;
                failed |= terminate;
            }
            for (int i = 0; i < n; i++) failed |= fmi3GetFloat64(c[i], &output, 1, &y[i], 1) > 1;
            double *row = rows + k * (n + 1);
            row[0] = (k + 1) * h;
            for (int i = 0; i < n; i++) row[i + 1] = y[i];
            if (failed) return 1;
        }
    }
    double took = now() - begin;
    __asm__ volatile("" : : "r"(rows) : "memory"); /* somebody reads them: else the compiler leaves the recording out */
    printf("%.4f %.17g\n", took / ((double)steps * n), y[n - 1]);
    return 0;
}
