"""The square-root unscented Kalman filter as a component of fixed size, which is compiled with the model inside.

The formulas are those of `twin.follow.filters.Unscented`; rows are orthogonalized as by LAPACK, so that both agree to rounding.
"""

from __future__ import annotations

from math import copysign, isfinite, nan, sqrt
from typing import TYPE_CHECKING, Any

from twin.component import Component, Int64, local, output, parameter, solver
from twin.follow.filters import CENTER

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.follow.problem import EstimatedVariable
    from twin.identify import Output


def initialize(self: Any) -> None:
    """Begin with the first estimate; the points are spread by the first step."""
    for i in range(len(self.estimate)):
        self.estimate[i], self.deviation[i] = self.first_estimate[i], self.first_deviation[i]
        for k in range(len(self.estimate)):
            self.root[i, k] = self.first_deviation[i] if i == k else 0.0
    for i in range(len(self.measured)):
        self.last[i] = nan
    self.age = -1
    self.is_spread = 0
    self.nis = 0.0


def step(self: Any, t: float, h: float) -> int:  # noqa: ARG001 - the form of a component
    """Correct the estimate by what is measured now, and spread the points where an interval begins."""
    self.is_spread = 0
    status = solver.OK
    count = choose(self)
    if self.age >= 0:
        self.age += 1
        if count == 0 and self.age < self.interval:
            return status
        status = correct(self, count)
    spread(self, h * max(1, self.interval))
    self.age = 0
    self.is_spread = 1
    return status


def sample(self: Any, number: int, value: float, tick: int) -> float:
    """Return a measured value that arrives, NaN if it is the last one that is held: equal, and within the sample interval."""
    if value == self.last[number] and tick - self.last_tick[number] < self.sample_interval[number]:
        return nan
    if isfinite(value):
        self.last[number] = value
        self.last_tick[number] = tick
    return value


def choose(self: Any) -> int:
    """List the signals that are measured now; return how many. At the start, nothing was predicted that could be compared."""
    count = 0
    for i in range(len(self.measured)):
        if self.age >= 0 and isfinite(self.measured[i]):
            self.chosen[count] = i
            count += 1
    return count


def correct(self: Any, count: int) -> int:
    """Correct the estimate by `count` measured signals; ERROR if a point of the model is not finite."""
    size, points = len(self.estimate), len(self.points)
    fill(self, count)
    triangularize(self.work, count + size, points + count)
    nis = 0.0
    for i in range(count):
        value = self.measured[self.chosen[i]] - self.predicted[i]
        for k in range(i):
            value -= self.work[i, k] * self.normalized[k]
        self.normalized[i] = value / self.work[i, i]
        nis += self.normalized[i] * self.normalized[i]
    for i in range(size):
        value = self.mean[i]
        variance = 0.0
        for k in range(count):
            value += self.work[count + i, k] * self.normalized[k]
        for k in range(size):
            self.root[i, k] = self.work[count + i, count + k] if k <= i else 0.0
            variance += self.root[i, k] * self.root[i, k]
        if not isfinite(value + variance):
            return solver.ERROR
        self.estimate[i] = min(max(value, self.low[i]), self.high[i])
        self.deviation[i] = sqrt(variance)
    if count > 0:
        self.nis = nis
    return solver.OK


def fill(self: Any, count: int) -> None:
    """Fill the work array with the weighted deviations of outputs and points, and the noise of the measurement."""
    size, points = len(self.estimate), len(self.points)
    center, other = CENTER / (size + CENTER), 0.5 / (size + CENTER)
    for i in range(count):
        self.predicted[i] = 0.0
        for k in range(points):
            self.predicted[i] += (center if k == 0 else other) * self.outputs[k, self.chosen[i]]
    for i in range(size):
        self.mean[i] = 0.0
        for k in range(points):
            self.mean[i] += (center if k == 0 else other) * (self.points[k, i] + self.excess[k, i])
    for k in range(points):
        scale = sqrt(center if k == 0 else other)
        for i in range(count):
            self.work[i, k] = scale * (self.outputs[k, self.chosen[i]] - self.predicted[i])
        for i in range(size):
            self.work[count + i, k] = scale * (self.points[k, i] + self.excess[k, i] - self.mean[i])
    for k in range(count):
        for i in range(count + size):
            self.work[i, points + k] = self.noise[self.chosen[k]] if i == k else 0.0


