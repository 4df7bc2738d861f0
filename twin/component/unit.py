"""Units: SI inside, what people prefer at the border. The only file that imports pint."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from twin.errors import CouplingError

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")  # the order in which FMI lists exponents


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit as FMI describes it: value in base units = factor * value + offset, and exponents of `BASE`."""

    factor: float
    offset: float
    exponents: tuple[int, ...]


@lru_cache(maxsize=1)
def registry() -> Any:
    """Pint's registry, made on first use: it takes 0.1 s."""
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True, cache_folder=":auto:")


@lru_cache(maxsize=256)
def describe(unit: str) -> Unit:
    """FMI description of a unit such as `N/mm` or `mm/(s*N)`; `""` and `1` are dimensionless."""
    if unit in ("", "1", "-"):
        return Unit(1.0, 0.0, (0,) * len(BASE))
    units = registry()
    try:
        parsed = units.Unit(unit)
        zero, one = (units.Quantity(value, parsed).to_base_units() for value in (0.0, 1.0))
        powers = dict(one.unit_items())
    except Exception as error:
        raise CouplingError(f"unit {unit!r} is not known ({error}). Write it like N, mm/s, mm/(s*N), deg.") from None
    names = {"kilogram": 0, "meter": 1, "second": 2, "ampere": 3, "kelvin": 4, "mole": 5, "candela": 6, "radian": 7}
    exponents = [0] * len(BASE)
    for name, power in powers.items():
        if name not in names or int(power) != power:
            raise CouplingError(f"unit {unit!r} has no SI base units ({one.units}). Use N, mm, deg and the like.")
        exponents[names[name]] = int(power)
    factor = float(one.magnitude - zero.magnitude)
    return Unit(round_trip(factor), float(zero.magnitude), tuple(exponents))


def round_trip(factor: float) -> float:
    """A factor without the noise of pint's products: the 15-digit decimal if that is what was meant."""
    return float(f"{factor:.15g}")


def same_kind(first: Unit, second: Unit) -> bool:
    """Whether values convert; radian counts as dimensionless, as in SI."""
    return first.exponents[:-1] == second.exponents[:-1]


def conversion(source: str, target: str, what: str) -> tuple[float, float]:
    """(factor, offset) with target value = factor * source value + offset; (1, 0) where one side has no unit."""
    if source == target or not source or not target:
        return 1.0, 0.0
    a, b = describe(source), describe(target)
    if not same_kind(a, b):
        raise CouplingError(f"{what}: {source} does not convert to {target}. Connect quantities of one kind.")
    return round_trip(a.factor / b.factor), (a.offset - b.offset) / b.factor


def quantity(text: str, unit: str, what: str) -> float:
    """A number with a unit, such as `0.2 N`, in `unit`; a bare number is taken to be in `unit` already."""
    units = registry()
    try:
        value = units.Quantity(text)
    except Exception:
        raise CouplingError(
            f"{what}: {text!r} is not a quantity. Write a number and a unit, such as 0.2 {unit}."
        ) from None
    if isinstance(value, int | float):
        return float(value)
    if value.dimensionless and value.unitless:
        return float(value.magnitude)
    factor, offset = conversion(str(value.units), unit or "1", what)
    return float(value.magnitude * factor + offset)
