"""Recording of estimates while they arrive: the same files as of a run, so that nothing is lost if this process is killed.

Rows of estimates go to `.recording/0.rows` at once; estimates that change are overwritten. `twin recover RUN` finishes the folder of
a process that was killed.
"""

from __future__ import annotations

import os
import time
from array import array
from bisect import bisect_left
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from twin import clock
from twin.errors import SimulationError
from twin.follow.follower import Estimate, remarks, summary_of
from twin.follow.records import signals_of
from twin.follow.status import FollowStatus
from twin.process import process_identity
from twin.results import Evaluation, Journal, RecordedVariable, Signals, column_to_dict, run_folder, stream
from twin.scenario import Dumper, ScenarioSpec

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from twin.follow.forecast import Forecast
    from twin.follow.problem import FollowProblem

STATUS_PERIOD = 0.5  # between two versions of the status file [s]
REVISED = 10.0  # age up to which estimates may be replaced, longer than any `max_delay` in use [s]
LEFT_OUT = (
    "events",
    "record",
    "analyses",
    "metrics",
    "expect",
    "plots",
    "scenes",
    "console",
    "mutations",
    "summary",
)  # of the model's scenario


class EstimateRecording:
    """Folder of a run to which estimates are written. OSError if it cannot be created."""

    def __init__(self, problem: FollowProblem, root: Path) -> None:
        self.problem = problem
        self.folder = run_folder.make_run_folder(root, problem.path.stem)
        self.info = run_info(problem)
        run_folder.write_text(self.folder / "scenario.yaml", model_text(problem.scenario))
        self.journal = Journal(self.folder)
        self.columns: list[RecordedVariable] = []
        self.status = FollowStatus(problem)
        self._status_due = 0.0
        self._forecasts: list[Forecast] = []  # that may end among later estimates
        self._ticks = array("q")
        self._file = -1
        self._judged: array[int] = array("b")  # of each row: NIS in its band, 1, not, 0, or nothing measured, -1

    def write(self, estimates: Sequence[Estimate]) -> None:
        """Write estimates in place of those from the first one's time on; SimulationError if the disk does not take them."""
        if not estimates:
            return
        self.status.add(estimates)
        begin, step = self.problem.begin, self.problem.step
        ticks = np.rint((np.array([estimate.time for estimate in estimates]) - begin) / step).astype(np.int64)
        row = bisect_left(self._ticks, int(ticks[0]))
        before = begin + self._ticks[row - 1] * step if row else -inf
        self._forecasts = [forecast for forecast in self._forecasts if forecast.time[-1] > before - REVISED]
        self._forecasts += [estimate.forecast for estimate in estimates if estimate.forecast]
        signals, columns = signals_of(self.problem, estimates, self._forecasts, before)
        values = [np.asarray(signals.values[column.name], np.float64).view(np.int64) for column in columns]
        words = np.ascontiguousarray(np.column_stack([ticks, *values]))
        try:
            if self._file < 0:
                self._open(columns)
            os.pwrite(self._file, words.tobytes(), row * words.strides[0])
            if row + len(ticks) < len(self._ticks):
                os.ftruncate(self._file, (row + len(ticks)) * words.strides[0])
            if time.monotonic() >= self._status_due:
                self._status_due = time.monotonic() + STATUS_PERIOD
                self.status.write(self.folder)
        except OSError as error:
            raise SimulationError(f"{self.folder}: the recording cannot go on ({error.strerror}).") from error
        del self._ticks[row:], self._judged[row:]
        self._ticks.extend(ticks.tolist())
        self._judged.extend(judge(estimate) for estimate in estimates)

    def _open(self, columns: list[RecordedVariable]) -> None:
        """Create the recording with its first estimates, whose signals it has."""
        self.columns = columns
        case, info = self.problem.experiment.case, self.info
        header = {
            **{name: getattr(info, name) for name in ("name", "title", "source", "description", "path", "algorithm")},
            "step_ns": clock.to_json(info.step_ns),
            "overrides": [],
            "started": info.started.isoformat(),
            "paper_applies": False,
            "report": False,
            "cases": [[case.variant, case.seed]],
            "columns": [column_to_dict(column) for column in columns],
        }
        self.journal.create(header, process_identity())
        self.journal.start_case(0)
        begin, step, per_second = clock.to_ticks(case.start_ns, case.step_ns)
        fields = [
            [column.name, 1 + number, [], "f", column.unit, column.display_unit]
            for number, column in enumerate(columns)
        ]
        layout = {"begin": begin, "step": step, "per_second": per_second, "words": 1 + len(columns), "columns": fields}
        self.journal.layout = layout
        self.journal.append_line(rows=0, **layout, calls={})
        self._file = os.open(self.journal.folder / "0.rows", os.O_CREAT | os.O_WRONLY, 0o644)

    @property
    def count(self) -> int:
        """Number of estimates."""
        return len(self._ticks)

    @property
    def in_band(self) -> float:
        """Fraction of the estimates with measurements whose NIS lies in its band; NaN without any."""
        judged = np.frombuffer(self._judged, np.int8) if self._judged else np.zeros(0, np.int8)
        measured = judged[judged >= 0]
        return float(measured.mean()) if len(measured) else float("nan")

    def finish(self, last: Estimate, status: str, reason: str, wall_time: float, extra: dict[str, Any]) -> Path:
        """Write signals.parquet and summary.json, and remove the recording; return the folder. `last`: the last estimate."""
        os.close(self._file)
        complete = status != "failed"
        signals = stream.read_case_signals(self.journal.folder, 0, self.journal.layout, complete)
        info = replace(self.info, status=status, reason=reason, wall_time=wall_time, extra=extra)
        write_files(self.folder, info, self.status, last, self.columns, signals, signals.parts())
        self.journal.remove()
        return self.folder


