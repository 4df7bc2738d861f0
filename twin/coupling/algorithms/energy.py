"""Power bonds whose ends agree on what went through: what an input got too little in a step it gets in the next.

Benedikt, Watzenig, Hofer: Modelling and analysis of the non-iterative coupling process for co-simulation, Math. Comput.
Model. Dyn. Syst. 19(5), 2013 (the nearly energy-preserving coupling element); Sadjina, Pedersen: Energy conservation and
coupling error reduction in non-iterative co-simulations, Eng. Comput. 36, 2020.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from twin.coupling.algorithms.algorithm import Algorithm
from twin.coupling.bonds import bonds

if TYPE_CHECKING:
    from twin.coupling.system import Link


@dataclass(frozen=True, kw_only=True, eq=False)
class Energy(Algorithm):
    """Members in parallel; inputs of power bonds get the share `correction` of what the last step owed them.

    All inputs are extrapolated with `order`. What is owed: the mean of what a connection gave over the last step (of its
    begin and end) minus that of the course that was fed.
    """

    name: ClassVar[str] = "energy"

    order: int = 1
    correction: float = 1.0  # type: ignore[misc]

    def __post_init__(self) -> None:
        super().__post_init__()
        self._limited("correction", 0.0, 1.0, above=True)

    def corrected(self, links: list[Link]) -> list[Link]:
        """Those of all power bonds."""
        return [link for own in bonds(links).values() for link in own]

    def remarks(self, corrected: list[Link]) -> list[str]:
        """That there are no bonds."""
        advice = (
            "Write `bond: name` at a force and at the velocity or position back, or connect terminals that have both."
        )
        return [] if corrected else [f"energy: no connection is a power bond, so none is corrected. {advice}"]
