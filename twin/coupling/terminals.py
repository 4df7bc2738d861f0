"""Terminals (FMI 3.0): expand a connection of two terminals to connections of their variables.

Members match by name (FMI 3.0, section 2.4.9.2): every member of a plug needs a partner, members of a bus may lack one;
those of a sequence are named by their positions, 1, 2, ... The causality decides which side of a pair is the source.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from twin.coupling.member import TerminalMember
from twin.errors import CouplingError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling.member import MemberVariable

    Catalog = Mapping[str, Mapping[str, MemberVariable]]
    Pair = tuple[MemberVariable, TerminalMember]

ELEMENT = re.compile(r"(.+)\[(\d+(?:\s*,\s*\d+)*)\]")
RULES = ("plug", "bus", "sequence")
FLOWS = {
    "inflow": "in",
    "outflow": "out",
}  # FMI's variableKind of flows through a terminal, by the positive direction
SHOWN = 6  # names in a message


@dataclass(frozen=True, slots=True)
class ConnectedTerminal:
    """Terminal of a member in a connection. `index`: the selected element of its arrays, `[2]`, or empty."""

    path: str
    member: str
    index: str
    members: dict[str, Pair]  # by memberName

    def end(self, name: str) -> str:
        """Return the path of a terminal member, for a connection of variables."""
        variable = self.members[name][0]
        return f"{self.member}.{variable.name}{self.index if variable.shape else ''}"


def names(variables: Mapping[str, MemberVariable]) -> list[str]:
    """Return the names of a member's terminals."""
    return list(
        dict.fromkeys(membership.terminal for variable in variables.values() for membership in variable.terminals)
    )


def find(path: str, catalog: Catalog) -> ConnectedTerminal | None:
    """Resolve `member.terminal` or `member.terminal[2]`; None if it is no terminal."""
    member, _, name = path.partition(".")
    variables = catalog.get(member, {})
    element = ELEMENT.fullmatch(name)
    if name in variables or (element and element[1] in variables):
        return None
    matched, index = members(variables, name), ""
    if not matched and element:
        matched, index = members(variables, element[1]), f"[{element[2]}]"
    return ConnectedTerminal(path, member, index, matched) if matched else None


def members(variables: Mapping[str, MemberVariable], terminal: str) -> dict[str, Pair]:
    """Return the members of a terminal by memberName."""
    return {
        membership.name: (variable, membership)
        for variable in variables.values()
        for membership in variable.terminals
        if membership.terminal == terminal
    }


def expand(a: ConnectedTerminal, b: ConnectedTerminal) -> list[tuple[str, str]]:
    """Return (source, target) of each connection between two terminals; CouplingError with all mismatches."""
    problems = [*partner_problems(a, b), *index_problems(a), *index_problems(b)]
    pairs: list[tuple[str, str]] = []
    for name in (name for name in a.members if name in b.members):
        ends = a.end(name), b.end(name)
        is_input = [terminal.members[name][0].causality == "input" for terminal in (a, b)]
        if problem := flow_problem(a.members[name][1].kind, b.members[name][1].kind):
            problems.append(f"{name}: {ends[0]} and {ends[1]} {problem}")
        elif is_input[0] == is_input[1]:
            problem_text = (
                f"both {' and '.join(ends)} are inputs" if is_input[0] else f"neither {' nor '.join(ends)} is an input"
            )
            problems.append(f"{name}: {problem_text}. Connect terminals of opposite sides.")
        else:
            pairs.append(ends if is_input[1] else ends[::-1])
    if problems:
        raise CouplingError(problems)
    return pairs


def partner_problems(a: ConnectedTerminal, b: ConnectedTerminal) -> list[str]:
    """Return the problem of members that lack a required partner."""
    unmatched = []
    for terminal, partner in ((a, b), (b, a)):
        rules = {membership.rule for _, membership in terminal.members.values()}
        if unknown := sorted(rules - set(RULES)):
            return [f"{terminal.path} has the matching rule {unknown[0]!r}. Connect its variables one by one."]
        if missing := [
            n
            for n, (_, membership) in terminal.members.items()
            if n not in partner.members and membership.rule != "bus"
        ]:
            unmatched.append(f"{shortened_list(missing)} of {terminal.path}")
    if unmatched:
        advice = "Connect terminals with the same members, or variables one by one."
        return [f"no partner at the other side for {' and '.join(unmatched)}. {advice}"]
    if not a.members.keys() & b.members.keys():
        return [
            f"nothing in common: {shortened_list(a.members)} and {shortened_list(b.members)}. Connect terminals of one kind."
        ]
    return []


def index_problems(terminal: ConnectedTerminal) -> list[str]:
    """Return the problem of an element index that does not fit the terminal's arrays."""
    arrays = [variable for variable, _ in terminal.members.values() if variable.shape]
    if not terminal.index:
        return []
    if not arrays:
        return [f"{terminal.path}: none of its variables is an array. Leave the brackets out."]
    for variable in arrays:
        if variable.index_of(terminal.index[1:-1]) is None:
            return [f"{terminal.path}: {variable.name} has shape {list(variable.shape)}, elements count from 1."]
    return []


def flow_problem(a: str, b: str) -> str:
    """Return why the values of two members cannot be copied: kinds that differ, or flows of equal direction."""
    if unknown := [kind for kind in (a, b) if kind not in (*FLOWS, "signal")]:
        return f"are of the kind {unknown[0]!r}, whose values are not just copied. Connect them by themselves."
    if a == b and a in FLOWS:
        return f"both count what flows {FLOWS[a]}: one is minus the other. Change the sign in a component between them."
    return ""


def shortened_list(labels: Mapping[str, object] | list[str]) -> str:
    """Join at most `SHOWN` names for a message."""
    every = list(labels)
    return ", ".join(every[:SHOWN]) + (f" and {len(every) - SHOWN} more" if len(every) > SHOWN else "")
