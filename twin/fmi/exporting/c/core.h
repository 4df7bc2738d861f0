/* What FMI 2.0 and FMI 3.0 have in common: memory, messages, access to variables, steps, saved states.

   No libc: instances and saved states come from the model's pool, messages are formatted here. The file of an FMI version
   first defines `FUNCTIONS`, the table of its functions: X(name, kinds of instance that have it, states in which it may be
   called, or 0 if `absent` answers; types of variables it moves). */

#include <float.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "model.h"

#if defined FMI3_Export
#define EXPORT FMI3_Export
#elif defined FMI2_Export
#define EXPORT FMI2_Export
#elif defined PREFIX
#define EXPORT
#elif defined _WIN32 || defined __CYGWIN__
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

/* A function of FMI, after its prototype: the standard's headers, which have them too, are not included. */
#define EXPORTED(type, name, arguments) \
    EXPORT type NAME(name) arguments;   \
    EXPORT type NAME(name) arguments

/* FMI's functions have arguments that mean nothing here; and time is rounded as in the component's own code */
#if defined _MSC_VER
#define INLINE static __forceinline
#define NOINLINE __declspec(noinline)
#pragma warning(disable : 4100)
#pragma fp_contract(off)
#elif defined __GNUC__
#define INLINE static inline __attribute__((always_inline))
#define NOINLINE __attribute__((noinline))
#pragma GCC diagnostic ignored "-Wunused-parameter"
#else
#define INLINE static inline
#define NOINLINE
#endif
#if defined __clang__
#pragma STDC FP_CONTRACT OFF
#elif defined __GNUC__
#pragma GCC optimize("fp-contract=off")
#endif

/* status of a call, as the component and both FMI versions number it */
enum { OK, WARNING, DISCARD, ERROR, FATAL };

/* kinds of instance: Co-Simulation, Model Exchange, Co-Simulation whose importer handles events, Scheduled Execution */
enum { CS = 1, ME = 2, EVENTFUL = 4, SCHEDULED = 8, STEPPED = CS | EVENTFUL, SAVED = STEPPED | ME, ALL = SAVED | SCHEDULED };

/* states of an instance; STEP_FAILED: a step was discarded, FAILED and DEAD: after ERROR and FATAL */
enum {
    INSTANTIATED = 1, INITIALIZATION = 2, STEP = 4, STEP_FAILED = 8, TERMINATED = 16, FAILED = 32, DEAD = 64,
    EVENT = 128, CONTINUOUS = 256, INTERMEDIATE = 512, /* only while fmi3DoStep runs */
    ACTIVATION = 1024, ANY = 2047 & ~INTERMEDIATE,
};
static const char *const STATE_NAMES[] = {
    "Instantiated", "Initialization Mode", "Step Mode", "step discarded", "Terminated", "after an error", "after a fatal error",
    "Event Mode", "Continuous-Time Mode", "Intermediate Update Mode", "Clock Activation Mode",
};

/* states in which a getter sees what was set just before */
enum { EVALUATED = INITIALIZATION | EVENT | CONTINUOUS | INTERMEDIATE };

/* when a variable may be set */
static const uint16_t SETTABLE[] = {
    [SIGNAL]     = INSTANTIATED | INITIALIZATION | STEP | EVENT | CONTINUOUS | INTERMEDIATE,
    [INPUT]      = INSTANTIATED | INITIALIZATION | STEP | EVENT | ACTIVATION,
    [TUNABLE]    = INSTANTIATED | INITIALIZATION | STEP | EVENT | ACTIVATION,
    [FIXED]      = INSTANTIATED | INITIALIZATION,
    [EXACT]      = INSTANTIATED | INITIALIZATION,
    [CALCULATED] = 0,
};

/* everything that a saved state holds; the component's record follows */
typedef struct {
    double  time, start_time, stop_time;
    int32_t mode, stop_defined;
    int32_t stale; /* something was set in a state of EVALUATED after the component's functions ran */
    int32_t kind;  /* of instance */
} Memory;

/* any function pointer, until its type is known */
typedef void (*Function)(void);

/* where messages go; `categories`: one bit per status, as numbered above */
typedef struct {
    Function    logger;
    void       *environment;
    const char *name;
    uint32_t    categories;
} Sink;

/* what an importer of FMI 3.0 wants to do within steps; a bit for each variable that may be accessed: `wish_bits` */
typedef struct {
    Function update; /* its function for Intermediate Update Mode, or NULL */
    bool     early_return;
} Wishes;

/* The begin of a slot. Its record follows; then, where there are directional derivatives, two more memories with their
   records, so that the question changes nothing; at last the wish bits. */
enum { FREE, INSTANCE, STATE };
typedef struct {
    _Alignas(16) atomic_uintptr_t use; /* FREE, or the slot's own address plus what it is used as */
    Sink              sink;
    char              name[128];
    Wishes            wishes;
    _Alignas(8) Memory memory;
} Slot;
_Static_assert(offsetof(Slot, memory) <= SLOT_HEAD && _Alignof(Slot) <= 64, "SLOT_HEAD holds what precedes the memory");
_Static_assert(sizeof(Memory) == MEMORY_HEAD && offsetof(Memory, time) == 0, "MEMORY_HEAD is the size of Memory");
_Static_assert((int)TIME == -(int)MEMORY_HEAD, "TIME leads to Memory.time");

