"""Polynomial extrapolation and interpolation of inputs over a step, and the values of it that members are fed.

Extrapolation: through the begin of the step and earlier points. Interpolation: through a guess for its end, its begin and
an earlier point. A member with constant inputs gets the mean over its step, so that integrals of inputs are exact; where an
output depends on the input directly, it makes the last eighth of the step with the value of the end, and the first part
with the value that preserves the mean. Members that take derivatives of inputs get value, slope and curvature.

`smoothing` 1 starts a polynomial at the end of the last one (as PyFMI's smooth coupling), 0 at the point.
"""

from __future__ import annotations

from typing import Any

from twin.compiler import read64, read_float, write_float, write_float32
from twin.coupling.variable_step.record_layout import (
    ARRIVED,
    BEFORE,
    BEGIN,
    CURVATURE,
    END,
    EXTRAPOLATED,
    FINAL,
    FIRST,
    GUESSED,
    HELD,
    LAST,
    LEFT,
    NODES,
    SHARE,
    SLOPE,
    TO_GUESS,
    USES,
    VALUE,
)

CATEGORY = USES * NODES * 8  # size of the weights of extrapolation [byte]; those of interpolation follow
USE = NODES * 8


def basis(address: int, order: int, s0: float, s1: float, s2: float) -> None:
    """Write the Lagrange polynomials of the last two of three nodes as a + b s + c s^2, three words each."""
    for i in range(6):
        write_float(address + 8 * i, 0.0)
    if order == 1:
        write_float(address, -s0 / (s1 - s0))
        write_float(address + 8, 1.0 / (s1 - s0))
    elif order > 1:
        polynomial(address, s0, s2, (s1 - s0) * (s1 - s2))
        polynomial(address + 24, s0, s1, (s2 - s0) * (s2 - s1))


def polynomial(address: int, p: float, q: float, divisor: float) -> None:
    """Write the polynomial (s - p) (s - q) / divisor."""
    write_float(address, p * q / divisor)
    write_float(address + 8, -(p + q) / divisor)
    write_float(address + 16, 1.0 / divisor)


def weigh(address: int, polynomials: int, h: float, smoothing: float) -> None:
    """Compute the weights of all uses from the polynomials of the last two nodes, and of the end of the last polynomial."""
    for i in range(1, NODES):
        a, b, c = smoothing, -smoothing, 0.0
        if i < 3:
            node = polynomials + 24 * (i - 1)
            a = read_float(node)
            b = read_float(node + 8) + smoothing * a
            c = read_float(node + 16)
            a = a * (1.0 - smoothing)
        mean, final = a + b / 2.0 + c / 3.0, a + b + c
        at = address + 8 * i
        write_float(at, mean)
        write_float(at + FIRST * USE, (mean - SHARE * final) / (1.0 - SHARE))
        write_float(at + FINAL * USE, final)
        write_float(at + VALUE * USE, a)
        write_float(at + SLOPE * USE, b / h)
        write_float(at + CURVATURE * USE, 2.0 * c / (h * h))
    for use in range(USES):  # The first weight is their sum, so that constants are reproduced to the bit.
        total = 1.0
        if use >= SLOPE:
            total = 0.0
        write_float(address + USE * use, total)


def prepare(self: Any, h: float) -> None:
    """Compute the weights of a step of `h` [s], with the available earlier points."""
    earlier = read64(self.past)
    first, second = read_float(self.past + 8) / h, read_float(self.past + 16) / h
    polynomials = self.weights + 2 * CATEGORY
    forward = self.order
    if self.max_iterations > 0 and forward == 0:
        forward = 1  # The initial guess of an iteration may be extrapolated even if inputs are not.
    basis(polynomials, min(forward, earlier), 0.0, -first, -(first + second))
    smoothing = self.smoothing
    if earlier == 0:
        smoothing = 0.0  # There is no earlier polynomial.
    weigh(self.weights, polynomials, h, smoothing)
    if self.order > 0:
        basis(polynomials, min(self.order, 1 + earlier), 1.0, 0.0, -first)
        weigh(self.weights + CATEGORY, polynomials, h, 0.0)


def value(weights: int, p0: int, p1: int, p2: int, p3: int) -> float:
    """Evaluate a polynomial from the addresses of its points."""
    first = read_float(p0)
    result = read_float(weights) * first + read_float(weights + 8) * (read_float(p1) - first)
    result += read_float(weights + 16) * (read_float(p2) - first)
    return result + read_float(weights + 24) * (read_float(p3) - first)


def fed(self: Any, now: int, course: int, source: int, weights: int) -> float:
    """Return the value to feed to an input; `now`, `course`: addresses of its element."""
    span = 8 * self.elements
    if source == HELD:
        return read_float(now + BEGIN * span)
    if source == GUESSED:
        return read_float(now + END * span)
    if source == ARRIVED:
        return read_float(now)
    if source == EXTRAPOLATED:
        return value(weights, now + BEGIN * span, course, course + BEFORE * span, course + LAST * span)
    end = now
    if source == TO_GUESS:
        end = now + END * span
    return value(weights, end, now + BEGIN * span, course, course + LAST * span)


def feed(self: Any, row: int, count: int) -> None:
    """Write the staged inputs of members."""
    span = 8 * self.elements
    for _ in range(count):
        course, source, target = read64(row + 8), read64(row + 16), read64(row + 32)
        fed_value = fed(self, read64(row), course, source, read64(row + 24))
        if self.correction > 0.0:
            fed_value += read_float(course + LEFT * span)
        if read64(row + 40) == 0:
            write_float(target, fed_value)
        else:
            write_float32(target, fed_value)
        row += 48


def predict(self: Any, target: int) -> None:
    """Write the extrapolated value of each element at the end of the step."""
    span = 8 * self.elements
    now, course, final = self.vectors, self.course, self.weights + FINAL * USE
    for i in range(self.elements):
        at, past = now + 8 * i, course + 8 * i
        write_float(target + 8 * i, value(final, at + BEGIN * span, past, past + BEFORE * span, past + LAST * span))