def run_info(problem: FollowProblem) -> run_folder.RunInfo:
    """Return the description of a run that follows."""
    return run_folder.RunInfo(
        problem.path.stem,
        problem.title,
        description=problem.keys.description,
        path=str(problem.path),
        step_ns=problem.experiment.case.step_ns,
    )


def write_files(
    folder: Path,
    info: run_folder.RunInfo,
    status: FollowStatus,
    last: Estimate,
    columns: list[RecordedVariable],
    signals: Signals,
    parts: Iterable[Signals],
) -> None:
    """Write signals.parquet, in parts, summary.json and the status at the end. `last`: the last estimate."""
    case = status.problem.experiment.case
    status.write(folder)
    with run_folder.SignalFile(folder / "signals.parquet", columns, {"scenario": info.name}) as file:
        for part in parts:
            file.write(case.variant, case.seed, part)
    info = replace(info, simulated_time=last.time - status.problem.begin)
    summary = run_folder.build_summary(info, Evaluation(), {(case.variant, case.seed): signals})
    run_folder.write_summary(folder / "summary.json", summary)


def write_run(
    problem: FollowProblem,
    estimates: Sequence[Estimate],
    root: Path,
    wall_time: float,
    failure: str = "",
    status: str = "",
) -> Path:
    """Write the estimates as the folder of a run, which `twin view` opens; return it.

    `failure`: why following ended early, with `status` interrupted or failed.
    """
    signals, columns = signals_of(problem, estimates)
    extra = {"notes": [*problem.notes, *remarks(problem, estimates)], "follow": summary_of(problem, estimates)}
    info = replace(run_info(problem), status=status or "completed", reason=failure, wall_time=wall_time, extra=extra)
    folder = run_folder.make_run_folder(root, problem.path.stem)
    run_folder.write_text(folder / "scenario.yaml", problem.scenario.frozen())
    at_end = FollowStatus(problem)
    at_end.add(estimates)
    write_files(folder, info, at_end, estimates[-1], columns, signals, [signals])
    return folder


def judge(estimate: Estimate) -> int:
    """Return 1 if NIS lies in its band, 0 if not, -1 if nothing was measured."""
    return int(estimate.is_in_band) if estimate.band[1] > 0.0 else -1


def model_text(scenario: ScenarioSpec) -> str:
    """Return a scenario as YAML text, without what refers to signals that are not recorded here."""
    content = {key: node.plain() for key, node in scenario.tree.entries.items() if key not in LEFT_OUT}
    return str(yaml.dump(content, Dumper=Dumper, sort_keys=False, allow_unicode=True, width=110))
