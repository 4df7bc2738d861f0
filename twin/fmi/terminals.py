"""terminalsAndIcons.xml of FMI 3.0: which variables are connected together, of components and third-party FMUs."""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING, Any

from lxml import etree

from twin.coupling import TerminalMember
from twin.errors import FMUError
from twin.fmi.xml_checks import VARIABLES, root_of

if TYPE_CHECKING:
    from collections.abc import Iterator
    from collections.abc import Set as AbstractSet
    from pathlib import Path

    from twin.component import Component

ARCHIVE_PATH = "terminalsAndIcons/terminalsAndIcons.xml"
DEEPEST = 8  # levels of terminals in terminals
NOTES = 3  # about one file

# element -> attributes with a member's name and variable, and its kind if no attribute declares it
MEMBERS = {
    "TerminalMemberVariable": (("memberName", "variableName", ""),),
    "TerminalStreamMemberVariable": (
        ("inStreamMemberName", "inStreamVariableName", "stream"),
        ("outStreamMemberName", "outStreamVariableName", "stream"),
    ),
}


def files(cls: type[Component]) -> dict[str, bytes]:
    """Return terminalsAndIcons.xml by its path in the FMU; empty for a component without terminals.

    All members are signals: a force is what the other side's output says, with the sign in its description, and is not
    summed up as a flow would be.
    """
    if not cls.terminals:
        return {}
    from twin.fmi.exporting.model_description_writer import add, serialized

    root = etree.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    group = add(root, "Terminals")
    for name, terminal in cls.terminals.items():
        element = add(group, "Terminal", name=name, matchingRule=terminal.rule, description=terminal.description)
        for member, variable in terminal.members.items():
            add(element, "TerminalMemberVariable", variableName=variable.name, memberName=member, variableKind="signal")
    return {ARCHIVE_PATH: serialized(root)}


def none(_: type[Component]) -> dict[str, bytes]:
    """Return no file: FMI 2.0 has no terminals."""
    return {}


def read(
    path: Path, content: bytes, variables: AbstractSet[str]
) -> tuple[dict[str, tuple[TerminalMember, ...]], list[str]]:
    """Return the terminal members of an FMU's variables, and notes about terminals that are left out.

    Terminals are optional: what is wrong with one does not stop a run. FMUError for a file that can do harm.
    """
    members_by_variable: dict[str, list[TerminalMember]] = {}
    notes: list[str] = []
    where = f"{path}: {ARCHIVE_PATH}"
    root = root_of(where, content) if content else etree.Element("none")
    namespace = etree.QName(root).namespace
    taken: set[str | None] = set()
    count = 0
    for terminal in (
        child for group in children(root, "Terminals", namespace) for child in children(group, "Terminal", namespace)
    ):
        members = list(islice(members_of(terminal, (), namespace, where), VARIABLES + 1))
        count += len(members)
        if count > VARIABLES:
            raise FMUError(f"{where} has more than {VARIABLES} members of terminals. Export the FMU with fewer.")
        name = terminal.get("name")
        reason = f"terminal {name!r} is there twice" if name in taken else wrong(members, variables)
        taken.add(name)
        if reason:
            notes.append(f"{where} line {terminal.sourceline}: {reason}. The terminal cannot be connected.")
            continue
        for variable, member in members:
            members_by_variable.setdefault(variable, []).append(member)
    if len(notes) > NOTES:
        notes[NOTES:] = [f"{where}: {len(notes) - NOTES} more terminals cannot be connected."]
    return {name: tuple(entries) for name, entries in members_by_variable.items()}, notes


def children(element: Any, tag: str, namespace: str | None) -> list[Any]:
    """Elements of a name directly below another; vendor annotations are deeper, or in a namespace of theirs."""
    return list(element.findall(f"{{{namespace}}}{tag}" if namespace else tag))


def members_of(
    terminal: Any, above: tuple[str, ...], namespace: str | None, where: str
) -> Iterator[tuple[str, TerminalMember]]:
    """Yield (variable, member) of a terminal and of the terminals in it.

    A terminal in another is `outer.inner`, and its members are members of the outer one too, as `inner.member`. Members
    of a sequence match by their order: they are named by it.
    """
    if len(above) == DEEPEST:
        raise FMUError(f"{where} line {terminal.sourceline}: terminals are more than {DEEPEST} deep. Nest them less.")
    names = (*above, terminal.get("name", ""))
    rule, number = terminal.get("matchingRule", ""), 0
    for tag, attributes in MEMBERS.items():
        for element in children(terminal, tag, namespace):
            for attribute, variable, kind in attributes:
                number += 1
                own = str(number) if rule == "sequence" else element.get(attribute, "")
                for i in range(1, len(names) + 1):
                    member = ".".join((*names[i:], own))
                    yield (
                        element.get(variable, ""),
                        TerminalMember(
                            ".".join(names[:i]), member, rule, kind or element.get("variableKind", "signal")
                        ),
                    )
    for inner in children(terminal, "Terminal", namespace):
        yield from members_of(inner, names, namespace, where)


def wrong(members: list[tuple[str, TerminalMember]], variables: AbstractSet[str]) -> str:
    """Return why a terminal is invalid, or an empty string."""
    distinct_members: set[tuple[str, str]] = set()
    for variable, path in members:
        if "" in (*path.terminal.split("."), *path.name.split(".")):
            return f"a terminal or a member of {path.terminal!r} has no name"
        if variable not in variables:
            return (
                f"member {path.name!r} of terminal {path.terminal!r} is the variable {variable!r}, which there is not"
            )
        if (path.terminal, path.name) in distinct_members:
            return f"member {path.name!r} of terminal {path.terminal!r} is there twice"
        distinct_members.add((path.terminal, path.name))
    return ""
