"""What is followed: model, recording, measured signals and estimates of a follow file; every mistake is told with its line."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from twin import clock
from twin.component import PythonComponent
from twin.coupling import MemberVariable, find
from twin.fmi import continuous_states, restart_problem
from twin.follow.changes import Change
from twin.follow.fmu_states import is_settable
from twin.follow.forecast import ForecastSettings
from twin.follow.influence import closed_fmu, component_of, uncorrected_inputs
from twin.follow.readers import read_changes, read_forecast
from twin.follow.schema import EstimateKeys, FollowKeys
from twin.follow.tangents import tangent_problem
from twin.identify import IdentifyKeys, Loader, Output, RecordedExperiment
from twin.scenario import MemberSpec, Node, ScenarioSpec, read

JUMP = 1000.0  # typical distances between the times of a column: a longer one is a jump of the clock


@dataclass(frozen=True)
class EstimatedVariable:
    """An estimated state or parameter, in its own unit. `walk`: standard deviation after one second."""

    name: str
    unit: str
    display_unit: str
    start: float
    deviation: float
    walk: float
    low: float
    high: float


@dataclass(frozen=True)
class FollowProblem:
    """A checked follow file. `lag`: of the smoothed estimates [communication steps], 0 without them."""

    path: Path
    keys: FollowKeys
    scenario: ScenarioSpec
    experiment: RecordedExperiment
    estimates: tuple[EstimatedVariable, ...]
    notes: tuple[str, ...]
    changes: tuple[Change, ...] = ()
    forecast: ForecastSettings | None = None
    lag: int = 0

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Measured signals."""
        return self.experiment.outputs

    @property
    def longest_interval(self) -> float:
        """Longest time without a measurement [communication steps]; infinite without a recording."""
        return float(max(np.diff([0, *times_of(self)]), default=np.inf))

    @property
    def begin(self) -> float:
        """Start of the model [s]."""
        return clock.seconds(self.experiment.case.start_ns)

    @property
    def step(self) -> float:
        """Communication step [s]."""
        return clock.seconds(self.experiment.case.step_ns)

    @property
    def title(self) -> str:
        """Title."""
        return self.keys.title or f"Following {self.experiment.model}"


def load(path: str | Path, recording: str | Path | None = None) -> FollowProblem:
    """Read and check a follow file; ScenarioError lists all problems. `recording`: replaces the file of its `data`."""
    path, problems = Path(path), list[str]()
    root = read(path, str(path), problems)
    if recording is not None:
        root = with_recording(root, str(Path(recording).resolve()))
    return check_model(FollowLoader(path, "", root, frozenset(), problems))


def check_model(loader: FollowLoader) -> FollowProblem:
    """Look up all that a follow file names; ScenarioError lists all problems."""
    path = loader.path
    loader.open()
    if loader.model is None:
        loader.stop_if_wrong()
    loader.look()
    estimates = tuple(loader.estimates())
    loader.check_outputs()
    loader.stop_if_wrong()
    loader.reduce()
    loader.check_influence()
    loader.check_states()
    changes, forecast, lag = read_changes(loader), read_forecast(loader), loader.lag()
    loader.stop_if_wrong()
    assert loader.model is not None
    experiment = loader.recording([])
    problem = FollowProblem(
        path, loader.keys, loader.model, experiment, estimates, tuple(loader.notes), changes, forecast, lag
    )
    if experiment.case.conditions:
        problem = replace(
            problem, notes=(*problem.notes, "events with a condition do not happen while a twin follows.")
        )
    if loader.keys.method.name == "extended" and (reason := tangent_problem(problem)):
        loader.add_problem(reason, "method")
        loader.stop_if_wrong()
    times = times_of(problem)
    used = sum(map(len, times.values()))
    if lost := sum(len(output.values) for output in problem.outputs) - used:
        text = f"{lost} measured values at the start, or in a communication step with another one, are not used."
        problem = replace(problem, notes=(*problem.notes, text))
    return replace(problem, notes=(*problem.notes, *sampling_notes(problem, list(times))))


