"""Reader of YAML files into a tree with source locations, so that an error can give file and line.

Plain scalars follow YAML 1.2: `1e-3` is a number, `on` and `12:30` are text. Tags and `<<` are rejected, aliases count
as the nodes they expand to, and size and depth are limited, so that no file can exhaust memory.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from twin.errors import ScenarioError
from twin.scenario.yaml_files.yaml_node import Node, SourceLocation

if TYPE_CHECKING:
    from collections.abc import Iterator

MAX_BYTES = 20_000_000  # recorded operation of one hour at 30 events per second
MAX_NODES = 1_000_000
MAX_DEPTH = 24

FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
INTEGER = re.compile(r"[-+]?[0-9]{1,20}")  # as many digits as 64 bits have
SPECIAL: dict[str, Any] = {"": None, "~": None, "null": None, "true": True, "false": False}
SPECIAL |= {".inf": float("inf"), "-.inf": float("-inf"), ".nan": float("nan")}

Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # only its event parser is used; no objects are constructed


def scalar(text: str) -> Any:
    """Parse a plain scalar."""
    if text in SPECIAL:
        return SPECIAL[text]
    if text.lower() in SPECIAL and text in (text.upper(), text.title()):
        return SPECIAL[text.lower()]
    if INTEGER.fullmatch(text):
        return int(text)
    return float(text) if FLOAT.fullmatch(text) else text


def read(path: Path, shown: str, problems: list[str] | None = None) -> Node:
    """Read a file; `shown`: its name in messages. Duplicate keys are appended to `problems`, if given, else raised."""
    try:
        if path.is_dir():
            raise ScenarioError(f"{shown}: is a folder. Name a file in it, such as {shown}/contact.yaml.")
        if path.exists() and not path.is_file():
            raise ScenarioError(f"{shown}: is a pipe, a socket or a device. Give a regular file.")
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{shown}: cannot be read ({getattr(error, 'strerror', None) or error}).") from None
    if data.startswith(b"PK\x03\x04"):
        raise ScenarioError(f"{shown}: {archive(path)}")
    if len(data) > MAX_BYTES:
        raise ScenarioError(f"{shown}: is larger than {MAX_BYTES // 1_000_000} MB. Such files have a few kilobytes.")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        byte = data[error.start]
        raise ScenarioError(f"{shown}:{line}: byte 0x{byte:02x} is not UTF-8 text. Save the file as UTF-8.") from None
    return parse(text, shown, problems)


def archive(path: Path) -> str:
    """Return advice for an archive given instead of a text."""
    if path.suffix == ".fmu":
        return "is an FMU, not a scenario. Run it with `twin simulate`, or name it as a member's component."
    if path.suffix == ".ssp":
        return "is an SSP, which is no text. Name it where a scenario is named."
    return "is a zip archive, not a text. Name the scenario in it."


def parse(text: str, shown: str, problems: list[str] | None = None) -> Node:
    """Parse a YAML text. Duplicate keys are appended to `problems`, if given, else raised as ScenarioError."""
    try:
        return Composer(shown, problems).document(yaml.parse(text, Loader=Loader))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f":{mark.line + 1}" if mark else ""
        reason = " ".join(str(part) for part in (error.problem, error.context) if part)
        # Inside { } and [ ], YAML ends plain text at the bracket of `sheath.x[3]`.
        element = mark is not None and re.search(r"[A-Za-z_0-9]\[", text.split("\n")[min(mark.line, text.count("\n"))])
        advice = "Put names like x[3] in quotes" if element else "Check indentation, quotes and brackets"
        raise ScenarioError(f"{shown}{line}: not YAML: {reason}. {advice} there.") from None
    except yaml.reader.ReaderError as error:
        line = f":{text.count(chr(10), 0, error.position) + 1}" if 0 <= error.position <= len(text) else ""
        raise ScenarioError(f"{shown}{line}: not YAML: {error.reason}. Remove that character.") from None


class Composer:
    """Builds the tree of one document from the parser's events."""

    def __init__(self, shown: str, problems: list[str] | None) -> None:
        self.shown = shown
        self.count = 0
        self.anchors: dict[str, tuple[Node, int]] = {}  # anchor -> node and number of nodes in it
        self.raises = problems is None
        self.problems = [] if problems is None else problems

    def location(self, event: Any) -> SourceLocation:
        """Return the location at which an event begins."""
        return SourceLocation(self.shown, event.start_mark.line + 1, event.start_mark.column + 1)

    def document(self, events: Iterator[Any]) -> Node:
        """Compose the only document of the stream."""
        root: Node | None = None
        for event in events:
            if isinstance(event, yaml.DocumentStartEvent):
                if root is not None:
                    raise ScenarioError(f"{self.location(event)}: a second document begins. Use one file for each.")
                root = self.node(next(events), events, 0)
        if root is None or root.value is None:
            raise ScenarioError(f"{self.shown}: is empty. Write it, or name another file.")
        if self.raises and self.problems:
            raise ScenarioError(self.problems)
        return root

    def node(self, event: Any, events: Iterator[Any], depth: int) -> Node:
        """Compose the node that begins with `event`."""
        location = self.location(event)
        previous_count = self.count
        self.add(1, location)
        if depth > MAX_DEPTH:
            raise ScenarioError(f"{location}: nested more than {MAX_DEPTH} deep. A scenario needs six levels.")
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self.anchors:
                raise ScenarioError(f"{location}: nothing is called &{event.anchor} above this line. Define it first.")
            target, count = self.anchors[event.anchor]
            self.add(count, location)
            return target
        if event.tag not in (None, "!"):
            raise ScenarioError(f"{location}: the tag {event.tag} is not supported. Write the plain value.")
        if isinstance(event, yaml.ScalarEvent):
            node = Node(scalar(event.value) if event.implicit[0] else event.value, location)
        elif isinstance(event, yaml.SequenceStartEvent):
            node = Node(list(self.sequence(events, depth)), location)
        else:
            node = Node(self.mapping(events, depth), location)
        if event.anchor:
            self.anchors[event.anchor] = node, self.count - previous_count
        return node

    def sequence(self, events: Iterator[Any], depth: int) -> Iterator[Node]:
        """Yield the items until the list ends."""
        while not isinstance(event := next(events), yaml.SequenceEndEvent):
            yield self.node(event, events, depth + 1)

    def mapping(self, events: Iterator[Any], depth: int) -> dict[str, Node]:
        """Compose the entries until the mapping ends."""
        entries: dict[str, Node] = {}
        while not isinstance(event := next(events), yaml.MappingEndEvent):
            location = self.location(event)
            if not isinstance(event, yaml.ScalarEvent):
                raise ScenarioError(
                    f"{location}: a key must be a name. Put {{ }} or [ ] in quotes if it is meant as text."
                )
            if event.value == "<<":
                raise ScenarioError(f"{location}: `<<` is not supported. Use `extends` or `variants`.")
            if event.value in entries:
                first = entries[event.value].location.line
                self.problems.append(f"{location}: `{event.value}` is given twice, first on line {first}. Keep one.")
            entries[event.value] = Node(self.node(next(events), events, depth + 1).value, location)
        return entries

    def add(self, count: int, location: SourceLocation) -> None:
        """Count nodes, those of aliases each time they are used; ScenarioError above the limit."""
        self.count += count
        if self.count > MAX_NODES:
            raise ScenarioError(
                f"{location}: more than {MAX_NODES} values, aliases counted. Make the scenario smaller."
            )
