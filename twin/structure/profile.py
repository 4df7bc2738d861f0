"""Computing time of each member of a co-simulation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from twin.coupling import Stopwatch

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling import CoSimulation


@dataclass(frozen=True)
class Cost:
    """Computing time of a member. `step`: of one of its steps [s]; `per_tick`: per communication step with value transfer [s]."""

    name: str
    what: str
    step: float
    per_tick: float
    share: float


@dataclass(frozen=True)
class CostProfile:
    """Costs, the largest first. `per_tick`: of a complete communication step [s], without the clock readings."""

    costs: tuple[Cost, ...]
    per_tick: float
    step: float  # communication step [s]
    overhead: float  # of reading the clock once [s]
    sampled_steps: int  # sampled communication steps

    @property
    def real_time_factor(self) -> float:
        """Simulated time divided by the computing time of the loop."""
        return self.step / self.per_tick


CONNECTIONS, LOOP = "connections", "loop and recording"


def profiled(watch: Stopwatch, simulated: CoSimulation, components: Mapping[str, str], step: float) -> CostProfile:
    """Evaluate the measurements of a stopwatch."""
    each = watch.per_tick()
    kinds, members, done = np.array(watch.kinds), np.array(watch.members), watch.done
    read = (len(each) + 2) * watch.overhead
    total = max(watch.wall / max(watch.ticks, 1) - read, float(each.sum()))
    rows = []
    for number, name in enumerate(simulated.members):
        is_own = members == number
        steps = is_own & (kinds == "steps")
        share = done[steps].sum() / max(watch.sampled, 1)  # steps in a communication step: a slow member has fewer
        step_time = float(each[steps].sum() / share) if share else 0.0
        rows.append((name, components.get(name, ""), step_time, float(each[is_own].sum())))
    rows.append((CONNECTIONS, "values copied and converted", 0.0, float(each[kinds == "copies"].sum())))
    rows.append((LOOP, "", 0.0, total - float(each.sum())))
    ordered = sorted(rows, key=lambda row: -row[3])
    costs = tuple(
        Cost(name, what, step_time, per_tick, per_tick / total) for name, what, step_time, per_tick in ordered
    )
    return CostProfile(costs, total, step, watch.overhead, watch.sampled)
