"""Execution of a run: every variant with every seed; recordings are preserved however it ends.

Samples go through a ring buffer into `.recording` immediately (`twin.results.recording.stream`), and at the end into
signals.parquet, summary.json and report.html. After a crash the next process continues with the remaining cases, or
finalizes the run.

Over 400 lines: one run, from its first case to its summary.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.coupling import LINE_NOTE, Ring
from twin.errors import ScenarioError, TwinError, nearest
from twin.process import LogLines, Stop, SupervisorChannel
from twin.results import HardwareTermination, Journal, column_to_dict
from twin.results import run_folder as results
from twin.results import stream as streams
from twin.run.cases import (
    Hardware,
    RunResult,
    add_notes,
    apply_analyses,
    build_simulation,
    failing_line,
    list_recorded_columns,
    refuse_faults,
    resolve_catalogs,
    run_case,
)
from twin.run.conditions import add_occurrences, occurrences
from twin.run.finalization import finalize_run
from twin.run.options import RunCallbacks, RunOptions, accept_former_arguments
from twin.run.parameter_table import WARNING, remarks_on_values
from twin.scenario import Backend, displayed, members

if TYPE_CHECKING:
    from twin.coupling import Catalog, CoSimulation, RowLayout
    from twin.run.checkpoint import CaseCheckpoints
    from twin.scenario import Case, ScenarioSpec

LOG = "log.txt"
NO_CALLBACKS = RunCallbacks()
INFO_FIELDS = ("name", "title", "source", "description", "path", "step_ns", "algorithm")  # copied unchanged


def cases_of(scenario: ScenarioSpec, options: RunOptions) -> list[Case]:
    """Return the cases that are run: those of the run that is continued, or of the chosen variants and seeds."""
    return options.origin.cases(scenario) if options.origin else scenario.cases(options.variants, options.seeds)


def run_scenario(
    scenario: ScenarioSpec,
    options: RunOptions | Backend | None = None,
    *,
    hardware: Hardware | None = None,
    channel: SupervisorChannel | None = None,
    callbacks: RunCallbacks = NO_CALLBACKS,
    **former: Any,
) -> RunResult:
    """Run a scenario and write its folder; a failing member or Ctrl-C ends it early with the results so far.

    `channel`: channel to the supervisor (`twin.process.supervise`); without it the run records by itself.
    `former`: arguments before `RunOptions`, accepted for one release.
    """
    options, callbacks = accept_former_arguments(options, callbacks, former)
    refuse_faults(cases_of(scenario, options), hardware)
    if hardware is not None:
        scenario = hardware.apply(scenario)
    catalogs = resolve_catalogs(scenario)
    scenario = displayed(scenario, catalogs)
    remarks = remarks_on_values(scenario, catalogs) if options.origin is None and options.study_case is None else []
    for remark in remarks:
        callbacks.on_log_line(remark)
    cases = cases_of(scenario, options)
    refuse_unknown_members(options.log_patterns, cases)
    refuse_interval(options.checkpoint_ns, cases)
    result = create_result(scenario, catalogs, options.root)
    result.study_case = options.study_case
    result.report_progress = partial(callbacks.progress, "writing the report")
    add_notes(result.run, [remark for remark in remarks if remark.startswith(WARNING)])
    channel, journal = channel or SupervisorChannel(), Journal(result.folder)
    try:
        journal.create(recording_header(result, cases, options.report), channel.owners)
    except OSError as error:
        import shutil

        shutil.rmtree(result.folder, ignore_errors=True)  # it is empty
        raise OSError(error.errno, error.strerror, str(result.folder)) from error
    executor = RunExecutor(result, cases, options, callbacks, hardware, channel, journal)
    try:
        with Stop() as executor.stop:
            channel.keep(resume=str(result.folder), hint=f"Then: twin recover {result.folder}")
            executor.build_members()
            executor.run(cases)
            if options.refine_steps:
                executor.refine_steps()
            executor.finalize()
    finally:
        channel.close()
    return result


def create_result(scenario: ScenarioSpec, catalogs: dict[str, Catalog], root: Path) -> RunResult:
    """Create the result of a run before its first case, with its folder and the frozen scenario."""
    info = results.RunInfo(
        scenario.name,
        scenario.title,
        scenario.source,
        scenario.description,
        str(scenario.path),
        overrides=scenario.overrides,
        step_ns=scenario.step_ns,
        algorithm=scenario.algorithm.described,
    )
    result = RunResult(scenario, catalogs, info, folder=results.make_run_folder(root, scenario.name))
    result.columns = list_recorded_columns(scenario, catalogs)
    results.write_text(result.folder / "scenario.yaml", scenario.frozen())
    return result


def refuse_unknown_members(log_patterns: Sequence[str], cases: Sequence[Case]) -> None:
    """Raise ScenarioError for a pattern of logged members that matches no member."""
    names = list(dict.fromkeys(name for case in cases for name in case.members))
    if problems := [
        f"--log {pattern}: there is no member `{pattern}`. {nearest(pattern, names)}"
        for pattern in log_patterns
        if not any(fnmatchcase(name, pattern) for name in names)
    ]:
        raise ScenarioError(problems)


def refuse_interval(interval: clock.Time, cases: Sequence[Case]) -> None:
    """Raise ScenarioError if checkpoints would lie between communication points."""
    for case in cases:
        if interval and interval % case.step_ns:
            nearest_text = clock.text(max(1, round(interval / case.step_ns)) * case.step_ns)
            raise ScenarioError(
                f"--checkpoint {clock.text(interval)}: is no multiple of the communication step {clock.text(case.step_ns)} "
                f"of variant `{case.variant}`. Use {nearest_text}."
            )


def recording_header(result: RunResult, cases: Sequence[Case], report: bool) -> dict[str, Any]:
    """Return the data that is needed to finalize a run, in addition to its scenario.yaml."""
    info = result.run
    return {
        **{key: getattr(info, key) for key in INFO_FIELDS},
        "step_ns": clock.to_json(info.step_ns),
        "overrides": list(info.overrides),
        "started": info.started.isoformat(),
        "paper_applies": result.scenario.paper_applies,
        "unchanged_variants": list(result.scenario.unchanged_variants),
        "report": report,
        "cases": [[case.variant, case.seed] for case in cases],
        "columns": [column_to_dict(column) for column in result.columns],
    }


@dataclass
class RunExecutor:
    """Executor of a run: cases, options, recording and result."""

    result: RunResult
    cases: list[Case]
    options: RunOptions
    callbacks: RunCallbacks
    hardware: Hardware | None
    channel: SupervisorChannel
    journal: Journal
    stop: Stop = None  # type: ignore[assignment]  # while the run goes on
    checkpoints: CaseCheckpoints | None = None  # of the case in progress

    def report_progress(self, name: str, part: float) -> None:
        """Report the progress of a case, and re-raise an interruption that a callback in native code swallowed."""
        self.callbacks.progress(name, part)
        self.stop.check()

    def build_members(self) -> None:
        """Build FMUs or compiled code of all members; an interrupted run has not recorded anything yet."""
        begin = time.monotonic()
        components = [members.component_of(spec) for case in self.cases for spec in case.members.values()]
        try:
            with self.stop.armed():
                members.prebuild(components, self.options.backend, self.options.build, self.callbacks.progress)
                if self.options.checkpoint_ns:
                    self.refuse_unserializable()
        except KeyboardInterrupt:
            self.result.mark_incomplete("interrupted", "interrupted before the first case")
        except BaseException:
            self.journal.remove()
            raise
        self.result.phases["building"] = time.monotonic() - begin

    def refuse_unserializable(self) -> None:
        """Raise TwinError with a line for each member of any variant whose state cannot be saved in a checkpoint."""
        from twin.coupling import serialization_problems

        problems: list[str] = []
        for case in {case.variant: case for case in self.cases}.values():
            catalog = self.result.catalogs[case.variant]
            cosimulation = build_simulation(case, catalog, self.options.backend, self.options.build)
            problems += serialization_problems(cosimulation.members)
            cosimulation.terminate()
        if problems:
            raise ScenarioError([f"{problem} Run without --checkpoint." for problem in dict.fromkeys(problems)])

    def run(self, cases: Sequence[Case]) -> None:
        """Run the remaining cases; stops after an interruption, a failure on hardware, or a full disk."""
        first = len(self.cases) - len(cases)
        for number, case in enumerate(cases, first):
            if self.result.run.status == "interrupted":
                return
            if self.stop.number:
                self.result.mark_incomplete("interrupted", f"interrupted before {case.name}")
                return
            if not self.execute_case(number, case) and (self.hardware is not None or self.channel.trouble is not None):
                return

    def execute_case(self, number: int, case: Case) -> bool:
        """Run one case; return whether it is complete."""
        result, info = self.result, self.result.run
        self.channel.keep(begun=True)
        self.journal.start_case(number)
        cosimulation: CoSimulation | None = None
        complete, failure, duration = False, "", 0.0
        note_count = len(info.extra.get("notes", []))
        start_time = time.perf_counter()
        try:
            with self.stop.armed():
                cosimulation = self.create_simulation(number, case)
            start_time = time.perf_counter()
            try:
                with self.stop.armed():
                    if self.checkpoints is None:
                        self.callbacks.run_case(case, cosimulation, self.report_progress)
                    else:
                        run_case(case, cosimulation, self.report_progress, self.checkpoints)
            finally:
                duration = time.perf_counter() - start_time + (self.checkpoints.wall_time if self.checkpoints else 0.0)
            duration -= self.callbacks.paused_time()
            reason, is_cut = self.callbacks.early_end()
            complete = not is_cut
            if reason:
                result.mark_incomplete("interrupted", f"{case.name}: {reason}")
            if cosimulation.failure:
                add_notes(info, [f"{case.name}: {cosimulation.failure}"])
        except KeyboardInterrupt:
            result.mark_incomplete(
                "interrupted",
                f"interrupted in {case.name}{' because its supervisor was killed' * self.channel.stopped}",
            )
        except TwinError as error:
            failure = f"{case.name}: {error}"
        except BaseException:  # an error of the engine: drives must be stopped in any case
            if cosimulation is not None:
                cosimulation.terminate()
            raise
        if cosimulation is not None:
            complete, failure = self.finish_case(number, case, cosimulation, complete, failure)
        if LINE_NOTE in failure and self.hardware is None and result.run.status == "completed":
            line = failing_line(case, result.catalogs[case.variant], self.options.build)
            failure = failure.replace(LINE_NOTE, f"It comes from {line}. " if line else LINE_NOTE)
        if failure:
            result.mark_incomplete("failed", failure)
        if changes := self.callbacks.operator_changes():
            add_notes(info, changes)
            result.scenario = replace(result.scenario, paper_applies=False, unchanged_variants=(), summary="")
        info.wall_time += duration
        last = None if cosimulation is None else cosimulation.last
        termination = result.terminations.get((case.variant, case.seed), HardwareTermination())
        self.journal.append_line(
            end=number,
            complete=complete,
            failure=failure,
            interrupted=info.status == "interrupted",
            took=duration,
            last=last,
            notes=info.extra.get("notes", [])[note_count:],
            occurrences=occurrences(case, cosimulation) if cosimulation is not None else [],
            ending=results.to_json_value(vars(termination)),
            members=info.members,
        )
        return complete

    def create_simulation(self, number: int, case: Case) -> CoSimulation:
        """Create the co-simulation of a case; its members' log lines are forwarded immediately."""
        self.channel.note("")
        self.checkpoints = self.create_checkpoints(number, case)
        ring = Ring(self.channel, partial(self.begin_rows, number, case))
        cosimulation = build_simulation(
            case, self.result.catalogs[case.variant], self.options.backend, self.options.build, ring
        )
        self.record_identities(case, cosimulation)
        if self.checkpoints is not None:
            self.checkpoints.identify(cosimulation)
        if self.options.report and case.seed == self.cases[0].seed:
            from twin.run.coupling_report import case_structure

            structure = case_structure(case, cosimulation)
            self.result.structures.setdefault((structure.svg(), structure.summary), []).append(case.variant)
        for name, member in cosimulation.members.items():
            member.logs = any(fnmatchcase(name, pattern) for pattern in self.options.log_patterns)
            member.log = LogLines(
                member.log, partial(self.store_log_line if member.logs else self.forward_log_line, case, name)
            )
        return cosimulation

    def create_checkpoints(self, number: int, case: Case) -> CaseCheckpoints | None:
        """Return the checkpoints of a case, if it continues from one or writes any."""
        options = self.options
        start = options.origin.checkpoints.get((case.variant, case.seed)) if options.origin is not None else None
        if not options.checkpoint_ns and start is None:
            return None
        from twin.run.checkpoint import CaseCheckpoints, common_header

        cases = [(case.variant, case.seed) for case in self.cases]
        common = common_header(self.result.folder, cases, options.backend)
        if start is not None:
            add_notes(self.result.run, [f"{case.name}: continues {start.path} from t = {clock.text(start.time_ns)}"])
        return CaseCheckpoints(
            case, number, self.result.folder, options.checkpoint_ns, start, common, self.channel.sync
        )

    def begin_rows(self, number: int, case: Case, layout: RowLayout) -> tuple[Path, Path]:
        """Begin the file of a case's rows; of a continued case with the rows up to its checkpoint."""
        rows, position = self.journal.append_layout(number, layout)
        if self.checkpoints is not None and self.checkpoints.start is not None:
            from twin.run.continuation import copy_rows

            copy_rows(self.checkpoints.start, case, self.journal.layout, rows)
        return rows, position

    def forward_log_line(self, _case: Case, name: str, line: str) -> None:
        """Forward a member's log line to the supervisor."""
        self.channel.log(name, line)

    def store_log_line(self, case: Case, name: str, line: str) -> None:
        """Forward a member's log line to the supervisor, and write it to the log file."""
        self.channel.log(name, line)
        text = f"{case.name}: {name}: {line}"
        with (self.result.folder / LOG).open("a", encoding="utf-8") as file:
            file.write(text + "\n")
        self.callbacks.on_log_line(text)

    def record_identities(self, case: Case, cosimulation: CoSimulation) -> None:
        """Store the identities of the members."""
        identities = dict(self.result.run.members)
        for name, member in cosimulation.members.items():
            identities.setdefault(name if name not in identities else f"{case.variant}: {name}", member.identity)
        self.result.run.members = identities

    def finish_case(
        self, number: int, case: Case, cosimulation: CoSimulation, complete: bool, failure: str
    ) -> tuple[bool, str]:
        """Terminate the members and add the recorded signals; return whether the case is complete, and the failure."""
        result, info = self.result, self.result.run
        line_counts = {name: len(member.log) for name, member in cosimulation.members.items()}
        cosimulation.terminate()
        if not failure and (
            crashes := [member.crash_text for member in cosimulation.members.values() if member.crash_text]
        ):
            complete, failure = False, f"{case.name}: {crashes[0]}"
        termination = self.hardware.termination() if self.hardware is not None else HardwareTermination()
        result.terminations[case.variant, case.seed] = termination
        if failure and termination.time_ns is not None and result.expects_stop(case):
            complete, failure = True, ""
        for name, member in cosimulation.members.items():
            add_notes(info, [f"{case.name}: {name}: {line}" for line in member.log[line_counts[name] :]])
        add_notes(info, [f"{case.name}: {line}" for line in cosimulation.notes])
        add_occurrences(info, occurrences(case, cosimulation))
        self.channel.shut()
        if complete and (trouble := self.channel.trouble) is not None:
            complete, failure = False, f"{case.name}: the recording cannot go on ({trouble.strerror})."
        recorded = streams.read_case_signals(
            self.journal.folder, number, self.journal.layout, complete, cosimulation.last
        )
        if complete and (problem := cosimulation.watch.spell((part.time, part.values) for part in recorded.parts())):
            complete, failure = False, f"{case.name}: {problem}"
            recorded = replace(recorded, complete=False)
        result.add_signals(
            case.variant, case.seed, apply_analyses(result.scenario, case.variant, recorded, self.callbacks.progress)
        )
        return complete, failure

    def refine_steps(self) -> None:
        """Compare the first complete case of each variant with a run at half the step, which is not recorded."""
        from twin.run.step_refinement import refine_step, summarize_refinements

        result, info = self.result, self.result.run
        first_cases = {case.variant: case for case in reversed(self.cases)}
        for case in (case for case in self.cases if first_cases[case.variant] is case):
            signals = result.tables.get((case.variant, case.seed))
            if signals is None or not signals.complete:
                continue
            try:
                with self.stop.armed():
                    result.refinements += refine_step(
                        result, case, signals, self.options.backend, self.options.build, self.report_progress
                    )
            except KeyboardInterrupt:
                add_notes(info, [f"{case.name} at half the step: interrupted"])
                return
            except TwinError as error:
                add_notes(info, [str(error)])
        if result.refinements:
            add_notes(info, [summarize_refinements(result.refinements)])
            info.extra = {**info.extra, "half_step": [refinement.to_dict() for refinement in result.refinements]}

    def finalize(self) -> None:
        """Write the folder; this is not interrupted."""
        begin, what = time.monotonic(), "report" if self.options.report else "results"
        self.callbacks.progress(f"writing the {what}", 1.0)
        self.channel.note("")
        self.channel.keep(finishing=True)
        self.channel.close()
        finalize_run(self.result, self.cases, self.options.report, self.hardware, self.journal)
        self.result.phases[what] = time.monotonic() - begin
