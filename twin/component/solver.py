"""From a component's own functions to the two the engine calls: `initialize(self, t)` and `advance(self, t, h)`.

A method is a table, the loops over it are plain Python over a record, so they too run interpreted, compiled and inside
an FMU, to the same bit. `self` has the flat overlays `_x`, `_dx` and the scratch fields that `hidden` names.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, floor, isfinite, sqrt
from typing import Any

import numpy as np

from twin.component.generated import define
from twin.component.variable import Boolean, Float64, Int64, Type

# status of a call, FMI 3.0 words; a component's function returns one or nothing
OK, WARNING, DISCARD, ERROR, FATAL = 0, 1, 2, 3, 4

Function = Callable[..., Any]
Hidden = dict[str, tuple[Type, tuple[int, ...]]]
Inputs = tuple[tuple[str, Type, tuple[int, ...]], ...]  # name, type and shape of each

HELD_PREFIX = "_held_"  # before the name of an input: its value in the present tick


@dataclass(frozen=True, slots=True)
class Method:
    """An integration method of fixed substep [s]: Butcher tableau `a`, `b`, `c`, or a linearly implicit one."""

    name: str
    order: int
    substep: float
    a: tuple[tuple[float, ...], ...] = ()
    b: tuple[float, ...] = ()
    c: tuple[float, ...] = ()


def euler(substep: float) -> Method:
    """Explicit Euler, order 1."""
    return Method("euler", 1, substep, ((0.0,),), (1.0,), (0.0,))


def heun(substep: float) -> Method:
    """Heun's method, order 2."""
    return Method("heun", 2, substep, ((0.0, 0.0), (1.0, 0.0)), (0.5, 0.5), (0.0, 1.0))


