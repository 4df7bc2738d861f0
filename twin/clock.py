"""Simulated time as integer nanoseconds: exact ratios of periods, no accumulated floats."""

from __future__ import annotations

import math
from fractions import Fraction

from twin.errors import CouplingError

NANOSECONDS = 1_000_000_000


def nanoseconds(seconds: float | str, what: str = "time") -> int:
    """Whole nanoseconds of a time in seconds; a time that is not a whole number of them is an error.

    The shortest decimal that reads back as the same float is taken, so 0.1 is 100 000 000 ns exactly.
    """
    try:
        exact = Fraction(str(seconds)) * NANOSECONDS
    except (ValueError, ZeroDivisionError):
        raise CouplingError(f"{what}: {seconds!r} is not a time. Give seconds, such as 0.001.") from None
    if exact.denominator != 1:
        raise CouplingError(f"{what}: {seconds} s is not a whole number of nanoseconds. Round it to 1e-9 s.")
    return int(exact)


def seconds(time: int) -> float:
    """The float nearest to an integer time [ns], in seconds: the `t` every member is given."""
    return time / NANOSECONDS


def common_step(periods: list[int]) -> int:
    """Greatest step [ns] of which every period is a multiple."""
    return math.gcd(*periods)


def text(time: int) -> str:
    """A time [ns] for messages, without needless digits: `1.5 ms`."""
    for unit, size in (("s", NANOSECONDS), ("ms", 1_000_000), ("us", 1_000)):
        if time == 0 or abs(time) >= size:
            return f"{time / size:g} {unit}"
    return f"{time} ns"
