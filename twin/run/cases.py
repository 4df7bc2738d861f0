"""Steps of a run: a case of a scenario becomes a co-simulation, runs from start to stop, and returns signals."""

from __future__ import annotations

import re
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from twin import clock, installed
from twin.coupling import CoSimulation, IsolatedMember, find
from twin.errors import DeclarationError, ScenarioError, TwinError
from twin.results import Evaluation, HardwareTermination, Signals
from twin.results import run_folder as results
from twin.run.conditions import apply_event, conditions_of
from twin.scenario import Backend, members

if TYPE_CHECKING:
    from twin.coupling import Catalog, Member, Recorder
    from twin.run.options import StudyCase
    from twin.run.step_refinement import StepRefinement
    from twin.scenario import Case, EventSpec, ScenarioSpec

SEARCH_TIME = 10.0  # of the line that makes a case fail, at most [s]
PYTHON_ERROR = re.compile(r"Last log: (\S.*:\d+: \w+: .*)")
Progress = Callable[[str, float], object]  # name of the case, completed fraction (0 to 1)


class StartPoint(Protocol):
    """State of a case at a time, from which another process or case continues."""

    @property
    def time_ns(self) -> clock.Time:
        """Simulated time [ns]."""

    @property
    def met(self) -> tuple[tuple[clock.Time, int], ...]:
        """Time [ns] and index of each condition that was met."""


class CaseStates(Protocol):
    """States of a case: the one that it continues from, and those that are saved on the way."""

    @property
    def start(self) -> StartPoint | None:
        """State to continue from; None: the case runs from its begin."""

    def next_time(self, now: clock.Time) -> clock.Time | None:
        """Return the next time after `now` [ns] at which the state is saved; None if there is none."""

    def restore(self, cosimulation: CoSimulation) -> None:
        """Restore the state to continue from."""

    def write(self, cosimulation: CoSimulation) -> None:
        """Save the state at the communication point reached."""


class BusValues(Protocol):
    """Values on a bus that is only received."""

    def receive(self, timeout: float) -> list[tuple[float, dict[str, float]]]:
        """Return arrival time (monotonic clock [s]) and values by name; wait up to `timeout` [s]."""

    def close(self) -> None:
        """Leave the bus."""


class Hardware(Protocol):
    """Replacement of some members of a scenario, such as drives on a bus; implemented by a package above the engine."""

    @property
    def takes_faults(self) -> bool:
        """Whether it executes the faults among a scenario's events."""

    def termination(self) -> HardwareTermination:
        """Return how the last case ended."""

    def apply(self, scenario: ScenarioSpec) -> ScenarioSpec:
        """Return the scenario with its members replaced; ScenarioError lists all mismatches."""

    def listen(self) -> BusValues:
        """Open the bus to receive its process data; no frame is sent."""

    def bounds(self) -> list[str]:
        """Return bounds of the motion after a late cycle or a crash of the control program, known before a run."""

    def report(self) -> dict[str, Any]:
        """Return data of a run for its summary."""

    def notes(self) -> list[str]:
        """Return remarks for the user."""

    def pictures(self) -> list[dict[str, str]]:
        """Return figures for the report: title, svg, note."""


def load_hardware(file: Path, arm: bool, build: Path, *more: Any) -> Hardware:
    """Read a hardware file with the package of the drives: an entry point of the group `twin.hardware`.

    `more`: path of the trace to write, recording to replay, whether nothing is sent; see `hw_bridge.bridge.load`.
    """
    points = list(installed.entry_points("twin.hardware").values())
    if not points:
        raise DeclarationError(f"{file}: no package for drives is installed. Run `pip install -e .` again.")
    hardware: Hardware = points[0].load()(file, arm, build, *more)
    return hardware


def noop(*_: object) -> None:
    """No-op callback."""


