/* A small FMI importer for tests on other platforms: FMI 2.0 and 3.0, Co-Simulation and Model Exchange.

     importer LIBRARY VERSION KIND TOKEN H STEPS STATES INPUTS REFERENCE... OUTPUTS REFERENCE... < inputs > outputs

   VERSION: 2 or 3; KIND: cs or me (explicit Euler over H [s]); STATES: number of continuous states.
   Standard input: STEPS + 1 rows of the inputs' values; output: as many rows of the outputs' values. Values are the
   64 bits of a double as hexadecimal words, so that no platform's printing or reading of numbers takes part. */

#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
static void *library_of(const char *path) { return (void *)LoadLibraryA(path); }
static void *symbol_of(void *library, const char *name) { return (void *)GetProcAddress((HMODULE)library, name); }
#else
#include <dlfcn.h>
static void *library_of(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
static void *symbol_of(void *library, const char *name) { return dlsym(library, name); }
#endif

enum { MOST = 64 }; /* inputs, outputs or states */

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} Callbacks2;

typedef struct {
    int needed, terminate, nominals, values, defined;
    double next;
} EventInfo2;

typedef struct {
    size_t count;
    uint32_t references[MOST];
    double values[MOST];
} Group;

static void *library, *me;
static int version;

static _Noreturn void stop(const char *what)
{
    fprintf(stderr, "importer: %s failed\n", what);
    exit(1);
}

/* The address of fmi2NAME or fmi3NAME. */
static void *function(const char *name)
{
    char symbol[80];
    snprintf(symbol, sizeof symbol, "fmi%d%s", version, name);
    void *address = symbol_of(library, symbol);
    if (!address) stop(symbol);
    return address;
}

#define CALL(name, types, ...) \
    do { if (((int (*) types)function(name))(__VA_ARGS__)) stop(name); } while (0)

static void log_2(void *environment, const char *name, int status, const char *category, const char *message, ...)
{
    (void)environment, (void)name, (void)status, (void)category;
    fprintf(stderr, "%s\n", message);
}

static void log_3(void *environment, int status, const char *category, const char *message)
{
    (void)environment, (void)status, (void)category;
    fprintf(stderr, "%s\n", message);
}

static void instantiate(bool exchange, const char *token)
{
    static const Callbacks2 callbacks = {log_2, calloc, free, NULL, NULL};
    if (version == 2) {
        typedef void *(*Make)(const char *, int, const char *, const char *, const Callbacks2 *, int, int);
        me = ((Make)function("Instantiate"))("it", exchange ? 0 : 1, token, "", &callbacks, 0, 0);
    } else if (exchange) {
        typedef void *(*Make)(const char *, const char *, const char *, bool, bool, void *, void *);
        me = ((Make)function("InstantiateModelExchange"))("it", token, "", false, false, NULL, (void *)log_3);
    } else {
        typedef void *(*Make)(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *, size_t,
                              void *, void *, void *);
        me = ((Make)function("InstantiateCoSimulation"))("it", token, "", false, false, false, false, NULL, 0, NULL,
                                                         (void *)log_3, NULL);
    }
    if (!me) stop("instantiation");
}

static void enter_initialization(void)
{
    if (version == 2) {
        CALL("SetupExperiment", (void *, int, double, double, int, double), me, 0, 0.0, 0.0, 0, 0.0);
        CALL("EnterInitializationMode", (void *), me);
    } else {
        CALL("EnterInitializationMode", (void *, bool, double, double, bool, double), me, false, 0.0, 0.0, false, 0.0);
    }
}

/* Read a row of values and set it. */
static void set(Group *inputs)
{
    for (size_t i = 0; i < inputs->count; i++) {
        uint64_t word;
        if (scanf("%" SCNx64, &word) != 1) stop("reading the inputs");
        memcpy(&inputs->values[i], &word, sizeof word);
    }
    if (!inputs->count) return;
    if (version == 2)
        CALL("SetReal", (void *, const uint32_t *, size_t, const double *), me, inputs->references, inputs->count,
             inputs->values);
    else
        CALL("SetFloat64", (void *, const uint32_t *, size_t, const double *, size_t), me, inputs->references,
             inputs->count, inputs->values, inputs->count);
}

