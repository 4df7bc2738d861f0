"""Monitor of values that are not finite and of inputs beyond their declared bounds.

The loop checks inputs with bounds in every communication step. Values that must be finite are checked between native calls,
which costs the loop nothing; when one is not finite, the members are restored to the last valid point and stepped again to
the first communication point where it is not. With a member that cannot be restored (Python-side, or a third-party FMU)
the loop checks the values in memory in every step instead.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling.component_member import RecordMember
from twin.coupling.execution.plan import Key, LoopPlan
from twin.coupling.execution.value_memory import bits, kind, silent_copy, view
from twin.coupling.system import stepping_order

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping

    from twin.coupling.member import Access, Member, MemberVariable
    from twin.coupling.system import ResolvedConnection

COMPUTED = ("output", "local")
REMEDY = "Correct its parameters or start values, or write `finite: false` for the member if that is meant."
LINE_NOTE = "The backend `interpreted` warns at the line of the code. "


def finite_variables(member: Member) -> list[MemberVariable]:
    """Return the variables that must be finite: outputs, and for our own components states and local variables too."""
    inside = isinstance(member, RecordMember) or member.has_cheap_fmu_state
    return [
        v
        for v in member.variables.values()
        if v.dtype.kind == "f" and v.causality in (COMPUTED if inside else COMPUTED[:1]) and v.name not in member.driven
    ]


@dataclass
class ValueReader:
    """Reader of a member's values: memory to check, and the calls that fill it first."""

    values: list[np.ndarray[Any, Any]] = field(default_factory=list)
    fill: list[Callable[[], int]] = field(default_factory=list)
    accesses: list[Access] = field(default_factory=list)  # memory that `fill` points to

    def is_bad(self) -> bool:
        """Whether any value is not finite."""
        for fill in self.fill:
            if fill() > 1:
                return False  # A failed member may refuse its values.
        return not all(np.isfinite(values).all() for values in self.values)


def value_reader(member: Member, variables: list[MemberVariable]) -> ValueReader:
    """Create a reader of a member's variables: in place, in as few blocks as possible, or by one call for each type."""
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
    """Saved state of a co-simulation at a communication point."""

    record: np.ndarray[Any, Any]  # of the loop
    blocks: list[np.ndarray[Any, Any]]
    members: dict[str, Any]
    lines: dict[str, int]  # number of log lines by member


