"""What goes wrong without a word: values that are no finite numbers, inputs beyond their declared bounds.

Inputs with bounds are looked at by the loop, in every communication step. Values that have to be finite are looked at
between native calls, which costs the loop nothing; when one is found, the members go back to where all was well, and
forward again to the first communication point where it is not. A member that cannot go back (Python-side, or somebody
else's FMU) makes the loop look at every step instead, at what lies in memory.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling.component_member import RecordMember
from twin.coupling.execution import loop
from twin.coupling.execution.plan import Key, Plan, bits, kind, view
from twin.coupling.system import stepping_order

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping

    from twin.coupling.member import Access, Member, MemberVariable
    from twin.coupling.system import Link

COMPUTED = ("output", "local")
REMEDY = "Correct its parameters or start values, or write `finite: false` for the member if that is meant."
NEVER = 1 << 62  # communication points between two rows of a recording that is not wanted


def finite_variables(member: Member) -> list[MemberVariable]:
    """Variables whose values have to be finite: outputs, and of a component of ours states and local variables too."""
    inside = isinstance(member, RecordMember) or member.can_restore
    return [
        v
        for v in member.variables.values()
        if v.dtype.kind == "f" and v.causality in (COMPUTED if inside else COMPUTED[:1]) and v.name not in member.driven
    ]


@dataclass
class ValueReader:
    """One look at a member: the memory to look at, and what fills it first."""

    values: list[np.ndarray[Any, Any]] = field(default_factory=list)
    fill: list[Callable[[], int]] = field(default_factory=list)
    accesses: list[Access] = field(default_factory=list)  # what `fill` points into

    def is_bad(self) -> bool:
        """Whether anything is not finite."""
        for fill in self.fill:
            if fill() > 1:
                return False  # a member that failed may say nothing
        return not all(np.isfinite(values).all() for values in self.values)


def value_reader(member: Member, variables: list[MemberVariable]) -> ValueReader:
    """How to look at some variables of a member: in place, in as few runs as may be, or by one call for each type."""
    reader = ValueReader()
    if all(member.address(v.name) for v in variables):
        runs: list[list[int]] = []
        for variable in sorted(variables, key=lambda v: member.address(v.name)):
            begin = member.address(variable.name)
            if runs and runs[-1][1] == begin:
                runs[-1][1] += 8 * variable.size
            else:
                runs.append([begin, begin + 8 * variable.size])
        raw = [(ctypes.c_double * ((end - begin) // 8)).from_address(begin) for begin, end in runs]
        reader.values = [np.ctypeslib.as_array(buffer) for buffer in raw]
        return reader
    for dtype in dict.fromkeys(v.dtype for v in variables):
        access = member.access([v.name for v in variables if v.dtype == dtype], write=False)
        values = np.zeros(access.size, dtype)
        call = partial(access.call, member.instance, int(values.ctypes.data))
        reader.accesses.append(access)
        reader.values.append(values)
        reader.fill.append(call)
    return reader


@dataclass
class Saved:
    """All that a co-simulation holds at a communication point."""

    record: np.ndarray[Any, Any]  # of the loop
    blocks: list[np.ndarray[Any, Any]]
    members: dict[str, Any]
    lines: dict[str, int]  # of the members' logs


def merge_adjacent(rows: list[list[int]]) -> list[list[int]]:
    """Rows of the loop's table of limits, those of neighbors in memory as one."""
    result: list[list[int]] = []
    for row in sorted(rows):
        last = result[-1] if result else row
        if last[1] == row[1] == loop.KINDS["f8"] and last[0] + 8 * last[2] == row[0]:
            last[2] += row[2]
        else:
            result.append(row)
    return result


