"""Implicit coupling step: accelerated fixed-point iterations and Newton's method.

Unknowns are the values of the torn connections (feedback) at the end of the step; a sweep along the other connections
computes them again, and the difference must vanish. Every iteration rolls the members back and steps them again.

Aitken: dynamic relaxation, Irons and Tuck, Int. J. Numer. Methods Eng. 1, 1969; Kuettler and Wall, Comput. Mech. 43, 2008.
Anderson: J. ACM 12(4), 1965, with the last `DEPTH` differences; Walker and Ni, SIAM J. Numer. Anal. 49(4), 2011.
"""

from __future__ import annotations

from typing import Any

from twin.compiler import read64, read_float, write_float
from twin.coupling.execution.loop import move
from twin.coupling.variable_step.explicit_step import (
    begin,
    end,
    read_connections,
    restore_state,
    save_state,
    sweep,
    transfer,
)
from twin.coupling.variable_step.input_extrapolation import predict, prepare
from twin.coupling.variable_step.linear_equations import factorize, substitute
from twin.coupling.variable_step.record_layout import (
    AITKEN,
    ANDERSON,
    ASKING,
    COMPARED,
    DEPTH,
    END,
    FIXED,
    NEWTON,
    PREDICTED,
    RESIDUAL,
    SCALE,
    UNSOLVED,
)

HUGE = 1e300  # for ratios that are no numbers
CHANGE = 1e-6  # of an unknown in differences, relative to its size
STALE = 0.3  # ratio of two differences in a row above which the Jacobian is recomputed


def attempt(self: Any, t: float, h: float, slot: int) -> int:
    """Try a step from t by h [s], iterating with the state saved in `slot`; the elements have the values at t + h afterwards."""
    if self.max_iterations > 0 and slot > 0 and save_state(self, slot) > 1:
        return int(self.status)
    if self.outputs_current == 0:
        read_connections(self)
    self.outputs_current = 0
    begin(self)
    if self.recalls != 0:
        prepare(self, h)
        if self.control == PREDICTED or self.control == RESIDUAL:
            predict(self, self.vectors + 8 * COMPARED * self.elements)
    status = 0
    if self.max_iterations == 0:
        status = sweep(self, t, h)
        if status > 1:
            return status
        move(self.feedback)
    else:
        status = solve(self, t, h, slot)
        if status > 1 and status != UNSOLVED:
            return status
    if self.recalls != 0:
        end(self, h)
    self.outputs_current = 1
    return status


def size_of(self: Any, i: int) -> float:
    """Return the scale of an element: its largest value until now, at least the floor."""
    now, span = self.vectors + 8 * i, 8 * self.elements
    return float(max(read_float(now + SCALE * span), abs(read_float(now)), self.floor))


def difference(self: Any, address: int) -> float:
    """Write each torn connection's value minus its guess; return the largest one relative to the tolerance."""
    largest, span = 0.0, 8 * self.elements
    for j in range(self.torn_count):
        i = read64(self.torn + 8 * j)
        now = self.vectors + 8 * i
        delta = read_float(now) - read_float(now + END * span)
        write_float(address + 8 * j, delta)
        ratio = abs(delta) / (self.coupling_tolerance * size_of(self, i))
        if not (ratio <= HUGE):  # NaN stays the largest, whatever follows
            ratio = HUGE
        largest = max(largest, ratio)
    return largest


def solve(self: Any, t: float, h: float, slot: int) -> int:
    """Iterate to convergence; UNSOLVED if the last iteration, which is kept, has not converged."""
    predict(self, self.vectors + 8 * END * self.elements)
    last, relaxation = 0.0, self.relaxation
    for k in range(self.max_iterations):
        if k > 0:
            status = restore_state(self, slot)
            if status > 1:
                return status
        status = sweep(self, t, h)
        if status > 1:
            return status
        move(self.feedback)
        ratio = difference(self, self.solver)
        if ratio <= 1.0:
            self.relaxation = relaxation
            return 0
        if k + 1 == self.max_iterations:
            return UNSOLVED
        if self.scheme == NEWTON:
            other = (
                h != self.linear_at and self.control == FIXED
            )  # With variable steps the Jacobian of another length is reused.
            if self.derives != 0 and (self.jacobian == 0 or other):
                self.status = ASKING
                return ASKING
            if self.jacobian == 0 or other or (k > 0 and ratio > STALE * last):
                status = linearize(self, t, h, slot)
                if status > 1:
                    return status
            newton(self)
        elif self.scheme == ANDERSON:
            anderson(self, k)
        elif self.scheme == AITKEN:
            relaxation = aitken(self, k, relaxation)
        else:
            step_by(self, self.solver, 1.0)
        last = ratio
    return UNSOLVED


def step_by(self: Any, vector: int, factor: float) -> None:
    """Add a multiple of a vector to the guesses of the torn connections."""
    span = 8 * self.elements
    for j in range(self.torn_count):
        guess = self.vectors + 8 * read64(self.torn + 8 * j) + END * span
        write_float(guess, read_float(guess) + factor * read_float(vector + 8 * j))


