"""How long the next step may be, by the energy that power bonds made or lost in the last one.

Both ends of a bond know one of its two values and were fed the other: the power that one end took minus the power that the
other one gave is the residual, and times the step an energy that nobody has. A controller with a proportional and an
integral part (Gustafsson, ACM Trans. Math. Softw. 17(4), 1991) makes it as large as is asked for.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from twin.compiler import read64, read_float, write_float

SAFETY = 0.9
PROPORTIONAL, INTEGRAL = 0.4, 0.3  # divided by the order of the residual in the step
SHRINK, GROW = 0.2, 1.5  # at most, from step to step


def choose_step(self: Any, stride: int) -> None:
    """Choose the next step by how good this one was; it stays in any case."""
    current = residual(self, self.span)
    if not (current <= 1.0) and stride <= self.least and self.tick > 0:  # before, sizes are not known
        if self.missed == 0:
            self.missed_tick = self.tick
        self.missed += 1
    before = self.residual
    if before == 0.0:
        before = current
    order = self.order + 2.0
    gain = GROW
    if current > 0.0:
        gain = SAFETY * current ** (-(PROPORTIONAL + INTEGRAL) / order) * before ** (PROPORTIONAL / order)
    if not (gain >= SHRINK):  # nor is it a number
        gain = SHRINK
    gain = min(gain, GROW)
    if gain > 1.0 and (self.limited != 0 or stride < self.stride):
        gain = 1.0  # it was cut: the next one may be as long as this one was to be
    self.residual = current
    self.next_step = min(self.next_step * gain, self.tick_length)
    shortest = self.tick_length / self.divisions
    self.next_step = max(self.next_step, shortest)
    self.stride = 1
    while 2 * self.stride <= self.divisions and 2 * self.stride * shortest <= self.next_step:
        self.stride *= 2


def residual(self: Any, h: float) -> float:
    """Energy [J] that bonds made or lost in a step of h, as a root mean square of what is tolerated."""
    row, own = self.pairs, self.energies
    power, lost, squares, count = 0.0, 0.0, 0.0, 0
    for _ in range(self.pair_count):
        received = read_float(read64(row)) * read_float(read64(row + 24)) * read_float(row + 32)
        delivered = read_float(read64(row + 8)) * read_float(read64(row + 16)) * read_float(row + 32)
        power += (received + delivered) / 2.0
        lost += received - delivered
        if read64(row + 40) != 0:
            went = read_float(own) + power * h
            largest = max(abs(went), read_float(own + 8))
            write_float(own, went)
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
