"""Pictures of the machine in a recorded case: what is drawn of it, and the signals that move it."""

from __future__ import annotations

import ast
import logging
from contextlib import suppress
from dataclasses import dataclass, field
from math import prod
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import catalog as components
from twin.coupling import find
from twin.errors import CouplingError
from twin.results import Signals, si_conversion
from twin.scenario import resolve_targets, resolve_warning
from twin.scene import nearest_indices, page
from twin.web import SIZES, build_views

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from twin.coupling import Catalog, MemberVariable
    from twin.results import Expectation
    from twin.scenario import Case, MemberSpec, ScenarioSpec
    from twin.scene import Scene

MAX_INSTANTS = 1500  # of a film
MAX_START_ELEMENTS = 64  # elements of an array whose start value is part of a view or a catalog


@dataclass(frozen=True)
class RecordedSignal:
    """A recorded variable, or a parameter with its start value."""

    name: str
    kind: str
    start: Any = None
    recorded: bool = True


@dataclass(frozen=True)
class RecordedSystem:
    """What views are built of: see `twin.web.build_views`."""

    members: Mapping[str, str]
    signals: Mapping[str, RecordedSignal]
    scenes: tuple[Mapping[str, Any], ...] = ()
    targets: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[Mapping[str, Any], ...] = ()
    expectations: tuple[Expectation, ...] = ()


