"""Values along the connections between members that are integrated together, at every evaluation of their equations.

Sources follow inputs at once where members have direct feedthrough: they are read in that order. Where they follow each
other in an algebraic loop, the loop is solved by Newton's method.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.coupling import FixedPoint, ResolvedConnection, direct_followers
from twin.errors import SimulationError
from twin.graph import ordered_groups

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.fmi.importing.local_state import VariableSlot
    from twin.fmi.model_exchange.model_exchange_member import ExchangeMember

Vector = np.ndarray[Any, Any]

TOLERANCE = 1e-12  # relative change of the values of an algebraic loop at which it counts as solved
ITERATIONS = 20
SMALLEST = 1e-3  # magnitude below which the steps of the Jacobian's differences are not reduced further
RENEWAL = 4  # iterations for which a Jacobian is used


@dataclass(slots=True)
class SlotOverrides:
    """What others see of a variable instead of its values: by element, or all of it (None)."""

    values: dict[int | None, Any] = field(default_factory=dict)

    def put(self, values: Vector) -> None:
        """Replace values by the overrides."""
        for element, value in self.values.items():
            if element is None:
                values[:] = np.ravel(value)
            else:
                values[element] = value


@dataclass(frozen=True, slots=True)
class SlotTarget:
    """Target of a connection: `part` of the source's values is converted and written to `target_slice` of an input."""

    member: ExchangeMember
    slot: VariableSlot
    part: slice
    target_slice: slice
    factor: float
    offset: float
    overrides: SlotOverrides

    def take(self, values: Vector) -> bool:
        """Take the source's values, and set them in the FMU if they changed; return whether they did."""
        given = values[self.part]
        if (self.factor, self.offset) != (1.0, 0.0):
            given = given * self.factor + self.offset
        values, applied = self.slot.values, self.slot.applied
        values[self.target_slice] = given
        self.overrides.put(values)
        if values.tobytes() == applied.tobytes():
            return False
        applied[:] = values
        self.member.move(self.slot)
        return True


@dataclass(frozen=True, slots=True)
class SlotSource:
    """A variable that others of the system read."""

    member: ExchangeMember
    slot: VariableSlot
    targets: tuple[SlotTarget, ...]
    overrides: SlotOverrides

    def read(self) -> Vector:
        """Its values."""
        self.member.move(self.slot)
        return self.slot.values

    def give(self, values: Vector) -> bool:
        """Write values to all targets; return whether a target's value changed."""
        if self.overrides.values:
            values = values.copy()
            self.overrides.put(values)
        taken = [target.take(values) for target in self.targets]
        return any(taken)

    def move(self) -> bool:
        """Copy the values from the source to all targets."""
        return self.give(self.read())


class AlgebraicLoop:
    """Algebraic loop of sources: their values x fulfill G(x) = x."""

    def __init__(self, sources: Sequence[SlotSource]) -> None:
        self.sources = sources
        self.names = ", ".join(f"{source.member.name}.{source.slot.variable.name}" for source in sources)
        self.equation = FixedPoint(self.evaluate, TOLERANCE, ITERATIONS, SMALLEST, RENEWAL)

    def evaluate(self, x: Vector) -> Vector:
        """Evaluate G(x): the sources' values if they were x."""
        at = 0
        for source in self.sources:
            source.give(x[at : at + len(source.slot.values)])
            at += len(source.slot.values)
        return self.read()

    def read(self) -> Vector:
        """The sources' values, flat."""
        return np.concatenate([source.read() for source in self.sources])

    def move(self) -> bool:
        """Solve G(x) = x from the present values; return whether they changed."""
        before = self.read()
        solution = self.equation.solve(before)
        if solution is None:
            raise SimulationError(
                f"the algebraic loop through {self.names} has no solution that could be found. "
                "Break it with a sampled component, or give other start values."
            )
        return not np.array_equal(before, solution[0])


class Couplings:
    """All connections inside of a system: those of continuous values in order, and the others."""

    def __init__(self, members: Sequence[ExchangeMember], links: Sequence[ResolvedConnection]) -> None:
        self.members = {member.name: member for member in members}
        self.links = links
        self.overrides: dict[tuple[str, str], SlotOverrides] = {}
        flowing = [link for link in links if is_continuous(link)]
        catalog = {member.name: member.variables for member in members}
        followers = direct_followers(flowing, catalog)
        self.order: list[SlotSource | AlgebraicLoop] = []
        for keys in ordered_groups(list(followers), followers):
            sources = [self._source(key, flowing) for key in keys]
            is_loop = len(keys) > 1 or keys[0] in followers[keys[0]]
            self.order.append(AlgebraicLoop(sources) if is_loop else sources[0])
        held = [link for link in links if not is_continuous(link)]
        self.held = [self._source(key, held) for key in dict.fromkeys(link.source.key for link in held)]

    def _source(self, key: tuple[str, str], links: Sequence[ResolvedConnection]) -> SlotSource:
        member = self.members[key[0]]
        targets = tuple(self._target(link) for link in links if link.source.key == key)
        return SlotSource(member, member.slot(key[1]), targets, self.overrides.setdefault(key, SlotOverrides()))

    def _target(self, link: ResolvedConnection) -> SlotTarget:
        source, target = link.source, link.target
        member = self.members[target.member]
        slot = member.slot(target.variable.name)
        slot.is_driven = target.size == target.variable.size
        return SlotTarget(
            member,
            slot,
            slice(source.first, source.first + source.size),
            slice(target.first, target.first + target.size),
            link.factor,
            link.offset,
            self.overrides.setdefault(target.key, SlotOverrides()),
        )

    def override(self, key: tuple[str, str], value: Any, element: int | None) -> None:
        """Let others see a value instead of a variable's own; None: no longer."""
        if key in self.overrides:
            overridden = self.overrides[key].values
            overridden.pop(element, None)
            if value is not None:
                overridden[element] = value

    def move(self) -> None:
        """Continuous values, at any point."""
        for function in self.order:
            function.move()

    def move_all(self) -> bool:
        """Move all values, in Event Mode; return whether one has changed."""
        moved = [function.move() for function in (*self.held, *self.order)]
        return any(moved)


def is_continuous(link: ResolvedConnection) -> bool:
    """Whether a connection's values change between events."""
    ends = link.source.variable, link.target.variable
    return all(end.variability == "continuous" and end.dtype.kind == "f" for end in ends)
