"""Stability of a coupling: growth of a small deviation over the common multiple of all periods (spectral radius).

Algorithm, solvers and delays are those of the run itself. All values that components store and publish are perturbed, one
after the other, which gives the complete map of a step. An FMU hides its state; if it supports rollback, the connected
values are perturbed and the map is identified from the responses over many steps (`growth_by_response`). One without
rollback but with directional derivatives is replaced by its linearization (`linear_member`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import Role
from twin.coupling.component_member import RecordMember
from twin.coupling.execution import loop
from twin.coupling.execution.value_memory import silent_copy, view
from twin.coupling.stability.growth_by_response import growth_of_responses
from twin.coupling.stability.linear_member import LinearMember
from twin.coupling.variable_step.record_layout import FIXED
from twin.coupling.variable_step.rollback import verify_rollback
from twin.errors import CouplingError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from twin.coupling.cosimulation import CoSimulation
    from twin.coupling.member import Member
    from twin.coupling.system import ResolvedConnection

    Array = np.ndarray[Any, Any]

DEVIATION = 1e-6  # relative to a value, or to its nominal size
SMALL = 1e-3  # size of a value without a nominal one [its SI unit]
LONGEST = 10_000  # largest number of communication steps of a cycle
DENSE = 120  # largest number of values for a dense matrix
SUBSPACE = 40  # dimension of Arnoldi's iteration for more values
HELP = "Export it with its state (canGetAndSetFMUstate; PythonFMU: `--handle-state`) or with directional derivatives."


@dataclass(frozen=True)
class Growth:
    """Growth of deviations. `factor`: of the fastest one over a cycle; `share`: names of its dominant values.

    `cycle` [s]: common multiple of the members' periods.
    """

    factor: float
    cycle: float
    share: tuple[str, ...]

    @property
    def rate(self) -> float:
        """Growth rate [1/s]; negative if all deviations decay."""
        return float(np.log(max(self.factor, 1e-300)) / self.cycle)


def growth(simulated: CoSimulation) -> Growth:
    """Compute the fastest growth of a deviation from the state of an initialized co-simulation, which is restored.

    CouplingError that names the members that cannot be analyzed.
    """
    linear: dict[str, Member] = {}
    problems = []
    for name, member in simulated.members.items():
        reason = hidden_state_problem(simulated, name, member)
        if reason and (linear_member := linearized(member, simulated.links)) is not None:
            linear[name] = linear_member
        elif reason:
            problems.append(f"stability: {reason}")
    if problems:
        raise CouplingError(problems)
    if linear:
        simulated = simulated.with_members({**simulated.members, **linear})
    return Deviation(simulated).growth()


def hidden_state_problem(simulated: CoSimulation, name: str, member: Member) -> str:
    """Return why a member's state can be neither read nor restored; empty if it can."""
    if isinstance(member, RecordMember) and not member.has_cheap_fmu_state:
        return f"{name} keeps its state to itself: it is Python. Nothing can be told of a coupling with it."
    if member.has_cheap_fmu_state:
        return ""
    if not member.has_fmu_state:
        return f"{name} keeps its state to itself, and tells no directional derivatives. {HELP}"
    problem = verify_rollback(member, clock.seconds(simulated.time), clock.seconds(simulated.periods[name]))
    return problem and f"{name} says that it can be brought back, and cannot: {problem}. {HELP}"


def linearized(member: Member, links: list[ResolvedConnection]) -> LinearMember | None:
    """Linearize a member at its current state by directional derivatives; None if it has none."""
    variables = {
        kind: {end.variable.name: end.variable for end in ends if end.member == member.name}
        for kind, ends in (("inputs", [link.target for link in links]), ("outputs", [link.source for link in links]))
    }
    if not all(variable.dtype == np.float64 for ends in variables.values() for variable in ends.values()):
        return None
    inputs, outputs = list(variables["inputs"].values()), list(variables["outputs"].values())
    matrices = member.slopes(inputs, outputs)
    return None if matrices is None else LinearMember(member, inputs, outputs, matrices)


