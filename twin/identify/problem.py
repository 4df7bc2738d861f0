"""What is looked for, in what, from which recordings: an identify file, checked against the model and the files."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from twin.results import format_value

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from twin.arrays import Array
    from twin.coupling import Catalog
    from twin.identify.recordings.recorded_files import RecordedFile
    from twin.identify.recordings.schema import IdentifyKeys
    from twin.scenario import Case

EDGE = 1e-3  # part of the range from a bound at which a value is at it


@dataclass(frozen=True)
class Unknown:
    """A value that is looked for: a member's parameter in all recordings or in one, or the delay or offset of an output.

    Inside it counts from 0 at its lower bound to 1 at its upper one, evenly or by its logarithm.
    """

    name: str
    unit: str
    low: float
    high: float
    start: float
    is_log: bool = False
    member: str = ""  # none: of an output
    variable: str = ""
    display_unit: str = ""
    where: str = ""
    recording: str = ""  # none: of all that have it

    @property
    def path(self) -> str:
        """`member.parameter`, if it is one."""
        return f"{self.member}.{self.variable}"

    def value(self, position: float) -> float:
        """Return the value at a position between the bounds, 0 to 1."""
        if self.is_log:
            return float(self.low * (self.high / self.low) ** position)
        return float(self.low + (self.high - self.low) * position)

    def position(self, value: float) -> float:
        """The place of a value, 0 to 1 between the bounds."""
        if self.is_log:
            return float(np.log(value / self.low) / np.log(self.high / self.low))
        return float((value - self.low) / (self.high - self.low))

    def slope(self, position: float) -> float:
        """Return the derivative of the value by the position."""
        return self.value(position) * float(np.log(self.high / self.low)) if self.is_log else self.high - self.low

    def at_bound(self, position: float) -> str:
        """Return the bound that a position is at, or an empty string."""
        return "lower" if position < EDGE else "upper" if position > 1 - EDGE else ""

    def shown(self, value: float) -> str:
        """A value of the parameter for people."""
        if not np.isfinite(value):
            return "unbounded"
        from twin.results import si_conversion

        factor, offset = si_conversion(self.unit)
        return format_value(value * factor + offset, self.display_unit or self.unit)


@dataclass(frozen=True)
class Output:
    """Measured column and the signal that it measures; both in the signal's unit.

    `delay` [s] and `offset` are numbers, or names of unknowns.
    """

    column: str
    file: str
    signal: str
    unit: str
    display_unit: str
    time: Array
    values: Array
    delay: float | str
    offset: float | str
    element: int = 0  # of an array, counted from 0
    noise: float | None = None
    weight: float = 1.0
    recording: str = ""

    @property
    def label(self) -> str:
        """The column, and the recording if there are several."""
        return named(self.column, self.recording)


@dataclass(frozen=True)
class Input:
    """A measured column that drives a variable, in the variable's unit, at every communication point."""

    column: str
    file: str
    signal: str
    values: Array


@dataclass(frozen=True)
class RecordedExperiment:
    """Recording and the model of its experiment."""

    name: str  # "" if there is no other
    case: Case  # inputs replayed, members without influence left out
    catalog: Catalog
    outputs: tuple[Output, ...]
    inputs: tuple[Input, ...]
    files: tuple[RecordedFile, ...]
    model: str  # a component or a scenario with its variant
    left_out: tuple[str, ...] = ()  # members without influence on the outputs
    own: frozenset[str] = frozenset()  # `member.parameter` that is looked for in this recording alone


@dataclass(frozen=True)
class Problem:
    """All that is needed to look for the unknowns."""

    path: Path
    keys: IdentifyKeys
    recordings: tuple[RecordedExperiment, ...]
    unknowns: tuple[Unknown, ...]
    notes: tuple[str, ...] = ()
    components: dict[str, str] = field(default_factory=dict)  # member -> component, as the parameter set calls it

    @property
    def outputs(self) -> tuple[Output, ...]:
        """What is compared in all recordings."""
        return tuple(output for recording in self.recordings for output in recording.outputs)

    @property
    def files(self) -> tuple[RecordedFile, ...]:
        """All files, each once."""
        return tuple({file.path: file for recording in self.recordings for file in recording.files}.values())

    @property
    def model(self) -> str:
        """What is fitted."""
        models = list(dict.fromkeys(recording.model for recording in self.recordings))
        shown = models[0] if len(models) == 1 else f"{models[0]} and others"
        return shown if len(self.recordings) == 1 else f"{shown}, {len(self.recordings)} recordings"

    @property
    def left_out(self) -> tuple[str, ...]:
        """Members that have no influence in any recording."""
        first, *others = self.recordings
        return tuple(name for name in first.left_out if all(name in other.left_out for other in others))

    def of(self, recording: RecordedExperiment) -> tuple[Unknown, ...]:
        """Members' parameters that a recording's simulation depends on."""
        return tuple(
            unknown
            for unknown in self.unknowns
            if unknown.member in recording.case.members
            and unknown.recording in ("", recording.name)
            and not (unknown.recording == "" and unknown.path in recording.own)
        )

    @property
    def title(self) -> str:
        """Title."""
        return self.keys.title or f"Identification of {self.model}"

    @property
    def count(self) -> int:
        """Number of measured values."""
        return sum(len(output.values) for output in self.outputs)

    def positions(self, values: Mapping[str, float] | None = None) -> Array:
        """Return the positions of values by name; by default of the model's own ones."""
        return np.array(
            [unknown.position(values[unknown.name] if values else unknown.start) for unknown in self.unknowns]
        )

    def values(self, positions: Array) -> dict[str, float]:
        """Return the values of the unknowns at their positions."""
        return {
            unknown.name: unknown.value(float(position))
            for unknown, position in zip(self.unknowns, positions, strict=True)
        }


def named(what: str, recording: str) -> str:
    """Something of one recording among several."""
    return f"{what} in {recording}" if recording else what
