"""Whether a coupling is stable: the eigenvalues of what one step of the whole loop makes of a small deviation.

All that the members keep and all that they publish is moved by a little, one value after the other, and the loop steps
once over the common multiple of all periods: algorithm, solvers and delays are those of the run itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import Role
from twin.coupling import loop
from twin.coupling.plan import view
from twin.coupling.record import RecordMember
from twin.dataclass import dataclass
from twin.errors import CouplingError

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.coupling.cosimulation import CoSimulation

    Array = np.ndarray[Any, Any]

DEVIATION = 1e-6  # of a value, or of its nominal size
SMALL = 1e-3  # size of a value that has no nominal one [its SI unit]
LONGEST = 10_000  # communication steps of a cycle
DENSE = 120  # values of which the whole matrix is made
SUBSPACE = 40  # of Arnoldi's iteration for more
NEVER = 2**62


@dataclass(frozen=True)
class Growth:
    """What becomes of a deviation. `factor`: of the fastest one over a cycle; `share`: of which values it is made.

    `cycle` [s]: common multiple of the members' periods.
    """

    factor: float
    cycle: float
    share: tuple[str, ...]

    @property
    def rate(self) -> float:
        """Of growth [1/s]; negative if everything decays."""
        return float(np.log(max(self.factor, 1e-300)) / self.cycle)


def growth(simulated: CoSimulation) -> Growth:
    """The fastest growth of a deviation from where an initialized co-simulation is; it is there again afterwards."""
    foreign = [
        name for name, one in simulated.members.items() if not (isinstance(one, RecordMember) and one.can_restore)
    ]
    if foreign:
        raise CouplingError(
            f"stability: {foreign[0]} keeps its state to itself. It can be told of components, not of FMUs or of Python."
        )
    return Deviation(simulated).growth()


class Deviation:
    """Values of a co-simulation that are moved by a little."""

    def __init__(self, simulated: CoSimulation) -> None:
        self.simulated, self.plan = simulated, simulated.plan
        names: list[str] = []
        self.places: list[Array] = []
        sizes: list[Array] = []
        for name, member in simulated.members.items():
            assert isinstance(member, RecordMember)
            for variable in member.component.variables:
                if variable.role is Role.parameter or variable.dtype.kind != "f" or not variable.size:
                    continue
                values = member.component.views[variable.name].reshape(-1)
                self.places.append(values)
                sizes.append(np.full(values.size, float(np.max(np.abs(variable.nominal or SMALL)))))
                names += [f"{name}.{variable.name}"] * values.size
        for (name, own), address in self.plan.published.items():
            variable_ = simulated.members[name].variables[own]
            if variable_.dtype == np.float64 and not self.plan.in_place(name):
                self.places.append(view(address, variable_))
                sizes.append(np.full(variable_.size, SMALL))
                names += [f"{name}.{own}"] * variable_.size
        self.names, self.sizes = names, np.concatenate(sizes)
        self.cycle = int(np.lcm.reduce([self.plan.divider(name) for name in simulated.members]))
        if self.cycle > LONGEST:
            raise CouplingError(
                f"stability: the periods meet only every {self.cycle} steps. Use periods with a common one."
            )

    def read(self) -> Array:
        """All values."""
        return np.concatenate(self.places)

    def write(self, values: Array) -> None:
        """Set them."""
        at = 0
        for place in self.places:
            place[:] = values[at : at + place.size]
            at += place.size

    def growth(self) -> Growth:
        """See `growth`."""
        begin = self.read()
        blocks = [block.copy() for block in self.plan.memory.blocks]
        kept = {name: member.save() for name, member in self.simulated.members.items()}

        def restore() -> None:
            for block, saved in zip(self.plan.memory.blocks, blocks, strict=True):
                block[:] = saved
            for name, member in self.simulated.members.items():
                member.restore(kept[name])

        def after(values: Array) -> Array:
            restore()
            self.write(values)
            self.step()
            return self.read()

        sizes = np.maximum(np.abs(begin), self.sizes)

        def applied(direction: Array) -> Array:
            """What becomes of a deviation, both as parts of the values' sizes."""
            small = DEVIATION / max(float(np.max(np.abs(direction))), 1e-300)
            ends = [after(begin + sign * small * sizes * direction.ravel()) for sign in (1, -1)]
            return np.asarray((ends[0] - ends[1]) / (2 * small * sizes))

        try:
            value, vector = largest(applied, len(begin))
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
        """Length of a cycle."""
        return clock.seconds(self.cycle * self.simulated.step)

    def step(self) -> None:
        """Let the loop go over a cycle, recording and noticing nothing."""
        record = self.simulated._record.copy()
        record["every"], record["limit_count"], record["limit"] = NEVER, 0, NEVER
        record["derives"] = 0  # Newton's method finds its Jacobian by itself
        record["stop"] = record["tick"] + self.cycle
        if self.simulated._loop(record.ctypes.data) == loop.FAILED:
            raise CouplingError(f"stability: {list(self.simulated.members)[int(record[0]['member'])]} fails a step.")


def largest(applied: Callable[[Array], Array], size: int) -> tuple[complex, Array]:
    """The eigenvalue of largest size of a linear map, and its vector. FloatingPointError if the map gives no numbers.

    All of it for a few values, Arnoldi's iteration for many.
    """
    if size <= DENSE:
        matrix = np.stack([applied(one) for one in np.eye(size)], axis=1)
        if not np.isfinite(matrix).all():
            raise FloatingPointError
        values, vectors = np.linalg.eig(matrix)
    else:
        from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs

        def checked(direction: Array) -> Array:
            found = applied(direction)
            if not np.isfinite(found).all():
                raise FloatingPointError
            return found

        operator = LinearOperator((size, size), matvec=checked, dtype=np.float64)
        try:
            values, vectors = eigs(operator, k=2, ncv=SUBSPACE, tol=1e-7, v0=np.ones(size))
        except ArpackNoConvergence as error:
            values, vectors = error.eigenvalues, error.eigenvectors
            if not len(values):
                raise CouplingError("stability: no eigenvalue converged. Linearize fewer members.") from None
    place = int(np.argmax(np.abs(values)))
    return complex(values[place]), vectors[:, place]