static atomic_size_t hint; /* offset in the pool of the slot last released: warm, and next to be claimed */

#define FUNCTION_NUMBER(name, kinds, modes, types) name##_number,
#define FUNCTION_ROW(name, kinds, modes, types) {#name, modes, kinds, types},
enum { FUNCTIONS(FUNCTION_NUMBER) };
static const struct {
    const char *name;
    uint16_t    modes;
    uint8_t     kinds, types;
} LEGAL[] = {FUNCTIONS(FUNCTION_ROW)};

/* Begin of a function: `me` is the instance, and the call is legal. */
#define ENTER(name) Slot *me = enter(instance, name##_number); if (!me) return ERROR

/* ------------------------------------------------------------------------------------------------------------- memory */

/* A variable's place in the record that follows a memory, or in the memory itself. */
INLINE void *place_of(Memory *memory, int32_t offset) { return (unsigned char *)(memory + 1) + offset; }

INLINE void *record_of(Memory *memory) { return memory + 1; }

/* What a memory and its record take. */
INLINE size_t memory_size(void) { return sizeof(Memory) + model.record_size; }

/* Memory number 1 or 2 of a slot, or what is behind the last one. */
INLINE void *behind(Slot *slot, size_t count)
{
    return (unsigned char *)&slot->memory + count * (sizeof(Memory) + ROUNDED(model.record_size, 8));
}

INLINE uint32_t *wish_bits(Slot *slot) { return behind(slot, model.tangent ? 3 : 1); }

INLINE bool is_finite(double value) { return value >= -DBL_MAX && value <= DBL_MAX; }

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
    size_t offset = atomic_load(&hint);
    for (size_t seen = 0; seen < model.pool_size; seen += model.slot_size) {
        Slot *slot = (Slot *)(void *)(model.pool + offset);
        uintptr_t expected = FREE, used = (uintptr_t)slot + (uintptr_t)use;
        offset = offset + model.slot_size < model.pool_size ? offset + model.slot_size : 0;
        if (atomic_load(&slot->use) == FREE && atomic_compare_exchange_strong(&slot->use, &expected, used)) {
            atomic_store(&hint, offset);
            return slot;
        }
    }
    return NULL;
}

static void release(Slot *slot)
{
    atomic_store(&slot->use, FREE);
    atomic_store(&hint, (size_t)((unsigned char *)slot - model.pool));
}

/* The slot behind a pointer from outside; NULL if it is not one that is in use so, freed ones included. */
INLINE Slot *slot_of(void *pointer, int use)
{
    uintptr_t address = (uintptr_t)pointer;
    if (address - (uintptr_t)model.pool >= model.pool_size || address % 16) return NULL;
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
    if (value < 0) put(message, '-'), value = -value;
    if (!(value >= 0)) { put_text(message, "NaN"); return; }
    if (value > 1.7e308) { put_text(message, "Inf"); return; }
    while (value >= 10) value /= 10, exponent++;
    while (value > 0 && value < 1) value *= 10, exponent--;
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
    int place = 0;
    while (!(me->memory.mode >> place & 1)) place++;
    return STATE_NAMES[place];
}

static const char *const KIND_NAMES[] = {
    [CS] = "Co-Simulation", [ME] = "Model Exchange", [EVENTFUL] = "Co-Simulation with Event Mode",
    [SCHEDULED] = "Scheduled Execution",
};

/* Trace a call, or say why it is refused. */
static NOINLINE void comment(const Slot *me, int function, bool legal)
{
    const char *name = LEGAL[function].name;
    if (legal) say(&me->sink, OK, "%s in state %s", name, state_name(me));
    else if (!(LEGAL[function].kinds & me->memory.kind))
        say(&me->sink, ERROR, "%s is not for %s, which this instance was made for.", name, KIND_NAMES[me->memory.kind]);
    else say(&me->sink, ERROR, "%s is not allowed in state %s.", name, state_name(me));
}

/* The one check at the entry of every function: is this an instance, and may it be called now? */
INLINE Slot *enter(void *instance, int function)
{
    Slot *me = slot_of(instance, INSTANCE);
    if (!me) return NULL;
    bool legal = LEGAL[function].modes & me->memory.mode && LEGAL[function].kinds & me->memory.kind;
    if (!legal || me->sink.categories & 1) comment(me, function, legal);
    return legal ? me : NULL;
}

/* A function of an interface that is not offered. */
static NOINLINE int absent(void *instance, int function)
{
    Slot *me = slot_of(instance, INSTANCE);
    if (me) say(&me->sink, ERROR, "%s belongs to an interface that this FMU does not offer.", LEGAL[function].name);
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
#include "events.h"