@dataclass
class RunResult:
    """Result of a run of a scenario."""

    scenario: ScenarioSpec
    catalogs: dict[str, Catalog]
    run: results.RunInfo
    tables: dict[tuple[str, int], Signals] = field(default_factory=dict)
    evaluation: Evaluation = field(default_factory=Evaluation)
    terminations: dict[tuple[str, int], HardwareTermination] = field(default_factory=dict)  # of hardware
    folder: Path = Path()
    summary: dict[str, Any] = field(default_factory=dict)
    report_progress: Callable[[float], object] = noop  # gets the fraction of the report that is written
    columns: list[results.RecordedVariable] = field(default_factory=list)  # of all variants
    refinements: list[StepRefinement] = field(default_factory=list)  # at half the step, if requested
    structures: dict[tuple[str, str], list[str]] = field(default_factory=dict)  # (SVG, remarks) -> variants
    study_case: StudyCase | None = None
    phases: dict[str, float] = field(default_factory=dict)  # durations beside the simulation [s]

    @property
    def passed(self) -> bool:
        """Whether the run is complete and all acceptance criteria are met."""
        return self.run.status == "completed" and self.evaluation.passed

    def mark_incomplete(self, status: str, reason: str) -> None:
        """Set that the run is incomplete, with the reason; an interruption takes precedence over a failure."""
        info = self.run
        info.status = status if info.status != "interrupted" else info.status
        info.reason = f"{info.reason}\n{reason}".lstrip()

    def add_signals(self, variant: str, seed: int, signals: Signals, timed: bool = True) -> None:
        """Add the signals of a case; `timed`: whether its duration is known."""
        self.tables[variant, seed] = signals
        if timed and len(signals.time):
            self.run.simulated_time += float(signals.time[-1] - signals.time[0])

    def expects_stop(self, case: Case) -> bool:
        """Whether the scenario expects that hardware stops a case: then the following cases are run."""
        return any(
            expectation.ends == "stopped" and (not expectation.variants or case.variant in expectation.variants)
            for expectation in self.scenario.expectations
        )


def resolve_catalogs(scenario: ScenarioSpec) -> dict[str, Catalog]:
    """Return the variables of all members; ScenarioError with every problem that is found without running."""
    from twin.scenario import resolve_variables

    catalogs, problems = resolve_variables(scenario)
    if problems:
        raise ScenarioError(problems)
    return catalogs


def refuse_faults(cases: Sequence[Case], hardware: Hardware | None) -> None:
    """Raise ScenarioError for faults without simulated drives."""
    if hardware is not None and hardware.takes_faults:
        return
    if problems := [
        f"{fault.where}: fault `{fault.text}` in variant `{case.variant}` happens to simulated drives only. Name their "
        f"hardware file, one with `simulated: true`, with --hardware and no --replay, or run other variants with --variant."
        for case in cases
        for fault in case.faults
    ]:
        raise ScenarioError(list(dict.fromkeys(problems))[:1])


def build_simulation(
    case: Case, catalog: Catalog, backend: Backend, build: Path, recorder: Recorder | None = None
) -> CoSimulation:
    """Create the members of a case and couple them, without initialization. `recorder`: in memory by default."""
    instances: dict[str, Member] = {}
    try:
        for name, spec in case.members.items():
            component = members.component_of(spec)
            # a group has no class that another process could import
            member_backend = Backend.fmu if spec.isolate and spec.made else backend
            instances[name] = members.make(
                name,
                component,
                case.values(name, catalog[name]),
                member_backend,
                build,
                spec.exchange,
                spec.names,
                spec.units,
            )
            if spec.isolate:
                instances[name] = IsolatedMember(instances[name], build)
        for instance in instances.values():
            if isinstance(instance, IsolatedMember):
                instance.wait()
        variables = {name: instance.variables for name, instance in instances.items()}
        recorded = [find(path, variables).key for path in case.record.select(variables)]
        events = [find(event.variable, variables) for event in case.actions if event.kind == "override"]
        split_keys = {reference.key for reference in events if reference.element is not None}
        periods = {name: period for name, spec in case.members.items() if (period := members.communication(spec))}
        return CoSimulation(
            instances,
            case.system(variables).links(),
            case.step_ns,
            case.method(variables),
            record=list(dict.fromkeys(recorded)),
            every=case.record.every_ns or 0,
            build=build,
            periods=periods,
            split=split_keys,
            recorder=recorder,
            exempt=[name for name, spec in case.members.items() if not spec.finite],
            threads=case.threads,
            conditions=conditions_of(case, variables),
        )
    except BaseException:
        for instance in instances.values():
            instance.close()
        raise