class FiniteValueMonitor:
    """Monitor of the members of a co-simulation. `exempt`: members that may compute values that are not finite."""

    def __init__(self, members: Mapping[str, Member], links: list[ResolvedConnection], exempt: Collection[str]) -> None:
        self.members, self.links = members, links
        self.periods: dict[str, clock.Time] = {}  # of members with steps of their own [ns]
        self.variables = {
            name: variables for name, m in members.items() if name not in exempt and (variables := finite_variables(m))
        }
        self.replays = bool(self.variables) and all(member.has_cheap_fmu_state for member in members.values())
        self._readers: dict[str, ValueReader] = {}
        self._saved: Saved | None = None
        self._rows: list[tuple[Key | None, list[int]]] = []

    def published(self) -> list[Key]:
        """Return the variables to publish in every step, because they cannot be checked later."""
        if self.replays:
            return []
        return [
            (name, v.name)
            for name, variables in self.variables.items()
            for v in variables
            if v.causality == "output" and not isinstance(self.members[name], RecordMember)
        ]

    def rows(self, plan: LoopPlan) -> np.ndarray[Any, Any]:
        """Return the loop's table of limits: values that must be finite, if they cannot be checked later; then inputs."""
        self._rows = []
        largest = float(np.finfo(np.float64).max)
        for name, variables in {} if self.replays else self.variables.items():
            for variable in variables:
                key = name, variable.name
                published = plan.unsplit.get(key) or plan.published.get(key)
                if address := self.members[name].address(variable.name) or published:
                    row = [address, kind(variable.dtype), variable.size, bits(-largest), bits(largest)]
                    self._rows.append((None, row))
        for (name, input_), address in plan.staged.items():
            variable = self.members[name].variables[input_]
            if variable.is_bounded:
                low, high = variable.limits
                row = [address, kind(variable.dtype), variable.size, bits(low), bits(high)]
                self._rows.append(((name, input_), row))
        return np.array([row for _, row in self._rows] or [[0] * 5], np.int64)

    def row(self, index: int) -> Key | None:
        """Return the input of a row; None for a value that must be finite."""
        return self._rows[index][0]

    @property
    def row_count(self) -> int:
        """Number of valid rows of the table."""
        return len(self._rows)

    def input_note(self, key: Key, plan: LoopPlan, time: clock.Time) -> str:
        """Return the note on an input that left its bounds in the step from `time` [ns]."""
        variable = self.members[key[0]].variables[key[1]]
        values = view(plan.staged[key], variable).reshape(variable.shape)
        problem, expected = variable.outside(values[()])
        expected = expected.replace("Give", "Expected", 1)
        return f"{key[0]}.{key[1]}{problem} at t = {clock.text(time)}, for the first time. {expected}"

    def non_finite_members(self, failed: str = "") -> list[str]:
        """Return the members with a value that is not finite; `failed`: a member whose step has failed."""
        for name, variables in self.variables.items():
            if name not in self._readers:
                self._readers[name] = value_reader(self.members[name], variables)
        return [
            name
            for name, reader in self._readers.items()
            if (name != failed or self.members[name].has_cheap_fmu_state) and reader.is_bad()
        ]

    def save(self, record: np.ndarray[Any, Any], plan: LoopPlan) -> None:
        """Save the state at a valid point, unless a member cannot be restored."""
        if self.replays:
            states = {name: member.save() for name, member in self.members.items()}
            lines = {name: len(member.log) for name, member in self.members.items()}
            self._saved = Saved(record.copy(), plan.memory.saved(), states, lines)

    def forget(self) -> None:
        """Discard the saved state: after a change from outside its steps would differ."""
        self._saved = None

    @property
    def is_saved(self) -> bool:
        """Whether there is a saved state, or none is needed."""
        return self._saved is not None or not self.replays

    def _restore(self, plan: LoopPlan) -> np.ndarray[Any, Any]:
        """Restore the saved state; return a loop record that records and reports nothing."""
        assert self._saved is not None
        plan.memory.restore(self._saved.blocks)
        for name, member in self.members.items():
            member.restore(self._saved.members[name])
            del member.log[self._saved.lines[name] :]
        return silent_copy(self._saved.record)

    def find_first_tick(self, end: int, run: Callable[[int], int], plan: LoopPlan) -> int:
        """Find the first tick with a value that is not finite, by bisection up to `end`; the members are at it afterwards.

        Assumes that a value stays not finite once it is.
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
        """Find the first member along the data flow with finite inputs; the Boolean tells whether there is one."""
        catalog = {name: member.variables for name, member in self.members.items()}
        order = [name for name in stepping_order(list(self.members), self.links, catalog) if name in bad]
        for name in order:
            inputs = [v.name for v in catalog[name].values() if v.causality == "input" and v.dtype.kind == "f"]
            if all(np.isfinite(self.members[name].get(input_name)).all() for input_name in inputs):
                return name, True
        return order[0], False

    def step_text(self, name: str, time: clock.Time) -> str:
        """Return the own step of a member that gave its value at a time [ns], which is published at its end; "" of others."""
        period = self.periods.get(name, 0)
        if not period or time <= 0:
            return ""
        begin = (time - 1) // period * period
        return f" (in its step from {clock.text(begin)} to {clock.text(begin + period)})"

    def code_note(self, name: str) -> str:
        """Return the note on the line of code, of a component of ours."""
        member = self.members[name]
        return LINE_NOTE if isinstance(member, RecordMember) or member.has_cheap_fmu_state else ""

    def described(self, bad: list[str], when: str, time: clock.Time = 0) -> str:
        """Describe the values that are not finite in one line: variable, time, cause. `time`: if it is exact [ns]."""
        name, is_source = self.find_source(bad)
        member = self.members[name]
        invalid = {v.name: value for v in self.variables[name] if not np.isfinite(value := member.get(v.name)).all()}
        spoiled = {path.rpartition(".")[0] for path in member.driven if not finite_value(member, path)}
        candidates = [path for path in invalid if path.rpartition(".")[0] not in spoiled] or list(invalid)
        first = min(
            candidates, key=lambda path: member.variables[path].causality == "output"
        )  # a cause before its effect
        value = np.asarray(invalid[first])
        index = tuple(np.argwhere(~np.isfinite(value))[0])
        element = f"[{','.join(str(i + 1) for i in index)}]" if index else ""
        others = [f"{name}.{path}" for path in candidates if path != first]
        more = f" ({', '.join(others[:2])}{' and others' if len(others) > 2 else ''} too)" if others else ""
        cause = (
            f"with finite inputs. {self.code_note(name)}{REMEDY}"
            if is_source
            else f"and not all of its inputs are finite. {REMEDY}"
        )
        return f"{name}.{first}{element} is {value[index]:g} {when}{self.step_text(name, time)}{more}, {cause}"

    def spell(self, parts: Iterable[tuple[np.ndarray[Any, Any], Mapping[str, np.ndarray[Any, Any]]]]) -> str:
        """Describe values that were recorded as not finite between two checks and finite again; empty if there are none.

        `parts`: consecutive pieces of times and signals.
        """
        for time, signals in parts:
            first: tuple[int, str] | None = None
            for name, variables in self.variables.items():
                for path in (path for v in variables if (path := f"{name}.{v.name}") in signals):
                    is_finite = np.isfinite(signals[path].reshape(len(time), -1)).all(axis=1)
                    if not is_finite.all():
                        first = min(first or (len(time), ""), (int(np.argmin(is_finite)), path))
            if first is not None:
                name, seconds = first[1].partition(".")[0], float(time[first[0]])
                when = f"at t = {seconds:g} s{self.step_text(name, round(seconds * 1e9))}"
                return f"{first[1]} was not finite {when}, and later was again. {self.code_note(name)}{REMEDY}"
        return ""


def finite_value(member: Member, name: str) -> bool:
    """Whether a variable's value is finite; integers always are."""
    return member.variables[name].dtype.kind != "f" or bool(np.isfinite(member.get(name)).all())
