"""Continuation of a run from its checkpoints in a new run: to its end (`resume`), or with changed values (`branch`)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import unit
from twin.errors import TwinError
from twin.results import RecordedVariable, list_recorded_variables, rows
from twin.run.cases import RunResult
from twin.run.checkpoint import Checkpoint, list_checkpoints, scenario_hash, versions
from twin.run.executor import NO_CALLBACKS, run_scenario
from twin.run.options import RunCallbacks, RunOptions
from twin.run.recovery import recover, with_texts
from twin.scenario import Backend, load_scenario, with_events

if TYPE_CHECKING:
    from twin.process import SupervisorChannel
    from twin.scenario import Case, ScenarioSpec

SIGNALS = "signals.parquet"


@dataclass(frozen=True)
class Origin:
    """Run that is continued. `selection`: variant and seed of all of its cases; `checkpoints`: those to continue from, by case."""

    folder: Path
    selection: Sequence[tuple[str, int]]
    checkpoints: Mapping[tuple[str, int], Checkpoint]

    def cases(self, scenario: ScenarioSpec) -> list[Case]:
        """Return the cases of the run, with the events of a scenario."""
        variants = {case.variant: case for case in scenario.variants}
        return [replace(variants[variant], seed=seed) for variant, seed in self.selection]


def continue_run(
    folder: Path,
    options: RunOptions,
    *,
    at_ns: clock.Time | None = None,
    overrides: Sequence[str] = (),
    channel: SupervisorChannel | None = None,
    callbacks: RunCallbacks = NO_CALLBACKS,
) -> RunResult:
    """Continue each case of a run from its last checkpoint, up to `at_ns` if that is given; others begin at their start.

    `overrides`: `member.parameter=value`, set at the time `at_ns`. The result is a new run, with the recording of the first
    one up to the checkpoint; it equals a run without interruption, with these events, to the bit.
    TwinError with the reason if the run cannot be continued: no checkpoint, another version, or another model.
    """
    scenario, options = prepare(folder, options, at_ns, overrides)
    return run_scenario(scenario, options, channel=channel, callbacks=callbacks)


def prepare(
    folder: Path, options: RunOptions, at_ns: clock.Time | None, overrides: Sequence[str]
) -> tuple[ScenarioSpec, RunOptions]:
    """Return scenario and options of the run that continues another one."""
    if not (folder / "scenario.yaml").exists():
        raise TwinError(f"{folder}: is no folder of a run. Name runs/SCENARIO/TIME.")
    if not (folder / "summary.json").exists():
        recover(folder, report=False)
    checkpoints = list_checkpoints(folder)
    if not checkpoints:
        raise TwinError(f"{folder}: has no checkpoint. Run the scenario with `--checkpoint 10s` or the like.")
    header = checkpoints[-1].header
    check_versions(folder, header)
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    if summary["status"] == "completed" and at_ns is None:
        raise TwinError(
            f"{folder}: is complete: there is nothing to resume. `twin branch` continues it with other values."
        )
    scenario = load_scenario(folder / "scenario.yaml")
    if at_ns is not None:
        scenario = with_events(scenario, at_ns, overrides)
    texts = {**summary["scenario"], "overrides": summary["overrides"], "paper_applies": summary["paper_applies"]}
    texts["paper_applies"] = texts["paper_applies"] and not overrides
    scenario = with_texts(scenario, texts)
    counts = recorded_rows(folder)
    latest: dict[tuple[str, int], Checkpoint] = {}
    every = {case.variant: (case.record.every_ns or case.step_ns) // case.step_ns for case in scenario.variants}
    for checkpoint in checkpoints:
        is_early = at_ns is None or checkpoint.time_ns <= at_ns
        if is_early and row_count(checkpoint, every[checkpoint.case[0]]) <= counts.get(checkpoint.case, 0):
            latest[checkpoint.case] = checkpoint
    selection = [(variant, seed) for variant, seed in header["cases"]]
    interval = options.checkpoint_ns or clock.from_json(header["interval_ns"])
    origin = Origin(folder, selection, latest)
    return scenario, replace(options, origin=origin, checkpoint_ns=interval, backend=Backend(header["backend"]))


def check_versions(folder: Path, header: Mapping[str, Any]) -> None:
    """Raise TwinError if the engine, the machine or the scenario differ from those of the checkpoints."""
    for name, value in versions().items():
        if header["versions"].get(name) != value:
            what = "by another kind of machine" if name == "machine" else "by another state of the engine"
            raise TwinError(
                f"{folder}: its checkpoints were written {what} (version {header['version']}, revision {header['revision']}, "
                f"{header['versions'].get('machine')}). Continue it there, or run the scenario again."
            )
    if header["scenario_sha256"] != scenario_hash(folder):
        raise TwinError(
            f"{folder / 'scenario.yaml'}: was changed after the checkpoints. Restore it, or run it as a new run."
        )


def row_count(checkpoint: Checkpoint, every: int) -> int:
    """Return the number of rows recorded up to a checkpoint, `every` so many communication steps."""
    return checkpoint.tick // every + 1


def row_groups(folder: Path) -> Any:
    """Yield the groups of rows in a run's signals: variant, seed, reader of columns, number of rows."""
    from pyarrow import parquet

    with parquet.ParquetFile(folder / SIGNALS) as file:
        for number in range(file.num_row_groups):
            first = file.read_row_group(number, columns=["variant", "seed"]).slice(0, 1).to_pydict()
            count = file.metadata.row_group(number).num_rows
            if count:
                yield (
                    (first["variant"][0], first["seed"][0]),
                    count,
                    lambda names, i=number: file.read_row_group(i, columns=names),
                )


