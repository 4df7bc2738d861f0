"""Simulated time as exact ratios: an int of nanoseconds, or a `Fraction` of them (a step of 1/30 s). Never a sum of floats.

The n-th communication point is exactly `start + n * step`; members receive the nearest float.
"""

from __future__ import annotations

import math
from fractions import Fraction

from twin.errors import CouplingError

NANOSECONDS = 1_000_000_000
FINEST = 17  # largest number of digits of the denominator of a time read from decimals: covers every float
READABLE = 1_000_000  # largest denominator [1/s] that a message shows
PARTS = (1, 2, 4, 5, 8, 10, 20)  # divisors suggested in messages: the quotients can be written exactly
MOST = 2**62  # largest number of ticks that the loop counts

Time = int | Fraction  # [ns]; integers are always an int


def to_time(time: Fraction) -> Time:
    """Return a time [ns] as an int if it is a whole number of nanoseconds."""
    return int(time) if time.denominator == 1 else time


def nanoseconds(seconds: float | str, what: str = "time") -> Time:
    """Convert seconds to an exact time [ns]: `1/30` is that ratio, 0.1 is 100 000 000 ns; decimals of whole nanoseconds are exact.

    Any other decimal, such as the step 0.0333333333333333 of an FMU, becomes the simplest ratio that is nearest to the same
    float. CouplingError for text that is no time.
    """
    try:
        exact = Fraction(str(seconds))
        return ratio(exact) if "/" not in str(seconds) else to_time(exact * NANOSECONDS)
    except (ValueError, ZeroDivisionError, OverflowError):
        raise CouplingError(f"{what}: {seconds!r} is not a time. Give seconds, such as 0.001 or 1/30.") from None


def whole_nanoseconds(seconds: float | str, what: str) -> int:
    """Convert seconds to an int of nanoseconds; CouplingError for a time that is not one, such as 1/30 s."""
    time = nanoseconds(seconds, what)
    if not isinstance(time, int):
        raise CouplingError(f"{what}: {seconds} s is not a whole number of nanoseconds. Round it to 1e-9 s.")
    return time


def ratio(seconds: Fraction) -> Time:
    """Convert a decimal number of seconds to the simplest ratio [ns] with the same float; ValueError if it is too small."""
    exact = seconds * NANOSECONDS
    if exact.denominator == 1:
        return int(exact)
    value = float(seconds)
    for digits in range(1, FINEST + 1):
        candidate = Fraction(value).limit_denominator(10**digits)
        if float(candidate) == value and candidate:
            return to_time(candidate * NANOSECONDS)
    raise ValueError


def seconds(time: Time) -> float:
    """Convert a time [ns] to the nearest float in seconds: the `t` that members receive."""
    return time / NANOSECONDS if isinstance(time, int) else float(time / NANOSECONDS)


def common_step(periods: list[Time]) -> Time:
    """Return the greatest step [ns] of which every period is a multiple."""
    fractions = [Fraction(period) for period in periods]
    denominator = math.lcm(*(fraction.denominator for fraction in fractions))
    return to_time(Fraction(math.gcd(*(int(fraction * denominator) for fraction in fractions)), denominator))


def parts_near(time: Time, part: Time) -> str:
    """Format the divisors of a time [ns] nearest to a `part` that does not divide it, for messages: `0.5 ms or 0.25 ms`."""
    divisors = [divisor for divisor in PARTS if divisor * part < time][-1:] + [
        divisor for divisor in PARTS if divisor * part > time
    ][:1]
    return " or ".join(text(to_time(Fraction(time) / divisor)) for divisor in divisors)


def to_ticks(begin: Time, step: Time, stop: Time | None = None) -> tuple[int, int, int]:
    """Convert begin and step to integer ticks of a common unit; also return the ticks per second. The loop counts in ticks.

    CouplingError if `stop` is too many ticks for 64-bit integers.
    """
    if isinstance(begin, int) and isinstance(step, int):
        return begin, step, NANOSECONDS
    times = Fraction(begin) / NANOSECONDS, Fraction(step) / NANOSECONDS
    per_second = math.lcm(*(time.denominator for time in times))
    farthest = max(abs(Fraction(time)) for time in (begin, step, stop or 0))
    if farthest * Fraction(per_second, NANOSECONDS) >= MOST:
        raise CouplingError(
            f"step {text(step)}: so odd a step cannot be counted exactly to {text(stop or begin)}. Use a simpler ratio, "
            f"such as 1/30 s, or a decimal with at most 9 digits."
        )
    return int(times[0] * per_second), int(times[1] * per_second), per_second


def at(count: int, per_second: int) -> Time:
    """Convert a count of ticks to a time [ns]."""
    return count if per_second == NANOSECONDS else to_time(Fraction(count * NANOSECONDS, per_second))


def to_json(time: Time) -> int | str:
    """Convert a time [ns] to JSON: an int, or a ratio as text; `of_plain` reads it."""
    return time if isinstance(time, int) else str(time)


def from_json(time: int | str) -> Time:
    """Read a time [ns] that `plain` wrote."""
    return time if isinstance(time, int) else Fraction(time)


def exact_text(time: Time) -> str:
    """Format a time [ns] exactly, as scenario files accept it."""
    return f"{time} ns"


def text(time: Time) -> str:
    """Format a time [ns] for messages, without needless digits: `1.5 ms`, `1/30 s`."""
    if isinstance(time, Fraction):
        exact = time / NANOSECONDS
        return f"{exact} s" if exact.denominator <= READABLE else f"{float(exact):.9g} s"
    for unit, size in (("s", NANOSECONDS), ("ms", 1_000_000), ("us", 1_000)):
        if time == 0 or abs(time) >= size:
            return f"{time / size:g} {unit}"
    return f"{time} ns"
