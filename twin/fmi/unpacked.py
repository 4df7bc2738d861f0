"""FMUs in folders, shared by all who use them; those of ours are kept that way, so that a run opens no archive.

    build/unpacked/<hash of the FMU>/fmu/           its files, as far as a run needs them
    build/unpacked/<hash of the FMU>/<interface>    what its description says, by `marshal`, behind its hash

Kept is what was built from a component, as the note beside it says (`built`); anyone else's FMU is unpacked for each run,
and removed. What is damaged, or of another engine, is made anew.
"""

from __future__ import annotations

import hashlib
import marshal
import os
import sys
import threading
from contextlib import suppress
from dataclasses import field, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import compiler
from twin.coupling import TerminalMember
from twin.dataclass import dataclass
from twin.errors import FMUError
from twin.fmi import clocks, model

if TYPE_CHECKING:
    import tempfile
    from collections.abc import Mapping
    from types import TracebackType
    from typing import Self

TAG = sys.implementation.cache_tag  # of what `marshal` writes, as for Python's own kept modules
HASH = 32  # byte
TUPLE = -1
NESTED = (tuple, list, dict)
KINDS: tuple[type[Any], ...] = (  # what a description is made of
    *(model.Model, model.Declared, model.DeclaredType, model.Dimension, model.DeclaredUnit, model.Continuous),
    *(clocks.Clocks, clocks.Clock, TerminalMember),
)


@dataclass
class Unpacked:
    """An FMU in a folder: `folder` holds its files, `description` what modelDescription.xml says.

    `interface` is the one that is run, `binary` the library for this platform; `notes` are remarks for the user that do not stop a run. Close it, or
    use it as a context manager: both remove the folder.
    """

    path: Path
    folder: Path
    description: model.Model
    fmi: str
    interface: str
    binary: Path
    sha256: str
    notes: list[str] = field(default_factory=list)
    temporary: tempfile.TemporaryDirectory[str] | None = None
    users: int = 1
    process: int = field(default_factory=os.getpid)  # that unpacked it: one that was forked off leaves the folder alone
    terminals: Mapping[str, tuple[TerminalMember, ...]] = field(default_factory=dict)  # by variable

    def close(self) -> None:
        """Remove the folder when its last user has closed it. Safe to call once too often."""
        self.users -= 1
        if self.users > 0:
            return
        for key in [key for key, one in list(_open.items()) if one is self]:
            del _open[key]  # nor is what its description says kept in memory
        if self.temporary is not None and self.process == os.getpid():
            self.temporary.cleanup()
            self.temporary = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()


_open: dict[tuple[Path, str, str, bool], Unpacked] = {}


def share(path: str | Path, interface: str = "", ours: bool = False) -> Unpacked:
    """Unpack an FMU, or join those who use it already: its instances then share one library, as FMI means them to.

    Known by its content: a file that was replaced is unpacked anew. Every user calls `close` once. `interface`:
    CoSimulation or ModelExchange; none: Co-Simulation, if the FMU has it. `ours`: it was built of a component, and is kept.
    """
    path = Path(path)
    sha256 = digest(path)
    known = _open.get((path, sha256, interface, ours))
    if known is not None and known.users > 0:
        known.users += 1
        return known
    made = find(path, sha256, interface) if ours else None
    if made is None:
        from twin.fmi.archive import unpack

        made = unpack(path, interface)
        if ours:
            keep(made, interface)
    for one in (interface, made.interface):
        _open[path, sha256, one, ours] = made
    return made


def digest(path: Path) -> str:
    """SHA-256 of a file; FMUError if there is none."""
    if not path.is_file():
        found = "is a folder" if path.is_dir() else "is not there"
        raise FMUError(f"{path}: {found}. Give the path of an .fmu file.")
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def suffix(platform: str) -> str:
    """How files of libraries end on a platform."""
    return compiler.PLATFORMS[platform].suffix if platform in compiler.PLATFORMS else ".so"


# ------------------------------------------------------------------------------------------------------ those that are kept


def made_from(path: Path, sha256: str) -> str:
    """What the note beside an FMU says that it was built from, the engine included; nothing if it is not that FMU's."""
    with suppress(OSError, ValueError):
        key, content, *_ = path.with_suffix(".hash").read_text(encoding="ascii").split()
        return key if content == sha256 else ""
    return ""


def place_of(path: Path, sha256: str) -> Path:
    """Where an FMU in `build/<version>/` is kept."""
    return path.parent.parent / "unpacked" / sha256[:32]


def outline_of(place: Path, interface: str) -> Path:
    """The file with what is known of a kept FMU."""
    return place / f"{interface or 'any'}.{TAG}"


def find(path: Path, sha256: str, interface: str) -> Unpacked | None:
    """An FMU that is kept, if it is, and whole."""
    key = made_from(path, sha256)
    if not key:
        return None
    place = place_of(path, sha256).resolve()
    try:
        data = outline_of(place, interface).read_bytes()
        if hashlib.sha256(data[HASH:]).digest() != data[:HASH]:
            return None
        engine, binary, sum_, told = marshal.loads(data[HASH:])  # noqa: S302 - ours, as the library beside it
        library = place / "fmu" / binary
        if engine != key or digest(library) != sum_:
            return None
        description, kind, notes, terminals = restored(told)
    except (OSError, ValueError, TypeError, EOFError, FMUError):
        return None
    return Unpacked(
        path, place / "fmu", description, description.fmi, kind, library, sha256, notes, terminals=terminals
    )


def keep(made: Unpacked, interface: str) -> None:
    """Keep an FMU of ours, if there is a place for it."""
    key = made_from(made.path, made.sha256)
    if not key:
        return
    binary = made.binary.relative_to(made.folder)
    place = place_of(made.path, made.sha256)
    told = packed((made.description, made.interface, made.notes, dict(made.terminals)))
    with suppress(OSError, ValueError):  # the last: something in it is no plain data
        sum_ = digest(made.binary)
        data = marshal.dumps((key, binary.as_posix(), sum_, told))
        if not (place / "fmu" / binary).is_file() or digest(place / "fmu" / binary) != sum_:
            copied(place, made.folder)
        compiler.put(outline_of(place, interface), hashlib.sha256(data).digest() + data)


def copied(place: Path, folder: Path) -> None:
    """Copy a folder to `place/fmu`, whole or not at all; whoever does the same at this moment copies the same."""
    import shutil

    beside = place.with_name(f".{place.name}.{os.getpid()}.{threading.get_ident()}")
    try:
        shutil.copytree(folder, beside / "fmu")
        shutil.rmtree(place, ignore_errors=True)
        with suppress(OSError):  # another was quicker
            beside.replace(place)
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def packed(value: Any) -> Any:
    """As `marshal` takes it: an object as the number of its kind and its fields."""
    if is_dataclass(value):
        return (KINDS.index(type(value)), *(packed(getattr(value, one.name)) for one in fields(value)))
    if isinstance(value, tuple):
        return (TUPLE, *map(packed, value))
    if isinstance(value, list):
        return [packed(one) for one in value]
    if isinstance(value, dict):
        return {key: packed(one) for key, one in value.items()}
    return value


def restored(told: Any) -> Any:
    """What was packed."""
    if isinstance(told, tuple):
        content = [restored(one) if type(one) in NESTED else one for one in told[1:]]
        return tuple(content) if told[0] == TUPLE else KINDS[told[0]](*content)
    if isinstance(told, list):
        return [restored(one) for one in told]
    if isinstance(told, dict):
        return {key: restored(one) for key, one in told.items()}
    return told
