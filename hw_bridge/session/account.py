"""What is told of a case: what stopped it, what was seen on the bus, what did not come to rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin.errors import SimulationError
from twin.results import HardwareTermination

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hw_bridge.bus import Override
    from hw_bridge.plant import Bench


class Account:
    """Filled as a case ends. Until then it is empty."""

    def __init__(self) -> None:
        self.notes: list[str] = []  # what the person who runs this has to know
        self.seen: list[str] = []
        self.unsafe: list[str] = []
        self.stopped: tuple[int, str] | None = None  # time of the scenario [ns] and reason of a stop before the end

    def look_after(self, bench: Bench, failed: bool) -> None:
        """What is not at rest after the stop: on a simulated bus in truth, else what the master could not confirm."""
        try:
            self.unsafe = bench.restless(failed, self.notes)
        except SimulationError as error:  # of a motor that cannot go on; the failure that ended the case is told first
            self.unsafe.append(str(error))

    def story(self, acted: Sequence[Override], seen: Sequence[str]) -> list[str]:
        """What was seen on the bus, with the faults that were planned and the stop in their places."""
        marks = [(override.at, f"FAULT {override.text}") for override in acted]
        marks += [(self.stopped[0], f"STOP {self.stopped[1]}")] if self.stopped is not None else []
        lines = [*(f"{time / 1e9:.6f} s: {text}" for time, text in marks), *seen]
        return sorted(lines, key=began)

    def termination(self) -> HardwareTermination:
        """How the case ended."""
        time, reason = self.stopped or (None, "")
        return HardwareTermination(time, reason, " ".join(self.unsafe), tuple(self.seen))


def began(line: str) -> float:
    """Time at the beginning of a line [s]; that there was more before has none, and stays at the top."""
    head = line.partition(" ")[0]
    return float("-inf") if head == "before:" else float(head)
