"""Plan of the loop: converts members and links to the tables that the loop executes.

All memory outside the members lies in one buffer: staged inputs and published outputs of FMUs, published copies of slow
records, overriding values, and the flags of FMI 3.0. A record in this process is read and written in place.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.compiler import machine
from twin.coupling.events import Events
from twin.coupling.execution import loop
from twin.coupling.execution.string_binary_links import StringBinaryLinks
from twin.coupling.execution.value_memory import ValueMemory, bits, kind
from twin.coupling.system import ResolvedConnection

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from twin.coupling.member import Access, Member, MemberVariable

MOVES = ("copies", "converts", "accesses")  # tables of operations, except steps
FLAGS = 32  # size of the flags of a step [byte]: event, terminate, early return, last successful time

Key = tuple[str, str]
RowReference = tuple[str, int, int, int]


@dataclass
class LoopPlan:
    """Tables of the loop, and the addresses of all values.

    `readers[key]`: rows that read a published variable, `writers[key]`: rows that write an input; both as (table, row,
    column of the source, offset of the element [byte]), so that an override can redirect them.
    `split`: variables of which single elements will be overridden; they are published element by element, by the rows
    (table, row) in `elements[key]`.
    """

    members: Mapping[str, Member]
    step_ns: clock.Time
    periods: Mapping[str, clock.Time]
    split: frozenset[Key] = frozenset()
    memory: ValueMemory = field(default_factory=ValueMemory)
    published: dict[Key, int] = field(default_factory=dict)
    staged: dict[Key, int] = field(default_factory=dict)
    recorded_inputs: set[Key] = field(default_factory=set)  # inputs that are recorded as they were set
    buffers: dict[Key, int] = field(default_factory=dict)  # memory that the setters of FMUs read
    readers: dict[Key, list[RowReference]] = field(default_factory=dict)
    writers: dict[Key, list[RowReference]] = field(default_factory=dict)
    elements: dict[Key, list[tuple[str, int]]] = field(default_factory=dict)
    unsplit: dict[Key, int] = field(default_factory=dict)  # address of a split variable before the split
    operations: list[dict[str, Any]] = field(default_factory=list)  # ranges by table; addresses come with the tables
    records: list[list[int]] = field(default_factory=list)
    copies: list[list[int]] = field(default_factory=list)
    converts: list[list[int]] = field(default_factory=list)
    accesses: list[list[int]] = field(default_factory=list)
    steps: list[list[int]] = field(default_factory=list)
    instructions: list[list[int]] = field(default_factory=list)  # of conditions
    columns: list[tuple[Key, int, int]] = field(default_factory=list)  # recorded: key, first word in the row, words
    gets: dict[str, list[list[int]]] = field(default_factory=dict)
    sets: dict[str, list[list[int]]] = field(default_factory=dict)
    publishes: dict[str, list[list[int]]] = field(default_factory=dict)
    keep: list[Access] = field(default_factory=list)
    # Names of the variables of a call, by its function, instance and references.
    access_names: dict[tuple[int, int, int], tuple[str, ...]] = field(default_factory=dict)
    references: dict[bytes, int] = field(default_factory=dict)  # addresses of value references, equal ones shared
    no_flags: int = 0  # address of the flags shared by members that write none
    functions: dict[int, str] = field(default_factory=dict)  # names of the functions that are called, by address
    objects: StringBinaryLinks | None = None  # connections of strings and binaries
    events: Events | None = None  # event handling at communication points
    row_words: int = 1
    record_converts: tuple[int, int] = (0, 0)

    def divider(self, member: str) -> int:
        """Return the communication points per step of a member."""
        return max(1, self.periods[member] // self.step_ns)

    def is_read_directly(self, member: str) -> bool:
        """Whether other members read the memory of a record: it publishes at every communication point."""
        return self.divider(member) == 1

    def is_recorded_input(self, member: str, name: str) -> bool:
        """Whether an input is recorded as it was set: many FMUs refuse to return their inputs."""
        instance = self.members[member]
        return (
            instance.variables[name].causality == "input"
            and not instance.address(name)
            and self.is_read_directly(member)
        )

    def build(
        self, order: list[list[str]], links: list[ResolvedConnection], recorded: list[Key], watched: Iterable[Key] = ()
    ) -> None:
        """Fill the tables. `order`: the stages, each a list of members; `watched`: further variables to publish."""
        needed: dict[str, dict[str, MemberVariable]] = {name: {} for name in self.members}
        inputs: dict[str, dict[str, MemberVariable]] = {name: {} for name in self.members}
        for link in links:
            needed[link.source.member][link.source.variable.name] = link.source.variable
            inputs[link.target.member][link.target.variable.name] = link.target.variable
        for key in (*recorded, *watched):
            if self.is_recorded_input(*key):
                self.recorded_inputs.add(key)
            else:
                needed[key[0]][key[1]] = self.members[key[0]].variables[key[1]]
        for index, name in enumerate(self.members):
            self._publish(index, name, needed[name])
        for index, name in enumerate(self.members):
            self._stage_inputs(index, name, inputs[name])
        for key in self.recorded_inputs:
            variable = self.members[key[0]].variables[key[1]]
            if key not in self.staged:
                self.buffers[key] = self.memory.take(variable.size * variable.dtype.itemsize)
            self.published[key] = self.staged.get(key, self.buffers.get(key, 0))
        for stage in order:
            self._stage(stage, links)
        self._events()
        self._record(recorded)

    def _events(self) -> None:
        """Append the operation of event handling, if there are clocks."""
        if self.events is None:
            return
        row = len(self.accesses)
        self.accesses.append([self.events.address, 0, 0, 0, 0, 0, self.events.index])
        self.functions[self.events.address] = "events"
        self.operations.append({"divider": 1, "h": bits(0.0), "accesses": (row, row + 1)})

    def rows_at_events(self, key: Key) -> list[tuple[str, int]]:
        """Return the rows (table, row) that move connected values to an input."""
        return list(dict.fromkeys((table, row) for table, row, *_ in self.writers.get(key, [])))

    def _stage(self, stage: list[str], links: list[ResolvedConnection]) -> None:
        """Add the operations of the members of a stage."""
        slots = []
        for divider in sorted({self.divider(name) for name in stage}):
            names = [name for name in stage if self.divider(name) == divider]
            slots.append(self._slot(divider, names, [link for link in links if link.target.member in names]))
        self._operations(slots)

    def _grouped(self, member: str, names: dict[str, MemberVariable], write: bool) -> list[Access]:
        """Return the calls that move variables of an FMU, one per type, and allocate their memory."""
        by_type: dict[tuple[str, Any], list[MemberVariable]] = {}
        for variable in names.values():
            by_type.setdefault((variable.type, variable.dtype), []).append(variable)
        addresses = self.staged if write else self.published
        calls = []
        for variables in by_type.values():
            access = self.members[member].access([v.name for v in variables], write)
            address = self.memory.take(sum(v.size * v.dtype.itemsize for v in variables))
            calls.append(access)
            self.functions[access.function] = access.name
            rows = self.sets if write else self.gets
            references = self.references.setdefault(access.references.tobytes(), int(access.references.ctypes.data))
            self.access_names[access.function, self.members[member].instance, references] = tuple(
                f"{v.name} (value reference {', '.join(map(str, v.references[:3]))})" for v in variables
            )
            instance = self.members[member].instance
            row = [access.function, instance, references, access.count, address, access.size_argument]
            rows[member].append(row)
            for variable in variables:
                addresses[member, variable.name] = address
                if write:
                    self.buffers[member, variable.name] = address
                address += variable.size * variable.dtype.itemsize
        return calls

    def _publish(self, index: int, name: str, needed: dict[str, MemberVariable]) -> None:
        """Set the addresses at which a member's needed variables are read."""
        member = self.members[name]
        self.gets[name], self.publishes[name] = [], []
        if not all(member.address(v) for v in needed):
            self.keep += self._grouped(name, needed, write=False)
        elif self.is_read_directly(name):
            self.published.update({(name, v): member.address(v) for v in needed})
        else:
            for variable in needed.values():
                address = member.address(variable.name)
                first, end = address // 8 * 8, address + variable.size * variable.dtype.itemsize
                words = -(-(end - first) // 8)
                shadow = self.memory.take(8 * words)
                self.publishes[name].append([first, shadow, words])
                self.published[name, variable.name] = shadow + address - first
        self.gets[name] += self.objects.gets(name) if self.objects else []
        for row in self.gets[name]:
            row.append(index)
        for key in ((name, v) for v in needed if (name, v) in self.split):
            self.unsplit[key] = self.published[key]
            self.published[key] = self.memory.take(needed[key[1]].size * needed[key[1]].dtype.itemsize)

    def _stage_inputs(self, index: int, name: str, inputs: dict[str, MemberVariable]) -> None:
        """Set the addresses at which a member's connected inputs are written."""
        member = self.members[name]
        self.sets[name] = []
        if not all(member.address(v) for v in inputs):
            self.keep += self._grouped(name, inputs, write=True)
        else:
            self.staged.update({(name, v): member.address(v) for v in inputs})
        self.sets[name] += self.objects.sets(name) if self.objects else []
        for row in self.sets[name]:
            row.append(index)

    def _operations(self, slots: list[list[dict[str, Any]]]) -> None:
        """Add the operations of a stage: all take inputs, all step, all publish; a single slot merges the first two."""
        if len(slots) == 1:
            inputs, steps, gets, *more = slots[0]
            if gets["divider"] == 1:
                self._publish_at_once(steps["steps"], gets.pop("accesses"))
            publish = [gets] if any(begin < end for begin, end in (gets.get(table, (0, 0)) for table in MOVES)) else []
            self.operations += [{**inputs, "steps": steps["steps"]}, *publish, *more]
        else:
            self.operations += [slot[phase] for phase in range(4) for slot in slots if phase < len(slot)]

    def _publish_at_once(self, steps: tuple[int, int], gets: tuple[int, int]) -> None:
        """Let the steps in some rows be followed directly by the calls, in other rows, that read their outputs."""
        for row in self.steps[slice(*steps)]:
            calls = [i for i in range(*gets) if self.accesses[i][-1] == row[-1]]
            row[-3:-1] = calls[0] if calls else 0, len(calls)

    def _slot(self, divider: int, names: list[str], links: list[ResolvedConnection]) -> list[dict[str, Any]]:
        """Return the operations of a stage's members with equal divider: take inputs, step, publish."""
        common = {"divider": divider, "h": bits(clock.seconds(divider * self.step_ns))}
        copies, converts, sets = len(self.copies), len(self.converts), len(self.accesses)
        direct = {id(link) for name in names for link in self._set_rows(name, links)}
        for link in links:
            if id(link) in direct:
                continue
            source = self.published[link.source.key] + link.source.first * link.source.variable.dtype.itemsize
            target = self.staged[link.target.key] + link.target.first * link.target.variable.dtype.itemsize
            self._move(link, source, target)
        gets, publishes, steps = len(self.accesses), len(self.copies), len(self.steps)
        inputs = {"copies": (copies, publishes), "converts": (converts, len(self.converts)), "accesses": (sets, gets)}
        self.accesses += [row for name in names for row in self.gets[name]]
        self.copies += [row for name in names for row in self.publishes[name]]
        order = list(self.members)
        for name in names:
            member = self.members[name]
            self.steps.append(self._step(member, order.index(name)))
        accesses, copied, converted = len(self.accesses), len(self.copies), len(self.converts)
        for key in (key for key in self.unsplit if key[0] in names):
            self._split(key)
        elements = {"copies": (copied, len(self.copies)), "converts": (converted, len(self.converts))}
        return [
            {**common, **inputs},
            {**common, "steps": (steps, len(self.steps))},
            {**common, "shift": 1, "accesses": (gets, accesses), "copies": (publishes, copied)},
            *([{**common, "shift": 1, **elements}] if any(begin < end for begin, end in elements.values()) else []),
        ]

    def _step(self, member: Member, index: int) -> list[int]:
        """Return the row of a member's step; the calls that publish at once are filled in later."""
        return [member.step_function, member.step_signature, member.instance, self._flags(member), 0, 0, index]

    def _flags(self, member: Member) -> int:
        """Return the address of a member's step flags."""
        if member.writes_flags:
            return self.memory.take(FLAGS)
        self.no_flags = self.no_flags or self.memory.take(FLAGS)
        return self.no_flags

    def _split(self, key: Key) -> None:
        """Add rows that publish a variable element by element."""
        variable = self.members[key[0]].variables[key[1]]
        size, code = variable.dtype.itemsize, kind(variable.dtype)
        for i in range(variable.size):
            source, target = self.unsplit[key] + i * size, self.published[key] + i * size
            table = "copies" if size == 8 else "converts"
            self.elements.setdefault(key, []).append((table, len(getattr(self, table))))
            if size == 8:
                self.copies.append([source, target, 1])
            else:
                self.converts.append([source, code, target, code, 1, bits(1.0), bits(0.0)])

    def stepping_operations(self) -> list[dict[str, Any]]:
        """Return the operations that may step members."""
        return self.operations

    def operation_rows(self, tables: Mapping[str, np.ndarray[Any, Any]]) -> np.ndarray[Any, Any]:
        """Return the operations with the addresses of their rows in the tables."""
        rows = []
        for operation in self.operations:
            row = [operation["divider"], operation.get("shift", 0), operation["h"]]
            for name in ("copies", "converts", "accesses", "steps"):
                begin, end = operation.get(name, (0, 0))
                row += [int(tables[name].ctypes.data) + begin * tables[name].strides[0], end - begin]
            rows.append(row)
        return np.array(rows, np.int64).reshape(len(rows), len(loop.OPERATION))

    def calls(self, tables: Mapping[str, np.ndarray[Any, Any]]) -> dict[int, tuple[str, str]]:
        """Return member and function of every calling row, by the row's address."""
        names, functions = list(self.members), self.functions | (self.objects.names if self.objects else {})
        result = {}
        for table, rows in (("accesses", self.accesses), ("steps", self.steps)):
            for i, row in enumerate(rows):
                member = names[row[-1]]
                function = functions[row[0]] if table == "accesses" else self.members[member].step_name
                result[int(tables[table].ctypes.data) + i * tables[table].strides[0]] = (member, function)
        return result

    def _set_rows(self, name: str, links: list[ResolvedConnection]) -> list[ResolvedConnection]:
        """Add the calls that set a member's inputs; return links without a copy, whose call reads the source directly."""
        direct = []
        for row in self.sets[name]:
            row_index = len(self.accesses)
            self.accesses.append(row)
            target_links = [
                link for link in links if link.target.member == name and self.staged[link.target.key] == row[4]
            ]
            if len(target_links) != 1 or row[3] != 1:
                continue
            link = target_links[0]
            if link.target.variable.is_bounded or link.target.key in self.recorded_inputs:
                continue  # The input is checked or recorded after the step, when the source may have changed.
            variable, foreign = (
                link.source.variable,
                not self.members[link.source.member].address(link.source.variable.name),
            )
            is_same_type = variable.dtype == link.target.variable.dtype and (link.factor, link.offset) == (1.0, 0.0)
            size = row[3] if row[5] == machine.NO_SIZE else row[5]
            if is_same_type and foreign and link.target.size == size:
                offset = link.source.first * variable.dtype.itemsize
                row[4] = self.staged[link.target.key] = self.published[link.source.key] + offset
                self.readers.setdefault(link.source.key, []).append(("accesses", row_index, 4, offset))
                self.writers.setdefault(link.target.key, []).append(("accesses", row_index, 4, 0))
                direct.append(link)
        return direct

    def _move(self, link: ResolvedConnection, source: int, target: int, dtype: np.dtype[Any] | None = None) -> None:
        """Add a copy for equal representations, else a conversion; `dtype`: of the target, if not the input's."""
        a, b = link.source.variable.dtype, dtype or link.target.variable.dtype
        is_same_type = a == b == link.target.variable.dtype and a.itemsize == 8
        if is_same_type and (link.factor, link.offset) == (1.0, 0.0):
            row = ("copies", len(self.copies), 0)
            self.copies.append([source, target, link.source.size])
        else:
            row = ("converts", len(self.converts), 0)
            conversion = [kind(a), target, kind(b), link.source.size, bits(link.factor), bits(link.offset)]
            self.converts.append([source, *conversion])
        self.readers.setdefault(link.source.key, []).append((*row, link.source.first * a.itemsize))
        offset = link.target.first * link.target.variable.dtype.itemsize  # of the value that overrides it
        self.writers.setdefault(link.target.key, []).append((*row, offset))

    def _record(self, recorded: list[Key]) -> None:
        """Add the recording rows: word 0 is the tick; every scalar takes a word, Float64 or Int64."""
        convert_begin, word = len(self.converts), 1
        for key in recorded:
            variable = self.members[key[0]].variables[key[1]]
            source = self.published[key]
            if variable.dtype.itemsize == 8:
                self.readers.setdefault(key, []).append(("records", len(self.records), 0, 0))
                self.records.append([source, 8 * word, variable.size])
            else:
                target = loop.KINDS["f8" if variable.dtype.kind == "f" else "i8"]
                self.readers.setdefault(key, []).append(("converts", len(self.converts), 0, 0))
                row = [source, kind(variable.dtype), 8 * word, target, variable.size, bits(1.0), bits(0.0)]
                self.converts.append(row)
            self.columns.append((key, word, variable.size))
            word += variable.size
        self.row_words = word
        self.record_converts = (convert_begin, len(self.converts))
