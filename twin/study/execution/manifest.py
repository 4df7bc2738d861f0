"""Manifest of a study: input hashes that reveal changes, versions of the packages, the command."""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import compiler, installed
from twin.component import Component, PythonComponent, catalog
from twin.errors import ScenarioError
from twin.results import run_folder, write_text
from twin.scenario import ScenarioSpec, members

if TYPE_CHECKING:
    from collections.abc import Iterator

    from twin.study.design import Study

NAME = "manifest.json"
PACKAGES = ("scipy", "SALib", "optuna", "distributed")


def inputs(study: Study) -> dict[str, str]:
    """Name -> hash of everything that decides what comes out: the files, and what each component computes."""
    return study.input_hashes() | components(study.scenario) | analyses(study.scenario)


def analyses(scenario: ScenarioSpec) -> dict[str, str]:
    """Analysis -> hash of the source of its function, and of the user's modules that it imports."""
    return {f"analysis {analysis.name}": compiler.source_hash(analysis.load()) for analysis in scenario.analyses}


def components(scenario: ScenarioSpec) -> dict[str, str]:
    """Member -> hash of what it computes, of all variants."""
    hashes = {}
    for name, made in made_of(scenario):
        if isinstance(made, Path):
            hashes[name] = hashlib.sha256(made.read_bytes()).hexdigest()
        else:
            hashes[f"{name} ({compiler.model_name(made)})"] = content_hash(made)
    return hashes


def content_hash(cls: type[Component]) -> str:
    """Hash of what a component computes; of one that cannot be traced, of the C that it becomes now."""
    if key := compiler.component_fingerprint(cls):
        return key
    if issubclass(cls, PythonComponent):
        raise ScenarioError(
            f"{cls.__name__}: holds values that cannot be compared, so that nobody could tell whether it changes while the "
            f"study runs. Keep files, generators and locks out of its class and module."
        )
    made = compiler.translate(cls, compiler.model_name(cls))
    return hashlib.sha256(f"{made.header}{made.source}".encode()).hexdigest()


def made_of(scenario: ScenarioSpec) -> Iterator[tuple[str, type[Component] | Path]]:
    """Each member of each variant with its component, or the FMU that it is."""
    for case in scenario.variants:
        for name, spec in case.members.items():
            made = members.component_of(spec)
            if isinstance(made, str) and made.endswith(".fmu"):
                yield name, Path(made)
            else:
                yield name, catalog.component(made) if isinstance(made, str) else made


def write(folder: Path, **entries: Any) -> None:
    """Write the manifest."""
    write_text(folder / NAME, json.dumps(entries, indent=2, allow_nan=False) + "\n")


def read(folder: Path) -> dict[str, Any]:
    """The manifest of a study. ScenarioError if there is none."""
    try:
        data: dict[str, Any] = json.loads((folder / NAME).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ScenarioError(
            f"{folder}: has no {NAME}. Name the folder of a study, such as runs/thousand_patients/..."
        ) from None
    except ValueError:
        raise ScenarioError(f"{folder / NAME}: is damaged. Run the study again.") from None
    return data


def study_folders(parent: Path, file: str) -> list[Path]:
    """Folders of the runs of a study that have a file, the newest last; without `latest`, which is a link to one of them."""
    return sorted(path.parent for path in parent.glob(f"*/{file}") if not path.parent.is_symlink())


def versions() -> dict[str, str]:
    """Versions of all that has a part in the results."""
    from importlib.metadata import PackageNotFoundError

    packages = dict(run_folder.software_versions())
    for name in PACKAGES:
        with suppress(PackageNotFoundError):  # of an extra
            packages[name] = installed.version(name)
    return packages


def refuse_changed(folder: Path, now: dict[str, str]) -> dict[str, Any]:
    """The manifest of a study that is to go on. ScenarioError if what it is made from has changed since."""
    stored = read(folder)
    before = stored["inputs"]
    if changed := [name for name in {**before, **now} if before.get(name) != now.get(name)]:
        what = ", ".join(changed[:3]) + (f" and {len(changed) - 3} others" if len(changed) > 3 else "")
        raise ScenarioError(
            f"{folder}: cannot go on, since it was made from something else: {what} changed. "
            f"Change that back, or run the study anew without --resume."
        )
    return stored


def is_complete(study: Study, folder: Path) -> bool:
    """Whether a run of a study is complete; ScenarioError if what it is made from has changed since."""
    return bool(refuse_changed(folder, inputs(study))["status"] == "completed")


def latest(root: Path, name: str) -> Path:
    """The newest folder of a study. ScenarioError if there is none."""
    folders = study_folders(root / name, NAME)
    if not folders:
        raise ScenarioError(f"{root / name}: there is no study to go on with. Run it without --resume first.")
    return folders[-1]
