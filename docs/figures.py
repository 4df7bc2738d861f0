"""Draw the figures of README.md and docs/, and write their result tables, from runs made now.

python docs/figures.py                          all
python docs/figures.py linear_grip rotation     the tables of these scenarios alone
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from tables import pivot, published, regripping, rig, table, write_data, write_table

from twin.component import Component, input, output  # noqa: A004 - FMI's own word
from twin.results import plotting
from twin.run import RunOptions, RunResult, run_scenario
from twin.scenario import Backend, load_scenario, parse_scenario

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "docs" / "figures"

# scenario -> pages with its result table; without a page, the table is written to docs/data
TABLES: dict[str, tuple[str, ...]] = {
    "heart_wall_force": ("README.md",),
    "hysteresis_identification": ("docs/explanation/force_experiment.md",),
    "linear_grip": (),
    "rotational_grip": (),
    "rotation": (),
    "dynamic_regripping": (),
    "smooth_regripping": (),
    "rig_on_wall": (),
    "coordinate_feedforward": (),
    "needle": (),
}
PIVOTS = {  # metrics as columns
    "dynamic_regripping": ("error_max", "aligned_error_max", "speed_lowest"),
    "smooth_regripping": ("speed_lowest", "standing", "lost"),
    "rig_on_wall": (
        "force_error_std",
        "force_error_max",
        "travel_force_std",
        "travel_force_least",
        "travel_force_most",
        "hand_overs",
        "slip",
    ),
}


def run(name: str, folder: Path) -> RunResult:
    """Run a scenario of scenarios/ and keep its results out of the way."""
    scenario = load_scenario(ROOT / "scenarios" / f"{name}.yaml")
    return run_scenario(scenario, RunOptions(root=folder / "runs", build=ROOT / "build", report=False))


def write_tables(outcomes: Mapping[str, RunResult]) -> None:
    """Tables of single scenarios, and those that are made of several."""
    for name, outcome in outcomes.items():
        text = pivot(outcome.summary, PIVOTS[name]) if name in PIVOTS else table(outcome.summary)
        if not TABLES[name]:
            write_data(name, text)
        for page in TABLES[name]:
            write_table(page, name, published(text) if page == "README.md" else text)
    if "dynamic_regripping" in outcomes:
        write_data("regripping_late", regripping(outcomes["dynamic_regripping"].summary))
    if outcomes.keys() >= {"linear_grip", "rotational_grip", "rotation", "dynamic_regripping"}:
        write_table("docs/explanation/racs.md", "rig", rig(outcomes))


def draw_plots(outcome: RunResult, files: Mapping[str, str]) -> None:
    """Plots of a scenario by title, as in its report, with the first seed alone."""
    tables = {case: signals for case, signals in outcome.tables.items() if case[1] == outcome.scenario.seeds[0]}
    for plot in outcome.scenario.plots:
        if plot.title in files:
            (FIGURES / files[plot.title]).write_text(plotting.plot_svg(plot, tables))


def save(figure: Any, name: str) -> None:
    """Write a figure that is the same file for the same content."""
    figure.savefig(FIGURES / name, metadata={"Date": None, "Creator": None}, transparent=False)


# ------------------------------------------------------------------------------------------------- the force experiment

PLACES = {
    "heart": (0, -0.85),
    "tip": (0, 0.85),
    "estimate": (1.5, 0.85),
    "controller": (3.0, 0.85),
    "servomotor": (3.0, 0),
    "sheath": (1.5, 0),
    "wall": (0, 0),
    "sensor": (1.5, 1.6),
}
WIDTH, HEIGHT = 0.84, 0.42
LABELS = {
    ("heart", "wall"): "position",
    ("wall", "tip"): "bending",
    ("sheath", "tip"): "travel",
    ("tip", "estimate"): "curvature",
    ("estimate", "controller"): "estimated\nposition",
    ("controller", "servomotor"): "target velocity",
    ("servomotor", "sheath"): "gripper\nposition",
    ("sheath", "servomotor"): "reaction",
    ("sheath", "wall"): "tip\nposition",
    ("wall", "sheath"): "contact force",
    ("wall", "sensor"): "contact force",
    ("sensor", "controller"): "measured force",
    ("sensor", "estimate"): "contact?",
}


def draw_system(outcome: RunResult) -> None:
    """The members of the force experiment and their connections, as the scenario has them."""
    case = outcome.scenario.variants[0]
    links = {(one.source.partition(".")[0], one.target.partition(".")[0]) for one in case.connections}
    assert set(PLACES) == set(case.members)
    assert set(LABELS) == links
    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": "system"}):
        figure = Figure((8.4, 5.6), layout="constrained")
        axis = figure.subplots()
        axis.set(xlim=(-0.75, 3.75), ylim=(-1.21, 1.85), aspect="equal")
        axis.axis("off")
        for name, (x, y) in PLACES.items():
            color = "#d1495b" if name == "controller" else "#0b62a4"
            corner = (x - WIDTH / 2, y - HEIGHT / 2)
            axis.add_patch(
                FancyBboxPatch(corner, WIDTH, HEIGHT, boxstyle="round,pad=0,rounding_size=0.06", fc="white", ec=color)
            )
            note = {
                "controller": "one of three",
                "sheath": "play, friction, EA",
                "wall": "bending, silicone",
                "servomotor": "drive and rod",
                "heart": "7 harmonics",
                "tip": "its shape",
                "estimate": "fiber, tracking, UKF",
                "sensor": "200 Hz, noise",
            }[name]
            axis.text(x, y + 0.05, name, ha="center", va="center", weight="bold", color=color, fontsize=11)
            axis.text(x, y - 0.11, note, ha="center", va="center", color="#52606d", fontsize=8)
        for link in sorted(links):
            draw_arrow(axis, *link)
        save(figure, "system.svg")


def draw_arrow(axis: Any, source: str, target: str) -> None:
    """One connection with its label; two that go both ways lie side by side."""
    (x0, y0), (x1, y1) = PLACES[source], PLACES[target]
    style = {"arrowstyle": "-|>", "color": "#3e4c59", "shrinkA": 0, "shrinkB": 0, "linewidth": 1.0}
    text = {"fontsize": 8, "color": "#3e4c59", "ha": "center"}
    label = LABELS[source, target]
    if (source, target) == ("wall", "sensor"):
        corner = -0.6
        axis.plot([x0 - WIDTH / 2, corner, corner], [y0, y0, y1], color="#3e4c59", linewidth=1.0)
        axis.annotate("", (x1 - WIDTH / 2, y1), (corner, y1), arrowprops=style)
        axis.text(0.1, y1 + 0.05, label, **text)
    elif (source, target) == ("sensor", "controller"):
        axis.plot([x0 + WIDTH / 2, x1], [y0, y0], color="#3e4c59", linewidth=1.0)
        axis.annotate("", (x1, y1 + HEIGHT / 2), (x1, y0), arrowprops=style)
        axis.text((x0 + WIDTH / 2 + x1) / 2, y0 + 0.05, label, **text)
    elif x0 == x1:
        sign = 1 if y1 > y0 else -1
        axis.annotate("", (x1, y1 - sign * HEIGHT / 2), (x0, y0 + sign * HEIGHT / 2), arrowprops=style)
        axis.text(x0 + 0.04, (y0 + y1) / 2, label, **{**text, "ha": "left", "va": "center"})
    else:
        sign = 1 if x1 > x0 else -1
        shift = 0.0 if (target, source) not in LABELS else 0.09 * sign
        axis.annotate("", (x1 - sign * WIDTH / 2, y1 + shift), (x0 + sign * WIDTH / 2, y0 + shift), arrowprops=style)
        above = shift >= 0 and not (shift == 0 and y0 == 0)
        place = (y0 + y1) / 2 + shift + (0.05 if above else -0.05)
        axis.text((x0 + x1) / 2, place, label, va="bottom" if above else "top", **text)


# ------------------------------------------------------------------------------------------------ publication when due


class Ramp(Component):
    """Rises with time."""

    y = output("s", "time")

    def derivatives(self, t: float) -> None:
        """Publish the time."""
        self.y = t


class Slow(Component):
    """Passes its input on, every 4 ms."""

    period = 4e-3
    u = input("s", "what comes in")
    y = output("s", "what came in a period ago")

    def initialize(self) -> None:
        """Begin with the input."""
        self.y = self.u

    def step(self, t: float, h: float) -> None:  # noqa: ARG002 - the form of a component's functions
        """Pass the input on."""
        self.y = self.u


class Fast(Slow):
    """Passes its input on at every communication point."""

    period = None


CHAIN = """
stop_time: 16 ms
members: {ramp: {component: "figures:Ramp"}, slow: {component: "figures:Slow"}, fast: {component: "figures:Fast"}}
connections: [ramp.y -> slow.u, slow.y -> fast.u]
"""


def draw_publication(folder: Path) -> None:
    """What a slow member and a fast one behind it publish of a ramp."""
    outcome = run_scenario(
        parse_scenario(CHAIN), RunOptions(backend=Backend.interpreted, root=folder / "runs", build=ROOT / "build")
    )
    signals = outcome.tables["base", 0]
    time = 1e3 * signals.time
    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": "publication"}):
        figure = Figure((7.2, 3.3), layout="constrained")
        axis = figure.subplots()
        for number, (name, text) in enumerate(
            (("ramp.y", "ramp, 1 ms"), ("slow.y", "slow, 4 ms: the ramp of a period ago"), ("fast.y", "fast, 1 ms"))
        ):
            values = 1e3 * signals.values[name]
            style = {"color": plotting.COLORS[number], "label": text}
            axis.step(time, values, where="post", **style)
            axis.plot(time, values, "o", markersize=3.5, color=style["color"])
        axis.set(
            xlabel="time [ms]", ylabel="value [ms]", xlim=(0, 16), xticks=np.arange(0, 17, 4), yticks=range(0, 17, 4)
        )
        axis.legend(loc="upper left")
        save(figure, "publication.svg")


LATE = """
stop_time: 8 ms
members:
  ramp: {component: "figures:Ramp"}
  y1: {component: "figures:Fast"}
  y2: {component: "figures:Fast"}
  y3: {component: "figures:Fast"}
