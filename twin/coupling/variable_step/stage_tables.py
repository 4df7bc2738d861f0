"""Tables of the variable-step master: the loop's plan, split into moving, feeding and stepping."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.coupling.execution.plan import LoopPlan
from twin.coupling.execution.value_memory import ValueMemory, kind
from twin.coupling.system import feeds, is_real
from twin.coupling.variable_step import input_extrapolation, record_layout
from twin.coupling.variable_step.record_layout import (
    ARRIVED,
    EXTRAPOLATED,
    FINAL,
    FIRST,
    GUESSED,
    HELD,
    MEAN,
    SHARE,
    SLOPE,
    TO_ARRIVED,
    TO_GUESS,
    VALUE,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from twin.coupling.algorithms import Algorithm
    from twin.coupling.execution.plan import Key
    from twin.coupling.system import ResolvedConnection

FLOAT = 8  # byte
VECTORS, COURSES = 5, 4  # Float64 per element in its two memories
UNIFORM = ((MEAN, 0.0, 1.0),)  # uses of a polynomial: which value, begin and length of the part of the step
SPLIT = ((FIRST, 0.0, 1.0 - SHARE), (FINAL, 1.0 - SHARE, SHARE))
WITH_SLOPES = ((VALUE, 0.0, 1.0),)


@dataclass
class Element:
    """Scalar of a connection to a member with variable steps. `number`: index; `source`: kind of value that it is fed."""

    number: int
    source: int
    is_torn: bool  # whether its source is stepped later in a sweep (feedback)
    is_moving: bool  # whether it changes within a tick
    link: ResolvedConnection

    @property
    def is_continuous(self) -> bool:
        """Whether it is continuous between two points: both ends are continuous and it is not declared to be held."""
        ends = self.link.source, self.link.target
        return not self.link.hold and all(end.variable.variability == "continuous" for end in ends)

    def is_judged(self, predicted: bool) -> bool:
        """Whether its error controls the length of steps: it must be continuous and, if `predicted`, torn."""
        return self.is_moving and self.is_continuous and (self.is_torn or not predicted)


@dataclass
class Stages(LoopPlan):
    """Plan in which members without their own period make variable steps."""

    algorithm: Algorithm = field(kw_only=True)
    slow: frozenset[str] = frozenset()
    work_memory: ValueMemory = field(default_factory=ValueMemory)  # memory of the variable-step master
    begins: list[dict[str, Any]] = field(default_factory=list)
    ends: list[dict[str, Any]] = field(default_factory=list)
    stages: list[dict[str, Any]] = field(default_factory=list)
    arrays: list[np.ndarray[Any, Any]] = field(default_factory=list)  # memory that calls point to
    fed: dict[int, list[Element]] = field(default_factory=dict)  # by the identity of their links
    direct_rows: dict[Key, list[tuple[str, int]]] = field(default_factory=dict)  # see `rows_at_events`

    def __post_init__(self) -> None:
        periodic = (name for name, m in self.members.items() if m.period_ns or self.divider(name) > 1)
        self.slow = frozenset(periodic)

    def is_read_directly(self, member: str) -> bool:
        """Whether other members read the memory of a record; a sampled member publishes when it is due."""
        return member not in self.slow

    @property
    def all_elements(self) -> list[Element]:
        """All elements, by number."""
        return [element for elements in self.fed.values() for element in elements]

    def build(
        self, order: list[list[str]], links: list[ResolvedConnection], recorded: list[Key], watched: Iterable[Key] = ()
    ) -> None:
        """Fill the tables."""
        stage_index = {name: i for i, stage in enumerate(order) for name in stage}
        count = 0
        for link in links:
            if link.target.member in self.slow or not is_real(link.target.variable):
                continue
            elements = [self._element(count + j, link, stage_index) for j in range(link.target.size)]
            self.fed[id(link)] = elements
            count += len(elements)
        self.count = count
        self.vectors = self.work_memory.take(FLOAT * VECTORS * count)
        self.course = self.work_memory.take(FLOAT * COURSES * count + FLOAT * record_layout.PAST)
        self.past = self.course + FLOAT * COURSES * count
        self.weights = self.work_memory.take(2 * input_extrapolation.CATEGORY + 6 * FLOAT)
        self.memory.take(FLOAT)  # Allocates the first block; others are inserted in front of it later.
        super().build(order, links, recorded, watched)
        self.feedback = self._moves(
            [link for link in links if any(element.is_torn for element in self.fed.get(id(link), ()))]
        )

    def _element(self, number: int, link: ResolvedConnection, stage_index: dict[str, int]) -> Element:
        """Create the element of one scalar of a connection."""
        source, target = link.source, link.target
        element = Element(number, HELD, is_torn=False, is_moving=source.member not in self.slow, link=link)
        if not element.is_moving:
            return element
        element.is_torn = stage_index[source.member] >= stage_index[target.member]
        smooth = element.is_continuous and self.algorithm.order > 0
        if not element.is_torn:
            element.source = TO_ARRIVED if smooth else ARRIVED
        elif self.algorithm.iterations:
            element.source = TO_GUESS if smooth else GUESSED
        elif smooth:
            element.source = EXTRAPOLATED
        return element

    def _events(self) -> None:
        """Add separate rows for members with clocks: at an event values are copied, not extrapolated."""
        for link in self.events.links if self.events is not None else ():
            if id(link) in self.fed:
                counts = len(self.copies), len(self.converts)
                first = link.source.first * link.source.variable.dtype.itemsize
                self._move(link, self.published[link.source.key] + first, self._staged(link, 0))
                row = ("copies", counts[0]) if len(self.copies) > counts[0] else ("converts", counts[1])
                self.direct_rows.setdefault(link.target.key, []).append(row)

    def stepping_operations(self) -> list[dict[str, Any]]:
        """Return the operations that may step members."""
        return [*self.begins, *(operation for stage in self.stages for _, operation, *_ in stage["parts"])]

    def rows_at_events(self, key: Key) -> list[tuple[str, int]]:
        """Return the rows that copy directly, if there are any."""
        return self.direct_rows.get(key) or super().rows_at_events(key)

    def _stage(self, stage: list[str], links: list[ResolvedConnection]) -> None:
        """Add members with their own period at its begin and end, the others to a stage with variable steps."""
        for divider in sorted({self.divider(name) for name in stage if name in self.slow}):
            names = [name for name in stage if name in self.slow and self.divider(name) == divider]
            inputs, steps, *publish = self._slot(
                divider, names, [link for link in links if link.target.member in names]
            )
            self.begins += [{**inputs, "steps": steps["steps"]}]
            self.ends += publish
        if names := [name for name in stage if name not in self.slow]:
            self.stages.append(self._quick(names, [link for link in links if link.target.member in names]))

    def _quick(self, names: list[str], links: list[ResolvedConnection]) -> dict[str, Any]:
        """Return a stage with variable steps."""
        moves = self._moves([link for link in links if id(link) in self.fed])
        direct = self._moves([link for link in links if id(link) not in self.fed])
        parts = []
        for uses, chosen in self._parts(names, links).items():
            sets, derivative_rows = len(self.accesses), []
            for name in chosen:
                self.accesses += [list(row) for row in self.sets[name]]
                if uses is WITH_SLOPES:
                    call, rows = self._slopes(name, links)
                    self.accesses.append(call)
                    derivative_rows += rows
            steps, order = len(self.steps), list(self.members)
            for name in chosen:
                member = self.members[name]
                self.steps.append(self._step(member, order.index(name)))
            operation = {"accesses": (sets, len(self.accesses)), "steps": (steps, len(self.steps))}
            inputs = [link for link in links if link.target.member in chosen and id(link) in self.fed]
            parts += [
                ([*self._feeds(inputs, use), *derivative_rows], operation, begin, length) for use, begin, length in uses
            ]
        gets, publishes, converts = len(self.accesses), len(self.copies), len(self.converts)
        self.accesses += [row for name in names for row in self.gets[name]]
        for key in (key for key in self.unsplit if key[0] in names):
            self._split(key)
        publication = {
            "accesses": (gets, len(self.accesses)),
            "copies": (publishes, len(self.copies)),
            "converts": (converts, len(self.converts)),
        }
        return {"links": moves, "direct": direct, "gets": publication, "parts": parts}

    def _moves(self, links: list[ResolvedConnection]) -> dict[str, Any]:
        """Add the rows of connections: to the elements, or directly to the staged inputs."""
        copies, converts = len(self.copies), len(self.converts)
        for link in links:
            source = self.published[link.source.key] + link.source.first * link.source.variable.dtype.itemsize
            if id(link) in self.fed:
                self._move(link, source, self.vectors + FLOAT * self.fed[id(link)][0].number, np.dtype(np.float64))
            else:
                self._move(link, source, self._staged(link, 0))
        return {"copies": (copies, len(self.copies)), "converts": (converts, len(self.converts))}

    def _staged(self, link: ResolvedConnection, j: int) -> int:
        return self.staged[link.target.key] + (link.target.first + j) * link.target.variable.dtype.itemsize

    def _parts(
        self, names: list[str], links: list[ResolvedConnection]
    ) -> dict[tuple[tuple[int, float, float], ...], list[str]]:
        """Group members by the way they receive extrapolated inputs."""
        groups: dict[tuple[tuple[int, float, float], ...], list[str]] = {}
        for name in names:
            fed = [link for link in links if link.target.member == name and self._is_course(link)]
            outputs = [v for v in self.members[name].variables.values() if v.causality == "output"]
            has_feedthrough = any(feeds(link, output) for link in fed for output in outputs)
            takes = bool(fed) and self.members[name].input_derivatives() != 0
            groups.setdefault(WITH_SLOPES if takes else SPLIT if has_feedthrough else UNIFORM, []).append(name)
        return groups

    def _is_course(self, link: ResolvedConnection) -> bool:
        elements = self.fed.get(id(link), [])
        return bool(elements) and elements[0].source in (EXTRAPOLATED, TO_GUESS, TO_ARRIVED)

    def _slopes(self, name: str, links: list[ResolvedConnection]) -> tuple[list[int], list[list[int]]]:
        """Return the call that sets a member's input derivatives, and the rows that compute them."""
        references: list[int] = []
        orders: list[int] = []
        fed = []
        for link in (
            candidate for candidate in links if candidate.target.member == name and self._is_course(candidate)
        ):
            variable, first = link.target.variable, link.target.first
            every = variable.references if len(variable.references) > 1 else variable.references * variable.size
            for j, element in enumerate(self.fed[id(link)]):
                for order in range(1, self.algorithm.order + 1):
                    references.append(every[first + j])
                    orders.append(order)
                    fed.append((element, SLOPE + order - 1))
        values = self.memory.take(FLOAT * len(fed))
        rows = [
            [*self._addresses(element), element.source, self._weights(element, use), values + FLOAT * i, 0]
            for i, (element, use) in enumerate(fed)
        ]
        arrays = np.array(references, np.uint32), np.array(orders, np.int32)
        self.arrays += arrays
        member = self.members[name]
        function = member.input_derivatives()
        self.functions[function] = "fmi2SetRealInputDerivatives"
        addresses = [int(array.ctypes.data) for array in arrays]
        index = list(self.members).index(name)
        return [function, member.instance, addresses[0], len(fed), addresses[1], values, index], rows

    def _feeds(self, links: list[ResolvedConnection], use: int) -> list[list[int]]:
        """Return the rows that write the values of elements to the staged inputs."""
        rows = []
        for link in links:
            for j, element in enumerate(self.fed[id(link)]):
                row = [*self._addresses(element), element.source, self._weights(element, use), self._staged(link, j)]
                rows.append([*row, kind(link.target.variable.dtype)])
        return rows

    def _weights(self, element: Element, use: int) -> int:
        category = input_extrapolation.CATEGORY if element.source in (TO_GUESS, TO_ARRIVED) else 0
        return self.weights + category + use * input_extrapolation.USE

    def _addresses(self, element: Element) -> list[int]:
        return [self.vectors + FLOAT * element.number, self.course + FLOAT * element.number]
