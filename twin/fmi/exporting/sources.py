"""`sources/` of an FMU: sources that an importer compiles for its own target, and their build description.

FMI's own headers are not among them, since nothing includes them: the functions are defined as the standard has them.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from lxml import etree

from twin.errors import BuildError
from twin.fmi.exporting import model_description_writer

if TYPE_CHECKING:
    from collections.abc import Mapping

FOLDER = Path(__file__).with_name("c")
LANGUAGE = "C11"

# gcc and clang round every operation, and whole numbers wrap around; other compilers find the first in the files
OPTIONS = "-ffp-contract=off -fwrapv"
PLATFORMS = {  # of FMI 3.0, and the library to link there beside the C library's
    "x86_64-linux": "m",
    "aarch64-linux": "m",
    "x86_64-darwin": "",
    "aarch64-darwin": "",
}


def state_machine(version: str) -> dict[str, bytes]:
    """The hand-written files for a version of FMI."""
    other = {"2.0": "fmi3", "3.0": "fmi2"}[version]
    return {p.name: p.read_bytes() for p in sorted(FOLDER.iterdir()) if not p.name.startswith(other)}


def source_files(name: str, version: str, model: str, own: Mapping[str, bytes]) -> dict[str, bytes]:
    """All of `sources/` by path in the archive: the state machine, the model, and the component's own files."""
    ours = {**state_machine(version), "model.c": model.encode()}
    taken = {file.lower() for file in ours} & {file.lower() for file in own}
    if taken:
        raise BuildError(f"{name}: {', '.join(sorted(taken))} would be in `sources` twice. Rename the component.")
    result = {f"sources/{file}": content for file, content in {**ours, **own}.items()}
    if version == "3.0":
        result["sources/buildDescription.xml"] = build_description(name, to_compile(result))
    return result


def to_compile(archive: Mapping[str, bytes]) -> list[str]:
    """What is to be compiled among the files of an archive, by path in `sources/`."""
    return sorted(
        path.removeprefix("sources/") for path in archive if path.startswith("sources/") and path.endswith(".c")
    )


def build_description(name: str, names: list[str]) -> bytes:
    """`buildDescription.xml` of FMI 3.0: a configuration for any platform, then those with options."""
    root = etree.Element("fmiBuildDescription", fmiVersion="3.0")
    for platform, library in {"": "", **PLATFORMS}.items():
        words = {"modelIdentifier": name, "platform": platform}
        configuration = model_description_writer.add(root, "BuildConfiguration", **words)
        options = OPTIONS if platform else None
        chosen = model_description_writer.add(
            configuration, "SourceFileSet", language=LANGUAGE, compilerOptions=options
        )
        for file in names:
            model_description_writer.add(chosen, "SourceFile", name=file)
        if library:
            model_description_writer.add(
                configuration, "Library", name=library, external=True, description="mathematics of the C library"
            )
    return model_description_writer.serialized(root)


def listed(model_description: bytes, names: list[str]) -> bytes:
    """modelDescription.xml of FMI 2.0 with the files to compile, the same for both interfaces."""
    root = etree.fromstring(model_description, etree.XMLParser(remove_blank_text=True, resolve_entities=False))
    for interface in (*root.iterfind("ModelExchange"), *root.iterfind("CoSimulation")):
        group = etree.Element("SourceFiles")
        interface.insert(0, group)
        for file in names:
            model_description_writer.add(group, "File", name=file)
    return model_description_writer.serialized(root)
