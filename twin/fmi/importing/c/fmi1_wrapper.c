/* Functions of FMI 2.0 for Co-Simulation by the functions of FMI 1.0, in the library MODEL.so next to this one.
 *
 * A slave is initialized when its initialization mode ends, or when a value is read in that mode, since FMI 1.0 has no such mode.
 * Its own file is called fmi1_wrapper_MODEL.so; functions of FMI 1.0 are called MODEL_fmiDoStep and so on.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define OWN_PREFIX "fmi1_wrapper_"

enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING };

typedef void (*Logger2)(void *environment, const char *name, int status, const char *category, const char *message, ...);
typedef struct {
    Logger2 logger;
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(void *, int);
    void *componentEnvironment;
} Callbacks2;
typedef struct {
    void (*logger)(void *, const char *name, int status, const char *category, const char *message, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(void *, int);
} Callbacks1;

typedef struct Slave {
    void *slave, *library;
    char model[256];
    const Callbacks2 *callbacks;
    char *name;
    double start, stop;
    char has_stop, is_initialized;
    struct Slave *next;
} Slave;

static Slave *slaves; /* messages name their instance */

static void *function(const Slave *s, const char *name) {
    char symbol[512];
    snprintf(symbol, sizeof symbol, "%s_%s", s->model, name);
    return s->library ? dlsym(s->library, symbol) : NULL;
}

static void report(const Slave *s, int status, const char *text) {
    if (s->callbacks && s->callbacks->logger) {
        s->callbacks->logger(s->callbacks->componentEnvironment, s->name, status, "fmi1", "%s", text);
    }
}

static void logger1(void *slave, const char *name, int status, const char *category, const char *message, ...) {
    char text[1024];
    va_list arguments;
    (void)category;
    va_start(arguments, message);
    vsnprintf(text, sizeof text, message ? message : "", arguments);
    va_end(arguments);
    for (const Slave *s = slaves; s; s = s->next) {
        if ((slave && s->slave == slave) || (name && strcmp(s->name, name) == 0)) {
            report(s, status, text);
            return;
        }
    }
}

static void open_library(Slave *s) {
    Dl_info own;
    char path[4096];
    if (!dladdr((void *)open_library, &own)) {
        return;
    }
    const char *slash = strrchr(own.dli_fname, '/');
    const char *name = slash ? slash + 1 : own.dli_fname;
    if (strncmp(name, OWN_PREFIX, strlen(OWN_PREFIX)) != 0) {
        return;
    }
    const char *file = name + strlen(OWN_PREFIX), *dot = strrchr(file, '.');
    snprintf(s->model, sizeof s->model, "%.*s", dot ? (int)(dot - file) : (int)strlen(file), file);
    snprintf(path, sizeof path, "%.*s%s", (int)(name - own.dli_fname), own.dli_fname, file);
    s->library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
}

static void free_slave(Slave *s) {
    for (Slave **link = &slaves; *link; link = &(*link)->next) {
        if (*link == s) {
            *link = s->next;
            break;
        }
    }
    if (s->library) {
        dlclose(s->library);
    }
    free(s->name);
    free(s);
}

typedef void *(*Instantiate)(const char *, const char *, const char *, const char *, double, char, char, Callbacks1, char);

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const Callbacks2 *callbacks,
                      int visible, int logging) {
    (void)type;
    Slave *s = calloc(1, sizeof *s);
    if (!s) {
        return NULL;
    }
    s->callbacks = callbacks;
    s->name = strdup(name);
    s->next = slaves;
    slaves = s;
    open_library(s);
    const Instantiate instantiate = (Instantiate)function(s, "fmiInstantiateSlave");
    if (!instantiate) {
        const char *reason = dlerror();
        report(s, ERROR, reason ? reason : "fmiInstantiateSlave is missing");
        free_slave(s);
        return NULL;
    }
    char location[4096]; /* of the FMU: without /resources */
    snprintf(location, sizeof location, "%s", resources ? resources : "");
    char *end = strstr(location, "/resources");
    if (end && strlen(end) <= strlen("/resources/")) {
        *end = '\0';
    }
    const Callbacks1 callbacks1 = {logger1, callbacks->allocateMemory, callbacks->freeMemory, NULL};
    s->slave = instantiate(name, guid, location, "application/x-fmu-sharedlibrary", 0.0, (char)(visible != 0), 0,
                           callbacks1, (char)(logging != 0));
    if (!s->slave) {
        free_slave(s);
        return NULL;
    }
    return s;
}

