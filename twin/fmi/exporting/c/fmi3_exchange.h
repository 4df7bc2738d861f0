/* Model Exchange, Event Mode and directional derivatives of FMI 3.0. Included by fmi3.c. */

EXPORTED(int, fmi3EnterContinuousTimeMode, (void *instance))
{
    ENTER(fmi3EnterContinuousTimeMode);
    return enter_mode(me, CONTINUOUS);
}

EXPORTED(int, fmi3EnterEventMode, (void *instance))
{
    ENTER(fmi3EnterEventMode);
    return enter_event(me);
}

EXPORTED(int, fmi3EnterStepMode, (void *instance))
{
    ENTER(fmi3EnterStepMode);
    return enter_mode(me, STEP);
}

EXPORTED(int, fmi3SetTime, (void *instance, double t))
{
    ENTER(fmi3SetTime);
    return set_time(me, fmi3SetTime_number, t);
}

#define VECTOR_FUNCTION(Name, action, type)                                   \
    EXPORTED(int, fmi3##Name, (void *instance, type values[], size_t size))   \
    {                                                                         \
        ENTER(fmi3##Name);                                                    \
        return action(me, fmi3##Name##_number, values, size);                 \
    }
VECTOR_FUNCTION(SetContinuousStates, set_states, const double)
VECTOR_FUNCTION(GetContinuousStates, get_states, double)
VECTOR_FUNCTION(GetContinuousStateDerivatives, get_derivatives, double)
VECTOR_FUNCTION(GetNominalsOfContinuousStates, get_nominals, double)
VECTOR_FUNCTION(GetEventIndicators, get_indicators, double)

EXPORTED(int, fmi3UpdateDiscreteStates, (void *instance, bool *discrete_states_need_update, bool *terminate_simulation,
                                         bool *nominals_changed, bool *states_changed, bool *next_event_defined,
                                         double *next_event))
{
    ENTER(fmi3UpdateDiscreteStates);
    bool *const answers[] = {discrete_states_need_update, terminate_simulation, nominals_changed, states_changed,
                             next_event_defined};
    for (size_t i = 0; i < sizeof answers / sizeof *answers; i++)
        if (answers[i]) *answers[i] = false;
    double next = is_timed(me) ? sample_inputs(me) : 0;
    if (next_event_defined) *next_event_defined = is_timed(me);
    if (next_event) *next_event = next;
    return settle(me);
}

EXPORTED(int, fmi3CompletedIntegratorStep, (void *instance, bool no_rollback, bool *enter_event_mode,
                                            bool *terminate_simulation))
{
    ENTER(fmi3CompletedIntegratorStep);
    if (enter_event_mode) *enter_event_mode = false;
    if (terminate_simulation) *terminate_simulation = false;
    return settle(me);
}

static int count_of(Slot *me, size_t *answer, size_t count)
{
    if (!answer) return nowhere(me);
    *answer = count;
    return OK;
}

EXPORTED(int, fmi3GetNumberOfContinuousStates, (void *instance, size_t *count))
{
    ENTER(fmi3GetNumberOfContinuousStates);
    return count_of(me, count, model.state_count);
}

EXPORTED(int, fmi3GetNumberOfEventIndicators, (void *instance, size_t *count))
{
    ENTER(fmi3GetNumberOfEventIndicators);
    return count_of(me, count, model.indicator_count);
}

EXPORTED(int, fmi3GetDirectionalDerivative, (void *instance, const uint32_t unknowns[], size_t unknown_count,
                                             const uint32_t knowns[], size_t known_count, const double seeds[],
                                             size_t seed_count, double tangents[], size_t tangent_count))
{
    if (!model.tangent) return absent(instance, fmi3GetDirectionalDerivative_number);
    ENTER(fmi3GetDirectionalDerivative);
    Direction asked = {unknowns, knowns, unknown_count, known_count, seeds, seed_count, tangents, tangent_count};
    return differentiate(me, fmi3GetDirectionalDerivative_number, &asked);
}
