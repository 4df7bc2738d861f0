"""A run from its first case to its folder: every variant with every seed, whatever happens on the way is kept.

What is recorded goes through a ring into `.recording` at once (`twin.results.stream`), and at the end into signals.parquet,
summary.json and report.html. Where a process dies, the next one goes on from there: with the cases that have not begun,
or at once with the end.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.coupling import Ring
from twin.errors import ScenarioError, TwinError, nearest
from twin.process import Lines, Link, Stop
from twin.results import Ending, Journal, plain_column
from twin.results import run_folder as results
from twin.results import stream as streams
from twin.run.cases import (
    Hardware,
    Outcome,
    Progress,
    analyzed,
    columns,
    note,
    prepare,
    refuse_faults,
    run_case,
    silent,
    simulation,
)
from twin.run.finalization import finish
from twin.scenario import Form, displayed, members

if TYPE_CHECKING:
    from twin.coupling import Catalog, CoSimulation
    from twin.scenario import Case, Scenario

LOG = "log.txt"
ABOUT = ("name", "title", "source", "description", "path", "step_ns", "algorithm")  # of a run, as they are


Course = Callable[["Case", "CoSimulation", Progress], object]  # takes a case from start to end


def unheard(_line: str) -> None:
    """Nobody listens."""


def run_scenario(
    scenario: Scenario,
    form: Form = Form.fmu,
    *,
    variants: Sequence[str] = (),
    seeds: Sequence[int] = (),
    root: Path = Path("runs"),
    build: Path = Path("build"),
    progress: Progress = silent,
    report: bool = True,
    hardware: Hardware | None = None,
    link: Link | None = None,
    half_step: bool = False,
    logged: Sequence[str] = (),
    hear: Callable[[str], object] = unheard,
    course: Course = run_case,
) -> Outcome:
    """Run a scenario and write its folder; a failing member or Ctrl-C ends it early, with what there is written.

    `half_step`: also run the first seed
    of each variant at half the step, and say what that changes. `logged`: members, or patterns of their names, whose FMUs'
    own log goes to log.txt and, line by line, to `hear`.

    `link`: to the process that watches this one (`twin.process.supervise`); without it the run records by itself.
    `course`: what takes each case from its start to its end, where that is not its stop time.
    """
    refuse_faults(scenario.cases(variants, seeds), hardware)
    if hardware is not None:
        scenario = hardware.apply(scenario)
    catalogs = prepare(scenario)
    scenario = displayed(scenario, catalogs)
    cases = scenario.cases(variants, seeds)
    refuse_names(logged, cases)
    outcome = begun(scenario, catalogs, root)
    link, journal = link or Link(), Journal(outcome.folder)
    try:
        journal.begin(header(outcome, cases, report), link.owners)
    except OSError as error:
        import shutil

        shutil.rmtree(outcome.folder, ignore_errors=True)  # nothing is in it
        raise OSError(error.errno, error.strerror, str(outcome.folder)) from error
    work = Work(outcome, cases, form, build, progress, report, hardware, link, journal, logged, hear, course)
    try:
        with Stop() as work.stop:
            link.keep(resume=str(outcome.folder), hint=f"Then: twin recover {outcome.folder}")
            work.build_members()
            work.run(cases)
            if half_step:
                work.halve()
            work.end()
    finally:
        link.close()
    return outcome


def begun(scenario: Scenario, catalogs: dict[str, Catalog], root: Path) -> Outcome:
    """The outcome of a run before its first case, with its folder and the scenario in it."""
    about = results.Run(
        scenario.name,
        scenario.title,
        scenario.source,
        scenario.description,
        str(scenario.path),
        overrides=scenario.overrides,
        step_ns=scenario.step_ns,
        algorithm=scenario.algorithm.described,
    )
    outcome = Outcome(scenario, catalogs, about, folder=results.folder(root, scenario.name))
    outcome.columns = columns(scenario, catalogs)
    results.write_text(outcome.folder / "scenario.yaml", scenario.frozen())
    return outcome


def refuse_names(logged: Sequence[str], cases: Sequence[Case]) -> None:
    """ScenarioError if there is no member whose log is wanted."""
    names = list(dict.fromkeys(name for case in cases for name in case.members))
    if problems := [
        f"--log {one}: there is no member `{one}`. {nearest(one, names)}"
        for one in logged
        if not any(fnmatchcase(name, one) for name in names)
    ]:
        raise ScenarioError(problems)


def header(outcome: Outcome, cases: Sequence[Case], report: bool) -> dict[str, Any]:
    """What is needed to finish a run, besides its scenario.yaml."""
    about = outcome.run
    return {
        **{key: getattr(about, key) for key in ABOUT},
        "step_ns": clock.plain(about.step_ns),
        "overrides": list(about.overrides),
        "started": about.started.isoformat(),
        "paper_applies": outcome.scenario.paper_applies,
        "report": report,
        "cases": [[case.variant, case.seed] for case in cases],
        "columns": [plain_column(one) for one in outcome.columns],
    }


@dataclass
class Work:
    """A run on its way."""

    outcome: Outcome
    cases: list[Case]
    form: Form
    build: Path
    progress: Progress
    report: bool
    hardware: Hardware | None
    link: Link
    journal: Journal
    logged: Sequence[str] = ()  # patterns of members' names
    hear: Callable[[str], object] = unheard
    course: Course = run_case
    stop: Stop = None  # type: ignore[assignment]  # while the run goes on

    def told(self, name: str, part: float) -> None:
        """Show how far a case is, and hear what a callback in native code has swallowed."""
        self.progress(name, part)
        self.stop.check()

    def build_members(self) -> None:
        """Build what the members are made of; a run that is interrupted here has recorded nothing."""
        used = [members.component_of(spec) for case in self.cases for spec in case.members.values()]
        try:
            with self.stop.armed():
                members.prebuild(used, self.form, self.build, self.progress)
        except KeyboardInterrupt:
            self.outcome.end("interrupted", "interrupted before the first case")
        except BaseException:
            self.journal.remove()
            raise

    def run(self, cases: Sequence[Case]) -> None:
        """Run the cases that are left; none follows an interruption, a failure on hardware, a full disk."""
        begun = len(self.cases) - len(cases)
        for number, case in enumerate(cases, begun):
            if self.outcome.run.status == "interrupted":
                return
            if self.stop.number:
                self.outcome.end("interrupted", f"interrupted before {case.name}")
                return
            if not self.one(number, case) and (self.hardware is not None or self.link.trouble is not None):
                return

    def one(self, number: int, case: Case) -> bool:
        """Run one case; whether it is complete."""
        outcome, about = self.outcome, self.outcome.run
        self.link.keep(begun=True)
        self.journal.start(number)
        simulated: CoSimulation | None = None
        complete, failure, took = False, "", 0.0
        before = len(about.extra.get("notes", []))
        begin = time.perf_counter()
        try:
            with self.stop.armed():
                simulated = self.made(number, case)
            begin = time.perf_counter()
            try:
                with self.stop.armed():
                    self.course(case, simulated, self.told)
            finally:
                took = time.perf_counter() - begin
            complete = True
            if simulated.failure:
                note(about, [f"{case.name}: {simulated.failure}"])
        except KeyboardInterrupt:
            outcome.end(
                "interrupted", f"interrupted in {case.name}{', as what watched it was killed' * self.link.stopped}"
            )
        except TwinError as error:
            failure = f"{case.name}: {error}"
        except BaseException:  # nobody's fault but ours: drives are stopped all the same
            if simulated is not None:
                simulated.terminate()
            raise
        if simulated is not None:
            complete, failure = self.close(number, case, simulated, complete, failure)
        if failure:
            outcome.end("failed", failure)
        about.wall_time += took
        last = None if simulated is None else simulated.last
        ending = outcome.endings.get((case.variant, case.seed), Ending())
        self.journal.add(
            end=number,
            complete=complete,
            failure=failure,
            interrupted=about.status == "interrupted",
            took=took,
            last=last,
            notes=about.extra.get("notes", [])[before:],
            ending=results.plain(vars(ending)),
            members=about.members,
        )
        return complete

    def made(self, number: int, case: Case) -> CoSimulation:
        """The members of a case, coupled; what they log is told at once."""
        self.link.note("")
        ring = Ring(self.link, partial(self.journal.rows, number))
        simulated = simulation(case, self.outcome.catalogs[case.variant], self.form, self.build, ring)
        self.identify(case, simulated)
        if self.report and case.seed == self.cases[0].seed:
            from twin.run.coupling_report import structure_of

            found = structure_of(case, simulated)
            self.outcome.systems.setdefault((found.svg(), found.told), []).append(case.variant)
        for name, member in simulated.members.items():
            member.logs = any(fnmatchcase(name, one) for one in self.logged)
            member.log = Lines(member.log, partial(self.heard if member.logs else self.told_of, case, name))
        return simulated

    def told_of(self, _case: Case, name: str, line: str) -> None:
        """A line of a member's log goes to whoever watches."""
        self.link.log(name, line)

    def heard(self, case: Case, name: str, line: str) -> None:
        """And of one whose log is wanted, into its file."""
        self.link.log(name, line)
        text = f"{case.name}: {name}: {line}"
        with (self.outcome.folder / LOG).open("a", encoding="utf-8") as file:
            file.write(text + "\n")
        self.hear(text)

    def identify(self, case: Case, simulated: CoSimulation) -> None:
        """Keep what the members are."""
        found = dict(self.outcome.run.members)
        for name, member in simulated.members.items():
            found.setdefault(name if name not in found else f"{case.variant}: {name}", member.identity)
        self.outcome.run.members = found

    def close(self, number: int, case: Case, simulated: CoSimulation, complete: bool, failure: str) -> tuple[bool, str]:
        """Close the members and take what was recorded; whether the case is complete, and why not."""
        outcome, about = self.outcome, self.outcome.run
        lines = {name: len(member.log) for name, member in simulated.members.items()}
        simulated.terminate()
        if not failure and (deaths := [one.death for one in simulated.members.values() if one.death]):
            complete, failure = False, f"{case.name}: {deaths[0]}"
        ending = self.hardware.ending() if self.hardware is not None else Ending()
        outcome.endings[case.variant, case.seed] = ending
        if failure and ending.time_ns is not None and outcome.may_stop(case):
            complete, failure = True, ""
        for name, member in simulated.members.items():
            note(about, [f"{case.name}: {name}: {line}" for line in member.log[lines[name] :]])
        note(about, [f"{case.name}: {line}" for line in simulated.notes])
        self.link.shut()
        if complete and (trouble := self.link.trouble) is not None:
            complete, failure = False, f"{case.name}: the recording cannot go on ({trouble.strerror})."
        recorded = streams.signals(self.journal.folder, number, self.journal.layout, complete, simulated.last)
        if complete and (spell := simulated.watch.spell((part.time, part.values) for part in recorded.parts())):
            complete, failure = False, f"{case.name}: {spell}"
            recorded = replace(recorded, complete=False)
        outcome.take(case.variant, case.seed, analyzed(outcome.scenario, case.variant, recorded, self.progress))
        return complete, failure

    def halve(self) -> None:
        """Compare the first complete case of each variant with what it is at half the step; nothing of it is recorded."""
        from twin.run.step_refinement import halved, worst

        outcome, about = self.outcome, self.outcome.run
        first = {case.variant: case for case in reversed(self.cases)}
        for case in (one for one in self.cases if first[one.variant] is one):
            whole = outcome.tables.get((case.variant, case.seed))
            if whole is None or not whole.complete:
                continue
            try:
                with self.stop.armed():
                    outcome.halved += halved(outcome, case, whole, self.form, self.build, self.told)
            except KeyboardInterrupt:
                note(about, [f"{case.name} at half the step: interrupted"])
                return
            except TwinError as error:
                note(about, [str(error)])
        if outcome.halved:
            note(about, [worst(outcome.halved)])
            about.extra = {**about.extra, "half_step": [one.plain for one in outcome.halved]}

    def end(self) -> None:
        """Write the folder; what has begun here is not interrupted."""
        self.link.note("")
        self.link.keep(finishing=True)
        self.link.close()
        finish(self.outcome, self.cases, self.report, self.hardware, self.journal)
