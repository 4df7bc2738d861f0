"""Linearized member from directional derivatives at the current state: der(x) = A x + B u, y = C x + D u.

It replaces a member without rollback in the stability analysis. Inputs are held over a step, for which it is exact.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import solver
from twin.coupling.member import Access, Member, MemberVariable, StateAccess

if TYPE_CHECKING:
    from collections.abc import Iterator

    Array = np.ndarray[Any, Any]

WORD = 8


class LinearMember(Member):
    """Linearization of an initialized `member`; `matrices`: A, B, C, D for its connected Float64 `inputs` and `outputs`."""

    def __init__(
        self,
        member: Member,
        inputs: list[MemberVariable],
        outputs: list[MemberVariable],
        matrices: tuple[Any, Any, Any, Any],
    ) -> None:
        self.name, self.period_ns = member.name, member.period_ns
        self.variables = {variable.name: variable for variable in (*inputs, *outputs)}
        self.log, self.identity = [], member.identity
        self.has_cheap_fmu_state = self.has_fmu_state = True
        self._a, self._b, self._c, self._d = matrices
        self._maps: dict[float, tuple[Array, Array]] = {}  # by the length of a step [s]
        values = {name: np.array(member.get(name), np.float64).reshape(-1) for name in self.variables}
        sizes = {"": len(self._a), **{name: len(elements) for name, elements in values.items()}}
        self._memory = np.zeros(sum(sizes.values()))  # states, then inputs, then outputs
        ends = np.cumsum(list(sizes.values()))
        self._views = {
            name: self._memory[end - size : end] for (name, size), end in zip(sizes.items(), ends, strict=True)
        }
        for name, elements in values.items():
            self._views[name][:] = elements
        n, m = len(self._a), sum(variable.size for variable in inputs)
        self._x, self._u, self._y = self._memory[:n], self._memory[n : n + m], self._memory[n + m :]
        self._before = self._u.copy(), self._y.copy()
        self.step_by(self._step)
        self.instance = int(self._memory.ctypes.data)

    def state_values(self) -> Iterator[tuple[str, Array]]:
        """Yield all states, inputs and outputs with names; states are unnamed."""
        yield from ((name or "states", values) for name, values in self._views.items())

    def _step(self, _instance: int, _t: float, h: float, *_: int) -> int:
        if h not in self._maps:
            self._maps[h] = zero_order_hold(self._a, self._b, h)
        state, forced = self._maps[h]
        u = self._u - self._before[0]
        self._x[:] = state @ self._x + forced @ u
        self._y[:] = self._before[1] + self._c @ self._x + self._d @ u
        return solver.OK

    def instantiate(self) -> None:
        """No-op: it starts at the state of the linearized member."""

    def enter_initialization(self, t: float, stop: float | None) -> None:
        """No-op: it starts at the state of the linearized member."""

    def exit_initialization(self) -> None:
        """No-op: it starts at the state of the linearized member."""

    def set(self, name: str, value: Any) -> None:
        """Write an input or an output."""
        self._views[name][:] = np.ravel(value)

    def get(self, name: str) -> Any:
        """Read an input or an output."""
        return self._views[name].reshape(self.variables[name].shape)[()]

    def address(self, name: str) -> int:
        """Return the address of an input or an output."""
        return int(self._views[name].ctypes.data)

    def access(self, names: list[str], write: bool) -> Access:
        """Not available: values are read and written in place."""
        raise NotImplementedError

    def state_access(self, count: int) -> StateAccess:  # noqa: ARG002 - memory is copied, to any number of points
        """Return access to its memory."""
        return StateAccess(self.instance, len(self._memory))

    def save(self) -> Any:
        """Return a copy of its memory."""
        return self._memory.copy()

    def restore(self, saved: Any) -> None:
        """Restore saved memory."""
        self._memory[:] = saved

    def close(self) -> None:
        """No-op: it owns no resources."""


def zero_order_hold(a: Array, b: Array, h: float) -> tuple[Array, Array]:
    """Discretize der(x) = A x + B u over a step of h [s] with held inputs: matrices for x and u."""
    from scipy.linalg import expm

    n, m = b.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = a * h, b * h
    exponential = expm(block)[:n]
    return exponential[:, :n], exponential[:, n:]
