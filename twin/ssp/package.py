"""The archive of an SSP: validated like an FMU's, unpacked into a persistent folder, its variants parsed.

The folder is named by the hash of the archive, so that frozen scenarios of earlier runs still find their FMUs.
"""

from __future__ import annotations

import os
import re
import shutil
import zlib
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from twin.errors import FMUError, ScenarioError
from twin.fmi import archive, digest
from twin.ssp.document import SCHEMA_MESSAGE, SSD, violations
from twin.ssp.model import Messages, SspElement
from twin.ssp.osp import OspReader
from twin.ssp.parser import SspParser
from twin.ssp.ssp_annotations import canonical_annotations

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

DEFAULT = "SystemStructure.ssd"
MAX_DEPTH = 8  # packages inside packages
EXTRA = "extra/catheter-twin/"  # scenario keys without an SSP equivalent


@dataclass
class Variant:
    """One system structure description. Times are in seconds, None if unspecified."""

    name: str
    file: str
    where: str
    system: SspElement
    description: str = ""
    start: float | None = None
    stop: float | None = None
    step: float | None = None
    extra: Path | None = None  # scenario keys without an SSP equivalent
    annotations: dict[str, list[bytes]] = field(default_factory=dict)  # of the root and of DefaultExperiment


@dataclass
class Package:
    """An SSP unpacked in `folder`, which may be `path` itself. The default variant is the first."""

    path: Path
    folder: Path
    variants: list[Variant]
    messages: Messages


def unpack_archive(path: Path, shown: str, build: Path) -> Path:
    """Unpack an SSP below `build` into a folder named by its hash; ScenarioError if it is none."""
    try:
        folder = (build / "ssp" / digest(path)[:20]).absolute()
        unpack(path, folder)
    except FMUError as error:
        text = str(error).removeprefix(f"{path}: ").replace(".fmu file", ".ssp file")
        raise ScenarioError(f"{shown}: {text.replace('FMU', 'SSP').replace('FMI', 'SSP')}") from None
    except OSError as error:
        raise ScenarioError(f"{shown}: cannot be unpacked below {build} ({error.strerror or error}).") from None
    return folder


def open_osp(path: Path, shown: str) -> Package:
    """Read an OspSystemStructure.xml as a package of one variant."""
    package = Package(path, path.parent, [], Messages())
    reader = OspReader(path, shown, package.messages)
    where, system = f"{shown}:1", reader.system()
    package.variants.append(
        Variant(
            path.stem, path.name, where, system, "", reader.time("StartTime"), reader.time("EndTime"), reader.base_step
        )
    )
    return package


def open_package(path: Path, shown: str, build: Path, outer_packages: tuple[str, ...] = ()) -> Package:
    """Unpack an SSP below `build`, or take its folder, and parse it; ScenarioError if it is not an SSP.

    `outer_packages`: names of enclosing ones.
    """
    if path.suffix == ".xml":
        return open_osp(path, shown)
    is_folder = path.suffix == ".ssd" or path.is_dir()
    if is_folder:
        folder = (path if path.is_dir() else path.parent).absolute()
        name = str(folder.resolve())
    else:
        folder = unpack_archive(path, shown, build)
        name = folder.name
    if name in outer_packages or len(outer_packages) >= MAX_DEPTH:
        raise ScenarioError(f"{shown}: is a part of itself, or nested more than {MAX_DEPTH} deep. Break the circle.")
    files = sorted(item.name for item in folder.glob("*.ssd"))
    if DEFAULT not in files:
        hint = f" It has {', '.join(files)}: rename one." if files else " This is not an SSP."
        raise ScenarioError(f"{shown}: has no {DEFAULT} at its top.{hint}")
    files.sort(key=lambda item: item != DEFAULT)
    if path.suffix == ".ssd" and path.is_file():
        shown = str(Path(shown).parent)  # messages name the files of the folder
    package = Package(path, folder, [], Messages())
    for file in files:
        messages = Messages()
        try:
            item = variant(SspParser(folder, shown, messages, build, (*outer_packages, name), is_folder), file)
        except ScenarioError as error:
            if file == DEFAULT:
                raise
            messages.problems += error.problems
        messages.problems = drop_duplicates(messages.problems)
        if messages.problems and file != DEFAULT:
            text = f"{file} is left out: {len(messages.problems)} problems, the first: {messages.problems[0]}"
            package.messages.deviations.append(f"{shown}: {text}")
            continue
        package.variants.append(item)
        package.messages.extend(messages)
    names = [item.name for item in package.variants]
    for item in package.variants:
        if names.count(item.name) > 1 or not item.name:
            item.name = Path(item.file).stem
    return package


def drop_duplicates(problems: list[str]) -> list[str]:
    """Drop duplicates, and schema messages about a value on a line that another message already reports."""
    reported = {
        (location_of(message), value)
        for message in problems
        if SCHEMA_MESSAGE not in message
        for value in re.findall(r"`([^`]*)`", message)
    }

    def is_reported(problem: str) -> bool:
        return any(
            (location_of(problem), value) in reported
            for value in re.findall(r"'([^']*)'", problem.partition(SCHEMA_MESSAGE)[2])
        )

    return list(
        dict.fromkeys(message for message in problems if SCHEMA_MESSAGE not in message or not is_reported(message))
    )


def location_of(problem: str) -> str:
    """Return `file:line` of a problem."""
    return problem.partition(": ")[0]


def unpack(path: Path, folder: Path) -> None:
    """Extract the archive into a folder and rename it atomically, unless its files and no others are there."""
    with path.open("rb") as file, archive.open_archive(path, file) as zipped:
        try:
            entries = archive.check_entries(path, zipped)
            if is_unpacked(folder, {name: info.CRC for name, info in entries.items()}):
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


def is_unpacked(folder: Path, checksums: Mapping[str, int]) -> bool:
    """Whether a folder holds these files and no others, with these CRC-32 checksums."""
    files = {file.relative_to(folder).as_posix() for file in folder.rglob("*") if not file.is_dir()}
    return files == checksums.keys() and all(
        zlib.crc32((folder / name).read_bytes()) == checksum for name, checksum in checksums.items()
    )


def variant(reader: SspParser, file: str) -> Variant:
    """Parse one system structure description of the archive."""
    root, shown = reader.document(file)
    where = f"{shown}:{root.sourceline}"
    name = root.get("name", "")
    system = root.find(f"{SSD}System")
    reader.messages.problems += violations(root, shown)
    if root.tag != f"{SSD}SystemStructureDescription" or system is None:
        return Variant(name, file, where, SspElement("system", "", where))
    system_element = reader.description(root, shown)
    experiment: Any = root.find(f"{SSD}DefaultExperiment")
    times = [reader.number(experiment, key, shown) for key in ("startTime", "stopTime")]
    extra = reader.folder / EXTRA / f"{Path(file).stem}.yaml"
    annotations = {"": canonical_annotations(root)}
    annotations["DefaultExperiment"] = canonical_annotations(experiment) if experiment is not None else []
    return Variant(
        name,
        file,
        where,
        system_element,
        root.get("description", "") or system.get("description", ""),
        times[0],
        times[1],
        reader.step(experiment, shown) or reader.step(system, shown) or reader.step(root, shown),
        extra if extra.is_file() else None,
        annotations,
    )
