"""Curves in space that compile: curvature interpolated along the arc, and the curve by parallel transport.

A curve is given by two components of curvature (k1, k2) [1/m] along two directions d1, d2 across the tangent that turn with
it but never about it (Bishop, Am. Math. Monthly 82(3), 1975). The Frenet-Serret normal points along the curvature and is
undefined where that is zero: in every straight part, and it flips by 180 deg where a bend changes sides.

A `frame` is an array (4, 3): d1, d2, tangent, position. Arrays come from the component that calls.
"""

from __future__ import annotations

from math import floor
from typing import Any

SINE = (1.0 / 6.0, 1.0 / 120.0, 1.0 / 5040.0)  # of the series: products, since a division takes as long as four of them
VERSINE = (1.0 / 2.0, 1.0 / 24.0, 1.0 / 720.0, 1.0 / 40320.0)
SIXTH = 1.0 / 6.0


def set_frame(frame: Any) -> None:
    """The origin, tangent along z."""
    for i in range(4):
        for j in range(3):
            frame[i, j] = 1.0 if i == j else 0.0
    frame[3, 2] = 0.0


def advance_frame(frame: Any, k1: float, k2: float, h: float) -> None:
    """Go along an arc of length h [m] with constant curvature, exactly.

    Series of sin and cos: to 1e-9 up to half a radian, so 10 mm at a radius of 20 mm.
    """
    square = (k1 * k1 + k2 * k2) * h * h
    if square == 0.0:
        for j in range(3):
            frame[3, j] += h * frame[2, j]
        return
    sine = 1.0 - square * (SINE[0] - square * (SINE[1] - square * SINE[2]))  # sin(a) / a
    versine = VERSINE[0] - square * (VERSINE[1] - square * (VERSINE[2] - square * VERSINE[3]))  # (1 - cos(a)) / a^2
    cosine = 1.0 - square * versine
    for j in range(3):
        tangent = frame[2, j]
        bend = h * (k1 * frame[0, j] + k2 * frame[1, j])
        turn = versine * bend + sine * tangent
        frame[3, j] += h * (sine * tangent + versine * bend)
        frame[0, j] -= k1 * h * turn
        frame[1, j] -= k2 * h * turn
        frame[2, j] = cosine * tangent + sine * bend


def put_node(frame: Any, shape: Any, tangent: Any, i: int) -> None:
    """Keep position and tangent of a frame as node i of a curve."""
    for j in range(3):
        shape[i, j] = frame[3, j]
        tangent[i, j] = frame[2, j]


def spline(values: Any, moments: Any, factors: Any, count: int) -> None:
    """Second derivatives (times the spacing squared) of the natural cubic splines through both columns of `values`.

    Equally spaced knots; de Boor, A Practical Guide to Splines, chapter IV. `factors` is scratch, as long as the columns.
    """
    for c in range(2):
        moments[0, c] = 0.0
        moments[count - 1, c] = 0.0
    factors[0] = 0.0
    for i in range(1, count - 1):
        factors[i] = 1.0 / (4.0 - factors[i - 1])
        for c in range(2):
            right = 6.0 * (values[i - 1, c] - 2.0 * values[i, c] + values[i + 1, c])
            moments[i, c] = (right - moments[i - 1, c]) * factors[i]
    for k in range(2, count):
        i = count - k
        for c in range(2):
            moments[i, c] -= factors[i] * moments[i + 1, c]


def interval(x: float, count: int) -> int:
    """Knot before x, which counts in spacings from the first knot; the outermost ones go on."""
    return max(min(floor(x), count - 2), 0)


def weights(part: float) -> tuple[float, float, float, float]:
    """Weights of the values and moments of two knots at a fraction (0 to 1) between them."""
    rest = 1.0 - part
    return rest, part, (rest * rest * rest - rest) * SIXTH, (part * part * part - part) * SIXTH


def interpolated(values: Any, moments: Any, c: int, i: int, part: float) -> float:
    """Value of a spline in column c at a fraction (0 to 1) between knot i and the next."""
    w, x, y, z = weights(part)
    return w * values[i, c] + x * values[i + 1, c] + y * moments[i, c] + z * moments[i + 1, c]


def slope(values: Any, moments: Any, c: int, i: int, part: float) -> float:
    """Derivative of a spline in column c, per spacing."""
    rest = 1.0 - part
    bend = (1.0 - 3.0 * rest * rest) * moments[i, c] + (3.0 * part * part - 1.0) * moments[i + 1, c]
    return values[i + 1, c] - values[i, c] + bend * SIXTH


def hermite(part: float, spacing: float) -> tuple[float, float, float, float]:
    """Weights of the positions and tangents of two nodes at a fraction (0 to 1) between them: cubic, error spacing^4 / (384 radius^3)."""
    rest = 1.0 - part
    return (
        (1.0 + 2.0 * part) * rest * rest,
        (1.0 + 2.0 * rest) * part * part,
        part * rest * rest * spacing,
        -part * part * rest * spacing,
    )
