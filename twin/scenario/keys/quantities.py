"""Values with units: durations are parsed exactly, other quantities against the variable they are assigned to."""

from __future__ import annotations

import math
import re
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import unit
from twin.errors import CouplingError

if TYPE_CHECKING:
    from twin.coupling import MemberVariable

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?"
# A unit starts with a letter, or as `1/s`, `/s` or `1/(s*N)`; `twin.component.unit` decides whether it is valid.
QUANTITY = re.compile(
    rf"\s*({NUMBER})\s*((?:1?\s*/\s*\(*\s*)?[A-Za-zµμΩ°%][A-Za-zµμΩ°%_\s*/()^·0-9.⁰¹²³⁴⁵⁶⁷⁸⁹⁻-]{{0,60}})?\s*"
)

DURATIONS = {
    "s": 10**9,
    "ms": 10**6,
    "us": 10**3,
    "µs": 10**3,
    "μs": 10**3,
    "ns": 1,
    "min": 60 * 10**9,
    "h": 3600 * 10**9,
}
LONGEST = 10**7 * 10**9  # four months [ns]
RATIO = re.compile(r"\s*(-?\d{1,9})\s*/\s*(\d{1,9})\s*([a-zµμ]*)\s*")  # `1/30 s`


def split(text: str) -> tuple[str, str] | None:
    """Split the text of a quantity into number and unit; None if it is not a quantity."""
    match = QUANTITY.fullmatch(text)
    if not match or len(text) > 80:
        return None
    unit_text = (match[2] or "").strip()
    return match[1], f"1{unit_text}" if unit_text.startswith("/") else unit_text


def duration(value: Any) -> clock.Time:
    """Parse a time [ns] exactly: `1 ms`, `1/30 s`, or a bare number of seconds. ValueError if it is invalid."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"expected a time, such as 1 ms, not {short(value)}")  # noqa: TRY004 - what pydantic catches
    if isinstance(value, str) and (match := RATIO.fullmatch(value)):
        numerator, denominator, symbol = match.groups()
    else:
        parts = split(value) if isinstance(value, str) else (repr(value), "s")
        if parts is None or (isinstance(value, float) and not math.isfinite(value)):
            raise ValueError(f"{short(value)} is not a time. Write a number and a unit, such as 1 ms or 1/30 s")
        numerator, denominator, symbol = parts[0], "", parts[1]
    if symbol not in DURATIONS and symbol:
        raise ValueError(f"{short(value)} is not a time: use s, ms, us, ns, min or h")
    if denominator and not int(denominator):
        raise ValueError(f"{short(value)} is divided by zero. Write a ratio such as 1/30 s")
    exact = Fraction(numerator) / int(denominator or 1) * DURATIONS[symbol or "s"]
    if abs(exact) > LONGEST:
        raise ValueError(f"{short(value)} is longer than {LONGEST // 10**9} s. Check the unit")
    try:
        return clock.to_time(exact) if denominator else clock.ratio(exact / clock.NANOSECONDS)
    except ValueError:
        raise ValueError(f"{short(value)} is too short a time. Check the unit") from None


def nanoseconds(value: Any) -> int:
    """Parse a time in whole nanoseconds, the resolution of drives and components. ValueError if it is invalid."""
    time = duration(value)
    if not isinstance(time, int):
        raise ValueError(f"{short(value)} is not a whole number of nanoseconds. Round it")  # noqa: TRY004
    return time


def short(value: Any) -> str:
    """Format a value for a message in at most 40 characters."""
    text = value if isinstance(value, str) else repr(value)
    kinds = {dict: "a group of keys", list: "a list", type(None): "nothing"}
    text = kinds.get(type(value), text)
    return text if len(text) <= 40 else text[:37] + "..."


def raw(value: Any, depth: int = 0) -> Any:
    """Check that a value is a number, text, true or false, or a nested list of them, and return it."""
    if isinstance(value, list) and depth < 4:
        return [raw(item, depth + 1) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{value} is not a finite number")
    if value is None or isinstance(value, dict | list):
        raise ValueError(f"expected a value or a list of values, not {short(value)}")
    return value


@lru_cache(maxsize=512)
def conversion(source: str, target: str) -> tuple[float, float]:
    """Return (factor, offset) between two units; `""` is dimensionless, unlike in a connection, where it is unknown."""
    if source == target:
        return 1.0, 0.0
    return unit.conversion(source or "1", target or "1", "")


def number(value: Any, target: str, what: str, is_difference: bool = False) -> float:
    """Convert a scalar to the unit `target`; a bare number is already in `target`. CouplingError if it is invalid.

    `is_difference`: 0.5 degC is half a kelvin, not 273.65 K.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise CouplingError(f"{what}: expected a number{in_unit(target)}, not {short(value)}.")
    if not isinstance(value, str):
        return float(value)
    parts = split(value)
    if parts is None:
        example = f"0.2 {target}".strip()
        raise CouplingError(f"{what}: `{short(value)}` is not a quantity. Write a number and a unit: {example}.")
    digits, symbol = float(parts[0]), parts[1]
    if not math.isfinite(digits):
        raise CouplingError(f"{what}: `{short(value)}` is not a finite number.")
    if not symbol or symbol in (target, unit.shown(target)):
        return digits
    try:
        factor, offset = conversion(symbol, target)
    except CouplingError as error:
        if "is not known" in str(error):
            text = f"{what}: unit `{symbol}` is not known. {unit.advice(symbol, parts[0])}"
            raise CouplingError(text) from None
        wanted = target or "a plain number"
        raise CouplingError(f"{what}: `{short(value)}` does not convert to {wanted}.") from None
    return unit.round_trip(digits * factor + (0.0 if is_difference else offset))


