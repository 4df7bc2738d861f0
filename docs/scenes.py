"""Draw docs/figures/environments.svg, the environments that are shipped, and scene.svg, two heartbeats of a run made now.

python docs/scenes.py
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from twin.results import Window, plotting
from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario
from twin.scene import animation, picture, read_environment, scene_instants, still_frames

ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "docs" / "figures"
# name -> left, bottom, width and height of its panel, as parts of the figure
PANELS = {
    "two_bends": (0.05, 0.72, 0.56, 0.23),
    "heart_wall": (0.05, 0.37, 0.56, 0.23),
    "free_gap": (0.05, 0.07, 0.56, 0.18),
    "aortic_arch": (0.68, 0.54, 0.31, 0.41),
    "left_ventricle": (0.68, 0.07, 0.31, 0.38),
}
VARIANT, SEED = "PI+FF", 1
SHOWN = Window(12_000_000_000, 14_000_000_000)  # two heartbeats after the controller has settled [ns]
RATE = 12.0  # frames a second: the file stays small


def environments() -> str:
    """All environments in one picture."""
    with mpl.rc_context({**plotting.STYLE, "font.size": 8}):
        figure = Figure((9.4, 8.0))
        for name, place in PANELS.items():
            axis, shown = figure.add_axes(place), still_frames(read_environment(name))
            picture.prepare_axis(axis, shown)
            axis.apply_aspect()
            picture.draw_walls(axis, shown, 0)
            picture.draw_instant(axis, shown, 0)
            axis.set(title=name, xlabel="", ylabel="")
        return picture.figure_svg(figure, "environments") + "\n"


def scene() -> str:
    """The tip on the beating wall, moving."""
    scenario = load_scenario(ROOT / "scenarios" / "bench_wall.yaml")
    with tempfile.TemporaryDirectory() as folder:
        outcome = run_scenario(
            scenario,
            RunOptions(variants=[VARIANT], seeds=[SEED], root=Path(folder), build=ROOT / "build", report=False),
        )
    shown = scene_instants(replace(scenario.scenes[0], window=SHOWN), outcome.tables[VARIANT, SEED])
    assert shown is not None
    return animation.animated_svg(shown, RATE, 1.0)


if __name__ == "__main__":
    (FIGURES / "environments.svg").write_text(environments(), encoding="utf-8")
    (FIGURES / "scene.svg").write_text(scene(), encoding="utf-8")
