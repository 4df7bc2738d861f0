"""State of the variable-step master: tables as arrays, rollback memory, and their addresses in the loop's record."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling.bonds import find_power_pairs
from twin.coupling.execution import loop
from twin.coupling.execution.value_memory import bits
from twin.coupling.variable_step.coupling_jacobian import Coupling
from twin.coupling.variable_step.linear_equations import factorize
from twin.coupling.variable_step.record_layout import (
    BEGIN,
    COMPARED,
    DEPTH,
    DOUBLING,
    END,
    FEED,
    HELD,
    NEWTON,
    NOW,
    PAIR,
    PART,
    PREDICTED,
    REGION,
    RESIDUAL,
    SCALE,
    STAGE,
    STATE,
)

if TYPE_CHECKING:
    from twin.coupling.execution.loop_tables import Tables
    from twin.coupling.system import ResolvedConnection
    from twin.coupling.variable_step.stage_tables import Element, Stages

WORD = 8


def move_operations(stage: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the operations of a stage, except those that step."""
    return [stage[name] for name in ("links", "direct", "gets")]


def is_work(operation: dict[str, Any]) -> bool:
    """Whether an operation does anything."""
    return any(begin < end for begin, end in operation.values())


def floats(address: int, count: int) -> np.ndarray[Any, Any]:
    """Return a view of Float64 at an address."""
    return np.ctypeslib.as_array((ctypes.c_double * count).from_address(address))


