/* What FMI 2.0 and FMI 3.0 have in common: memory, messages, access to variables, steps, saved states.

   No libc: instances and saved states come from a pool in .bss, messages are formatted here. `component.h` is
   generated for each component. The file of an FMI version first defines `FUNCTIONS`, the table of its functions:
   X(name, kinds of instance that have it, states in which it may be called, or 0 if no instance can offer it; types of
   variables it moves). */

#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#define NOINLINE __attribute__((noinline))

/* status of a call, as the component and both FMI versions number it */
enum { OK, WARNING, DISCARD, ERROR, FATAL };

/* kinds of instance: Co-Simulation, Model Exchange, Co-Simulation whose importer handles events */
enum { CS = 1, ME = 2, EVENTFUL = 4, STEPPED = CS | EVENTFUL, ALL = STEPPED | ME };

/* states of an instance; STEP_FAILED: a step was discarded, FAILED and DEAD: after ERROR and FATAL */
enum {
    INSTANTIATED = 1, INITIALIZATION = 2, STEP = 4, STEP_FAILED = 8, TERMINATED = 16, FAILED = 32, DEAD = 64,
    EVENT = 128, CONTINUOUS = 256, ANY = 511, INTERMEDIATE = 512, /* the last one only while fmi3DoStep runs */
};
static const char *const STATE_NAMES[] = {
    "Instantiated", "Initialization Mode", "Step Mode", "step discarded", "Terminated", "after an error", "after a fatal error",
    "Event Mode", "Continuous-Time Mode", "Intermediate Update Mode",
};

/* types of a variable in the record; a getter or setter takes a mask of them */
enum { FLOAT64 = 1, INT32 = 2, INT64 = 4, BOOLEAN = 8, NO_TYPE = 0 };

/* what decides when a variable may be set */
enum { SIGNAL, INPUT, TUNABLE, FIXED, EXACT, CALCULATED };
static const uint16_t SETTABLE[] = {
    [SIGNAL]     = INSTANTIATED | INITIALIZATION | STEP | EVENT | CONTINUOUS | INTERMEDIATE, /* an input continuous in time */
    [INPUT]      = INSTANTIATED | INITIALIZATION | STEP | EVENT,
    [TUNABLE]    = INSTANTIATED | INITIALIZATION | STEP | EVENT,
    [FIXED]      = INSTANTIATED | INITIALIZATION,
    [EXACT]      = INSTANTIATED | INITIALIZATION,
    [CALCULATED] = 0,
};

/* one value reference: offset in the record [byte], number of scalars, place of the name in NAMES */
typedef struct {
    int32_t  offset;
    uint32_t count, name;
    uint8_t  type, width, access;
    bool     is_intermediate; /* may be asked for in Intermediate Update Mode */
} Field;

#define TIME (-40) /* offset of the independent variable, the first field of Memory, from the record */
#include "component.h"

/* states in which a getter sees what was set just before */
enum { EVALUATED = INITIALIZATION | (EXCHANGE ? EVENT | CONTINUOUS | INTERMEDIATE : 0) };

/* everything that a saved state holds */
typedef struct {
    double  time, start_time, stop_time;
    int32_t mode, stop_defined;
    int32_t stale; /* something was set in a state of EVALUATED after the component's functions ran */
    int32_t kind;  /* of instance */
    _Alignas(8) unsigned char record[RECORD_SIZE];
} Memory;
_Static_assert(offsetof(Memory, time) == 0 && offsetof(Memory, record) == -TIME, "TIME leads to Memory.time");

/* where messages go; `categories`: one bit per status, as numbered above */
typedef struct {
    void       *logger, *environment;
    const char *name;
    uint32_t    categories;
} Sink;

/* what an importer of FMI 3.0 wants to do within steps */
typedef struct {
    void    *update; /* its function for Intermediate Update Mode, or NULL */
    bool     early_return;
    uint32_t variables[FIELD_COUNT / 32 + 1]; /* one bit each: may be accessed in Intermediate Update Mode */
} Wishes;

enum { FREE, INSTANCE, STATE };
typedef struct {
    _Alignas(16) atomic_uintptr_t use; /* FREE, or the slot's own address plus what it is used as */
    Sink       sink;
    char       name[128];
    Wishes     wishes;
    Memory     memory;
#if DIRECTIONAL
    Memory     trial, tangents; /* where directional derivatives are computed, so that the question changes nothing */
#endif
} Slot;

