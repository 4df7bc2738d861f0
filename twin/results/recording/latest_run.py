"""Search for the most recent run of a scenario, and `latest`, a link to it in the folder of the scenario."""

from __future__ import annotations

import json
import os
import re
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from twin.errors import TwinError, nearest
from twin.files import write_atomically

if TYPE_CHECKING:
    from collections.abc import Iterable

SUMMARY = "summary.json"  # of a finished run
ROOT = Path("runs")  # default folder of the results of all scenarios and studies
LATEST = "latest"  # name of the link in the folder of a scenario
STAMP = re.compile(r"(\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d)(?:_(\d+))?")


def is_finished_run(folder: Path, file: str = SUMMARY) -> bool:
    """Return whether a folder is that of a finished run, or of a study with `file`."""
    return STAMP.fullmatch(folder.name) is not None and (folder / file).is_file()


def run_order(folder: Path) -> tuple[str, int]:
    """Return the sorting key of a run's folder: its time, then the number of the run in this second."""
    stamp = STAMP.fullmatch(folder.name)
    return (stamp[1], int(stamp[2] or 1)) if stamp else ("", 0)


def finished_runs(root: Path, file: str = SUMMARY) -> list[Path]:
    """Return the finished runs of all scenarios below `root`, or studies with `file`, the latest first."""
    folders = [path.parent for path in root.glob(f"*/*/{file}")]
    return sorted((folder for folder in folders if is_finished_run(folder, file)), key=run_order, reverse=True)


def has_signals(folder: Path) -> bool:
    """Return whether a finished run has recorded something: one whose components could not be built has not."""
    try:
        return bool(json.loads((folder / SUMMARY).read_text(encoding="utf-8")).get("cases", True))
    except (OSError, ValueError, AttributeError):  # a study, or a damaged file, which is reported when it is opened
        return True


def newest(runs: Iterable[Path]) -> Path:
    """Return the newest of some runs that has signals; the newest one if none has."""
    ordered = sorted(runs, key=run_order, reverse=True)
    return next(filter(has_signals, ordered), ordered[0])


def default_run(folder: Path) -> Path | None:
    """Return the newest finished run of the same scenario with its own parameters; None if there is none."""
    for other in sorted(filter(is_finished_run, folder.parent.iterdir()), key=run_order, reverse=True):
        with suppress(OSError, ValueError, AttributeError):
            summary = json.loads((other / SUMMARY).read_text(encoding="utf-8"))
            if other.name != folder.name and summary.get("cases") and not summary.get("overrides"):
                return other
    return None


def newer_note(folder: Path) -> str:
    """Return a note on a newer run of the scenario that has no signals; "" without such a run."""
    siblings = [other for other in folder.resolve().parent.iterdir() if is_finished_run(other)]
    newer = max(siblings, key=run_order, default=folder)
    if run_order(newer) <= run_order(folder.resolve()) or has_signals(newer):
        return ""
    return f"{newer.name} is newer, but failed before it recorded anything; this is {folder.resolve().name}."


def resolve_latest(folder: Path, file: str = SUMMARY, root: Path = ROOT) -> Path:
    """Return the folder of a run, by its path, its time or SCENARIO/TIME in `root`.

    `SCENARIO/latest` is the last finished one with signals, `latest` that of all in `root`.

    TwinError if there is none.
    """
    if folder == Path(LATEST) and not folder.exists():
        if runs := finished_runs(root, file):
            return newest(runs)
        example = "Run a scenario first, such as `twin run heart_wall_force`."
        raise TwinError(
            f"{root}: holds no finished {'run' if file == SUMMARY else 'study'}. {example if file == SUMMARY else ''}".rstrip()
        )
    folder = folder if folder.exists() else find_by_time(root, folder)
    is_own_folder = folder.is_dir() and not folder.is_symlink()  # a person may call a run so
    return folder if folder.name != LATEST or is_own_folder else latest_run(folder.parent, file)


def find_by_time(root: Path, folder: Path) -> Path:
    """Return the folder that TIME or SCENARIO/TIME names in `root`; unchanged if there is none. TwinError for several."""
    if STAMP.fullmatch(folder.name) is None and folder.name != LATEST:
        return folder
    if len(folder.parts) > 1:
        return root / folder if (root / folder.parent).is_dir() and not folder.parent.is_dir() else folder
    matches = sorted(root.glob(f"*/{folder.name}"))
    if len(matches) > 1 and folder.name != LATEST:
        raise TwinError(f"{folder}: is the time of {len(matches)} runs. Name one: {', '.join(map(str, matches))}.")
    return matches[0] if len(matches) == 1 else folder


def latest_run(parent: Path, file: str = SUMMARY) -> Path:
    """Return the last finished run with signals in the folder of a scenario, or study in that of a study."""
    runs = [folder for folder in parent.iterdir() if is_finished_run(folder, file)] if parent.is_dir() else []
    if runs:
        return newest(runs)
    hint = suggest_folders(parent, file) if not parent.is_dir() else "Run the scenario first."
    raise TwinError(f"{parent}: holds no finished run. {hint}")


def find_results(path: Path, file: str, kind: str, example: str) -> Path:
    """Return the folder with `file`, by its path, as NAME/latest, or by the NAME of what was run last in runs/.

    TwinError if there is none: where was looked, and names that are similar. `kind`: run or study, `example`: a NAME.
    """
    folder = resolve_latest(path, file)
    if (folder / file).is_file():
        return folder
    if folder.is_dir():
        if any(is_finished_run(item, file) for item in folder.iterdir()):
            many = "studies" if kind == "study" else "runs"
            raise TwinError(f"{folder}: is a folder of {many}. Name one of them, or {folder / LATEST}.")
        text = f"has no {file}: the {kind} is not finished."
        raise TwinError(f"{folder}: {text} Give the folder of a finished {kind}, such as {ROOT}/{example}/{LATEST}.")
    if len(folder.parts) == 1 and (ROOT / folder).is_dir():
        return latest_run(ROOT / folder, file)
    raise TwinError(f"{folder}: does not exist. {suggest_folders(folder, file)}")


def suggest_folders(folder: Path, file: str, *others: str) -> str:
    """Return where a folder was looked for, and similar names there of folders that hold results with `file` or other files."""
    missing = next(item for item in [*reversed(folder.parents), folder] if not item.exists())
    parents = [missing.parent, *([ROOT] if len(missing.parts) == 1 else [])]
    names = [
        item.name
        for parent in parents
        if parent.is_dir()
        for item in parent.iterdir()
        if has_results(item, file, *others)
    ]
    if not names:
        return f"There are no {'runs' if file == SUMMARY else 'studies'} in {parents[-1].resolve()}."
    parents = [parent for parent in parents if parent.is_dir()]
    return f"Looked in {' and '.join(str(parent.resolve()) for parent in parents)}. {nearest(missing.name, names)}"


def has_results(folder: Path, *files: str) -> bool:
    """Return whether a folder is a run or a study, or has one in it."""
    return any((folder / file).is_file() or any(folder.glob(f"*/{file}")) for file in files)


def link_latest(folder: Path) -> None:
    """Let `latest` name this run, unless it names a later one or this one has no signals; a file where links cannot be made."""
    link = folder.parent / LATEST
    is_own_folder = link.is_dir() and not link.is_symlink()
    if (
        not STAMP.fullmatch(folder.name)
        or is_own_folder
        or (link.exists() and (run_order(linked(link)) > run_order(folder) or not has_signals(folder)))
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
