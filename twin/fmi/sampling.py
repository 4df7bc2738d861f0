"""Inputs from a table and recording of outputs, for an FMU that is simulated alone."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.errors import FMUError
from twin.fmi.csv_tables import InputColumn, Results

if TYPE_CHECKING:
    from twin.coupling import Access, MemberVariable
    from twin.fmi.csv_tables import Inputs
    from twin.fmi.importing.fmu_member import FMUMember

SCALARS = 200_000_000  # largest number of recorded scalars


class Mover:
    """Variables of one type, moved between the FMU and a buffer in one call."""

    def __init__(self, member: FMUMember, variables: list[MemberVariable], write: bool) -> None:
        self.names = [variable.name for variable in variables]
        self.member = member
        self.call: Access = member.access(self.names, write)
        self.buffer = np.zeros(self.call.size, variables[0].dtype)
        ends = np.cumsum([variable.size for variable in variables])
        self.parts = [slice(end - each.size, end) for each, end in zip(variables, ends, strict=True)]

    def __call__(self) -> None:
        """Move them."""
        status = self.call.call(self.member.instance, int(self.buffer.ctypes.data))
        self.member.check(status, f"access to {', '.join(self.names[:3])}")


def grouped(variables: list[MemberVariable]) -> list[list[MemberVariable]]:
    """Variables that one call can move together: same type, in order."""
    groups: dict[str, list[MemberVariable]] = {}
    for variable in variables:
        if variable.connectable:
            groups.setdefault(variable.type, []).append(variable)
    return list(groups.values())


class Feeder:
    """Sets the inputs of a table at a time."""

    def __init__(self, member: FMUMember, inputs: Inputs) -> None:
        self.member, self.inputs = member, inputs
        columns = {column.variable.name: column for column in inputs.columns}
        self.groups = [
            (Mover(member, group, write=True), [columns[variable.name] for variable in group])
            for group in grouped([column.variable for column in inputs.columns])
        ]
        self.objects = [column for column in inputs.columns if not column.variable.connectable]
        self.last: dict[str, Any] = {}

    def __call__(self, t: float) -> None:
        """Set all inputs to their values at t [s]."""
        for mover, columns in self.groups:
            for part, column in zip(mover.parts, columns, strict=True):
                mover.buffer[part] = self.inputs.at(column, t)
            mover()
        for column in self.objects:
            self.feed_objects(column, t)

    def feed_objects(self, column: InputColumn, t: float) -> None:
        """Strings and binaries are set when they change."""
        value = self.inputs.at(column, t).tolist()
        name = column.variable.name
        if self.last.get(name) != value:
            self.last[name] = value
            self.member.set(name, value if column.variable.shape else value[0])


class Sampler:
    """Records variables of a running FMU; in files of `folder`, if given, so that they outlive this process.

    `last`: how many rows there are, and the time of the step at work [s]. `again`: read what another process recorded.
    """

    def __init__(
        self, member: FMUMember, names: tuple[str, ...], rows: int, folder: str = "", again: bool = False
    ) -> None:
        self.folder, self.mode = folder, "r+" if again else "w+"
        self.member = member
        self.variables = [member.variables[name] for name in names]
        scalars = rows * sum(variable.size for variable in self.variables)
        if scalars > SCALARS:
            raise FMUError(
                f"{member.name}: {scalars} values to record are too many. Use --output-interval or --record."
            )
        self.last = self.table("last", (2,), np.dtype(np.float64))
        self.when = self.table("times", (rows,), np.dtype(np.float64))
        if not again:
            self.last[0] = 0
        self.times: list[clock.Time] = [clock.nanoseconds(time) for time in self.when[: int(self.last[0])].tolist()]
        self.rows = {
            each.name: self.table(str(i), (rows, each.size), each.dtype) for i, each in enumerate(self.variables)
        }
        for each in self.variables if again else ():
            if not each.connectable:
                self.rows[each.name][:] = b"" if each.type == "Binary" else ""
        self.movers = [] if again else [Mover(member, group, write=False) for group in grouped(self.variables)]
        self.objects = [variable for variable in self.variables if not variable.connectable]

    def table(self, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> np.ndarray[Any, Any]:
        """Room for a variable: what is no number is lost with the process."""
        if not self.folder or dtype.hasobject or not math.prod(shape):
            return np.empty(shape, dtype)
        return np.memmap(f"{self.folder}/{name}.simulated", dtype, self.mode, shape=shape)  # type: ignore[call-overload,no-any-return]

    def __call__(self, time: clock.Time) -> None:
        """Record a row at a time [ns]."""
        row = len(self.times)
        for mover in self.movers:
            mover()
            for name, part in zip(mover.names, mover.parts, strict=True):
                self.rows[name][row] = mover.buffer[part]
        for variable in self.objects:
            self.rows[variable.name][row] = np.asarray(self.member.get(variable.name), dtype=object).reshape(-1)
        self.times.append(time)
        self.when[row] = clock.seconds(time)
        self.last[0] = row + 1

    def results(self) -> Results:
        """What was recorded so far."""
        rows = [self.rows[variable.name][: len(self.times)] for variable in self.variables]
        return Results(self.times, self.variables, rows)
