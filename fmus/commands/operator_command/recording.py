"""An operator's recording, from CSV with units, to the table of `operator_command` as a parameter set.

python -m fmus.operator_command.recording mine.csv > mine.yaml
"""

from __future__ import annotations

import csv
import re
import sys
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from fmus.operator_command.model import ROWS

from twin.component import unit
from twin.errors import CouplingError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

HELD = ("none", "catheter", "wire", "both")
SPEED_MAXIMUM, TURN_MAXIMUM = 0.04, 1.2566  # [m/s], [rad/s], as the component passes on at most
DRIFT_MAXIMUM = 2e-3  # between file and table, of a position [m]
COLUMN = re.compile(r"\s*(\w+)\s*(?:\[\s*(.*?)\s*\])?\s*")

# axis of the table: columns that give it, with their units, what is left out of the table [m/s, rad/s], largest value
AXES = {
    "catheter_speed": ({"catheter_velocity": "m/s", "catheter_position": "m"}, 0.5e-3, SPEED_MAXIMUM),
    "wire_speed": ({"wire_velocity": "m/s", "wire_position": "m"}, 0.5e-3, SPEED_MAXIMUM),
    "catheter_turn": ({"catheter_rotation": "rad/s"}, 0.02, TURN_MAXIMUM),
    "wire_turn": ({"wire_rotation": "rad/s"}, 0.02, TURN_MAXIMUM),
}
UNITS = {"time": "s", **{name: symbol for columns, _, _ in AXES.values() for name, symbol in columns.items()}}
SYMBOLS = {"catheter_speed": "m/s", "wire_speed": "m/s", "catheter_turn": "rad/s", "wire_turn": "rad/s"}
REQUIRED = ("catheter_speed", "wire_speed")
NEEDED = "time, catheter_velocity or catheter_position, wire_velocity or wire_position"


def header(path: Path, names: list[str]) -> dict[str, tuple[int, float]]:
    """Column of each quantity and its factor to SI; `held` has none."""
    columns: dict[str, tuple[int, float]] = {}
    for index, text in enumerate(names):
        matched = COLUMN.fullmatch(text)
        name, symbol = (matched[1], matched[2]) if matched else (text.strip(), None)
        if name in columns:
            raise ValueError(f"{path}: column `{name}` is there twice. Leave one.")
        if name == "held":
            columns[name] = (index, 1.0)
        elif name not in UNITS:
            raise ValueError(f"{path}: unknown column `{text.strip()[:40]}`. Expected {', '.join((*UNITS, 'held'))}.")
        elif not symbol:
            raise ValueError(f"{path}: column `{name}` has no unit. Write `{name} [{UNITS[name]}]`, or another unit.")
        else:
            try:
                factor, _ = unit.conversion(symbol, UNITS[name], "")
            except CouplingError:
                problem = f"column `{name}` is in {symbol}, which does not convert to {UNITS[name]}. Correct the unit"
                raise ValueError(f"{path}: {problem}.") from None
            columns[name] = (index, factor)
    for name, (possible, _, _) in AXES.items():
        given = [column for column in possible if column in columns]
        if "time" not in columns or len(given) > 1 or (name in REQUIRED and not given):
            raise ValueError(f"{path}: columns {', '.join(columns)}. Expected {NEEDED}, each axis once.")
    return columns


def read(path: Path) -> tuple[Array, dict[str, Array], NDArray[np.int64]]:
    """Read a recording: instants [s], speed of each axis in SI, and the held instruments from each instant on; checked."""
    if not path.is_file():
        raise ValueError(f"{path}: no such file. Expected a recording, .csv.")
    try:
        lines = [row for row in csv.reader(path.read_text(encoding="utf-8-sig").splitlines()) if any(row)]
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: {error}. Expected a text file, .csv.") from None
    if len(lines) < 3:
        raise ValueError(f"{path}: {max(len(lines) - 1, 0)} rows. Expected 2 or more under a line of names with units.")
    columns = header(path, lines[0])
    values: dict[str, Array] = {}
    for name, (index, factor) in columns.items():
        if name != "held":
            values[name] = np.array([number(path, i, name, row, index) for i, row in enumerate(lines[1:], 1)]) * factor
    time = values["time"]
    wrong = np.flatnonzero(np.diff(time) <= 0.0)
    if len(wrong) or time[0] < 0.0:
        row = int(wrong[0]) + 2 if len(wrong) else 1
        raise ValueError(f"{path}: row {row}: time {time[row - 1]:g} s. Expected times from 0 on that rise.")
    time = time - time[0]
    held = np.zeros(len(time), np.int64)
    if "held" in columns:
        held = np.array([holding(path, i, row, columns["held"][0]) for i, row in enumerate(lines[1:], 1)])
    return time, speeds(path, time, values, held), held


def number(path: Path, i: int, name: str, row: list[str], index: int) -> float:
    """A finite number of a row."""
    text = row[index].strip() if index < len(row) else ""
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise ValueError(f"{path}: row {i}: {name} is `{text[:40]}`. Expected a number.")
    return value


