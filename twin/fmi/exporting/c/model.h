/* What the state machines, fmi2.c and fmi3.c, know of a component. model.c, generated for each component, defines it. */

#ifndef MODEL_H
#define MODEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Sources of several FMUs in one program: FMI's functions, and `model`, get the prefix of the standards' headers. */
#if defined FMI3_FUNCTION_PREFIX && !defined FMI3_OVERRIDE_FUNCTION_PREFIX
#define PREFIX FMI3_FUNCTION_PREFIX
#elif defined FMI2_FUNCTION_PREFIX && !defined FMI2_OVERRIDE_FUNCTION_PREFIX
#define PREFIX FMI2_FUNCTION_PREFIX
#endif

#ifdef PREFIX
#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
#define NAME(name) JOINED(PREFIX, name)
#define model NAME(model)
#else
#define NAME(name) name
#endif

/* of this library alone: reached without a detour through its table of symbols */
#if defined __GNUC__ && !defined _WIN32 && !defined __CYGWIN__
#define HIDDEN __attribute__((visibility("hidden")))
#else
#define HIDDEN
#endif

/* types of a variable in the record; a getter or setter takes a mask of them */
enum { NO_TYPE = 0, FLOAT64 = 1, INT32 = 2, INT64 = 4, BOOLEAN = 8, CLOCK = 16 };

/* what decides when a variable may be set: an input continuous in time, another input, a parameter, a fixed one, a start
   value that nothing computes; never what the component computes */
enum { SIGNAL, INPUT, TUNABLE, FIXED, EXACT, CALCULATED };

enum { TIME = -40 }; /* instead of an offset in the record: the independent variable */

/* one value reference */
typedef struct {
    const char *name;
    int32_t     offset; /* in the record [byte] */
    uint32_t    count;  /* of scalars */
    uint8_t     type, access;
    bool        is_intermediate; /* may be asked for in Intermediate Update Mode */
} Field;

/* A function's status is OK (0), WARNING, DISCARD, ERROR or FATAL (4). Offsets are those in the record [byte]. */
typedef struct {
    const char    *name, *token;
    uint64_t       identity[2]; /* the token's number: saved states carry it */
    size_t         record_size; /* [byte] */
    uint32_t       field_count;
    const Field   *fields; /* by value reference */

    /* the component's own functions */
    void    (*init)(void *record); /* start values */
    int32_t (*start)(void *record, double t);
    int32_t (*step)(void *record, double t, double h);
    int32_t (*derivatives)(void *record, double t); /* NULL: Co-Simulation only */

    /* directional derivatives, of `derivatives` and of `start`: seeds in a second record become tangents; NULL: none */
    int32_t (*tangent)(void *record, void *tangents, double t, double tangent_of_t);
    int32_t (*first_tangent)(void *record, void *tangents, double t, double tangent_of_t);

    /* a sampled component */
    int64_t period; /* [ns]; 0: it is not sampled */
    int32_t begin;  /* offset of the first tick's time [ns], an int64_t */
    int32_t tick;   /* offset of two int64_t: number of the present tick; whether it has taken its inputs */
    bool    has_clock; /* one of the fields is a clock of this period: Scheduled Execution is offered */

    /* a continuous component */
    double         substep; /* longest step of its method [s] */
    uint32_t       state_count, indicator_count;
    const int32_t *states, *derivatives_of_states; /* offsets */
    const double  *nominals;                       /* of states */
    const int32_t *indicators;                     /* offsets */

    /* memory for instances and saved states, zero at first */
    unsigned char *pool;
    size_t         pool_size, slot_size; /* [byte] */
} Model;

extern HIDDEN const Model model;

/* ------------------------------------------------------------------------------------------------------------ memory */

/* bytes in a slot before the record, and for what a saved state holds beside it; both are checked in core.h */
enum { SLOT_HEAD = 192, MEMORY_HEAD = 40 };

#define ROUNDED(size, unit) (((size) + (unit) - 1) / (unit) * (unit))

/* one memory, or three for directional derivatives, and one bit for each value reference */
#define SLOT_SIZE(record_size, field_count, memories) \
    ROUNDED(SLOT_HEAD + (memories) * (MEMORY_HEAD + ROUNDED(record_size, 8)) + 4 * ((field_count) / 32 + 1), 64)

/* 64 MiB, or 16 slots if that is more. It is virtual: pages are only taken when touched. */
#define SLOT_COUNT(slot_size) ((64 << 20) / (slot_size) > 16 ? (64 << 20) / (slot_size) : 16)

#endif