def run_case(case: Case, cosimulation: CoSimulation, progress: Progress, states: CaseStates | None = None) -> None:
    """Run a case with its events to its stop: from its start, or from a saved state. `states`: that one, and those to save."""
    duration = max(1, case.stop_ns - case.start_ns)
    catalog = {name: member.variables for name, member in cosimulation.members.items()}

    def report(now: clock.Time) -> None:
        progress(case.name, float((now - case.start_ns) / duration))

    def advance(until: clock.Time) -> None:
        while states and not cosimulation.finished:
            due = states.next_time(cosimulation.time)
            if due is None or due > until:
                break
            cosimulation.advance(due, report)
            if not cosimulation.finished:
                states.write(cosimulation)
        if not cosimulation.finished:
            cosimulation.advance(until, report)

    start = states.start if states else None
    cosimulation.initialize(case.start_ns, case.stop_ns, first_row=start is None)
    begin = case.start_ns
    if states and start:
        # Events before the saved state are applied for their overrides; the values are replaced by those of the state.
        begin = start.time_ns
        for event in events_before(case, begin, start.met):
            apply_event(event, case, cosimulation, catalog)
        states.restore(cosimulation)
    for event in case.events:
        if event.time_ns < begin:
            continue
        advance(event.time_ns)
        if cosimulation.finished:
            return
        apply_event(event, case, cosimulation, catalog)
    advance(case.stop_ns)


def failing_line(case: Case, catalog: Catalog, build: Path) -> str:
    """Return file, line and error of a component's code where a case fails, found by running it as Python; "" if none is.

    The backends give the same values to the bit, so that it fails at the same time; it ends after `SEARCH_TIME`.
    """
    deadline = time.monotonic() + SEARCH_TIME

    def check(_case: str, _part: float) -> None:
        if time.monotonic() > deadline:
            raise TimeoutError

    error = ""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        cosimulation: CoSimulation | None = None
        try:
            cosimulation = build_simulation(case, catalog, Backend.interpreted, build)
            run_case(case, cosimulation, check)
        except (TwinError, TimeoutError) as failure:
            error = str(failure)
        finally:
            if cosimulation is not None:
                cosimulation.terminate()
    if raised := PYTHON_ERROR.search(error):
        return raised[1].removesuffix(".")
    numeric = [warning for warning in caught if issubclass(warning.category, RuntimeWarning)]
    return f"{numeric[0].filename}:{numeric[0].lineno}: {numeric[0].message}" if numeric else ""


def events_before(case: Case, time_ns: clock.Time, met: Sequence[tuple[clock.Time, int]]) -> list[EventSpec]:
    """Return all that happened before a checkpoint, in order: at one time, events with a condition come first.

    `met`: time [ns] and index of each condition that was met.
    """
    changes = [(time, action) for time, index in met for action in case.conditions[index].actions]
    changes += [(event.time_ns, event) for event in case.events if event.time_ns < time_ns]
    return [event for _, event in sorted(changes, key=lambda change: change[0])]


def list_recorded_columns(scenario: ScenarioSpec, catalogs: dict[str, Catalog]) -> list[results.RecordedVariable]:
    """List every variable that any variant records."""
    columns: dict[str, results.RecordedVariable] = {}
    for case in scenario.variants:
        catalog = {**catalogs[case.variant], **scenario.derived(case.variant)}
        for path in case.record.select(catalog):
            variable = find(path, catalog).variable
            kind = variable.dtype.kind
            is_bit = variable.type in ("Boolean", "Clock")
            integer_type = np.uint64 if variable.type == "UInt64" else np.int64
            dtype = np.dtype(np.float64 if kind == "f" else np.bool_ if is_bit else integer_type)
            columns.setdefault(
                path,
                results.RecordedVariable(
                    path,
                    dtype,
                    variable.shape,
                    variable.unit,
                    variable.display_unit,
                    variable.description,
                ),
            )
    return list(columns.values())


def recorded_signals(cosimulation: CoSimulation, complete: bool) -> Signals:
    """Return the recorded signals of a simulation, with units."""
    recording = cosimulation.recording()
    variables = {f"{m}.{n}": cosimulation.members[m].variables[n] for m, n in cosimulation.recorded}
    units = {name: variable.unit for name, variable in variables.items()}
    displayed = {name: variable.display_unit for name, variable in variables.items() if variable.display_unit}
    return Signals(recording.time, recording.signals, units, complete, displayed)


def add_notes(info: results.RunInfo, lines: list[str]) -> None:
    """Add remarks for the user."""
    if lines:
        info.extra = {**info.extra, "notes": [*info.extra.get("notes", []), *lines]}


def apply_analyses(scenario: ScenarioSpec, variant: str, recorded: Signals, progress: Progress = noop) -> Signals:
    """Add the signals of its analyses to a complete case."""
    for analysis in scenario.analyses:
        if recorded.complete and (not analysis.variants or variant in analysis.variants):
            progress(f"{variant}: analysis {analysis.name}", 1.0)
            recorded = analysis.apply(recorded)
    return recorded