def si(value: Any, symbol: str, what: str, is_difference: bool = False) -> float:
    """Convert a scalar to coherent SI units; its unit must have the dimension of `symbol`, if that is given."""
    parts = split(value) if isinstance(value, str) else None
    if parts is None or not parts[1]:
        return number(value, "", what)
    number(value, symbol or parts[1], what)
    factor, offset = to_si(parts[1], is_difference)
    return unit.round_trip(float(parts[0]) * factor + offset)


def to_si(symbol: str, is_difference: bool = False) -> tuple[float, float]:
    """Return (factor, offset) from a unit to SI; CouplingError for an unknown unit."""
    description = unit.describe(symbol)
    return description.factor, 0.0 if is_difference else description.offset


def in_unit(symbol: str) -> str:
    """Return ` in N`, for messages; "" for dimensionless."""
    return f" in {symbol}" if symbol not in ("", "1") else ""


def resolve(value: Any, variable: MemberVariable, what: str) -> Any:
    """Convert a value to a numpy scalar or array of the variable's type, shape and unit; CouplingError if out of bounds."""
    if isinstance(value, list) and not variable.shape:
        advice = " A decimal point, not a comma?" if len(value) == 2 else ""  # 1,2 Hz
        raise CouplingError(f"{what}: expected one value, not a list of {len(value)}.{advice}")
    resolved = array(value, variable, what) if variable.shape else element(value, variable, what)
    violation, advice = variable.outside(resolved)
    if violation:
        is_bare = isinstance(value, int | float) and variable.display_unit not in ("", variable.unit)
        raise CouplingError(
            f"{what}{violation}. {advice}" + f" A number without a unit is in {variable.unit}." * is_bare
        )
    return resolved


def array(value: Any, variable: MemberVariable, what: str) -> Any:
    """Convert a value to an array; a scalar is used for all elements."""
    flat: list[Any] = []

    def shape(item: Any) -> tuple[int, ...]:
        if not isinstance(item, list):
            flat.append(element(item, variable, what))
            return ()
        shapes = {shape(child) for child in item}
        return (len(item), *(shapes.pop() if len(shapes) == 1 else (-1,) * bool(shapes)))

    given_shape = shape(value)
    if given_shape not in ((), variable.shape):
        sizes = " x ".join(map(str, variable.shape))
        raise CouplingError(f"{what}: expected {sizes} values or one for all, not {' x '.join(map(str, given_shape))}.")
    result = np.empty(variable.shape, variable.dtype)
    result[...] = np.asarray(flat, variable.dtype).reshape(given_shape)
    return result


def item(value: Any, items: dict[str, int], what: str) -> int:
    """Return the number of an enumeration's item given by name or number."""
    if isinstance(value, str) and value in items:
        return items[value]
    if isinstance(value, int) and not isinstance(value, bool) and value in items.values():
        return value
    choices = ", ".join(f"`{name}` ({number})" for name, number in items.items())
    raise CouplingError(f"{what}: expected an item of the enumeration, not {short(value)}. Choose from {choices}.")


def element(value: Any, variable: MemberVariable, what: str) -> Any:
    """Convert a value to a scalar of a variable's type."""
    kind = variable.dtype.kind
    if kind == "O":
        if not isinstance(value, str):
            raise CouplingError(f"{what}: expected text, not {short(value)}. Put it in quotes.")
        return value
    if variable.interval:  # of a clock that ticks by time
        return number(value, "s", what)
    if variable.type in ("Boolean", "Clock"):  # a bool, or a C int in FMI 2.0
        if not isinstance(value, bool):
            raise CouplingError(f"{what}: expected true or false, not {short(value)}.")
        return variable.dtype.type(value)
    if variable.items:
        return variable.dtype.type(item(value, dict(variable.items), what))
    if kind == "f":
        real = number(value, variable.unit, what)
        if abs(real) > (limit := float(np.finfo(variable.dtype).max)):
            raise CouplingError(f"{what}: {short(value)} is too large for {variable.type}. Give at most {limit:.3g}.")
        return variable.dtype.type(real)
    exact = value if isinstance(value, int) and not isinstance(value, bool) else number(value, variable.unit, what)
    limits = np.iinfo(variable.dtype)
    if exact != int(exact) or not limits.min <= exact <= limits.max:
        raise CouplingError(f"{what}: expected a whole number ({variable.type}), not {short(value)}.")
    return variable.dtype.type(int(exact))