def recorded_rows(folder: Path) -> dict[tuple[str, int], int]:
    """Return the number of recorded rows of each case of a run."""
    counts: dict[tuple[str, int], int] = {}
    if (folder / SIGNALS).exists():
        for case, count, _ in row_groups(folder):
            counts[case] = counts.get(case, 0) + count
    return counts


def before_conversion(values: Any, factor: float, offset: float) -> Any:
    """Return values that the recording of a run converts to the given ones, to the bit where there are such numbers.

    Variants may have a variable in different units; the recording has it in one.
    """
    if (factor, offset) == (1.0, 0.0):
        return values
    result = nearest = (values - offset) / factor
    for neighbor in (np.nextafter(nearest, np.inf), np.nextafter(nearest, -np.inf)):
        result = np.where(result * factor + offset == values, result, neighbor)
    return np.where(result * factor + offset == values, result, nearest)


def copy_rows(checkpoint: Checkpoint, case: Case, layout: Mapping[str, Any], file: Path) -> None:
    """Write the rows up to a checkpoint from the signals of its run to the file of a case's rows, as the loop records them."""
    folder = checkpoint.path.parent.parent
    every = (case.record.every_ns or case.step_ns) // case.step_ns
    remaining, done = row_count(checkpoint, every), 0
    columns = {
        label: (field, i)
        for name, field in rows.row_fields(layout).items()
        for i, label in enumerate(RecordedVariable(name, shape=field.shape).columns)
    }
    own_units = {name: symbol for name, *_, symbol, _ in layout["columns"]}
    conversions = {
        label: unit.conversion(own_units[name], variable.unit, label)
        for name, variable in list_recorded_variables(folder / SIGNALS).items()
        if name in own_units
        for label in variable.columns
    }
    with file.open("wb") as output:
        for group_case, group_count, read in row_groups(folder):
            if group_case != checkpoint.case or not remaining:
                continue
            count = min(group_count, remaining)
            words = np.zeros((count, layout["words"]), np.int64)
            words[:, 0] = np.arange(done, done + count) * every
            table = read(list(columns))
            for label, (field, i) in columns.items():
                values = before_conversion(table[label].slice(0, count).to_numpy(), *conversions[label])
                dtype = np.int64 if field.kind == "b" else field.dtype
                words[:, field.first + i] = values.astype(dtype, copy=False).view(np.int64)
            output.write(words.tobytes())
            remaining, done = remaining - count, done + count