#define POOL_SIZE ((size_t)64 << 20) /* virtual: pages are only taken when touched */
#define SLOTS (POOL_SIZE / sizeof(Slot) > 16 ? POOL_SIZE / sizeof(Slot) : 16)
static Slot pool[SLOTS];
static atomic_size_t hint; /* last slot that was released: warm, and next to be claimed */

#define FUNCTION_NUMBER(name, kinds, modes, types) name##_number,
#define FUNCTION_ROW(name, kinds, modes, types) {#name, modes, kinds, types},
enum { FUNCTIONS(FUNCTION_NUMBER) };
static const struct {
    const char *name;
    uint16_t    modes;
    uint8_t     kinds, types;
} LEGAL[] = {FUNCTIONS(FUNCTION_ROW)};

/* A function of an interface that is not offered: refused, with a message. */
#define ABSENT(name, ...) EXPORT int name(void *instance __VA_OPT__(,) __VA_ARGS__) { return absent(instance, name##_number); }

/* Begin of a function: `me` is the instance, and the call is legal. */
#define ENTER(name) Slot *me = enter(instance, name##_number); if (!me) return ERROR

int32_t component_initialize(void *record, double t);
int32_t component_advance(void *record, double t, double h);
#if EXCHANGE
int32_t component_derivatives(void *record, double t);
#else
static int32_t component_derivatives(void *record, double t) { return (void)record, (void)t, ERROR; } /* never called */
#endif

/* ------------------------------------------------------------------------------------------------------ helpers */

static NOINLINE void copy(void *restrict to, const void *restrict from, size_t size)
{
    for (size_t i = 0; i < size; i++) ((unsigned char *)to)[i] = ((const unsigned char *)from)[i];
}

static NOINLINE bool same_text(const char *a, const char *b)
{
    while (*a && *a == *b) a++, b++;
    return *a == *b;
}

static NOINLINE Slot *claim(int use)
{
    size_t first = atomic_load(&hint);
    for (size_t i = 0; i < SLOTS; i++) {
        size_t place = (first + i) % SLOTS;
        uintptr_t expected = FREE, used = (uintptr_t)&pool[place] + (uintptr_t)use;
        if (atomic_load(&pool[place].use) == FREE && atomic_compare_exchange_strong(&pool[place].use, &expected, used)) {
            atomic_store(&hint, (place + 1) % SLOTS);
            return &pool[place];
        }
    }
    return NULL;
}

static void release(Slot *slot)
{
    atomic_store(&slot->use, FREE);
    atomic_store(&hint, (size_t)(slot - pool));
}

/* The slot behind a pointer from outside; NULL if it is not one that is in use so, freed ones included. */
static inline Slot *slot_of(void *pointer, int use)
{
    uintptr_t address = (uintptr_t)pointer;
    if (address - (uintptr_t)pool >= sizeof pool || address % 16) return NULL;
    return atomic_load_explicit(&((Slot *)pointer)->use, memory_order_acquire) == address + (uintptr_t)use ? pointer : NULL;
}

/* ----------------------------------------------------------------------------------------------------- messages */

/* logged under the category of its status; OK is the trace of calls */
static const char *const CATEGORIES[] = {"logCalls", "logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal"};
enum { ALL_CATEGORIES = 31 };

static void send(const Sink *sink, int status, const char *category, const char *text);

typedef struct {
    char   text[512];
    size_t size;
} Message;

static void put(Message *message, char letter)
{
    /* FMI 2.0 gives a message to a printf that also knows #r1#; neither sign may reach it */
    if (letter == '%' || letter == '#') letter = '?';
    if (message->size + 1 < sizeof message->text) message->text[message->size++] = letter;
}

static void put_text(Message *message, const char *text)
{
    while (*text) put(message, *text++);
}

static void put_integer(Message *message, int64_t value)
{
    char digits[20];
    int count = 0;
    uint64_t rest = value < 0 ? -(uint64_t)value : (uint64_t)value;
    do digits[count++] = (char)('0' + rest % 10); while (rest /= 10);
    if (value < 0) put(message, '-');
    while (count) put(message, digits[--count]);
}

