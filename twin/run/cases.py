"""The parts of a run: a case of a scenario becomes a co-simulation, goes from start to stop, and leaves signals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from twin import clock
from twin.coupling import CoSimulation, IsolatedMember, find
from twin.errors import ScenarioError
from twin.results import Ending, Evaluation, Signals
from twin.results import run_folder as results
from twin.scenario import Form, members

if TYPE_CHECKING:
    from twin.coupling import Catalog, Member, Recorder
    from twin.run.step_refinement import Halved
    from twin.scenario import Case, EventSpec, Scenario

Progress = Callable[[str, float], object]  # name of the case, part of it that is done (0 to 1)


class Hardware(Protocol):
    """What stands for some members of a scenario, such as drives on a bus: given by a package above the engine."""

    @property
    def takes_faults(self) -> bool:
        """Whether it does what the faults among a scenario's events say."""

    def ending(self) -> Ending:
        """How the case that was run last ended."""

    def apply(self, scenario: Scenario) -> Scenario:
        """The scenario with other members; ScenarioError lists what does not fit."""

    def bounds(self) -> list[str]:
        """What it can do at most where the program that drives it is late or dead, known before a run."""

    def report(self) -> dict[str, Any]:
        """What is worth keeping of a run, for its summary."""

    def notes(self) -> list[str]:
        """What the person who runs this has to know."""

    def pictures(self) -> list[dict[str, str]]:
        """Figures for the report: title, svg, note."""


def silent(_name: str, _part: float) -> None:
    """No progress shown."""


@dataclass
class Outcome:
    """What a run of a scenario gave."""

    scenario: Scenario
    catalogs: dict[str, Catalog]
    run: results.Run
    tables: dict[tuple[str, int], Signals] = field(default_factory=dict)
    evaluation: Evaluation = field(default_factory=Evaluation)
    endings: dict[tuple[str, int], Ending] = field(default_factory=dict)  # of hardware
    folder: Path = Path()
    summary: dict[str, Any] = field(default_factory=dict)
    columns: list[results.Column] = field(default_factory=list)  # of all variants
    halved: list[Halved] = field(default_factory=list)  # at half the step, if that was asked for
    systems: dict[tuple[str, str], list[str]] = field(
        default_factory=dict
    )  # drawn, and what it does not show -> variants

    @property
    def passed(self) -> bool:
        """Whether the run is complete and everything that was expected holds."""
        return self.run.status == "completed" and self.evaluation.passed

    def end(self, status: str, reason: str) -> None:
        """Say that the run is not complete, and why; an interruption counts more than a failure."""
        about = self.run
        about.status = status if about.status != "interrupted" else about.status
        about.reason = f"{about.reason}\n{reason}".lstrip()

    def take(self, variant: str, seed: int, signals: Signals, timed: bool = True) -> None:
        """Keep what a case recorded; `timed`: how long it took is known."""
        self.tables[variant, seed] = signals
        if timed and len(signals.time):
            self.run.simulated_time += float(signals.time[-1] - signals.time[0])

    def may_stop(self, case: Case) -> bool:
        """Whether the scenario expects that hardware stops a case: then its end is judged, and the others follow."""
        return any(
            one.ends == "stopped" and (not one.variants or case.variant in one.variants)
            for one in self.scenario.expectations
        )


def prepare(scenario: Scenario) -> dict[str, Catalog]:
    """Variables of all members; ScenarioError with every problem that can be found without running."""
    from twin.scenario import look_up

    catalogs, problems = look_up(scenario)
    if problems:
        raise ScenarioError(problems)
    return catalogs


def refuse_faults(cases: Sequence[Case], hardware: Hardware | None) -> None:
    """Faults happen to simulated drives only; ScenarioError where there are none."""
    if hardware is not None and hardware.takes_faults:
        return
    if problems := [
        f"{fault.where}: fault `{fault.text}` in variant `{case.variant}` happens to simulated drives only. Name their "
        f"hardware file, one with `simulated: true`, with --hardware and no --replay, or run other variants with --variant."
        for case in cases
        for fault in case.faults
    ]:
        raise ScenarioError(list(dict.fromkeys(problems))[:1])


