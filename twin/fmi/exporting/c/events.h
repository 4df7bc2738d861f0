/* Ticks of a sampled component as events: Event Mode, Model Exchange, Scheduled Execution. Included by core.h.

   Tick n has the inputs that hold when its event ends, and publishes at the begin of event n + 1. Event 0 follows
   initialization. Between events nothing changes. */

/* When the present tick begins and when it publishes [ns]. */
static int64_t tick_begin(Memory *memory)
{
    const int64_t *begin = place_of(memory, model.begin), *tick = place_of(memory, model.tick);
    return *begin + *tick * model.period;
}

static int64_t next_event(Memory *memory) { return tick_begin(memory) + model.period; }

static double half_a_period(void) { return (double)model.period * 0.5e-9; } /* [s] */

/* Whether t [s] has come to an instant [ns], or passed it: with the tolerance of the component's own counting, and so
   that an instant has come, and not passed, at the time that it is told with. */
static bool has_come(double t, int64_t instant)
{
    return t >= (double)instant / 1e9 || t * 1e9 + 1e-6 * (double)model.period >= (double)instant;
}

static bool has_passed(double t, int64_t instant)
{
    return t > (double)instant / 1e9 && t * 1e9 - 1e-6 * (double)model.period > (double)instant;
}

static bool is_at(double t, int64_t instant) { return has_come(t, instant) && !has_passed(t, instant); }

/* Whether ticks are events of an instance: those of a group are not where its equations are solved outside. */
static bool is_timed(const Slot *me) { return model.period && !(me->memory.kind == ME && model.derivatives); }

/* The tick that is due publishes. */
static int publish(Slot *me)
{
    Memory *memory = &me->memory;
    int status = OK;
    if (has_come(memory->time, next_event(memory)))
        status = model.step(record_of(memory), memory->time, half_a_period()); /* nothing else is due by then */
    if (status != OK) status = conclude(me, status, memory->time, 0);
    if (status == DISCARD) memory->mode = FAILED, status = ERROR; /* only a step can be discarded */
    return status;
}

static int enter_event(Slot *me)
{
    int status = is_timed(me) ? publish(me) : OK;
    if (status < DISCARD) me->memory.mode = EVENT;
    return status;
}

/* A tick that begins now takes its inputs; again, if they have changed since. Returns the time of the next event [s]. */
static double sample_inputs(Slot *me)
{
    Memory *memory = &me->memory;
    if (is_at(memory->time, tick_begin(memory))) {
        ((int64_t *)place_of(memory, model.tick))[1] = 0; /* not taken yet */
        model.step(record_of(memory), memory->time, half_a_period());
    }
    return (double)next_event(memory) / 1e9;
}