def sampling_notes(problem: FollowProblem, ticks: list[int]) -> Iterator[str]:
    """Yield a note for each signal that is sampled with inputs from before the correction. `ticks`: of the measurements."""
    case, names = problem.experiment.case, [variable.name for variable in problem.estimates]
    interval = float(np.median(np.diff(ticks))) * case.step_ns if len(ticks) > 1 else np.inf
    for reader, signal, source_input in uncorrected_inputs(case, names, interval):
        member = source_input.partition(".")[0]
        yield (
            f"{reader} samples {signal} at the instant of a correction, when {source_input} still has the value before: "
            f"deviations may be too small. Estimate {source_input} and the states of {member}."
        )


def with_recording(root: Node, file: str) -> Node:
    """Return the keys with another recorded file."""
    data = root.entries.get("data", Node([], root.location))
    first = data.items[0] if data.items else data
    entries = first.entries | {"file": Node(file, data.location)}
    return Node(root.entries | {"data": Node([Node(entries, data.location)], data.location)}, root.location)


class FollowLoader(Loader):
    """Loader of a follow file."""

    schema: ClassVar[type[IdentifyKeys]] = FollowKeys
    required: ClassVar[tuple[tuple[str, str], ...]] = (
        ("data", "data: em.csv"),
        ("outputs", 'outputs: {"tip [mm]": {signal: sheath.tip_position, noise: 0.1 mm}}'),
        ("estimate", "estimate: {sheath.play: {deviation: 0.2 mm, walk: 0.01 mm}}"),
    )
    noise_advice: ClassVar[str] = "Give the standard deviation of the measured values."
    keys: FollowKeys

    def estimates(self) -> list[EstimatedVariable]:
        """Return what is estimated, in the variables' units."""
        result = []
        for name, keys in self.keys.estimate.items():
            path = ("estimate", name)
            variable = self.looked_up(name, self.catalog, *path)
            if variable is None:
                continue
            is_fmu = self.full_case.members[name.partition(".")[0]].component.endswith(".fmu")
            if find(name, self.catalog).size != 1:
                self.add_problem(f"{name} is an array. Name one element, such as {name}[1].", *path)
            elif variable.type != "Float64":
                self.add_problem(f"{name} is {variable.type}: only real numbers (Float64) can be estimated.", *path)
            elif variable.variability == "fixed" and not is_fmu:
                self.add_problem(f"{name} is fixed: it is read at the start only. Name a tunable parameter.", *path)
            elif is_fmu and (problem := self.setting_problem(name, variable)):
                self.add_problem(f"{name} {problem}", *path)
            elif is_fmu and keys.start is None and variable.start is None:
                self.add_problem("the FMU gives no start value. Add `start`.", *path)
            else:
                result.append(self.estimated(name, variable.unit, variable.display_unit, keys))
        return result

    def setting_problem(self, name: str, variable: MemberVariable) -> str:
        """Return why a variable of an FMU cannot be set between two steps; empty if it can."""
        if is_settable(variable):
            return ""
        owner = name.partition(".")[0]
        member = closed_fmu(owner, self.full_case.members[owner])
        if member.continuous and variable.name in continuous_states(member):
            return ""
        if variable.initial not in ("exact", "approx"):
            return f"is {variable.causality} and calculated by the FMU. Name a parameter, a state with a start value, or an input."
        if problem := restart_problem(member):
            return (
                f"cannot be set while the FMU runs, and it cannot be initialized anew: {problem}. "
                "Name a tunable parameter or an input."
            )
        states = " and ".join(continuous_states(member))
        text = f"{owner} is initialized anew after each measurement at its states {states}: all else that it remembers is lost."
        self.notes += [text] * (text not in self.notes)
        return ""

    def estimated(self, name: str, unit: str, display_unit: str, keys: EstimateKeys) -> EstimatedVariable:
        """Return an estimate with its numbers in the variable's unit."""
        path = ("estimate", name)
        member, reference = name.partition(".")[0], find(name, self.catalog)
        given, problems = self.full_case.members[member].values(member, self.catalog[member])
        self.problems += problems
        model = np.ravel(given.get(reference.variable.name, reference.variable.start))[reference.first]

        def value(key: str, raw: Any, default: float) -> float:
            is_difference = key in ("deviation", "walk")
            return default if raw is None else self.quantity(raw, unit, *path, key, is_difference=is_difference)

        low, high = value("from", keys.low, -np.inf), value("to", keys.high, np.inf)
        start, deviation = value("start", keys.start, float(model)), value("deviation", keys.deviation, 0.0)
        walk = value("walk", keys.walk, 0.0)
        if not low < high:
            self.add_problem(f"from {keys.low} is not below to {keys.high}. Swap them.", *path)
        elif not low <= start <= high:
            self.add_problem(f"start {start:g} {unit} is outside of its bounds. Move it.", *path)
        if deviation <= 0.0:
            self.add_problem("is not above zero. Give the standard deviation of the start value.", *path, "deviation")
        if walk < 0.0:
            self.add_problem("is negative. Give the standard deviation of the change in one second.", *path, "walk")
        return EstimatedVariable(name, unit, display_unit, start, deviation, walk, low, high)

    def lag(self) -> int:
        """Return the lag of the smoothed estimates in communication steps."""
        step, lag = self.full_case.step_ns, self.keys.smooth
        if lag is not None and lag < step:
            self.add_problem(
                f"{clock.text(lag)} is shorter than the communication step of {clock.text(step)}. Give a longer lag.",
                "smooth",
            )
        return 0 if lag is None else int(lag // step)

    def check_keys(self, output: Output) -> None:
        """Refuse a measured signal without a noise, or whose delay or offset is to be estimated."""
        path = ("outputs", output.column)
        if output.noise is None:
            self.add_problem("`noise` is missing. Add its standard deviation, such as noise: 0.1 mm.", *path)
        if isinstance(output.delay, str) or isinstance(output.offset, str):
            self.add_problem("delay and offset are not estimated here. Give numbers.", *path)

    def check_outputs(self) -> None:
        """Refuse measured signals without a noise, constant ones, and times that jump."""
        for output in self.compared:
            path = ("outputs", output.column)
            self.check_keys(output)
            if np.ptp(output.values) == 0.0:
                text = f"{output.values[0]:g} {output.unit}".strip()
                self.add_problem(f"is constant ({text}): the sensor does not measure. Leave it out.", *path)
            distances = np.diff(output.time)
            if (distances > JUMP * float(np.median(distances))).any():
                row = int(np.argmax(distances))
                self.add_problem(
                    f"time jumps from {output.time[row]:.6g} s to {output.time[row + 1]:.6g} s. "
                    "Correct the clock, or give the rows after the jump a file of their own.",
                    *path,
                )

    def check_states(self) -> None:
        """Refuse members whose state cannot be copied between the points of the filter."""
        for name, spec in self.reduced.members.items():
            if problem := state_problem(name, spec):
                self.add_problem(
                    f"{name} {problem}. It cannot be followed.", "scenario" if self.keys.scenario else "component"
                )

    def check_influence(self) -> None:
        """Refuse estimates on which no measured signal depends."""
        for name in self.keys.estimate:
            if name.partition(".")[0] not in self.reduced.members:
                self.add_problem(
                    f"no measured signal depends on {name.partition('.')[0]}. Leave it out.", "estimate", name
                )


def state_problem(name: str, spec: MemberSpec) -> str:
    """Return why the state of a member cannot be copied between points; empty if it can."""
    if spec.isolate:
        return "runs in a process of its own: leave out `isolate`"
    if spec.component.endswith(".fmu"):
        return closed_fmu(name, spec).state_copy_problem()
    if spec.exchange.is_specified:
        return "is followed as compiled code: leave out `interface` and what belongs to it"
    component = component_of(spec)
    has_state = not issubclass(component, PythonComponent) or component.state_is_record
    return "" if has_state else "cannot save its state: it is Python-side"


def times_of(problem: FollowProblem) -> dict[int, dict[int, float]]:
    """Return the measured values by communication step and output: what is measured belongs to the nearest step.

    The delay of a signal is subtracted: a value belongs to the time at which it was measured. Values at the start of the
    model are left out, since nothing has been predicted there.
    """
    steps: dict[int, dict[int, float]] = {}
    for number, output in enumerate(problem.outputs):
        offset = float(output.offset)
        ticks = np.rint((output.time - float(output.delay) - problem.begin) / problem.step).astype(int)
        for tick, value in zip(ticks.tolist(), output.values.tolist(), strict=True):
            if tick > 0:
                steps.setdefault(tick, {})[number] = value - offset
    return dict(sorted(steps.items()))
