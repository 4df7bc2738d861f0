"""What a run records while it goes on: readable at any moment and at any length, whatever became of who wrote it.

    runs/<scenario>/<time>/.recording/
        journal.jsonl    a line for each thing that happened: the run, a case with the columns of its rows, its end
        0.rows           rows of 64-bit words, of the first case: the tick, then Float64 or Int64; the last may be cut off
        0.position       where the loop was: tick, address of the call at work, what is done outside of the loop
        owner            the process that writes, or finishes
        reserve          why the journal does not go on: room that is taken at the begin, for a disk that is full then

At the end signals.parquet holds the same, and the folder is removed.
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
from twin.process import Death, alive
from twin.results import rows
from twin.results.run_folder import Column
from twin.results.signals import Signals

if TYPE_CHECKING:
    from twin.coupling import Layout

FOLDER, JOURNAL, OWNER, RESERVE = ".recording", "journal.jsonl", "owner", "reserve"
FORMAT = 1
ROOM = 2048  # of the reserve [byte]
LARGE = 1 << 28  # rows of more are not read at once [byte]
SLICE = 1 << 26  # but so many [byte]


class Journal:
    """The folder of a recording, to be written. What cannot be written is kept in `trouble`."""

    def __init__(self, run: Path) -> None:
        self.folder = run / FOLDER
        self.layout: dict[str, Any] = {}  # of the rows of the last case
        self.trouble: OSError | None = None

    def begin(self, about: Mapping[str, Any], owners: str) -> None:
        """Make the folder and the first line; OSError if they cannot be written."""
        self.folder.mkdir()
        self.own(owners)
        (self.folder / RESERVE).write_bytes(b" " * ROOM)
        self.add(format=FORMAT, run=about)
        if self.trouble is not None:
            raise self.trouble

    def own(self, owners: str) -> None:
        """Say which processes look after the recording."""
        (self.folder / OWNER).write_text(owners, encoding="utf-8")

    def start(self, number: int) -> None:
        """A case begins."""
        self.layout = {}
        self.add(start=number)

    def add(self, **line: Any) -> None:
        """Append a line, in one piece or not at all: a disk that becomes full takes a part of it first."""
        left = (json.dumps(line, ensure_ascii=False) + "\n").encode()
        try:
            with (self.folder / JOURNAL).open("ab", buffering=0) as file:
                end = file.seek(0, os.SEEK_END)
                try:
                    while left:
                        left = left[file.write(left) :]
                except OSError:
                    file.truncate(end)
                    raise
        except OSError as error:
            self.trouble = self.trouble or error
            self.explain(line.get("failure") or f"{self.folder / JOURNAL}: cannot be written ({error.strerror})")

    def explain(self, reason: str) -> None:
        """Keep why the journal does not go on, in the room that was taken for it."""
        with suppress(OSError), (self.folder / RESERVE).open("r+b", buffering=0) as file:
            file.write(reason.encode()[:ROOM].ljust(ROOM))

    def rows(self, number: int, layout: Layout) -> tuple[Path, Path]:
        """Say how the rows of a case lie; the files for them and for the position."""
        columns = [
            [
                f"{member}.{name}",
                first,
                list(one.shape),
                "b" if one.type == "Boolean" else one.dtype.kind,
                one.unit,
                one.display_unit,
            ]
            for (member, name), first, one in layout.columns
        ]
        calls = {str(address): call for address, call in layout.calls.items()}
        self.layout = {
            "begin": layout.begin,
            "step": layout.step,
            "per_second": layout.per_second,
            "words": layout.words,
            "columns": columns,
        }
        self.add(rows=number, **self.layout, calls=calls)
        return self.folder / f"{number}.rows", self.folder / f"{number}.position"

    def remove(self) -> None:
        """Everything of it is elsewhere now."""
        import shutil

        shutil.rmtree(self.folder, ignore_errors=True)


@dataclass
class Part:
    """What a recording holds of one case."""

    number: int
    rows: dict[str, Any] = field(default_factory=dict)
    end: dict[str, Any] | None = None


@dataclass
class Stream:
    """A recording, read."""

    folder: Path
    about: dict[str, Any]
    parts: list[Part]

    @property
    def cases(self) -> list[tuple[str, int]]:
        """All cases of the run, in order: variant and seed."""
        return [(variant, seed) for variant, seed in self.about["cases"]]

    def signals(self, number: int) -> Signals:
        """What was recorded of a case until now."""
        part = self.parts[number]
        end = part.end or {"complete": False, "last": None}
        return signals(self.folder, number, part.rows, end["complete"], end["last"])

    def located(self, number: int, death: Death | None) -> Death:
        """A death with the member, the function and the time, as far as they are known. None: nobody was left to tell."""
        rows = self.parts[number].rows
        death = death or Death(signal=9, **self.position(number))
        call = rows.get("calls", {}).get(str(death.at))
        if call:
            death.member, death.function = call
        elif ": " in death.note:
            death.member, _, death.function = death.note.partition(": ")
        if rows:
            death.time_ns = clock.at(rows["begin"] + death.tick * rows["step"], rows["per_second"])
        return death

    def position(self, number: int) -> dict[str, Any]:
        """Where the loop was, when it was last looked at."""
        try:
            text = (self.folder / f"{number}.position").read_text(encoding="utf-8", errors="replace").partition("\n")[0]
            tick, at, note = text.split(" ", 2)
            return {"tick": int(tick), "at": int(at), "note": note}
        except (OSError, ValueError):
            return {}


def read(run: Path) -> Stream:
    """Read what a run has recorded until now, or until its death."""
    folder = run / FOLDER
    try:
        text = (folder / JOURNAL).read_text(encoding="utf-8", errors="replace")
    except OSError:
        raise TwinError(f"{run}: holds no recording. Name the folder of a run that was killed, or goes on.") from None
    try:
        lines = [json.loads(line) for line in text.split("\n")[:-1]]
        known = lines[0]["format"] == FORMAT
    except (ValueError, LookupError, TypeError):
        known = False
    if not known:
        raise TwinError(f"{folder / JOURNAL}: is damaged, or of another version. Use that one, or remove {folder}.")
    parts: list[Part] = []
    for line in lines[1:]:
        if "start" in line:
            parts.append(Part(line["start"]))
        elif "rows" in line:
            parts[-1].rows = line
        elif "end" in line:
            parts[-1].end = line
    return Stream(folder, lines[0]["run"], parts)


def explanation(run: Path) -> str:
    """Why the journal of a recording did not go on, or nothing."""
    try:
        return (run / FOLDER / RESERVE).read_text(encoding="utf-8", errors="ignore").strip()
    except OSError:
        return ""


def has_begun(run: Path) -> bool:
    """Whether a recording came as far as its first line."""
    try:
        return b"\n" in (run / FOLDER / JOURNAL).read_bytes()
    except OSError:
        return False


def signals(folder: Path, number: int, layout: Mapping[str, Any], complete: bool, last: int | None = None) -> Signals:
    """The signals of a case in its rows; those of large files are read when they are asked for.

    `last`: tick of the last row that counts, or None.
    """
    if not layout:
        return Signals(np.zeros(0), {}, complete=complete)
    recorded = rows.Rows(folder / f"{number}.rows", layout["words"], LARGE, SLICE, last)
    places = {name: rows.Place(first, tuple(shape), kind) for name, first, shape, kind, *_ in layout["columns"]}
    time, values = rows.columns(recorded, places, (layout["begin"], layout["step"], layout["per_second"]))
    units = {name: unit for name, _, _, _, unit, _ in layout["columns"]}
    displayed = {name: unit for name, _, _, _, _, unit in layout["columns"] if unit}
    return Signals(time, values, units, complete, displayed)


def unfinished(root: Path) -> list[Path]:
    """Folders of runs whose recording nobody looks after any more."""
    found = []
    with suppress(OSError):
        for scenario in os.scandir(root):
            if scenario.is_dir(follow_symlinks=False):
                found += [Path(run.path) for run in os.scandir(scenario) if (Path(run.path) / FOLDER).exists()]
    return sorted(run for run in found if abandoned(run))


def abandoned(run: Path) -> bool:
    """Whether the process that looked after a recording is dead."""
    try:
        return not any(map(alive, (run / FOLDER / OWNER).read_text(encoding="utf-8").split()))
    except OSError:
        return True


def plain_column(column: Column) -> dict[str, Any]:
    """A column as plain data."""
    return {**vars(column), "dtype": column.dtype.str, "shape": list(column.shape), "index": list(column.index)}


def column_of(told: Mapping[str, Any]) -> Column:
    """A column from plain data."""
    own = {"dtype": np.dtype(told["dtype"]), "shape": tuple(told["shape"]), "index": tuple(told["index"])}
    return Column(**{**told, **own})
