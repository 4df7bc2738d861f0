"""Recording of a run in progress: readable at any time and of any length, also after the writing process has died.

    runs/<scenario>/<time>/.recording/
        journal.jsonl    a line for each event: start of the run, of a case with the columns of its rows, end of a case
        0.rows           rows of 64-bit words of the first case: the tick, then Float64 or Int64; the last may be truncated
        0.position       position of the loop: tick, address of the call in progress, activity outside of the loop
        owner            the process that writes or finalizes
        reserve          reason why the journal ends; its space is allocated at the start, for the case of a full disk

At the end signals.parquet contains the same, and the folder is removed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.errors import TwinError
from twin.process import CrashReport, alive
from twin.results.recording import rows
from twin.results.recording.run_folder import RecordedVariable
from twin.results.recording.signals import Signals

if TYPE_CHECKING:
    from twin.coupling import RowLayout

FOLDER, JOURNAL, OWNER, RESERVE = ".recording", "journal.jsonl", "owner", "reserve"
FORMAT = 1
RESERVE_SIZE = 2048  # [byte]
LARGE_FILE = 1 << 28  # [byte]; larger files are read in slices
SLICE_SIZE = 1 << 26  # [byte]


class Journal:
    """Writer of a recording's folder. The first error of writing is stored in `error`."""

    def __init__(self, run: Path) -> None:
        self.folder = run / FOLDER
        self.layout: dict[str, Any] = {}  # of the rows of the last case
        self.error: OSError | None = None

    def create(self, about: Mapping[str, Any], owners: str) -> None:
        """Create the folder and write the first line; OSError if that fails."""
        self.folder.mkdir()
        self.set_owners(owners)
        (self.folder / RESERVE).write_bytes(b" " * RESERVE_SIZE)
        self.append_line(format=FORMAT, run=about)
        if self.error is not None:
            raise self.error

    def set_owners(self, owners: str) -> None:
        """Store the identities of the processes that own the recording."""
        (self.folder / OWNER).write_text(owners, encoding="utf-8")

    def start_case(self, number: int) -> None:
        """Record the start of a case."""
        self.layout = {}
        self.append_line(start=number)

    def append_line(self, **line: Any) -> None:
        """Append a line entirely or not at all: a disk that becomes full may accept a part of it."""
        remaining = (json.dumps(line, ensure_ascii=False) + "\n").encode()
        try:
            with (self.folder / JOURNAL).open("ab", buffering=0) as file:
                end = file.seek(0, os.SEEK_END)
                try:
                    while remaining:
                        remaining = remaining[file.write(remaining) :]
                except OSError:
                    file.truncate(end)
                    raise
        except OSError as error:
            self.error = self.error or error
            self.store_failure_reason(
                line.get("failure") or f"{self.folder / JOURNAL}: cannot be written ({error.strerror})"
            )

    def store_failure_reason(self, reason: str) -> None:
        """Store the reason why the journal ends, in the reserved space."""
        with suppress(OSError), (self.folder / RESERVE).open("r+b", buffering=0) as file:
            file.write(reason.encode()[:RESERVE_SIZE].ljust(RESERVE_SIZE))

    def append_layout(self, number: int, layout: RowLayout) -> tuple[Path, Path]:
        """Record the layout of a case's rows; return the files for the rows and the position."""
        columns = [
            [
                f"{member}.{name}",
                first,
                list(variable.shape),
                "b" if variable.type == "Boolean" else variable.dtype.kind,
                variable.unit,
                variable.display_unit,
            ]
            for (member, name), first, variable in layout.columns
        ]
        calls = {str(address): call for address, call in layout.calls.items()}
        self.layout = {
            "begin": layout.begin,
            "step": layout.step,
            "per_second": layout.per_second,
            "words": layout.words,
            "columns": columns,
        }
        self.append_line(rows=number, **self.layout, calls=calls)
        return self.folder / f"{number}.rows", self.folder / f"{number}.position"

    def remove(self) -> None:
        """Remove the folder, after its content has been written elsewhere."""
        import shutil

        shutil.rmtree(self.folder, ignore_errors=True)


@dataclass
class CaseRecording:
    """Recorded layout and end of one case."""

    number: int
    layout: dict[str, Any] = field(default_factory=dict)
    end: dict[str, Any] | None = None


