"""A CSV file as a member: its columns are outputs that follow the rows.

members: {operator: {component: command.csv}}
connections: [operator.target_velocity -> servomotor.target_velocity]
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import Boolean, PythonComponent, output, parameter, unit
from twin.errors import CouplingError, DeclarationError, FMUError, TwinError
from twin.files import split_unit
from twin.fmi.csv_tables import MEETS, number, read_cells, read_times

if TYPE_CHECKING:
    from twin.component import Component

SUFFIX = ".csv"


def component(file: str) -> type[Component]:
    """The component of a table: column `time`, and one for each output, `name` or `name [unit]`.

    FMI's rules for inputs: linear between rows, or held with `hold: true`; constant before the first and after the last
    row; of two rows at one time the later one holds at and after it. TwinError names file and line of what is wrong.
    """
    path = Path(file)
    if not path.is_file():
        raise FMUError(f"there is no file {file}. Give a path relative to the scenario.")
    lines = read_cells(path)
    header = [split_unit(name.strip()) for name in lines[0][1]]
    where = f"{file}:{lines[0][0]}"
    names = [name for name, _ in header]
    if "time" not in names or len(lines) < 2:
        raise FMUError(f"{where}: expected a column `time` and rows below the header. Name the first column time.")
    if doubled := [name for name in names if names.count(name) > 1]:
        raise FMUError(f"{where}: column {doubled[0]!r} stands there twice. Remove one of them.")
    time_column = names.index("time")
    times = read_times(file, lines[1:], time_column, header[time_column][1])
    columns = [i for i in range(len(header)) if i != time_column]
    rows = np.array([[number(cells[i], f"{file}:{line}: {names[i]}") for i in columns] for line, cells in lines[1:]])
    outputs = {}
    for i in columns:
        name, symbol = header[i]
        if not name.isidentifier():
            raise FMUError(f"{where}: column {name!r} is no name of a variable. Use letters, digits and _.")
        try:
            unit.describe(symbol)
        except CouplingError as error:
            raise FMUError(f"{where}: column {name!r}: {error}") from None
        outputs[name] = output(symbol, f"column of {path.name}")
    body: dict[str, Any] = {
        "__doc__": f"Rows of {path.name}.",
        "__module__": __name__,
        "hold": parameter(False, "", "hold values between rows", type=Boolean, source="FMI: of discrete inputs"),
        "_table": (times, rows, tuple(outputs)),
        **outputs,
    }
    try:
        return type("".join(letter if letter.isalnum() else "_" for letter in path.stem), (Table,), body)
    except DeclarationError as error:
        raise FMUError(f"{where}: {str(error).partition('.')[2]}") from None
    except TwinError as error:
        raise FMUError(f"{where}: {error}") from None


class Table(PythonComponent):
    """Follows its rows; its subclasses have the columns."""

    _table: tuple[np.ndarray[Any, Any], np.ndarray[Any, Any], tuple[str, ...]]
    hold: bool
    state_is_record = True

    def start(self, t: float = 0.0) -> None:
        """Set the outputs to the rows' values at t [s]."""
        self._follow(t, 0.0)

    def step(self, t: float, h: float) -> None:
        """Go to t + h [s]. A row a thousandth of a step later is meant to be met, unless the one before is nearer."""
        self._follow(t + h, MEETS * h)

    def _follow(self, t: float, near: float) -> None:
        times, rows, names = self._table
        row = int(np.searchsorted(times, t, side="right")) - 1
        later = float(times[min(row + 1, len(times) - 1)])
        if 0.0 < later - t <= near and (row < 0 or later - t < t - times[row]):
            row = int(np.searchsorted(times, later, side="right")) - 1
        row = max(row, 0)
        values = rows[row]
        if not self.hold and row + 1 < len(times) and t > times[row]:
            values = values + (t - times[row]) / (times[row + 1] - times[row]) * (rows[row + 1] - values)
        for name, value in zip(names, values.tolist(), strict=True):
            self.views[name][...] = value
