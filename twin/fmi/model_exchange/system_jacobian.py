"""The Jacobian of a continuous system from its members' directional derivatives, through the connections between them.

Of a member: der(x) = A x + B u, y = C x + D u in small changes, and u = K y along the connections, so that the whole has
A + B K (1 - D K)^-1 C. Algebraic loops are part of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.fmi.model_exchange.connections import is_continuous

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from twin.coupling import ResolvedConnection
    from twin.fmi.model_exchange.model_exchange_member import ExchangeMember

Vector = np.ndarray[Any, Any]


def offered(members: Sequence[ExchangeMember]) -> bool:
    """Whether all members provide directional derivatives."""
    return all(member.capabilities["providesDirectionalDerivatives"] for member in members)


class JacobianPart:
    """Knowns and unknowns of one member, and their rows and columns in the system."""

    def __init__(self, member: ExchangeMember, links: Sequence[ResolvedConnection], wanted: Sequence[str] = ()) -> None:
        self.member = member
        inputs = [link.target.variable for link in links if link.target.member == member.name]
        outputs = [link.source.variable for link in links if link.source.member == member.name]
        outputs += [member.variables[name] for name in wanted]
        self.inputs = {variable.name: variable for variable in inputs}
        self.outputs = {output.name: output for output in outputs}
        sizes = {variable.references[0]: variable.size for variable in member.variables.values()}
        self.state_references = [(reference, sizes[reference]) for reference in member.structure.states]
        self.input_references = [(variable.references[0], variable.size) for variable in self.inputs.values()]
        unknowns = [*member.structure.derivatives, *(output.references[0] for output in self.outputs.values())]
        self.unknowns = np.array(unknowns, np.uint32)
        self.rows = sum(sizes[int(unknown)] for unknown in self.unknowns)

    def along(self, references: Sequence[tuple[int, int]]) -> Vector:
        """Derivatives of all unknowns along each element of some knowns, as columns."""
        columns = [
            self.member.direction(self.unknowns, reference, seed, self.rows)
            for reference, size in references
            for seed in np.eye(size)
        ]
        return np.array(columns).T if columns else np.zeros((self.rows, 0))


class Jacobian:
    """Of all states' derivatives by all states; `move_to` brings the members to a point.

    `wanted`: outputs of each member to include besides those that others read.
    """

    def __init__(
        self,
        members: Sequence[ExchangeMember],
        links: Sequence[ResolvedConnection],
        move_to: Callable[[float, Vector], None],
        wanted: Mapping[str, Sequence[str]] | None = None,
    ) -> None:
        flowing = [link for link in links if is_continuous(link)]
        self.parts = [JacobianPart(member, flowing, (wanted or {}).get(member.name, ())) for member in members]
        self.move_to = move_to
        inputs = assign_offsets(
            (part.member.name, variable) for part in self.parts for variable in part.inputs.values()
        )
        self.outputs, count = assign_offsets(
            (part.member.name, variable) for part in self.parts for variable in part.outputs.values()
        )
        self.coupling = np.zeros((inputs[1], count))
        for link in flowing:
            row = inputs[0][link.target.key] + link.target.first
            column = self.outputs[link.source.key] + link.source.first
            for i in range(link.target.size):
                self.coupling[row + i, column + i] = link.factor

    def __call__(self, t: float, y: Vector) -> Vector:
        """The Jacobian at a point."""
        self.move_to(t, y)
        return self.linearized()[0]

    def linearized(self, by: Sequence[Vector] | None = None) -> tuple[Vector, Vector, Vector, Vector]:
        """Linearize the system at the members' present point: states' derivatives, then outputs, by states and by `by`.

        `by`: derivatives of each member's unknowns by other knowns, such as parameters; in columns.
        """
        counts = [len(part.member.states) for part in self.parts]
        by_state = [part.along(part.state_references) for part in self.parts]
        a, c = (blocks(by_state, counts, below) for below in (False, True))
        other = [np.zeros((part.rows, 0)) for part in self.parts] if by is None else by
        f, g = (
            np.concatenate(
                [values[count:] if below else values[:count] for values, count in zip(other, counts, strict=True)]
            )
            for below in (False, True)
        )
        if not self.coupling.size:
            return a, f, c, g
        by_input = [part.along(part.input_references) for part in self.parts]
        b, d = (blocks(by_input, counts, below) for below in (False, True))
        ring = np.eye(len(c)) - d @ self.coupling
        reach, straight = np.linalg.solve(ring, c), np.linalg.solve(ring, g)
        through = b @ self.coupling
        return a + through @ reach, f + through @ straight, reach, straight


def assign_offsets(variables: Any) -> tuple[dict[tuple[str, str], int], int]:
    """Where each variable's elements begin, and how many there are in all."""
    offsets, at = {}, 0
    for member, variable in variables:
        offsets[member, variable.name] = at
        at += variable.size
    return offsets, at


def blocks(parts: Sequence[Vector], counts: Sequence[int], below: bool) -> Vector:
    """A block-diagonal matrix of the rows above or below each part's number of states."""
    import scipy.linalg

    chosen = [part[count:] if below else part[:count] for part, count in zip(parts, counts, strict=True)]
    return np.asarray(scipy.linalg.block_diag(*chosen))
