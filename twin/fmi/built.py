"""FMUs of components that are built already: found by a hash of what they are made from, without making anything.

Only who lacks one imports `exporter`, which translates, describes, documents and links.
"""

from __future__ import annotations

import hashlib
import inspect
import os
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from twin import compiler, installed
from twin.compiler import model_name
from twin.component import PythonComponent
from twin.errors import BuildError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from twin.component import Component

ENGINE = Path(__file__).parents[1]
DECISIVE = ("component", "compiler", "coupling/group.py", "fmi")  # what decides what an FMU is
SUFFIXES = (".py", ".c", ".h", ".html")

_keys: dict[tuple[type[Component], str], str] = {}  # classes do not change, and a scenario has each once per variant


def readme(cls: type[Component]) -> str:
    """README.md of a component's folder; empty for a class that lives elsewhere."""
    if model_name(cls) == cls.__name__:
        return ""
    file = Path(inspect.getfile(cls)).with_name("README.md")
    return file.read_text(encoding="utf-8") if file.exists() else ""


def made_from(cls: type[Component], version: str) -> str:
    """Hash of all that an FMU is made from: engine, component with its files and README. Cheap: nothing is made."""
    if (cls, version) not in _keys:
        name = model_name(cls)
        more = [version, readme(cls), repr(cls.terminals), repr(cls.switches), repr(cls.period), repr(cls.method)]
        _keys[cls, version] = compiler.source_hash(cls, name, _engine(), *more)
    return _keys[cls, version]


@cache
def _engine() -> str:
    """Hash of the engine's files that decide what an FMU is, and of the compiler's version."""
    digest = hashlib.sha256(installed.version("ziglang").encode())
    for file in sorted(one for name in DECISIVE for one in _files(str(ENGINE / name)) if one.endswith(SUFFIXES)):
        with open(file, "rb") as content:
            digest.update(content.read())
    return digest.hexdigest()


def _files(place: str) -> Iterator[str]:
    """A file, or all files in a folder; pathlib takes ten times as long."""
    if not os.path.isdir(place):  # noqa: PTH112
        yield place
        return
    for folder, _, names in os.walk(place):
        yield from (f"{folder}{os.sep}{name}" for name in names)


def is_built(cls: type[Component], build: Path, version: str = "3.0", wanted: Sequence[str] = ()) -> bool:
    """Whether the component's FMU is there as it would be made now, with all binaries that are wanted."""
    path = build / version / f"{model_name(cls)}.fmu"
    note = path.with_suffix(".hash")
    words = note.read_text(errors="replace").split() if note.exists() and path.exists() else []
    key, content, *present = words if len(words) > 1 else ["", ""]
    if not key or key != made_from(cls, version) or not set(wanted or (compiler.host(),)) <= set(present):
        return False
    return content == hashlib.sha256(path.read_bytes()).hexdigest()  # a damaged file is made anew


def build(cls: type[Component], version: str, build: Path, targets: Sequence[str] = ()) -> Path:
    """The component's FMU in `build/<version>/`, made anew only if what it is made from, or a target, is new."""
    if issubclass(cls, PythonComponent):
        raise BuildError(
            f"{cls.__name__}: is Python-side and cannot be an FMU that needs no Python. "
            "Derive it from Component instead, or use `twin export --needs-python`."
        )
    wanted = tuple(targets) or (compiler.host(),)
    path = build / version / f"{model_name(cls)}.fmu"
    if not is_built(cls, build, version, wanted):
        from twin.fmi import exporter

        content = exporter.made(cls, version, build, wanted)
        note = path.with_suffix(".hash")
        note.unlink(missing_ok=True)
        compiler.put(path, content)
        words = made_from(cls, version), hashlib.sha256(content).hexdigest(), *wanted
        compiler.put(note, f"{' '.join(words)}\n".encode())
    return path
