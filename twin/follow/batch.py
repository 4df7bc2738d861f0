"""Copies of a model in one co-simulation: one call of the compiled loop steps the points of a filter, without Python per point."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling import MemoryRecorder, RecordMember, find, published_values
from twin.errors import SimulationError
from twin.run import build_simulation
from twin.scenario import Backend

if TYPE_CHECKING:
    from pathlib import Path

    from twin.follow.problem import FollowProblem

    Array = np.ndarray[Any, Any]


class Batch:
    """`count` copies of the model of a problem, initialized. Use it with `with`."""

    def __init__(self, problem: FollowProblem, count: int, build: Path) -> None:
        experiment = problem.experiment
        case = experiment.case
        self.case, self.count = case, count
        shared = {name for name in case.members if " " in name}  # recorded inputs

        def own(path: str, number: int) -> str:
            member, dot, variable = path.partition(".")
            return path if member in shared else f"{member}#{number}{dot}{variable}"

        numbers = range(count)
        members = {own(name, k): spec for name, spec in case.members.items() for k in numbers}
        connections = [
            replace(connection, source=own(connection.source, k), target=own(connection.target, k))
            for connection in case.connections
            for k in numbers
        ]
        events = [replace(event, variable=own(event.variable, k)) for event in case.events for k in numbers]
        self.case = replace(case, members=members, connections=tuple(connections), events=tuple(events), conditions=())
        self.catalog = {own(name, k): experiment.catalog[name] for name in case.members for k in numbers}
        self.simulation = build_simulation(self.case, self.catalog, Backend.compiled, build, MemoryRecorder(1 << 16))
        try:
            self.simulation.recorded = []
            self.simulation.initialize(case.start_ns)
            self._states = [[self._element(own(estimate.name, k)) for estimate in problem.estimates] for k in numbers]
            self._outputs = [[find(own(output.signal, k), self.catalog) for output in problem.outputs] for k in numbers]
            names = [name for name in case.members if name not in shared]
            self._memory = [[array for name in names for array in self._arrays(own(name, k))] for k in numbers]
            owners = dict.fromkeys(
                own(estimate.name, k).partition(".")[0] for estimate in problem.estimates for k in numbers
            )
            corrected = [self._record_member(name) for name in owners]
            self._continuous = [member for member in corrected if hasattr(type(member.component), "derivatives")]
        except BaseException:
            self.simulation.terminate()
            raise

    def _arrays(self, name: str) -> list[Array]:
        """Return all memory of a member: its record, and what it has published if that lies elsewhere."""
        return [self._record_member(name).component.record, *published_values(self.simulation, name)]

    def _record_member(self, name: str) -> RecordMember:
        member = self.simulation.members[name]
        assert isinstance(member, RecordMember)
        return member

    def _element(self, path: str) -> Array:
        """Return a view of one scalar of a member's record."""
        reference = find(path, self.catalog)
        values = self._record_member(reference.member).component.views[reference.variable.name]
        return values.reshape(-1)[reference.first : reference.first + 1]

    def read(self) -> Array:
        """Return the estimated variables of all copies, (count, n)."""
        return np.array([[view[0] for view in views] for views in self._states])

    def write(self, points: Array, *, share_memory: bool) -> None:
        """Set the estimated variables of all copies; `share_memory`: after all other memory of the first one was copied."""
        if share_memory:
            for arrays in self._memory[1:]:
                for array, first in zip(arrays, self._memory[0], strict=True):
                    array[...] = first
        for views, values in zip(self._states, points, strict=True):
            for view, value in zip(views, values, strict=True):
                view[0] = value
        t, flags = clock.seconds(self.simulation.time), np.zeros(4, np.int64)
        for member in self._continuous:
            member.try_step(t, 0.0, flags)  # sets outputs and derivatives of the corrected states
        self.simulation.watch.forget()

    def outputs(self, numbers: list[int]) -> Array:
        """Return measured signals of all copies, (count, m)."""
        return np.array([[self._value(references[number]) for number in numbers] for references in self._outputs])

    def _value(self, reference: Any) -> float:
        return float(self.simulation.value(reference.key).reshape(-1)[reference.first])

    def advance(self, tick: int) -> None:
        """Advance all copies to a communication step; SimulationError if one of them fails."""
        try:
            self.simulation.advance(self.case.start_ns + tick * self.case.step_ns)
        except SimulationError as error:
            raise SimulationError(
                f"a point of the filter cannot be simulated: {error} Give bounds (from, to) or a smaller deviation or walk."
            ) from error

    def close(self) -> None:
        """Free the members."""
        self.simulation.terminate()