/* Get the outputs and print them as a row. */
static void show(Group *outputs)
{
    if (version == 2)
        CALL("GetReal", (void *, const uint32_t *, size_t, double *), me, outputs->references, outputs->count,
             outputs->values);
    else
        CALL("GetFloat64", (void *, const uint32_t *, size_t, double *, size_t), me, outputs->references, outputs->count,
             outputs->values, outputs->count);
    for (size_t i = 0; i < outputs->count; i++) {
        uint64_t word;
        memcpy(&word, &outputs->values[i], sizeof word);
        printf("%016" PRIx64 "%c", word, i + 1 < outputs->count ? ' ' : '\n');
    }
}

static void do_step(double t, double h)
{
    bool event = false, terminate = false, early = false;
    double last = t;
    if (version == 2)
        CALL("DoStep", (void *, double, double, int), me, t, h, 1);
    else
        CALL("DoStep", (void *, double, double, bool, bool *, bool *, bool *, double *), me, t, h, true, &event,
             &terminate, &early, &last);
}

static void enter_continuous_time(void)
{
    EventInfo2 info = {0};
    bool flags[5] = {false};
    double next = 0.0;
    if (version == 2)
        CALL("NewDiscreteStates", (void *, EventInfo2 *), me, &info);
    else
        CALL("UpdateDiscreteStates", (void *, bool *, bool *, bool *, bool *, bool *, double *), me, &flags[0], &flags[1],
             &flags[2], &flags[3], &flags[4], &next);
    CALL("EnterContinuousTimeMode", (void *), me);
}

/* x(t + h) = x(t) + h x'(t); compiled without contraction, so that every platform rounds alike. */
static void euler(double t, double h, size_t states)
{
    double x[MOST], slope[MOST];
    CALL("GetContinuousStates", (void *, double *, size_t), me, x, states);
    CALL(version == 2 ? "GetDerivatives" : "GetContinuousStateDerivatives", (void *, double *, size_t), me, slope, states);
    for (size_t i = 0; i < states; i++) x[i] += h * slope[i];
    CALL("SetTime", (void *, double), me, t + h);
    CALL("SetContinuousStates", (void *, const double *, size_t), me, x, states);
}

static char **read_group(char **arguments, Group *group)
{
    group->count = strtoul(*arguments++, NULL, 10);
    if (group->count > MOST) stop("more variables than there is room for");
    for (size_t i = 0; i < group->count; i++) group->references[i] = strtoul(*arguments++, NULL, 10);
    return arguments;
}

int main(int count, char **arguments)
{
    Group inputs, outputs;
    if (count < 10) stop("reading the arguments");
    version = atoi(arguments[2]);
    bool exchange = !strcmp(arguments[3], "me");
    double h = strtod(arguments[5], NULL);
    long steps = strtol(arguments[6], NULL, 10);
    size_t states = strtoul(arguments[7], NULL, 10);
    if (states > MOST) stop("more states than there is room for");
    read_group(read_group(arguments + 8, &inputs), &outputs);
    library = library_of(arguments[1]);
    if (!library) stop("loading the library");
    instantiate(exchange, arguments[4]);
    enter_initialization();
    set(&inputs);
    CALL("ExitInitializationMode", (void *), me);
    if (exchange) enter_continuous_time();
    show(&outputs);
    for (long k = 0; k < steps; k++) {
        if (exchange) euler(k * h, h, states);
        else do_step(k * h, h);
        set(&inputs);
        show(&outputs);
    }
    CALL("Terminate", (void *), me);
    ((void (*)(void *))function("FreeInstance"))(me);
    return 0;
}
