/* The life of an instance: start, initialization, steps, access to variables, saved states. Included by core.h. */

/* ----------------------------------------------------------------------------------------------------- life cycle */

static void start(Slot *me)
{
    Memory *memory = &me->memory;
    memory->time = memory->start_time = memory->stop_time = 0;
    memory->stop_defined = memory->stale = 0;
    memory->mode = INSTANTIATED;
    model.init(record_of(memory));
}

static Slot *place_for(int use, const Sink *sink)
{
    Slot *slot = claim(use);
    if (!slot)
        say(sink, ERROR, "%s: all %i places for instances and saved states are in use. Free some.", model.name,
            (int64_t)(model.pool_size / model.slot_size));
    return slot;
}

/* A new instance, or NULL with the reason logged. */
static Slot *instantiate(Sink sink, int kind, const char *token, bool logging)
{
    if (!sink.name || !*sink.name) sink.name = model.name;
    sink.categories = logging ? ALL_CATEGORIES : 0;
    if (kind == ME && !model.derivatives && !model.period) {
        say(&sink, ERROR, "%s: is for Co-Simulation, not for Model Exchange.", model.name);
        return NULL;
    }
    if (!token || !same_text(token, model.token)) {
        say(&sink, ERROR, "%s: GUID or instantiation token is %s, not %s. The modelDescription.xml belongs to another binary.",
            model.name, token ? token : "NULL", model.token);
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
    if (!is_finite(start_time) || (stop_defined && !(stop_time >= start_time))) {
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

static NOINLINE int evaluate(Slot *me)
{
    Memory *memory = &me->memory;
    bool first = memory->mode == INITIALIZATION;
    int32_t (*function)(void *record, double t) = first ? model.start : model.derivatives;
    memory->stale = 0;
    if (!function || function(record_of(memory), memory->time) == OK) return OK;
    memory->mode = FAILED;
    say(&me->sink, ERROR, "%s: %s failed.", model.name, first ? "initialization" : "evaluation");
    return ERROR;
}

/* Run the component's functions on the live record if anything was set since they last ran, as a record member does. */
INLINE int settle(Slot *me) { return me->memory.stale ? evaluate(me) : OK; }

/* Something was set. */
INLINE void touch(Slot *me)
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
    if (status == OK) me->memory.mode = me->memory.kind == CS ? STEP : me->memory.kind == SCHEDULED ? ACTIVATION : EVENT;
    return status;
}

INLINE double tolerance(double t)
{
    double size = t < 0 ? -t : t;
    return 1e-9 * (size > 1 ? size : 1);
}

/* Say why a step is impossible. */
static NOINLINE bool explain_step(const Slot *me, double t, double h)
{
    const Memory *memory = &me->memory;
    double gap = t - memory->time, limit = tolerance(t);
    if (!(gap <= limit && gap >= -limit))
        say(&me->sink, ERROR, "The communication point is %g, but the FMU is at %g.", t, memory->time);
    else if (!(h > 0) || !is_finite(h))
        say(&me->sink, ERROR, "The communication step size is %g. It must be positive.", h);
    else say(&me->sink, ERROR, "A step from %g to %g goes past the stop time %g.", t, t + h, memory->stop_time);
    return false;
}

INLINE bool step_is_possible(const Slot *me, double t, double h)
{
    const Memory *memory = &me->memory;
    double gap = t - memory->time, limit = tolerance(t);
    if (!(gap <= limit && gap >= -limit) || !(h > 0) || !is_finite(h)) return explain_step(me, t, h);
    bool is_late = memory->stop_defined && t + h > memory->stop_time + tolerance(memory->stop_time);
    return !is_late || explain_step(me, t, h);
}

/* Draw the conclusions from a status other than OK of a step, or of a part of it, and return it. */
static NOINLINE int conclude(Slot *me, int status, double t, double h)
{
    static const uint8_t AFTER[] = {[DISCARD] = STEP_FAILED, [ERROR] = FAILED, [FATAL] = DEAD};
    if (status < OK || status > FATAL) status = ERROR;
    if (status >= DISCARD) me->memory.mode = AFTER[status];
    say(&me->sink, status, "%s: the step from %g by %g did not go well.", model.name, t, h);
    return status;
}

INLINE int advance(Slot *me, double t, double h)
{
    if (!step_is_possible(me, t, h)) return ERROR;
    double end = t + h;
    int status = model.step(record_of(&me->memory), t, h);
    if (status != OK) status = conclude(me, status, t, h);
    if (status < DISCARD) me->memory.time = end;
    return status;
}

/* ------------------------------------------------------------------------------------------------------ variables */

/* In Intermediate Update Mode only what was asked for at instantiation is within reach. */
static bool is_hidden(Slot *me, uint32_t reference)
{
    return me->memory.mode == INTERMEDIATE && !(wish_bits(me)[reference / 32] >> reference % 32 & 1);
}

/* Say why a variable may not be accessed. */
static NOINLINE bool explain(Slot *me, int function, uint32_t reference)
{
    const char *name = LEGAL[function].name;
    if (reference >= model.field_count) {
        say(&me->sink, ERROR, "%s: there is no value reference %i.", name, (int64_t)reference);
        return false;
    }
    const Field *field = &model.fields[reference];
    if (!(field->type & LEGAL[function].types))
        say(&me->sink, ERROR, "%s: %s (value reference %i) has another type.", name, field->name, (int64_t)reference);
    else if (is_hidden(me, reference))
        say(&me->sink, ERROR, "%s: %s is no input or output that was required at instantiation.", name, field->name);
    else say(&me->sink, ERROR, "%s: %s cannot be set in state %s.", name, field->name, state_name(me));
    return false;
}

static NOINLINE bool explain_size(const Slot *me, int function, size_t given, size_t expected)
{
    const char *name = LEGAL[function].name;
    say(&me->sink, ERROR, "%s: %i values were given, %i expected.", name, (int64_t)given, (int64_t)expected);
    return false;
}

static NOINLINE bool are_in_reach(Slot *me, int function, const uint32_t references[], size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (is_hidden(me, references[i])) return explain(me, function, references[i]);
    return true;
}

/* Whether all references exist, have the type and may be accessed now, and `size` values belong to them. */
INLINE bool accessible(Slot *me, int function, bool write, const uint32_t references[], size_t count, const void *values,
                       size_t size)
{
    unsigned types = LEGAL[function].types;
    int32_t mode = me->memory.mode;
    const Field *fields = model.fields;
    uint32_t field_count = model.field_count;
    size_t total = 0;
    if (count && (!references || !values)) return explain_size(me, function, 0, count);
    for (size_t i = 0; i < count; i++) {
        uint32_t reference = references[i];
        if (reference >= field_count || !(fields[reference].type & types) ||
            (write && !(SETTABLE[fields[reference].access] & mode)))
            return explain(me, function, reference);
        total += fields[reference].count;
    }
    if (total != size) return explain_size(me, function, size, total);
    return mode != INTERMEDIATE || are_in_reach(me, function, references, count);
}

/* Begin of a getter: `me` is the instance, and what is asked for is up to date. */
INLINE Slot *reading(void *instance, int function, const uint32_t references[], size_t count, const void *values,
                     size_t size)
{
    Slot *me = enter(instance, function);
    return me && accessible(me, function, false, references, count, values, size) && settle(me) == OK ? me : NULL;
}

/* Begin of a setter. */
INLINE Slot *writing(void *instance, int function, const uint32_t references[], size_t count, const void *values,
                     size_t size)
{
    Slot *me = enter(instance, function);
    if (!me || !accessible(me, function, true, references, count, values, size)) return NULL;
    touch(me);
    return me;
}

/* The same for a type that no variable has: only an empty call succeeds. */
static NOINLINE int get_none(void *instance, int function, const uint32_t references[], size_t count,
                             const void *values, size_t size)
{
    return reading(instance, function, references, count, values, size) ? OK : ERROR;
}

static NOINLINE int set_none(void *instance, int function, const uint32_t references[], size_t count,
                             const void *values, size_t size)
{
    return writing(instance, function, references, count, values, size) ? OK : ERROR;
}

/* ----------------------------------------------------------------------------------------------------- saved states */

/* A serialized state: the identity of the component that may read it back, then a memory with its record. */
INLINE size_t saved_size(void) { return sizeof model.identity + memory_size(); }

static int save(Slot *me, void **state)
{
    Slot *kept = state && *state ? slot_of(*state, STATE) : NULL;
    if (!state || (*state && !kept)) {
        say(&me->sink, ERROR, "This is not a saved state of %s, nor a place for one.", model.name);
        return ERROR;
    }
    if (!kept) kept = place_for(STATE, &me->sink);
    if (!kept) return ERROR;
    copy(&kept->memory, &me->memory, memory_size());
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
    if (!kept) say(&me->sink, ERROR, "This is not a saved state of %s.", model.name);
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
    copy(&me->memory, &kept->memory, memory_size());
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
    *size = saved_size();
    return OK;
}

static int serialize(Slot *me, void *state, void *bytes, size_t size)
{
    Slot *kept = saved(me, state);
    if (!kept) return ERROR;
    if (!bytes || size < saved_size()) {
        say(&me->sink, ERROR, "A serialized state needs %i bytes, got %i.", (int64_t)saved_size(), (int64_t)size);
        return ERROR;
    }
    copy(bytes, model.identity, sizeof model.identity);
    copy((char *)bytes + sizeof model.identity, &kept->memory, memory_size());
    return OK;
}

static int deserialize(Slot *me, const void *bytes, size_t size, void **state)
{
    uint64_t identity[2] = {0, 0};
    int32_t mode = 0, kind = 0;
    if (bytes && size == saved_size()) {
        copy(identity, bytes, sizeof identity);
        copy(&mode, (const char *)bytes + sizeof model.identity + offsetof(Memory, mode), sizeof mode);
        copy(&kind, (const char *)bytes + sizeof model.identity + offsetof(Memory, kind), sizeof kind);
    }
    if (identity[0] != model.identity[0] || identity[1] != model.identity[1] || !(mode & ANY) || mode & (mode - 1) ||
        !(kind & ALL) || kind & (kind - 1)) {
        say(&me->sink, ERROR, "These %i bytes are not a state of this build of %s.", (int64_t)size, model.name);
        return ERROR;
    }
    if (!state) return nowhere(me);
    *state = NULL;
    Slot *kept = place_for(STATE, &me->sink);
    if (!kept) return ERROR;
    copy(&kept->memory, (const char *)bytes + sizeof model.identity, memory_size());
    *state = kept;
    return OK;
}
