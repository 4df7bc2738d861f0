"""From a scenario to its results: every variant with every seed, whatever happens on the way is kept."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from twin.component import catalog
from twin.coupling import Algorithm, Connection, CoSimulation, System, find
from twin.errors import CouplingError, ScenarioError, SimulationError, TwinError
from twin.results import Ending, Evaluation, Signals, evaluate
from twin.results import recording as results
from twin.scenario import Form, Scenario, look_up, members

if TYPE_CHECKING:
    from twin.coupling import Catalog, Member
    from twin.scenario import Case

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

    @property
    def passed(self) -> bool:
        """Whether the run is complete and everything that was expected holds."""
        return self.run.status == "completed" and self.evaluation.passed

    def may_stop(self, case: Case) -> bool:
        """Whether the scenario expects that hardware stops a case: then its end is judged, and the others follow."""
        return any(
            one.ends == "stopped" and (not one.variants or case.variant in one.variants)
            for one in self.scenario.expectations
        )


def prepare(scenario: Scenario) -> dict[str, Catalog]:
    """Variables of all members; ScenarioError with every problem that can be found without running."""
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


def simulation(case: Case, catalog: Catalog, form: Form, build: Path) -> CoSimulation:
    """The members of a case, coupled and not yet initialized."""
    parts: dict[str, Member] = {}
    try:
        for name, spec in case.members.items():
            parts[name] = members.make(name, spec.made or spec.component, case.values(name, catalog[name]), form, build)
        found = {name: part.variables for name, part in parts.items()}
        system = System(found, [Connection(one.source, one.target, one.where) for one in case.connections])
        recorded = [find(path, found).key for path in case.record.select(found)]
        events = [find(event.variable, found) for event in case.events if event.kind == "override"]
        split = {reference.key for reference in events if reference.element is not None}
        periods = {name: spec.period_ns for name, spec in case.members.items() if spec.period_ns}
        return CoSimulation(
            parts, system.links(), case.step_ns, Algorithm(case.algorithm),
            record=list(dict.fromkeys(recorded)), every=case.record.every_ns or 0, build=build, periods=periods, split=split,
        )  # fmt: skip
    except BaseException:
        for part in parts.values():
            part.close()
        raise


def run_case(case: Case, simulated: CoSimulation, progress: Progress) -> None:
    """Take a case from start to stop, with its events."""
    whole = max(1, case.stop_ns - case.start_ns)
    catalog = {name: member.variables for name, member in simulated.members.items()}

    def advance(until: int) -> None:
        simulated.advance(until, lambda now: progress(case.name, (now - case.start_ns) / whole))

    simulated.initialize(case.start_ns, case.stop_ns)
    for event in case.events:
        advance(event.time_ns)
        if simulated.finished:
            return
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
    advance(case.stop_ns)


def columns(scenario: Scenario, catalogs: dict[str, Catalog]) -> list[results.Column]:
    """Every variable that any variant records."""
    found: dict[str, results.Column] = {}
    for case in scenario.variants:
        catalog = {**catalogs[case.variant], **scenario.derived(case.variant)}
        for path in case.record.select(catalog):
            variable = find(path, catalog).variable
            kind = variable.dtype.kind
            dtype = np.dtype(np.float64 if kind == "f" else np.bool_ if variable.type == "Boolean" else np.int64)
            found.setdefault(path, results.Column(
                path, dtype, variable.shape, variable.unit, variable.display_unit, variable.description,
            ))  # fmt: skip
    return list(found.values())


def signals(simulated: CoSimulation, complete: bool) -> Signals:
    """What a simulation recorded, with units."""
    recording = simulated.recording()
    units = {f"{m}.{n}": simulated.members[m].variables[n].unit for m, n in simulated.recorded}
    return Signals(recording.time, recording.signals, units, complete)


def run_scenario(
    scenario: Scenario, form: Form = Form.fmu, *, variants: Sequence[str] = (), seeds: Sequence[int] = (),
    root: Path = Path("runs"), build: Path = Path("build"), progress: Progress = silent, report: bool = True,
    hardware: Hardware | None = None,
) -> Outcome:  # fmt: skip
    """Run a scenario and write its folder; a failing member or Ctrl-C ends it early, with what there is written."""
    refuse_faults(scenario.cases(variants, seeds), hardware)
    if hardware is not None:
        scenario = hardware.apply(scenario)
    catalogs = prepare(scenario)
    cases = scenario.cases(variants, seeds)
    about = results.Run(
        scenario.name, scenario.title, scenario.source, scenario.description, str(scenario.path),
        overrides=scenario.overrides, step_ns=scenario.step_ns, algorithm=scenario.algorithm,
    )  # fmt: skip
    outcome = Outcome(scenario, catalogs, about, folder=results.folder(root, scenario.name))
    results.write_text(outcome.folder / "scenario.yaml", scenario.frozen())
    identities: dict[str, dict[str, str]] = {}
    used = [spec.made or spec.component for case in cases for spec in case.members.values()]
    members.prebuild(used, form, build, progress)
    with results.SignalFile(
        outcome.folder / "signals.parquet", columns(scenario, catalogs), {"scenario": scenario.name}
    ) as file:
        for case in cases:
            if not _run_one(case, outcome, form, build, progress, file, identities, hardware):
                break
    about.members = identities
    outcome.evaluation = evaluate(
        scenario.metrics, scenario.expectations, outcome.tables, scenario.paper_applies, outcome.endings
    )
    if hardware is not None:
        about.extra = {**about.extra, "hardware": hardware.report()}
        note(about, hardware.notes())
    write(outcome, cases, report, hardware.pictures() if hardware is not None else [])
    return outcome


def _run_one(
    case: Case, outcome: Outcome, form: Form, build: Path, progress: Progress, file: results.SignalFile,
    identities: dict[str, dict[str, str]], hardware: Hardware | None,
) -> bool:  # fmt: skip
    """Run one case and write what it recorded; False if the run ends here."""
    about = outcome.run
    simulated: CoSimulation | None = None
    complete, failure = False, ""
    try:
        simulated = simulation(case, outcome.catalogs[case.variant], form, build)
        for name, member in simulated.members.items():
            identities.setdefault(name if name not in identities else f"{case.variant}: {name}", member.identity)
        begin = time.perf_counter()
        try:
            run_case(case, simulated, progress)
        finally:
            about.wall_time += time.perf_counter() - begin
        complete = True
        if simulated.failure:
            note(about, [f"{case.name}: {simulated.failure}"])
    except KeyboardInterrupt:
        about.status, about.reason = "interrupted", f"interrupted in {case.name}"
    except (SimulationError, CouplingError, TwinError) as error:
        failure = f"{case.name}: {error}"
    finally:
        if simulated is not None:
            lines = {name: len(member.log) for name, member in simulated.members.items()}
            simulated.terminate()
            ending = outcome.endings[case.variant, case.seed] = hardware.ending() if hardware is not None else Ending()
            if failure and ending.time_ns is not None and outcome.may_stop(case):
                complete, failure = True, ""
            for name, member in simulated.members.items():
                note(about, [f"{case.name}: {name}: {line}" for line in member.log[lines[name] :]])
            recorded = analyzed(outcome.scenario, case.variant, signals(simulated, complete), progress)
            outcome.tables[case.variant, case.seed] = recorded
            file.write(case.variant, case.seed, recorded)
            about.simulated_time += float(recorded.time[-1] - recorded.time[0]) if len(recorded.time) else 0.0
    if failure:
        about.status, about.reason = "failed", failure
    return complete


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


def sources(cases: Iterable[Case]) -> dict[str, str]:
    """Where the parameters' values come from, as their components declare it."""
    found = {}
    for case in cases:
        for name, spec in case.members.items():
            if not spec.component.endswith(".fmu"):
                found.update(
                    {
                        f"{name}.{v.name}": v.source
                        for v in (spec.made or catalog.component(spec.component)).variables
                        if v.source
                    }
                )
    return found


def write(outcome: Outcome, cases: Sequence[Case], report: bool, pictures: Sequence[dict[str, str]] = ()) -> None:
    """Write summary.json and report.html."""
    outcome.summary = results.summary(outcome.run, outcome.evaluation, outcome.tables, outcome.endings)
    results.write_summary(outcome.folder / "summary.json", outcome.summary)
    if report:
        from twin.run import report as page

        distinct = list({case.variant: case for case in cases}.values())
        text = page.html(
            outcome.summary, outcome.evaluation, outcome.tables, plots=outcome.scenario.plots,
            parameters=page.parameters(distinct, outcome.catalogs, sources(distinct)), events=page.events(distinct),
            pictures=pictures, endings=outcome.endings,
        )  # fmt: skip
        results.write_text(outcome.folder / "report.html", text)
