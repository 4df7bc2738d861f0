"""modelDescription.xml of a third-party FMU: parsed as untrusted input, and checked for the data that a run needs.

Without the schema, since many FMUs break it in places that do not matter; what does matter is checked with line numbers.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from twin.errors import FMUError
from twin.fmi.fmi_version import FMI2, FMI3, FmiVersion
from twin.fmi.importing import fmi1

if TYPE_CHECKING:
    from pathlib import Path

VARIABLES = 200_000  # largest number of variables: 10 s and 1 GB
REFERENCES = 1 << 32  # value references are 32 bit
TRUE = {"true", "1"}
INTERFACES = {  # the first that is there is taken
    "CoSimulation": "Co-Simulation",
    "ModelExchange": "Model Exchange",
    "ScheduledExecution": "Scheduled Execution",
}


@dataclass(frozen=True, slots=True)
class Description:
    """What must be known before unpacking; `interface` is that of a run, `tree` the whole document."""

    fmi: FmiVersion
    interface: str
    identifier: str
    needs_tool: bool
    tree: Any
    is_fmi1: bool = False  # converted to FMI 2.0


def error_line(error: BaseException) -> str:
    """Format an exception of third-party code as one line of at most 240 characters."""
    problems = getattr(error, "problems", None)
    text = " ".join(str(problems[0] if problems else error).split())
    named = text if len(text.split()) > 2 else f"{type(error).__name__} {text}".strip()
    return named if len(named) <= 240 else named[:237] + "..."


def root_of(where: str, content: bytes) -> Any:
    """A document's root element, parsed without trust."""
    from lxml import etree

    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, dtd_validation=False, huge_tree=False
    )
    try:
        root = etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise FMUError(f"{where} is not well-formed XML ({error_line(error)}). Export the FMU once more.") from None
    if root.getroottree().docinfo.doctype or root.getroottree().docinfo.internalDTD is not None:
        raise FMUError(f"{where} has a document type declaration. FMI needs none, and it can be harmful: remove it.")
    return root


def check(path: Path, content: bytes, wanted: str = "") -> Description:
    """Parse the document and check version, interface and variables; `wanted`: an interface; empty: the one available."""
    where = f"{path}: modelDescription.xml"
    root = root_of(where, content)
    if root.tag != "fmiModelDescription":
        raise FMUError(f"{where} has the root <{root.tag}>, expected <fmiModelDescription>. This is not an FMU.")
    converted = fmi1.is_fmi1(root)
    if converted:
        root = fmi1.convert(where, root)
    number = root.get("fmiVersion", "")
    if not re.fullmatch(r"2\.0|3\.0(\.\d+)?", number):
        said = f"is for FMI {number}" if number else "does not say for which FMI version it is"
        raise FMUError(
            f"{where} {said}; FMI 1.0 (Co-Simulation), 2.0 and 3.0 are supported. Export the FMU for one of them."
        )
    interface = interface_of(path, root, (wanted,) if wanted else tuple(INTERFACES))
    identifier = interface.get("modelIdentifier", "")
    if not re.fullmatch(r"\w[\w.+\- ]*", identifier):
        raise FMUError(f"{where}: modelIdentifier {identifier!r} is not the name of a library. Use letters and digits.")
    version = FMI2 if number == FMI2.number else FMI3
    if root.get(version.token) is None:
        raise FMUError(f"{where} has no {version.token}, without which no FMU starts. Export the FMU once more.")
    check_variables(where, root, version)
    needs_tool = interface.get("needsExecutionTool") in TRUE
    return Description(version, interface.tag, identifier, needs_tool, root, converted)


def interface_of(path: Path, root: Any, wanted: tuple[str, ...]) -> Any:
    """The element of the first interface that is there; FMUError with those that there are instead."""
    interface_element = next((element for tag in wanted if (element := root.find(tag)) is not None), None)
    if interface_element is not None:
        return interface_element
    others = [text for tag, text in INTERFACES.items() if root.find(tag) is not None]
    what = f"is for {' and '.join(others)} only" if others else "names no interface"
    needed = " or ".join(INTERFACES[tag] for tag in wanted)
    raise FMUError(f"{path}: {what}; {needed} is needed. Export it for {needed}.")


def check_variables(where: str, root: Any, version: FmiVersion) -> None:
    """Names, value references and types of all variables; dimensions against the variables that hold them."""
    container = root.find("ModelVariables")
    if container is None:
        raise FMUError(f"{where} has no <ModelVariables>. Export the FMU once more.")
    names: dict[str, int] = {}
    sizes: dict[int, Any] = {}
    elements = [element for element in container if isinstance(element.tag, str)]
    if len(elements) > VARIABLES:
        raise FMUError(
            f"{where} has {len(elements)} variables, more than {VARIABLES}. Export the FMU with those that are looked at."
        )
    for element in elements:
        location = f"{where} line {element.sourceline}"
        name = element.get("name")
        if not name:
            raise FMUError(f"{location}: a variable has no name. Name it.")
        for word in [name, *(alias.get("name", "") for alias in element.findall("Alias"))]:
            if word in names:
                raise FMUError(
                    f"{location}: variable {word!r} is there twice, first in line {names[word]}. Rename one."
                )
            names[word] = element.sourceline
        reference = parse_int(element.get("valueReference"))
        if reference is None or reference >= REFERENCES:
            given = element.get("valueReference")
            raise FMUError(f"{location}: {name!r} has the value reference {given!r}, expected 0 to {REFERENCES - 1}.")
        kinds = version.types & ({child.tag for child in element} if version == FMI2 else {element.tag})
        if len(kinds) != 1:
            raise FMUError(
                f"{location}: {name!r} has no known type. Expected one of {', '.join(sorted(version.types))}."
            )
        if version == FMI3 and reference in sizes:
            raise FMUError(
                f"{location}: {name!r} has the value reference {reference} of another variable. Renumber it."
            )
        sizes[reference] = element
    for element in elements:
        for dimension in element.findall("Dimension"):
            check_dimension(f"{where} line {dimension.sourceline}: {element.get('name')!r}", dimension, sizes)


def check_dimension(location: str, dimension: Any, variables: dict[int, Any]) -> None:
    """A dimension is a whole number, or refers to a structural parameter which has one."""
    if dimension.get("start") is not None:
        if parse_int(dimension.get("start")) is None:
            raise FMUError(f"{location} has the dimension {dimension.get('start')!r}, expected a whole number.")
        return
    reference = parse_int(dimension.get("valueReference"))
    holder = variables.get(-1 if reference is None else reference)
    if holder is None:
        raise FMUError(f"{location} has a dimension that refers to no variable. Give start, or a valueReference.")
    if parse_int(holder.get("start")) is None:
        raise FMUError(f"{location} has the dimension {holder.get('name')!r}, which starts with no whole number.")


def parse_int(text: str | None) -> int | None:
    """A number without sign, as XML holds it."""
    digits = text.strip() if text is not None else ""
    return int(digits) if digits.isdecimal() and digits.isascii() and len(digits) < 20 else None
