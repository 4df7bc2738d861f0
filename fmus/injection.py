"""Empirical equations of the injection catheter, Cheng and Law (paper B), eqs. (2) to (9) and Table 1.

Lengths are in mm here, as in the paper: the coefficients' units depend on the exponents, and converting them would hide
the paper's numbers. Variables of the components are in m; the factor 1e3 stands where they meet. All functions compile.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import Any

from twin.component import Component, normal, parameter

MILLIMETER = 1e-3

# eqs. (2), (3): a tip moves by GAIN per actuator travel, once a reversal has used up the offset [mm]
SLOPE = 0.0257
REVERSAL_OFFSET = 1.5776

# eqs. (4), (5): coefficients of a^0 to a^3; in force from FIRST, below DEAD_BAND [mm] nothing moves
BEND_Y = (0.0, 0.145, 0.472, -0.0326)
BEND_Z = (0.102, -0.165, 0.171, -0.0083)
DEAD_BAND = 1.0

# eq. (6), Table 1: terms 1, a, z, a^2, a z, z^2, ... of the pull a and the tip's advance z
COMPRESSION = (
    0.185,
    -0.3438,
    0.1178,
    0.2441,
    -0.02831,
    -0.06484,
    -0.06264,
    0.003804,
    0.004771,
    0.01234,
    6.973e-3,
    -2.169e-4,
    -2.789e-4,
    -3.778e-4,
    -9.163e-4,
    -2.818e-4,
    6.832e-6,
    3.021e-6,
    8.916e-6,
    9.773e-6,
    2.323e-5,
)
TENSION = (0.2959, 0.03744, -0.1764, -0.01379, 8.859e-3, 0.0278, 9.538e-4, -1.273e-4, -4.86e-4, -5.882e-4)
COUPLING_TRAVEL = 20.0  # longest advance that eq. (6) was measured at [mm]

# eqs. (7), (8): length per actuator travel, offset [mm], length per pull
NEEDLE = (0.4428, -1.1044, 0.0984)

# eq. (9): actuator position for a decrease d at a pull a: terms 1, d, a, d^2, d a, a^2
RETRACTION = (9.821, -2.132, 0.3162, 0.04756, -0.02998, -0.04206)

INCREMENT = 1.0  # step of the pull in the paper's deflection experiment [mm]


def length(x: float, y: float) -> float:
    """Length of a vector, of operations that IEEE 754 rounds: the same with every Python and libm, as hypot is not."""
    return sqrt(x * x + y * y)


def power(base: float, exponent: int) -> float:
    """Whole power by multiplication: the same bits on every platform."""
    result = 1.0
    for _ in range(exponent):
        result *= base
    return result


def cubic(c: Any, a: float) -> float:
    """c[0] + c[1] a + c[2] a^2 + c[3] a^3."""
    return c[0] + a * (c[1] + a * (c[2] + a * c[3]))


def bend(c: Any, dead_band: float, pull: float) -> float:
    """Eq. (4) or (5): tip displacement [mm] of a pull [mm].

    Measured in increments of 1 mm, so nothing is known between the end of the dead band and the next increment: a
    Hermite cubic leads there without the jump of 0.58 mm that the printed eq. (4) has.
    """
    first = dead_band + INCREMENT
    if pull <= dead_band:
        return 0.0
    if pull >= first:
        return cubic(c, pull)
    s = (pull - dead_band) / INCREMENT
    slope = INCREMENT * (c[1] + first * (2.0 * c[2] + first * 3.0 * c[3]))
    return s * s * ((3.0 - 2.0 * s) * cubic(c, first) + (s - 1.0) * slope)


def engagement(dead_band: float, pull: float) -> float:
    """Part of the coupling that acts: none on a straight catheter, all from the first measured deflection on."""
    s = min(max((pull - dead_band) / INCREMENT, 0.0), 1.0)
    return s * s * (3.0 - 2.0 * s)


def surface(c: Any, degree: int, a: float, z: float) -> float:
    """Polynomial of two variables, terms by rising degree, in each from a^d to z^d."""
    total = 0.0
    index = 0
    for d in range(degree + 1):
        for j in range(d + 1):
            total += c[index] * power(a, d - j) * power(z, j)
            index += 1
    return total


def coupling(compression: Any, tension: Any, share: float, dead_band: float, pull: float, advance: float) -> float:
    """Eq. (6): sideways shift [mm] by the tip's advance [mm]; `share`: 0 compressed, 1 in tension, between in the play.

    Beyond the 20 mm that were measured it stays: the fifth degree would leave the bench within a few millimeters.
    """
    z = min(max(advance, 0.0), COUPLING_TRAVEL)
    shift = 0.0
    if share < 1.0:
        shift += (1.0 - share) * surface(compression, 5, pull, z)
    if share > 0.0:
        shift += share * surface(tension, 3, pull, z)
    return engagement(dead_band, pull) * shift


def retraction(c: Any, decrease: float, pull: float) -> float:
    """Eq. (9): actuator position [mm] at which the needle has become shorter by a length [mm]."""
    return surface(c, 2, decrease, pull)


def decrease(c: Any, actuator: float, pull: float) -> float:
    """Eq. (9) solved for the decrease [mm]: the root with the falling slope."""
    linear = c[1] + c[4] * pull
    rest = c[0] + pull * (c[2] + pull * c[5]) - actuator
    root = linear * linear - 4.0 * c[3] * rest
    return 2.0 * rest / (-linear + sqrt(max(root, 0.0)))


def needle_limits(needle: Any, back: Any, turn: float, actuator: float, pull: float) -> tuple[float, float]:
    """Least and largest part of the needle's length [mm] that the actuator [mm] sets: eq. (7), and eq. (9) from `turn`.

    Between the two the needle does not follow the actuator. What the pull adds, eq. (8), is not part of it.
    """
    forward = needle[0] * actuator + needle[1]
    backward = needle[0] * turn + needle[1] - decrease(back, actuator, pull)
    return forward, max(forward, backward)


def narrowest(c: Any, actuator: float) -> float:
    """Pull [mm] at which eq. (9) leaves least of the needle's length: there the decrease does not change with the pull."""
    if c[5] == 0.0:
        return 0.0
    # the decrease at that pull, as in `decrease`; the pull is -(c2 + c4 d) / (2 c5)
    square = c[3] - c[4] * c[4] / (4.0 * c[5])
    linear = c[1] - c[2] * c[4] / (2.0 * c[5])
    rest = c[0] - c[2] * c[2] / (4.0 * c[5]) - actuator
    root = linear * linear - 4.0 * square * rest
    d = 2.0 * rest / (-linear + sqrt(max(root, 0.0)))
    return -(c[2] + c[4] * d) / (2.0 * c[5])