class FiniteValueMonitor:
    """Looks after the members of a co-simulation. `exempt`: those that may compute what is not finite."""

    def __init__(self, members: Mapping[str, Member], links: list[Link], exempt: Collection[str]) -> None:
        self.members, self.links = members, links
        self.replays = all(member.can_restore for member in members.values())
        self.variables = {
            name: variables for name, m in members.items() if name not in exempt and (variables := finite_variables(m))
        }
        self._readers: dict[str, ValueReader] = {}
        self._saved: Saved | None = None
        self._rows: list[tuple[Key | None, list[int]]] = []

    def published(self) -> list[Key]:
        """What has to be fetched in every step, since it cannot be looked at later."""
        if self.replays:
            return []
        return [
            (name, v.name)
            for name, variables in self.variables.items()
            for v in variables
            if v.causality == "output" and not isinstance(self.members[name], RecordMember)
        ]

    def rows(self, plan: Plan) -> np.ndarray[Any, Any]:
        """The loop's table of limits: first what has to be finite, if it cannot be looked at later; then inputs."""
        self._rows = []
        largest = float(np.finfo(np.float64).max)
        for name, variables in {} if self.replays else self.variables.items():
            for variable in variables:
                key = name, variable.name
                published = plan.unsplit.get(key) or plan.published.get(key)
                if address := self.members[name].address(variable.name) or published:
                    row = [address, kind(variable.dtype), variable.size, bits(-largest), bits(largest)]
                    self._rows.append((None, row))
        self._rows = [(None, row) for row in merge_adjacent([row for _, row in self._rows])]
        for (name, input_), address in plan.staged.items():
            variable = self.members[name].variables[input_]
            if variable.is_bounded:
                low, high = variable.limits
                row = [address, kind(variable.dtype), variable.size, bits(low), bits(high)]
                self._rows.append(((name, input_), row))
        return np.array([row for _, row in self._rows] or [[0] * 5], np.int64)

    def row(self, index: int) -> Key | None:
        """The input that a row is for; None: a value that has to be finite."""
        return self._rows[index][0]

    @property
    def row_count(self) -> int:
        """Rows of the table that count."""
        return len(self._rows)

    def input_note(self, key: Key, plan: Plan, time: clock.Time) -> str:
        """That an input left its bounds in the step from `time` [ns]."""
        variable = self.members[key[0]].variables[key[1]]
        values = view(plan.staged[key], variable).reshape(variable.shape)
        wrong, expected = variable.outside(values[()])
        expected = expected.replace("Give", "Expected", 1)
        return f"{key[0]}.{key[1]}{wrong} at t = {clock.text(time)}, for the first time. {expected}"

    def non_finite_members(self, failed: str = "") -> list[str]:
        """Members that hold a value that is not finite; `failed`: one that may not like to be asked."""
        for name, variables in self.variables.items():
            if name not in self._readers:
                self._readers[name] = value_reader(self.members[name], variables)
        return [
            name
            for name, reader in self._readers.items()
            if (name != failed or self.members[name].can_restore) and reader.is_bad()
        ]

    def save(self, record: np.ndarray[Any, Any], plan: Plan) -> None:
        """Remember where all is well, unless a member cannot come back to it."""
        if self.replays:
            states = {name: member.save() for name, member in self.members.items()}
            lines = {name: len(member.log) for name, member in self.members.items()}
            self._saved = Saved(record.copy(), [block.copy() for block in plan.memory.blocks], states, lines)

    def forget(self) -> None:
        """Something was set from outside: what was saved leads elsewhere."""
        self._saved = None

    @property
    def is_saved(self) -> bool:
        """Whether there is a point to go back to, or none is needed."""
        return self._saved is not None or not self.replays

    def _restore(self, plan: Plan) -> np.ndarray[Any, Any]:
        """Bring everything back to the saved point; a loop's record that records and notices nothing."""
        assert self._saved is not None
        for block, saved in zip(plan.memory.blocks, self._saved.blocks, strict=True):
            block[:] = saved
        for name, member in self.members.items():
            member.restore(self._saved.members[name])
            del member.log[self._saved.lines[name] :]
        record = self._saved.record.copy()
        record["every"], record["limit_count"], record["limit"] = NEVER, 0, NEVER
        record["derives"] = 0  # nobody would answer
        return record

    def find_first_tick(self, end: int, run: Callable[[int], int], plan: Plan) -> int:
        """The first tick at which something is not finite, all being there again; `end`: one where something is.

        That a value once spoiled stays so is taken for granted.
        """
        assert self._saved is not None
        record = self._restore(plan)
        low, high = int(record[0]["tick"]), end
        while high - low > 1:
            middle = (low + high) // 2
            record["stop"] = middle
            run(record.ctypes.data)
            if self.non_finite_members():
                high, record = middle, self._restore(plan)
            else:
                low = middle
                self.save(record, plan)
        record["stop"] = high
        run(record.ctypes.data)
        return high

    def find_source(self, bad: list[str]) -> tuple[str, bool]:
        """The member where it began: the first, along the data, with finite inputs; and whether there is one."""
        catalog = {name: member.variables for name, member in self.members.items()}
        order = [name for name in stepping_order(list(self.members), self.links, catalog) if name in bad]
        for name in order:
            inputs = [v.name for v in catalog[name].values() if v.causality == "input" and v.dtype.kind == "f"]
            if all(np.isfinite(self.members[name].get(input_name)).all() for input_name in inputs):
                return name, True
        return order[0], False

    def described(self, bad: list[str], when: str) -> str:
        """What is not finite, where and when, in one line."""
        name, is_source = self.find_source(bad)
        member = self.members[name]
        wrong = {v.name: value for v in self.variables[name] if not np.isfinite(value := member.get(v.name)).all()}
        spoiled = {path.rpartition(".")[0] for path in member.driven if not finite_value(member, path)}
        candidates = [path for path in wrong if path.rpartition(".")[0] not in spoiled] or list(wrong)
        first = min(
            candidates, key=lambda path: member.variables[path].causality == "output"
        )  # a cause before its effect
        value = np.asarray(wrong[first])
        index = tuple(np.argwhere(~np.isfinite(value))[0])
        element = f"[{','.join(str(i + 1) for i in index)}]" if index else ""
        others = [f"{name}.{path}" for path in candidates if path != first]
        more = f" ({', '.join(others[:2])}{' and others' if len(others) > 2 else ''} too)" if others else ""
        cause = f"with finite inputs. {REMEDY}" if is_source else f"and not all of its inputs are finite. {REMEDY}"
        return f"{name}.{first}{element} is {value[index]:g} {when}{more}, {cause}"

    def spell(self, parts: Iterable[tuple[np.ndarray[Any, Any], Mapping[str, np.ndarray[Any, Any]]]]) -> str:
        """What was recorded as not finite, and was finite again before anybody looked; empty if nothing was.

        `parts`: times and signals, one after the other.
        """
        for time, signals in parts:
            first: tuple[int, str] | None = None
            for name, variables in self.variables.items():
                for path in (path for v in variables if (path := f"{name}.{v.name}") in signals):
                    good = np.isfinite(signals[path].reshape(len(time), -1)).all(axis=1)
                    if not good.all():
                        first = min(first or (len(time), ""), (int(np.argmin(good)), path))
            if first is not None:
                return f"{first[1]} was not finite at t = {time[first[0]]:g} s, and later was again. {REMEDY}"
        return ""


def finite_value(member: Member, name: str) -> bool:
    """Whether a variable's value is finite; whole numbers are."""
    return member.variables[name].dtype.kind != "f" or bool(np.isfinite(member.get(name)).all())
