"""FMUs of components in the store of a build folder, found by a hash of their sources without building anything.

`exporter`, which translates, describes, documents and links, is imported only when an FMU is missing.
"""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import TYPE_CHECKING

from twin import compiler
from twin.compiler import model_name
from twin.component import PythonComponent
from twin.errors import BuildError
from twin.store import Store, make_key

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.component import Component


def readme(cls: type[Component]) -> str:
    """README.md of a component's folder; empty for a class that lives elsewhere."""
    if model_name(cls) == cls.__name__:
        return ""
    file = Path(inspect.getfile(cls)).with_name("README.md")
    return file.read_text(encoding="utf-8") if file.exists() else ""


def refuse_python_side(cls: type[Component]) -> None:
    """Raise BuildError for a component that cannot be native."""
    if issubclass(cls, PythonComponent):
        raise BuildError(
            f"{cls.__name__}: is Python-side and cannot be an FMU that needs no Python. "
            "Derive it from Component instead, or use `twin export --needs-python`."
        )


def fmu_key(cls: type[Component], version: str, targets: Sequence[str]) -> str | None:
    """Key of a component's FMU; None for an untraceable component."""
    return compiler.component_fingerprint(cls, version, readme(cls), *(targets or (compiler.host(),)))


def is_built(cls: type[Component], build: Path, version: str = "3.0", targets: Sequence[str] = ()) -> bool:
    """Whether the component's FMU is stored as it would be made now, with binaries for the targets."""
    key = fmu_key(cls, version, targets)
    return key is not None and Store(build).get(model_name(cls), key) is not None


def build(cls: type[Component], version: str, build: Path, targets: Sequence[str] = ()) -> Path:
    """Path of the component's FMU in the store; it is made if it is missing. Hold `Store.shared` while the path is used."""
    refuse_python_side(cls)
    store, name, key = Store(build), model_name(cls), fmu_key(cls, version, targets)
    file = f"{name}.fmu"
    if key is None or store.get(name, key) is None:
        from twin.fmi.exporting import exporter

        content = exporter.made(cls, version, build, targets or (compiler.host(),))
        key = key or make_key(content)
        store.put(name, key, {file: content})
    return store.path(name, key) / file
