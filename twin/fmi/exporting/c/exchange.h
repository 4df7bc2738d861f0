/* Model Exchange and directional derivatives, for both FMI versions. Included by core.h. */

static int fail(const Slot *me, int function, const char *why)
{
    say(&me->sink, ERROR, "%s: %s", LEGAL[function].name, why);
    return ERROR;
}

static int enter_mode(Slot *me, int mode)
{
    me->memory.mode = mode;
    return OK;
}

static int set_time(Slot *me, int function, double t)
{
    if (!is_finite(t)) return fail(me, function, "time must be finite.");
    me->memory.time = t;
    touch(me);
    return OK;
}

/* Whether an array has one value for each of `count`. */
static bool fits(const Slot *me, int function, const void *values, size_t size, size_t count)
{
    return (size == count && (values || !count)) || explain_size(me, function, values ? size : 0, count);
}

static void gather(Slot *me, double values[], const int32_t offsets[], uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) values[i] = *(const double *)place_of(&me->memory, offsets[i]);
}

static int set_states(Slot *me, int function, const double values[], size_t size)
{
    if (!fits(me, function, values, size, model.state_count)) return ERROR;
    for (uint32_t i = 0; i < model.state_count; i++) *(double *)place_of(&me->memory, model.states[i]) = values[i];
    touch(me);
    return OK;
}

/* In Initialization Mode states may follow from parameters and inputs, as derivatives always do. */
static int get_states(Slot *me, int function, double values[], size_t size)
{
    if (!fits(me, function, values, size, model.state_count) || settle(me) != OK) return ERROR;
    gather(me, values, model.states, model.state_count);
    return OK;
}

static int get_derivatives(Slot *me, int function, double values[], size_t size)
{
    if (!fits(me, function, values, size, model.state_count) || settle(me) != OK) return ERROR;
    gather(me, values, model.derivatives_of_states, model.state_count);
    return OK;
}

static int get_nominals(Slot *me, int function, double values[], size_t size)
{
    if (!fits(me, function, values, size, model.state_count)) return ERROR;
    copy(values, model.nominals, sizeof(double) * model.state_count);
    return OK;
}

static int get_indicators(Slot *me, int function, double values[], size_t size)
{
    if (!fits(me, function, values, size, model.indicator_count) || settle(me) != OK) return ERROR;
    gather(me, values, model.indicators, model.indicator_count);
    return OK;
}

/* -------------------------------------------------------------------------------------------- directional derivatives */

/* Seeds of knowns to tangents of unknowns: one pass of the dual-number form of the component's own functions. */
typedef struct {
    const uint32_t *unknowns, *knowns;
    size_t          unknown_count, known_count;
    const double   *seeds;
    size_t          seed_count;
    double         *tangents;
    size_t          tangent_count;
} Direction;

/* Whether a variable is given in the present state, and not computed. */
static bool is_known(const Slot *me, const Field *field)
{
    bool is_state = false;
    for (uint32_t i = 0; i < model.state_count; i++) is_state |= field->offset == model.states[i];
    if (field->offset == TIME || field->access == SIGNAL || field->access == TUNABLE || field->access == FIXED) return true;
    return me->memory.mode == INITIALIZATION ? field->access == EXACT : is_state;
}

static int differentiate(Slot *me, int function, const Direction *asked)
{
    Memory *at = behind(me, 1), *along = behind(me, 2);
    if (!accessible(me, function, false, asked->unknowns, asked->unknown_count, asked->tangents, asked->tangent_count) ||
        !accessible(me, function, false, asked->knowns, asked->known_count, asked->seeds, asked->seed_count))
        return ERROR;
    copy(at, &me->memory, memory_size());
    for (size_t i = 0; i < memory_size(); i++) ((unsigned char *)along)[i] = 0;
    const double *seed = asked->seeds;
    for (size_t i = 0; i < asked->known_count; i++) {
        const Field *field = &model.fields[asked->knowns[i]];
        if (!is_known(me, field)) {
            say(&me->sink, ERROR, "%s: %s is not known in state %s, but computed.", LEGAL[function].name, field->name,
                state_name(me));
            return ERROR;
        }
        double *to = place_of(along, field->offset);
        for (uint32_t j = 0; j < field->count; j++) *to++ = *seed++;
    }
    bool first = at->mode == INITIALIZATION;
    int status = (first ? model.first_tangent : model.tangent)(record_of(at), record_of(along), at->time, along->time);
    if (status != OK) return fail(me, function, "the component cannot be evaluated here.");
    double *tangent = asked->tangents;
    for (size_t i = 0; i < asked->unknown_count; i++) {
        const Field *field = &model.fields[asked->unknowns[i]];
        const double *from = place_of(along, field->offset);
        for (uint32_t j = 0; j < field->count; j++) *tangent++ = *from++;
    }
    return OK;
}
