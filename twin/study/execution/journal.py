"""What is done of a study, kept line by line: Ctrl-C, a full disk or a power cut cost the cases that were on their way."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from twin.errors import ScenarioError
from twin.study.execution.case_engine import Row

NAME = "cases.jsonl"
LISTS = ("metrics", "holds", "bands", "extremes")


class StudyJournal:
    """Rows by their numbers; samples of signals stay in the file."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / NAME
        self.rows: dict[int, Row] = {}
        self._offsets: dict[int, int] = {}
        end = 0
        with suppress(FileNotFoundError), self.path.open("rb") as file:
            for line in file:
                if not line.endswith(b"\n"):
                    break  # half a line: the process was killed there
                row = parsed(line, self.path)
                self._keep(row, end)
                end += len(line)
        self._file = self.path.open("ab", buffering=0)
        self._file.truncate(end)
        self._end = end

    def _keep(self, row: Row, offset: int) -> None:
        self.rows[row.number] = Row(**{**vars(row), "bands": ()})
        self._offsets[row.number] = offset

    def add(self, row: Row) -> None:
        """Write a row; it is there from now on, whatever happens to this process."""
        line = left = json.dumps(vars(row), allow_nan=False).encode() + b"\n"
        while left:  # a disk that becomes full takes a part of it first
            left = left[self._file.write(left) :]
        self._keep(row, self._end)
        self._end += len(line)

    def bands(self) -> Iterator[tuple[int, tuple[str, ...]]]:
        """(number, samples of signals) of all rows in order, one in memory at a time."""
        with self.path.open("rb") as file:
            for number in sorted(self._offsets):
                file.seek(self._offsets[number])
                yield number, parsed(file.readline(), self.path).bands

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def parsed(line: bytes, path: Path) -> Row:
    """A row from its line."""
    try:
        data: dict[str, Any] = json.loads(line)
        fields: dict[str, Any] = {key: tuple(item) if key in LISTS else item for key, item in data.items()}
        return Row(**fields)
    except (ValueError, TypeError):
        raise ScenarioError(f"{path}: is damaged. Remove the folder, and run the study again.") from None
