"""Four pull wires: antagonistic pairs in two planes and their resultant. Lengths in mm, see `fmus.injection`."""

from __future__ import annotations

from math import floor, hypot
from typing import Any

from fmus.injection import bend, coupling, engagement

WIRES = 4  # +x, +y, -x, -y
HALVINGS = 40  # 9 mm / 2^40: the rounding of the actuators' steps is coarser by far


def pair(plus: float, minus: float, dead_band: float, gain: float, ratio: float) -> float:
    """Shortening [mm] of the side of the first wire, where two wires and the bending stiffness balance.

    Positions are positive when pulled; `ratio` is bending stiffness over wire stiffness. A wire only pulls, so an
    antagonist that is not paid out by the shortening works against the other.
    """
    first = gain * (plus - dead_band)
    second = gain * (minus - dead_band)
    if first > 0.0:
        alone = first / (1.0 + ratio)
        return alone if second + alone <= 0.0 else (first - second) / (2.0 + ratio)
    if second > 0.0:
        alone = second / (1.0 + ratio)
        return -alone if first + alone <= 0.0 else (first - second) / (2.0 + ratio)
    return 0.0


def single_pull(x: float, y: float, dead_band: float, ratio: float) -> float:
    """Pull [mm] of a single wire that bends as much as shortenings in both planes: the argument of eqs. (4) to (9)."""
    return dead_band + (1.0 + ratio) * hypot(x, y)


def needle_pull(dead_band: float, pull: float) -> float:
    """Pull [mm] for the needle's equations: none while the catheter is straight, all from the first deflection on."""
    return engagement(dead_band, pull) * pull


def radial(
    bend_y: Any, compression: Any, tension: Any, dead_band: float, pull: float, advance: float, share: float
) -> float:
    """Eqs. (4) and (6): tip displacement [mm] in the direction of the resultant pull."""
    return bend(bend_y, dead_band, pull) + coupling(compression, tension, share, dead_band, pull, advance)


def pull_for(
    radius: float,
    z: float,
    bend_y: Any,
    bend_z: Any,
    compression: Any,
    tension: Any,
    dead_band: float,
    longest: float,
    share: float,
) -> float:
    """Pull [mm] of a single wire that brings the tip to a radius at an axial position, by bisection; -1 if there is none."""
    if radius <= 0.0:
        return dead_band
    low = dead_band
    high = longest
    if radial(bend_y, compression, tension, dead_band, high, z + bend(bend_z, dead_band, high), share) < radius:
        return -1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        advance = z + bend(bend_z, dead_band, middle)
        if radial(bend_y, compression, tension, dead_band, middle, advance, share) < radius:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def periodic(table: Any, count: int, part: float) -> float:
    """Value of a periodic table at a part of the period, linear between its entries."""
    position = (part - floor(part)) * count
    first = min(floor(position), count - 1)
    rest = position - first
    return (1.0 - rest) * table[first] + rest * table[(first + 1) % count]
