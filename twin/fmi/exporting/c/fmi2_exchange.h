/* Model Exchange and directional derivatives of FMI 2.0. Included by fmi2.c. */

EXPORTED(int, fmi2EnterContinuousTimeMode, (void *instance))
{
    ENTER(fmi2EnterContinuousTimeMode);
    return enter_mode(me, CONTINUOUS);
}

EXPORTED(int, fmi2EnterEventMode, (void *instance))
{
    ENTER(fmi2EnterEventMode);
    return enter_event(me);
}

EXPORTED(int, fmi2SetTime, (void *instance, double t))
{
    ENTER(fmi2SetTime);
    return set_time(me, fmi2SetTime_number, t);
}

#define VECTOR_FUNCTION(Name, action, type)                                   \
    EXPORTED(int, fmi2##Name, (void *instance, type values[], size_t size))   \
    {                                                                         \
        ENTER(fmi2##Name);                                                    \
        return action(me, fmi2##Name##_number, values, size);                 \
    }
VECTOR_FUNCTION(SetContinuousStates, set_states, const double)
VECTOR_FUNCTION(GetContinuousStates, get_states, double)
VECTOR_FUNCTION(GetDerivatives, get_derivatives, double)
VECTOR_FUNCTION(GetNominalsOfContinuousStates, get_nominals, double)
VECTOR_FUNCTION(GetEventIndicators, get_indicators, double)

typedef struct {
    int    new_discrete_states_needed, terminate_simulation, nominals_changed, states_changed, next_event_defined;
    double next_event;
} EventInfo;

EXPORTED(int, fmi2NewDiscreteStates, (void *instance, EventInfo *info))
{
    ENTER(fmi2NewDiscreteStates);
    if (!info) return nowhere(me);
    info->new_discrete_states_needed = info->terminate_simulation = info->nominals_changed = 0;
    info->states_changed = 0;
    info->next_event_defined = is_timed(me);
    info->next_event = is_timed(me) ? sample_inputs(me) : 0;
    return settle(me);
}

EXPORTED(int, fmi2CompletedIntegratorStep, (void *instance, int no_rollback, int *enter_event_mode,
                                            int *terminate_simulation))
{
    ENTER(fmi2CompletedIntegratorStep);
    if (enter_event_mode) *enter_event_mode = 0;
    if (terminate_simulation) *terminate_simulation = 0;
    return settle(me);
}

EXPORTED(int, fmi2GetDirectionalDerivative, (void *instance, const uint32_t unknowns[], size_t unknown_count,
                                             const uint32_t knowns[], size_t known_count, const double seeds[],
                                             double tangents[]))
{
    if (!model.tangent) return absent(instance, fmi2GetDirectionalDerivative_number);
    ENTER(fmi2GetDirectionalDerivative);
    Direction asked = {unknowns, knowns, unknown_count, known_count, seeds, known_count, tangents, unknown_count};
    return differentiate(me, fmi2GetDirectionalDerivative_number, &asked);
}
