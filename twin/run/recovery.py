"""Recovery of a run whose process died, by its successor or by `twin recover`."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.errors import TwinError
from twin.process import Stop, SupervisorChannel
from twin.results import HardwareTermination, Journal, RunRecording, column_from_dict
from twin.results import run_folder as results
from twin.results import stream as streams
from twin.run.cases import Progress, RunResult, add_notes, apply_analyses, noop, resolve_catalogs
from twin.run.conditions import add_occurrences
from twin.run.executor import INFO_FIELDS, NO_CALLBACKS, RunExecutor
from twin.run.finalization import OPERATED
from twin.run.options import RunCallbacks, RunOptions

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.scenario import Case, ScenarioSpec


def resume(
    folder: Path,
    options: RunOptions,
    *,
    channel: SupervisorChannel,
    callbacks: RunCallbacks = NO_CALLBACKS,
    run_remaining: bool = False,
) -> RunResult:
    """Finalize a run whose process died, from its recording. `run_remaining`: first run the remaining cases."""
    journal = Journal(folder)
    journal.set_owners(channel.owners)
    recording = streams.read_recording(folder)
    executor = restore_executor(recording, options, callbacks, channel, journal)
    with Stop() as executor.stop:
        executor.channel.keep(resume=str(folder), hint=f"Then: twin recover {folder}")
        remaining = finalize_dead_cases(executor, recording)
        if run_remaining and remaining:
            executor.build_members()
            executor.run(remaining)
        elif remaining:
            executor.result.mark_incomplete(
                "interrupted", f"{len(remaining)} of {len(executor.cases)} cases had not begun"
            )
        try:
            executor.finalize()
        finally:
            executor.channel.close()
    return executor.result


def restore_executor(
    recording: RunRecording,
    options: RunOptions,
    callbacks: RunCallbacks,
    channel: SupervisorChannel,
    journal: Journal,
) -> RunExecutor:
    """Restore the executor of a run from its recording, without its cases."""
    from twin.scenario import displayed, load_scenario

    data, folder = recording.header, recording.folder.parent
    options = replace(options, report=options.report and data["report"])
    is_session = (folder / OPERATED).exists()  # its operator may have changed values
    if is_session:
        data = {**data, "paper_applies": False, "unchanged_variants": []}
    scenario = with_texts(load_scenario(folder / "scenario.yaml"), data)
    catalogs: dict[str, Any] = {}
    with suppress(TwinError):  # an FMU may be missing although its signals were recorded
        catalogs = resolve_catalogs(scenario)
        scenario = displayed(scenario, catalogs)
    info = results.RunInfo(
        **{**{key: data[key] for key in INFO_FIELDS}, "step_ns": clock.from_json(data["step_ns"])},
        overrides=tuple(data["overrides"]),
        started=datetime.fromisoformat(data["started"]),
    )
    result = RunResult(scenario, catalogs, info, folder=folder)
    result.columns = [column_from_dict(column) for column in data["columns"]]
    variants = {case.variant: case for case in scenario.variants}
    cases = [replace(variants[variant], seed=seed) for variant, seed in recording.cases]
    return RunExecutor(result, cases, options, callbacks, None, channel, journal)


def with_texts(scenario: ScenarioSpec, data: Mapping[str, Any]) -> ScenarioSpec:
    """Return a frozen scenario with the name, texts, path and overrides of the scenario that was run.

    The frozen one has no overrides, so that its own `unchanged_variants` would be all. A continued run has none.
    """
    texts = {key: data[key] for key in ("name", "title", "description", "source", "paper_applies")}
    unchanged = tuple(data.get("unchanged_variants", ()))
    overrides = tuple(data["overrides"])
    return replace(scenario, path=Path(data["path"]), overrides=overrides, unchanged_variants=unchanged, **texts)


def finalize_dead_cases(executor: RunExecutor, recording: RunRecording) -> list[Case]:
    """Add the ended cases, and end the case that was in progress; return the remaining cases."""
    result, channel = executor.result, executor.channel
    for case_recording in recording.case_recordings:
        variant, seed = recording.cases[case_recording.number]
        if case_recording.end is None:
            crash = recording.locate_crash(case_recording.number, channel.crash_report)
            reason = "" if channel.crash_report else streams.read_failure_reason(result.folder)
            case_recording.end = {
                "end": case_recording.number,
                "complete": False,
                "failure": reason or f"{variant}, seed {seed}: {crash.text()}",
                "interrupted": crash.from_outside and not reason,
                "took": 0.0,
                "last": None,
            }
            executor.journal.append_line(**case_recording.end)
        case_end = case_recording.end
        result.run.wall_time += case_end["took"]
        result.run.members = case_end.get("members") or result.run.members
        add_notes(result.run, case_end.get("notes", []))
        add_occurrences(result.run, case_end.get("occurrences", []))
        if termination := case_end.get("ending"):
            result.terminations[variant, seed] = HardwareTermination(
                **{**termination, "log": tuple(termination["log"])}
            )
        signals = apply_analyses(
            result.scenario, variant, recording.signals(case_recording.number), executor.callbacks.progress
        )
        result.add_signals(variant, seed, signals, timed=bool(case_end["took"]))
        if case_end["interrupted"]:
            result.mark_incomplete("interrupted", case_end["failure"] or f"interrupted in {variant}, seed {seed}")
        elif case_end["failure"]:
            result.mark_incomplete("failed", case_end["failure"])
    count = len(recording.case_recordings)
    if channel.crash_report is not None and channel.crash_report.from_outside and count < len(executor.cases):
        result.mark_incomplete("interrupted", channel.crash_report.text())
    return executor.cases[count:] if result.run.status != "interrupted" else []


def recover(folder: Path, *, report: bool = True, progress: Progress = noop) -> RunResult:
    """Finalize an abandoned run from its recording; TwinError if there is nothing to recover."""
    if not (folder / streams.FOLDER).exists():
        what = "is complete" if (folder / "summary.json").exists() else "is no folder of a run"
        raise TwinError(f"{folder}: {what}: there is nothing to recover.")
    if not streams.is_abandoned(folder):
        raise TwinError(f"{folder}: the run is in progress. Wait for it, or end it with Ctrl-C.")
    if not streams.has_journal(folder):
        Journal(folder).remove()
        raise TwinError(f"{folder}: was killed before anything was recorded.")
    callbacks = RunCallbacks(progress=progress)
    return resume(folder, RunOptions(report=report), channel=SupervisorChannel(), callbacks=callbacks)
