"""The archive of an SSP: checked as an FMU's is, unpacked into a folder that stays, its variants read.

The folder has the name of the archive's content, so that runs find the FMUs again that their frozen scenarios name.
"""

from __future__ import annotations

import os
import re
import shutil
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from twin.errors import FMUError, ScenarioError
from twin.fmi import archive, digest
from twin.ssp.document import SCHEMA, SSD, violations
from twin.ssp.model import Element
from twin.ssp.parser import Reader

if TYPE_CHECKING:
    from typing import Any

DEFAULT = "SystemStructure.ssd"
DEEPEST = 8  # packages inside packages
EXTRA = "extra/catheter-twin/"  # what this project keeps in an SSP that SSP has no words for


@dataclass
class Variant:
    """One system structure description. Times are in seconds, None where it does not say."""

    name: str
    file: str
    where: str
    system: Element
    description: str = ""
    start: float | None = None
    stop: float | None = None
    step: float | None = None
    extra: Path | None = None  # the rest of the scenario that it was written from
    annotations: dict[str, list[bytes]] = field(default_factory=dict)  # of the root and of DefaultExperiment


@dataclass
class Package:
    """An SSP that is unpacked in `folder`; its default variant is the first. `problems` and `notes`: what was found."""

    path: Path
    folder: Path
    variants: list[Variant]
    problems: list[str]
    notes: list[str]


def opened(path: Path, shown: str, build: Path, above: tuple[str, ...] = ()) -> Package:
    """Unpack an SSP below `build` and read it; ScenarioError if it is none."""
    try:
        name = digest(path)[:20]
        folder = (build / "ssp" / name).absolute()
        unpack(path, folder)
    except FMUError as error:
        text = str(error).removeprefix(f"{path}: ").replace(".fmu file", ".ssp file")
        raise ScenarioError(f"{shown}: {text.replace('FMU', 'SSP').replace('FMI', 'SSP')}") from None
    except OSError as error:
        raise ScenarioError(f"{shown}: cannot be unpacked below {build} ({error.strerror or error}).") from None
    if name in above or len(above) >= DEEPEST:
        raise ScenarioError(f"{shown}: is a part of itself, or nested more than {DEEPEST} deep. Break the circle.")
    files = sorted(one.name for one in folder.glob("*.ssd"))
    if DEFAULT not in files:
        hint = f" It has {', '.join(files)}: rename one." if files else " This is not an SSP."
        raise ScenarioError(f"{shown}: has no {DEFAULT} at its top.{hint}")
    files.sort(key=lambda one: one != DEFAULT)
    package = Package(path, folder, [], [], [])
    reader = Reader(folder, shown, package.problems, package.notes, build, (*above, name))
    package.variants = [variant(reader, file) for file in files]
    package.problems[:] = once(package.problems)
    names = [one.name for one in package.variants]
    for one in package.variants:
        if names.count(one.name) > 1 or not one.name:
            one.name = Path(one.file).stem
    return package


def once(problems: list[str]) -> list[str]:
    """The problems without those of the schema that are told in plainer words: of the same value on the same line."""
    told = {(place(one), value) for one in problems if SCHEMA not in one for value in re.findall(r"`([^`]*)`", one)}

    def is_told(problem: str) -> bool:
        return any((place(problem), value) in told for value in re.findall(r"'([^']*)'", problem.partition(SCHEMA)[2]))

    return list(dict.fromkeys(one for one in problems if SCHEMA not in one or not is_told(one)))


def place(problem: str) -> str:
    """`file:line` of a problem."""
    return problem.partition(": ")[0]


def unpack(path: Path, folder: Path) -> None:
    """Write the archive's files into a folder, all at once, unless they are there."""
    with path.open("rb") as file, archive.open_archive(path, file) as zipped:
        try:
            entries = archive.check_entries(path, zipped)
            if all((folder / name).is_file() and (folder / name).stat().st_size == info.file_size
                   for name, info in entries.items()) and folder.is_dir():  # fmt: skip
                return
            partial = folder.with_name(f".{folder.name}.{os.getpid()}")
            partial.parent.mkdir(parents=True, exist_ok=True)
            shutil.rmtree(partial, ignore_errors=True)
            try:
                archive.extract(path, zipped, entries, partial)
                shutil.rmtree(folder, ignore_errors=True)
                with suppress(FileExistsError):
                    partial.rename(folder)
            finally:
                shutil.rmtree(partial, ignore_errors=True)
        except (FMUError, OSError):
            raise
        except Exception as error:  # damaged archives make zipfile raise nearly anything
            raise FMUError(f"{path}: cannot be unpacked ({error}). Get or write it once more.") from None


def variant(reader: Reader, file: str) -> Variant:
    """One description of the archive."""
    root, shown = reader.document(file)
    where = f"{shown}:{root.sourceline}"
    name = root.get("name", "")
    system = root.find(f"{SSD}System")
    reader.problems += violations(root, shown)
    if root.tag != f"{SSD}SystemStructureDescription" or system is None:
        return Variant(name, file, where, Element("system", "", where))
    told = reader.description(root, shown)
    experiment: Any = root.find(f"{SSD}DefaultExperiment")
    times = [reader.number(experiment, key, shown) for key in ("startTime", "stopTime")]
    extra = reader.folder / EXTRA / f"{Path(file).stem}.yaml"
    kept = {"": reader.annotations(root)}
    kept["DefaultExperiment"] = reader.annotations(experiment) if experiment is not None else []
    return Variant(
        name,
        file,
        where,
        told,
        root.get("description", "") or system.get("description", ""),
        times[0],
        times[1],
        reader.step(experiment, shown) or reader.step(system, shown),
        extra if extra.is_file() else None,
        kept,
    )