connections: [ramp.y -> y1.u, y1.y -> y2.u, y2.y -> y3.u]
variants: {jacobi: {}, gauss_seidel: {algorithm: gauss_seidel}}
"""


def draw_lateness(folder: Path) -> None:
    """What three members in a row, each of which passes its input on, publish of a ramp, with two algorithms."""
    outcome = run_scenario(
        parse_scenario(LATE), RunOptions(backend=Backend.interpreted, root=folder / "runs", build=ROOT / "build")
    )
    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": "lateness"}):
        figure = Figure((7.2, 2.9), layout="constrained")
        for axis, variant in zip(figure.subplots(1, 2, sharey=True), ("jacobi", "gauss_seidel"), strict=True):
            signals = outcome.tables[variant, 0]
            for number, name in enumerate(("ramp", "y1", "y2", "y3")):
                values = 1e3 * signals.values[f"{name}.y"]
                style = {"color": plotting.COLORS[number], "label": name, "linewidth": 3.2 - 0.8 * number}
                axis.step(1e3 * signals.time, values, where="post", **style)
            axis.set(title=variant, xlabel="time [ms]", xlim=(0, 8))
        axis.legend(loc="upper left")
        figure.axes[0].set_ylabel("value [ms]")
        save(figure, "lateness.svg")


def main(asked: Sequence[str]) -> None:
    """Draw and write everything, or write the tables of some scenarios."""
    FIGURES.mkdir(exist_ok=True)
    sys.modules["figures"] = sys.modules[__name__]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if asked:
            write_tables({scenario: run(scenario, folder) for scenario in asked})
            return
        outcomes = {scenario: run(scenario, folder) for scenario in TABLES}
        write_tables(outcomes)
        draw_system(outcomes["heart_wall_force"])
        draw_plots(outcomes["heart_wall_force"], {"Contact force": "force.svg"})
        draw_plots(run("heart_wall_replay", folder), {"sheath hysteresis: tip over gripper": "sheath.svg"})
        draw_plots(outcomes["hysteresis_identification"], {"Heart and tip": "tracking.svg"})
        draw_plots(run("hysteresis_followed", folder), {"Error of the tip while the friction changes": "followed.svg"})
        draw_plots(outcomes["dynamic_regripping"], {"Tracking error": "regripping.svg"})
        draw_plots(outcomes["smooth_regripping"], {"Tip speed relative to the command": "hand_over.svg"})
        draw_plots(outcomes["rig_on_wall"], {"Force during handovers": "rig_on_wall.svg"})
        draw_plots(outcomes["rotation"], {"Tip over frame": "rotation.svg"})
        draw_plots(outcomes["coordinate_feedforward"], {"Target and reached coordinates": "coordinates.svg"})
        draw_publication(folder)
        draw_lateness(folder)
    for file in sorted(FIGURES.iterdir()):
        sys.stdout.write(f"{file.relative_to(ROOT)}: {file.stat().st_size / 1000:.0f} kB\n")


if __name__ == "__main__":
    main(sys.argv[1:])