def spread(self: Any, interval: float) -> None:
    """Set the points. `interval`: the time for which process noise is added [s]."""
    size = len(self.estimate)
    has_noise = False
    for i in range(size):
        has_noise = has_noise or self.walk[i] > 0.0
        for k in range(size):
            self.work[i, k] = self.root[i, k]
            self.work[i, size + k] = self.walk[i] * sqrt(interval) if i == k else 0.0
    if has_noise:
        triangularize(self.work, size, 2 * size)
    for i in range(size):
        self.points[0, i] = self.estimate[i]
        for k in range(size):
            move = sqrt(size + CENTER) * (self.work[i, k] if k <= i or not has_noise else 0.0)
            set_point(self, 1 + k, i, self.estimate[i] + move)
            set_point(self, 1 + size + k, i, self.estimate[i] - move)


def set_point(self: Any, number: int, i: int, value: float) -> None:
    """Set an estimate of a point within its bounds, and what these take from it."""
    self.points[number, i] = min(max(value, self.low[i]), self.high[i])
    self.excess[number, i] = value - self.points[number, i]


def triangularize(work: Any, rows: int, columns: int) -> None:
    """Make the lower triangle of `work` the factor L of L L' = A A', by Householder reflections as in LAPACK's dgelq2.

    A: the first `rows` and `columns` of `work`, at least as many columns as rows. Above the diagonal the reflections remain.
    """
    for i in range(rows):
        square = 0.0
        for k in range(i + 1, columns):
            square += work[i, k] * work[i, k]
        if square != 0.0:
            first = work[i, i]
            diagonal = -copysign(sqrt(first * first + square), first)
            for k in range(i + 1, columns):
                work[i, k] /= first - diagonal
            for j in range(i + 1, rows):
                product = work[j, i]
                for k in range(i + 1, columns):
                    product += work[j, k] * work[i, k]
                product *= (diagonal - first) / diagonal
                work[j, i] -= product
                for k in range(i + 1, columns):
                    work[j, k] -= product * work[i, k]
            work[i, i] = diagonal


def unscented(
    estimates: Sequence[EstimatedVariable], outputs: Sequence[Output], interval: int, sample_intervals: Sequence[int]
) -> type[Component]:
    """Return the filter for n estimates and m measured signals.

    `interval`: communication steps between two measurements; `sample_intervals`: between two values of each signal.
    """
    n, m = len(estimates), len(outputs)
    points = 2 * n + 1

    def array(what: str, *shape: int) -> Any:
        return local(0.0, "", what, shape=shape)

    def constants(name: str, what: str) -> Any:
        return parameter(tuple(getattr(variable, name) for variable in estimates), "", what)

    body = {
        "__doc__": "Square-root unscented Kalman filter.",
        "__module__": __name__,
        "initialize": initialize,
        "step": step,
        "estimate": output("", "estimates", shape=(n,)),
        "deviation": output("", "their standard deviations", shape=(n,)),
        "nis": output("", "normalized innovation squared of the last measurement"),
        "last": array("last value of each measured signal", m),
        "last_tick": local((0,) * m, "", "communication step at which it arrived", type=Int64),
        "measured": array("measured values; NaN: not measured", m),
        "points": array("estimated variables at the points", points, n),
        "excess": array("what the bounds have taken from the points", points, n),
        "outputs": array("measured signals at the points", points, m),
        "is_spread": local(0, "", "whether the points were spread", type=Int64),
        "age": local(-1, "", "communication steps since the points were spread; -1: not yet", type=Int64),
        "root": array("lower square root of the covariance", n, n),
        "work": array("deviations of outputs and points", m + n, points + m),
        "chosen": local((0,) * m, "", "signals that are measured now", type=Int64),
        "predicted": array("predicted measurement", m),
        "normalized": array("normalized innovation", m),
        "mean": array("mean of the points", n),
        "first_estimate": constants("start", "first estimate"),
        "first_deviation": constants("deviation", "standard deviation of the first estimate"),
        "walk": constants("walk", "standard deviation of the change in one second"),
        "low": constants("low", "lower bounds"),
        "high": constants("high", "upper bounds"),
        "noise": parameter(tuple(float(output.noise or 0.0) for output in outputs), "", "standard deviations"),
        "sample_interval": parameter(
            tuple(sample_intervals), "", "communication steps between two values of a signal", type=Int64, minimum=1
        ),
        "interval": parameter(interval, "", "communication steps between two measurements", type=Int64, minimum=1),
    }
    return type("Unscented", (Component,), body)
