"""Units as a foreign FMU defines them: what its names mean, where that is not what they mean here."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from twin.component import unit
from twin.errors import CouplingError

if TYPE_CHECKING:
    from twin.coupling import MemberVariable

Names = dict[tuple[str, str], tuple[str, str]]  # unit and display unit as the FMU writes them -> as they are known here


def names(description: Any) -> Names:
    """Every pair of unit and display unit that an FMU defines; what it gives no size that makes sense keeps its name."""
    found: Names = {}
    for one in description.unitDefinitions:
        name, size = one.name or "", base(one)
        text = name if one.baseUnit is None or size is None else unit.defined(name, size)
        found[name, ""] = text, ""
        for display in one.displayUnits:
            shown = display.name or ""
            if size is not None and display.factor:
                # shown = factor * value + offset, and base = size.factor * value + size.offset
                factor = size.factor / display.factor
                shown = unit.defined(shown, unit.Unit(factor, size.offset - factor * display.offset, size.exponents))
            found[name, display.name or ""] = text, shown
    return found


def base(one: Any) -> unit.Unit | None:
    """A unit in base units as the FMU says, else by its name alone; None: nobody knows."""
    if one.baseUnit is not None:
        exponents = tuple(getattr(one.baseUnit, symbol) for symbol in unit.BASE)
        return unit.Unit(one.baseUnit.factor, one.baseUnit.offset, exponents)
    try:
        return unit.describe(one.name or "?")
    except CouplingError:
        return None


def named(variable: MemberVariable, found: Names) -> MemberVariable:
    """A variable with its units as they are known here."""
    written = variable.unit, variable.display_unit
    here = found.get(written) or (found.get((variable.unit, ""), written)[0], variable.display_unit)
    return variable if here == written else replace(variable, unit=here[0], display_unit=here[1])
