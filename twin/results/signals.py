"""What a run recorded, in the members' units, and expressions over it in coherent SI units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import unit
from twin.errors import CouplingError, ScenarioError
from twin.results import rows

if TYPE_CHECKING:
    from twin.results.expression import Expression

# What float64 leaves of a zero, as part of the largest number that it was made of: a mean of 5.8e-15 mm is none.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Window:
    """Part of a run, both ends included [ns]; None: its start or end."""

    start_ns: clock.Time | None = None
    stop_ns: clock.Time | None = None

    @property
    def text(self) -> str:
        """`, from 4 s, to 5 s`."""
        text = f", from {clock.text(self.start_ns)}" if self.start_ns is not None else ""
        return text + (f", to {clock.text(self.stop_ns)}" if self.stop_ns is not None else "")


WHOLE = Window()


@dataclass
class Signals:
    """What one case recorded. `values`: member.variable -> array (n, ...), in the variable's own unit.

    `complete` is False for a case that was interrupted or failed: it is plotted, but no metric is taken from it.
    A recording that is larger than `rows.LARGE` is in its file; `parts` go through it without having it in memory.
    """

    time: np.ndarray[Any, Any]  # [s], (n,)
    values: Mapping[str, np.ndarray[Any, Any]]
    units: Mapping[str, str] = field(default_factory=dict)
    complete: bool = True
    display_units: Mapping[str, str] = field(default_factory=dict)  # where they are others

    @property
    def is_large(self) -> bool:
        """Whether it is in its file, of which one slice at a time is at hand: for one reader."""
        return isinstance(self.time, rows.Column)

    def parts(self) -> Iterator[Signals]:
        """The same in parts that fit into memory, one after the other; most are one part."""
        if not isinstance(self.time, rows.Column):
            yield self
            return
        for begin in range(0, len(self.time), self.time.rows.slice):
            part = slice(begin, min(begin + self.time.rows.slice, len(self.time)))
            yield replace(self, time=self.time[part], values=Part(self.values, part))

    def sampled(self, most: int) -> Signals:
        """The same with every n-th row, if it is large, so that there are at most so many."""
        if not isinstance(self.time, rows.Column):
            return self
        every = slice(None, None, -(-len(self.time) // most))
        return replace(self, time=self.time[every], values=Part(self.values, every))

    def si(self, names: set[str]) -> dict[str, np.ndarray[Any, Any]]:
        """The named signals in coherent SI units, as floats."""
        result = {}
        for name in names & set(self.values):
            factor, offset = coherent(self.units.get(name, ""))
            values = np.asarray(self.values[name], np.float64)
            result[name] = values if (factor, offset) == (1.0, 0.0) else values * factor + offset
        return result

    def evaluate(self, expression: Expression, window: Window = WHOLE) -> tuple[Any, Any] | None:
        """(time, value) of an expression in a window.

        None if a signal of it was not recorded or has no element, or if the expression is no single value.
        """
        values = self.si({signal.name for signal in expression.signals})
        try:
            if expression.shape({name: array.shape[1:] for name, array in values.items()}):
                return None
        except (KeyError, IndexError, ScenarioError):
            return None
        value = expression.evaluate(values)
        value = np.broadcast_to(value, self.time.shape) if np.ndim(value) == 0 else value
        seconds = np.asarray(self.time)
        inside = within(seconds, window)
        return seconds[inside], value[inside]

    def pieces(self, expression: Expression, window: Window = WHOLE) -> Iterator[tuple[Any, Any]]:
        """What `evaluate` gives, part by part; nothing instead of None."""
        for part in self.parts():
            if (found := part.evaluate(expression, window)) is None:
                return
            yield found

    def scale(self, expression: Expression) -> float:
        """Size of the numbers that an expression is made of: a difference near zero is only as exact as these are."""
        largest = 0.0
        for part in self.parts():
            values = expression.magnitude(part.si({signal.name for signal in expression.signals}))
            largest = float(np.max(np.asarray(values)[np.isfinite(values)], initial=largest))
        return largest

    def has(self, expression: Expression) -> bool:
        """Whether every signal of an expression was recorded."""
        return all(signal.name in self.values for signal in expression.signals)


class Part(Mapping[str, Any]):
    """Some rows of signals, each taken when it is asked for."""

    def __init__(self, whole: Mapping[str, Any], rows_: slice) -> None:
        self.whole, self.rows = whole, rows_

    def __getitem__(self, name: str) -> np.ndarray[Any, Any]:
        return np.asarray(self.whole[name][self.rows])

    def __iter__(self) -> Iterator[str]:
        return iter(self.whole)

    def __len__(self) -> int:
        return len(self.whole)


def within(time: np.ndarray[Any, Any], window: Window) -> np.ndarray[Any, Any]:
    """Which times [s] lie in a window: by whole nanoseconds, so that a sample at exactly 4 s belongs to `from: 4 s`."""
    rounded = np.rint(time * clock.NANOSECONDS)
    inside = np.ones(len(rounded), bool)
    if window.start_ns is not None:
        inside &= rounded >= round(window.start_ns)
    if window.stop_ns is not None:
        inside &= rounded <= round(window.stop_ns)
    return inside


@lru_cache(maxsize=256)
def coherent(symbol: str, is_difference: bool = False) -> tuple[float, float]:
    """(factor, offset) to SI; a unit that is not known, as FMUs may have, stays as it is. A difference has no offset."""
    try:
        found = unit.describe(symbol)
    except CouplingError:
        return 1.0, 0.0
    return found.factor, 0.0 if is_difference else found.offset


def shown(value: float | None, symbol: str, scale: float = 0.0, is_difference: bool = False) -> str:
    """A value in the unit it is to be read in, with four digits: `0.0362 N`.

    `scale`: size of the numbers it was made of, in SI; 0 is shown for what rounding leaves of them.
    """
    if value is None:
        return "-"
    factor, offset = coherent(symbol, is_difference)
    if abs(value - offset) <= ROUNDING * max(scale, abs(offset)):
        value = offset
    return f"{(value - offset) / factor:.4g} {unit.shown(symbol)}".rstrip()
