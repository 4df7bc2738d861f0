"""What is followed live: the model, the rig's sources, and the signals that are measured or drive the model."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from twin import clock
from twin.arrays import Array
from twin.component import unit
from twin.errors import CouplingError
from twin.files import split_unit
from twin.follow.problem import FollowLoader, FollowProblem, check_model
from twin.follow.schema import RigKeys
from twin.identify import Column, InputKeys, Output, RecordedExperiment, RecordedFile, Unknown, replay
from twin.scenario import Case, Node, read

IDLE = 1.0  # longest simulated time between two estimates, also while nothing is measured [s]


@dataclass(frozen=True)
class LiveSignal:
    """A value of a source and the variable that it drives or measures: variable = factor * value in its unit + offset.

    `unit`: of the value, where the file states it, else "". `delay` [s]: the value belongs to the time so much before its stamp.
    """

    name: str
    unit: str
    variable: str
    variable_unit: str
    factor: float = 1.0
    offset: float = 0.0
    delay: float = 0.0

    def converted(self, value: float, sent_unit: str) -> float | str:
        """Return the variable's value, or why the unit that the source sends does not convert."""
        try:
            factor, offset = unit.conversion(sent_unit or self.unit, self.variable_unit or "1", self.name)
        except CouplingError:
            return f"arrives in {sent_unit}, {self.variable} is in {self.variable_unit or 'no unit'}"
        return self.factor * (value * factor + offset) + self.offset


@dataclass(frozen=True, kw_only=True)
class LiveProblem(FollowProblem):
    """A checked follow file with a rig. `tables`: values of the inputs at the communication points of the next advance."""

    rig: RigKeys
    inputs: tuple[LiveSignal, ...]
    measured: tuple[LiveSignal, ...]
    tables: tuple[Array, ...]

    @property
    def longest_interval(self) -> float:
        """Longest advance [communication steps], also while nothing is measured."""
        return idle_ticks(self.experiment.case)


def idle_ticks(case: Case) -> int:
    """Return the communication steps in `IDLE`, at least one."""
    return max(1, round(IDLE / clock.seconds(case.step_ns)))


def load_live(path: str | Path, rig: str | Path | None = None) -> LiveProblem:
    """Read and check a follow file with a rig; ScenarioError lists all problems.

    `rig`: the address of the rig's datagrams, or the file of a rig, instead of the section `rig` of the file.
    """
    path, problems = Path(path), list[str]()
    root = read(path, str(path), problems)
    entries = {key: node for key, node in root.entries.items() if key != "data"}
    if rig is not None:
        is_file = str(rig).endswith((".yaml", ".yml"))
        entries["rig"] = read(Path(rig), str(rig), problems) if is_file else Node(str(rig), root.location)
    loader = LiveLoader(path, "", Node(entries, root.location), frozenset(), problems)
    base = check_model(loader)
    return LiveProblem(
        **{field.name: getattr(base, field.name) for field in fields(base)},
        rig=loader.rig_keys(Path(rig).parent if rig is not None else path.parent),
        inputs=tuple(loader.live_inputs()),
        measured=tuple(loader.live_outputs()),
        tables=loader.tables,
    )


def has_rig(path: str | Path) -> bool:
    """Whether a follow file has a section `rig`."""
    return "rig" in read(Path(path), str(path), []).entries


class LiveLoader(FollowLoader):
    """Loader of a follow file with a rig: columns are names in messages, whose values come later."""

    required: ClassVar[tuple[tuple[str, str], ...]] = (("rig", "rig: udp://127.0.0.1:4710"), *FollowLoader.required[1:])
    tables: tuple[Array, ...]

    def files(self) -> list[RecordedFile]:
        """No file is read."""
        return []

    def read_columns(self, files: list[RecordedFile]) -> dict[str, Column]:  # noqa: ARG002 - of the base class
        """Columns without values, with which names and units are checked."""
        names = dict.fromkeys([*self.keys.inputs, *self.keys.outputs])
        empty = np.zeros(0)
        return {name: Column("rig", name, split_unit(name)[1], empty, empty, empty) for name in names}

    def check_outputs(self) -> None:
        """Refuse measured signals without a noise."""
        for output in self.compared:
            self.check_keys(output)

    def timed(
        self, case: Case, outputs: list[Output], inputs: list[tuple[str, InputKeys, Column]], unknowns: list[Unknown]
    ) -> tuple[Case, list[Output]]:
        """The case as it is: it has no end."""
        del inputs, unknowns
        return case, outputs

    def recording(self, unknowns: list[Unknown]) -> RecordedExperiment:
        """The experiment, whose inputs are read from `tables`."""
        experiment = super().recording(unknowns)
        return replace(experiment, case=replay.bind_tables(experiment.case, self.tables))

    def played(self, case: Case, inputs: list[tuple[str, InputKeys, Column]]) -> list[Any]:
        """No values yet."""
        self.tables = tuple(np.zeros(idle_ticks(case) + 1) for _ in inputs)
        return []

    def live_inputs(self) -> list[LiveSignal]:
        """Return the signals that drive the model."""
        signals = []
        for key, keys, _ in self.driving:
            variable = self.looked_up(keys.signal, self.catalog, "inputs", key)
            assert variable is not None
            name, symbol = split_unit(key)
            offset = self.quantity(keys.offset, variable.unit, "inputs", key, "offset", is_difference=True)
            signals.append(LiveSignal(name, symbol, keys.signal, variable.unit, keys.factor, offset))
        return signals

    def live_outputs(self) -> list[LiveSignal]:
        """Return the measured signals."""
        signals = []
        for output in self.compared:
            name, symbol = split_unit(output.column)
            factor = self.keys.outputs[output.column].factor
            offset, delay = -float(output.offset), float(output.delay)
            signals.append(LiveSignal(name, symbol, output.signal, output.unit, factor, offset, delay))
        return signals

    def rig_keys(self, folder: Path) -> RigKeys:
        """Return the keys of the rig, with paths of hardware files from where the command runs."""
        assert self.keys.rig is not None
        sources = {
            name: source.model_copy(update={"hardware": str(folder / source.hardware)}) if source.hardware else source
            for name, source in self.keys.rig.sources.items()
        }
        return self.keys.rig.model_copy(update={"sources": sources})
