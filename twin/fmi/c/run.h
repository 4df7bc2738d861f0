/* The life of an instance: start, initialization, steps, access to variables, saved states. Included by core.h. */

/* ----------------------------------------------------------------------------------------------------- life cycle */

static void start(Slot *me)
{
    Memory *memory = &me->memory;
    memory->time = memory->start_time = memory->stop_time = 0;
    memory->stop_defined = memory->stale = 0;
    memory->mode = INSTANTIATED;
    copy(memory->record, START, RECORD_SIZE);
}

static Slot *place_for(int use, const Sink *sink)
{
    Slot *slot = claim(use);
    if (!slot)
        say(sink, ERROR, "%s: all %i places for instances and saved states are in use. Free some.", MODEL, (int64_t)SLOTS);
    return slot;
}

/* A new instance, or NULL with the reason logged. */
static Slot *instantiate(Sink sink, int kind, const char *token, bool logging)
{
    if (!sink.name || !*sink.name) sink.name = MODEL;
    sink.categories = logging ? ALL_CATEGORIES : 0;
    if (kind == ME && !EXCHANGE) {
        say(&sink, ERROR, "%s: is for Co-Simulation, not for Model Exchange.", MODEL);
        return NULL;
    }
    if (!token || !same_text(token, TOKEN)) {
        say(&sink, ERROR, "%s: GUID or instantiation token is %s, not %s. The modelDescription.xml belongs to another binary.",
            MODEL, token ? token : "NULL", TOKEN);
        return NULL;
    }
    Slot *me = place_for(INSTANCE, &sink);
    if (!me) return NULL;
    size_t i = 0;
    for (; sink.name[i] && i + 1 < sizeof me->name; i++) me->name[i] = sink.name[i];
    me->name[i] = 0;
    sink.name = me->name;
    copy(&me->sink, &sink, sizeof sink);
    me->memory.kind = kind;
    start(me);
    return me;
}

static bool define_experiment(Slot *me, double start_time, bool stop_defined, double stop_time)
{
    if (start_time - start_time != 0 || (stop_defined && !(stop_time >= start_time))) {
        say(&me->sink, ERROR, "Start time %g and stop time %g are not an interval.", start_time, stop_time);
        return false;
    }
    me->memory.time = me->memory.start_time = start_time;
    me->memory.stop_defined = stop_defined;
    me->memory.stop_time = stop_time;
    return true;
}

static int enter_initialization(Slot *me)
{
    me->memory.mode = INITIALIZATION;
    me->memory.stale = 1;
    return OK;
}

/* Run the component's functions on the live record if anything was set since they last ran, as a record member does. */
static int settle(Slot *me)
{
    Memory *memory = &me->memory;
    if (!memory->stale) return OK;
    bool first = memory->mode == INITIALIZATION;
    memory->stale = 0;
    if ((first ? component_initialize : component_derivatives)(memory->record, memory->time) == OK) return OK;
    memory->mode = FAILED;
    say(&me->sink, ERROR, "%s: %s failed.", MODEL, first ? "initialization" : "evaluation");
    return ERROR;
}

/* Something was set. */
static void touch(Slot *me)
{
    me->memory.stale = (me->memory.mode & EVALUATED) != 0;
}

static int terminate(Slot *me)
{
    int status = settle(me);
    if (status == OK) me->memory.mode = TERMINATED;
    return status;
}

static int exit_initialization(Slot *me)
{
    int status = settle(me);
    if (status == OK) me->memory.mode = me->memory.kind == CS ? STEP : EVENT;
    return status;
}

static double tolerance(double t)
{
    double size = t < 0 ? -t : t;
    return 1e-9 * (size > 1 ? size : 1);
}

static inline bool step_is_possible(const Slot *me, double t, double h)
{
    const Memory *memory = &me->memory;
    double gap = t - memory->time, limit = tolerance(t);
    if (!(gap <= limit && gap >= -limit)) {
        say(&me->sink, ERROR, "The communication point is %g, but the FMU is at %g.", t, memory->time);
        return false;
    }
    if (!(h > 0) || h - h != 0) {
        say(&me->sink, ERROR, "The communication step size is %g. It must be positive.", h);
        return false;
    }
    if (memory->stop_defined && t + h > memory->stop_time + tolerance(memory->stop_time)) {
        say(&me->sink, ERROR, "A step from %g to %g goes past the stop time %g.", t, t + h, memory->stop_time);
        return false;
    }
    return true;
}

/* Draw the conclusions from a status other than OK of a step, or of a part of it, and return it. */
static NOINLINE int conclude(Slot *me, int status, double t, double h)
{
    static const uint8_t AFTER[] = {[DISCARD] = STEP_FAILED, [ERROR] = FAILED, [FATAL] = DEAD};
    if (status < OK || status > FATAL) status = ERROR;
    if (status >= DISCARD) me->memory.mode = AFTER[status];
    say(&me->sink, status, "%s: the step from %g by %g did not go well.", MODEL, t, h);
    return status;
}

static int advance(Slot *me, double t, double h)
{
    if (!step_is_possible(me, t, h)) return ERROR;
    int status = component_advance(me->memory.record, t, h);
    if (status != OK) status = conclude(me, status, t, h);
    if (status < DISCARD) me->memory.time = t + h;
    return status;
}

/* ------------------------------------------------------------------------------------------------------ variables */

/* In Intermediate Update Mode only what was asked for at instantiation is within reach. */
static inline bool is_hidden(const Slot *me, uint32_t reference)
{
    return EXCHANGE && me->memory.mode == INTERMEDIATE && !(me->wishes.variables[reference / 32] >> reference % 32 & 1);
}

