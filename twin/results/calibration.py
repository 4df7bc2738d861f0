"""Calibration from bench measurements: tables in CSV files become parameters of a component.

A module `calibrate` next to the component's `model` defines what can be calibrated:

    TABLES                  table -> column -> meaning
    calibrate(tables)       tables of arrays -> (parameters of the component, fits by name)

A fit has `coefficients`, `r_squared` and `residual`. `calibrate` raises TwinError with one line for invalid data.
"""

from __future__ import annotations

import importlib
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from twin.component import unit
from twin.errors import CouplingError, TwinError, nearest
from twin.files import read_csv, split_unit

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from types import ModuleType

    from twin.component import Component

    Table = dict[str, np.ndarray[Any, Any]]

POOR_FIT = 0.9  # R2 below which a fit is reported


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

    `aliases`: column -> its name and unit in the file; without, the column's own name and the unit in its header.
    A name may leave out the unit of the header.
    """
    header, rows = read_rows(path)
    full_names = {split_unit(name)[0]: name for name in header} | {name: name for name in header}
    names = {column: aliases.get(column, ("", ""))[0] or column for column in columns}
    names = {column: full_names.get(name, name) for column, name in names.items()}
    missing = [name for name in names.values() if name not in header]
    if missing:
        existing = ", ".join(header) or "nothing"
        raise TwinError(
            f"{path}: column {missing[0]} is missing; there is {existing}. Name the columns {', '.join(names.values())}, "
            "or say with --columns how the file calls them."
        )
    if not rows:
        raise TwinError(f"{path}: has no readings below its header. Give one line for each.")
    table = {}
    for column, name in names.items():
        index = header.index(name)
        values = [parse_cell(row, index, header, f"{path}:{number}") for number, row in rows]
        symbol = aliases.get(column, ("", ""))[1] or split_unit(name)[1]
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
        value = float(text)
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
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Determine parameters from the measurements in files; return them and the fits.

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
    parameters, fits = module.calibrate(tables)
    names = {variable.name for variable in cls.variables}
    assert names.issuperset(parameters), f"{shown}: calibrate gave {set(parameters) - names}"
    return parameters, fits


def quality(fit: Any) -> str:
    """Return in words how well a fit fits."""
    share = "" if math.isnan(fit.r_squared) else f"R2 {fit.r_squared:.4f}, "
    return f"{share}residual {fit.residual:.3g}, {len(fit.used)} measurements"


def warnings(fits: Mapping[str, Any]) -> list[str]:
    """Return a sentence for each fit that explains too little of its measurements."""
    return [
        f"warning: {name}: R2 {fit.r_squared:.2f} is below {POOR_FIT}. Check columns, units and order of its measurements."
        for name, fit in fits.items()
        if fit.r_squared < POOR_FIT
    ]


def to_yaml(shown: str, files: Mapping[str, Path], parameters: Mapping[str, Any], fits: Mapping[str, Any]) -> str:
    """Format as YAML: `parameters` as in a scenario's member, quality of each fit as a comment."""
    lines = [f"# {shown}, calibrated from {', '.join(f'{name}={path.name}' for name, path in files.items())}"]
    for name, fit in fits.items():
        lines.append(f"# {name}: {quality(fit)}")
    lines += [f"# {text}" for text in warnings(fits)]
    body = yaml.safe_dump({"parameters": dict(parameters)}, sort_keys=False, default_flow_style=None, width=110)
    return "\n".join(lines) + "\n" + body
