"""Application of parameter sets to a system.

Names are SSP's hierarchical ones. A value that matches no variable is ignored, as SSP specifies; a mapping entry whose target
does not exist is an error.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from twin.component import unit
from twin.errors import CouplingError, nearest
from twin.ssp.model import Binding, Linear, Parameter, ParameterMappingEntry, SspElement, ValueTable

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from twin.coupling import MemberVariable
    from twin.ssp.flat import FlatMember, FlatSystem

MAX_UNMATCHED_NOTES = 5  # of one parameter set; further ones are counted
ELEMENT = re.compile(r"(.+?)\[\d+(?:\s*,\s*\d+)*\]")


@dataclass(frozen=True)
class AssignedValue:
    """A value as written, and its transformation. `suppress`: its unit is not converted."""

    value: Any
    unit: str | None
    change: Linear | ValueTable | None
    suppress: bool
    where: str


def find_variable(name: str, variables: Mapping[str, MemberVariable]) -> MemberVariable | None:
    """Return a variable by its name, or the array that an element belongs to; None if there is none."""
    if name in variables:
        return variables[name]
    element = ELEMENT.fullmatch(name)
    return variables.get(element[1]) if element else None


def apply_binding(
    binding: Binding,
    path: tuple[str, ...],
    elements: Mapping[tuple[str, ...], SspElement],
    members: Mapping[tuple[str, ...], FlatMember],
    assigned: dict[tuple[tuple[str, ...], str], AssignedValue],
    flat: FlatSystem,
) -> None:
    """Apply a binding to an element; later bindings override earlier ones, outer ones inner ones."""
    unmatched: list[Parameter] = []
    element_name = ".".join(path) or "the system"
    candidates = [
        variable
        for member_path in members_inside(path, members)
        for variable in variable_names(member_path, path, members)
    ]
    for name, parameter, entry in iterate_assignments(binding, flat):
        nodes = list(resolve_name(name, path, elements, members))
        if not nodes and entry is not None:
            hint = nearest(name, candidates, "`") if candidates else "Correct the target."
            flat.problems.append(f"{entry.where}: nothing is called `{name}` in {element_name}. {hint}")
        elif not nodes:
            unmatched.append(parameter)
        change, suppress = (entry.change, entry.suppress) if entry else (None, False)
        for node in nodes:
            assigned.pop(node, None)  # to the end: an array overrides what was assigned to its elements before
            assigned[node] = AssignedValue(parameter.value, parameter.unit, change, suppress, parameter.where)
    for parameter in unmatched[:MAX_UNMATCHED_NOTES]:
        hint = nearest(parameter.name, candidates, "`") if candidates else ""
        flat.notes.append(
            f"{parameter.where}: nothing is called `{parameter.name}` in {element_name}: its value is left out. {hint}".rstrip()
        )
    if len(unmatched) > MAX_UNMATCHED_NOTES:
        flat.notes.append(
            f"{binding.where}: {len(unmatched) - MAX_UNMATCHED_NOTES} more values fit nothing and are left out."
        )


def iterate_assignments(
    binding: Binding, flat: FlatSystem
) -> Iterator[tuple[str, Parameter, ParameterMappingEntry | None]]:
    """Yield (target name, parameter, mapping entry or None)."""
    if binding.mapping is None:
        yield from ((parameter.name, parameter, None) for parameter in binding.parameters)
        return
    values = {parameter.name: parameter for parameter in binding.parameters}
    for entry in binding.mapping:
        if entry.source in values:
            yield entry.target, values[entry.source], entry
        else:
            hint = nearest(entry.source, values, "`") if values else "The set is empty."
            flat.problems.append(f"{entry.where}: the parameter set has no `{entry.source}`. {hint}")


def members_inside(path: tuple[str, ...], members: Mapping[tuple[str, ...], FlatMember]) -> list[tuple[str, ...]]:
    """Return the paths of the members inside an element."""
    return [member_path for member_path in members if member_path[: len(path)] == path]


def variable_names(
    member_path: tuple[str, ...], path: tuple[str, ...], members: Mapping[tuple[str, ...], FlatMember]
) -> list[str]:
    """Return the names of a member's variables relative to an enclosing element."""
    info = members[member_path].info
    return [".".join((*member_path[len(path) :], name)) for name in (info.variables if info else ())]


def resolve_name(
    name: str,
    path: tuple[str, ...],
    elements: Mapping[tuple[str, ...], SspElement],
    members: Mapping[tuple[str, ...], FlatMember],
) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield the nodes that a name refers to: a variable of the element's FMU, its connector, or nodes inside it."""
    element = elements[path]
    if path in members:
        info = members[path].info
        if info is None or find_variable(name, info.variables) is not None:
            yield path, name
        return
    if name in element.connectors:
        yield path, name
    for child in element.elements:
        if name.startswith(f"{child.name}.") and (*path, child.name) in elements:
            yield from resolve_name(name.removeprefix(f"{child.name}."), (*path, child.name), elements, members)


def convert_value(assigned: AssignedValue, target: str | None, what: str) -> Any:
    """Convert a value to the unit `target`, then transform it; CouplingError if that fails."""
    if isinstance(assigned.value, list):
        return [convert_value(replace(assigned, value=item), target, what) for item in assigned.value]
    value = assigned.value
    if isinstance(assigned.change, ValueTable):
        return assigned.change.entries.get(value, value)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number:
        if assigned.change is not None and assigned.change != Linear():
            raise CouplingError(
                f"{what}: a linear transformation is for numbers, not for {str(value)[:40]!r}. Drop it."
            )
        return value
    if not assigned.suppress and assigned.unit and target:
        factor, offset = unit.conversion(assigned.unit, target, what)
        if (factor, offset) != (1.0, 0.0):
            value = unit.round_trip(value * factor + offset)
    return value if assigned.change is None or assigned.change == Linear() else assigned.change.of(value)
