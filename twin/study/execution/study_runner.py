"""A study from its file to its folder: samples, then what is searched, then what is told of them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.errors import SimulationError, TwinError
from twin.installed import import_optional
from twin.process import Stop, cores
from twin.results import link_latest, run_folder, write_text
from twin.run import noop
from twin.scenario import Backend, Case, members
from twin.study.design import SAMPLED, CommonPrefixes, Study, StudyRequest, VariantInputs, load_study
from twin.study.execution import case_table, manifest
from twin.study.execution.case_engine import DONE, Engine, Job, Row
from twin.study.execution.journal import NAME as JOURNAL
from twin.study.execution.journal import StudyJournal
from twin.study.execution.process_pool import Pool, memory_of_each
from twin.study.execution.progress import ProgressReporter, StudyProgress, TimeEstimate, finishing_time
from twin.study.execution.tuning import Tuned, tune
from twin.study.execution.worst_case_search import WorstCase, search_worst

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from twin.study.answers import PlotSet
    from twin.study.execution.cluster import WorkerCluster

COPY = "study.yaml"
RUNNING = "running"
REPORT_PERIOD = 2.0  # of reports while cases run, at least [s]
PLOTS_PERIOD = 60.0  # of their plots, which take most of the time, at least [s]
REPORT_SHARE = 0.05  # of the time that each of both takes, at most


@dataclass
class StudyOutcome:
    """Outcome of a study."""

    study: Study
    folder: Path
    cases: case_table.CaseTable
    status: str
    seconds: float = 0.0
    worst: WorstCase | None = None
    tuned: Tuned | None = None
    runs: dict[int, str] = field(default_factory=dict)  # number of a case -> its folder, as from the study's
    before: int = 0  # cases that were done when it went on
    engine: str = ""  # what ran the cases
    begin: float = 0.0  # time at which the command started, as of time.perf_counter
    seconds_before: float = 0.0  # of the commands that it continues

    def take_time(self) -> None:
        """Set `seconds` to the time since the command started: with building, kept cases and plots."""
        if self.begin:
            self.seconds = time.perf_counter() - self.begin


class ReportSoFar:
    """Writes tables, manifest and report of the cases that are done: at once, then every `REPORT_PERIOD` or less often.

    The plots are those of `PLOTS_PERIOD` or less often.
    """

    def __init__(self, outcome: StudyOutcome, journal: StudyJournal, manifest_data: dict[str, Any]) -> None:
        self.outcome, self.journal, self.manifest_data = outcome, journal, manifest_data
        self._due, self._plots_due = 0.0, outcome.begin + PLOTS_PERIOD
        self._plots: PlotSet | None = None

    def update(self, requests: list[StudyRequest], *, is_last: bool = False) -> None:
        """Write the report if it is due, as it is for the last case. OSError if it cannot be written."""
        begin = time.perf_counter()
        if begin < self._due and not is_last:
            return
        from twin.study.answers import PlotSet, write_report

        cases = case_table.finished_cases(self.outcome.study, requests, self.journal)
        done = replace(self.outcome, cases=cases, status=RUNNING)
        write_tables(done, self.journal)
        manifest.write(done.folder, **{**self.manifest_data, **progress_entries(done)})
        write_report(done, self._plots or PlotSet())
        now = time.perf_counter()
        self._due = now + max(REPORT_PERIOD, (now - begin) / REPORT_SHARE)
        if now >= self._plots_due and not is_last:
            self._plots = write_report(done)
            end = time.perf_counter()
            self._plots_due = end + max(PLOTS_PERIOD, (end - now) / REPORT_SHARE)


class PendingCases:
    """Runs what the journal does not have yet. `report`: None writes none while cases run."""

    def __init__(
        self,
        runner: Pool | WorkerCluster,
        journal: StudyJournal,
        reporter: ProgressReporter,
        stop: Stop,
        report: ReportSoFar | None = None,
    ) -> None:
        self.runner, self.journal, self.reporter, self.stop, self.report = runner, journal, reporter, stop, report
        self.requests: list[StudyRequest] = []

    def run(self, requests: Iterable[StudyRequest], part: str) -> list[Row]:
        """Rows of requests, in their order."""
        wanted = list(requests)
        self.requests += wanted
        self.reporter.part = part
        rows = self.runner.run(request for request in wanted if request.number not in self.journal.rows)
        while True:
            with self.stop.armed():
                row = next(rows, None)
            if row is None:
                break
            self.journal.add(row)
            self.reporter.take(row)
            self.write_report()
        return [self.journal.rows[request.number] for request in wanted]

    def write_report(self, *, is_last: bool = False) -> None:
        """Write the report if it is due."""
        if self.report is not None:
            with self.stop.armed():
                self.report.update(self.requests, is_last=is_last)

    def completed_row(self, request: StudyRequest) -> Row:
        """The row of a request that was run."""
        return self.journal.rows[request.number]


def run_study(
    study: Study | str | Path,
    *,
    root: Path = Path("runs"),
    build: Path = Path("build"),
    workers: int = 0,
    scheduler: str = "",
    timeout: float = 0.0,
    memory: int = 0,
    resume: Path | None = None,
    listen: Callable[[StudyProgress], object] = noop,
    notify: Callable[[], object] = noop,
    command: str = "twin.study.run_study",
    report: bool = True,
) -> StudyOutcome:
    """Run a study. After Ctrl-C what is done is kept; `resume`: the folder of one that goes on.

    `workers`: processes on this machine, by default one per core; `scheduler`: address of a dask scheduler instead.
    `memory`: of each process [byte], by default an equal part of the machine's; `timeout`: of a case [s].
    `notify`: called in the signal handler at once, for each Ctrl-C.
    """
    study = load_study(study) if isinstance(study, str | Path) else study
    start_time = time.perf_counter()
    workers = workers or cores()
    with Stop(notify) as stop, ExitStack() as stack:
        folder, manifest_data = prepare_folder(study, root, resume, command)
        journal = stack.enter_context(StudyJournal(folder))
        engine = scheduler or f"{workers} process{'es' * (workers > 1)}"
        cases_so_far = case_table.finished_cases(study, [], journal)
        outcome = StudyOutcome(study, folder, cases_so_far, "completed", engine=engine, begin=start_time)
        outcome.before, requests = len(journal.rows), list[StudyRequest]()
        reporter = ProgressReporter(journal, study.total, listen)
        reporter.finishing = partial(finishing_time, study) if report else reporter.finishing
        reporter.folder = folder
        outcome.seconds_before = manifest_data.get("seconds", 0.0)
        outcome.runs = {
            int(number): run for number, run in manifest_data.get("runs", {}).items() if (folder / run).is_dir()
        }
        so_far = ReportSoFar(outcome, journal, manifest_data) if report else None
        try:
            if so_far is not None:  # before its path is printed
                so_far.update(list(study.requests()))
            reporter.update("preparing the members")
            with stop.armed():
                job = build_job(study, folder / manifest_data["frozen"], build, reporter.update_build)
            reporter.update(f"starting {engine}")
            with closing(
                start_runner(job, study, scheduler, workers, memory or memory_of_each(workers), timeout)
            ) as runner:
                cases = PendingCases(runner, journal, reporter, stop, so_far)
                requests = cases.requests
                run_parts(outcome, cases)
                cases.write_report(is_last=True)
        except KeyboardInterrupt:
            outcome.status = "interrupted"
        except BrokenPipeError:
            raise
        except OSError as error:
            raise SimulationError(unwritten(folder, len(journal.rows), error)) from error
        outcome.cases = case_table.finished_cases(study, requests or list(study.requests()), journal)
        finish(outcome, journal, {**manifest_data, **progress_entries(outcome)}, build, stop, report, reporter)
        outcome.take_time()
        seconds = outcome.seconds_before + outcome.seconds
        manifest.write(folder, **{**manifest.read(folder), "seconds": seconds})
        link_latest(folder)
        if outcome.status == "completed":  # else it goes on from there
            (folder / JOURNAL).unlink()
    return outcome


def finish(
    outcome: StudyOutcome,
    journal: StudyJournal,
    manifest_data: dict[str, Any],
    build: Path,
    stop: Stop,
    report: bool,
    reporter: ProgressReporter,
) -> None:
    """Write tables, manifest and report, and the runs that are kept; SimulationError if they cannot be written."""
    folder = outcome.folder
    reporter.update("writing tables")
    try:
        write_tables(outcome, journal)
        manifest.write(folder, **manifest_data)
        if report:
            from twin.study.answers import PlotSet, write_report

            if outcome.status == "completed":
                keep_runs(outcome, build, stop, reporter)
                manifest.write(folder, **{**manifest_data, "status": outcome.status, "runs": outcome.runs})
            if outcome.status != "completed":  # at once, since a second signal may end the process
                write_report(outcome, PlotSet())
            reporter.update("drawing the plots of the report")
            write_report(outcome)
    except OSError as error:
        raise SimulationError(unwritten(folder, len(journal.rows), error)) from error


def unwritten(folder: Path, count: int, error: OSError) -> str:
    """Why a study cannot be written, and what to do, in one line."""
    why = os.strerror(error.errno) if error.errno else " ".join(str(error).split())
    return f"{folder}: cannot be written ({why}). {count} cases are kept: free some space, then go on with --resume."


def prepare_folder(study: Study, root: Path, resume: Path | None, command: str) -> tuple[Path, dict[str, Any]]:
    """The study's folder with its files and its manifest, which is given too."""
    manifest_data = initial_entries(study, command)
    if resume is not None:
        folder = resume
        stored = manifest.refuse_changed(folder, manifest_data["inputs"])
        manifest_data |= {key: stored[key] for key in ("started", "runs", "seconds") if key in stored}
    else:
        folder = run_folder.make_run_folder(root, study.name)
        write_text(folder / COPY, study.path.read_text(encoding="utf-8"))
    write_text(folder / manifest_data["frozen"], study.scenario.frozen())
    manifest.write(folder, **{**manifest_data, "status": RUNNING})
    return folder, manifest_data