def rk4(substep: float) -> Method:
    """The classical Runge-Kutta method, order 4."""
    a = ((0.0, 0.0, 0.0, 0.0), (0.5, 0.0, 0.0, 0.0), (0.0, 0.5, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
    return Method("rk4", 4, substep, a, (1 / 6, 1 / 3, 1 / 3, 1 / 6), (0.0, 0.5, 0.5, 1.0))


def ros2(substep: float) -> Method:
    """Linearly implicit and L-stable, order 2 with any approximation of the Jacobian: for stiff members.

    ROS2, Verwer, Spee, Blom, Hundsdorfer, SIAM J. Sci. Comput. 20(4), 1999. The Jacobian is taken by differences in
    every substep, so `derivatives` is evaluated states + 2 times.
    """
    return Method("ros2", 2, substep)


def hidden(method: Method | None, period: int, states: int, inputs: Inputs) -> Hidden:
    """Fields that the engine adds to the declared variables in the record."""
    fields: Hidden = {}
    if method is not None and states:
        fields["_x0"] = (Float64, (states,))
        fields["_k"] = (Float64, (max(len(method.b), 2), states))
        if not method.b:
            fields["_jacobian"] = (Float64, (states, states))
            fields["_nominal"] = (Float64, (states,))
    if period:
        fields["_begin"] = (Int64, (1,))  # start of the run [ns]
        fields["_tick"] = (Int64, (2,))
        fields.update({f"{HELD_PREFIX}{name}": (kind, shape or (1,)) for name, kind, shape in inputs})
    return fields


def explicit_step(derivatives: Function, method: Method, state_count: int) -> Function:
    """One substep of an explicit Runge-Kutta method."""
    matrix, weights, nodes, stages = np.array(method.a), np.array(method.b), np.array(method.c), len(method.b)

    def substep(self: Any, t: float, h: float) -> None:
        x, dx, x0, k = self._x, self._dx, self._x0, self._k
        for j in range(state_count):
            x0[j] = x[j]
        for i in range(stages):
            for j in range(state_count):
                change = 0.0
                for m in range(i):
                    change += matrix[i, m] * k[m, j]
                x[j] = x0[j] + h * change
            derivatives(self, t + nodes[i] * h)
            for j in range(state_count):
                k[i, j] = dx[j]
        for j in range(state_count):
            change = 0.0
            for m in range(stages):
                change += weights[m] * k[m, j]
            x[j] = x0[j] + h * change

    return substep


def factorize(a: Any, n: int) -> None:
    """LU without pivoting, in place. I - gamma h J is diagonally dominant for all but absurd substeps."""
    for i in range(n):
        for j in range(i + 1, n):
            a[j, i] /= a[i, i]
            for m in range(i + 1, n):
                a[j, m] -= a[j, i] * a[i, m]


def substitute(a: Any, b: Any, row: int, n: int) -> None:
    """Solve with the factors; `b[row]` is the right-hand side and then the solution."""
    for i in range(n):
        for m in range(i):
            b[row, i] -= a[i, m] * b[row, m]
    for i in range(n - 1, -1, -1):
        for m in range(i + 1, n):
            b[row, i] -= a[i, m] * b[row, m]
        b[row, i] /= a[i, i]


def implicit_step(derivatives: Function, state_count: int) -> Function:
    """One substep of ROS2; f(t + h) in the second stage keeps order 2 for inputs that are given in time."""
    gamma = 1.0 - sqrt(0.5)

    def substep(self: Any, t: float, h: float) -> None:
        x, dx, x0, k, a, nominal = self._x, self._dx, self._x0, self._k, self._jacobian, self._nominal
        derivatives(self, t)
        for j in range(state_count):
            x0[j] = x[j]
            k[0, j] = dx[j]
        for m in range(state_count):
            change = 1e-7 * (abs(x0[m]) + nominal[m])
            x[m] = x0[m] + change
            derivatives(self, t)
            x[m] = x0[m]
            for j in range(state_count):
                a[j, m] = -gamma * h * (dx[j] - k[0, j]) / change
            a[m, m] += 1.0
        factorize(a, state_count)
        substitute(a, k, 0, state_count)
        for j in range(state_count):
            x[j] = x0[j] + h * k[0, j]
        derivatives(self, t + h)
        for j in range(state_count):
            k[1, j] = dx[j] - 2.0 * k[0, j]
        substitute(a, k, 1, state_count)
        for j in range(state_count):
            x[j] = x0[j] + h * (1.5 * k[0, j] + 0.5 * k[1, j])

    return substep


def continuous_advance(derivatives: Function, method: Method, state_count: int) -> Function:
    """Integrate over h in equal substeps no longer than the method's, then set outputs and derivatives of t + h."""
    substep = explicit_step(derivatives, method, state_count) if method.b else implicit_step(derivatives, state_count)
    longest_substep = method.substep

    def advance(self: Any, t: float, h: float) -> int:
        count = max(1, ceil(h / longest_substep - 1e-9))
        part = h / count
        for i in range(count):
            substep(self, t + i * part, part)
        derivatives(self, t + h)
        for j in range(state_count):
            if not isfinite(self._x[j]):
                return ERROR
        return OK

    return advance


def algebraic_advance(derivatives: Function) -> Function:
    """A continuous component without states: its outputs of t + h."""

    def advance(self: Any, t: float, h: float) -> int:
        derivatives(self, t + h)
        return OK

    return advance


def evaluation(derivatives: Function) -> Function:
    """States, inputs and time as they are: set derivatives and outputs. What a solver outside calls."""

    def evaluate(self: Any, t: float) -> int:
        derivatives(self, t)
        return OK

    return evaluate


def discrete_advance(step: Function, returns_status: bool) -> Function:
    """Component that steps on request."""

    def advance(self: Any, t: float, h: float) -> int:
        step(self, t, h)
        return OK

    def advance_status(self: Any, t: float, h: float) -> int:
        return int(step(self, t, h))

    return advance_status if returns_status else advance


def sampled_advance(advance: Function, period_ns: int, inputs: Inputs) -> Function:
    """A component with its own period P [ns], under any communication step.

    Tick n holds the inputs of n P and publishes at (n + 1) P, when its step is due, not when it is computed. With a
    communication step of P this is one plain step. Times are counted in whole nanoseconds, so that the `t` of a tick
    is the same float wherever the component runs.
    """
    h_tick = period_ns / 1e9
    tolerance_ns = 1e-6 * period_ns
    take, swap = (define(name, text, {}, "inputs of a tick") for name, text in hold(inputs).items())

    def advance_sampled(self: Any, t: float, h: float) -> int:
        begin, tick = self._begin[0], self._tick
        end = (t + h) * 1e9
        status = OK
        while True:
            first = begin + tick[0] * period_ns
            is_open = first + period_ns > end + tolerance_ns
            if tick[1] == 0:
                if first >= end - tolerance_ns:
                    return status
                if is_open:
                    take(self)
                    tick[1] = 1
                    return status
                status = max(status, advance(self, first / 1e9, h_tick))  # begins and ends here: with the inputs of now
            else:
                if is_open:
                    return status
                swap(self)
                status = max(status, advance(self, first / 1e9, h_tick))
                swap(self)
            tick[0] += 1
            tick[1] = 0

    def advance_source(self: Any, t: float, h: float) -> int:
        begin, tick = self._begin[0], self._tick
        status = OK
        while begin + (tick[0] + 1) * period_ns <= (t + h) * 1e9 + tolerance_ns:
            status = max(status, advance(self, (begin + tick[0] * period_ns) / 1e9, h_tick))
            tick[0] += 1
        return status

    return advance_sampled if inputs else advance_source


def hold(inputs: Inputs) -> dict[str, str]:
    """Text of the functions that keep the inputs of a tick, and that exchange them with those of now."""
    lines: dict[str, list[str]] = {"take_inputs": [], "swap_inputs": []}
    for name, kind, shape in inputs:
        now, held, depth = f"self.{name}", f"self.{HELD_PREFIX}{name}", 1
        for i, size in enumerate(shape):
            for body in lines.values():
                body.append(f"{'    ' * depth}for i{i} in range({size}):")
            depth += 1
        index = ", ".join(f"i{i}" for i in range(len(shape)))
        now, held = f"{now}[{index}]" if shape else now, f"{held}[{index or 0}]"
        back = f"{held} != 0" if kind is Boolean and not shape else held
        indent = "    " * depth
        lines["take_inputs"].append(f"{indent}{held} = {now}")
        new = f"new_{name.strip('_')}"
        lines["swap_inputs"] += [f"{indent}{new} = {now}", f"{indent}{now} = {back}", f"{indent}{held} = {new}"]
    return {name: "\n".join([f"def {name}(self):", *(body or ["    pass"]), ""]) for name, body in lines.items()}


def initialization(initialize: Function | None, derivatives: Function | None, sampled: bool) -> Function:
    """Set states and outputs from parameters and inputs; may be repeated while inputs are being found."""

    def nothing(self: Any) -> None:
        pass

    first = initialize or nothing

    def initialize_continuous(self: Any, t: float) -> int:
        first(self)
        derivatives(self, t)  # type: ignore[misc]
        return OK

    def initialize_sampled(self: Any, t: float) -> int:
        self._begin[0] = floor(t * 1e9 + 0.5)
        self._tick[0] = 0
        self._tick[1] = 0
        first(self)
        return OK

    def initialize_discrete(self: Any, t: float) -> int:
        first(self)
        return OK

    if derivatives is not None:
        return initialize_continuous
    return initialize_sampled if sampled else initialize_discrete
