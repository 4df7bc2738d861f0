"""ECCO: step control by the energy that power bonds create or lose, without rollback.

Sadjina, Kyllingstad, Skjong, Pedersen: Energy conservation and power bonds in co-simulations: non-iterative adaptive step
size control and error estimation, Eng. Comput. 33(3), 2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from twin.coupling.algorithms.algorithm import Algorithm
from twin.coupling.bonds import find_bonds, find_power_pairs
from twin.coupling.variable_step.record_layout import RESIDUAL

if TYPE_CHECKING:
    from twin.coupling.system import ResolvedConnection


@dataclass(frozen=True, kw_only=True, eq=False)
class Ecco(Algorithm):
    """ECCO with members in parallel; the scenario's step is the longest, `smallest` [ns] the shortest.

    `tolerance`: of the energy that a bond creates or loses in a step, relative to the largest energy transferred, or to
    `floor` [J]. A step that turns out too long is kept; the next one is shorter. `correction` above 0 adds the energy
    correction of `energy`.
    """

    name: ClassVar[str] = "ecco"
    control: ClassVar[int] = RESIDUAL

    order: int = 1
    tolerance: float = 1e-3  # type: ignore[misc]
    smallest: int = 1_000  # type: ignore[misc]  # [ns]
    floor: float = 1e-12  # type: ignore[misc]
    correction: float = 0.0  # type: ignore[misc]

    def corrected(self, links: list[ResolvedConnection]) -> list[ResolvedConnection]:
        """Return the connections of all power bonds; CouplingError if a bond has no power."""
        find_power_pairs(links)  # raises before the run starts
        return [link for own in find_bonds(links).values() for link in own]

    def remarks(self, corrected: list[ResolvedConnection]) -> list[str]:
        """Return a note if there is no power bond to control the step."""
        advice = "Write `bond: name` at a force and at the velocity back, or take predictive, which needs no bond."
        return [] if corrected else [f"ecco: no connection is a power bond, so all steps are the longest. {advice}"]
