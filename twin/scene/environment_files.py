"""Environments by file path, or by the name of a file in a folder `environments` of `fmus`."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from twin.errors import SceneError, nearest
from twin.scene.environment_builder import Problems, assemble

if TYPE_CHECKING:
    from twin.scene.environment import Environment

MAX_FILE_SIZE = 2_000_000
READERS = {".svg": "svg", ".geojson": "geojson", ".json": "geojson"}  # suffix: module that reads it
SHIPPED = "fmus/*/environments/*"


def shipped_environments() -> dict[str, Path]:
    """Find all environments with a name: in the current directory first, then in the search order of components."""
    current = Path.cwd()
    roots = dict.fromkeys([current, *(Path(entry or current) for entry in sys.path), Path(__file__).parents[2]])
    environments: dict[str, Path] = {}
    for root in roots:
        for path in sorted(root.glob(SHIPPED)):
            if path.suffix in READERS:
                environments.setdefault(path.stem, path)
    return environments


def locate_environment(name: str | Path) -> Path:
    """Resolve a path or a name to a file; SceneError if it does not exist."""
    path = Path(name)
    if path.suffix in READERS:
        if path.is_file():
            return path
        names = [other.name for other in path.parent.glob("*") if other.suffix in READERS]
        raise SceneError(
            f"There is no file {path}. {nearest(path.name, names)}" if names else f"There is no file {path}."
        )
    if path.parent != Path() or path.suffix:
        raise SceneError(f"{path}: cannot be read. Expected {', '.join(READERS)}, or the name of an environment.")
    environments = shipped_environments()
    if path.name not in environments:
        raise SceneError(f"There is no environment '{path.name}'. {nearest(path.name, environments)}")
    return environments[path.name]


def read_environment(name: str | Path) -> Environment:
    """Read an environment from an SVG or GeoJSON file, or by its name; SceneError lists all its problems, one line each."""
    path = locate_environment(name)
    shown = str(name) if path.suffix == Path(name).suffix else path.name
    with path.open("rb") as file:
        data = file.read(MAX_FILE_SIZE + 1)
    problems = Problems()
    if len(data) > MAX_FILE_SIZE:
        problems.add(shown, f"is larger than {MAX_FILE_SIZE // 1_000_000} MB. Draw simpler lines.")
        problems.raise_if_any()
    reader = importlib.import_module(f"twin.scene.{READERS[path.suffix]}")
    lines, texts = reader.read(data, shown, problems)
    return assemble(lines, path, shown, texts, problems)
