"""Parameter sets applied to a system: which variable of which member gets which value.

Names are SSP's hierarchical ones. A value without a mapping that fits nothing is left out, as SSP says; one that a
mapping sends to nobody is a mistake.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from twin.component import unit
from twin.errors import CouplingError, nearest
from twin.ssp.model import Binding, Element, Entry, Linear, Parameter, Table

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from twin.coupling import MemberVariable
    from twin.ssp.flat import Flat, Member

LOST = 5  # values of one set that fit nothing, of which each is told
ELEMENT = re.compile(r"(.+?)\[\d+(?:\s*,\s*\d+)*\]")


@dataclass(frozen=True)
class Given:
    """A value as it is written, and what is to be done to it; `suppress`: its unit is not converted."""

    value: Any
    unit: str | None
    change: Linear | Table | None
    suppress: bool
    where: str


def find(name: str, variables: Mapping[str, MemberVariable]) -> MemberVariable | None:
    """A variable by its name, or the array that an element belongs to."""
    if name in variables:
        return variables[name]
    element = ELEMENT.fullmatch(name)
    return variables.get(element[1]) if element else None


def apply(
    binding: Binding,
    path: tuple[str, ...],
    elements: Mapping[tuple[str, ...], Element],
    members: Mapping[tuple[str, ...], Member],
    given: dict[tuple[tuple[str, ...], str], Given],
    flat: Flat,
) -> None:
    """Apply a binding to an element; later ones win over earlier, outer ones over inner."""
    lost: list[Parameter] = []
    place = ".".join(path) or "the system"
    known = [variable for at in nearby(path, members) for variable in names(at, path, members)]
    for name, one, entry in pairs(binding, flat):
        nodes = list(reached(name, path, elements, members))
        if not nodes and entry is not None:
            hint = nearest(name, known, "`") if known else "Correct the target."
            flat.problems.append(f"{entry.where}: nothing is called `{name}` in {place}. {hint}")
        elif not nodes:
            lost.append(one)
        change, suppress = (entry.change, entry.suppress) if entry else (None, False)
        for node in nodes:
            given[node] = Given(one.value, one.unit, change, suppress, one.where)
    for one in lost[:LOST]:
        hint = nearest(one.name, known, "`") if known else ""
        flat.notes.append(
            f"{one.where}: nothing is called `{one.name}` in {place}: its value is left out. {hint}".rstrip()
        )
    if len(lost) > LOST:
        flat.notes.append(f"{binding.where}: {len(lost) - LOST} more values fit nothing and are left out.")


def pairs(binding: Binding, flat: Flat) -> Iterator[tuple[str, Parameter, Entry | None]]:
    """(name to apply to, parameter, its entry of the mapping)."""
    if binding.mapping is None:
        yield from ((one.name, one, None) for one in binding.parameters)
        return
    values = {one.name: one for one in binding.parameters}
    for entry in binding.mapping:
        if entry.source in values:
            yield entry.target, values[entry.source], entry
        else:
            hint = nearest(entry.source, values, "`") if values else "The set is empty."
            flat.problems.append(f"{entry.where}: the parameter set has no `{entry.source}`. {hint}")


def nearby(path: tuple[str, ...], members: Mapping[tuple[str, ...], Member]) -> list[tuple[str, ...]]:
    """Members inside an element."""
    return [at for at in members if at[: len(path)] == path]


def names(at: tuple[str, ...], path: tuple[str, ...], members: Mapping[tuple[str, ...], Member]) -> list[str]:
    """Names of a member's variables as an element around it calls them."""
    told = members[at].facts
    return [".".join((*at[len(path) :], name)) for name in (told.variables if told else ())]


def reached(
    name: str,
    path: tuple[str, ...],
    elements: Mapping[tuple[str, ...], Element],
    members: Mapping[tuple[str, ...], Member],
) -> Iterator[tuple[tuple[str, ...], str]]:
    """All that a name means in an element: a variable of its FMU, its own connector, or what is inside."""
    element = elements[path]
    if path in members:
        told = members[path].facts
        if told is None or find(name, told.variables) is not None:
            yield path, name
        return
    if name in element.connectors:
        yield path, name
    for child in element.elements:
        if name.startswith(f"{child.name}.") and (*path, child.name) in elements:
            yield from reached(name.removeprefix(f"{child.name}."), (*path, child.name), elements, members)


def settle(one: Given, target: str | None, what: str) -> Any:
    """A value in the unit `target`, transformed: units first, then the transformation; CouplingError if that fails."""
    if isinstance(one.value, list):
        return [settle(replace(one, value=item), target, what) for item in one.value]
    value = one.value
    if isinstance(one.change, Table):
        return one.change.entries.get(value, value)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number:
        if one.change is not None and one.change != Linear():
            raise CouplingError(
                f"{what}: a linear transformation is for numbers, not for {str(value)[:40]!r}. Drop it."
            )
        return value
    if not one.suppress and one.unit and target:
        factor, offset = unit.conversion(one.unit, target, what)
        if (factor, offset) != (1.0, 0.0):
            value = unit.round_trip(value * factor + offset)
    return value if one.change is None or one.change == Linear() else one.change.of(value)