def build_job(study: Study, frozen: Path, build: Path, progress: Callable[[str, float], object] = noop) -> Job:
    """What a process has to know; what the members are made of is built."""
    used = [members.component_of(spec) for case in chosen(study) for spec in case.members.values()]
    members.prebuild(used, Backend.compiled, build, progress)
    bands = tuple((name, band.text) for name, band in study.bands.items())
    options, every = study.scenario.overrides, study.keys.keep.every
    return Job(frozen.resolve(), options, study.all_factors, bands, every, build.resolve())


def run_parts(outcome: StudyOutcome, cases: PendingCases) -> None:
    """The samples, then the worst case, then the tuning."""
    study = outcome.study
    cases.run(study.requests(), SAMPLED)
    number = study.count
    if study.keys.worst is not None:
        outcome.worst = search_worst(study, cases, number)
        number = outcome.worst.last
    if study.keys.tune is not None:
        outcome.tuned = tune(study, cases, number)


def estimate_time(study: Study, *, build: Path, workers: int = 0) -> TimeEstimate:
    """Measure what a study will take: a process is started; here, members are built and three cases of each variant run."""
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", "import twin.study.execution.worker"], check=True)
    requests = {variant: [r for r in study.requests() if r.variant == variant][:3] for variant in study.variants}
    with tempfile.TemporaryDirectory() as folder:
        frozen = Path(folder) / f"{study.scenario.name}.yaml"
        write_text(frozen, study.scenario.frozen())
        engine = Engine(build_job(study, frozen, build))
        first = [engine.row(own[0]) for own in requests.values()]  # makes the members, too
        preparation = time.perf_counter() - begin
        rows = {variant: [engine.row(request) for request in own[1:] or own] for variant, own in requests.items()}
    seconds = {variant: sum(row.seconds for row in own) / len(own) for variant, own in rows.items()}
    counts = dict.fromkeys(study.variants, study.count // len(study.variants))
    for search, count in study.searched_cases.items():
        counts[search or study.variants[0]] += count
    failures = [row.why for row in (*first, *(row for own in rows.values() for row in own)) if row.status != DONE]
    return TimeEstimate(counts, seconds, preparation, workers or cores(), tuple(dict.fromkeys(failures)))


def chosen(study: Study) -> list[Case]:
    """The variants that are run."""
    return [case for case in study.scenario.variants if case.variant in study.variants]


def start_runner(
    job: Job, study: Study, scheduler: str, workers: int, memory: int, timeout: float
) -> Pool | WorkerCluster:
    """Processes here, or on a cluster."""
    if not scheduler:
        cases, factors = chosen(study), study.all_factors
        inputs = {case.variant: VariantInputs(case, study.catalogs[case.variant], factors) for case in cases}
        return Pool(job, workers, memory, timeout, partial(CommonPrefixes(cases, factors).groups, inputs=inputs))
    import_optional("distributed", "cluster", "--scheduler")
    from twin.study.execution.cluster import WorkerCluster

    return WorkerCluster(job, scheduler, timeout, study.variants)


def initial_entries(study: Study, command: str) -> dict[str, Any]:
    """What is known of a study before its first case."""
    return {
        "study": study.name,
        "title": study.title,
        "file": str(study.path.resolve()),
        "scenario": str(study.scenario.path.resolve()),
        "frozen": f"{study.scenario.name}_of_study.yaml",
        "options": list(study.scenario.overrides),
        "command": command,
        "started": datetime.now(UTC).astimezone().isoformat(timespec="seconds"),
        "inputs": manifest.inputs(study),
        "versions": manifest.versions(),
        "samples": len(study.design.values),
        "cases": study.count,
        "factors": [
            {
                **{key: getattr(factor, key) for key in ("name", "sets", "scales", "unit", "display_unit", "source")},
                "at_ns": None if factor.at_ns is None else clock.to_json(factor.at_ns),
            }
            for factor in study.all_factors
        ],
    }


def progress_entries(outcome: StudyOutcome) -> dict[str, Any]:
    """What is known after the last one, or so far."""
    rows = outcome.cases.rows
    return {
        "status": outcome.status,
        "done": len(rows),
        "failed": sum(row.status != DONE for row in rows),
        "seconds": outcome.seconds_before + outcome.seconds,
        "engine": outcome.engine,
    }


def write_tables(outcome: StudyOutcome, journal: StudyJournal) -> None:
    """The table of cases, and samples of signals."""
    if not outcome.cases.rows:
        return
    case_table.write(outcome.folder, outcome.cases)
    if outcome.study.bands:
        case_table.write_bands(outcome.folder, list(outcome.study.bands), journal)


def keep_runs(outcome: StudyOutcome, build: Path, stop: Stop, reporter: ProgressReporter) -> None:
    """Run those cases again with all their signals that are worth looking at: the bits are the same."""
    from twin.study.answers import noteworthy
    from twin.study.execution.stored_case import repeat

    wanted = noteworthy(outcome.cases, outcome.study.keys.keep)
    for k, number in enumerate(wanted, 1):
        if number in outcome.runs:  # of a study that goes on
            continue
        reporter.update(f"keeping case {number} ({k} of {len(wanted)})")
        if stop.number:
            outcome.status = "interrupted"
            return
        try:
            again = repeat(outcome.folder, number, root=outcome.folder / "cases", build=build)
        except TwinError:  # its folder cannot be written, say: the study is there all the same
            continue
        if again.run.status == "interrupted":
            outcome.status = "interrupted"
            shutil.rmtree(again.folder, ignore_errors=True)
            return
        outcome.runs[number] = str(again.folder.relative_to(outcome.folder))