void fmi2FreeInstance(void *component) {
    Slave *s = component;
    if (!s) {
        return;
    }
    void (*release)(void *) = (void (*)(void *))function(s, "fmiFreeSlaveInstance");
    if (release) {
        release(s->slave);
    }
    free_slave(s);
}

int fmi2SetupExperiment(void *component, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    Slave *s = component;
    (void)has_tolerance, (void)tolerance;
    s->start = start;
    s->stop = stop;
    s->has_stop = (char)(has_stop != 0);
    return OK;
}

int fmi2EnterInitializationMode(void *component) {
    (void)component;
    return OK;
}

static int initialize(Slave *s) {
    int (*call)(void *, double, char, double) = (int (*)(void *, double, char, double))function(s, "fmiInitializeSlave");
    if (s->is_initialized) {
        return OK;
    }
    s->is_initialized = 1;
    return call ? call(s->slave, s->start, s->has_stop, s->stop) : ERROR;
}

int fmi2ExitInitializationMode(void *component) {
    return initialize(component);
}

static int plain(const Slave *s, const char *name) {
    int (*call)(void *) = (int (*)(void *))function(s, name);
    return call ? call(s->slave) : ERROR;
}

int fmi2Terminate(void *component) {
    return plain(component, "fmiTerminateSlave");
}

int fmi2Reset(void *component) {
    Slave *s = component;
    s->is_initialized = 0;
    return plain(s, "fmiResetSlave");
}

int fmi2DoStep(void *component, double time, double step, int is_final) {
    const Slave *s = component;
    (void)is_final;
    int (*call)(void *, double, double, char) = (int (*)(void *, double, double, char))function(s, "fmiDoStep");
    return call ? call(s->slave, time, step, 1) : ERROR;
}

/* Values of most types are passed as they are. */
#define VALUES(TYPE, NAME)                                                                                              \
    int fmi2Get##NAME(void *component, const unsigned *references, size_t count, TYPE *values) {                        \
        Slave *s = component;                                                                                           \
        int (*call)(void *, const unsigned *, size_t, TYPE *) =                                                         \
            (int (*)(void *, const unsigned *, size_t, TYPE *))function(s, "fmiGet" #NAME);                             \
        const int status = initialize(s);                                                                               \
        return status > WARNING ? status : call ? call(s->slave, references, count, values) : ERROR;                    \
    }                                                                                                                   \
    int fmi2Set##NAME(void *component, const unsigned *references, size_t count, const TYPE *values) {                  \
        const Slave *s = component;                                                                                     \
        int (*call)(void *, const unsigned *, size_t, const TYPE *) =                                                   \
            (int (*)(void *, const unsigned *, size_t, const TYPE *))function(s, "fmiSet" #NAME);                       \
        return call ? call(s->slave, references, count, values) : ERROR;                                                \
    }

VALUES(double, Real)
VALUES(int, Integer)
VALUES(const char *, String)

int fmi2GetBoolean(void *component, const unsigned *references, size_t count, int *values) {
    Slave *s = component;
    int (*call)(void *, const unsigned *, size_t, char *) =
        (int (*)(void *, const unsigned *, size_t, char *))function(s, "fmiGetBoolean");
    int status = initialize(s);
    for (size_t i = 0; i < count && status <= WARNING; i++) {
        char value = 0; /* a Boolean of FMI 1.0 is a char */
        status = call ? call(s->slave, &references[i], 1, &value) : ERROR;
        values[i] = value != 0;
    }
    return status;
}

int fmi2SetBoolean(void *component, const unsigned *references, size_t count, const int *values) {
    const Slave *s = component;
    int (*call)(void *, const unsigned *, size_t, const char *) =
        (int (*)(void *, const unsigned *, size_t, const char *))function(s, "fmiSetBoolean");
    int status = OK;
    for (size_t i = 0; i < count && status <= WARNING; i++) {
        const char value = (char)(values[i] != 0);
        status = call ? call(s->slave, &references[i], 1, &value) : ERROR;
    }
    return status;
}

int fmi2GetRealStatus(void *component, int kind, double *value) {
    const Slave *s = component;
    int (*call)(void *, int, double *) = (int (*)(void *, int, double *))function(s, "fmiGetRealStatus");
    return call ? call(s->slave, kind, value) : DISCARD;
}

int fmi2GetBooleanStatus(void *component, int kind, int *value) { /* fmi2Terminated, which FMI 1.0 does not have */
    (void)component, (void)kind, (void)value;
    return DISCARD;
}
