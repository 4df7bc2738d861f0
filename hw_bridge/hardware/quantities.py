"""Quantities and times of the hardware file: text with a unit, converted to SI; a bare number is refused."""

from __future__ import annotations

from math import degrees, isfinite
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from twin.errors import CouplingError
from twin.scenario import nanoseconds, number, short

MILLISECOND = 1_000_000
TARGET_SHARE = 0.8  # of the limits of velocity and force that a target may have: the drive overshoots
LARGEST = 1e6  # of any quantity, in SI: more is a mistake, and no drive could count it

EXAMPLES = {"m": "30 mm", "m/s": "300 mm/s", "m/s^2": "10 m/s^2", "N": "15 N", "N/A": "11.64 N/A", "A": "60 mA",
            "1/s": "50 1/s", "N/m": "200 N/m"}  # fmt: skip


def without_unit(value: Any) -> bool:
    """Whether a value is a bare number, which is ambiguous; zero is zero in all units."""
    try:
        return not isinstance(value, bool) and isfinite(float(value)) and float(value) != 0.0
    except (TypeError, ValueError):
        return False


def quantity(*symbols: str) -> Any:
    """A type of key that converts text such as `5 mm` to SI, of the first kind that fits; a bare number is refused."""

    def convert(value: Any) -> float:
        return parse(value, symbols)[0]

    return BeforeValidator(convert)


def sized(*symbols: str) -> Any:
    """A type of key for the size of a unit, with its symbol: `1 um` of a line, `0.001 deg` of a turn."""

    def convert(value: Any) -> tuple[float, str]:
        size = value if isinstance(value, tuple) else parse(value, symbols)
        if size[0] <= 0.0:
            raise ValueError(f"expected a size above 0, not {short(value)}")
        return size

    return BeforeValidator(convert)


def parse(value: Any, symbols: tuple[str, ...]) -> tuple[float, str]:
    """A quantity in SI with its symbol, the first of `symbols` that fits; ValueError for a bare number, or one too large."""
    if without_unit(value):
        raise ValueError(f"{short(value)} has no unit. Write it with one, such as {EXAMPLES[symbols[0]]}")
    problems = []
    for symbol in symbols:
        try:
            quantity = number(value, symbol, "")
        except CouplingError as error:
            problems.append(str(error).removeprefix(": "))
            continue
        if not abs(quantity) <= LARGEST:  # not a number, too
            raise ValueError(f"expected a number of at most {LARGEST:g}, not {short(value)}")
        return quantity, symbol
    raise ValueError(problems[0])


def timed(value: Any) -> int:
    """A time above zero [ns]; a bare number is refused, as it is of a quantity: 60 would be a minute."""
    if without_unit(value):
        raise ValueError(f"{short(value)} has no unit. Write it with one, such as 60 ms")
    time = nanoseconds(value)
    if time <= 0:
        raise ValueError(f"expected a time above zero, such as 60 ms, not {short(value)}")
    return time


def positive_milliseconds(value: Any) -> int:
    """Parse a time in whole milliseconds, the resolution of drives [ns]."""
    if without_unit(value):
        raise ValueError(f"{short(value)} has no unit. Write it with one, such as 60 ms")
    time = nanoseconds(value)
    if time <= 0 or time % MILLISECOND:
        raise ValueError(f"expected whole milliseconds above zero, such as 5 ms, not {short(value)}")
    return time


def format_quantity(value: float, unit: str) -> str:
    """Format a quantity: mm for m, deg for rad."""
    if unit.startswith("rad"):
        return f"{degrees(value):.6g} deg{unit[3:]}"
    if unit in ("m", "m/s") and abs(value) < 100.0:
        return f"{1e3 * value:.6g} m{unit}"
    if unit in ("mV", "mA") and abs(value) >= 1000.0:
        return f"{1e-3 * value:.4g} {unit[1:]}"
    return f"{value:.4g} {unit}"


# of a linear axis, or of one that turns
Position = Annotated[float, quantity("m", "rad")]
Distance = Annotated[float, quantity("m", "rad"), Field(gt=0)]
Speed = Annotated[float, quantity("m/s", "rad/s"), Field(gt=0)]
Acceleration = Annotated[float, quantity("m/s^2", "rad/s^2"), Field(gt=0)]
Force = Annotated[float, quantity("N", "N*m"), Field(gt=0)]
ForceConstant = Annotated[float, quantity("N/A", "N*m/A"), Field(gt=0)]
Milliseconds = Annotated[int, BeforeValidator(positive_milliseconds)]
Lapse = Annotated[int, BeforeValidator(timed)]