def simulation(case: Case, catalog: Catalog, form: Form, build: Path, recorder: Recorder | None = None) -> CoSimulation:
    """The members of a case, coupled and not yet initialized. `recorder`: where they record, by default into memory."""
    parts: dict[str, Member] = {}
    try:
        for name, spec in case.members.items():
            made = members.component_of(spec)
            # a group has no class that another process could import
            own = Form.fmu if spec.isolate and spec.made else form
            parts[name] = members.make(name, made, case.values(name, catalog[name]), own, build, spec.exchange)
            if spec.isolate:
                parts[name] = IsolatedMember(parts[name], build)
        for part in parts.values():
            if isinstance(part, IsolatedMember):
                part.wait()
        found = {name: part.variables for name, part in parts.items()}
        recorded = [find(path, found).key for path in case.record.select(found)]
        events = [find(event.variable, found) for event in case.events if event.kind == "override"]
        split = {reference.key for reference in events if reference.element is not None}
        periods = {name: every for name, spec in case.members.items() if (every := members.communication(spec))}
        return CoSimulation(
            parts, case.system(found).links(), case.step_ns, case.method(found),
            record=list(dict.fromkeys(recorded)), every=case.record.every_ns or 0, build=build, periods=periods, split=split,
            recorder=recorder, exempt=[name for name, spec in case.members.items() if not spec.finite],
        )  # fmt: skip
    except BaseException:
        for part in parts.values():
            part.close()
        raise


def run_case(case: Case, simulated: CoSimulation, progress: Progress) -> None:
    """Take a case from start to stop, with its events."""
    whole = max(1, case.stop_ns - case.start_ns)
    catalog = {name: member.variables for name, member in simulated.members.items()}

    def advance(until: clock.Time) -> None:
        simulated.advance(until, lambda now: progress(case.name, float((now - case.start_ns) / whole)))

    simulated.initialize(case.start_ns, case.stop_ns)
    for event in case.events:
        advance(event.time_ns)
        if simulated.finished:
            return
        happen(event, case, simulated, catalog)
    advance(case.stop_ns)


def happen(event: EventSpec, case: Case, simulated: CoSimulation, catalog: Catalog) -> None:
    """Let an event happen at the communication point that was reached."""
    reference = find(event.variable, catalog)
    element = reference.element
    value = None if event.kind == "release" else case.event_value(event, catalog)
    if event.kind == "release":
        simulated.release(reference.key, element)
    elif event.kind == "override":
        simulated.override(reference.key, value, element)
    else:
        if element is not None:
            array = np.array(simulated.members[reference.member].get(reference.variable.name))
            array.reshape(-1)[element] = value
            value = array
        simulated.set(reference.key, value)


def columns(scenario: Scenario, catalogs: dict[str, Catalog]) -> list[results.Column]:
    """Every variable that any variant records."""
    found: dict[str, results.Column] = {}
    for case in scenario.variants:
        catalog = {**catalogs[case.variant], **scenario.derived(case.variant)}
        for path in case.record.select(catalog):
            variable = find(path, catalog).variable
            kind = variable.dtype.kind
            is_bit = variable.type in ("Boolean", "Clock")
            whole = np.uint64 if variable.type == "UInt64" else np.int64
            dtype = np.dtype(np.float64 if kind == "f" else np.bool_ if is_bit else whole)
            found.setdefault(
                path,
                results.Column(
                    path,
                    dtype,
                    variable.shape,
                    variable.unit,
                    variable.display_unit,
                    variable.description,
                ),
            )
    return list(found.values())


def signals(simulated: CoSimulation, complete: bool) -> Signals:
    """What a simulation recorded, with units."""
    recording = simulated.recording()
    variables = {f"{m}.{n}": simulated.members[m].variables[n] for m, n in simulated.recorded}
    units = {name: one.unit for name, one in variables.items()}
    displayed = {name: one.display_unit for name, one in variables.items() if one.display_unit}
    return Signals(recording.time, recording.signals, units, complete, displayed)


def note(about: results.Run, lines: list[str]) -> None:
    """Keep remarks for the person who runs this."""
    if lines:
        about.extra = {**about.extra, "notes": [*about.extra.get("notes", []), *lines]}


def analyzed(scenario: Scenario, variant: str, recorded: Signals, progress: Progress = silent) -> Signals:
    """The signals of a complete case with those of its analyses."""
    for one in scenario.analyses:
        if recorded.complete and (not one.variants or variant in one.variants):
            progress(f"{variant}: {one.name}", 1.0)
            recorded = one.apply(recorded)
    return recorded