/* Twelve digits, enough to see why two times differ. */
static void put_real(Message *message, double value)
{
    int exponent = 0;
    if (value != value) { put_text(message, "NaN"); return; }
    if (value < 0) put(message, '-'), value = -value;
    if (value > 1.7e308) { put_text(message, "Inf"); return; }
    while (value >= 10) value /= 10, exponent++;
    while (value && value < 1) value *= 10, exponent--;
    int64_t digits = (int64_t)(value * 1e11 + 0.5);
    if (digits >= 1000000000000) digits /= 10, exponent++;
    bool plain = exponent >= -5 && exponent <= 11;
    int leading = plain ? exponent : 0; /* place of the first digit before the point */
    int64_t unit = 100000000000;
    if (leading < 0) {
        put_text(message, "0.");
        for (int i = leading + 1; i < 0; i++) put(message, '0');
    }
    for (int place = leading; place >= 0 || digits; place--, unit /= 10) {
        if (place == -1 && leading >= 0) put(message, '.');
        put(message, (char)('0' + (unit ? digits / unit : 0)));
        if (unit) digits %= unit;
    }
    if (!plain) put(message, 'e'), put_integer(message, exponent);
}

/* Send a message with %s (text), %i (int64_t), %g (double). Errors are sent whether or not logging is on. */
static NOINLINE void say(const Sink *sink, int status, const char *format, ...)
{
    if (!sink->logger || !(status >= ERROR || sink->categories >> status & 1)) return;
    Message message;
    message.size = 0; /* not an initializer, which would call memset */
    va_list arguments;
    va_start(arguments, format);
    for (; *format; format++) {
        if (*format != '%') { put(&message, *format); continue; }
        switch (*++format) {
        case 's': put_text(&message, va_arg(arguments, const char *)); break;
        case 'i': put_integer(&message, va_arg(arguments, int64_t)); break;
        default:  put_real(&message, va_arg(arguments, double)); break;
        }
    }
    va_end(arguments);
    message.text[message.size] = 0;
    send(sink, status, CATEGORIES[status], message.text);
}

static const char *state_name(const Slot *me)
{
    return STATE_NAMES[__builtin_ctz((unsigned)me->memory.mode)];
}

static const char *const KIND_NAMES[] = {
    [CS] = "Co-Simulation", [ME] = "Model Exchange", [EVENTFUL] = "Co-Simulation with Event Mode",
};

/* Trace a call, or say why it is refused. */
static NOINLINE void comment(const Slot *me, int function, bool legal)
{
    const char *name = LEGAL[function].name;
    if (legal) say(&me->sink, OK, "%s in state %s", name, state_name(me));
    else if (LEGAL[function].modes && !(LEGAL[function].kinds & me->memory.kind))
        say(&me->sink, ERROR, "%s is not for %s, which this instance was made for.", name, KIND_NAMES[me->memory.kind]);
    else if (LEGAL[function].modes) say(&me->sink, ERROR, "%s is not allowed in state %s.", name, state_name(me));
    else say(&me->sink, ERROR, "%s belongs to an interface that this FMU does not offer.", name);
}

/* The one check at the entry of every function: is this an instance, and may it be called now? */
static Slot *enter(void *instance, int function)
{
    Slot *me = slot_of(instance, INSTANCE);
    if (!me) return NULL;
    bool legal = LEGAL[function].modes & me->memory.mode && LEGAL[function].kinds & me->memory.kind;
    if (!legal || me->sink.categories & 1) comment(me, function, legal);
    return legal ? me : NULL;
}

static NOINLINE int absent(void *instance, int function)
{
    enter(instance, function);
    return ERROR;
}

static int set_logging(Slot *me, bool on, size_t count, const char *const names[])
{
    uint32_t chosen = 0;
    for (size_t i = 0; i < count; i++) {
        int status = OK;
        while (status <= FATAL && !(names && names[i] && same_text(names[i], CATEGORIES[status]))) status++;
        if (status > FATAL) {
            say(&me->sink, ERROR, "There is no log category \"%s\".", names && names[i] ? names[i] : "NULL");
            return ERROR;
        }
        chosen |= 1u << status;
    }
    if (!count) me->sink.categories = on ? ALL_CATEGORIES : 0;
    else me->sink.categories = on ? chosen : me->sink.categories & ~chosen;
    return OK;
}

#include "run.h"
#include "exchange.h"
