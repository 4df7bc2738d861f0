"""Cases of a study that were kept with their signals: links between their pages."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from twin.errors import TwinError
from twin.study import stored_cases, study_of_run

if TYPE_CHECKING:
    from pathlib import Path

    from twin.viewer.runs import RunCollection


@dataclass(frozen=True)
class StudyCases:
    """The kept cases of a study by number, and the number of the viewed one."""

    name: str
    folders: dict[int, Path]
    current: int

    def plain(self) -> dict[str, Any]:
        """Return the description as JSON data; `passed` is None if the summary of a run cannot be read."""
        cases = [{"number": number, "passed": is_passed(folder)} for number, folder in sorted(self.folders.items())]
        return {"name": self.name, "current": self.current, "cases": cases}


def is_passed(folder: Path) -> bool | None:
    """Return whether a run passed; None if its summary cannot be read."""
    try:
        return bool(json.loads((folder / "summary.json").read_text(encoding="utf-8"))["passed"])
    except (OSError, ValueError, KeyError):
        return None


def study_cases(runs: RunCollection) -> StudyCases | None:
    """Return the kept cases of the study of a single run; None for other runs."""
    if len(runs.runs) != 1 or (study := study_of_run(runs.runs[0].folder)) is None:
        return None
    own = runs.runs[0].folder.resolve()
    try:
        folders = stored_cases(study)
    except TwinError:  # of another version
        return None
    current = next((number for number, folder in folders.items() if folder.resolve() == own), None)
    return None if current is None else StudyCases(study.resolve().parent.name, folders, current)


__all__ = ["StudyCases", "study_cases"]
