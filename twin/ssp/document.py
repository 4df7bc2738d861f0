"""Hardened parsing of the XML files of an SSP and validation against the schemas of the standard.

The schemas are those of the Modelica Association Project SSP, 1.0 and 2.0 (schema/, each with its license).
"""

from __future__ import annotations

import re
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from lxml import etree

from twin.errors import FMUError, ScenarioError
from twin.fmi import xml_checks

NAMESPACE = "http://ssp-standard.org/SSP1/SystemStructure"
SSD, SSC, SSV, SSM, SSB = (
    f"{{{NAMESPACE}{tag}}}"
    for tag in ("Description", "Common", "ParameterValues", "ParameterMapping", "SignalDictionary")
)
SPACES = {"ssd": SSD[1:-1], "ssc": SSC[1:-1], "ssv": SSV[1:-1], "ssm": SSM[1:-1], "ssb": SSB[1:-1]}  # usual prefixes
ROOTS = {
    f"{SSD}SystemStructureDescription": "Description",
    f"{SSV}ParameterSet": "ParameterValues",
    f"{SSM}ParameterMapping": "ParameterMapping",
    f"{SSB}SignalDictionary": "SignalDictionary",
}
DRAFT = re.compile(r"\{http://www\.pmsf\.net/xsd/SystemStructure(\w+)Draft\}(.*)")  # tags before SSP 1.0
CONSTRAINTS = "{http://umit.math.umu.se/FmiGo.xsd}KinematicConstraints"
TOLERATED_ERRORS = (  # OMSimulator leaves the name out, which changes nothing
    re.compile(r"Element 'Enumeration': The attribute 'name' is required"),
)
ROOT_TAG = re.compile(rb"<[A-Za-z_][^\s/>]*")
PREFIX = re.compile(r"Namespace prefix ([\w.-]+) ")  # message of libxml2
MAX_MESSAGES = 40  # reported for one file
SCHEMA_MESSAGE = "against the schema"


def parse_root(content: bytes, shown_path: str, deviations: list[str] | None = None) -> Any:
    """Return the root element of a file; raise ScenarioError if it is not XML or is unsafe to parse.

    With `deviations`, undeclared prefixes are declared, drafts are changed to SSP 1.0, and both are reported there.
    """
    content, prefixes = (content, []) if deviations is None else declare_prefixes(content)
    if deviations is not None and prefixes:
        text = f"the prefix {' and '.join(prefixes)} is used without xmlns:{prefixes[0]}. Declare it"
        deviations.append(f"{shown_path}:1: {text}.")
    try:
        root = xml_checks.root_of(shown_path, content)
    except FMUError as error:
        text = str(error).replace("Export the FMU once more", "Write it once more").replace("FMI needs", "SSP needs")
        raise ScenarioError(text) from None
    if deviations is not None and DRAFT.match(root.tag):
        version = root.get("version", "")
        deviations.append(f"{shown_path}:{root.sourceline}: {version} of SSP is read as 1.0. Write it for 1.0.")
        change_draft(root, shown_path)
    return root


def change_draft(root: Any, shown_path: str) -> None:
    """Change the elements of a draft to those of SSP 1.0; ScenarioError if members are coupled by constraints of FMIGo."""
    for node in root.iter("*"):
        if node.tag == CONSTRAINTS:
            text = "<KinematicConstraints> of FMIGo cannot be read. Connect the components' forces and motions"
            raise ScenarioError(f"{shown_path}:{node.sourceline}: {text}.")
        if match := DRAFT.match(node.tag):
            is_common = match[2].endswith(("Transformation", "MapEntry"))
            node.tag = f"{{{NAMESPACE}{'Common' if is_common else match[1]}}}{match[2]}"
            if node.get("version", "").startswith("Draft"):
                node.set("version", "1.0")


def declare_prefixes(content: bytes) -> tuple[bytes, list[str]]:
    """Declare the prefixes that a file uses without a namespace, as exports for the OSP do, if nothing else is wrong with it."""
    parser = etree.XMLParser(
        recover=True, resolve_entities=False, no_network=True, load_dtd=False, dtd_validation=False, huge_tree=False
    )
    with suppress(etree.XMLSyntaxError, ValueError):
        etree.fromstring(content, parser)
    errors = [entry for entry in parser.error_log if entry.level >= etree.ErrorLevels.ERROR]
    root_tag = ROOT_TAG.search(content)
    if root_tag is None or any(entry.type != etree.ErrorTypes.NS_ERR_UNDEFINED_NAMESPACE for entry in errors):
        return content, []
    prefixes = sorted({match[1] for entry in errors if (match := PREFIX.match(entry.message))})
    spaces = {prefix: SPACES.get(prefix, f"urn:undeclared:{prefix}") for prefix in prefixes}
    declarations = "".join(f' xmlns:{prefix}="{space}"' for prefix, space in spaces.items()).encode()
    return content[: root_tag.end()] + declarations + content[root_tag.end() :], prefixes


@cache
def schema(version: str, name: str) -> Any:
    """Compile a schema; cached for the life of the process."""
    path = Path(__file__).parent / "schema" / version / f"SystemStructure{name}.xsd"
    return etree.XMLSchema(etree.parse(str(path)))


def violations(root: Any, shown_path: str) -> list[str]:
    """Validate a file, or a part with a schema of its own, and return one message for each invalid line."""
    name = ROOTS.get(root.tag)
    if name is None:
        expected = ", ".join(shorten(tag) for tag in ROOTS)
        return [
            f"{shown_path}:{root.sourceline}: <{shorten(root.tag)}> is no root of an SSP file. Expected {expected}."
        ]
    version = root.get("version", "")
    if not re.fullmatch(r"1\.\d+(-.*)?|2\.0", version):
        reason = f"is for SSP {version}" if version else "does not say for which SSP version it is"
        return [f"{shown_path}:{root.sourceline}: {reason}; 1.0 and 2.0 can be read. Write it for one of them."]
    compiled_schema = schema(f"{version[0]}.0", name)
    if compiled_schema.validate(root):
        return []
    messages: dict[tuple[int, str], str] = {}
    for entry in compiled_schema.error_log:
        text = shorten(entry.message).rstrip(".")
        if not any(pattern.search(text) for pattern in TOLERATED_ERRORS):
            messages.setdefault(
                (entry.line, entry.path),
                f"{shown_path}:{entry.line}: {SCHEMA_MESSAGE} of SSP {version}: {text}. Correct it.",
            )
    lines = list(messages.values())
    remainder = [f"{shown_path}: {len(lines) - MAX_MESSAGES} more lines against the schema. Correct these first."]
    return lines[:MAX_MESSAGES] + (remainder if len(lines) > MAX_MESSAGES else [])


def shorten(text: str) -> str:
    """Strip namespaces from a tag or a schema message and put it on one line of at most 300 characters."""
    single_line = " ".join(re.sub(r"\{http[^{}]*\}", "", text).split())
    return single_line if len(single_line) <= 300 else single_line[:297] + "..."
