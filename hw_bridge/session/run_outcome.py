"""Outcome of a case: stop reason, bus events, faults at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin.errors import SimulationError
from twin.results import HardwareTermination

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hw_bridge.bus import Override
    from hw_bridge.plant import Bench


class RunOutcome:
    """Outcome of one case, filled as the case ends."""

    def __init__(self) -> None:
        self.notes: list[str] = []  # notes for the operator
        self.bus_events: list[str] = []
        self.unsafe: list[str] = []
        self.stopped: tuple[int, str] | None = None  # time of the scenario [ns] and reason of a stop before the end

    def record_faults_at_rest(self, bench: Bench, failed: bool) -> None:
        """Record what is not at rest after the stop: by the true state if simulated, else what the master could not confirm."""
        try:
            self.unsafe = bench.faults_at_rest(failed, self.notes)
        except (
            SimulationError
        ) as error:  # of a motor that cannot continue; the failure that ended the case is reported first
            self.unsafe.append(str(error))

    def timeline(self, applied: Sequence[Override], bus_events: Sequence[str]) -> list[str]:
        """Bus events with planned faults and the stop, sorted by time."""
        marks = [(override.at, f"FAULT {override.text}") for override in applied]
        marks += [(self.stopped[0], f"STOP {self.stopped[1]}")] if self.stopped is not None else []
        lines = [*(f"{time / 1e9:.6f} s: {text}" for time, text in marks), *bus_events]
        return sorted(lines, key=line_time)

    def termination(self) -> HardwareTermination:
        """Summarize how the case ended."""
        time, reason = self.stopped or (None, "")
        return HardwareTermination(time, reason, " ".join(self.unsafe), tuple(self.bus_events))


def line_time(line: str) -> float:
    """Time at the beginning of a line [s]; the line about earlier events has none, and sorts first."""
    head = line.partition(" ")[0]
    return float("-inf") if head == "before:" else float(head)
