"""Events in a run: how they act, and what the summary says of those with a condition."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling import Condition, find

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from twin.coupling import Catalog, CoSimulation
    from twin.results import run_folder
    from twin.scenario import Case, ConditionSpec, EventSpec

OCCURRENCES = "conditions"  # key of summary.json
MAX_TIMES = 5  # in a note
MAX_OCCURRENCES = 1000  # of a condition in the summary of a case


def apply_event(event: EventSpec, case: Case, cosimulation: CoSimulation, catalog: Catalog) -> None:
    """Apply an event at the current communication point."""
    reference = find(event.variable, catalog)
    element = reference.element
    value = None if event.kind == "release" else case.event_value(event, catalog)
    if event.kind == "release":
        cosimulation.release(reference.key, element)
    elif event.kind == "override":
        cosimulation.override(reference.key, value, element)
    else:
        if element is not None:
            array = np.array(cosimulation.members[reference.member].get(reference.variable.name))
            array.reshape(-1)[element] = value
            value = array
        cosimulation.set(reference.key, value)


def conditions_of(case: Case, catalog: Catalog) -> list[Condition]:
    """Return the conditions of a case for a co-simulation."""
    return [
        Condition(
            spec.condition.instructions(catalog),
            partial(act, spec, case, catalog),
            spec.hold_ns,
            spec.after_ns,
            spec.repeats,
        )
        for spec in case.conditions
    ]


def act(spec: ConditionSpec, case: Case, catalog: Catalog, cosimulation: CoSimulation) -> None:
    """Apply the actions of an event whose condition is met; its stop comes last."""
    for action in spec.actions:
        apply_event(action, case, cosimulation, catalog)
    if spec.stops:
        reason = f": {spec.description}" if spec.description else ""
        text = f"`{spec.condition.text}` ended the run at {clock.text(cosimulation.time)}{reason}"
        cosimulation.conditions.stop(cosimulation, text)


def condition_notes(cases: Sequence[Case], met: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a line for each condition of each variant: when it was met. `met`: occurrences of all cases that were run."""
    lines = []
    for variant in dict.fromkeys(case.variant for case in cases):
        seeds = [case.seed for case in cases if case.variant == variant]
        specs = next(case.conditions for case in cases if case.variant == variant)
        for text in dict.fromkeys(spec.condition.text for spec in specs):
            own = [item for item in met if (item["variant"], item["when"]) == (variant, text)]
            never = [str(seed) for seed in seeds if all(item["seed"] != seed for item in own)]
            times = [
                clock.text(clock.nanoseconds(item["time"])) + f" (seed {item['seed']})" * (len(seeds) > 1)
                for item in own
            ]
            shown = ", ".join(times[:MAX_TIMES])
            if (more := len(times) - MAX_TIMES) > 0:
                shown += f" and {more} more time{'s' * (more > 1)}"
            when = f"met at {shown}" + f", never with seed {', '.join(never)}" * bool(never) if own else "never met"
            lines.append(f"{variant}: condition `{text}` was {when}")
    return lines


def add_occurrences(info: run_folder.RunInfo, added: Sequence[Mapping[str, Any]]) -> None:
    """Add occurrences to the summary of a run."""
    if added:
        info.extra = {**info.extra, OCCURRENCES: [*info.extra.get(OCCURRENCES, []), *added]}


def occurrences(case: Case, cosimulation: CoSimulation) -> list[dict[str, Any]]:
    """Return each time at which a condition was met, for summary.json."""
    counts = dict.fromkeys(range(len(case.conditions)), 0)
    result = []
    for time, index in cosimulation.conditions.met:
        counts[index] += 1
        if counts[index] <= MAX_OCCURRENCES:
            spec = case.conditions[index]
            result.append(
                {
                    "variant": case.variant,
                    "seed": case.seed,
                    "time": clock.seconds(time),
                    "when": spec.condition.text,
                    "event": spec.text,
                    "label": spec.description or spec.condition.text,
                }
            )
    return result