def needle_after(
    needle: Any, back: Any, turn: float, actuator: float, begin: float, end: float, needle_set: float
) -> float:
    """Remainder of `needle_set` [mm] while the pull changes from `begin` to `end` [mm] and the actuator rests.

    The play is narrowest at a pull of about 4 mm: on its way across, the pull can draw the needle in by itself.
    """
    narrow = narrowest(back, actuator)
    if (narrow - begin) * (narrow - end) < 0.0:
        low, high = needle_limits(needle, back, turn, actuator, narrow)
        needle_set = min(max(needle_set, low), high)
    low, high = needle_limits(needle, back, turn, actuator, end)
    return min(max(needle_set, low), high)


def wander(memory: Any, stream: Any, travel: float, length: float) -> None:
    """Advance the random process memory[1] (mean 0, variance 1) over travel; travel and correlation length in one unit.

    White noise over the way through two equal lags. One lag alone would have no slope: a slide that goes forward would
    step back all the time, and every play behind it would make a one-sided error of that.
    """
    if travel <= 0.0:
        return
    correlation = exp(-travel / length)
    memory[0] = correlation * memory[0] + sqrt(1.0 - correlation * correlation) * normal(stream)
    memory[1] = correlation * memory[1] + (1.0 - correlation) * sqrt(2.0) * memory[0]


class Deflection(Component):
    """Constants of the deflection and of its coupling with the advance, eqs. (4) to (6)."""

    bend_y = parameter(BEND_Y, "", "eq. (4): coefficients of a^0 to a^3 in mm", source="paper, eq. (4)")
    bend_z = parameter(BEND_Z, "", "eq. (5): coefficients of a^0 to a^3 in mm", source="paper, eq. (5)")
    dead_band = parameter(DEAD_BAND, "", "pull [mm] that takes up a wire's slack", minimum=0.0, source="paper, eq. (4)")
    compression = parameter(COMPRESSION, "", "eq. (6) compressed, in mm", source="paper, Table 1")
    tension = parameter(
        TENSION,
        "",
        "eq. (6) in tension, in mm",
        source="paper, Table 1; terms in the order of poly33, two printed features are wrong",
    )


class InjectionModel(Deflection):
    """Constants of all equations."""

    slope = parameter(SLOPE, "", "tip travel per handle travel, less one", source="paper, eqs. (2), (3)")
    reversal_offset = parameter(
        REVERSAL_OFFSET, "", "travel [mm] that a reversal costs", minimum=0.0, source="paper, eq. (2)"
    )
    needle = parameter(
        NEEDLE, "", "eqs. (7), (8): length per actuator, offset [mm], length per pull", source="paper, eqs. (7), (8)"
    )
    needle_back = parameter(RETRACTION, "", "eq. (9), in mm", source="paper, eq. (9)")
    needle_turn = parameter(
        11.5,
        "",
        "actuator position [mm] from which eq. (9) retracts",
        source="not printed: the least half millimeter with which a needle drawn back is never shorter than one pushed there",
    )
