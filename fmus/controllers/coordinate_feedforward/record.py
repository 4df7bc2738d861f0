"""Readings of a run on the virtual bench as the CSV files that `twin calibrate` reads.

    python -m fmus.coordinate_feedforward.record FOLDER runs/SCENARIO ...

The latest run of each scenario is taken, and of it the first seed.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow.parquet as pq
from fmus.coordinate_feedforward.bench import slide
from fmus.coordinate_feedforward.calibrate import TABLES
from fmus.coordinate_feedforward.statistics import ends

from fmus.injection import MILLIMETER
from twin.errors import TwinError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]

HANDLE, WIRE, NEEDLE = "program.handle_steps", "program.wire_steps", "program.needle_steps"
Y, Z, LENGTH = "camera.measured_y", "camera.measured_z", "camera.measured_needle_length"

# (scenario, variant) -> table and the signals of its columns
SOURCES = {
    ("stepper_calibration", "loaded"): ("steppers", (HANDLE, Z)),
    ("catheter_calibration", "linear"): ("linear", (HANDLE, Z)),
    ("catheter_calibration", "deflection"): ("deflection", (WIRE, Y, Z)),
    ("catheter_calibration", "coupling"): ("coupling", (WIRE, HANDLE, Y, Z)),
    ("needle", "calibration"): ("needle", (WIRE, NEEDLE, LENGTH)),
}


def readings(runs: Path) -> dict[str, NDArray[np.float64]]:
    """Read a scenario's runs: per table, the rows of step-counter positions and camera readings at rest [mm]."""
    paths = sorted(runs.glob("*/signals.parquet"))
    if not paths:
        raise TwinError(f"{runs}: holds no run. Run its scenario first, and name the folder such as runs/needle.")
    path = paths[-1]
    tables = {}
    for (scenario, variant), (table, names) in SOURCES.items():
        if runs.resolve().name != scenario:
            continue
        seed = pq.read_table(path, columns=["seed"])["seed"][0].as_py()
        rows = pq.read_table(
            path, columns=["program.number", *names], filters=[("variant", "=", variant), ("seed", "=", seed)]
        )
        at = ends(rows["program.number"].to_numpy().astype(float))
        columns = [column(name, rows[name].to_numpy().astype(float)[at], table) for name in names]
        tables[table] = np.column_stack(columns)
    return tables


def column(name: str, values: Values, table: str) -> Values:
    """Readings of a signal in the table's unit; steppers are recorded as single moves."""
    if table == "steppers":
        return np.diff(values if name == HANDLE else values / MILLIMETER, prepend=0.0)
    return slide(values) if name in (HANDLE, WIRE, NEEDLE) else values / MILLIMETER


def main(folder: Path, runs: list[Path]) -> None:
    """Write a file for each table that the runs have."""
    folder.mkdir(parents=True, exist_ok=True)
    for scenario in runs:
        for table, rows in readings(scenario).items():
            with (folder / f"{table}.csv").open("w", newline="") as file:
                writer = csv.writer(file)
                writer.writerow(TABLES[table])
                writer.writerows([f"{value:.6g}" for value in row] for row in rows)
            print(f"{folder / table}.csv: {len(rows)} readings")


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]])
