"""Unit definitions of a third-party FMU, for names with another meaning in this project."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from twin.component import unit
from twin.errors import CouplingError, nearest

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from twin.coupling import MemberVariable
    from twin.fmi.model_description import DeclaredUnit

Names = dict[
    tuple[str, str], tuple[str, str]
]  # unit and display unit as the FMU writes them -> as this project writes them


def names(units: Iterable[DeclaredUnit]) -> Names:
    """Every pair of unit and display unit that an FMU defines; a unit without a valid factor keeps its name."""
    unit_names: Names = {}
    for declared_unit in units:
        size, text = declared_unit.size, declared_unit.name
        if size is None:
            with suppress(CouplingError):
                size = unit.describe(text or "?")
        else:
            text = unit.defined(text, size)
        unit_names[declared_unit.name, ""] = text, ""
        for name, part, offset in declared_unit.displays:
            shown = name if part else ""
            if size is not None and part:
                # shown = part * value + offset, and base = size.factor * value + size.offset
                factor = size.factor / part
                shown = unit.defined(name, unit.Unit(factor, size.offset - factor * offset, size.exponents))
            unit_names[declared_unit.name, name] = text, shown
    return unit_names


def named(variable: MemberVariable, unit_names: Names, *, is_relative: bool = False) -> MemberVariable:
    """Return a variable with its units as this project writes them; those of a difference have no offset."""
    declared = variable.unit, variable.display_unit
    here = unit_names.get(declared) or (unit_names.get((variable.unit, ""), declared)[0], variable.display_unit)
    here = (without_offset(here[0]), without_offset(here[1])) if is_relative else here
    return variable if here == declared else replace(variable, unit=here[0], display_unit=here[1])


def stated(variables: Mapping[str, MemberVariable], units: Mapping[str, str]) -> dict[str, MemberVariable]:
    """Return variables with the units that a scenario states where the FMU declares none, or none that is valid."""
    result = dict(variables)
    for name, text in units.items():
        if name not in variables:
            raise CouplingError(f"units: there is no variable `{name}`. {nearest(name, variables)}")
        if has_unit(variables[name]):
            own = unit.shown(variables[name].unit)
            raise CouplingError(f"units: `{name}` is declared in {own} by the FMU. Leave it out, or use `factor`.")
        unit.describe(text)
        result[name] = replace(variables[name], unit=text, display_unit="")
    return result


def has_unit(variable: MemberVariable) -> bool:
    """Whether a variable has a valid unit, so that its values are converted."""
    with suppress(CouplingError):
        return bool(variable.unit and unit.describe(variable.unit))
    return False


def without_offset(text: str) -> str:
    """The unit of differences: a kelvin for a degree Celsius."""
    try:
        size = unit.describe(text)
    except CouplingError:
        return text
    return unit.defined(unit.shown(text), replace(size, offset=0.0)) if size.offset else text
