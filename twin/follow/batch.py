"""Copies of a model in one co-simulation: one call of the compiled loop steps the points of a filter, without Python per point.

The records of a copy lie side by side in one row of an array, so that a copy takes over the memory of another one at once.
A third-party FMU has an instance for each copy, whose states are copied by FMI's functions; parameters that are set in it
have a buffer in the row of its copy.
"""

from __future__ import annotations

import re
import weakref
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.coupling import (
    LOOP_FIELDS,
    Access,
    CoSimulation,
    MemberVariable,
    MemoryRecorder,
    RecordMember,
    Reference,
    StateTransfer,
    Transfer,
    find,
    published_address,
    published_copies,
)
from twin.errors import SimulationError
from twin.follow.fmu_states import FmuRestarts, FmuStates, StateSlot, access_row, is_settable
from twin.follow.influence import shared_by_copies
from twin.run import build_simulation
from twin.scenario import Backend

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from twin.arrays import Array
    from twin.follow.problem import FollowProblem

NEVER = 1 << 62  # communication points between two rows: nothing is recorded
LINE = 64  # size of a cache line [byte]: no two copies share one


@dataclass(frozen=True)
class SavedBatch:
    """Memory of a batch at a communication step, for `Batch.restore` of the same batch."""

    records: Array
    blocks: tuple[Array, ...]
    shared: Mapping[str, Any]
    fields: Mapping[str, int | float]
    states: StateSlot  # of the FMUs


