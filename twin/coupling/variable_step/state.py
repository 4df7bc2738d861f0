"""The tables of the walk as arrays, the memory for going back, and the loop's record told of both."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling.bonds import powers
from twin.coupling.execution import loop
from twin.coupling.execution.plan import bits
from twin.coupling.variable_step.coupling_jacobian import Coupling
from twin.coupling.variable_step.linear_equations import factorize
from twin.coupling.variable_step.record_layout import (
    BEGIN,
    DEPTH,
    DOUBLING,
    END,
    FEED,
    FIXED,
    HELD,
    KEEP,
    NEWTON,
    NOW,
    PAIR,
    PART,
    PREDICTED,
    RESIDUAL,
    SCALE,
    SEEN,
    STAGE,
    STATE,
)

if TYPE_CHECKING:
    from twin.coupling.execution.loop_tables import Tables
    from twin.coupling.system import Link
    from twin.coupling.variable_step.stage_tables import Element, Stages

WORD = 8


def ops(stage: dict[str, Any]) -> list[dict[str, Any]]:
    """The operations of a stage beside those that step."""
    return [stage[name] for name in ("links", "direct", "gets")]


def is_work(operation: dict[str, Any]) -> bool:
    """Whether an operation does anything."""
    return any(begin < end for begin, end in operation.values())


def floats(address: int, count: int) -> np.ndarray[Any, Any]:
    """Float64 where they lie."""
    return np.ctypeslib.as_array((ctypes.c_double * count).from_address(address))


class Walk:
    """What the walk of a plan needs beside the loop's tables, kept as long as it runs."""

    def __init__(self, plan: Stages, tables: Tables, state: Any, step: clock.Time, corrected: list[Link]) -> None:
        self.plan, self.algorithm, self.state = plan, plan.algorithm, state
        self.kept: list[np.ndarray[Any, Any]] = []  # arrays that are pointed into
        self._operations(tables)
        self._options(step)
        self._elements({id(link) for link in corrected})
        if self.algorithm.control == RESIDUAL:
            self._bonds(corrected)
        if self.algorithm.rolls_back:
            self._way_back()
        plan.memory.blocks[:0] = plan.own.blocks  # so that who saves one saves both

    def _array(self, name: str, rows: list[list[int]], columns: int) -> int:
        """Rows as an array; tells its address and, where there is such a field, their number."""
        made = np.array(rows, np.int64).reshape(len(rows), columns)
        self.kept.append(made)
        if name:
            self.state[f"{name}s"], self.state[f"{name}_count"] = made.ctypes.data, len(made)
        return int(made.ctypes.data)

    def _operations(self, tables: Tables) -> None:
        plan, plain = self.plan, {"divider": 1, "h": 0}
        inner = [one for stage in plan.stages for one in ops(stage)]
        parts = [operation for stage in plan.stages for _, operation, _, _ in stage["parts"]]
        plan.operations = [*plan.begins, *plan.ends, *({**plain, **one} for one in (*inner, *parts, plan.leading_back))]
        self.operations = plan.operation_rows(tables.arrays)
        base, size = int(self.operations.ctypes.data), WORD * len(loop.OPERATION)
        first = len(plan.begins) + len(plan.ends)
        self.state["leading_back"] = base + size * (len(plan.operations) - 1)
        self.state["begins"], self.state["begin_count"] = base, len(plan.begins)
        self.state["ends"], self.state["end_count"] = base + size * len(plan.begins), len(plan.ends)
        stages, at = [], first + len(inner)
        for i, stage in enumerate(plan.stages):
            rows = []
            for feeds, _, begin, length in stage["parts"]:
                rows.append(
                    [self._array("", feeds, len(FEED)), len(feeds), base + size * at, bits(begin), bits(length)]
                )
                at += 1
            own = [
                base + size * (first + 3 * i + j) if j == 0 or is_work(one) else 0 for j, one in enumerate(ops(stage))
            ]
            stages.append([*own, self._array("", rows, len(PART)), len(rows)])
        self._array("stage", stages, len(STAGE))

    def _options(self, step: clock.Time) -> None:
        state, algorithm = self.state, self.algorithm
        state["order"], state["smoothing"] = algorithm.order, algorithm.smoothing
        state["most"], state["scheme"], state["control"] = algorithm.iterations, algorithm.scheme, algorithm.control
        state["trial"], state["strict"] = algorithm.rolls_back, algorithm.is_strict
        state["correction"] = algorithm.correction
        state["recalls"] = (
            algorithm.order > 0
            or algorithm.iterations > 0
            or algorithm.control in (PREDICTED, RESIDUAL)
            or (algorithm.correction > 0)
        )
        state["agreement"], state["tolerance"], state["floor"] = (
            algorithm.agreement,
            algorithm.tolerance,
            algorithm.floor,
        )
        state["relaxation"] = 1.0
        state["derives"] = algorithm.iterations > 0 and algorithm.scheme == NEWTON
        state["whole"] = clock.seconds(step)
        state["divisions"] = state["stride"] = algorithm.divisions(step)
        if algorithm.control == RESIDUAL:
            state["stride"] = 1  # nothing is known yet, and nothing is taken back
            state["wish"] = state["whole"] / state["divisions"]
        state["least"] = 1 if algorithm.control != DOUBLING else min(2, algorithm.divisions(step))  # a half, too

    def _elements(self, corrected: set[int]) -> None:
        plan, state = self.plan, self.state
        state["elements"], state["vectors"], state["course"], state["past"] = (
            plan.count,
            plan.vectors,
            plan.course,
            plan.past,
        )
        state["weights"] = plan.weights
        every = plan.every
        for name, chosen in (
            ("torn", [one for one in every if one.is_torn]),
            ("moving", [one for one in every if one.is_moving]),
            ("judged", [one for one in every if one.is_judged(self.algorithm.control == PREDICTED)]),
            ("bond", [one for one in every if one.is_torn and id(one.link) in corrected]),
        ):
            made = np.array([one.number for one in chosen], np.int64)
            self.kept.append(made)
            state["bonds" if name == "bond" else name] = made.ctypes.data
            state[f"{name}_count"] = len(made)
        sizes = floats(plan.vectors, 5 * plan.count).reshape(5, plan.count)[SCALE]
        for one in every:
            for member, name in (one.link.source.key, one.link.target.key):
                sizes[one.number] = max(sizes[one.number], self.algorithm.scales.get(f"{member}.{name}", 0.0))
        m = int(state["torn_count"])
        state["solver"] = plan.own.take(WORD * ((3 + 2 * DEPTH + 1) * m + m * m + DEPTH * (DEPTH + 2)))

    def _bonds(self, links: list[Link]) -> None:
        """Rows of what powers are made of, and room for the energy that went through each bond."""
        plan, rows = self.plan, []
        every = [[one for one in own if id(one[0]) in plan.fed and id(one[1]) in plan.fed] for own in powers(links)]
        told = [own for own in every if own]
        for own in told:
            for there, back, size in own:
                for pair in zip(plan.fed[id(there)], plan.fed[id(back)], strict=True):
                    ends = [self._fed_and_came(one) for one in pair]
                    rows.append([*ends[0], *ends[1], bits(size), 0])
            rows[-1][-1] = 1
        self._array("pair", rows, len(PAIR))
        self.state["energies"] = plan.own.take(2 * WORD * max(1, len(told)))
        if not told:
            self.state["stride"] = self.state["divisions"]
            self.state["wish"] = self.state["whole"]

    def _fed_and_came(self, element: Element) -> tuple[int, int]:
        """Where the end of the course lies that an input was fed, and what its connection gave at the end of the step."""
        fed = BEGIN if element.source == HELD else SEEN
        at = self.plan.vectors + WORD * element.number
        return at + WORD * fed * self.plan.count, at

    def _way_back(self) -> None:
        """Rows that keep all that a step changes, and bring it back."""
        plan = self.plan
        slots = 2 if self.algorithm.iterations and self.algorithm.control == DOUBLING else 1
        regions = [(int(one.ctypes.data), len(one)) for one in plan.memory.blocks[:-1]]
        regions.append((int(plan.memory.blocks[-1].ctypes.data), plan.memory.used))
        regions.append((plan.course, 4 * plan.count + 3))
        states = []
        for index, (name, member) in enumerate(plan.members.items()):
            if name in plan.slow:
                continue
            way = member.way(slots)
            if way.words:
                regions.append((way.address, way.words))
            else:
                states.append([way.get, way.set, member.instance, way.places[0], way.places[-1], index])
        if plan.objects is not None and plan.objects.links:
            way = plan.objects.way(slots)
            states.append([way.get, way.set, 0, way.places[0], way.places[-1], 0])
        keeps = []
        for address, words in regions:
            first = plan.own.take(WORD * words)
            keeps.append([address, words, first, plan.own.take(WORD * words) if slots > 1 else first])
        self._array("keep", keeps, len(KEEP))
        self._array("state", states, len(STATE))

    def derive(self) -> None:
        """Give Newton's method the factors of its matrix for the step that is at work; differences if none can be told."""
        state, m = self.state, int(self.state["torn_count"])
        found = Coupling(self.plan).jacobian(float(state["begun"]), float(state["span"]))
        matrix = int(state["solver"]) + 3 * WORD * m
        if found is not None:
            floats(matrix, m * m)[:] = (np.eye(m) - found).reshape(-1)
            if factorize(matrix, matrix + WORD * m * m, m) == 0:
                state["jacobian"], state["linear_at"] = 1, state["span"]
                return
        state["derives"] = 0

    def apart(self) -> list[str]:
        """Inputs whose guesses are not what their sources gave, the farthest first."""
        n = self.plan.count
        vectors = floats(self.plan.vectors, 5 * n).reshape(5, n)
        size = np.maximum(np.maximum(vectors[SCALE], abs(vectors[NOW])), self.algorithm.floor)
        ratio = abs(vectors[NOW] - vectors[END]) / size / self.algorithm.agreement
        found = {
            f"{one.link.target.member}.{one.link.target.variable.name}": ratio[one.number]
            for one in self.plan.every
            if one.is_torn and not ratio[one.number] <= 1.0
        }
        return sorted(found, key=lambda name: -found[name])

    def forget(self) -> None:
        """Something was set from outside: what was before it tells nothing of what follows."""
        ctypes.memset(self.plan.past, 0, 3 * WORD)

    @property
    def is_fixed(self) -> bool:
        """Whether every step is a tick."""
        return self.algorithm.control == FIXED
