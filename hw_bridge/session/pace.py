"""Cycles that come late: what is ridden through, how, and for how long.

The drives do not wait: in csv and cst they go on as they were told last, in csp they stand at their last target, and each
stops by itself where this program's heartbeat is missing. Here is only what this program does when it comes back.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hw_bridge.bus import NEVER
from hw_bridge.hardware import late
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.hardware import HardwareKeys

SLOW = (
    1_000_000_000  # so long after a late cycle all goes at half speed [ns]; estimate: stalls of a host come in groups
)


class Pace:
    """Judges each cycle. `late`: how many came later than a whole cycle; `longest`: by how much, of these [ns]."""

    def __init__(self, keys: HardwareKeys) -> None:
        self.cycle, self.policy, self.at_most = keys.cycle, keys.late_cycle.policy, late.at_most(keys)
        self.late = self.longest = self.slowed = 0
        self._slow_until = -NEVER

    def judge(self, lateness: int, now: int) -> int:
        """How far the rest of the scenario is put off [ns]; SimulationError where that is the end of the run."""
        if lateness <= self.cycle:
            return 0
        self.late += 1
        self.longest = max(self.longest, lateness)
        came = f"this program came {lateness / 1e6:.1f} ms late"
        if self.policy == "stop":
            raise SimulationError(f"{came}, and late_cycle is stop. All drives stop.")
        if lateness > self.at_most:
            raise SimulationError(f"{came}, more than the {self.at_most / 1e6:g} ms of late_cycle. All drives stop.")
        if self.policy == "slow_down":
            self._slow_until = now + SLOW
        return lateness

    def slow(self, now: int) -> bool:
        """Whether this cycle of the scenario takes two of the drives'."""
        found = now < self._slow_until
        self.slowed += found
        return found

    def report(self) -> dict[str, Any]:
        """What came late, for the summary of a run."""
        return {"late_cycle": self.policy, "overruns": self.late, "longest_overrun": self.longest / 1e9,
                "slow_cycles": self.slowed}  # fmt: skip
