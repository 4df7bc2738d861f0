"""C sources of FMUs without a library for this machine, and the wrapper of FMI 1.0: compiled by `zig cc`, kept in the store.

The headers of FMI are those that FMPy brings, which also switch off the prefix that functions have in a static library.
"""

from __future__ import annotations

import importlib.util
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import compiler
from twin.errors import BuildError, FMUError
from twin.fmi.fmi_version import FMI2
from twin.fmi.importing import fmi1

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

PREFIXES = (
    "FMI2_OVERRIDE_FUNCTION_PREFIX",
    "FMI2_FUNCTION_PREFIX=",
    "FMI3_OVERRIDE_FUNCTION_PREFIX",
    "FMI3_FUNCTION_PREFIX=",
)
OPTIONS = (*(f"-D{text}" for text in PREFIXES), "-Ifmi-headers", "-I.")  # no prefix, in headers of any version
LANGUAGES = re.compile(r"(?i)c(89|90|99|11|17|\+\+.*)?")
BUILD = Path("build")  # its store holds what was compiled


def build_wrapper() -> bytes:
    """Compile the wrapper of FMI 1.0 for this machine."""
    return build_library({fmi1.WRAPPER.name: fmi1.WRAPPER.read_bytes()}, [fmi1.WRAPPER.name], ())


def build_sources(path: Path, description: Any, files: Mapping[str, bytes]) -> bytes:
    """Compile the sources of an FMU for this machine. `files`: all of its archive below `sources/`, without that prefix.

    FMUError if it does not say what is to be compiled, or if that fails.
    """
    names, options = description_of_build(path, description, files)
    missing = [name for name in names if name not in files]
    if missing:
        raise FMUError(f"{path}: sources/{missing[0]} is listed, but not in the FMU. Export it with its library.")
    try:
        return build_library(files, names, options)
    except BuildError as error:
        text = f"its sources cannot be compiled ({error}). Export it with a library for this machine"
        raise FMUError(f"{path}: {text}.") from None


def description_of_build(path: Path, description: Any, files: Mapping[str, bytes]) -> tuple[list[str], tuple[str, ...]]:
    """Return what is to be compiled, and options: by buildDescription.xml (FMI 3.0) or <SourceFiles> (FMI 2.0)."""
    if description.fmi == FMI2:
        listed = description.tree.iterfind(f"{description.interface}/SourceFiles/File")
        names = [node.get("name", "") for node in listed]
        if not names:
            raise FMUError(f"{path}: has sources but does not list them. Export it with a library for this machine.")
        return names, ()
    if "buildDescription.xml" not in files:
        raise FMUError(f"{path}: has no sources/buildDescription.xml. Export it with a library for this machine.")
    from twin.fmi.xml_checks import root_of

    root = root_of(f"{path}: buildDescription.xml", files["buildDescription.xml"])
    own = [
        node for node in root.iterfind("BuildConfiguration") if node.get("modelIdentifier") == description.identifier
    ]
    host = compiler.host()
    matching = [node for node in own if node.get("platform") == host] or [
        node for node in own if not node.get("platform")
    ]
    if not matching:
        raise FMUError(f"{path}: buildDescription.xml has no configuration for {host}. Export it with a library.")
    names, options = [], []
    for source_set in matching[0].iterfind("SourceFileSet"):
        if not LANGUAGES.fullmatch(source_set.get("language", "C")):
            raise FMUError(f"{path}: sources in {source_set.get('language')} cannot be compiled here. Use a library.")
        names += [node.get("name", "") for node in source_set.iterfind("SourceFile")]
        options += shlex.split(source_set.get("compilerOptions", ""))
        for node in source_set.iterfind("PreprocessorDefinition"):
            value = node.get("value")
            options.append(f"-D{node.get('name', '')}" + (f"={value}" if value is not None else ""))
        options += [f"-I{node.get('name', '')}" for node in source_set.iterfind("IncludeDirectory")]
    options += [
        f"-l{node.get('name', '')}" for node in matching[0].iterfind("Library") if node.get("external") == "true"
    ]
    return names, tuple(options)


def build_library(files: Mapping[str, bytes], names: Sequence[str], options: Sequence[str]) -> bytes:
    """Compile a library with the headers of FMI; BuildError if it fails."""
    headers = {f"fmi-headers/{file.name}": file.read_bytes() for file in sorted(header_folder().glob("*.h"))}
    return compiler.build_hosted_library("fmu-sources", {**headers, **files}, names, (*OPTIONS, *options), BUILD)


def header_folder() -> Path:
    """Return the folder of FMI's headers in FMPy; BuildError if FMPy is not installed."""
    spec = importlib.util.find_spec("fmpy")
    if spec is None or not spec.submodule_search_locations:
        raise BuildError("FMPy, which has the headers of FMI, is not installed. Run: pip install fmpy")
    return Path(next(iter(spec.submodule_search_locations))) / "c-code"
