"""Pictures of the machine in a recorded run: what is drawn of a case, and the recorded values that move it."""

from __future__ import annotations

import ast
import logging
from dataclasses import dataclass, field, replace
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.coupling import find
from twin.errors import TwinError
from twin.live import member_class, scene_data, start_values, targets_and_warnings
from twin.results import Signals, si_conversion
from twin.scenario import lint, resolve_variables
from twin.web import SIZES, build_views

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from twin.results import Expectation
    from twin.scenario import ScenarioSpec
    from twin.viewer.runs import OpenRun, RunCollection

    Array = np.ndarray[Any, Any]

MAX_VALUES = 400_000  # numbers of all signals in an answer: 3 MB
MAX_INSTANTS = 2000  # of an answer: more than a picture can show of a window


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


@dataclass(frozen=True)
class SceneSamples:
    """Values that move views: `time` (n,) [s], `values` by name, (n, ...) [SI]."""

    time: Array
    values: dict[str, Array]


class Scenes:
    """Views of the cases of opened runs, built at the first request for a variant."""

    def __init__(self, runs: RunCollection) -> None:
        self.runs = runs
        self._views: dict[tuple[int, str], list[dict[str, Any]]] = {}

    def views(self, number: int) -> list[dict[str, Any]]:
        """Return the views of a case; none if no component of it is drawn."""
        case = self.runs.cases[number]
        key = (case.run, case.variant)
        if key not in self._views:
            system = recorded_system(self.runs.run_of(case), case.key)
            self._views[key] = [view | force_band(view["parts"], system.expectations) for view in build_views(system)]
        return self._views[key]

    def samples(self, number: int, window: tuple[float, float], instants: int = MAX_INSTANTS) -> SceneSamples:
        """Return the values of a window at so many instants at most, evenly spaced."""
        case = self.runs.cases[number]
        run = self.runs.run_of(case)
        names = dict.fromkeys(moving_signals(self.views(number)))
        time = run.recording.column(case.key, "time")
        begin, end = (int(np.searchsorted(time, edge)) for edge in window)
        size = sum(prod(run.variables[name].shape) for name in names) or 1
        count = max(min(instants, MAX_VALUES // size, end + 1 - begin), 1)
        indices = np.unique(np.linspace(begin, end, count).astype(np.int64))
        indices = indices[indices < len(time)]
        values = {name: run.recording.values(case.key, name)[indices] for name in names}
        units = {name: run.variables[name].unit for name in names}
        si = Signals(time[indices], values, units).to_si(set(values))
        return SceneSamples(time[indices], {name: si[name] for name in names})


def moving_signals(views: list[dict[str, Any]]) -> Iterator[str]:
    """Yield the names of the signals that move views."""
    for view in views:
        for part in view["parts"]:
            yield from part["signals"].values()


def recorded_system(run: OpenRun, case: tuple[str, int]) -> RecordedSystem:
    """Return the system of a case; without its components only scenes, and parts that are found by their signals."""
    recorded = {
        name: RecordedSignal(name, "output")
        for name, variable in run.variables.items()
        if run.recording.has(case, variable.columns[0])
    }
    try:
        scenario, _ = lint(run.scenario_file, imports=False)
    except TwinError:
        return RecordedSystem({}, recorded)
    scenes = tuple(scene_data(scene) for scene in scenario.scenes)
    try:
        system = describe_system(run.scenario_file, case[0], recorded, scenes)
    except Exception as error:  # a component's module may raise anything
        logging.getLogger("twin").debug("viewer", exc_info=error)
        system = RecordedSystem({}, recorded, scenes)
    own = (each for each in scenario.expectations if not each.variants or case[0] in each.variants)
    return replace(system, expectations=tuple(own))


def force_band(parts: Sequence[Mapping[str, Any]], expectations: Sequence[Expectation]) -> dict[str, Any]:
    """Return the band [N] of the displayed contact force from its only expectation; `is_judged` is False if there is not one."""
    shown = {part["kind"]: part["signals"] for part in reversed(parts)}
    signal = shown.get("force", {}).get("measured_force") or shown.get("wall", {}).get("force")
    own = [each for each in expectations if each.signal is not None and ast.unparse(each.signal.tree) == signal]
    bands = [(each.at_least, each.at_most) for each in own if None not in (each.at_least, each.at_most)]
    return {"band": bands[0], "is_judged": True} if len(own) == len(bands) == 1 else {"is_judged": False}


def describe_system(
    file: Path, variant: str, recorded: Mapping[str, RecordedSignal], scenes: tuple[Mapping[str, Any], ...]
) -> RecordedSystem:
    """Return the system of a variant, with classes and sizes of its components."""
    scenario: ScenarioSpec
    scenario, _ = lint(file)
    variables = resolve_variables(scenario)[0][variant]
    case = next(each for each in scenario.variants if each.variant == variant)
    sizes = {}
    for member, own in variables.items():
        for name, start in start_values(case, member, own).items():
            if own[name].causality == "parameter" and name.rpartition(".")[2] in SIZES and start is not None:
                factor, offset = si_conversion(own[name].unit)
                value = (np.asarray(start) * factor + offset).tolist()
                sizes[f"{member}.{name}"] = RecordedSignal(f"{member}.{name}", "parameter", value, False)
    members = {name: member_class(spec) for name, spec in case.members.items()}
    targets, warnings = targets_and_warnings(scenario, variables)
    return RecordedSystem(members, {**recorded, **sizes}, scenes, *limits_in_si(targets, warnings, variables))


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
    limits = tuple({**warning, "above": factor * warning["above"] + offset} for warning, (factor, offset) in scaled)
    return dict(targets), limits


__all__ = ["SceneSamples", "Scenes"]
