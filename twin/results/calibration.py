"""Calibration from recorded readings: tables of numbers in CSV files become parameters of a component.

What can be calibrated, and how, stands in a module `calibrate` beside the component's `model`:

    TABLES                  table -> column -> meaning
    calibrate(tables)       tables of arrays -> (parameters of the component, fits by name)

A fit has `coefficients`, `r_squared` and `residual`. What `calibrate` cannot do it says by a TwinError of one line.
"""

from __future__ import annotations

import csv
import importlib
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from twin.errors import TwinError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from types import ModuleType

    from twin.component import Component

    Table = dict[str, np.ndarray[Any, Any]]


def module(cls: type[Component], shown: str) -> ModuleType:
    """The component's calibration."""
    name = f"{cls.__module__.rpartition('.')[0]}.calibrate"
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise TwinError(f"{shown}: has no calibration. A component that has one keeps it in {name}.") from None


def rows_of(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Header of a CSV file, and its other rows that are not empty, with their lines. A TwinError names the file."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise TwinError(f"{path}: cannot be read ({error.strerror}).") from None
    except UnicodeDecodeError:
        raise TwinError(f"{path}: is no text. Save the table as CSV in UTF-8.") from None
    separator = ";" if lines and ";" in lines[0] and "," not in lines[0] else ","
    rows = list(csv.reader(lines, delimiter=separator))
    header = [name.strip() for name in rows[0]] if rows else []
    return header, [(number, row) for number, row in enumerate(rows[1:], 2) if any(cell.strip() for cell in row)]


def read(path: Path, columns: Mapping[str, str]) -> Table:
    """A CSV file with a header; columns that are not asked for are left out. A TwinError names file and line."""
    header, rows = rows_of(path)
    missing = [name for name in columns if name not in header]
    if missing:
        found = ", ".join(header) or "nothing"
        raise TwinError(
            f"{path}: column {missing[0]} is missing; there is {found}. Name the columns {', '.join(columns)}."
        )
    places = [header.index(name) for name in columns]
    values = [[cell_value(row, place, header, f"{path}:{number}") for place in places] for number, row in rows]
    if not values:
        raise TwinError(f"{path}: has no readings below its header. Give one line for each.")
    array = np.array(values)
    return {name: array[:, place] for place, name in enumerate(columns)}


def cell_value(row: list[str], place: int, header: list[str], where: str) -> float:
    """A finite number."""
    text = row[place].strip() if place < len(row) else ""
    try:
        value = float(text)
    except ValueError:
        hint = " Write a decimal point." if "," in text else ""
        raise TwinError(f"{where}: {header[place]} is {text!r}, expected a number.{hint}") from None
    if not math.isfinite(value):
        raise TwinError(f"{where}: {header[place]} is {text}, expected a finite number. Leave the line out.")
    return value


def calibrate(cls: type[Component], shown: str, files: Mapping[str, Path]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Parameters that the files' readings determine, and the fits."""
    own = module(cls, shown)
    tables = {}
    for name, path in files.items():
        if name not in own.TABLES:
            raise TwinError(f"{name}={path}: {shown} knows no table {name!r}. It knows {', '.join(own.TABLES)}.")
        tables[name] = read(path, own.TABLES[name])
    parameters, fits = own.calibrate(tables)
    known = {variable.name for variable in cls.variables}
    assert known.issuperset(parameters), f"{shown}: calibrate gave {set(parameters) - known}"
    return parameters, fits


def text(shown: str, files: Mapping[str, Path], parameters: Mapping[str, Any], fits: Mapping[str, Any]) -> str:
    """A YAML file: `parameters` as a scenario's member takes them, quality of each fit as a comment."""
    lines = [f"# {shown}, calibrated from {', '.join(f'{name}={path.name}' for name, path in files.items())}"]
    for name, fit in fits.items():
        quality = "" if math.isnan(fit.r_squared) else f"R2 {fit.r_squared:.4f}, "
        lines.append(f"# {name}: {quality}residual {fit.residual:.3g}, {len(fit.used)} readings")
    body = yaml.safe_dump({"parameters": dict(parameters)}, sort_keys=False, default_flow_style=None, width=110)
    return "\n".join(lines) + "\n" + body
