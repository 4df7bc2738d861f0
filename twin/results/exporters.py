"""Recorded signals as files of other tools: CSV, MAT of MATLAB and Octave, MCAP of Foxglove. Units go with them."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import unit
from twin.errors import TwinError
from twin.results.mcap_export import mcap
from twin.results.signal_reader import read_variables

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from twin.results.signal_reader import Recorded

    Cases = set[tuple[str, int]]

LONGEST = 63  # letters of a name in MATLAB
MOST = 2**31 - 1  # bytes of a variable of a MAT file of level 5


def csv(source: Path, target: Path, variables: Sequence[Recorded], cases: Cases) -> None:
    """Columns variant, seed, time [s], then one for each scalar as `sensor.force [N]`; what was not recorded is empty.

    Read and written part by part: a recording may be larger than memory.
    """
    import pyarrow as pa
    from pyarrow import csv as table
    from pyarrow import parquet

    columns = [column for one in variables for column in one.columns]
    units = {column: one.unit for one in variables for column in one.columns}
    with parquet.ParquetFile(source) as file:
        fields = [pa.field("variant", pa.string()), pa.field("seed", pa.int64()), pa.field("time [s]", pa.float64())]
        fields += [pa.field(titled(name, units[name]), file.schema_arrow.field(name).type) for name in columns]
        schema = pa.schema(fields)
        with table.CSVWriter(str(target), schema) as writer:
            for batch in file.iter_batches(columns=["variant", "seed", "time", *columns]):
                names, seeds = batch.column("variant").to_pylist(), batch.column("seed").to_pylist()
                there = np.array([case in cases for case in zip(names, seeds, strict=True)], bool)
                if not there.any():
                    continue
                parts = [batch.column("variant").cast(pa.string())]
                parts += [batch.column(name) for name in ("seed", "time", *columns)]
                chosen = pa.Table.from_arrays(parts, schema=schema).take(np.flatnonzero(there))
                writer.write_table(chosen)


def titled(name: str, symbol: str) -> str:
    """`sensor.force [N]`."""
    return f"{name} [{unit.shown(symbol)}]" if symbol else name


def mat(source: Path, target: Path, variables: Sequence[Recorded], cases: Cases) -> None:
    """`cases(i).signals.sensor_force` over `cases(i).time`; `about.sensor_force` has its name, unit and description.

    Arrays keep their shape, time first. Level 5 of the format, which holds 2 GiB in a variable.
    """
    from scipy.io import savemat

    fields = identifiers([one.name for one in variables])
    found = []
    for (variant, seed), signals in read_variables(source, variables).items():
        if (variant, seed) not in cases:
            continue
        values = {fields[name]: np.asarray(value) for name, value in signals.values.items()}
        if sum(value.nbytes for value in values.values()) > MOST:
            raise TwinError(f"{target}: {variant}, seed {seed} is larger than 2 GiB. Choose fewer with --signal.")
        columns = {name: value[:, None] if value.ndim == 1 else value for name, value in values.items()}
        found.append({"variant": variant, "seed": float(seed), "time": signals.time[:, None], "signals": columns})
    about = {
        fields[one.name]: {"name": one.name, "unit": one.unit, "description": one.description} for one in variables
    }
    savemat(target, {"cases": structs(found), "about": about}, long_field_names=True, do_compression=True)


def structs(found: Sequence[dict[str, Any]]) -> Any:
    """A struct array of MATLAB."""
    array = np.empty(len(found), [(name, object) for name in ("variant", "seed", "time", "signals")])
    for place, one in enumerate(found):
        array[place] = tuple(one.values())
    return array


def identifiers(names: Sequence[str]) -> dict[str, str]:
    """Each name as MATLAB can write it, none twice: `sheath.x[3]` as `sheath_x_3`."""
    result: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        plain = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_")
        plain = (plain if plain[:1].isalpha() else f"x{plain}")[:LONGEST]
        own, count = plain, 1
        while own in taken:
            count += 1
            own = f"{plain[: LONGEST - 1 - len(str(count))]}_{count}"
        taken.add(own)
        result[name] = own
    return result


FORMATS: dict[str, Callable[[Path, Path, Sequence[Recorded], Cases], None]] = {".csv": csv, ".mat": mat, ".mcap": mcap}


def export(source: Path, target: Path, variables: Sequence[Recorded], cases: Cases) -> None:
    """Write chosen signals of a signals.parquet, whole or not at all; the file's ending says how."""
    beside = target.with_name(f".{os.getpid()}.{target.name}")
    try:
        FORMATS[target.suffix.lower()](source, beside, variables, cases)
        beside.replace(target)
    except OSError as error:
        raise TwinError(f"{target}: cannot be written ({error.strerror}). Choose another file.") from None
    finally:
        beside.unlink(missing_ok=True)
