"""Checks of values that arrive: numbers that are none, wrong units, sensors that stand still, and names that are never sent."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from twin.errors import SimulationError, nearest

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping

    from twin.follow.live_problem import LiveSignal
    from twin.follow.schema import Reaction

CONSTANT_AFTER = 2.0  # so long a measured value must be equal to the bit until its sensor counts as stuck [s]
CONSTANT_COUNT = 20  # and so many messages
UNKNOWN_AFTER = 2.0  # after the first message: then each signal must have been sent once [s]


@dataclass
class Notes:
    """One line for each kind of event, shown when it occurs first; later ones are counted. `show`: gets each line."""

    show: Callable[[str], object]
    lines: list[str] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)

    def report(self, kind: str, text: str, reaction: Reaction = "continue") -> None:
        """Tell of an event; SimulationError if following has to stop."""
        if reaction == "stop":
            raise SimulationError(text)
        self.counts[kind] += 1
        if self.counts[kind] == 1:
            self.lines.append(text)
            self.show(text)

    def report_again(self, kind: str) -> None:
        """Let the next event of a kind be shown again."""
        self.counts[kind] = 0


@dataclass
class Repeats:
    """Last value of a measured signal, since when [s] and how often it has been sent, and whether its sensor counts as stuck."""

    value: float = math.nan
    since: float = 0.0
    count: int = 0
    stuck: bool = False


class SignalChecks:
    """Checks of the values of a rig. `on_bad`: what happens if one cannot be used."""

    def __init__(self, measured: Iterable[LiveSignal], notes: Notes, on_bad: Reaction) -> None:
        self.notes, self.on_bad = notes, on_bad
        self._repeats = {signal.name: Repeats() for signal in measured}
        self.sent: dict[str, str] = {}  # name -> source
        self._begin: float | None = None

    def checked(self, signal: LiveSignal, value: float, sent_unit: str, time: float) -> float | None:
        """Return the value for the model, None if it cannot be used. `time` [s]: of the measurement."""
        if not math.isfinite(value):
            self.notes.report(
                f"nan {signal.name}", f"{signal.name} is {value}: left out until it is a number.", self.on_bad
            )
            return None
        if isinstance(converted := signal.converted(value, sent_unit), str):
            text = f"{signal.name} {converted}: left out. Correct the sender, or the signal in the follow file."
            self.notes.report(f"unit {signal.name}", text, self.on_bad)
            return None
        return None if self._is_stuck(signal, value, time) else converted

    def _is_stuck(self, signal: LiveSignal, value: float, time: float) -> bool:
        """Whether a measured value has been the same for so long that its sensor does not measure."""
        repeats = self._repeats.get(signal.name)
        if repeats is None:
            return False
        if value != repeats.value:
            if repeats.stuck:
                self.notes.report_again(f"constant {signal.name}")
            self._repeats[signal.name] = Repeats(value, time, 1)
            return False
        repeats.count += 1
        if not repeats.stuck and time - repeats.since >= CONSTANT_AFTER and repeats.count >= CONSTANT_COUNT:
            repeats.stuck = True
            text = (
                f"{signal.name} is constant ({value:g} {signal.unit}".rstrip()
                + f") for {CONSTANT_AFTER:g} s: its sensor does not measure. Left out until it changes."
            )
            self.notes.report(f"constant {signal.name}", text, self.on_bad)
        return repeats.stuck

    def note_names(self, source: str, names: Iterable[str], now: float) -> None:
        """Note which names a source sends."""
        self._begin = now if self._begin is None else self._begin
        for name in names:
            self.sent.setdefault(name, source)

    def check_names(self, wanted: Collection[str], sources: Mapping[str, object], now: float) -> None:
        """Tell of signals that no source has sent."""
        if self._begin is None or now - self._begin < UNKNOWN_AFTER:
            return
        for name in wanted:
            if name not in self.sent:
                text = f"{name}: {' and '.join(sources)} {'do' if len(sources) > 1 else 'does'} not send it. {nearest(name, self.sent)}"
                self.notes.report(f"unknown {name}", text, self.on_bad)
