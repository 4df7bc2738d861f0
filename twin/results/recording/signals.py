"""Recorded signals in the members' units, and expressions over them in coherent SI units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import unit
from twin.errors import CouplingError, ScenarioError
from twin.results.recording import rows

if TYPE_CHECKING:
    from twin.results.evaluation.expression import Expression

# Rounding error of a zero relative to its largest operand: a mean of 5.8e-15 mm is zero.
ROUNDING_ERROR = 1e-12
MILLI_UNITS = {"N": "mN", "m": "mm", "s": "ms", "A": "mA", "V": "mV", "m/s": "mm/s", "N*m": "mN*m"}  # by their SI units
LARGER_UNITS = {milli: unit for unit, milli in MILLI_UNITS.items()}


@dataclass(frozen=True)
class Window:
    """Time window, both ends included [ns]; None: start or end of the run."""

    start_ns: clock.Time | None = None
    stop_ns: clock.Time | None = None

    @property
    def text(self) -> str:
        """Description for a message: `, from 4 s, to 5 s`."""
        text = f", from {clock.text(self.start_ns)}" if self.start_ns is not None else ""
        return text + (f", to {clock.text(self.stop_ns)}" if self.stop_ns is not None else "")


FULL_RUN = Window()


@dataclass
class Signals:
    """Recorded signals of one case. `values`: member.variable -> array (n, ...), in the variable's own unit.

    `complete` is False for a case that was interrupted or failed: it is plotted, but metrics are not computed from it.
    A recording larger than `stream.LARGE_FILE` stays in its file; `parts` iterates over it in slices.
    """

    time: np.ndarray[Any, Any]  # [s], (n,)
    values: Mapping[str, np.ndarray[Any, Any]]
    units: Mapping[str, str] = field(default_factory=dict)
    complete: bool = True
    display_units: Mapping[str, str] = field(default_factory=dict)  # where they differ from `units`
    window_lengths: Mapping[str, float] = field(default_factory=dict)  # [s] before each row, of results of an analysis

    @property
    def is_large(self) -> bool:
        """Whether the recording stays in its file, of which one slice is in memory: for one reader at a time."""
        return isinstance(self.time, rows.RowColumn)

    def parts(self) -> Iterator[Signals]:
        """Iterate over consecutive parts that fit into memory; a recording in memory is one part."""
        if not isinstance(self.time, rows.RowColumn):
            yield self
            return
        for begin in range(0, len(self.time), self.time.rows.rows_per_slice):
            part = slice(begin, min(begin + self.time.rows.rows_per_slice, len(self.time)))
            yield replace(self, time=self.time[part], values=SignalSlice(self.values, part))

    def subsample(self, max_rows: int) -> Signals:
        """Return every n-th row of a large recording, at most `most` rows; others are returned unchanged."""
        if not isinstance(self.time, rows.RowColumn):
            return self
        stride = slice(None, None, -(-len(self.time) // max_rows))
        return replace(self, time=self.time[stride], values=SignalSlice(self.values, stride))

    def to_si(self, names: set[str]) -> dict[str, np.ndarray[Any, Any]]:
        """Return the named signals in coherent SI units, as floats."""
        result = {}
        for name in names & set(self.values):
            factor, offset = si_conversion(self.units.get(name, ""))
            values = np.asarray(self.values[name], np.float64)
            result[name] = values if (factor, offset) == (1.0, 0.0) else values * factor + offset
        return result

    def evaluate(self, expression: Expression, window: Window = FULL_RUN) -> tuple[Any, Any] | None:
        """Return (time, value) of an expression in a window.

        None if a signal of it was not recorded or has no such element, or if the expression is not scalar.
        """
        values = self.to_si({signal.name for signal in expression.signals})
        try:
            if expression.shape({name: array.shape[1:] for name, array in values.items()}):
                return None
        except (KeyError, IndexError, ScenarioError):
            return None
        value = expression.evaluate(values)
        value = np.broadcast_to(value, self.time.shape) if np.ndim(value) == 0 else value
        seconds = np.asarray(self.time)
        mask = window_mask(seconds, window)
        return seconds[mask], value[mask]

    def evaluate_parts(self, expression: Expression, window: Window = FULL_RUN) -> Iterator[tuple[Any, Any]]:
        """Evaluate an expression part by part; yields nothing where `evaluate` returns None."""
        for part in self.parts():
            if (result := part.evaluate(expression, window)) is None:
                return
            yield result

    def scale(self, expression: Expression) -> float:
        """Return the size of an expression's operands: a difference near zero is only as exact as these are."""
        largest = 0.0
        for part in self.parts():
            values = expression.magnitude(part.to_si({signal.name for signal in expression.signals}))
            largest = float(np.max(np.asarray(values)[np.isfinite(values)], initial=largest))
        return largest

    def window_length(self, expression: Expression) -> float:
        """Return the duration before each row of which an expression's value is [s]; 0 if it is of the row's time."""
        return max((self.window_lengths.get(signal.name, 0.0) for signal in expression.signals), default=0.0)

    def has(self, expression: Expression) -> bool:
        """Whether every signal of an expression was recorded."""
        return all(signal.name in self.values for signal in expression.signals)


