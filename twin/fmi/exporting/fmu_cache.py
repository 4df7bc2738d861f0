"""Cache of built component FMUs, by a hash of their sources, computed without building anything.

Only who lacks one imports `exporter`, which translates, describes, documents and links.
"""

from __future__ import annotations

import hashlib
import inspect
from pathlib import Path
from typing import TYPE_CHECKING

from twin import compiler
from twin.compiler import model_name
from twin.component import PythonComponent
from twin.errors import BuildError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.component import Component


def readme(cls: type[Component]) -> str:
    """README.md of a component's folder; empty for a class that lives elsewhere."""
    if model_name(cls) == cls.__name__:
        return ""
    file = Path(inspect.getfile(cls)).with_name("README.md")
    return file.read_text(encoding="utf-8") if file.exists() else ""


def made_from(cls: type[Component], version: str) -> str:
    """Fingerprint of all that an FMU is made from, without making anything; empty for an untraceable component."""
    return compiler.component_fingerprint(cls, model_name(cls), version, readme(cls)) or ""


def is_built(cls: type[Component], build: Path, version: str = "3.0", wanted: Sequence[str] = ()) -> bool:
    """Whether the component's FMU is there as it would be made now, with all binaries that are wanted."""
    path = build / version / f"{model_name(cls)}.fmu"
    note = path.with_suffix(".hash")
    try:
        words, data = compiler.read_own(note).decode(errors="replace").split(), compiler.read_own(path)
    except OSError:
        return False
    key, content, *present = words if len(words) > 1 else ["", ""]
    if not key or key != made_from(cls, version) or not set(wanted or (compiler.host(),)) <= set(present):
        return False
    return content == hashlib.sha256(data).hexdigest()  # a damaged file is made anew


def build(cls: type[Component], version: str, build: Path, targets: Sequence[str] = ()) -> Path:
    """The component's FMU in `build/<version>/`, rebuilt only if its sources or targets changed."""
    if issubclass(cls, PythonComponent):
        raise BuildError(
            f"{cls.__name__}: is Python-side and cannot be an FMU that needs no Python. "
            "Derive it from Component instead, or use `twin export --needs-python`."
        )
    wanted = tuple(targets) or (compiler.host(),)
    path = build / version / f"{model_name(cls)}.fmu"
    if not is_built(cls, build, version, wanted):
        from twin.fmi.exporting import exporter

        content = exporter.made(cls, version, build, wanted)
        note = path.with_suffix(".hash")
        note.unlink(missing_ok=True)
        compiler.put(path, content)
        if key := made_from(cls, version):
            words = key, hashlib.sha256(content).hexdigest(), *wanted
            compiler.put(note, f"{' '.join(words)}\n".encode())
    return path
