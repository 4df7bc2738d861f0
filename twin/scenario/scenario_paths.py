"""Lookup of scenarios and studies by name: first in the current folder, then among those shipped with the project."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from twin.errors import ScenarioError, find_similar, nearest, suggestion

if TYPE_CHECKING:
    from twin.scenario.yaml_files.yaml_node import Node

FOLDERS = {"scenario": "scenarios", "study": "scenarios/studies", "validation": "validation"}
TOPICS = {  # `topic` of a scenario, heading
    "operate": "Operate",
    "navigation": "Navigation",
    "force": "Force on the beating heart",
    "grippers": "Grippers and rig",
    "injection": "Injection",
    "drives": "Drives and failures",
}
START_HERE = ("heart_wall_force", "teleoperation")  # scenarios to begin with
OPERATOR_VARIANT = "by hand"  # variant whose inputs are those of the controls; in others a script or a recording moves
STUDY_KEY = re.compile(rb"^scenario:", re.MULTILINE)  # of a study, not of a scenario that a study varies
SHARE = "share/catheter-twin"  # data folder of the wheel, below the prefix


def folders(kind: str) -> list[Path]:
    """Return the existing folders of a kind in `FOLDERS`: current directory, source checkout, installed wheel."""
    import sysconfig

    roots = (Path(), Path(__file__).parents[2], Path(sysconfig.get_path("data"), SHARE))
    return [folder for root in roots if (folder := root / FOLDERS[kind]).is_dir()]


def scenarios(kind: str = "scenario") -> dict[str, Path]:
    """Return name -> path of all scenarios or studies, sorted; the first folder with a name takes precedence.

    A file in the folder of studies without the key `scenario` is a scenario that studies vary.
    """
    paths: dict[str, Path] = {}
    of_studies = folders("study") if kind in ("scenario", "study") else []
    for folder in [*(folders(kind) if kind != "study" else ()), *of_studies]:
        for path in sorted(folder.glob("*.yaml")):
            if path.stem.endswith(".parameters"):  # frozen by `twin validate --fit`
                continue
            if folder not in of_studies or is_study_file(path) == (kind == "study"):
                paths.setdefault(path.stem, path)
    return dict(sorted(paths.items()))


def is_shipped(path: Path) -> bool:
    """Whether a file came with the project."""
    import sysconfig

    roots = (Path(__file__).parents[2], Path(sysconfig.get_path("data"), SHARE))
    return any(path.resolve().is_relative_to((root / FOLDERS["scenario"]).resolve()) for root in roots)


def is_study_file(path: Path) -> bool:
    """Whether a file has the key `scenario` of a study; one that cannot be read is none."""
    try:
        return STUDY_KEY.search(path.read_bytes()) is not None
    except OSError:
        return False


@dataclass(frozen=True)
class Overview:
    """What a list shows of a scenario. `duration`: its stop time as written, also in a file that it extends.

    `variant`: the one for an operator, None if there is none. `variants`: their number. `details`: description, names and
    titles of variants, for a search.
    """

    title: str
    topic: str = ""
    duration: str = ""
    has_controls: bool = False
    variant: str | None = None
    variants: int = 1
    details: str = ""


def overview(path: Path) -> Overview:
    """Return what a scenario's own file says; stop time and controls may be inherited. The title is the error if it cannot be read."""
    from twin.scenario.yaml_files import yaml_reader

    try:
        root = yaml_reader.read(path, path.name)
    except ScenarioError as error:
        return Overview(error.problems[0])
    stop_node, console, variants = (_inherited(path, root, key) for key in ("stop_time", "console", "variants"))
    nodes = (root.get("title"), root.get("description"), root.get("topic"), stop_node)
    title, description, topic, stop = ("" if node.value is None else str(node.value) for node in nodes)
    duration = f"{stop} s" if stop.replace(".", "").isdigit() else stop
    has_controls = isinstance(console.value, list) or "controls" in console.entries
    variant = OPERATOR_VARIANT if has_controls and OPERATOR_VARIANT in root.get("variants").entries else None
    titles = (str(node.get("title").value or "") for node in variants.entries.values())
    details = " ".join((description, *variants.entries, *titles))
    return Overview(
        title or description, topic, duration, has_controls, variant, max(len(variants.entries), 1), details
    )


