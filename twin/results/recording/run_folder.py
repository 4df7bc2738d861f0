"""Folder of a run: signals.parquet, summary.json, scenario.yaml, report.html.

Signals are written case by case and the file is closed in any case, so that Ctrl-C or a failing member loses nothing
that was recorded before. Other files are written to a temporary name and renamed atomically.
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
from twin.results.evaluation.hardware_termination import HardwareTermination
from twin.results.evaluation.metrics import Evaluation, MetricResult
from twin.results.recording import arrow_arrays
from twin.results.recording.signals import si_conversion
from twin.revision import checkout

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from twin.results.recording.signals import Signals

FLOAT: np.dtype[Any] = np.dtype(np.float64)
PACKAGES = ("numpy", "ziglang", "fmpy", "pyarrow", "pint", "pydantic")


@dataclass(frozen=True)
class RecordedVariable:
    """Recorded variable, or one scalar of it after `flatten_columns`. `name`: member.variable; `index` counts from 0."""

    name: str
    dtype: np.dtype[Any] = FLOAT
    shape: tuple[int, ...] = ()
    unit: str = ""
    display_unit: str = ""
    description: str = ""
    index: tuple[int, ...] = ()

    def __repr__(self) -> str:
        return unit.declaration("signal", self.label, self.shape, self.unit, self.description)

    @property
    def label(self) -> str:
        """Name with index: `sheath.x[1]`, counted from 1 as in Modelica."""
        return self.name + (f"[{','.join(str(i + 1) for i in self.index)}]" if self.index else "")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns of its elements, in row-major order."""
        return tuple(replace(self, index=index).label for index in np.ndindex(self.shape))


@dataclass
class RunInfo:
    """Description of a run without its signals, filled in during the run."""

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


def make_run_folder(root: str | Path, name: str, now: datetime | None = None) -> Path:
    """Create `root/name/2026-11-21_00-41-32`, with `_2` and so on if it exists."""
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


def flatten_columns(columns: Iterable[RecordedVariable]) -> list[RecordedVariable]:
    """Return one column for each scalar of all variants, each once; a scalar of two types becomes Float64."""
    result: dict[str, RecordedVariable] = {}
    for column in columns:
        for index in np.ndindex(column.shape):
            scalar = replace(column, shape=(), index=index)
            existing = result.setdefault(scalar.label, scalar)
            unit.conversion(existing.unit, scalar.unit, f"{scalar.label}, which two variants have in different units")
            if existing.dtype != scalar.dtype:
                result[scalar.label] = replace(existing, dtype=np.dtype(np.float64))
    return list(result.values())