class SignalSlice(Mapping[str, Any]):
    """Some rows of signals, each read on access."""

    def __init__(self, signals: Mapping[str, Any], rows_: slice) -> None:
        self.signals, self.rows = signals, rows_

    def __getitem__(self, name: str) -> np.ndarray[Any, Any]:
        return np.asarray(self.signals[name][self.rows])

    def __iter__(self) -> Iterator[str]:
        return iter(self.signals)

    def __len__(self) -> int:
        return len(self.signals)


def window_mask(time: np.ndarray[Any, Any], window: Window) -> np.ndarray[Any, Any]:
    """Return a mask of the times [s] in a window. They are rounded to nanoseconds: 4 s belongs to `from: 4 s`."""
    rounded = np.rint(time * clock.NANOSECONDS)
    mask = np.ones(len(rounded), bool)
    if window.start_ns is not None:
        mask &= rounded >= round(window.start_ns)
    if window.stop_ns is not None:
        mask &= rounded <= round(window.stop_ns)
    return mask


@lru_cache(maxsize=256)
def si_conversion(symbol: str, is_difference: bool = False) -> tuple[float, float]:
    """Return (factor, offset) to SI; 1 and 0 for a unit that is not in any table. A difference has no offset."""
    try:
        description = unit.describe(symbol)
    except CouplingError:
        return 1.0, 0.0
    return description.factor, 0.0 if is_difference else description.offset


def format_value(
    value: float | None,
    symbol: str,
    scale: float = 0.0,
    is_difference: bool = False,
    decimals: int | None = None,
    digits: int = 4,
    keeps_unit: bool = False,
) -> str:
    """Format a value in a unit with some digits, or with a number of decimals: `0.0362 N`.

    Without `keeps_unit` a value that needs a power of ten in a milli unit is in the unit itself: 18.08 N, not 1.808e+04 mN.

    `scale`: size of the operands that it was computed from, in SI; rounding errors of these are shown as 0.
    """
    if value is None:
        return "-"
    factor, offset = si_conversion(symbol, is_difference)
    if abs(value - offset) <= ROUNDING_ERROR * max(scale, abs(offset)):
        value = offset
    number = unit.round_trip((value - offset) / factor)  # as in the summary: no text differs by a rounding error
    text = f"{number:.{digits}g}" if decimals is None else f"{number:.{decimals}f}"
    if "e+" in text and symbol in LARGER_UNITS and not keeps_unit:
        return format_value(value, LARGER_UNITS[symbol], scale, is_difference, decimals, digits)
    return f"{text if float(text) else text.lstrip('-')} {unit.label(symbol)}".rstrip()  # 60 /min