def machine_film(
    views: Sequence[Mapping[str, Any]], signals: Signals, max_values: int, times: Sequence[float] = ()
) -> dict[str, Any]:
    """Return views with the values that move them, packed, at `max_values` numbers in all; what stands has one row.

    `times` [s]: the instants nearest to these are shown, too.
    """
    names = list(dict.fromkeys(moving_signals(views)))
    size = sum(prod(np.shape(signals.values[name])[1:]) for name in names)
    count = min(MAX_INSTANTS, max_values // max(size, 1), len(signals.time))
    indices = np.linspace(0, len(signals.time) - 1, max(count, 1)).astype(np.int64)
    indices = np.union1d(indices, nearest_indices(signals.time, times))
    values = {name: np.asarray(signals.values[name])[indices] for name in names}
    si = Signals(indices, values, signals.units).to_si(set(names))
    rows = {name: si[name][:1] if (si[name] == si[name][:1]).all() else si[name] for name in names}
    return {
        "views": views,
        "time": page.round_values(np.asarray(signals.time)[indices]),
        "signals": [
            {
                "name": name,
                "shape": si[name].shape[1:],
                "integer": values[name].dtype.kind in "biu",
                **page.pack_values(rows[name]),
            }
            for name in names
        ],
    }


def variant_views(
    scenario: ScenarioSpec,
    cases: Sequence[Case],
    catalogs: Mapping[str, Catalog],
    tables: Mapping[tuple[str, int], Signals],
    reached: Mapping[str, float] = MappingProxyType({}),
) -> dict[str, list[dict[str, Any]]]:
    """Return the views of each variant of a run by its name; none where a component's module fails. `reached`: see `system_views`."""
    views = {}
    for case in cases:
        signals = next((table for (variant, _), table in tables.items() if variant == case.variant), None)
        if signals is None or case.variant not in catalogs or not len(signals.time):
            continue
        recorded = {name: RecordedSignal(name, "output") for name in signals.values}
        try:
            views[case.variant] = system_views(
                describe_system(scenario, case, catalogs[case.variant], recorded), reached
            )
        except Exception as error:  # a component's module may raise anything
            logging.getLogger("twin").debug("report", exc_info=error)
    return views


def system_views(system: RecordedSystem, reached: Mapping[str, float] = MappingProxyType({})) -> list[dict[str, Any]]:
    """Return the views of a system, each with the band of its contact force. `reached`: times of its targets [s]."""
    views = build_views(system)
    for target in (target for view in views for target in view["targets"] if target["name"] in reached):
        target["time"] = reached[target["name"]]
    return [view | force_band(view["parts"], system.expectations) for view in views]


def reached_times(operation: Mapping[str, Any]) -> dict[str, float]:
    """Return when an operator reached targets, from the start of the session [s]; `operation`: of summary.json."""
    targets = operation.get("targets", {})
    return dict(targets.get("reached", {}))


def describe_system(
    scenario: ScenarioSpec, case: Case, variables: Catalog, recorded: Mapping[str, RecordedSignal]
) -> RecordedSystem:
    """Return the system of a case, with classes and sizes of its components."""
    sizes = {}
    for member, own in variables.items():
        for name, start in start_values(case, member, own).items():
            if own[name].causality == "parameter" and name.rpartition(".")[2] in SIZES and start is not None:
                factor, offset = si_conversion(own[name].unit)
                value = (np.asarray(start) * factor + offset).tolist()
                sizes[f"{member}.{name}"] = RecordedSignal(f"{member}.{name}", "parameter", value, False)
    return RecordedSystem(
        {name: member_class(spec) for name, spec in case.members.items()},
        {**recorded, **sizes},
        tuple(scene_data(scene) for scene in scenario.scenes),
        *limits_in_si(*targets_and_warnings(scenario, variables), variables),
        expectations_of(scenario, case.variant),
    )


def expectations_of(scenario: ScenarioSpec, variant: str) -> tuple[Expectation, ...]:
    """Return the expectations that name a variant, or all variants."""
    return tuple(each for each in scenario.expectations if not each.variants or variant in each.variants)


def moving_signals(views: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the names of the signals that move views."""
    for view in views:
        for part in view["parts"]:
            yield from part["signals"].values()


def force_band(parts: Sequence[Mapping[str, Any]], expectations: Sequence[Expectation]) -> dict[str, Any]:
    """Return the band [N] of the displayed contact force from its only expectation; `is_judged` is False if there is not one."""
    shown = {part["kind"]: part["signals"] for part in reversed(parts)}
    signal = shown.get("force", {}).get("measured_force") or shown.get("wall", {}).get("force")
    own = [each for each in expectations if each.signal is not None and ast.unparse(each.signal.tree) == signal]
    bands = [(each.at_least, each.at_most) for each in own if None not in (each.at_least, each.at_most)]
    return {"band": bands[0], "is_judged": True} if len(own) == len(bands) == 1 else {"is_judged": False}


def limits_in_si(
    targets: Mapping[str, Any], warnings: Sequence[Mapping[str, Any]], variables: Mapping[str, Any]
) -> tuple[dict[str, Any], tuple[dict[str, Any], ...]]:
    """Convert targets and warnings from the units of their signals to SI, like the values that they are compared with."""

    def scale(signal: str) -> tuple[float, float]:
        return si_conversion(find(signal, variables).variable.unit)

    if targets:
        factor, offset = scale(targets["signal"])
        points = {name: [factor * x + offset for x in point] for name, point in targets["points"].items()}
        targets = {**targets, "points": points, "tolerance": factor * targets["tolerance"]}
    scaled = [(warning, scale(warning["signal"])) for warning in warnings]
    limits = tuple(
        {**warning, **{key: factor * warning[key] + offset for key in ("above", "below") if key in warning}}
        for warning, (factor, offset) in scaled
    )
    return dict(targets), limits


def scene_data(scene: Scene) -> dict[str, Any]:
    """Return a scene as plain data: what stands, and the names of the signals that move. Expressions are left out."""
    motions = {name: spec.single.name for name, spec in scene.motions.items() if spec.single is not None}
    return {
        "title": scene.title,
        "walls": [page.wall_data(wall) for wall in (scene.environment.walls if scene.environment else ())],
        "axes": list(scene.axes),
        "motions": motions,
        "lines": [{"signal": line.signal, "label": line.label, "width": 1e3 * line.width} for line in scene.lines],
        "points": [{"signal": mark.signal, "label": mark.label} for mark in scene.points if mark.signal],
        "arrows": [{"signal": arrow.signal, "label": arrow.label, "at": arrow.at} for arrow in scene.arrows],
    }


def targets_and_warnings(scenario: ScenarioSpec, catalog: Catalog) -> tuple[dict[str, Any], tuple[dict[str, Any], ...]]:
    """Return the targets and warnings of a scenario whose signals this variant has."""
    targets, warnings = dict[str, Any](), list[dict[str, Any]]()
    if scenario.console_targets is not None:
        with suppress(CouplingError):
            targets = resolve_targets(scenario.console_targets, catalog)
    for spec in scenario.console_warnings:
        with suppress(CouplingError):
            warnings.append(resolve_warning(spec, catalog))
    return targets, tuple(warnings)


def member_class(spec: MemberSpec) -> str:
    """Return the class name of a member's component, or the name of its file."""
    if "#" in spec.component or spec.component.endswith((".fmu", ".csv")):
        return spec.component.rpartition("/")[2]
    made: Any = spec.made or components.component(spec.component)
    name: str = getattr(made, "replaced", made).__name__  # a drive shows as the member that it stands for
    return name


def start_values(case: Case, member: str, variables: Mapping[str, MemberVariable]) -> dict[str, Any]:
    """Return the start values of a member's numeric variables as plain data, in their units; None if there is none or if it is long."""
    given = dict[str, Any]()
    with suppress(CouplingError):  # a drive stands for the member that the file sets
        given = case.values(member, variables)
    starts = {name: given.get(name, variable.start) for name, variable in variables.items() if variable.connectable}
    return {
        name: None if start is None or variables[name].size > MAX_START_ELEMENTS else finite_data(start)
        for name, start in starts.items()
    }


def finite_data(value: Any) -> Any:
    """Return numbers as plain data; None if one is not finite."""
    return np.asarray(value).tolist() if np.all(np.isfinite(np.asarray(value, float))) else None