class SignalFile:
    """Writer of signals.parquet: rows of all cases with `variant`, `seed`, `time`, then one column for each scalar.

    `columns`: those of all variants; a value that a case has not recorded is null. A context manager.
    """

    def __init__(self, path: Path, columns: Iterable[RecordedVariable], about: Mapping[str, str]) -> None:
        import pyarrow as pa

        self.columns = flatten_columns(columns)
        fields = [
            pa.field("variant", pa.dictionary(pa.int32(), pa.string())),
            pa.field("seed", pa.int64()),
            pa.field("time", pa.float64(), metadata={"unit": "s", "description": "communication point"}),
        ]
        for column in self.columns:
            metadata = {"unit": column.unit, "display_unit": column.display_unit, "description": column.description}
            fields.append(
                pa.field(
                    column.label, pa.from_numpy_dtype(column.dtype), metadata={k: v for k, v in metadata.items() if v}
                )
            )
        self.schema = pa.schema(fields, {"project": f"catheter-twin {twin.__version__}", **about})
        self.writer = arrow_arrays.open_table_writer(str(path), self.schema, words=("variant",))

    def write(self, variant: str, seed: int, signals: Signals) -> None:
        """Append the recording of one case, complete or not."""
        import pyarrow as pa

        count = len(signals.time)
        names = pa.DictionaryArray.from_arrays(
            arrow_arrays.to_arrow_array(np.zeros(count, np.int32)), arrow_arrays.text_array(variant)
        )
        times = np.asarray(signals.time, np.float64)
        arrays = [
            names,
            arrow_arrays.to_arrow_array(np.full(count, seed, np.int64)),
            arrow_arrays.to_arrow_array(times),
        ]
        for field_type, column in zip(self.schema.types[3:], self.columns, strict=True):
            values = signals.values.get(column.name)
            if values is None or (
                column.index and any(i >= n for i, n in zip(column.index, values.shape[1:], strict=True))
            ):
                arrays.append(pa.nulls(count, field_type))
                continue
            element: Any = (..., *column.index)
            values = np.ascontiguousarray(values[element])
            factor, offset = unit.conversion(signals.units.get(column.name, ""), column.unit, column.label)
            if (factor, offset) != (1.0, 0.0):
                values = values * factor + offset  # another variant's component has the same variable in another unit
            arrays.append(arrow_arrays.to_arrow_array(values.astype(column.dtype, copy=False)))
        self.writer.write_table(pa.Table.from_arrays(arrays, schema=self.schema))

    def close(self) -> None:
        """Finish the file, which is unreadable before. May be called twice."""
        self.writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def read_signals(
    path: str | Path, columns: Sequence[str] | None = None
) -> tuple[dict[tuple[str, int], Signals], dict[str, str]]:
    """Read the signals of every case of a signals.parquet, arrays as single elements, and the file's metadata.

    `columns`: names of the columns to read; all if None.
    """
    from pyarrow import parquet

    from twin.results.recording.signals import Signals

    table = parquet.read_table(path, columns=None if columns is None else ["variant", "seed", "time", *columns])
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema}
    variants, seeds = table["variant"].to_pylist(), table["seed"].to_numpy()
    result = {}
    names = np.array(variants)
    for case in dict.fromkeys(zip(variants, seeds.tolist(), strict=True)):
        rows = (names == case[0]) & (seeds == case[1])
        case_table = table.filter(rows)
        values = {
            name: case_table[name].to_numpy()
            for name in case_table.column_names[3:]
            if case_table[name].null_count < len(case_table)
        }
        result[case] = Signals(case_table["time"].to_numpy(), values, {name: units[name] for name in values})
    return result, {key.decode(): value.decode() for key, value in (table.schema.metadata or {}).items()}


write_text = write_atomically


