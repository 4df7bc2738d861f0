"""Unit definitions of a third-party FMU, for names with another meaning in this project."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from twin.component import unit
from twin.errors import CouplingError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from twin.coupling import MemberVariable
    from twin.fmi.model_description import DeclaredUnit

Names = dict[
    tuple[str, str], tuple[str, str]
]  # unit and display unit as the FMU writes them -> as this project writes them


def names(units: Iterable[DeclaredUnit]) -> Names:
    """Every pair of unit and display unit that an FMU defines; a unit without a valid factor keeps its name."""
    unit_names: Names = {}
    for one in units:
        size = base(one)
        text = one.name if one.factor is None or size is None else unit.defined(one.name, size)
        unit_names[one.name, ""] = text, ""
        for name, part, offset in one.displays:
            shown = name
            if size is not None and part:
                # shown = part * value + offset, and base = size.factor * value + size.offset
                factor = size.factor / part
                shown = unit.defined(name, unit.Unit(factor, size.offset - factor * offset, size.exponents))
            unit_names[one.name, name] = text, shown
    return unit_names


def base(one: DeclaredUnit) -> unit.Unit | None:
    """A unit in base units as the FMU says, else by its name alone; None if the unit is unknown."""
    if one.factor is not None:
        return unit.Unit(one.factor, one.offset, one.exponents)
    try:
        return unit.describe(one.name or "?")
    except CouplingError:
        return None


def named(variable: MemberVariable, unit_names: Names) -> MemberVariable:
    """Return a variable with its units as this project writes them."""
    written = variable.unit, variable.display_unit
    here = unit_names.get(written) or (unit_names.get((variable.unit, ""), written)[0], variable.display_unit)
    return variable if here == written else replace(variable, unit=here[0], display_unit=here[1])
