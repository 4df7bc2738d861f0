"""How much farther the end of a profile has come than its middle: a shift that changes evenly along it; compiles.

Play lets an instrument come less far here than there. Its profile is then not only shifted but stretched, and that tells
how far the tip has come, which lies beyond what is matched. Arrays come from the component that calls.
"""

from __future__ import annotations

from math import hypot
from typing import Any

from fmus.curves import interpolated, interval, slope


def lead(
    profile: Any,
    reference: Any,
    moments: Any,
    begin: int,
    end: int,
    used: int,
    pitch: float,
    shift: float,
    along: float,
    across: float,
    expected: float,
) -> float:
    """Shift of the tip beyond that of the profile [m], for gratings `begin` to `end` of `used`.

    Least squares about the best shift, for roll, shift of the tip and stretch. `along` and `across`: the best roll, as a complex
    number of any size. `expected`: standard deviation of the stretch beforehand.
    """
    size = hypot(along, across)
    if not size > 0.0:
        return 0.0
    along /= size
    across /= size
    j = interval(begin + shift / pitch, used)
    part = begin + shift / pitch - j

    # normal equations: columns are slope, slope times distance from the tip, and the profile turned by 90 deg
    ss = sd = dd = st = dt = tt = sr = dr = tr = rr = 0.0
    for i in range(begin, end):
        b1 = interpolated(reference, moments, 0, j + i - begin, part)
        b2 = interpolated(reference, moments, 1, j + i - begin, part)
        s1 = slope(reference, moments, 0, j + i - begin, part) / pitch
        s2 = slope(reference, moments, 1, j + i - begin, part) / pitch
        r1 = along * profile[i, 0] + across * profile[i, 1] - b1
        r2 = along * profile[i, 1] - across * profile[i, 0] - b2
        distance = (used - i - 0.5) * pitch
        steep = s1 * s1 + s2 * s2
        turned = b1 * s2 - b2 * s1
        ss += steep
        sd += steep * distance
        dd += steep * distance * distance
        st += turned
        dt += turned * distance
        tt += b1 * b1 + b2 * b2
        sr += s1 * r1 + s2 * r2
        dr += (s1 * r1 + s2 * r2) * distance
        tr += b1 * r2 - b2 * r1
        rr += r1 * r1 + r2 * r2
    dd += rr / max(2.0 * (end - begin) - 3.0, 1.0) / (expected * expected)
    ss -= st * st / tt
    sd -= st * dt / tt
    dd -= dt * dt / tt
    sr -= st * tr / tt
    dr -= dt * tr / tt
    determinant = ss * dd - sd * sd
    return (dd * sr - sd * dr) / determinant if determinant > 0.0 else 0.0
