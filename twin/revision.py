"""Where sources stand in their version control, so that an exported file can be traced back to them."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

UNKNOWN = "not under version control"


def revision(folder: Path) -> str:
    """The last commit that changed a folder, `with changes` if it differs from it, or that there is none.

    The commit of the folder, not of the repository: a commit elsewhere leaves the same source as it was.
    """
    commit = _git(folder, "log", "-1", "--format=%h", "--abbrev=12", "--", ".")
    if not commit:
        return UNKNOWN
    return f"{commit} with changes" if _git(folder, "status", "--porcelain", "--", ".") else commit


@cache
def checkout(path: Path) -> str:
    """Commit of the checkout that `path` lies in, with `+` if something was changed since; or nothing.

    Asked once: what a process has imported stays as it is. So ask while there is other work, git takes its time.
    """
    if not any((parent / ".git").exists() for parent in (path, *path.parents)):
        return ""
    return _git(path, "describe", "--always", "--abbrev=12", "--exclude=*", "--dirty=+")


def _git(folder: Path, *words: str) -> str:
    import subprocess

    command = ["git", "--no-optional-locks", "-C", str(folder), *words]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=10).stdout.strip()
    except (OSError, subprocess.TimeoutExpired):
        return ""
