"""Calibration from bench measurements: tables in CSV files become parameters of a component.

A module `calibrate` next to the component's `model` defines what can be calibrated:

    TABLES                  table -> column -> meaning
    STROKES                 column -> largest range of its values on the rig
    calibrate(tables)       tables of arrays -> (parameters of the component, fits by name)
    standard_errors(fits)   fits -> standard errors, by the same names as the parameters
    doubts(tables, fits)    tables, fits -> a sentence for each result that the equations contradict

`calibrate` raises TwinError with one line for invalid data. A fit has `coefficients` and `errors`, `used` of `rows`,
`measured` and `predicted`, and in words `residual`, `span`, `noise` and `r_squared`, which `calibration_report` explains.
"""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import unit
from twin.errors import CouplingError, TwinError, nearest
from twin.files import parse_float, read_csv

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from types import ModuleType

    from twin.component import Component

    Table = dict[str, np.ndarray[Any, Any]]

SMALL, LARGE = 0.25, 1.2  # range of a column over the rig's stroke, beyond which its unit is doubted
OTHER_UNITS = {"in": 25.4, "cm": 10.0, "m": 1e3, "um": 1e-3}  # [mm] that files hold without saying so


@dataclass(frozen=True)
class Calibration:
    """Result of a calibration: `parameters` with standard `errors` by the same names, `fits` by name, `hints` on units."""

    parameters: dict[str, Any]
    errors: dict[str, Any]
    fits: dict[str, Any]
    hints: list[str]


def calibration_module(cls: type[Component], shown: str) -> ModuleType:
    """Import the component's calibration; TwinError if it has none."""
    name = f"{cls.__module__.rpartition('.')[0]}.calibrate"
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise TwinError(f"{shown}: has no calibration. A component that has one keeps it in {name}.") from None


def read_rows(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Read a CSV file: header, and the other nonempty rows with their line numbers. A TwinError names the file."""
    lines = read_csv(path, ",;")
    return [name.strip() for name in lines[0][1]] if lines else [], lines[1:]


def read_table(path: Path, columns: Mapping[str, str], aliases: Mapping[str, tuple[str, str]]) -> Table:
    """Read columns of a CSV file with a header, converted to their own units. A TwinError names file and line.

    `aliases`: column -> its name and unit in the file; without, the column's own name and the unit in its header,
    `handle [in]` or `Handle (in)`. A name may leave out the unit of the header; a column `handle_mm` is also found as
    `handle` if the header has a unit. Upper and lower case count as equal if no name is exactly the same.
    """
    header, rows = read_rows(path)
    full_names = {f"{base}_mm": name for name in header for base, symbol in [unit.split_header(name)] if symbol}
    full_names |= {unit.split_header(name)[0]: name for name in header} | {name: name for name in header}
    names = {column: aliases.get(column, ("", ""))[0] or column for column in columns}
    any_case = {name.casefold(): full_name for name, full_name in full_names.items()}
    names = {column: full_names.get(name) or any_case.get(name.casefold(), name) for column, name in names.items()}
    missing = [name for name in names.values() if name not in header]
    if missing:
        existing = ", ".join(header) or "nothing"
        raise TwinError(
            f"{path}: column `{missing[0]}` is missing; there is {existing}. Name the columns {', '.join(names.values())}, "
            "or map them to the names in the file with --columns (see `twin calibrate --help`)."
        )
    if not rows:
        raise TwinError(f"{path}: has no readings below its header. Give one line for each.")
    table = {}
    for column, name in names.items():
        index = header.index(name)
        values = [parse_cell(row, index, header, f"{path}:{number}") for number, row in rows]
        symbol = aliases.get(column, ("", ""))[1] or unit.split_header(name)[1]
        try:
            factor, offset = unit.conversion(symbol, unit_of(column), name) if symbol else (1.0, 0.0)
        except CouplingError as error:
            raise TwinError(f"{path}: {error} Correct the unit of {column}.") from None
        table[column] = factor * np.array(values) + offset
    return table


def unit_of(column: str) -> str:
    """Unit of a column of a table of `TABLES`, by its name."""
    return "mm" if column.endswith("_mm") else "1"


def parse_cell(row: list[str], index: int, header: list[str], where: str) -> float:
    """Parse a finite number."""
    text = row[index].strip() if index < len(row) else ""
    try:
        value = parse_float(text)
    except ValueError:
        hint = " Write a decimal point." if "," in text else ""
        raise TwinError(f"{where}: {header[index]} is {text!r}, expected a number.{hint}") from None
    if not math.isfinite(value):
        raise TwinError(f"{where}: {header[index]} is {text}, expected a finite number. Leave the line out.")
    return value


def calibrate(
    cls: type[Component],
    shown: str,
    files: Mapping[str, Path],
    aliases: Mapping[str, Mapping[str, tuple[str, str]]],
) -> Calibration:
    """Determine parameters from the measurements in files.

    `aliases`: table -> column -> its name and unit in the file.
    """
    module = calibration_module(cls, shown)
    for name, columns in aliases.items():
        if unknown := [column for column in columns if column not in module.TABLES.get(name, {})]:
            raise TwinError(
                f"columns: {shown} has no table with column {name}.{unknown[0]}. "
                f"{nearest(unknown[0], module.TABLES.get(name, {}))}"
            )
    tables = {}
    for name, path in files.items():
        if name not in module.TABLES:
            raise TwinError(f"{name}={path}: {shown} has no table {name!r}. Its tables: {', '.join(module.TABLES)}.")
        tables[name] = read_table(path, module.TABLES[name], aliases.get(name, {}))
    try:
        parameters, fits = module.calibrate(tables)
    except TwinError as error:
        constant = [
            f"{n}.{column}" for n, t in tables.items() for column, v in t.items() if len(v) > 1 and not np.ptp(v)
        ]
        raise TwinError(f"{error} The same in all rows: {', '.join(constant)}." if constant else str(error)) from None
    names = {variable.name for variable in cls.variables}
    assert names.issuperset(parameters), f"{shown}: calibrate gave {set(parameters) - names}"
    hints = [
        hint
        for name, table in tables.items()
        for column, values in table.items()
        if column in module.STROKES
        for hint in stroke_hints(f"{name}.{column}", values, module.STROKES[column])
    ]
    return Calibration(parameters, module.standard_errors(fits), fits, hints + module.doubts(tables, fits))


def stroke_hints(column: str, values: np.ndarray[Any, Any], stroke: float) -> list[str]:
    """Return a sentence if the range of a column [mm] is much smaller or larger than the rig's stroke [mm]."""
    span = float(np.ptp(values))
    if SMALL <= span / stroke <= LARGE:
        return []
    others = [symbol for symbol, factor in OTHER_UNITS.items() if SMALL <= span * factor / stroke <= LARGE]
    symbol = min(others, key=lambda other: abs(math.log(span * OTHER_UNITS[other] / stroke)), default="")
    name = column.rpartition(".")[2].removesuffix("_mm")
    likely = f" With the header `{name} [{symbol}]` it spans {span * OTHER_UNITS[symbol]:.3g} mm." if symbol else ""
    return [f"{column} spans {span:.3g} mm, the rig's stroke is {stroke:g} mm. Check its unit.{likely}"]
