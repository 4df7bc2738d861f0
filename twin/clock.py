"""Simulated time as exact ratios: whole nanoseconds mostly, a `Fraction` of them where a step is 1/30 s. Never a sum of floats.

The n-th communication point is `start + n * step`, exactly; a member is given the float next to it.
"""

from __future__ import annotations

import math
from fractions import Fraction

from twin.errors import CouplingError

NANOSECONDS = 1_000_000_000
FINEST = 17  # digits of the denominator of a time that is read from decimals: any float is the nearest to such a ratio
READABLE = 1_000_000  # largest denominator [1/s] that a message shows
PARTS = (1, 2, 4, 5, 8, 10, 20)  # into which a message advises to divide a time: they can be written exactly
MOST = 2**62  # units of time that the loop counts

Time = int | Fraction  # [ns]; a whole number is an int


def whole(time: Fraction) -> Time:
    """The same time, as an int if it is whole."""
    return int(time) if time.denominator == 1 else time


def nanoseconds(seconds: float | str, what: str = "time") -> Time:
    """A time in seconds, exactly: `1/30` is that ratio, 0.1 is 100 000 000 ns, and so is any decimal of whole nanoseconds.

    Any other decimal, as the step 0.0333333333333333 of an FMU, is the simplest ratio that is nearest to the same float.
    """
    try:
        exact = Fraction(str(seconds))
        return ratio(exact) if "/" not in str(seconds) else whole(exact * NANOSECONDS)
    except (ValueError, ZeroDivisionError, OverflowError):
        raise CouplingError(f"{what}: {seconds!r} is not a time. Give seconds, such as 0.001 or 1/30.") from None


def whole_nanoseconds(seconds: float | str, what: str) -> int:
    """The same for what counts in nanoseconds; CouplingError for 1/30 s."""
    time = nanoseconds(seconds, what)
    if not isinstance(time, int):
        raise CouplingError(f"{what}: {seconds} s is not a whole number of nanoseconds. Round it to 1e-9 s.")
    return time


def ratio(seconds: Fraction) -> Time:
    """A decimal number of seconds as the ratio that is meant; ValueError if it is too small to be one."""
    exact = seconds * NANOSECONDS
    if exact.denominator == 1:
        return int(exact)
    value = float(seconds)
    for digits in range(1, FINEST + 1):
        near = Fraction(value).limit_denominator(10**digits)
        if float(near) == value and near:
            return whole(near * NANOSECONDS)
    raise ValueError


def seconds(time: Time) -> float:
    """The float next to a time [ns], in seconds: the `t` every member is given."""
    return time / NANOSECONDS if isinstance(time, int) else float(time / NANOSECONDS)


def common_step(periods: list[Time]) -> Time:
    """Greatest step [ns] of which every period is a multiple."""
    fractions = [Fraction(period) for period in periods]
    below = math.lcm(*(one.denominator for one in fractions))
    return whole(Fraction(math.gcd(*(int(one * below) for one in fractions)), below))


def parts_near(time: Time, part: Time) -> str:
    """Parts of a time [ns] that are next to one that does not divide it, for messages: `0.5 ms or 0.25 ms`."""
    counts = [one for one in PARTS if one * part < time][-1:] + [one for one in PARTS if one * part > time][:1]
    return " or ".join(text(whole(Fraction(time) / one)) for one in counts)


def counted(begin: Time, step: Time, stop: Time | None = None) -> tuple[int, int, int]:
    """Begin and step as whole numbers of a unit of time, and how many of these a second has: what the loop counts in."""
    if isinstance(begin, int) and isinstance(step, int):
        return begin, step, NANOSECONDS
    times = Fraction(begin) / NANOSECONDS, Fraction(step) / NANOSECONDS
    per_second = math.lcm(*(one.denominator for one in times))
    farthest = max(abs(Fraction(time)) for time in (begin, step, stop or 0))
    if farthest * Fraction(per_second, NANOSECONDS) >= MOST:
        raise CouplingError(
            f"step {text(step)}: so odd a step cannot be counted exactly to {text(stop or begin)}. Use a simpler ratio, "
            f"such as 1/30 s, or a decimal with at most 9 digits."
        )
    return int(times[0] * per_second), int(times[1] * per_second), per_second


def at(count: int, per_second: int) -> Time:
    """The time [ns] of a count of units."""
    return count if per_second == NANOSECONDS else whole(Fraction(count * NANOSECONDS, per_second))


def plain(time: Time) -> int | str:
    """A time [ns] as JSON knows it; `of_plain` reads it."""
    return time if isinstance(time, int) else str(time)


def of_plain(time: int | str) -> Time:
    """A time [ns] that was written by `plain`."""
    return time if isinstance(time, int) else Fraction(time)


def exact_text(time: Time) -> str:
    """A time [ns] as a scenario takes it."""
    return f"{time} ns"


def text(time: Time) -> str:
    """A time [ns] for messages, without needless digits: `1.5 ms`, `1/30 s`."""
    if isinstance(time, Fraction):
        exact = time / NANOSECONDS
        return f"{exact} s" if exact.denominator <= READABLE else f"{float(exact):.9g} s"
    for unit, size in (("s", NANOSECONDS), ("ms", 1_000_000), ("us", 1_000)):
        if time == 0 or abs(time) >= size:
            return f"{time / size:g} {unit}"
    return f"{time} ns"
