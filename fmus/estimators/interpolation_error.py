"""Interpolation error of the shift, periodic in the pitch, learned from motion beyond a pitch; compiles.

What lies between two gratings is guessed by a spline, so a shift against one profile is wrong by a part that repeats with
the pitch. It cannot be seen in two profiles. But motion over a pitch leads each grating to where the next one was: all
their readings, put where the shift says that they were taken, are the path's curvature without gaps. If the shift is
wrong, that is stretched here and squeezed there, at each pitch alike, and is rougher than the path. What makes it
smoothest is the error.

Rough is the third difference. A stiff body that leans on walls is bent continuously, with corners (a beam's moment between
contacts), and a grating reads the mean over its length: so two derivatives of what is read are finite. That is the least
that has to hold: with corners alone (absolute second differences) bends that are smoother than that get worse.

Places are counted in parts of a pitch; `path` has the curvature at each of them, `count` and `place` how many profiles each
part of a pitch has seen and by how much they were off its middle. Arrays come from the component that calls.
"""

from __future__ import annotations

from math import cos, floor, pi, sin
from typing import Any

PARTS = 10  # places per pitch; 8 to 16 give the same within 0.05 mm
MEMORY = 500  # profiles that a part remembers: 2 s of samples
RELEARNED = 50  # profiles from one estimate to the next
EXPECTED = (
    0.3  # standard deviation of the error before anything is known [parts]: splines are off by up to 0.45 mm of 10 mm
)
ORDER = 3  # of the difference that is to be small
STEPS = (
    10.0  # of the sums below by noise^2 per grating, above which steps shift the error by less than 0.05 mm of 10 mm
)


def forget(count: Any, wave: Any) -> None:
    """Reset the learned error."""
    for q in range(PARTS):
        count[q] = 0
    for j in range(2):
        wave[j] = 0.0


def note(path: Any, count: Any, offset: Any, profile: Any, begin: int, end: int, shift: float) -> None:
    """Put the readings of gratings `begin` to `end` where they were taken, a shift [pitches] from the reference."""
    x = shift * PARTS
    k = floor(x + 0.5)
    q = k - PARTS * floor(k / PARTS)
    count[q] = min(count[q] + 1, MEMORY)
    if count[q] == 1:
        offset[q] = 0.0
    offset[q] += (x - k - offset[q]) / count[q]
    for i in range(begin, end):
        for c in range(2):
            path[i * PARTS + k, c] += (profile[i, c] - path[i * PARTS + k, c]) / count[q]


def complete(count: Any) -> bool:
    """Return whether the path covers the pitch without gaps."""
    visited = 0
    for q in range(PARTS):
        visited += min(count[q], 1)
    return visited == PARTS


def middle(path: Any, offset: Any, k: int, c: int) -> float:
    """Curvature at the center of cell k, interpolated from a neighboring reading."""
    return path[k, c] - offset[k % PARTS] * 0.5 * (path[k + 1, c] - path[k - 1, c])


def find(path: Any, offset: Any, behind: Any, wave: Any, begin: int, end: int, noise: float) -> None:
    """Put cosine and sine [pitches] of the error over a pitch into `wave`, from the places between two gratings.

    Least squares: third differences of path + wave * (path's slope) shall be small. To first order in the wave. `noise`:
    standard deviation of a grating's curvature [1/m]. It makes steps from grating to grating that a stretched path hides.
    """
    cc = cs = ss = pc = ps = pp = 0.0
    for c in range(2):
        for k in range(begin * PARTS, end * PARTS):
            angle = 2.0 * pi * k / PARTS
            steep = 0.5 * (middle(path, offset, k + 1, c) - middle(path, offset, k - 1, c))
            rough = difference(behind, 0, middle(path, offset, k, c))
            along = difference(behind, 1, cos(angle) * steep)
            across = difference(behind, 2, sin(angle) * steep)
            if k < begin * PARTS + ORDER:
                continue
            pp += rough * rough
            pc += rough * along
            ps += rough * across
            cc += along * along
            cs += along * across
            ss += across * across

    # a nearly straight path contains no information but these steps
    if min(cc, ss) < STEPS * noise * noise * (end - begin):
        return

    # what is expected beforehand counts as one more observation
    trust = pp / (2.0 * ((end - begin) * PARTS - ORDER) * EXPECTED * EXPECTED)
    cc += trust
    ss += trust
    determinant = cc * ss - cs * cs
    if determinant > 0.0:
        wave[0] = -(ss * pc - cs * ps) / determinant / PARTS
        wave[1] = -(cc * ps - cs * pc) / determinant / PARTS


def difference(behind: Any, row: int, value: float) -> float:
    """Third difference of the values that a row has got so far."""
    for order in range(ORDER):
        change = value - behind[row, order]
        behind[row, order] = value
        value = change
    return value


def without(wave: Any, shift: float) -> float:
    """A shift [pitches] without its error; there is none at the reference."""
    corrected = shift
    for _ in range(4):  # the error is that of the true shift; it changes by less than a fifth of that
        angle = 2.0 * pi * corrected
        corrected = shift - wave[0] * (cos(angle) - 1.0) - wave[1] * sin(angle)
    return corrected
