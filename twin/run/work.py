"""A run from its first case to its folder: every variant with every seed, whatever happens on the way is kept.

What is recorded goes through a ring into `.recording` at once (`twin.results.stream`), and at the end into signals.parquet,
summary.json and report.html. Where a process dies, the next one goes on from there: with the cases that have not begun,
or at once with the end.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import late
from twin.coupling import Ring
from twin.errors import TwinError
from twin.process import Lines, Link, Stop
from twin.results import Ending, Journal, Stream, column_of, plain_column
from twin.results import recording as results
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
from twin.run.finish import finish
from twin.scenario import Form, members

if TYPE_CHECKING:
    from twin.coupling import CoSimulation
    from twin.scenario import Case, Checked, Scenario

WRITERS = ("pyarrow.parquet",)  # what the end needs, imported while the loop runs
ABOUT = ("name", "title", "source", "description", "path", "step_ns", "algorithm")  # of a run, as they are


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
    known: Checked | None = None,
) -> Outcome:
    """Run a scenario and write its folder; a failing member or Ctrl-C ends it early, with what there is written.

    `known`: what is known of it, if it has been checked with its members already (`twin.scenario.checked`).

    `link`: to the process that watches this one (`twin.process.supervise`); without it the run records by itself.
    """
    refuse_faults(scenario.cases(variants, seeds), hardware)
    if hardware is not None:
        scenario = hardware.apply(scenario)
    catalogs = dict(known.catalogs) if known is not None else prepare(scenario)
    if known is None:
        from twin.scenario import displayed

        scenario = displayed(scenario, catalogs)
    cases = scenario.cases(variants, seeds)
    about = results.Run(
        scenario.name,
        scenario.title,
        scenario.source,
        scenario.description,
        str(scenario.path),
        overrides=scenario.overrides,
        step_ns=scenario.step_ns,
        algorithm=scenario.algorithm,
    )
    outcome = Outcome(scenario, catalogs, about, folder=results.folder(root, scenario.name))
    outcome.columns = columns(scenario, catalogs)
    results.write_text(outcome.folder / "scenario.yaml", scenario.frozen())
    link, journal = link or Link(), Journal(outcome.folder)
    journal.begin(header(outcome, cases, report), link.owners)
    work = Work(outcome, cases, form, build, progress, report, hardware, link, journal)
    try:
        with Stop(last=work.link.watched) as work.stop:
            link.keep(resume=str(outcome.folder), hint=f"Then: twin recover {outcome.folder}")
            work.build_members()
            if known is not None:
                known.keep(build)
            work.run(cases)
            work.end()
    finally:
        link.close()
    return outcome


def header(outcome: Outcome, cases: Sequence[Case], report: bool) -> dict[str, Any]:
    """What is needed to finish a run, besides its scenario.yaml."""
    about = outcome.run
    return {
        **{key: getattr(about, key) for key in ABOUT},
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
    stop: Stop = None  # type: ignore[assignment]  # while the run goes on

    def told(self, name: str, part: float) -> None:
        """Show how far a case is, and hear what a callback in native code has swallowed."""
        self.progress(name, part)
        self.stop.check()

    def build_members(self) -> None:
        """Build what the members are made of; a run that is interrupted here has recorded nothing."""
        used = [spec.built or members.component_of(spec) for case in self.cases for spec in case.members.values()]
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
                with self.stop.armed(), late.ahead(*(WRITERS if self.hardware is None else ())):
                    run_case(case, simulated, self.told)
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
        for name, member in simulated.members.items():
            member.log = Lines(member.log, partial(self.link.log, name))
        return simulated

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

    def end(self) -> None:
        """Write the folder; what has begun here is not interrupted."""
        self.link.note("")
        self.link.keep(finishing=True)
        self.link.close()
        finish(self.outcome, self.cases, self.report, self.hardware, self.journal)


def resume(
    folder: Path,
    form: Form = Form.fmu,
    *,
    link: Link,
    build: Path = Path("build"),
    progress: Progress = silent,
    report: bool = True,
    others: bool = False,
) -> Outcome:
    """Finish a run whose process died, from its recording. `others`: first run the cases that had not begun."""
    journal = Journal(folder)
    journal.own(link.owners)
    recorded = streams.read(folder)
    work = restored(recorded, folder, link, form, build, progress, report, journal)
    with Stop(last=work.link.watched) as work.stop:
        work.link.keep(resume=str(folder), hint=f"Then: twin recover {folder}")
        left = bury(work, recorded)
        if others and left:
            work.build_members()
            work.run(left)
        elif left:
            work.outcome.end("interrupted", f"{len(left)} of {len(work.cases)} cases had not begun")
        try:
            work.end()
        finally:
            work.link.close()
    return work.outcome


def restored(
    recorded: Stream,
    folder: Path,
    link: Link,
    form: Form,
    build: Path,
    progress: Progress,
    report: bool,
    journal: Journal,
) -> Work:
    """A run as its recording tells it: the cases that have ended are in its tables."""
    from twin.scenario import displayed, load_scenario

    told = recorded.about
    scenario = load_scenario(folder / "scenario.yaml")
    own = {key: told[key] for key in ("name", "title", "description", "source", "paper_applies")}
    scenario = replace(scenario, path=Path(told["path"]), overrides=tuple(told["overrides"]), **own)
    catalogs: dict[str, Any] = {}
    with suppress(TwinError):  # an FMU may be gone, and what it recorded is there
        catalogs = prepare(scenario)
        scenario = displayed(scenario, catalogs)
    about = results.Run(
        **{key: told[key] for key in ABOUT},
        overrides=tuple(told["overrides"]),
        started=datetime.fromisoformat(told["started"]),
    )
    outcome = Outcome(scenario, catalogs, about, folder=folder)
    outcome.columns = [column_of(one) for one in told["columns"]]
    variants = {case.variant: case for case in scenario.variants}
    cases = [replace(variants[variant], seed=seed) for variant, seed in recorded.cases]
    return Work(outcome, cases, form, build, progress, report and told["report"], None, link, journal)


def bury(work: Work, recorded: Stream) -> list[Case]:
    """Take over the cases that have ended, and end the one that died; those that have not begun."""
    outcome, link = work.outcome, work.link
    for part in recorded.parts:
        variant, seed = recorded.cases[part.number]
        if part.end is None:
            death = recorded.located(part.number, link.death)
            part.end = {
                "end": part.number,
                "complete": False,
                "failure": f"{variant}, seed {seed}: {death.text()}",
                "interrupted": death.from_outside,
                "took": 0.0,
                "last": None,
            }
            work.journal.add(**part.end)
        end = part.end
        outcome.run.wall_time += end["took"]
        outcome.run.members = end.get("members") or outcome.run.members
        note(outcome.run, end.get("notes", []))
        if ending := end.get("ending"):
            outcome.endings[variant, seed] = Ending(**{**ending, "log": tuple(ending["log"])})
        signals = analyzed(outcome.scenario, variant, recorded.signals(part.number), work.progress)
        outcome.take(variant, seed, signals, timed=bool(end["took"]))
        if end["interrupted"]:
            outcome.end("interrupted", end["failure"] or f"interrupted in {variant}, seed {seed}")
        elif end["failure"]:
            outcome.end("failed", end["failure"])
    begun = len(recorded.parts)
    if link.death is not None and link.death.from_outside and begun < len(work.cases):
        outcome.end("interrupted", link.death.text())
    return work.cases[begun:] if outcome.run.status != "interrupted" else []


def recover(folder: Path, *, report: bool = True, progress: Progress = silent) -> Outcome:
    """Finish a run that nobody finishes any more, from its recording; TwinError if there is nothing to finish."""
    if not (folder / streams.FOLDER).exists():
        what = "is complete" if (folder / "summary.json").exists() else "is no folder of a run"
        raise TwinError(f"{folder}: {what}: there is nothing to recover.")
    if not streams.abandoned(folder):
        raise TwinError(f"{folder}: the run goes on. Wait for it, or end it with Ctrl-C.")
    if not streams.has_begun(folder):
        Journal(folder).remove()
        raise TwinError(f"{folder}: was killed before anything was recorded.")
    return resume(folder, link=Link(), report=report, progress=progress)
