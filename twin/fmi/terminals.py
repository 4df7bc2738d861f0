"""terminalsAndIcons.xml of FMI 3.0: which variables of a component are connected together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lxml import etree

from twin.fmi.description import add, serialized

if TYPE_CHECKING:
    from twin.component import Component

PLACE = "terminalsAndIcons/terminalsAndIcons.xml"


def files(cls: type[Component]) -> dict[str, bytes]:
    """The file under its place in the FMU; nothing for a component without terminals.

    All members are signals: a force is what the other side's output says, with the sign in its description, and is not
    summed up as a flow would be.
    """
    if not cls.terminals:
        return {}
    root = etree.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    group = add(root, "Terminals")
    for name, terminal in cls.terminals.items():
        element = add(group, "Terminal", name=name, matchingRule=terminal.rule, description=terminal.description)
        for member, variable in terminal.members.items():
            add(element, "TerminalMemberVariable", variableName=variable.name, memberName=member, variableKind="signal")
    return {PLACE: serialized(root)}


def none(_: type[Component]) -> dict[str, bytes]:
    """FMI 2.0 knows no terminals."""
    return {}
