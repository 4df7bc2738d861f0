"""Export of recorded signals as MCAP for Foxglove and ROS: one topic for each member, units in its schema."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import unit
from twin.errors import TwinError
from twin.installed import import_optional
from twin.results.recording.run_folder import to_json_value

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from twin.results.recording.run_folder import RecordedVariable

    Cases = set[tuple[str, int]]

JSON_TYPES = {"b": "boolean", "i": "integer", "u": "integer"}  # NumPy's kinds as JSON names them; others are numbers


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