class VariableStepState:
    """Tables, work vectors and rollback buffers of the variable-step master; must outlive the native loop."""

    def __init__(
        self, plan: Stages, tables: Tables, state: Any, step: clock.Time, corrected: list[ResolvedConnection]
    ) -> None:
        self.plan, self.algorithm, self.state = plan, plan.algorithm, state
        self.arrays: list[np.ndarray[Any, Any]] = []  # memory that the record points to
        self._operations(tables)
        self._options(step)
        self._elements({id(link) for link in corrected})
        if self.algorithm.control == RESIDUAL:
            self._bonds(corrected)
        if self.algorithm.rolls_back:
            self._allocate_rollback()
        plan.memory.blocks[:0] = plan.work_memory.blocks  # so that saving the plan's memory saves both

    def _array(self, name: str, rows: list[list[int]], columns: int) -> int:
        """Store rows as an array; write its address and length to the record if `name` is given; return the address."""
        array = np.array(rows, np.int64).reshape(len(rows), columns)
        self.arrays.append(array)
        if name:
            self.state[f"{name}s"], self.state[f"{name}_count"] = array.ctypes.data, len(array)
        return int(array.ctypes.data)

    def _operations(self, tables: Tables) -> None:
        plan, defaults = self.plan, {"divider": 1, "h": 0}
        inner = [operation for stage in plan.stages for operation in move_operations(stage)]
        parts = [operation for stage in plan.stages for _, operation, _, _ in stage["parts"]]
        plan.operations = [
            *plan.begins,
            *plan.ends,
            *({**defaults, **operation} for operation in (*inner, *parts, plan.feedback)),
        ]
        self.operations = plan.operation_rows(tables.arrays)
        base, size = int(self.operations.ctypes.data), WORD * len(loop.OPERATION)
        first = len(plan.begins) + len(plan.ends)
        self.state["feedback"] = base + size * (len(plan.operations) - 1)
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
            addresses = [
                base + size * (first + 3 * i + j) if j == 0 or is_work(operation) else 0
                for j, operation in enumerate(move_operations(stage))
            ]
            stages.append([*addresses, self._array("", rows, len(PART)), len(rows)])
        self._array("stage", stages, len(STAGE))

    def _options(self, step: clock.Time) -> None:
        state, algorithm = self.state, self.algorithm
        state["order"], state["smoothing"] = algorithm.order, algorithm.smoothing
        state["max_iterations"], state["scheme"], state["control"] = (
            algorithm.iterations,
            algorithm.scheme,
            algorithm.control,
        )
        state["trial"], state["strict"] = algorithm.rolls_back, algorithm.is_strict
        state["correction"] = algorithm.correction
        state["recalls"] = (
            algorithm.order > 0
            or algorithm.iterations > 0
            or algorithm.control in (PREDICTED, RESIDUAL)
            or (algorithm.correction > 0)
        )
        state["coupling_tolerance"], state["tolerance"], state["floor"] = (
            algorithm.agreement,
            algorithm.tolerance,
            algorithm.floor,
        )
        state["relaxation"] = 1.0
        state["derives"] = algorithm.iterations > 0 and algorithm.scheme == NEWTON
        state["tick_length"] = clock.seconds(step)
        state["divisions"] = state["stride"] = algorithm.divisions(step)
        if algorithm.control == RESIDUAL:
            state["stride"] = 1  # No error is known yet, and there is no rollback.
            state["next_step"] = state["tick_length"] / state["divisions"]
        state["least"] = (
            1 if algorithm.control != DOUBLING else min(2, algorithm.divisions(step))
        )  # A half step is made too.

    def _elements(self, corrected: set[int]) -> None:
        plan, state = self.plan, self.state
        state["elements"], state["vectors"], state["course"], state["past"] = (
            plan.count,
            plan.vectors,
            plan.course,
            plan.past,
        )
        state["weights"] = plan.weights
        every = plan.all_elements
        for name, chosen in (
            ("torn", [element for element in every if element.is_torn]),
            ("moving", [element for element in every if element.is_moving]),
            ("judged", [element for element in every if element.is_judged(self.algorithm.control == PREDICTED)]),
            ("bond", [element for element in every if element.is_torn and id(element.link) in corrected]),
        ):
            numbers = np.array([element.number for element in chosen], np.int64)
            self.arrays.append(numbers)
            state["bonds" if name == "bond" else name] = numbers.ctypes.data
            state[f"{name}_count"] = len(numbers)
        sizes = floats(plan.vectors, 5 * plan.count).reshape(5, plan.count)[SCALE]
        for element in every:
            for member, name in (element.link.source.key, element.link.target.key):
                sizes[element.number] = max(sizes[element.number], self.algorithm.scales.get(f"{member}.{name}", 0.0))
        m = int(state["torn_count"])
        anderson, newton = 2 * DEPTH * m + DEPTH * (DEPTH + 2), m * (m + 1)
        state["solver"] = plan.work_memory.take(WORD * (3 * m + max(anderson, newton)))

    def _bonds(self, links: list[ResolvedConnection]) -> None:
        """Add the rows of pairs whose product is a power, and allocate the energy through each bond."""
        plan, rows = self.plan, []
        every = [
            [pair for pair in own if id(pair[0]) in plan.fed and id(pair[1]) in plan.fed]
            for own in find_power_pairs(links)
        ]
        connected = [pairs for pairs in every if pairs]
        for pairs in connected:
            for there, back, size in pairs:
                for pair in zip(plan.fed[id(there)], plan.fed[id(back)], strict=True):
                    ends = [self._fed_and_received(element) for element in pair]
                    rows.append([*ends[0], *ends[1], bits(size), 0])
            rows[-1][-1] = 1
        self._array("pair", rows, len(PAIR))
        self.state["energies"] = plan.work_memory.take(2 * WORD * max(1, len(connected)))
        if not connected:
            self.state["stride"] = self.state["divisions"]
            self.state["next_step"] = self.state["tick_length"]

    def _fed_and_received(self, element: Element) -> tuple[int, int]:
        """Return the addresses of the fed value and of the connection's value, both at the end of the step."""
        fed = BEGIN if element.source == HELD else COMPARED
        at = self.plan.vectors + WORD * element.number
        return at + WORD * fed * self.plan.count, at

    def _allocate_rollback(self) -> None:
        """Add the rows that save and restore all memory that a step changes."""
        plan = self.plan
        slots = 2 if self.algorithm.iterations and self.algorithm.control == DOUBLING else 1
        regions = [(int(block.ctypes.data), len(block)) for block in plan.memory.blocks[:-1]]
        regions.append((int(plan.memory.blocks[-1].ctypes.data), plan.memory.used))
        regions.append((plan.course, 4 * plan.count + 3))
        states = []
        for index, (name, member) in enumerate(plan.members.items()):
            if name in plan.slow:
                continue
            access = member.state_access(slots)
            if access.words:
                regions.append((access.address, access.words))
            else:
                states.append(
                    [
                        access.get,
                        access.set,
                        member.instance,
                        access.pointer_addresses[0],
                        access.pointer_addresses[-1],
                        index,
                    ]
                )
        if plan.objects is not None and plan.objects.links:
            access = plan.objects.state_access(slots)
            states.append([access.get, access.set, 0, access.pointer_addresses[0], access.pointer_addresses[-1], 0])
        rows = []
        for address, words in regions:
            first = plan.work_memory.take(WORD * words)
            rows.append([address, words, first, plan.work_memory.take(WORD * words) if slots > 1 else first])
        self._array("region", rows, len(REGION))
        self._array("state", states, len(STATE))

    def derive(self) -> None:
        """Factorize the matrix of Newton's method for the step in progress; fall back to differences if that fails."""
        state, m = self.state, int(self.state["torn_count"])
        jacobian = Coupling(self.plan).jacobian(float(state["step_begin"]), float(state["span"]))
        matrix = int(state["solver"]) + 3 * WORD * m
        if jacobian is not None:
            floats(matrix, m * m)[:] = (np.eye(m) - jacobian).reshape(-1)
            if factorize(matrix, matrix + WORD * m * m, m) == 0:
                state["jacobian"], state["linear_at"] = 1, state["span"]
                return
        state["derives"] = 0

    def disagreements(self) -> list[str]:
        """Return the inputs whose guesses differ from their sources by more than the tolerance, the worst first."""
        n = self.plan.count
        vectors = floats(self.plan.vectors, 5 * n).reshape(5, n)
        size = np.maximum(np.maximum(vectors[SCALE], abs(vectors[NOW])), self.algorithm.floor)
        ratio = abs(vectors[NOW] - vectors[END]) / size / self.algorithm.agreement
        ratios = {
            f"{element.link.target.member}.{element.link.target.variable.name}": ratio[element.number]
            for element in self.plan.all_elements
            if element.is_torn and not ratio[element.number] <= 1.0
        }
        return sorted(ratios, key=lambda name: -ratios[name])

    def forget(self) -> None:
        """Discard earlier points: after a change from outside they are no basis for extrapolation."""
        ctypes.memset(self.plan.past, 0, 3 * WORD)