class Deviation:
    """Perturbation of the values of a co-simulation."""

    def __init__(self, simulated: CoSimulation) -> None:
        self.simulated, self.plan = simulated, simulated.plan
        self.names: list[str] = []
        self.arrays: list[Array] = []
        sizes: list[Array] = []
        self.is_complete = True  # whether the values are the complete state of the members
        for name, member in simulated.members.items():
            for state, values, size in state_values(member):
                self.arrays.append(values)
                sizes.append(np.full(values.size, size))
                self.names += [f"{name}.{state}"] * values.size
            if not isinstance(member, RecordMember | LinearMember):
                self.is_complete = False
                self._refuse_controlled(name)
        for (name, variable_name), address in self.plan.published.items():
            variable = simulated.members[name].variables[variable_name]
            has_readable_state = self.plan.is_read_directly(name) and isinstance(
                simulated.members[name], RecordMember | LinearMember
            )
            if variable.dtype == np.float64 and not has_readable_state and variable.causality != "input":
                self.arrays.append(view(address, variable))
                sizes.append(np.full(variable.size, SMALL))
                self.names += [f"{name}.{variable_name}"] * variable.size
        self.sizes = np.concatenate([np.zeros(0), *sizes])
        self.cycle = int(np.lcm.reduce([self.plan.divider(name) for name in simulated.members]))
        if self.cycle > LONGEST:
            raise CouplingError(
                f"stability: the periods meet only every {self.cycle} steps. Use periods with a common one."
            )

    def _refuse_controlled(self, name: str) -> None:
        """Raise CouplingError where the length of steps depends on values: then responses do not follow one linear map."""
        algorithm = self.simulated.algorithm
        if algorithm.control != FIXED:
            raise CouplingError(
                f"stability: {algorithm} chooses the length of its steps, and {name} shows its answers over many of them only. "
                "See what steps it needs: twin check --stability --set algorithm=jacobi."
            )

    def read(self) -> Array:
        """Return all values."""
        return np.concatenate([np.zeros(0), *self.arrays])

    def write(self, values: Array) -> None:
        """Set all values."""
        at = 0
        for array in self.arrays:
            array[:] = values[at : at + array.size]
            at += array.size

    def growth(self) -> Growth:
        """Compute the fastest growth; see the function `growth`."""
        begin = self.read()
        memory = self.plan.memory.saved()
        states = {name: member.save() for name, member in self.simulated.members.items()}

        def restore() -> None:
            self.plan.memory.restore(memory)
            for name, member in self.simulated.members.items():
                member.restore(states[name])

        sizes = np.maximum(np.abs(begin), self.sizes)
        if not sizes.size:
            return Growth(0.0, self.seconds, ())  # There are no states and no connections.

        def after(count: int, stride: int, direction: Array) -> Array:
            """Return the response to a deviation after each of `count` strides, relative to the values' sizes: a row each."""
            small = DEVIATION / max(float(np.max(np.abs(direction))), 1e-300)
            ends = []
            for sign in (1, -1):
                restore()
                self.write(begin + sign * small * sizes * direction.ravel())
                ends.append(self.answers(count, stride * self.cycle))
            return np.asarray((np.array(ends[0]) - np.array(ends[1])) / (2 * small * sizes))

        try:
            if self.is_complete:
                value, vector = largest_eigenvalue(lambda direction: after(1, 1, direction)[0], len(begin))
            else:
                value, vector = growth_of_responses(after, len(begin))
        except FloatingPointError:
            return Growth(np.inf, self.seconds, ())
        finally:
            restore()
            self.write(begin)
        parts = np.abs(vector)
        leading = [self.names[i] for i in np.argsort(-parts)[:6] if parts[i] > 0.2 * parts.max()]
        return Growth(float(abs(value)), self.seconds, tuple(dict.fromkeys(leading)))

    @property
    def seconds(self) -> float:
        """Length of a cycle [s]."""
        return clock.seconds(self.cycle * self.simulated.step)

    def answers(self, count: int, steps: int) -> list[Array]:
        """Return all values after every `steps` steps of the loop, `count` times; nothing is recorded or reported."""
        record = silent_copy(self.simulated._record)
        results = []
        for _ in range(count):
            record["stop"] = record["tick"] + steps
            if self.simulated._loop(record.ctypes.data) == loop.FAILED:
                raise CouplingError(
                    f"stability: {list(self.simulated.members)[int(record[0]['member'])]} fails a step."
                )
            results.append(self.read())
        return results


def state_values(member: Member) -> Iterator[tuple[str, Array, float]]:
    """Yield the real states of a member that can be set: name, view of the values, nominal size."""
    if isinstance(member, LinearMember):
        yield from ((name, values, SMALL) for name, values in member.state_values())
    if not isinstance(member, RecordMember):
        return
    for variable in member.component.variables:
        if variable.role is not Role.parameter and variable.dtype.kind == "f" and variable.size:
            size = float(np.max(np.abs(variable.nominal or SMALL)))
            yield variable.name, member.component.views[variable.name].reshape(-1), size


def largest_eigenvalue(apply: Callable[[Array], Array], size: int) -> tuple[complex, Array]:
    """Return the eigenvalue of largest modulus of a linear map, and its vector; FloatingPointError if not finite.

    Dense for up to `DENSE` values, by Arnoldi's iteration for more.
    """
    if size <= DENSE:
        matrix = np.stack([apply(direction) for direction in np.eye(size)], axis=1)
        if not np.isfinite(matrix).all():
            raise FloatingPointError
        values, vectors = np.linalg.eig(matrix)
    else:
        from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs

        def apply_checked(direction: Array) -> Array:
            image = apply(direction)
            if not np.isfinite(image).all():
                raise FloatingPointError
            return image

        operator = LinearOperator((size, size), matvec=apply_checked, dtype=np.float64)
        try:
            values, vectors = eigs(operator, k=2, ncv=SUBSPACE, tol=1e-7, v0=np.ones(size))
        except ArpackNoConvergence as error:
            values, vectors = error.eigenvalues, error.eigenvectors
            if not len(values):
                raise CouplingError("stability: no eigenvalue converged. Linearize fewer members.") from None
    index = int(np.argmax(np.abs(values)))
    return complex(values[index]), vectors[:, index]
