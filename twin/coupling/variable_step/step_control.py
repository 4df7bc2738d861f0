"""Step control by the energy that power bonds created or lost in the last step.

Each end of a bond computes one of its two values and is fed the other: the power received by one end minus the power
delivered by the other is the residual power, and times the step the residual energy. A PI controller (Gustafsson, ACM Trans.
Math. Softw. 17(4), 1991) keeps it at the tolerance.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from twin.compiler import read64, read_float, write_float

SAFETY = 0.9
PROPORTIONAL, INTEGRAL = 0.4, 0.3  # gains, divided by the order of the residual in the step
SHRINK, GROW = 0.2, 1.5  # limits of the ratio of two steps in a row


def choose_step(self: Any, stride: int) -> None:
    """Choose the next step by the residual of this one, which is accepted in any case."""
    current = residual(self, self.span)
    if not (current <= 1.0) and stride <= self.least and self.tick > 0:  # In the first tick sizes are unknown.
        if self.missed == 0:
            self.missed_tick = self.tick
        self.missed += 1
    previous = self.residual
    if previous == 0.0:
        previous = current
    order = self.order + 2.0
    gain = GROW
    if current > 0.0:
        gain = SAFETY * current ** (-(PROPORTIONAL + INTEGRAL) / order) * previous ** (PROPORTIONAL / order)
    if not (gain >= SHRINK):  # also for NaN
        gain = SHRINK
    gain = min(gain, GROW)
    if gain > 1.0 and (self.limited != 0 or stride < self.stride):
        gain = 1.0  # This step was shortened, so its residual does not justify a longer one.
    self.residual = current
    self.next_step = min(self.next_step * gain, self.tick_length)
    shortest = self.tick_length / self.divisions
    self.next_step = max(self.next_step, shortest)
    self.stride = 1
    while 2 * self.stride <= self.divisions and 2 * self.stride * shortest <= self.next_step:
        self.stride *= 2


def residual(self: Any, h: float) -> float:
    """Return the root mean square of the bonds' residual energies in a step of h [s], relative to their tolerances."""
    row, own = self.pairs, self.energies
    power, lost, squares, count = 0.0, 0.0, 0.0, 0
    for _ in range(self.pair_count):
        received = read_float(read64(row)) * read_float(read64(row + 24)) * read_float(row + 32)
        delivered = read_float(read64(row + 8)) * read_float(read64(row + 16)) * read_float(row + 32)
        power += (received + delivered) / 2.0
        lost += received - delivered
        if read64(row + 40) != 0:
            energy = read_float(own) + power * h
            largest = max(abs(energy), read_float(own + 8))
            write_float(own, energy)
            write_float(own + 8, largest)
            ratio = lost * h / (self.tolerance * max(largest, self.floor))
            squares += ratio * ratio
            count += 1
            power, lost = 0.0, 0.0
            own += 16
        row += 48
    if count == 0:
        return 0.0
    return float(sqrt(squares / count))