def _inherited(path: Path, root: Node, key: str) -> Node:
    """Return a key of a file, or of the nearest file that it extends; a node without a value if there is none."""
    from twin.scenario.yaml_files import merge, yaml_reader

    visited: set[Path] = set()
    while key not in root.entries and "extends" in root.entries and path not in visited:
        visited.add(path)
        path = merge.extended_file(path, str(root.get("extends").value))
        try:
            root = yaml_reader.read(path, path.name)
        except ScenarioError:
            break
    return root.get(key)


def title(path: Path) -> str:
    """Return a scenario's title or description, or the error if it cannot be read; `extends` is ignored."""
    return overview(path).title


def refuse_elsewhere(path: Path, kind: str = "scenario") -> None:
    """Raise ScenarioError if a file is not there but its name is that of a scenario or study."""
    if path.suffix and not path.exists() and path.stem in scenarios(kind):
        raise ScenarioError(
            f"{path}: is not there. There is a {kind} of this name elsewhere: give the name alone, {path.stem}."
        )


def located(name_or_path: str | Path, kind: str = "scenario") -> Path:
    """Resolve the name of a scenario or study to its path; return a path unchanged.

    ScenarioError for an unknown name, and for a missing file whose name exists elsewhere.
    """
    path = Path(name_or_path)
    refuse_elsewhere(path, kind)
    if path.suffix in (".yaml", ".yml") and not path.exists():
        if hint := suggest_files(path, kind):
            raise ScenarioError(f"{path}: is not there. {hint}")
    if path.suffix or len(path.parts) != 1 or path.is_file():
        return path
    named_paths = scenarios(kind)
    if path.name not in named_paths and path.exists():  # a folder or a special file: reading it raises the error
        return path
    if path.name not in named_paths:
        other, command = ("study", "twin study") if kind == "scenario" else ("scenario", "twin run")
        if path.name in scenarios(other):
            raise ScenarioError(f"{path.name!r} is a {other}: {command} {path.name}")
        if (file := path.with_suffix(".yaml")).is_file():
            if is_study_file(file) != (kind == "study"):
                raise ScenarioError(f"{file} is a {other}: {command} {file}")
            raise ScenarioError(f"There is no {kind} {path.name!r}. Name the file that is here: {file}")
        from twin.component import catalog

        if path.name in catalog.names():
            raise ScenarioError(f"{path.name!r} is a component: twin describe {path.name}")
        many = "studies" if kind == "study" else f"{kind}s"
        see = f"See `twin list {many}`." if kind in ("scenario", "study") else nearest(path.name, named_paths)
        hint = suggest_files(path, kind) or see
        raise ScenarioError(f"There is no {kind} {path.name!r}, and no file of this name. {hint}")
    return named_paths[path.name]


def suggest_files(path: Path, kind: str) -> str:
    """Return `Did you mean ...?` with files of the folder and shipped scenarios, or studies, of a similar name; "" without."""
    others = (other for other in path.parent.glob("*.y*ml") if is_study_file(other) == (kind == "study"))
    files = {other.stem: str(other) for other in others}
    names = ({name: name for name in scenarios(kind)} if path.parent == Path() else {}) | files
    close = [repr(names[name]) for name, _ in find_similar(path.stem, sorted(names))]
    return f"Did you mean {' or '.join(close)}?" if close else ""


def missing_file_advice(path: Path) -> str:
    """Return the remedy for a file that a scenario names and that does not exist: a similar name, or to extend a shipped scenario."""
    names = [other.name for other in path.parent.glob("*.y*ml")] if path.parent.is_dir() else []
    shipped = [folder / end for folder in folders("scenario") for end in (path.name, Path(*path.parts[-2:]))]
    if any(file.is_file() for file in shipped):
        nearby = [*path.parent.glob("*.yaml"), *path.parent.parent.glob("*.yaml")]
        copied = next((other.stem for other in nearby if other.stem in scenarios()), "SCENARIO")
        return f"The shipped scenarios have it: copy it too, or write `extends: {copied}` and your changes alone."
    return suggestion(path.name, names, "`") or "Give a path relative to this file."