def write_summary(path: Path, summary: Mapping[str, Any]) -> None:
    """Write summary.json; NaN and infinity become null."""
    write_text(path, json.dumps(to_json_value(summary), indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def to_json_value(value: Any) -> Any:
    """Convert a value to JSON types."""
    if isinstance(value, Mapping):
        return {str(key): to_json_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [to_json_value(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return to_json_value(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return str(value)


def build_summary(
    run: RunInfo,
    evaluation: Evaluation,
    tables: Mapping[tuple[str, int], Signals],
    terminations: Mapping[tuple[str, int], HardwareTermination] = MappingProxyType({}),
) -> dict[str, Any]:
    """Collect all figures of a run. Metrics are in their own `unit` (SI if it is empty), times in seconds."""
    metrics: dict[str, Any] = {}
    for result in evaluation.metric_results:
        metric = result.metric
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
        entry["variants"][result.variant] = metric_to_dict(result)
    return {
        "scenario": {key: getattr(run, key) for key in ("name", "title", "description", "source", "path")},
        "status": run.status,
        "reason": run.reason,
        "passed": run.status == "completed" and evaluation.passed,
        "paper_applies": evaluation.paper_applies,
        "overrides": run.overrides,
        "started": run.started.isoformat(timespec="seconds"),
        "wall_time": run.wall_time,
        "simulated_time": run.simulated_time,
        "real_time_factor": run.real_time_factor,
        "step": clock.seconds(run.step_ns),
        "algorithm": run.algorithm,
        "cases": [
            {
                "variant": variant,
                "seed": seed,
                "complete": signals.complete,
                "samples": len(signals.time),
                **termination_to_dict(terminations.get((variant, seed), HardwareTermination())),
            }
            for (variant, seed), signals in tables.items()
        ],
        "metrics": metrics,
        "expectations": [vars(expectation_result) for expectation_result in evaluation.expectation_results],
        "unjudged": evaluation.unjudged,
        "members": {name: dict(identity) for name, identity in run.members.items()},
        "versions": software_versions(),
        **run.extra,
    }


def count_verdicts(summary: Mapping[str, Any]) -> tuple[int, int]:
    """Return how many requirements are met, and how many were judged: expectations, and metrics with a reference value."""
    metrics = [result["verdict"] for metric in summary["metrics"].values() for result in metric["variants"].values()]
    verdicts = [*metrics, *(result["verdict"] for result in summary["expectations"])]
    return verdicts.count("pass"), sum(verdict in ("pass", "fail", "none") for verdict in verdicts)


def count_not_judged(summary: Mapping[str, Any]) -> tuple[int, int]:
    """Return how many requirements, also of the paper's values, were not judged, and how many are outside of nominal limits."""
    skipped = [result for result in summary["expectations"] if result["verdict"] == "skipped"]
    compared = [metric for metric in summary.get("metrics", {}).values() if metric.get("tolerance") is not None]
    others = sum(result["verdict"] == "other" for metric in compared for result in metric["variants"].values())
    return len(skipped) + others, sum(result.get("is_outside", False) for result in skipped)


def requirements_text(met: int, judged: int, not_judged: int = 0, outside: int = 0) -> str:
    """Return how many requirements are met or failed, as report, notebook, console and terminal say it: `1 failed · 12 passed · 4 not judged`. `outside`: of those not judged."""
    if met < judged:
        passed = [f"{met} passed"] * bool(met)
        return " · ".join([f"{judged - met} failed", *passed, *not_judged_texts(not_judged, 0)])
    return ", ".join([f"{met} of {judged} requirements met"] * bool(judged) + not_judged_texts(not_judged, outside))


def not_judged_texts(not_judged: int, outside: int) -> list[str]:
    """Return how many requirements are not judged, and how many of them lie outside of their limits for nominal values."""
    return [f"{not_judged} not judged"] * bool(not_judged) + [f"{outside} of these outside of nominal limits"] * bool(
        outside
    )


def describe_outcome(summary: Mapping[str, Any]) -> tuple[str, str]:
    """Return the outcome of a run as a word, such as PASS, and the counts: `2 failed · 4 passed · 11 not judged, 1 warning`."""
    met, judged = count_verdicts(summary)
    verdict = ("PASS" if summary["passed"] else "FAIL") if judged else "DONE"
    word = verdict if summary["status"] == "completed" else summary["status"].upper()
    not_judged, outside = count_not_judged(summary)
    parts = [f"{met} of {judged}"] * (word == "PASS") + not_judged_texts(not_judged, outside)
    parts = [requirements_text(met, judged, not_judged)] if met < judged and word != "PASS" else parts
    warnings = sum("warning: " in note for note in summary.get("notes", ()))
    return word, ", ".join(filter(None, [*parts, *[f"{warnings} warning{'s' * (warnings > 1)}"] * bool(warnings)]))


def termination_to_dict(termination: HardwareTermination) -> dict[str, Any]:
    """Return time and reason of a stop by hardware, and the axes that are not at rest; empty without a stop."""
    result = {"unsafe": termination.unsafe} if termination.unsafe else {}
    return (
        result
        if termination.time_ns is None
        else result
        | {
            "stopped": clock.seconds(termination.time_ns),
            "reason": termination.reason,
        }
    )


def metric_to_dict(result: MetricResult) -> dict[str, Any]:
    """Convert a metric of one variant to its own unit."""
    factor, offset = si_conversion(result.metric.unit, result.metric.is_difference)

    def in_unit(value: float | None) -> float | None:
        return None if value is None else unit.round_trip((value - offset) / factor)

    return {
        "values": {seed: in_unit(value) for seed, value in result.values.items()},
        "mean": in_unit(result.mean),
        "worst": in_unit(result.worst),
        "paper": in_unit(result.paper),
        "ratio": result.ratio,
        "verdict": result.verdict,
    }


def software_versions() -> dict[str, str]:
    """Return the versions of Python, packages and this project, with its revision."""
    versions = {"catheter-twin": twin.__version__, "python": platform.python_version(), "platform": platform_name()}
    for package in PACKAGES:
        try:
            versions[package] = installed.version(package)
        except ModuleNotFoundError:  # as PackageNotFoundError is one
            continue
    if revision := checkout(Path(twin.__file__).parent):
        versions["revision"] = revision
    return versions


def platform_name() -> str:
    """Return `platform.platform()` without its subprocess, whose result (the processor's name) is not part of it."""
    try:
        libc = os.confstr("CS_GNU_LIBC_VERSION") or ""
    except (AttributeError, ValueError, OSError):  # no glibc
        return platform.platform()
    system = os.uname()
    return "-".join((system.sysname, system.release, system.machine, "with", libc.replace(" ", "")))
