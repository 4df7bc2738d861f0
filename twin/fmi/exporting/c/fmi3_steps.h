/* Steps that an importer of FMI 3.0 takes part in: ticks of a sampled component as events, substeps of a continuous one.
   Included by fmi3.c. */

/* ------------------------------------------------------------------------------------------------ what is asked for */

typedef void (*Update)(void *environment, double t, bool set_requested, bool get_allowed, bool step_finished,
                       bool can_return_early, bool *early_return_requested, double *early_return_time);

static bool are_possible(const Sink *sink, bool event_mode_used, const uint32_t references[], size_t count)
{
    if (event_mode_used && !model.period) {
        say(sink, ERROR, "%s: has no Event Mode. Instantiate it without.", model.name);
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        if (references && references[i] < model.field_count && model.fields[references[i]].is_intermediate) continue;
        say(sink, ERROR, "%s: value reference %i has no intermediateUpdate and cannot be required for it.", model.name,
            references ? (int64_t)references[i] : -1);
        return false;
    }
    return true;
}

static void wish(Slot *me, Update update, bool early_return, const uint32_t references[], size_t count)
{
    uint32_t *bits = wish_bits(me);
    me->wishes.update = model.derivatives ? (Function)update : NULL;
    me->wishes.early_return = early_return;
    for (size_t i = 0; i <= model.field_count / 32; i++) bits[i] = 0;
    for (size_t i = 0; i < count; i++) bits[references[i] / 32] |= 1u << references[i] % 32;
}

/* ------------------------------------------------------------------------------ Event Mode of a sampled component */

/* Go to the next event or, if the importer does not want steps to end early, to the end: ticks before it happen inside. */
static NOINLINE int advance_to_event(Slot *me, double t, double h, bool *event)
{
    Memory *memory = &me->memory;
    int64_t instant = next_event(memory);
    if (has_come(memory->time, instant)) return fail(me, fmi3DoStep_number, "an event has come. Enter Event Mode first.");
    if (!step_is_possible(me, t, h)) return ERROR;
    double end = t + h;
    if (!me->wishes.early_return)
        while (has_come(end, instant + model.period)) instant += model.period;
    bool is_event = has_come(end, instant) && (me->wishes.early_return || !has_passed(end, instant));

    /* half a period before the event everything due before it has happened, and what is due at it has not */
    double part = is_event ? (double)(instant - model.period / 2) * 1e-9 - t : h;
    int status = part > 0 ? model.step(record_of(memory), t, part) : OK;
    if (status != OK) status = conclude(me, status, t, part);
    if (status >= DISCARD) return status;
    memory->time = is_event && has_passed(end, instant) ? (double)instant / 1e9 : end;
    if (event) *event = is_event;
    return status;
}

/* The clock ticks, by Scheduled Execution. */
static NOINLINE int activate(Slot *me, int function, uint32_t clock, double t)
{
    Memory *memory = &me->memory;
    if (clock >= model.field_count || model.fields[clock].type != CLOCK) return explain(me, function, clock), ERROR;
    int64_t instant = has_come(t, next_event(memory)) ? next_event(memory) : tick_begin(memory);
    if (!is_at(t, instant)) {
        say(&me->sink, ERROR, "%s: the clock was due at %g, not at %g.", LEGAL[function].name, (double)instant / 1e9, t);
        return ERROR;
    }
    memory->time = t;
    int status = publish(me);
    if (status < DISCARD) sample_inputs(me);
    return status;
}

/* ------------------------------------------------------------------- Intermediate Update Mode of a continuous component */

/* Into how many equal substeps the component's method divides a step. */
static int64_t count_substeps(double h)
{
    double ratio = model.substep > 0 ? h / model.substep - 1e-9 : 0;
    int64_t count = (int64_t)ratio;
    count += (double)count < ratio;
    return count > 1 ? count : 1;
}

/* Let the importer look at the end of a substep; returns the time [s] at which it wants the step to end. */
static double show(Slot *me, double end, bool is_last)
{
    Memory *memory = &me->memory;
    bool can_return = me->wishes.early_return && !is_last, requested = false;
    double wanted = end;
    memory->mode = INTERMEDIATE;
    ((Update)me->wishes.update)(me->sink.environment, memory->time, !is_last, true, true, can_return, &requested, &wanted);
    if (memory->mode == INTERMEDIATE) memory->mode = STEP;
    if (!can_return || !requested || !(wanted < end)) return end;
    return wanted > memory->time ? wanted : memory->time;
}

/* A step that does what `advance` does, to the bit, and shows the end of every substep. */
static NOINLINE int advance_in_sight(Slot *me, double t, double h)
{
    if (!step_is_possible(me, t, h)) return ERROR;
    Memory *memory = &me->memory;
    int64_t count = count_substeps(h);
    double part = h / (double)count, end = t + h;
    int status = OK;
    bool is_last = false;
    for (int64_t i = 0; !is_last && memory->time < end; i++) {
        double from = t + (double)i * part, size = part;
        is_last = i + 1 == count;
        if (end < t + h && end - from <= part) is_last = true, size = end - from; /* the importer wants it shorter */
        int here = model.step(record_of(memory), from, size);
        if (is_last && here < DISCARD && model.derivatives(record_of(memory), end) != OK) here = ERROR;
        if (here != OK) here = conclude(me, here, from, size);
        if (here > status) status = here;
        if (status >= DISCARD) return status;
        memory->time = is_last ? end : from + part;
        end = show(me, end, is_last);
        if (memory->mode != STEP) return ERROR;
    }
    return settle(me) == OK ? status : ERROR;
}
