"""Export of recorded signals with their units: CSV, MAT (MATLAB, Octave), MCAP (Foxglove)."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import unit
from twin.errors import TwinError
from twin.results.mcap_export import export_mcap
from twin.results.recording.signal_reader import read_variables

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from twin.results.recording.run_folder import RecordedVariable

    Cases = set[tuple[str, int]]

MAX_NAME_LENGTH = 63  # letters of a name in MATLAB
MAX_VARIABLE_SIZE = 2**31 - 1  # bytes of a variable of a MAT file of level 5


def export_csv(source: Path, target: Path, variables: Sequence[RecordedVariable], cases: Cases) -> None:
    """Write columns variant, seed, time [s], then one for each scalar as `sensor.force [N]`; missing values are empty.

    Read and written part by part: a recording may be larger than memory.
    """
    import pyarrow as pa
    from pyarrow import csv as table
    from pyarrow import parquet

    columns = [column for variable in variables for column in variable.columns]
    units = {column: variable.unit for variable in variables for column in variable.columns}
    with parquet.ParquetFile(source) as file:
        fields = [pa.field("variant", pa.string()), pa.field("seed", pa.int64()), pa.field("time [s]", pa.float64())]
        fields += [pa.field(column_title(name, units[name]), file.schema_arrow.field(name).type) for name in columns]
        schema = pa.schema(fields)
        with table.CSVWriter(str(target), schema) as writer:
            for batch in file.iter_batches(columns=["variant", "seed", "time", *columns]):
                names, seeds = batch.column("variant").to_pylist(), batch.column("seed").to_pylist()
                is_selected = np.array([case in cases for case in zip(names, seeds, strict=True)], bool)
                if not is_selected.any():
                    continue
                parts = [batch.column("variant").cast(pa.string())]
                parts += [batch.column(name) for name in ("seed", "time", *columns)]
                selected = pa.Table.from_arrays(parts, schema=schema).take(np.flatnonzero(is_selected))
                writer.write_table(selected)


def column_title(name: str, symbol: str) -> str:
    """Format the title of a column: `sensor.force [N]`."""
    return f"{name} [{unit.shown(symbol)}]" if symbol else name


def export_mat(source: Path, target: Path, variables: Sequence[RecordedVariable], cases: Cases) -> None:
    """Write `cases(i).signals.sensor_force` over `cases(i).time`; `about.sensor_force`: name, unit and description.

    Arrays keep their shape, time first. MAT level 5, whose variables are limited to 2 GiB.
    """
    from scipy.io import savemat

    fields = matlab_names([variable.name for variable in variables])
    structs = []
    for (variant, seed), signals in read_variables(source, variables).items():
        if (variant, seed) not in cases:
            continue
        values = {fields[name]: np.asarray(value) for name, value in signals.values.items()}
        if sum(value.nbytes for value in values.values()) > MAX_VARIABLE_SIZE:
            raise TwinError(f"{target}: {variant}, seed {seed} is larger than 2 GiB. Choose fewer with --signal.")
        columns = {name: value[:, None] if value.ndim == 1 else value for name, value in values.items()}
        structs.append({"variant": variant, "seed": float(seed), "time": signals.time[:, None], "signals": columns})
    about = {
        fields[variable.name]: {"name": variable.name, "unit": variable.unit, "description": variable.description}
        for variable in variables
    }
    savemat(target, {"cases": struct_array(structs), "about": about}, long_field_names=True, do_compression=True)


def struct_array(cases: Sequence[dict[str, Any]]) -> Any:
    """Create a struct array of MATLAB."""
    array = np.empty(len(cases), [(name, object) for name in ("variant", "seed", "time", "signals")])
    for index, case in enumerate(cases):
        array[index] = tuple(case.values())
    return array


def matlab_names(names: Sequence[str]) -> dict[str, str]:
    """Map names to unique names that are valid in MATLAB: `sheath.x[3]` to `sheath_x_3`."""
    result: dict[str, str] = {}
    used: set[str] = set()
    for name in names:
        base = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_")
        base = (base if base[:1].isalpha() else f"x{base}")[:MAX_NAME_LENGTH]
        unique, count = base, 1
        while unique in used:
            count += 1
            unique = f"{base[: MAX_NAME_LENGTH - 1 - len(str(count))]}_{count}"
        used.add(unique)
        result[name] = unique
    return result


FORMATS: dict[str, Callable[[Path, Path, Sequence[RecordedVariable], Cases], None]] = {
    ".csv": export_csv,
    ".mat": export_mat,
    ".mcap": export_mcap,
}


def export(source: Path, target: Path, variables: Sequence[RecordedVariable], cases: Cases) -> None:
    """Write selected signals of a signals.parquet atomically; the suffix of the target determines the format."""
    from pyarrow import ArrowException

    temporary = target.with_name(f".{os.getpid()}.{target.name}")
    try:
        FORMATS[target.suffix.lower()](source, temporary, variables, cases)
        temporary.replace(target)
    except (ArrowException, OSError) as error:
        if getattr(error, "errno", None) is None:  # an error of Arrow about damaged data
            reason = str(error).splitlines()[0]
            raise TwinError(f"{source}: cannot be read ({reason}). Run the scenario again.") from None
        raise TwinError(
            f"{target}: cannot be written ({getattr(error, 'strerror', error)}). Choose another file."
        ) from None
    finally:
        temporary.unlink(missing_ok=True)
