/* An FMI 2.0 FMU with its debug logging off, for hosts that always switch it on: every call goes to the library `inner.so`
 * beside this one, fmi2Instantiate with loggingOn = false. Costs one jump per call.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <string.h>

static void *function(const char *name) {
    static void *library;
    if (!library) {
        char path[4096];
        Dl_info here;
        dladdr((void *)function, &here);
        snprintf(path, sizeof path, "%s", here.dli_fname);
        snprintf(strrchr(path, '/') + 1, 16, "inner.so");
        library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    }
    return dlsym(library, name);
}

/* up to five words, whatever they mean: pointers, counts, integers */
#define FORWARD(type, name)                                                                        \
    type name(void *a, void *b, void *c, void *d, void *e) {                                       \
        static type (*real)(void *, void *, void *, void *, void *);                               \
        if (!real) real = (type (*)(void *, void *, void *, void *, void *))function(#name);       \
        return real(a, b, c, d, e);                                                                \
    }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks,
                      int visible, int logging) {
    typedef void *(*Instantiate)(const char *, int, const char *, const char *, const void *, int, int);
    (void)logging;
    return ((Instantiate)function("fmi2Instantiate"))(name, type, guid, resources, callbacks, visible, 0);
}

int fmi2SetDebugLogging(void *instance, int on, size_t count, const char *const categories[]) {
    (void)instance, (void)on, (void)count, (void)categories;
    return 0;
}

int fmi2SetupExperiment(void *instance, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    typedef int (*Setup)(void *, int, double, double, int, double);
    return ((Setup)function("fmi2SetupExperiment"))(instance, has_tolerance, tolerance, start, has_stop, stop);
}

int fmi2DoStep(void *instance, double t, double h, int final) {
    static int (*real)(void *, double, double, int);
    if (!real) real = (int (*)(void *, double, double, int))function("fmi2DoStep");
    return real(instance, t, h, final);
}

FORWARD(const char *, fmi2GetTypesPlatform)
FORWARD(const char *, fmi2GetVersion)
FORWARD(int, fmi2FreeInstance)
FORWARD(int, fmi2EnterInitializationMode)
FORWARD(int, fmi2ExitInitializationMode)
FORWARD(int, fmi2Terminate)
FORWARD(int, fmi2Reset)
FORWARD(int, fmi2GetReal)
FORWARD(int, fmi2GetInteger)
FORWARD(int, fmi2GetBoolean)
FORWARD(int, fmi2GetString)
FORWARD(int, fmi2SetReal)
FORWARD(int, fmi2SetInteger)
FORWARD(int, fmi2SetBoolean)
FORWARD(int, fmi2SetString)
FORWARD(int, fmi2GetFMUstate)
FORWARD(int, fmi2SetFMUstate)
FORWARD(int, fmi2FreeFMUstate)
FORWARD(int, fmi2SerializedFMUstateSize)
FORWARD(int, fmi2SerializeFMUstate)
FORWARD(int, fmi2DeSerializeFMUstate)
FORWARD(int, fmi2GetDirectionalDerivative)
FORWARD(int, fmi2SetRealInputDerivatives)
FORWARD(int, fmi2GetRealOutputDerivatives)
FORWARD(int, fmi2CancelStep)
FORWARD(int, fmi2GetStatus)
FORWARD(int, fmi2GetRealStatus)
FORWARD(int, fmi2GetIntegerStatus)
FORWARD(int, fmi2GetBooleanStatus)
FORWARD(int, fmi2GetStringStatus)
