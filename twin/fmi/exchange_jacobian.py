"""The Jacobian of a continuous system from its members' directional derivatives, through the connections between them.

Of a member: der(x) = A x + B u, y = C x + D u in small changes, and u = K y along the connections, so that the whole has
A + B K (1 - D K)^-1 C. Algebraic loops are part of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.fmi.exchange_links import is_continuous

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from twin.coupling import Link
    from twin.fmi.exchange import ExchangeMember

Vector = np.ndarray[Any, Any]


def offered(members: Sequence[ExchangeMember]) -> bool:
    """Whether all members tell directional derivatives."""
    return all(one.capabilities["providesDirectionalDerivatives"] for one in members)


class Part:
    """One member: which of its values are known, which are not, and where they stand in the whole."""

    def __init__(self, member: ExchangeMember, links: Sequence[Link]) -> None:
        self.member = member
        inputs = [link.target.variable for link in links if link.target.member == member.name]
        outputs = [link.source.variable for link in links if link.source.member == member.name]
        self.inputs = {one.name: one for one in inputs}
        self.outputs = {one.name: one for one in outputs}
        sizes = {one.references[0]: one.size for one in member.variables.values()}
        self.state_references = [(reference, sizes[reference]) for reference in member.structure.states]
        self.input_references = [(one.references[0], one.size) for one in self.inputs.values()]
        unknowns = [*member.structure.derivatives, *(one.references[0] for one in self.outputs.values())]
        self.unknowns = np.array(unknowns, np.uint32)
        self.rows = sum(sizes[int(one)] for one in self.unknowns)

    def along(self, references: Sequence[tuple[int, int]]) -> Vector:
        """Derivatives of all unknowns along each element of some knowns, as columns."""
        columns = [
            self.member.direction(self.unknowns, reference, seed, self.rows)
            for reference, size in references
            for seed in np.eye(size)
        ]
        return np.array(columns).T if columns else np.zeros((self.rows, 0))


class Jacobian:
    """Of all states' derivatives by all states; `move_to` brings the members to a point."""

    def __init__(
        self, members: Sequence[ExchangeMember], links: Sequence[Link], move_to: Callable[[float, Vector], None]
    ) -> None:
        flowing = [link for link in links if is_continuous(link)]
        self.parts, self.move_to = [Part(one, flowing) for one in members], move_to
        inputs = places((one.member.name, variable) for one in self.parts for variable in one.inputs.values())
        outputs = places((one.member.name, variable) for one in self.parts for variable in one.outputs.values())
        self.coupling = np.zeros((inputs[1], outputs[1]))
        for link in flowing:
            row = inputs[0][link.target.key] + link.target.first
            column = outputs[0][link.source.key] + link.source.first
            for i in range(link.target.size):
                self.coupling[row + i, column + i] = link.factor

    def __call__(self, t: float, y: Vector) -> Vector:
        """The Jacobian at a point."""
        self.move_to(t, y)
        by_state = [part.along(part.state_references) for part in self.parts]
        by_input = [part.along(part.input_references) for part in self.parts]
        counts = [len(part.member.states) for part in self.parts]
        a, c = (blocks(by_state, counts, below) for below in (False, True))
        if not self.coupling.size:
            return a
        b, d = (blocks(by_input, counts, below) for below in (False, True))
        reach = np.linalg.solve(np.eye(len(c)) - d @ self.coupling, c)
        whole: Vector = a + b @ self.coupling @ reach
        return whole


def places(variables: Any) -> tuple[dict[tuple[str, str], int], int]:
    """Where each variable's elements begin, and how many there are in all."""
    found, at = {}, 0
    for member, variable in variables:
        found[member, variable.name] = at
        at += variable.size
    return found, at


def blocks(parts: Sequence[Vector], counts: Sequence[int], below: bool) -> Vector:
    """A block-diagonal matrix of the rows above or below each part's number of states."""
    import scipy.linalg

    chosen = [part[count:] if below else part[:count] for part, count in zip(parts, counts, strict=True)]
    return np.asarray(scipy.linalg.block_diag(*chosen))
