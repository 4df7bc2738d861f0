"""Policy for late cycles: what is tolerated, how, and for how long.

The drives do not wait: in csv and cst they continue with their last target, in csp they stand at it, and each
stops by itself when this program's heartbeat is missing. This module is only about what this program does afterwards.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hw_bridge.bus import NEVER
from hw_bridge.hardware import stall_bounds
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.hardware import HardwareKeys

SLOW = (
    1_000_000_000  # so long after a late cycle all goes at half speed [ns]; estimate: stalls of a host come in groups
)


class LateCyclePolicy:
    """Evaluate the lateness of each cycle. `overruns`: cycles late by more than a period; `longest`: the largest [ns]."""

    def __init__(self, keys: HardwareKeys) -> None:
        self.cycle, self.policy, self.at_most = keys.cycle, keys.late_cycle.policy, stall_bounds.at_most(keys)
        self.overruns = self.longest = self.slowed = 0
        self._slow_until = -NEVER

    def check(self, lateness: int, now: int) -> int:
        """Return by how much the rest of the scenario is delayed [ns]; SimulationError where the run ends."""
        if lateness <= self.cycle:
            return 0
        self.overruns += 1
        self.longest = max(self.longest, lateness)
        lateness_text = f"this program came {lateness / 1e6:.1f} ms late"
        if self.policy == "stop":
            raise SimulationError(f"{lateness_text}, and late_cycle is stop. All drives stop.")
        if lateness > self.at_most:
            raise SimulationError(
                f"{lateness_text}, more than the {self.at_most / 1e6:g} ms of late_cycle. All drives stop."
            )
        if self.policy == "slow_down":
            self._slow_until = now + SLOW
        return lateness

    def slow(self, now: int) -> bool:
        """Whether this cycle of the scenario takes two of the drives' cycles."""
        is_slow = now < self._slow_until
        self.slowed += is_slow
        return is_slow

    def report(self) -> dict[str, Any]:
        """Statistics of late cycles for the summary of a run."""
        return {
            "late_cycle": self.policy,
            "overruns": self.overruns,
            "longest_overrun": self.longest / 1e9,
            "slow_cycles": self.slowed,
        }
