"""Export of recorded signals with their units: CSV, MAT (MATLAB, Octave), MCAP (Foxglove)."""

from __future__ import annotations

import json
import os
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import unit
from twin.errors import TwinError
from twin.installed import import_optional
from twin.results.recording.run_folder import to_json_value
from twin.results.recording.signal_reader import read_variables

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from twin.results.recording.run_folder import RecordedVariable

    Cases = set[tuple[str, int]]

JSON_TYPES = {"b": "boolean", "i": "integer", "u": "integer"}  # NumPy's kinds as JSON names them; others are numbers
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


def export_mcap(source: Path, target: Path, variables: Sequence[RecordedVariable], cases: Cases) -> None:
    """Write messages `{"force": 0.2}` to topics such as `/sensor`, with several cases `/PI/seed_1/sensor`.

    Log time is simulated time. The encoding is JSON, so a file is ten times as large as Parquet. NaN and infinity become null.
    """
    mcap = import_optional("mcap.writer", "mcap", target.suffix)
    from pyarrow import parquet

    with parquet.ParquetFile(source) as file, target.open("wb") as stream:
        writer = mcap.Writer(stream)
        writer.start(library="catheter-twin")
        metadata = {key.decode(): text.decode() for key, text in (file.schema_arrow.metadata or {}).items()}
        writer.add_metadata("run", {key: metadata[key] for key in ("project", "scenario") if key in metadata})
        topics = Topics(writer, variables, file.schema_arrow, prefixed=len(cases) > 1)
        columns = [column for variable in variables for column in variable.columns]
        for batch in file.iter_batches(columns=["variant", "seed", "time", *columns]):
            for case, part in split_by_case(batch):
                if case in cases:
                    topics.write(case, part)
        writer.finish()


def split_by_case(batch: Any) -> Iterator[tuple[tuple[str, int], Any]]:
    """Split a batch into consecutive rows of one case each."""
    names, seeds = batch.column("variant").to_pylist(), batch.column("seed").to_pylist()
    changes = [i for i in range(1, len(seeds)) if (names[i], seeds[i]) != (names[i - 1], seeds[i - 1])]
    for begin, end in zip([0, *changes], [*changes, len(seeds)], strict=True):
        if begin < end:
            yield (names[begin], seeds[begin]), batch.slice(begin, end - begin)


class Topics:
    """Topics of a file, one for each member of each case, registered with the first message."""

    def __init__(self, writer: Any, variables: Sequence[RecordedVariable], schema: Any, *, prefixed: bool) -> None:
        self.writer, self.prefixed = writer, prefixed
        self.members: dict[str, list[RecordedVariable]] = {}
        for variable in variables:
            self.members.setdefault(variable.name.rpartition(".")[0], []).append(variable)
        self.schemas = {
            member: writer.register_schema(
                member, "jsonschema", json.dumps(message_schema(member, member_variables, schema)).encode()
            )
            for member, member_variables in self.members.items()
        }
        self.channels: dict[tuple[tuple[str, int], str], int] = {}

    def channel(self, case: tuple[str, int], member: str) -> int:
        """Return the channel of a member's topic; register it on first use."""
        if (case, member) not in self.channels:
            names = (*((case[0], f"seed_{case[1]}") if self.prefixed else ()), *member.split("."))
            self.channels[case, member] = self.writer.register_channel(
                "/" + "/".join(names), "json", self.schemas[member], {"variant": case[0], "seed": str(case[1])}
            )
        return self.channels[case, member]

    def write(self, case: tuple[str, int], rows: Any) -> None:
        """Write messages of rows in the order of time; a member without recorded values in this case has none."""
        present = {
            member: {
                variable.name.rpartition(".")[2]: row_values(variable, rows)
                for variable in member_variables
                if rows.column(variable.columns[0]).null_count < len(rows)
            }
            for member, member_variables in self.members.items()
        }
        channels = [
            (self.channel(case, member), list(member_variables), zip(*member_variables.values(), strict=True))
            for member, member_variables in present.items()
            if member_variables
        ]
        times = np.rint(rows.column("time").to_numpy() * clock.NANOSECONDS).astype(np.int64).tolist()
        if times[0] < 0:
            raise TwinError(
                f"{case[0]}, seed {case[1]} begins at {times[0] / 1e9:g} s: MCAP has no negative times. Write .csv or .mat."
            )
        for time in times:
            for channel, names, samples in channels:
                data = json.dumps(dict(zip(names, next(samples), strict=True)), allow_nan=False).encode()
                self.writer.add_message(channel, time, data, time)


def row_values(variable: RecordedVariable, rows: Any) -> list[Any]:
    """Return a value for each row, a list for an array."""
    columns = [rows.column(name).to_numpy(zero_copy_only=False) for name in variable.columns]
    values: list[Any] = to_json_value(np.stack(columns, 1).reshape(-1, *variable.shape))
    return values


def message_schema(member: str, variables: Sequence[RecordedVariable], schema: Any) -> dict[str, Any]:
    """Return the JSON schema of a member's messages, with the units of its variables."""
    properties = {}
    for variable in variables:
        dtype = np.dtype(schema.field(variable.columns[0]).type.to_pandas_dtype())
        kind: dict[str, Any] = {"type": JSON_TYPES.get(dtype.kind, ["number", "null"])}
        for count in reversed(variable.shape):
            kind = {"type": "array", "items": kind, "minItems": count, "maxItems": count}
        symbol = unit.shown(variable.unit)
        description = f"{variable.description} [{symbol}]" if symbol else variable.description
        properties[variable.name.rpartition(".")[2]] = kind | {"description": description.strip(), "unit": symbol}
    return {"title": member, "type": "object", "properties": properties}


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