class Batch:
    """`count` copies of the model of a problem, initialized. Use it with `with`.

    `parameters`: further variables to write, beside the estimates, by `set_parameters`. `signals`: those to read by `outputs`;
    by default the measured ones. `interval`: longest time between two moments in which all copies have the same memory except the
    estimates [communication steps]; members on which nothing depends within it are not copied (`shared_by_copies`).
    """

    def __init__(
        self,
        problem: FollowProblem,
        count: int,
        build: Path,
        parameters: Sequence[str] = (),
        signals: Sequence[str] | None = None,
        interval: float = inf,
    ) -> None:
        self.problem, self.count, self._build = problem, count, build
        self._accesses: list[Access] = []  # whose references the loop reads
        case = problem.experiment.case
        self._signals = [output.signal for output in problem.outputs] if signals is None else list(signals)
        self.shared = shared_by_copies(problem, interval, parameters, self._signals)
        self._names = [name for name in case.members if name not in self.shared]
        numbers = range(count)
        members = {self._own(name, k): replace(s, finite=False) for name, s in case.members.items() for k in numbers}
        connections = [
            replace(connection, source=self._own(connection.source, k), target=self._own(connection.target, k))
            for connection in case.connections
            for k in numbers
            if k == 0 or connection.target.partition(".")[0] not in self.shared
        ]
        events = [replace(event, variable=self._own(event.variable, k)) for event in case.events for k in numbers]
        self.case = replace(
            case, members=members, connections=tuple(connections), events=tuple(events), threads=1, conditions=()
        )
        self.catalog = {self._own(name, k): problem.experiment.catalog[name] for name in case.members for k in numbers}
        self.simulation: CoSimulation = build_simulation(
            self.case, self.catalog, Backend.compiled, build, MemoryRecorder(1 << 16)
        )
        try:
            self._set_in_fmus = self._fmu_variables([*(estimate.name for estimate in problem.estimates), *parameters])
            self._arrange_records()
            keys = [find(self._own(signal, k), self.catalog).key for signal in self._signals for k in numbers]
            self.simulation.recorded = list(dict.fromkeys(keys))  # published when due, also of a longer period
            self.simulation.initialize(case.start_ns)
            self.simulation.state["every"] = NEVER
            self._fmus = FmuStates(self.simulation, build)
            if count > 1:
                self._fmus.verify((self._own(name, 0), self._own(name, 1)) for name in self._names)
            restarted = [self._own(name, k) for name in self._names if name in self._restarted for k in range(count)]
            self._restarts = FmuRestarts(self.simulation, build, restarted, self._buffers)
            self._build_transfers([estimate.name for estimate in problem.estimates], self._signals, parameters)
        except BaseException:
            self.simulation.terminate()
            raise

    def _own(self, path: str, number: int) -> str:
        """Return a variable or member of a copy; some members are shared."""
        member, dot, variable = path.partition(".")
        return path if member in self.shared else f"{member}#{number}{dot}{variable}"

    def _fmu_variables(self, paths: Sequence[str]) -> dict[tuple[str, str], int]:
        """Return the variables of FMUs, by member without number, that are set, with their size [byte]; and all states if need be."""
        from twin.fmi import FMUMember, continuous_states

        variables: dict[tuple[str, str], MemberVariable] = {}
        self._restarted: set[str] = set()  # members without number
        for path in paths:
            reference, name = find(self._own(path, 0), self.catalog), path.partition(".")[0]
            member = self.simulation.members[reference.member]
            if not isinstance(member, FMUMember):
                continue
            variables[name, reference.variable.name] = reference.variable
            if not is_settable(reference.variable):
                self._restarted.add(name)
                variables |= {(name, state): member.variables[state] for state in continuous_states(member)}
        return {key: variable.size * variable.dtype.itemsize for key, variable in variables.items()}

    def _arrange_records(self) -> None:
        """Move the records of each copy into a row of one array; beside them are the buffers of what is set in FMUs."""
        members = {name: self.simulation.members[self._own(name, 0)] for name in self._names}
        sizes = {(name, ""): m.component.layout.size for name, m in members.items() if isinstance(m, RecordMember)}
        sizes |= self._set_in_fmus
        offsets = np.cumsum([0, *(-(-size // LINE) * LINE for size in sizes.values())])
        memory = np.zeros(self.count * int(offsets[-1]) + LINE, np.uint8)
        first = -memory.ctypes.data % LINE
        self._records = memory[first : first + self.count * int(offsets[-1])].reshape(self.count, -1)
        self._buffers: dict[tuple[str, str], Array] = {}
        for k in range(self.count):
            for ((name, variable), size), offset in zip(sizes.items(), offsets.tolist(), strict=False):
                part, own = self._records[k, offset : offset + size], self._own(name, k)
                if variable:
                    self._buffers[own, variable] = part.view(self.catalog[own][variable].dtype)
                else:
                    member = self._record_member(own)
                    member.move(part.view(member.component.layout.dtype))

    def _build_transfers(self, estimates: Sequence[str], outputs: Sequence[str], parameters: Sequence[str]) -> None:
        """Build the native calls that move estimates, parameters and outputs of all copies."""
        make, numbers = self.simulation, range(self.count)
        for (name, variable), buffer in self._buffers.items():
            buffer[:] = np.ravel(make.members[name].get(variable))
        self._points = np.zeros((self.count, len(estimates)))
        self._outputs = np.zeros((self.count, len(outputs)))
        self._parameters = np.zeros((self.count, len(parameters)))
        owners = {path.partition(".")[0]: None for path in estimates}
        corrected = [make.members[self._own(name, k)] for k in numbers for name in owners]
        continuous = [m for m in corrected if isinstance(m, RecordMember) and hasattr(type(m.component), "derivatives")]
        self._scatter, self._gather = self._transfers(estimates, self._points, continuous)
        self._put, self._take = self._transfers(parameters, self._parameters)
        measured = [
            (published_address(make, r.key) + r.first * r.variable.dtype.itemsize, r.variable.dtype, array)
            for r, (_, array) in zip(self._references(outputs), self._table(outputs, self._outputs), strict=True)
        ]
        self._measure = Transfer(make, self._build, conversions=measured)
        published = [
            [row for name in self._names for row in published_copies(make, self._own(name, k)).values()]
            for k in numbers
        ]
        self._published = [[row for row, _ in rows] for rows in published], [words for _, words in published[0]]
        self._sharing: dict[tuple[range, int], tuple[Transfer, StateTransfer]] = {}
        self._branches: dict[tuple[int, tuple[int, ...]], tuple[Transfer, StateTransfer]] = {}
        self._take()

    def _transfers(
        self, paths: Sequence[str], array: Array, evaluated: Sequence[RecordMember] = ()
    ) -> tuple[Transfer, Transfer]:
        """Return the calls that set scalars of all copies from an array (count, n), and that read them into it."""
        addresses, accesses = self._table(paths, array), self._set_calls(paths)
        copies = [(element, value, 1) for value, element in addresses]
        put = Transfer(self.simulation, self._build, copies, evaluated=evaluated, accesses=accesses)
        return put, Transfer(self.simulation, self._build, [(*pair, 1) for pair in addresses])

    def _references(self, paths: Sequence[str]) -> list[Reference]:
        return [find(self._own(path, k), self.catalog) for k in range(self.count) for path in paths]

    def _table(self, paths: Sequence[str], array: Array) -> list[tuple[int, int]]:
        """Return the addresses of scalars in the members' records or buffers, and of their element in an array (count, n)."""
        size, first = array.itemsize, array.ctypes.data
        return [
            (self._address(r) + r.first * r.variable.dtype.itemsize, first + i * size)
            for i, r in enumerate(self._references(paths))
        ]

    def _address(self, reference: Reference) -> int:
        """Return the address of a variable in its member's record, or in the buffer of what is set in an FMU."""
        buffer = self._buffers.get(reference.key)
        return (
            self.simulation.members[reference.member].address(reference.variable.name)
            if buffer is None
            else int(buffer.ctypes.data)
        )

    def _set_calls(self, paths: Sequence[str]) -> list[list[int]]:
        """Return rows of the loop that set variables of FMUs from their buffers."""
        keys_in_buffers = [r.key for r in self._references(paths) if r.key in self._buffers and is_settable(r.variable)]
        keys = dict.fromkeys(keys_in_buffers)
        names, rows = list(self.simulation.members), []
        for name, variable in keys:
            member, values = self.simulation.members[name], self._buffers[name, variable]
            self._accesses.append(member.access([variable], write=True))
            rows.append(access_row(self._accesses[-1], member, values, names.index(name)))
        return rows

    def _record_member(self, name: str) -> RecordMember:
        member = self.simulation.members[name]
        assert isinstance(member, RecordMember)
        return member

    def read(self) -> Array:
        """Return the estimated variables of all copies, (count, n); SimulationError if one is not finite."""
        if self._restarted:
            self._restarts.read()
        self._gather()
        return self._finite(self._points, [estimate.name for estimate in self.problem.estimates])

    def write(self, points: Array, *, sharing: int) -> None:
        """Set the estimated variables of the first copies; before, the first `sharing` of them take all memory of the very first."""
        with errors_of_points():
            self.copy_memory(range(1, sharing))
            if self._restarted:
                self._restarts.read()
            self._gather()
            self._points[: len(points)] = points
            self._scatter()
            if self._restarted:
                self._restarts.set()
        self.simulation.watch.forget()

    def copy_memory(self, numbers: range, source: int = 0) -> None:
        """Copy all memory of a copy to other ones."""
        if not len(numbers):
            return
        self._records[numbers.start : numbers.stop] = self._records[source]
        addresses, words = self._published
        if (numbers, source) not in self._sharing:
            rows = [row for k in numbers for row in zip(addresses[source], addresses[k], words, strict=True)]
            fmus = [name for name in self._names if self._own(name, 0) in self._fmus.members]
            copies = [(self._own(name, source), [self._own(name, k) for k in numbers]) for name in fmus]
            self._sharing[numbers, source] = Transfer(self.simulation, self._build, rows), self._fmus.transfer(copies)
        for transfer in self._sharing[numbers, source]:
            transfer()

    def set_parameters(self, values: Array) -> None:
        """Set the further variables of all copies, (count, p)."""
        self._parameters[:] = values
        self._put()

    def get_parameters(self) -> Array:
        """Return the further variables of all copies, (count, p)."""
        self._take()
        return self._parameters.copy()

    def outputs(self, numbers: Sequence[int]) -> Array:
        """Return measured signals of all copies, (count, m); SimulationError if one is not finite."""
        self._measure()
        return self._finite(self._outputs[:, numbers], [self._signals[number] for number in numbers])

    def _finite(self, values: Array, names: Sequence[str]) -> Array:
        if not np.isfinite(values).all():
            k, i = np.argwhere(~np.isfinite(values))[0]
            raise failure(f"{self._own(names[i], k)} is {values[k, i]:g} at t = {self.simulation.time * 1e-9:.6g} s.")
        return values.copy()

    def advance(self, tick: int) -> None:
        """Advance all copies to a communication step; SimulationError if one of them fails."""
        with errors_of_points():
            self.simulation.advance(self.case.start_ns + tick * self.case.step_ns)

    def save(self) -> SavedBatch:
        """Return all memory of the copies at the communication step reached."""
        simulation = self.simulation
        slot = self._fmus.save()
        saved = SavedBatch(
            self._records.copy(),
            tuple(block.copy() for block in simulation.plan.memory.blocks),
            {name: simulation.members[name].save() for name in self.shared if name not in self._fmus.members},
            {name: simulation.state[name].item() for name in LOOP_FIELDS},
            slot,
        )
        weakref.finalize(saved, self._fmus.slots.append, slot)
        return saved

    def restore(self, saved: SavedBatch) -> None:
        """Go back, or forward, to a saved communication step."""
        simulation = self.simulation
        self._records[:] = saved.records
        for block, values in zip(simulation.plan.memory.blocks, saved.blocks, strict=True):
            block[:] = values
        for name, record in saved.shared.items():
            simulation.members[name].restore(record)
        for name, value in saved.fields.items():
            simulation.state[name] = value
        saved.states.restore()
        simulation.finished = False
        simulation.watch.forget()

    def branch(self, other: Batch, numbers: Sequence[int]) -> None:
        """Take over memory and time of another batch of the same model: those of one of its copies for each copy here."""
        key = id(other), tuple(numbers)
        if key not in self._branches:
            rows, states = [], []
            for name in self.problem.experiment.case.members:
                for k, number in enumerate(numbers if name not in self.shared else numbers[:1]):
                    own, source = self._own(name, k), other._own(name, number)
                    member = self.simulation.members[own]
                    if isinstance(member, RecordMember):
                        words = member.component.record.nbytes // 8
                        rows.append((other.simulation.members[source].instance, member.instance, words))
                    else:
                        states.append((source, [own]))
                    rows += self._published_rows(other, source, own)
                    rows += [
                        (int(values.ctypes.data), int(self._buffers[own, variable].ctypes.data), values.nbytes // 8)
                        for (member_name, variable), values in other._buffers.items()
                        if member_name == source and (own, variable) in self._buffers
                    ]
            transfers = Transfer(self.simulation, self._build, rows), self._fmus.transfer(states, other._fmus)
            self._branches[key] = transfers
        for transfer in self._branches[key]:
            transfer()
        for name in LOOP_FIELDS:
            self.simulation.state[name] = other.simulation.state[name]
        self.simulation.finished = False
        self.simulation.watch.forget()

    def _published_rows(self, other: Batch, source: str, own: str) -> Iterator[tuple[int, int, int]]:
        """Yield source, target and words of what a member publishes here.

        The other batch may publish more, because it reads other outputs. What it does not publish is taken from the record:
        until the member publishes again, that is early by less than its period.
        """
        sources, member = published_copies(other.simulation, source), other.simulation.members[source]
        for names, (address, words) in published_copies(self.simulation, own).items():
            if names in sources:
                yield sources[names][0], address, words
            elif start := member.address(names[0]):
                yield start // 8 * 8, address, words  # a copy begins at a word
            else:
                raise SimulationError(f"{source}: measure {' and '.join(names)} too, so that it can be forecast.")

    def set_variable(self, path: str, value: float) -> None:
        """Set a parameter or an unconnected input of all copies."""
        for number in range(self.count):
            reference = find(self._own(path, number), self.catalog)
            member = self.simulation.members[reference.member]
            values = np.array(member.get(reference.variable.name))
            values.reshape(-1)[reference.first : reference.first + reference.size] = value
            self.simulation.set(reference.key, values[()])

    def hold(self, name: str) -> None:
        """Hold a recorded input at its present value, in all copies."""
        for own in dict.fromkeys(self._own(name, number) for number in range(self.count)):
            member = self._record_member(own)
            member.set("count", int(member.get("row")) + 1)

    def close(self) -> None:
        """Free the members."""
        self.simulation.terminate()


@contextmanager
def errors_of_points() -> Iterator[None]:
    """Raise errors of the members as those of a point."""
    try:
        yield
    except SimulationError as error:
        raise failure(str(error)) from error


def failure(reason: str) -> SimulationError:
    """Return the error for a point that cannot be simulated; copies are called as their member."""
    reason = re.sub(r"#\d+\b", "", reason)
    return SimulationError(
        f"a point of the filter cannot be simulated: {reason} Look for wrong measured values. Give bounds (from, to) or a smaller deviation or walk."
    )
