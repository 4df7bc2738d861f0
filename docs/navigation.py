"""Draw the figures of docs/explanation/navigation.md, and write its result table, from a run made now.

python docs/navigation.py
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import numpy as np
from figures import FIGURES, ROOT, draw_plots, run
from tables import pivot

from twin.scene import instants, picture

PAGE = ROOT / "docs" / "explanation" / "navigation.md"
SHOWN = (0.0, 18.8, 48.0, 56.0)  # [s]: the start, after two legs of the wire, in the arch, the catheter at its farthest
COLUMNS = (
    "wire_reached", "catheter_reached", "lead", "wire_moved", "catheter_moved", "hall_worst", "fused_worst",
    "catheter_push", "regrips",
)  # fmt: skip
PLOTS = {
    "Tips along the vessel": "navigation_tips.svg",
    "Error of the catheter's travel": "navigation_error.svg",
    "Curvature along the catheter, as in Fig. 10C": "navigation_curvature.svg",
    "Shape of the catheter after registration, as in Fig. 10D": "navigation_shape.svg",
}


def main() -> None:
    """Draw and write everything."""
    with tempfile.TemporaryDirectory() as folder:
        outcome = run("in_vivo_navigation", Path(folder))
    draw_plots(outcome, PLOTS)
    frames = instants(outcome.scenario.scenes[0], outcome.tables["navigation", 0])
    assert frames is not None
    chosen = frames.at(np.searchsorted(frames.time, np.array(SHOWN) - 1e-9))
    (FIGURES / "navigation_vessel.svg").write_text(
        picture.as_svg(picture.figure(chosen, instants=len(SHOWN)), "navigation_vessel") + "\n"
    )
    marks = re.compile(r"(<!-- results in_vivo_navigation -->\n).*?(<!-- end -->)", re.DOTALL)
    table = pivot(outcome.summary, COLUMNS)
    PAGE.write_text(marks.sub(lambda match: match[1] + table + "\n" + match[2], PAGE.read_text()))


if __name__ == "__main__":
    main()
