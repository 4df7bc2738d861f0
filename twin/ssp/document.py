"""The XML files of an SSP: parsed without trust, and held against the schemas of the standard.

The schemas are those of the Modelica Association Project SSP, 1.0 and 2.0 (schema/, each with its license).
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

from lxml import etree

from twin.errors import FMUError, ScenarioError
from twin.fmi import xml_checks

SPACE = "http://ssp-standard.org/SSP1/SystemStructure"
SSD, SSC, SSV, SSM, SSB = (
    f"{{{SPACE}{one}}}" for one in ("Description", "Common", "ParameterValues", "ParameterMapping", "SignalDictionary")
)
ROOTS = {
    f"{SSD}SystemStructureDescription": "Description",
    f"{SSV}ParameterSet": "ParameterValues",
    f"{SSM}ParameterMapping": "ParameterMapping",
    f"{SSB}SignalDictionary": "SignalDictionary",
}
TOLERATED = (  # what OMSimulator writes, and what changes nothing
    re.compile(r"Element 'Enumeration': The attribute 'name' is required"),
)
MOST = 40  # lines of one file
SCHEMA = "against the schema"


def root_of(content: bytes, shown: str) -> Any:
    """The root element of a file; ScenarioError if it is no XML, or could do harm."""
    try:
        return xml_checks.root_of(shown, content)
    except FMUError as error:
        text = str(error).replace("Export the FMU once more", "Write it once more").replace("FMI needs", "SSP needs")
        raise ScenarioError(text) from None


@cache
def schema(version: str, name: str) -> Any:
    """A schema, compiled once."""
    file = Path(__file__).parent / "schema" / version / f"SystemStructure{name}.xsd"
    return etree.XMLSchema(etree.parse(str(file)))


def violations(root: Any, shown: str) -> list[str]:
    """What a file, or a part of one that has its own schema, does against its schema: a line for each line of it."""
    name = ROOTS.get(root.tag)
    if name is None:
        expected = ", ".join(plain(tag) for tag in ROOTS)
        return [f"{shown}:{root.sourceline}: <{plain(root.tag)}> is no root of an SSP file. Expected {expected}."]
    version = root.get("version", "")
    if not re.fullmatch(r"1\.\d+(-.*)?|2\.0", version):
        said = f"is for SSP {version}" if version else "does not say for which SSP version it is"
        return [f"{shown}:{root.sourceline}: {said}; 1.0 and 2.0 can be read. Write it for one of them."]
    checked = schema(f"{version[0]}.0", name)
    if checked.validate(root):
        return []
    found: dict[tuple[int, str], str] = {}
    for one in checked.error_log:
        text = plain(one.message).rstrip(".")
        if not any(pattern.search(text) for pattern in TOLERATED):
            found.setdefault(
                (one.line, one.path), f"{shown}:{one.line}: {SCHEMA} of SSP {version}: {text}. Correct it."
            )
    lines = list(found.values())
    more = [f"{shown}: {len(lines) - MOST} more lines against the schema. Correct these first."]
    return lines[:MOST] + (more if len(lines) > MOST else [])


def plain(text: str) -> str:
    """A tag or a message of the schema without namespaces, on one line, not too long."""
    short = " ".join(re.sub(r"\{http[^{}]*\}", "", text).split())
    return short if len(short) <= 300 else short[:297] + "..."
