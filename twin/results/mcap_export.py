"""Recorded signals as MCAP, which Foxglove and the readers of ROS open: a topic for each member, units in its schema."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import unit
from twin.errors import TwinError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from twin.results.signal_reader import Recorded

    Cases = set[tuple[str, int]]

TYPES = {"b": "boolean", "i": "integer", "u": "integer"}  # NumPy's kinds as JSON names them; others are numbers


def mcap(source: Path, target: Path, variables: Sequence[Recorded], cases: Cases) -> None:
    """Messages `{"force": 0.2}` of topics like `/sensor`, of several cases `/PI/seed_1/sensor`; log time is simulated time.

    JSON, so that a file is ten times as large as its Parquet. What is not a number is null.
    """
    try:
        from mcap.writer import Writer
    except ModuleNotFoundError:
        raise TwinError(
            f"{target.suffix}: needs a package that is not here. pip install 'catheter-twin[mcap]'"
        ) from None
    from pyarrow import parquet

    with parquet.ParquetFile(source) as file, target.open("wb") as stream:
        writer: Any = Writer(stream)
        writer.start(library="catheter-twin")
        notes = {key.decode(): text.decode() for key, text in (file.schema_arrow.metadata or {}).items()}
        writer.add_metadata("run", {key: notes[key] for key in ("project", "scenario") if key in notes})
        topics = Topics(writer, variables, file.schema_arrow, prefixed=len(cases) > 1)
        columns = [column for one in variables for column in one.columns]
        for batch in file.iter_batches(columns=["variant", "seed", "time", *columns]):
            for case, part in by_case(batch):
                if case in cases:
                    topics.write(case, part)
        writer.finish()


def by_case(batch: Any) -> Iterator[tuple[tuple[str, int], Any]]:
    """The rows of a batch, those of one case together."""
    names, seeds = batch.column("variant").to_pylist(), batch.column("seed").to_pylist()
    changes = [i for i in range(1, len(seeds)) if (names[i], seeds[i]) != (names[i - 1], seeds[i - 1])]
    for begin, end in zip([0, *changes], [*changes, len(seeds)], strict=True):
        if begin < end:
            yield (names[begin], seeds[begin]), batch.slice(begin, end - begin)


class Topics:
    """The topics of a file, one for each member of each case, made with its first message."""

    def __init__(self, writer: Any, variables: Sequence[Recorded], schema: Any, *, prefixed: bool) -> None:
        self.writer, self.prefixed = writer, prefixed
        self.members: dict[str, list[Recorded]] = {}
        for one in variables:
            self.members.setdefault(one.name.rpartition(".")[0], []).append(one)
        self.schemas = {
            member: writer.register_schema(member, "jsonschema", json.dumps(described(member, own, schema)).encode())
            for member, own in self.members.items()
        }
        self.channels: dict[tuple[tuple[str, int], str], int] = {}

    def channel(self, case: tuple[str, int], member: str) -> int:
        """The topic of a member."""
        if (case, member) not in self.channels:
            names = (*((case[0], f"seed_{case[1]}") if self.prefixed else ()), *member.split("."))
            self.channels[case, member] = self.writer.register_channel(
                "/" + "/".join(names), "json", self.schemas[member], {"variant": case[0], "seed": str(case[1])}
            )
        return self.channels[case, member]

    def write(self, case: tuple[str, int], rows: Any) -> None:
        """Messages of some rows, in the order of time; a member that recorded nothing in this case has none."""
        there = {
            member: {
                one.name.rpartition(".")[2]: values(one, rows)
                for one in own
                if rows.column(one.columns[0]).null_count < len(rows)
            }
            for member, own in self.members.items()
        }
        channels = [
            (self.channel(case, member), list(own), zip(*own.values(), strict=True))
            for member, own in there.items()
            if own
        ]
        times = np.rint(rows.column("time").to_numpy() * clock.NANOSECONDS).astype(np.int64).tolist()
        for time in times:
            for channel, names, samples in channels:
                data = json.dumps(dict(zip(names, next(samples), strict=True)), allow_nan=False).encode()
                self.writer.add_message(channel, time, data, time)


def values(variable: Recorded, rows: Any) -> list[Any]:
    """A value for each row, of an array a list."""
    columns = [rows.column(name).to_numpy(zero_copy_only=False) for name in variable.columns]
    return [finite(one) for one in np.stack(columns, 1).reshape(-1, *variable.shape).tolist()]


def finite(value: Any) -> Any:
    """A value as JSON knows it."""
    if isinstance(value, list):
        return [finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def described(member: str, variables: Sequence[Recorded], schema: Any) -> dict[str, Any]:
    """The JSON schema of a member's messages, with the units of its variables."""
    properties = {}
    for one in variables:
        dtype = np.dtype(schema.field(one.columns[0]).type.to_pandas_dtype())
        kind: dict[str, Any] = {"type": TYPES.get(dtype.kind, ["number", "null"])}
        for count in reversed(one.shape):
            kind = {"type": "array", "items": kind, "minItems": count, "maxItems": count}
        symbol = unit.shown(one.unit)
        about = f"{one.description} [{symbol}]" if symbol else one.description
        properties[one.name.rpartition(".")[2]] = kind | {"description": about.strip(), "unit": symbol}
    return {"title": member, "type": "object", "properties": properties}