/* Say why a variable may not be accessed. */
static NOINLINE bool explain(const Slot *me, int function, uint32_t reference)
{
    const char *name = LEGAL[function].name;
    const Field *field = &FIELDS[reference];
    if (reference >= FIELD_COUNT) say(&me->sink, ERROR, "%s: there is no value reference %i.", name, (int64_t)reference);
    else if (!(field->type & LEGAL[function].types))
        say(&me->sink, ERROR, "%s: %s (value reference %i) has another type.", name, NAMES + field->name, (int64_t)reference);
    else if (is_hidden(me, reference))
        say(&me->sink, ERROR, "%s: %s is no input or output that was required at instantiation.", name, NAMES + field->name);
    else say(&me->sink, ERROR, "%s: %s cannot be set in state %s.", name, NAMES + field->name, state_name(me));
    return false;
}

static NOINLINE bool explain_size(const Slot *me, int function, size_t given, size_t expected)
{
    const char *name = LEGAL[function].name;
    say(&me->sink, ERROR, "%s: %i values were given, %i expected.", name, (int64_t)given, (int64_t)expected);
    return false;
}

/* Whether all references exist, have the type and may be accessed now, and `size` values belong to them. */
static inline bool accessible(Slot *me, int function, bool write, const uint32_t references[], size_t count,
                              const void *values, size_t size)
{
    unsigned types = LEGAL[function].types;
    size_t total = 0;
    if (count && (!references || !values)) return explain_size(me, function, 0, count);
    for (size_t i = 0; i < count; i++) {
        const Field *field = &FIELDS[references[i]];
        if (references[i] >= FIELD_COUNT || !(field->type & types) ||
            (write && !(SETTABLE[field->access] & me->memory.mode)) || is_hidden(me, references[i]))
            return explain(me, function, references[i]);
        total += field->count;
    }
    return total == size || explain_size(me, function, size, total);
}

/* ----------------------------------------------------------------------------------------------------- saved states */

typedef struct {
    uint64_t identity[2]; /* of the component that may read it back */
    Memory   memory;
} Serialized;

static int save(Slot *me, void **state)
{
    Slot *kept = state && *state ? slot_of(*state, STATE) : NULL;
    if (!state || (*state && !kept)) {
        say(&me->sink, ERROR, "This is not a saved state of %s, nor a place for one.", MODEL);
        return ERROR;
    }
    if (!kept) kept = place_for(STATE, &me->sink);
    if (!kept) return ERROR;
    copy(&kept->memory, &me->memory, sizeof(Memory));
    *state = kept;
    return OK;
}

static int nowhere(const Slot *me)
{
    say(&me->sink, ERROR, "NULL instead of a place for the answer.");
    return ERROR;
}

static Slot *saved(const Slot *me, void *state)
{
    Slot *kept = slot_of(state, STATE);
    if (!kept) say(&me->sink, ERROR, "This is not a saved state of %s.", MODEL);
    return kept;
}

static int restore(Slot *me, void *state)
{
    Slot *kept = saved(me, state);
    if (!kept) return ERROR;
    if (kept->memory.kind != me->memory.kind) {
        say(&me->sink, ERROR, "This state was saved in an instance for %s.", KIND_NAMES[kept->memory.kind]);
        return ERROR;
    }
    copy(&me->memory, &kept->memory, sizeof(Memory));
    return OK;
}

static int drop(Slot *me, void **state)
{
    if (!state || !*state) return OK;
    Slot *kept = saved(me, *state);
    if (!kept) return ERROR;
    release(kept);
    *state = NULL;
    return OK;
}

static int serialized_size(Slot *me, void *state, size_t *size)
{
    if (!saved(me, state)) return ERROR;
    if (!size) return nowhere(me);
    *size = sizeof(Serialized);
    return OK;
}

static int serialize(Slot *me, void *state, void *bytes, size_t size)
{
    Slot *kept = saved(me, state);
    if (!kept) return ERROR;
    if (!bytes || size < sizeof(Serialized)) {
        say(&me->sink, ERROR, "A serialized state needs %i bytes, got %i.", (int64_t)sizeof(Serialized), (int64_t)size);
        return ERROR;
    }
    copy(bytes, IDENTITY, sizeof IDENTITY);
    copy((char *)bytes + offsetof(Serialized, memory), &kept->memory, sizeof(Memory));
    return OK;
}

static int deserialize(Slot *me, const void *bytes, size_t size, void **state)
{
    uint64_t identity[2] = {0, 0};
    int32_t mode = 0, kind = 0;
    if (bytes && size == sizeof(Serialized)) {
        copy(identity, bytes, sizeof identity);
        copy(&mode, (const char *)bytes + offsetof(Serialized, memory) + offsetof(Memory, mode), sizeof mode);
        copy(&kind, (const char *)bytes + offsetof(Serialized, memory) + offsetof(Memory, kind), sizeof kind);
    }
    if (identity[0] != IDENTITY[0] || identity[1] != IDENTITY[1] || !(mode & ANY) || mode & (mode - 1) ||
        !(kind & ALL) || kind & (kind - 1)) {
        say(&me->sink, ERROR, "These %i bytes are not a state of this build of %s.", (int64_t)size, MODEL);
        return ERROR;
    }
    if (!state) return nowhere(me);
    *state = NULL;
    Slot *kept = place_for(STATE, &me->sink);
    if (!kept) return ERROR;
    copy(&kept->memory, (const char *)bytes + offsetof(Serialized, memory), sizeof(Memory));
    *state = kept;
    return OK;
}