def product(self: Any, a: int, b: int) -> float:
    """Return the scalar product of two vectors over the torn connections, scaled by the elements' sizes."""
    total = 0.0
    for j in range(self.torn_count):
        size = size_of(self, read64(self.torn + 8 * j))
        total += read_float(a + 8 * j) / size * (read_float(b + 8 * j) / size)
    return total


def aitken(self: Any, k: int, relaxation: float) -> float:
    """Make a step with Aitken's dynamic relaxation; `solver`: difference, the last one, their change."""
    m = self.torn_count
    now, before, change = self.solver, self.solver + 8 * m, self.solver + 16 * m
    if k > 0:
        for j in range(m):
            write_float(change + 8 * j, read_float(now + 8 * j) - read_float(before + 8 * j))
        square = product(self, change, change)
        if square > 0.0:
            relaxation = -relaxation * product(self, before, change) / square
    transfer(now, before, m)
    step_by(self, now, relaxation)
    return relaxation


def anderson(self: Any, k: int) -> None:
    """Make a step of Anderson acceleration: the combination of the last differences with the least residual.

    `solver`: difference f, last f, last guess x, then DEPTH changes of f, DEPTH of x, matrix, right-hand side, pivots.
    """
    m, span = self.torn_count, 8 * self.elements
    f, f_last, x_last = self.solver, self.solver + 8 * m, self.solver + 16 * m
    changes_f = self.solver + 24 * m
    changes_x = changes_f + 8 * m * DEPTH
    matrix = changes_x + 8 * m * DEPTH
    right = matrix + 8 * DEPTH * DEPTH
    if k > 0:
        slot = 8 * m * ((k - 1) % DEPTH)
        for j in range(m):
            guess = self.vectors + 8 * read64(self.torn + 8 * j) + END * span
            write_float(changes_f + slot + 8 * j, read_float(f + 8 * j) - read_float(f_last + 8 * j))
            write_float(changes_x + slot + 8 * j, read_float(guess) - read_float(x_last + 8 * j))
    for j in range(m):
        guess = self.vectors + 8 * read64(self.torn + 8 * j) + END * span
        write_float(x_last + 8 * j, read_float(guess))
    transfer(f, f_last, m)
    n = min(k, DEPTH)
    largest = 0.0
    for a in range(n):
        for b in range(n):
            entry = product(self, changes_f + 8 * m * a, changes_f + 8 * m * b)
            write_float(matrix + 8 * (n * a + b), entry)
            largest = max(largest, entry)
        write_float(right + 8 * a, product(self, changes_f + 8 * m * a, f))
    for a in range(n):
        diagonal = matrix + 8 * (n * a + a)
        write_float(diagonal, read_float(diagonal) + 1e-14 * largest)
    step_by(self, f, 1.0)
    if n > 0 and largest > 0.0 and factorize(matrix, right + 8 * DEPTH, n) == 0:
        substitute(matrix, right + 8 * DEPTH, right, n)
        for a in range(n):
            step_by(self, changes_x + 8 * m * a, -read_float(right + 8 * a))
            step_by(self, changes_f + 8 * m * a, -read_float(right + 8 * a))


def newton(self: Any) -> None:
    """Make a step of Newton's method with the current factors; `solver`: difference, step, matrix, pivots."""
    m = self.torn_count
    step, matrix = self.solver + 8 * m, self.solver + 24 * m
    transfer(self.solver, step, m)
    substitute(matrix, matrix + 8 * m * m, step, m)
    step_by(self, step, 1.0)


def linearize(self: Any, t: float, h: float, slot: int) -> int:
    """Factorize the unit matrix minus the derivatives of torn connections by their guesses, by differences."""
    m, span = self.torn_count, 8 * self.elements
    base, matrix = self.solver + 16 * m, self.solver + 24 * m
    for j in range(m):
        write_float(base + 8 * j, read_float(self.vectors + 8 * read64(self.torn + 8 * j)))
    for j in range(m):
        i = read64(self.torn + 8 * j)
        guess = self.vectors + 8 * i + END * span
        before = read_float(guess)
        change = CHANGE * max(size_of(self, i), abs(before))
        write_float(guess, before + change)
        change = read_float(guess) - before
        status = restore_state(self, slot)
        if status > 1:
            return status
        status = sweep(self, t, h)
        if status > 1:
            return status
        move(self.feedback)
        write_float(guess, before)
        for a in range(m):
            output = read_float(self.vectors + 8 * read64(self.torn + 8 * a))
            slope = (output - read_float(base + 8 * a)) / change
            unit = 0.0
            if a == j:
                unit = 1.0
            write_float(matrix + 8 * (m * a + j), unit - slope)
    if factorize(matrix, matrix + 8 * m * m, m) != 0:
        for a in range(m):
            for j in range(m):
                write_float(matrix + 8 * (m * a + j), float(a == j))
        factorize(matrix, matrix + 8 * m * m, m)
    self.jacobian, self.linear_at = 1, h
    return 0
