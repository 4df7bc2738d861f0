"""Four small runs, and plots of them, that tests of the report and of plots share."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np

from twin.results import Expectation, Plot, PlotCurve, Signals
from twin.results.evaluation import expression

TIME = np.arange(5001) * 0.001
SVG = "{http://www.w3.org/2000/svg}"


def tables(*, complete: bool = True) -> dict[tuple[str, int], Signals]:
    return {
        (variant, seed): Signals(
            TIME,
            {"a.force": 0.2 + scale * np.sin(6 * TIME + seed), "a.x": np.cos(6 * TIME), "a.v": np.zeros((5001, 2))},
            {"a.force": "N", "a.x": "m"},
            complete,
        )
        for variant, scale in (("PI", 0.05), ("PI+FF", 0.02))
        for seed in (1, 2)
    }


FORCE = expression.parse("a.force")
LIMIT = Expectation("stays <in> band", signal=FORCE, at_least=0.1, at_most=0.22, unit="N")
PLOTS = [
    Plot(
        "Force <per> controller",
        (PlotCurve(FORCE, "force"),),
        "force",
        "N",
        per_variant=True,
        band=(0.1, 0.4),
        lines=(0.2,),
    ),
    Plot("Loop", (PlotCurve(FORCE, "force", expression.parse("a.x")),), unit="N", x_unit="mm"),
    Plot("Nothing", (PlotCurve(expression.parse("a.nothing"), "x"),)),
]


def labels(svg: str) -> list[str]:
    """All text of an SVG that people read."""
    root = ET.fromstring(svg.replace(' role="img"', "", 1))
    return [(element.text or "").replace("\N{MINUS SIGN}", "-") for element in root.iter(f"{SVG}text")]
