"""The folder of a run: signals.parquet, summary.json, scenario.yaml, report.html.

Signals are written case by case and the file is closed whatever happens, so that Ctrl-C or a failing member costs
nothing that was recorded before. Everything else is written beside its place and moved there: never half a file.
"""

from __future__ import annotations

import json
import math
import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

import twin
from twin import clock, installed
from twin.component import unit
from twin.errors import TwinError
from twin.files import write_atomically
from twin.results import arrow_arrays
from twin.results.metrics import Ending, Evaluation, Figure
from twin.results.signals import coherent
from twin.revision import checkout

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from twin.results.signals import Signals

FLOAT: np.dtype[Any] = np.dtype(np.float64)
PACKAGES = ("numpy", "ziglang", "fmpy", "pyarrow", "pint", "pydantic")


@dataclass(frozen=True)
class Column:
    """A recorded variable, or after `flat` one scalar of it. `name` is member.variable, `index` counts from 0."""

    name: str
    dtype: np.dtype[Any] = FLOAT
    shape: tuple[int, ...] = ()
    unit: str = ""
    display_unit: str = ""
    description: str = ""
    index: tuple[int, ...] = ()

    @property
    def label(self) -> str:
        """`sheath.x[1]`, counted from 1 as in Modelica."""
        return self.name + (f"[{','.join(str(i + 1) for i in self.index)}]" if self.index else "")


@dataclass
class Run:
    """What is known about a run besides its signals; the caller fills it in as it goes."""

    name: str
    title: str = ""
    source: str = ""
    description: str = ""
    path: str = ""
    started: datetime = field(default_factory=lambda: datetime.now().astimezone())
    status: str = "completed"  # or interrupted, failed
    reason: str = ""
    overrides: tuple[str, ...] = ()
    wall_time: float = 0.0  # of simulating alone [s]
    simulated_time: float = 0.0  # over all cases [s]
    step_ns: clock.Time = 0
    algorithm: str = ""
    members: Mapping[str, Mapping[str, str]] = field(default_factory=dict)  # member -> identity: kind, version, hash
    extra: Mapping[str, Any] = field(default_factory=dict)  # anything else worth keeping, such as overruns

    @property
    def real_time_factor(self) -> float | None:
        """Simulated time over wall time: above 1 is faster than real time."""
        return self.simulated_time / self.wall_time if self.wall_time > 0 else None


def folder(root: str | Path, name: str, now: datetime | None = None) -> Path:
    """Make `root/name/2026-11-21_00-41-32`, with `_2` and so on if that is taken."""
    stamp = (now or datetime.now()).strftime("%Y-%m-%d_%H-%M-%S")  # noqa: DTZ005 - read by people: local time
    safe = "".join(letter if letter.isalnum() or letter in "-_.+" else "_" for letter in name).strip(".") or "run"
    for count in range(1, 10_000):
        path = Path(root) / safe / (stamp if count == 1 else f"{stamp}_{count}")
        try:
            path.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise TwinError(f"{path}: cannot be made ({error.strerror}). Choose another folder for results.") from None
        return path
    raise TwinError(f"{root}/{safe}: too many runs in one second. Choose another folder for results.")


def flat(columns: Iterable[Column]) -> list[Column]:
    """One column for each scalar; those of all variants together, each once, numbers of two types as Float64."""
    result: dict[str, Column] = {}
    for column in columns:
        for index in np.ndindex(column.shape):
            one = replace(column, shape=(), index=index)
            known = result.setdefault(one.label, one)
            unit.conversion(known.unit, one.unit, f"{one.label}, which two variants have in different units")
            if known.dtype != one.dtype:
                result[one.label] = replace(known, dtype=np.dtype(np.float64))
    return list(result.values())


class SignalFile:
    """signals.parquet: rows of all cases with `variant`, `seed`, `time`, then one column for each scalar.

    `columns` are those of all variants; what a case has not recorded is null. Use it with `with`.
    """

    def __init__(self, path: Path, columns: Iterable[Column], about: Mapping[str, str]) -> None:
        import pyarrow as pa

        self.columns = flat(columns)
        fields = [
            pa.field("variant", pa.dictionary(pa.int32(), pa.string())),
            pa.field("seed", pa.int64()),
            pa.field("time", pa.float64(), metadata={"unit": "s", "description": "communication point"}),
        ]
        for one in self.columns:
            notes = {"unit": one.unit, "display_unit": one.display_unit, "description": one.description}
            fields.append(
                pa.field(one.label, pa.from_numpy_dtype(one.dtype), metadata={k: v for k, v in notes.items() if v})
            )
        self.schema = pa.schema(fields, {"project": f"catheter-twin {twin.__version__}", **about})
        self.writer = arrow_arrays.writer(str(path), self.schema, words=("variant",))

    def write(self, variant: str, seed: int, signals: Signals) -> None:
        """Append what one case recorded, complete or not."""
        import pyarrow as pa

        count = len(signals.time)
        names = pa.DictionaryArray.from_arrays(
            arrow_arrays.column(np.zeros(count, np.int32)), arrow_arrays.word(variant)
        )
        times = np.asarray(signals.time, np.float64)
        arrays = [names, arrow_arrays.column(np.full(count, seed, np.int64)), arrow_arrays.column(times)]
        for field_, one in zip(self.schema.types[3:], self.columns, strict=True):
            values = signals.values.get(one.name)
            if values is None or (one.index and any(i >= n for i, n in zip(one.index, values.shape[1:], strict=True))):
                arrays.append(pa.nulls(count, field_))
                continue
            place: Any = (..., *one.index)
            values = np.ascontiguousarray(values[place])
            factor, offset = unit.conversion(signals.units.get(one.name, ""), one.unit, one.label)
            if (factor, offset) != (1.0, 0.0):
                values = values * factor + offset  # another variant's component has the same variable in another unit
            arrays.append(arrow_arrays.column(values.astype(one.dtype, copy=False)))
        self.writer.write_table(pa.Table.from_arrays(arrays, schema=self.schema))

    def close(self) -> None:
        """Finish the file; without this it cannot be read. Safe to call twice."""
        self.writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def read_signals(
    path: str | Path, columns: Sequence[str] | None = None
) -> tuple[dict[tuple[str, int], Signals], dict[str, str]]:
    """Signals of every case of a signals.parquet, arrays as single elements, and the file's metadata.

    `columns`: those that are wanted; nothing else is read.
    """
    from pyarrow import parquet

    from twin.results.signals import Signals

    table = parquet.read_table(path, columns=None if columns is None else ["variant", "seed", "time", *columns])
    units = {one.name: (one.metadata or {}).get(b"unit", b"").decode() for one in table.schema}
    variants, seeds = table["variant"].to_pylist(), table["seed"].to_numpy()
    result = {}
    names = np.array(variants)
    for case in dict.fromkeys(zip(variants, seeds.tolist(), strict=True)):
        rows = (names == case[0]) & (seeds == case[1])
        part = table.filter(rows)
        values = {name: part[name].to_numpy() for name in part.column_names[3:] if part[name].null_count < len(part)}
        result[case] = Signals(part["time"].to_numpy(), values, {name: units[name] for name in values})
    return result, {key.decode(): value.decode() for key, value in (table.schema.metadata or {}).items()}


