"""Environments by the name of a file, or by that of one in a folder `environments` of `fmus`."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from twin.errors import SceneError, nearest
from twin.scene.environment_builder import Problems, assemble

if TYPE_CHECKING:
    from twin.scene.environment import Environment

MOST_BYTES = 2_000_000
READERS = {".svg": "svg", ".geojson": "geojson", ".json": "geojson"}  # suffix: module that reads it
SHIPPED = "fmus/*/environments/*"


def shipped() -> dict[str, Path]:
    """Every environment that is found by its name: of the current directory first, then as components are found."""
    here = Path.cwd()
    roots = dict.fromkeys([here, *(Path(entry or here) for entry in sys.path), Path(__file__).parents[2]])
    found: dict[str, Path] = {}
    for root in roots:
        for path in sorted(root.glob(SHIPPED)):
            if path.suffix in READERS:
                found.setdefault(path.stem, path)
    return found


def names() -> list[str]:
    """Names of the environments that are there without naming a file."""
    return sorted(shipped())


def place(name: str | Path, beside: Path | None = None) -> Path:
    """The file that a path or a name means; SceneError if there is none."""
    path = Path(name)
    if path.suffix in READERS:
        for one in dict.fromkeys([(beside or Path()) / path, path]):
            if one.is_file():
                return one
        known = [other.name for other in path.parent.glob("*") if other.suffix in READERS]
        raise SceneError(
            f"There is no file {path}. {nearest(path.name, known)}" if known else f"There is no file {path}."
        )
    if path.parent != Path() or path.suffix:
        raise SceneError(f"{path}: cannot be read. Expected {', '.join(READERS)}, or the name of an environment.")
    every = shipped()
    if path.name not in every:
        raise SceneError(f"There is no environment '{path.name}'. {nearest(path.name, every)}")
    return every[path.name]


def read(name: str | Path, beside: Path | None = None) -> Environment:
    """The environment of a file, SVG or GeoJSON, or of a name; SceneError lists all its problems, one line each.

    A relative path is looked for in the folder `beside` first.
    """
    path = place(name, beside)
    shown = str(name) if path.suffix == Path(name).suffix else path.name
    with path.open("rb") as file:
        data = file.read(MOST_BYTES + 1)
    problems = Problems()
    if len(data) > MOST_BYTES:
        problems.add(shown, f"is larger than {MOST_BYTES // 1_000_000} MB. Draw simpler lines.")
        problems.refuse()
    reader = importlib.import_module(f"twin.scene.{READERS[path.suffix]}")
    drawn, texts = reader.read(data, shown, problems)
    return assemble(drawn, path, shown, texts, problems)
