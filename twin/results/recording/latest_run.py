"""Search for the most recent run of a scenario, and `latest`, a link to it in the folder of the scenario."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path

from twin.errors import TwinError, nearest
from twin.files import write_atomically

LATEST = "latest"  # name of the link in the folder of a scenario
STAMP = re.compile(r"(\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d)(?:_(\d+))?")


def is_finished_run(folder: Path) -> bool:
    """Return whether a folder is that of a finished run."""
    return STAMP.fullmatch(folder.name) is not None and (folder / "summary.json").is_file()


def run_order(folder: Path) -> tuple[str, int]:
    """Return the sorting key of a run's folder: its time, then the number of the run in this second."""
    stamp = STAMP.fullmatch(folder.name)
    return (stamp[1], int(stamp[2] or 1)) if stamp else ("", 0)


def finished_runs(root: Path) -> list[Path]:
    """Return the finished runs of all scenarios below `root`, the latest first."""
    folders = [path.parent for path in root.glob("*/*/summary.json")]
    return sorted(filter(is_finished_run, folders), key=run_order, reverse=True)


def resolve_latest(folder: Path) -> Path:
    """Return the folder of a run; `SCENARIO/latest` is the last finished one. TwinError if there is none."""
    is_own_folder = folder.is_dir() and not folder.is_symlink()  # a person may call a run so
    return folder if folder.name != LATEST or is_own_folder else latest_run(folder.parent)


def latest_run(parent: Path) -> Path:
    """Return the last finished run in the folder of a scenario."""
    runs = list(filter(is_finished_run, parent.iterdir())) if parent.is_dir() else []
    if runs:
        return max(runs, key=run_order)
    scenarios = [path.name for path in parent.parent.iterdir() if path.is_dir()] if parent.parent.is_dir() else []
    hint = nearest(parent.name, scenarios) if not parent.is_dir() else "Run the scenario first."
    raise TwinError(f"{parent}: holds no finished run. {hint}")


def link_latest(folder: Path) -> None:
    """Let `latest` name this run, unless it names a later one; a file with the name where links cannot be made."""
    link = folder.parent / LATEST
    is_own_folder = link.is_dir() and not link.is_symlink()
    if (
        not STAMP.fullmatch(folder.name)
        or is_own_folder
        or (link.exists() and run_order(linked(link)) > run_order(folder))
    ):
        return
    temporary = folder.parent / f".{LATEST}.{os.getpid()}"
    with suppress(OSError):  # the run is complete without it
        try:
            temporary.symlink_to(folder.name, target_is_directory=True)
            temporary.replace(link)
        except (OSError, NotImplementedError):
            temporary.unlink(missing_ok=True)
            write_atomically(link, folder.name + "\n")


def linked(link: Path) -> Path:
    """Return the run that `latest` names, by a link or by its text."""
    return link.resolve() if link.is_symlink() else link.parent / link.read_text(encoding="utf-8").strip()