def write_text(path: Path, text: str) -> None:
    """Write a file as a whole or not at all."""
    write_atomically(path, text)


def write_summary(path: Path, summary: Mapping[str, Any]) -> None:
    """Write summary.json; what is not a number becomes null."""
    write_text(path, json.dumps(plain(summary), indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def plain(value: Any) -> Any:
    """A value as JSON knows it."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return str(value)


def summary(
    run: Run,
    evaluation: Evaluation,
    tables: Mapping[tuple[str, int], Signals],
    endings: Mapping[tuple[str, int], Ending] = MappingProxyType({}),
) -> dict[str, Any]:
    """All figures of a run. Metrics are in their own `unit` (SI if it is empty), times in seconds."""
    metrics: dict[str, Any] = {}
    for one in evaluation.figures:
        metric = one.metric
        entry = metrics.setdefault(
            metric.name,
            {
                "signal": metric.signal.text,
                "reduce": metric.reduce,
                "unit": metric.unit,
                "from": None if metric.window.start_ns is None else clock.seconds(metric.window.start_ns),
                "to": None if metric.window.stop_ns is None else clock.seconds(metric.window.stop_ns),
                "description": metric.description,
                "tolerance": metric.tolerance,
                "variants": {},
            },
        )
        entry["variants"][one.variant] = figure(one)
    return {
        "scenario": {key: getattr(run, key) for key in ("name", "title", "description", "source", "path")},
        "status": run.status, "reason": run.reason,
        "passed": run.status == "completed" and evaluation.passed,
        "paper_applies": evaluation.paper_applies, "overrides": run.overrides,
        "started": run.started.isoformat(timespec="seconds"),
        "wall_time": run.wall_time, "simulated_time": run.simulated_time, "real_time_factor": run.real_time_factor,
        "step": clock.seconds(run.step_ns), "algorithm": run.algorithm,
        "cases": [
            {
                "variant": variant, "seed": seed, "complete": signals.complete, "samples": len(signals.time),
                **stop(endings.get((variant, seed), Ending())),
            }
            for (variant, seed), signals in tables.items()
        ],
        "metrics": metrics,
        "expectations": [vars(outcome) for outcome in evaluation.outcomes],
        "members": {name: dict(identity) for name, identity in run.members.items()},
        "versions": versions(),
        **run.extra,
    }  # fmt: skip


def stop(ending: Ending) -> dict[str, Any]:
    """When and why hardware stopped a case, if it did, and what is not at rest."""
    found = {"unsafe": ending.unsafe} if ending.unsafe else {}
    return (
        found
        if ending.time_ns is None
        else found
        | {
            "stopped": clock.seconds(ending.time_ns),
            "reason": ending.reason,
        }
    )


def figure(one: Figure) -> dict[str, Any]:
    """A metric of one variant in the metric's unit."""
    factor, offset = coherent(one.metric.unit, one.metric.is_difference)

    def own(value: float | None) -> float | None:
        return None if value is None else unit.round_trip((value - offset) / factor)

    return {
        "values": {seed: own(value) for seed, value in one.values.items()},
        "mean": own(one.mean),
        "worst": own(one.worst),
        "paper": own(one.paper),
        "ratio": one.ratio,
        "verdict": one.verdict,
    }


def versions() -> dict[str, str]:
    """What ran: Python, packages, this project and its revision."""
    found = {"catheter-twin": twin.__version__, "python": platform.python_version(), "platform": system()}
    for package in PACKAGES:
        try:
            found[package] = installed.version(package)
        except ModuleNotFoundError:  # as PackageNotFoundError is one
            continue
    if text := checkout(Path(twin.__file__).parent):
        found["revision"] = text
    return found


def system() -> str:
    """`platform.platform()`, which starts a process to ask for the processor's name and then leaves it out."""
    try:
        libc = os.confstr("CS_GNU_LIBC_VERSION") or ""
    except (AttributeError, ValueError, OSError):  # no glibc
        return platform.platform()
    about = os.uname()
    return "-".join((about.sysname, about.release, about.machine, "with", libc.replace(" ", "")))
