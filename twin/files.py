"""Atomic file writes, and reading of CSV files."""

from __future__ import annotations

import csv
import os
import re
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

from twin.errors import TwinError

WITH_UNIT = re.compile(r"(.*\S)\s+\[([^\]]*)\]")  # `tip [mm]`; without the blank it is an element, `x[2]`


def write_atomically(path: Path, data: bytes | str) -> None:
    """Write a file under a temporary name and rename it; a failed write leaves no file. Creates its folder. Text is UTF-8.

    Raises OSError with `path` in it: the system's own error for a full disk names no file.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.{os.getpid()}.{threading.get_ident()}")
    try:
        partial.write_bytes(data.encode() if isinstance(data, str) else data)
        partial.replace(path)
    except BaseException as error:
        with suppress(OSError):
            partial.unlink()
        if isinstance(error, OSError):
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise


def parse_float(value: Any) -> float:
    """Convert a cell to a number; ValueError for other text, also for `1_000`, which Python reads as 1000."""
    if isinstance(value, str) and "_" in value:
        raise ValueError(value)
    return float(value)


def read_csv(path: Path, separators: str = ",", error_type: type[TwinError] = TwinError) -> list[tuple[int, list[str]]]:
    """Return line number and cells of all lines of a CSV file that are not empty.

    Cells are separated by the first of `separators` that the first line has; an `error_type` names the file.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            first = file.readline()
            file.seek(0)
            separator = next((each for each in separators if each in first), separators[0])
            reader = csv.reader(file, delimiter=separator, strict=True)
            if "\0" in first:
                raise error_type(f"{path}: is not text. Save it as CSV in UTF-8.")
            return [(reader.line_num, cells) for cells in reader if any(cell.strip() for cell in cells)]
    except UnicodeDecodeError:
        raise error_type(f"{path}: is not UTF-8 text. Save it as CSV in UTF-8.") from None
    except (OSError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise error_type(f"{path}: cannot be read ({reason}). Give a CSV file with a header.") from None


def split_unit(name: str) -> tuple[str, str]:
    """Split the header of a column, `tip [mm]`, into name and unit; without a unit it is ""."""
    matched = WITH_UNIT.fullmatch(name)
    return (matched[1], matched[2].strip()) if matched else (name, "")


def shown_path(path: str) -> str:
    """Return the path of a file as it opens from the working folder: relative below it, else absolute; `cell` of a notebook's."""
    if "ipykernel_" in path:
        return "cell"
    absolute = Path(path)
    return str(absolute.relative_to(Path.cwd())) if absolute.is_relative_to(Path.cwd()) else path
