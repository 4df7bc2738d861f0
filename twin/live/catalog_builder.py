"""Build the catalog of a session from its case and its members."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from math import lcm
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.errors import CouplingError
from twin.live.catalog import Catalog, CatalogControl, CatalogEvent, CatalogSignal
from twin.results import si_conversion
from twin.run import display_conversion, member_class, scene_data, start_values, targets_and_warnings
from twin.scenario import (
    EventSpec,
    connected,
    controls_of,
    event_problems,
    short,
    slider_range,
    space_problem,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling import Catalog as Variables
    from twin.coupling import CoSimulation
    from twin.scenario import Case, FaultSpec, ScenarioSpec
    from twin.scene import Scene

MAX_RECORDED_ELEMENTS = 16  # elements of an array that is recorded by default
KINDS = {"output": "output", "input": "input", "parameter": "parameter", "structuralParameter": "parameter"}
EVENT_VERBS = {"set": "set to", "override": "overridden by", "release": "released"}


def recorded_names(case: Case, catalog: Variables, more: tuple[str, ...]) -> list[str]:
    """Return the names of recorded variables: those of the scenario, `more`, small outputs and all free inputs."""
    targets = connected(case, catalog)
    wanted = replace(case.record, patterns=(*case.record.patterns, *more)).select(catalog)
    small = [
        f"{member}.{name}"
        for member, variables in catalog.items()
        for name, variable in variables.items()
        if variable.connectable
        and variable.size <= MAX_RECORDED_ELEMENTS
        and variable.type != "Clock"
        and (variable.causality == "output" or (variable.causality == "input" and f"{member}.{name}" not in targets))
    ]
    return list(dict.fromkeys([*wanted, *small]))


def catalog_of(
    scenario: ScenarioSpec,
    original: ScenarioSpec,
    variant: str,
    case: Case,
    simulated: CoSimulation,
    events: Mapping[str, CatalogEvent],
    drives: bool,
    wall_clock: bool,
) -> Catalog:
    """Build the catalog. `scenario`: of the session, one variant of `original` without an end; `drives`: members are drives;
    `wall_clock`: the drives determine the time.
    """
    original_case = next(each for each in original.variants if each.variant == variant)
    variables = {name: member.variables for name, member in simulated.members.items()}
    controls = [control(control_spec) for control_spec in controls_of(scenario, case, variables)]
    signals = signals_of(case, simulated, {item.input.partition("[")[0] for item in controls}, wall_clock)
    plots = [
        (plot.title, plot.unit, tuple(curve.signal.text for curve in plot.curves))
        for plot in scenario.plots
        if all(curve.x is None and curve.signal.text.partition("[")[0] in signals for curve in plot.curves)
    ]
    return Catalog(
        scenario.name,
        scenario.title,
        scenario.description,
        str(scenario.path),
        variant,
        case.seed,
        clock.seconds(case.step_ns),
        clock.seconds(steps_to_common(case, simulated) * case.step_ns),
        clock.seconds(case.start_ns),
        clock.seconds(simulated.every),
        drives,
        wall_clock,
        {name: member_class(spec) for name, spec in case.members.items()},
        signals,
        tuple(controls),
        tuple(events.values()),
        tuple(plots),
        {plot.title: plot.band for plot in scenario.plots if plot.band},
        {each.variant: each.title for each in original.variants},
        clock.seconds(original_case.stop_ns),
        listed_parameters(original, original_case, variables, signals),
        *targets_and_warnings(original, variables),
        tuple(scene_data(scene) for scene in scenario.scenes),
        tuple(space_data(scene, case, variables) for scene in spaces_of(scenario, variant, variables)),
        {plot.title: plot.lines for plot in scenario.plots if plot.lines},
        {curve.signal.text: curve.label for plot in scenario.plots for curve in plot.curves},
    )


def spaces_of(scenario: ScenarioSpec, variant: str, variables: Variables) -> list[Scene]:
    """Return the scenes in three dimensions of a variant that has all of their signals."""
    scenes = [scene for scene in scenario.scenes if variant in (scene.variants or (variant,))]
    return [scene for scene in scenes if scene.space is not None and not space_problem(scene.space, variables)]


def space_data(scene: Scene, case: Case, variables: Variables) -> dict[str, Any]:
    """Return a scene in three dimensions as plain data: title, axes, specification, and the parameters of its path in SI."""
    assert scene.space is not None
    path = scene.space.path
    parameters = {}
    for name in (*path.curvature, path.diameter) if path else ():
        member, _, variable = name.partition(".")
        own = variables[member][variable]
        factor, offset = si_conversion(own.unit)
        values = case.values(member, variables[member]).get(variable, own.start)
        parameters[name] = (np.asarray(values, float) * factor + offset).tolist()
    return {
        "title": scene.title,
        "axes": list(scene.axes),
        "space": scene.space.plain(),
        "curvature": [parameters[name] for name in path.curvature] if path else [],
        "diameter": parameters[path.diameter] if path else [],
    }


def listed_parameters(
    scenario: ScenarioSpec, case: Case, catalog: Variables, signals: Mapping[str, CatalogSignal]
) -> dict[str, tuple[float, float] | None]:
    """Return what the page lists first, with slider ends: `console.parameters`, or all that the scenario sets itself."""
    listed: dict[str, tuple[float, float] | None] = {}
    for name in scenario.console_parameters:
        with suppress(CouplingError):  # not in this variant
            listed[name] = slider_range(scenario, case, catalog, name)
    if listed:
        return listed
    given = (f"{member}.{name}" for member, spec in case.members.items() for name in spec.parameters)
    return {
        name: None for name in given if name in signals and signals[name].settable and signals[name].kind == "parameter"
    }


def signals_of(case: Case, simulated: CoSimulation, held: set[str], wall_clock: bool) -> dict[str, CatalogSignal]:
    """Return the signals of all members by name. `held`: inputs of controls; `wall_clock`: drives determine the time."""
    variables = {name: member.variables for name, member in simulated.members.items()}
    targets, recorded = connected(case, variables), set(simulated.recorded)
    signals = {}
    for member, own in variables.items():
        starts = start_values(case, member, own)
        for name, variable in own.items():
            if not variable.connectable:
                continue
            path = f"{member}.{name}"
            is_free = variable.causality == "input" and path not in targets
            is_held = is_free and (path in held or wall_clock)
            tunable = variable.causality == "parameter" and variable.variability == "tunable"
            display, factor, offset = display_conversion(variable)
            signals[path] = CatalogSignal(
                path,
                member,
                KINDS.get(variable.causality, "local"),
                variable.type,
                variable.shape,
                variable.unit,
                display,
                factor,
                offset,
                variable.description,
                variable.minimum,
                variable.maximum,
                starts[name],
                dict(variable.items),
                (member, name) in recorded,
                (is_free and not is_held) or tunable,
                is_free,
            )
    return signals


def steps_to_common(case: Case, simulated: CoSimulation) -> int:
    """Return the communication steps between points common to all members."""
    return lcm(*(period // case.step_ns for period in simulated.periods.values()))


def control(bounded: Any) -> CatalogControl:
    """Return a control as plain data."""
    spec, variable = bounded.spec, bounded.variable
    display, factor, offset = display_conversion(variable)
    return CatalogControl(
        spec.input,
        spec.input,
        spec.label,
        spec.description,
        bounded.low,
        bounded.high,
        bounded.rest,
        spec.dead_zone,
        variable.unit,
        display,
        factor,
        offset,
        "press" if variable.type == "Boolean" else "hold",
        spec.stick,
        spec.keys,
        spec.axis,
        spec.reverse,
        spec.buttons,
        tuple(spec.along),
    )


def prepared_events(
    scenario: ScenarioSpec, variant: str, case: Case, catalog: Variables, held: set[str], faults: bool
) -> dict[str, tuple[CatalogEvent, EventSpec | FaultSpec]]:
    """Return the events that can happen in a case: its own first, then those of other variants, each once.

    `held`: inputs moved by a control, which no event of another variant may set; `faults`: simulated drives support faults.
    """
    targets = connected(case, catalog)
    triggers: dict[str, tuple[CatalogEvent, EventSpec | FaultSpec]] = {}
    names = set()
    for other_case in sorted(scenario.variants, key=lambda candidate: candidate.variant != variant):
        own = other_case.variant == variant
        events: list[EventSpec | FaultSpec] = [*other_case.events, *(other_case.faults if faults else ())]
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
            triggers[key] = CatalogEvent(key, kind, text, "" if own else other_case.title, at, own), event
    return triggers


def event_text(event: EventSpec | FaultSpec) -> str:
    """Describe an event or a fault in one line."""
    if isinstance(event, EventSpec):
        return (
            f"{event.variable} {EVENT_VERBS[event.kind]}{'' if event.kind == 'release' else f' {short(event.value)}'}"
        )
    return f"fault {event.text}"