@dataclass
class RunRecording:
    """Recording of a run, as read from its folder."""

    folder: Path
    header: dict[str, Any]
    case_recordings: list[CaseRecording]

    @property
    def cases(self) -> list[tuple[str, int]]:
        """Variant and seed of all cases of the run, in order."""
        return [(variant, seed) for variant, seed in self.header["cases"]]

    def signals(self, number: int) -> Signals:
        """Read the signals of a case recorded so far."""
        recording = self.case_recordings[number]
        end = recording.end or {"complete": False, "last": None}
        return read_case_signals(self.folder, number, recording.layout, end["complete"], end["last"])

    def locate_crash(self, number: int, report: CrashReport | None) -> CrashReport:
        """Complete a crash report with member, function and time; None: the supervisor was killed too."""
        layout = self.case_recordings[number].layout
        report = report or CrashReport(signal=9, **self.position(number))
        call = layout.get("calls", {}).get(str(report.at))
        if call:
            report.member, report.function = call
        elif ": " in report.note:
            report.member, _, report.function = report.note.partition(": ")
        if layout:
            report.time_ns = clock.at(layout["begin"] + report.tick * layout["step"], layout["per_second"])
        return report

    def position(self, number: int) -> dict[str, Any]:
        """Read the last stored position of the loop."""
        try:
            text = (self.folder / f"{number}.position").read_text(encoding="utf-8", errors="replace").partition("\n")[0]
            tick, at, note = text.split(" ", 2)
            return {"tick": int(tick), "at": int(at), "note": note}
        except (OSError, ValueError):
            return {}


def read_recording(run: Path) -> RunRecording:
    """Read the recording of a run that is in progress or was killed."""
    folder = run / FOLDER
    try:
        text = (folder / JOURNAL).read_text(encoding="utf-8", errors="replace")
    except OSError:
        raise TwinError(
            f"{run}: contains no recording. Name the folder of a run that is in progress or was killed."
        ) from None
    try:
        lines = [json.loads(line) for line in text.split("\n")[:-1]]
        is_supported_format = lines[0]["format"] == FORMAT
    except (ValueError, LookupError, TypeError):
        is_supported_format = False
    if not is_supported_format:
        raise TwinError(f"{folder / JOURNAL}: is damaged, or of another version. Use that version, or remove {folder}.")
    recordings: list[CaseRecording] = []
    for line in lines[1:]:
        if "start" in line:
            recordings.append(CaseRecording(line["start"]))
        elif "rows" in line:
            recordings[-1].layout = line
        elif "end" in line:
            recordings[-1].end = line
    return RunRecording(folder, lines[0]["run"], recordings)


def read_failure_reason(run: Path) -> str:
    """Read the reason why the journal of a recording ends; empty if there is none."""
    try:
        return (run / FOLDER / RESERVE).read_text(encoding="utf-8", errors="ignore").strip()
    except OSError:
        return ""


def has_journal(run: Path) -> bool:
    """Whether the first line of the journal was written."""
    try:
        return b"\n" in (run / FOLDER / JOURNAL).read_bytes()
    except OSError:
        return False


def read_case_signals(
    folder: Path, number: int, layout: Mapping[str, Any], complete: bool, last: int | None = None
) -> Signals:
    """Read the signals of a case from its rows; large files are read on access.

    `last`: tick of the last valid row, or None.
    """
    if not layout:
        return Signals(np.zeros(0), {}, complete=complete)
    recorded = rows.RowFile(folder / f"{number}.rows", layout["words"], LARGE_FILE, SLICE_SIZE, last)
    time, values = rows.read_columns(
        recorded, rows.row_fields(layout), (layout["begin"], layout["step"], layout["per_second"])
    )
    units = {name: unit for name, _, _, _, unit, _ in layout["columns"]}
    displayed = {name: unit for name, _, _, _, _, unit in layout["columns"] if unit}
    return Signals(time, values, units, complete, displayed)


def find_unfinished_runs(root: Path) -> list[Path]:
    """List the folders of runs with an abandoned recording."""
    folders = []
    with suppress(OSError):
        for scenario in os.scandir(root):
            if scenario.is_dir(follow_symlinks=False):
                folders += [Path(run.path) for run in os.scandir(scenario) if (Path(run.path) / FOLDER).exists()]
    return sorted(run for run in folders if is_abandoned(run))


def is_abandoned(run: Path) -> bool:
    """Whether no process that owns the recording is alive."""
    try:
        return not any(map(alive, (run / FOLDER / OWNER).read_text(encoding="utf-8").split()))
    except OSError:
        return True


def column_to_dict(column: RecordedVariable) -> dict[str, Any]:
    """Convert a column to JSON values."""
    return {**vars(column), "dtype": column.dtype.str, "shape": list(column.shape), "index": list(column.index)}


def column_from_dict(data: Mapping[str, Any]) -> RecordedVariable:
    """Create a column from the result of `column_to_dict`."""
    arrays = {"dtype": np.dtype(data["dtype"]), "shape": tuple(data["shape"]), "index": tuple(data["index"])}
    return RecordedVariable(**{**data, **arrays})
