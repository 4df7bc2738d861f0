"""Build the catalog of a session from its case and its members."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from math import lcm
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import catalog as components
from twin.component import unit
from twin.errors import CouplingError
from twin.live.catalog import Catalog, Control, Event, Signal
from twin.scenario import EventSpec, connected, controls_of, event_problems, short

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling import Catalog as Variables
    from twin.coupling import CoSimulation, MemberVariable
    from twin.scenario import Case, FaultSpec, MemberSpec, Scenario

MAX_RECORDED_ELEMENTS = 16  # elements of an array that is recorded by default
MAX_START_ELEMENTS = 64  # elements of an array whose start value is sent
KINDS = {"output": "output", "input": "input", "parameter": "parameter", "structuralParameter": "parameter"}
EVENT_VERBS = {"set": "set to", "override": "overridden by", "release": "released"}


def recorded_names(case: Case, catalog: Variables, more: tuple[str, ...]) -> list[str]:
    """Return the names of recorded variables: those of the scenario, `more`, small outputs and all free inputs."""
    targets = connected(case, catalog)
    wanted = replace(case.record, patterns=(*case.record.patterns, *more)).select(catalog)
    small = [
        f"{member}.{name}"
        for member, variables in catalog.items()
        for name, one in variables.items()
        if one.connectable and one.size <= MAX_RECORDED_ELEMENTS and one.type != "Clock"
        and (one.causality == "output" or (one.causality == "input" and f"{member}.{name}" not in targets))
    ]  # fmt: skip
    return list(dict.fromkeys([*wanted, *small]))


def display_conversion(one: MemberVariable) -> tuple[str, float, float]:
    """Return display unit, factor and offset of a variable."""
    if one.display_unit and one.unit:
        with suppress(CouplingError):  # an FMU may have any text for a unit
            return one.display_unit, *unit.conversion(one.unit, one.display_unit, one.name)
    return one.unit, 1.0, 0.0


def catalog_of(
    scenario: Scenario, variant: str, case: Case, simulated: CoSimulation, events: Mapping[str, Event],
    drives: bool, wall_clock: bool,
) -> Catalog:  # fmt: skip
    """Build the catalog. `drives`: members are drives; `wall_clock`: the drives determine the time."""
    variables = {name: member.variables for name, member in simulated.members.items()}
    targets, recorded = connected(case, variables), set(simulated.recorded)
    controls = [control(one) for one in controls_of(scenario, case, variables)]
    held = {one.input.partition("[")[0] for one in controls}
    signals = {}
    for member, own in variables.items():
        for name, one in own.items():
            if not one.connectable:
                continue
            path = f"{member}.{name}"
            is_free = one.causality == "input" and path not in targets
            is_held = is_free and (path in held or wall_clock)
            tunable = one.causality == "parameter" and one.variability == "tunable"
            display, factor, offset = display_conversion(one)
            signals[path] = Signal(
                path, member, KINDS.get(one.causality, "local"), one.type, one.shape, one.unit, display, factor, offset,
                one.description, one.minimum, one.maximum, start(case, member, one), dict(one.items),
                (member, name) in recorded, (is_free and not is_held) or tunable, is_free,
            )  # fmt: skip
    plots = [
        (one.title, one.unit, tuple(curve.signal.text for curve in one.curves))
        for one in scenario.plots
        if all(curve.x is None and curve.signal.text.partition("[")[0] in signals for curve in one.curves)
    ]
    return Catalog(
        scenario.name, scenario.title, scenario.description, str(scenario.path), variant, case.seed,
        clock.seconds(case.step_ns), clock.seconds(steps_to_common(case, simulated) * case.step_ns),
        clock.seconds(case.start_ns), clock.seconds(simulated.every), drives, wall_clock,
        {name: component(spec) for name, spec in case.members.items()}, signals, tuple(controls),
        tuple(events.values()), tuple(plots), {one.title: one.band for one in scenario.plots if one.band},
    )  # fmt: skip


def steps_to_common(case: Case, simulated: CoSimulation) -> int:
    """Return the communication steps between points common to all members."""
    return lcm(*(period // case.step_ns for period in simulated.periods.values()))


def component(spec: MemberSpec) -> str:
    """Return the class name of a member's component, or the name of its file."""
    if "#" in spec.component or spec.component.endswith((".fmu", ".csv")):
        return spec.component.rpartition("/")[2]
    made: Any = spec.made or components.component(spec.component)
    name: str = getattr(made, "replaced", made).__name__  # a drive shows as the member that it stands for
    return name


def start(case: Case, member: str, one: MemberVariable) -> Any:
    """Return a start value as plain data; None if there is none or if it is long."""
    given = one.start
    with suppress(CouplingError):
        given = case.values(member, {one.name: one}).get(one.name, given)
    if given is None or one.size > MAX_START_ELEMENTS:
        return None
    value = np.asarray(given)
    return value.tolist() if np.all(np.isfinite(value.astype(float))) else None


def control(one: Any) -> Control:
    """Return a control as plain data."""
    spec, variable = one.spec, one.variable
    display, factor, offset = display_conversion(variable)
    return Control(
        spec.input, spec.input, spec.label, spec.description, one.low, one.high, one.rest, spec.dead_zone,
        variable.unit, display, factor, offset, "press" if variable.type == "Boolean" else "hold", spec.stick, spec.keys,
        spec.axis, spec.reverse, spec.buttons,
    )  # fmt: skip


def prepared_events(
    scenario: Scenario, variant: str, case: Case, catalog: Variables, held: set[str], faults: bool
) -> dict[str, tuple[Event, EventSpec | FaultSpec]]:
    """Return the events that can happen in a case: its own first, then those of other variants, each once.

    `held`: inputs moved by a control, which no event of another variant may set; `faults`: simulated drives support faults.
    """
    targets = connected(case, catalog)
    triggers: dict[str, tuple[Event, EventSpec | FaultSpec]] = {}
    names = set()
    for one in sorted(scenario.variants, key=lambda one: one.variant != variant):
        own = one.variant == variant
        events: list[EventSpec | FaultSpec] = [*one.events, *(one.faults if faults else ())]
        for event in events:
            text = event_text(event)
            if text in names and not own:
                continue
            if isinstance(event, EventSpec) and (
                event_problems(event, catalog, targets)
                or (event.kind == "set" and event.variable.partition("[")[0] in held and not own)
            ):
                continue
            names.add(text)
            key, kind = f"event_{len(triggers) + 1}", event.kind if isinstance(event, EventSpec) else "fault"
            at = clock.seconds(event.time_ns) if own else None
            triggers[key] = Event(key, kind, text, "" if own else one.title, at, own), event
    return triggers


def event_text(event: EventSpec | FaultSpec) -> str:
    """Describe an event or a fault in one line."""
    if isinstance(event, EventSpec):
        return (
            f"{event.variable} {EVENT_VERBS[event.kind]}{'' if event.kind == 'release' else f' {short(event.value)}'}"
        )
    return f"fault {event.text}"
