"""Pictures of the machine in a recorded run: what is drawn of a case, and the recorded values that move it."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import TwinError
from twin.results import Signals
from twin.run import (
    RecordedSignal,
    RecordedSystem,
    describe_system,
    expectations_of,
    moving_signals,
    reached_times,
    scene_data,
    system_views,
)
from twin.scenario import lint, resolve_variables

if TYPE_CHECKING:
    from twin.viewer.runs import OpenRun, RunCollection

    Array = np.ndarray[Any, Any]

MAX_VALUES = 400_000  # numbers of all signals in an answer: 3 MB
MAX_INSTANTS = 2000  # of an answer: more than a picture can show of a window


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
            run = self.runs.run_of(case)
            self._views[key] = system_views(
                recorded_system(run, case.key), reached_times(run.summary.get("operation", {}))
            )
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
    try:
        loaded, _ = lint(run.scenario_file)
        variant = next(each for each in loaded.variants if each.variant == case[0])
        return describe_system(loaded, variant, resolve_variables(loaded)[0][case[0]], recorded)
    except Exception as error:  # a component's module may raise anything
        logging.getLogger("twin").debug("viewer", exc_info=error)
        scenes = tuple(scene_data(scene) for scene in scenario.scenes)
        return RecordedSystem({}, recorded, scenes, expectations=expectations_of(scenario, case[0]))


__all__ = ["SceneSamples", "Scenes"]