def holding(path: Path, i: int, row: list[str], index: int) -> int:
    """Which instrument a row holds."""
    text = row[index].strip().lower() if index < len(row) else ""
    if text not in HELD:
        raise ValueError(f"{path}: row {i}: held is `{text[:40]}`. Expected {', '.join(HELD)}.")
    return HELD.index(text)


def speeds(path: Path, time: Array, values: dict[str, Array], held: NDArray[np.int64]) -> dict[str, Array]:
    """Return the speed of each axis at each instant; raise an error if a held instrument moves or a speed exceeds the rig's."""
    speed_by_axis: dict[str, Array] = {}
    for k, (axis, (columns, _, most)) in enumerate(AXES.items()):
        name = next((column for column in columns if column in values), "")
        speed = np.zeros(len(time))
        if name.endswith("_position"):
            speed = np.gradient(values[name], time)
        elif name:
            speed = values[name]
        fast = np.flatnonzero(np.abs(speed) > most * (1.0 + 1e-3))
        if len(fast):
            i = int(fast[0])
            shown = f"{1e3 * speed[i]:.4g} mm/s" if k < 2 else f"{np.degrees(speed[i]):.4g} deg/s"
            limit = f"{1e3 * most:g} mm/s" if k < 2 else f"{np.degrees(most):.3g} deg/s"
            raise ValueError(f"{path}: row {i + 1}: {name} asks for {shown}. Expected at most {limit}; check the unit.")
        still = (held[:-1] == 3) | (held[:-1] == 1 + k % 2)
        moves = np.flatnonzero(still & ((np.abs(speed[:-1]) > 1e-9) | (np.abs(speed[1:]) > 1e-9)))
        if len(moves) and not name.endswith("_position"):
            i = int(moves[0])
            raise ValueError(
                f"{path}: row {i + 1}: {HELD[1 + k % 2]} is held and moves by {name}. Let it rest until the next row, or free it."
            )
        speed_by_axis[axis] = speed
    return speed_by_axis


def essential_rows(time: Array, axes: dict[str, Array], held: NDArray[np.int64]) -> NDArray[np.intp]:
    """Rows whose linear interpolation stays within the tolerance (Douglas and Peucker, 1973)."""
    values = np.column_stack([axes[name] / left_out for name, (_, left_out, _) in AXES.items()])
    changes = np.flatnonzero(np.diff(held) != 0) + 1
    rows = sorted({0, len(time) - 1, *changes.tolist()})
    parts = list(pairwise(rows))
    while parts:
        a, b = parts.pop()
        if b - a < 2:
            continue
        part = ((time[a : b + 1] - time[a]) / (time[b] - time[a]))[:, None]
        off = np.abs(values[a : b + 1] - values[a] - part * (values[b] - values[a])).max(axis=1)
        worst = int(np.argmax(off))
        if off[worst] > 1.0:
            rows.append(a + worst)
            parts += [(a, a + worst), (a + worst, b)]
    return np.array(sorted(rows))


def drift(time: Array, speed: Array, rows: NDArray[np.intp]) -> float:
    """Largest difference of position between all rows and the selected rows."""
    steps = 0.5 * np.diff(time) * (speed[1:] + speed[:-1])
    table = np.interp(time, time[rows], speed[rows])
    others = 0.5 * np.diff(time) * (table[1:] + table[:-1])
    return float(np.abs(np.cumsum(steps - others)).max())


def parameter_set(path: Path) -> str:
    """The table as YAML for `parameter_sets`."""
    time, axes, held = read(path)
    rows = essential_rows(time, axes, held)
    if len(rows) > ROWS:
        raise ValueError(
            f"{path}: needs {len(rows)} rows after thinning, there is room for {ROWS}. Smooth it, or cut it into parts."
        )
    off = max(drift(time, axes[name], rows) for name in ("catheter_speed", "wire_speed"))
    if off > DRIFT_MAXIMUM:
        raise ValueError(
            f"{path}: a position would drift by {1e3 * off:.3g} mm in {len(rows)} rows. Smooth it, or cut it into parts."
        )
    lines = [
        f"# from {path.name}: {len(rows)} of {len(time)} rows, positions within {1e3 * off:.2g} mm",
        "operator_command:",
        f"  rows: {len(rows)}",
        f"  instant: {row_of(time[rows])}  # s",
        *(f"  {name}: {row_of(axes[name][rows])}  # {symbol}" for name, symbol in SYMBOLS.items()),
        f"  hold: {row_of(held[rows])}",
    ]
    return "\n".join(lines) + "\n"


def row_of(values: Array | NDArray[np.int64]) -> str:
    """An array of the table as YAML, 0 behind its end; one number where all are the same."""
    texts = [f"{value + 0.0:.6g}" for value in values] + ["0"] * (ROWS - len(values))
    return "0" if set(texts) == {"0"} else f"[{', '.join(texts)}]"


if __name__ == "__main__":
    try:
        sys.stdout.write(parameter_set(Path(sys.argv[1])))
    except (ValueError, IndexError) as error:
        sys.exit(str(error) if len(sys.argv) > 1 else "recording: no file named. Expected one .csv.")
