"""Unpacked FMUs, shared by all members that are made of the same file, and removed when the last of them closes."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import compiler
from twin.errors import FMUError

if TYPE_CHECKING:
    import tempfile
    from collections.abc import Mapping
    from types import TracebackType
    from typing import Self

    from twin.coupling import TerminalMember
    from twin.fmi import model_description
    from twin.fmi.fmi_version import FmiVersion


@dataclass
class Unpacked:
    """An FMU in a folder: `folder` holds its files, `description` is the parsed modelDescription.xml.

    `interface` is the one that is run, `binary` the library for this platform; `notes` are remarks for the user that do not stop a run. Close it, or
    use it as a context manager: both remove the folder.
    """

    path: Path
    folder: Path
    description: model_description.ModelDescription
    fmi: FmiVersion
    interface: str
    binary: Path
    sha256: str
    notes: list[str] = field(default_factory=list)
    temporary: tempfile.TemporaryDirectory[str] | None = None
    users: int = 1
    process: int = field(default_factory=os.getpid)  # that unpacked it: one that was forked off leaves the folder alone
    terminals: Mapping[str, tuple[TerminalMember, ...]] = field(default_factory=dict)  # by variable
    # parts of saved states outside the FMU, of all instances
    saved_states: dict[int, Any] = field(default_factory=dict)

    def __getstate__(self) -> dict[str, Any]:
        """For another process, which leaves the folder alone."""
        return vars(self) | {"temporary": None}

    def close(self) -> None:
        """Remove the folder when its last user has closed it. Safe to call once too often."""
        self.users -= 1
        if self.users > 0:
            return
        for key in [key for key, unpacked in list(_open.items()) if unpacked is self]:
            del _open[key]  # The parsed description is released, too.
        if self.temporary is not None and self.process == os.getpid():
            self.temporary.cleanup()
            self.temporary = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()


_open: dict[tuple[Path, str, str], Unpacked] = {}


def share(path: str | Path, interface: str = "") -> Unpacked:
    """Unpack an FMU, or share the copy that is in use: its instances then share one library, as FMI intends.

    Known by its content: a file that was replaced is unpacked anew. Every user calls `close` once. `interface`:
    CoSimulation or ModelExchange; none: Co-Simulation, if the FMU has it.
    """
    path = Path(path)
    sha256 = digest(path)
    opened = _open.get((path, sha256, interface))
    if opened is not None and opened.users > 0:
        opened.users += 1
        return opened
    from twin.fmi.archive import unpack

    made = unpack(path, interface)
    for name in (interface, made.interface):
        _open[path, sha256, name] = made
    return made


def digest(path: Path) -> str:
    """SHA-256 of a file; FMUError if there is none."""
    if not path.is_file():
        other = "is a pipe, a socket or a device" if path.exists() else "is not there"
        problem = "is a folder" if path.is_dir() else other
        raise FMUError(f"{path}: {problem}. Give the path of an .fmu file.")
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def suffix(platform: str) -> str:
    """How files of libraries end on a platform."""
    return compiler.PLATFORMS[platform].suffix if platform in compiler.PLATFORMS else ".so"
