"""Energy correction of power bonds: an input's error over a step is added in the next step.

Benedikt, Watzenig, Hofer: Modelling and analysis of the non-iterative coupling process for co-simulation, Math. Comput.
Model. Dyn. Syst. 19(5), 2013 (the nearly energy-preserving coupling element); Sadjina, Pedersen: Energy conservation and
coupling error reduction in non-iterative co-simulations, Eng. Comput. 36, 2020.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from twin.coupling.algorithms.algorithm import LIMITS, Algorithm, Limits
from twin.coupling.bonds import find_bonds

if TYPE_CHECKING:
    from twin.coupling.system import ResolvedConnection


@dataclass(frozen=True, kw_only=True, eq=False)
class Energy(Algorithm):
    """Energy correction with members in parallel; inputs of power bonds get the share `correction` of the last step's error.

    All inputs are extrapolated with `order`. The error is the mean of a connection's values at begin and end of the last
    step minus the mean of the extrapolated input.
    """

    name: ClassVar[str] = "energy"
    limits: ClassVar[Mapping[str, Limits]] = {**LIMITS, "correction": (0.0, 1.0, True)}

    order: int = 1
    correction: float = 1.0  # type: ignore[misc]

    def corrected(self, links: list[ResolvedConnection]) -> list[ResolvedConnection]:
        """Return the connections of all power bonds."""
        return [link for own in find_bonds(links).values() for link in own]

    def remarks(self, corrected: list[ResolvedConnection]) -> list[str]:
        """Return a note if there is no power bond."""
        advice = (
            "Write `bond: name` at a force and at the velocity or position back, or connect terminals that have both."
        )
        return [] if corrected else [f"energy: no connection is a power bond, so none is corrected. {advice}"]
