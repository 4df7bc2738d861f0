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
    if (t - t != 0) return fail(me, function, "time must be finite.");
    me->memory.time = t;
    touch(me);
    return OK;
}

static double *states(Memory *memory) { return (double *)(memory->record + STATES); }

/* Whether an array has one value for each of `count`. */
static bool fits(const Slot *me, int function, const void *values, size_t size, size_t count)
{
    return (size == count && (values || !count)) || explain_size(me, function, values ? size : 0, count);
}

static int set_states(Slot *me, int function, const double values[], size_t size)
{
    if (!fits(me, function, values, size, STATE_COUNT)) return ERROR;
    copy(states(&me->memory), values, sizeof(double) * STATE_COUNT);
    touch(me);
    return OK;
}

/* In Initialization Mode states may follow from parameters and inputs, as derivatives always do. */
static int get_states(Slot *me, int function, double values[], size_t size)
{
    if (!fits(me, function, values, size, STATE_COUNT) || settle(me) != OK) return ERROR;
    copy(values, states(&me->memory), sizeof(double) * STATE_COUNT);
    return OK;
}

static int get_derivatives(Slot *me, int function, double values[], size_t size)
{
    if (!fits(me, function, values, size, STATE_COUNT) || settle(me) != OK) return ERROR;
    copy(values, me->memory.record + DERIVATIVES, sizeof(double) * STATE_COUNT);
    return OK;
}

static int get_nominals(Slot *me, int function, double values[], size_t size)
{
    if (!fits(me, function, values, size, STATE_COUNT)) return ERROR;
    copy(values, NOMINALS, sizeof(double) * STATE_COUNT);
    return OK;
}

static int get_indicators(Slot *me, int function, double values[], size_t size)
{
    if (!fits(me, function, values, size, INDICATOR_COUNT) || settle(me) != OK) return ERROR;
    for (int i = 0; i < INDICATOR_COUNT; i++) values[i] = *(const double *)(me->memory.record + INDICATORS[i]);
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

#if DIRECTIONAL
int32_t component_tangent(void *record, void *tangents, double t, double tangent_of_t);
int32_t component_first_tangent(void *record, void *tangents, double t, double tangent_of_t); /* of initialization */

/* Whether a variable is given in the present state, and not computed. */
static bool is_known(const Slot *me, const Field *field)
{
    bool is_state = field->offset >= STATES && field->offset < STATES + (int32_t)sizeof(double) * STATE_COUNT;
    if (field->offset == TIME || field->access == SIGNAL || field->access == TUNABLE || field->access == FIXED) return true;
    return me->memory.mode == INITIALIZATION ? field->access == EXACT : is_state;
}

static int differentiate(Slot *me, int function, const Direction *asked)
{
    Memory *at = &me->trial, *along = &me->tangents;
    if (!accessible(me, function, false, asked->unknowns, asked->unknown_count, asked->tangents, asked->tangent_count) ||
        !accessible(me, function, false, asked->knowns, asked->known_count, asked->seeds, asked->seed_count))
        return ERROR;
    copy(at, &me->memory, sizeof(Memory));
    for (size_t i = 0; i < sizeof(Memory); i++) ((unsigned char *)along)[i] = 0;
    const double *seed = asked->seeds;
    for (size_t i = 0; i < asked->known_count; i++) {
        const Field *field = &FIELDS[asked->knowns[i]];
        if (!is_known(me, field)) {
            say(&me->sink, ERROR, "%s: %s is not known in state %s, but computed.", LEGAL[function].name, NAMES + field->name,
                state_name(me));
            return ERROR;
        }
        double *to = (double *)(along->record + field->offset);
        for (uint32_t j = 0; j < field->count; j++) *to++ = *seed++;
    }
    bool first = at->mode == INITIALIZATION;
    int status = (first ? component_first_tangent : component_tangent)(at->record, along->record, at->time, along->time);
    if (status != OK) return fail(me, function, "the component cannot be evaluated here.");
    double *tangent = asked->tangents;
    for (size_t i = 0; i < asked->unknown_count; i++) {
        const Field *field = &FIELDS[asked->unknowns[i]];
        const double *from = (const double *)(along->record + field->offset);
        for (uint32_t j = 0; j < field->count; j++) *tangent++ = *from++;
    }
    return OK;
}
#else
static int differentiate(Slot *me, int function, const Direction *asked) { return (void)me, (void)function, (void)asked, ERROR; }
#endif
