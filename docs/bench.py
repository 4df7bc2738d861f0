"""Draw the figures of docs/explanation/bench.md and write its tables, from runs made now; takes some ten minutes.

python docs/bench.py
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from fmus.chain.model import Chain
from matplotlib.figure import Figure
from scipy.optimize import minimize_scalar
from tables import select, write_data, write_table

from fmus.bodies import anywhere, experiments
from fmus.bodies.rod import euler_load
from twin.run import RunOptions, RunResult, run_scenario
from twin.scenario import load_scenario
from twin.scene import read_environment

ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "docs" / "figures"
PAGE = ROOT / "docs" / "explanation" / "bench.md"
SHOWN = (
    "as declared",
    "friction 0",
    "friction 0.05",
    "friction 0.2",
    "EA 9.2 kN, ten times",
    "EA 460 N, half",
)  # of the plays
H = 1e-3

COUNTS = (10, 20, 40)
CASES: dict[str, Callable[..., float]] = {
    "cantilever, Euler-Bernoulli": experiments.cantilever,
    "cantilever, elastica, F L^2 = 2 EI": lambda *one: experiments.cantilever(*one, part=2.0),
    "clamped quarter circle": experiments.clamped_arc,
    "buckling load, one end free": experiments.column,
}
WRAPS = (90, 180, 270)

# scenario with the lumped model, with bodies; metrics that are compared
COMPARED = (
    ("heart_wall_replay", ("bench_force", "bench_wall"), ("force_error_std", "force_error_max")),
    (
        "hysteresis_identification",
        ("bench_hysteresis",),
        ("tracking_error_std", "tracking_error_max", "residual", "alpha_x", "alpha", "beta", "delta", "gamma"),
    ),
)
REGRIPPED = {"error_out": "10.9 mm over 500 mm, mean of speeds and directions", "error_back": "the same", "slip": ""}


def save(figure: Any, name: str) -> None:
    """Write a figure that is the same file for the same content."""
    with mpl.rc_context({"svg.hashsalt": name}):
        figure.savefig(FIGURES / name, metadata={"Date": None, "Creator": None}, transparent=False)


def percent(ratio: float) -> str:
    """The error of a ratio."""
    return f"{100 * (ratio - 1):+.1f} %"


def theory() -> str:
    """Errors against theory, over segments and substeps."""
    head = [f"{count} segments" for count in COUNTS] + ["20 segments, 0.125 ms", "20 segments, 0.5 ms"]
    rows = [f"| bodies over theory | {' | '.join(head)} |", "|---" * (len(head) + 1) + "|"]
    for name, measure in CASES.items():
        values = [measure(count) for count in COUNTS] + [measure(20, step) for step in (0.125e-3, 0.5e-3)]
        rows.append(f"| {name} | {' | '.join(map(percent, values))} |")
    return "\n".join(rows)


def belts() -> str:
    """The capstan over wrap, friction and segments."""
    head = [f"{angle} deg" for angle in WRAPS]
    rows = [f"| pull over e^(mu theta (1 - r / R)) | {' | '.join(head)} |", "|---" * (len(head) + 1) + "|"]
    for friction, count in ((0.15, 30), (0.15, 60), (0.3, 60)):
        values = [experiments.capstan(np.deg2rad(angle), friction, count) for angle in WRAPS]
        rows.append(f"| mu {friction}, {count} segments | {' | '.join(map(percent, values))} |")
    return "\n".join(rows)


def plays() -> str:
    """What the play depends on, one change at a time."""
    environment = read_environment("two_bends")
    rod = Chain().rod(environment)
    changes: dict[str, dict[str, Any]] = {
        "as declared": {},
        "friction 0": {"friction": 0.0},
        "friction 0.05": {"friction": 0.05},
        "friction 0.2": {"friction": 0.2},
        "EA 9.2 kN, ten times": {"axial_stiffness": 9200.0},
        "EA 460 N, half": {"axial_stiffness": 460.0},
        "EI of the shaft 1e-3 N m2": {"bending_stiffness": 1e-3},
        "EI of the shaft 3e-3 N m2": {"bending_stiffness": 3e-3},
        "40 segments": {"segments": 40},
        "120 segments": {"segments": 120},
    }
    found = {name: experiments.play(environment, replace(rod, **change)) for name, change in changes.items()}
    found["substep 0.125 ms"] = experiments.play(environment, rod, 0.125e-3)
    rows = ["| instrument | play |", "|---|---|"]
    return "\n".join([*rows, *(f"| {name} | {1e3 * play:.2f} mm |" for name, play in found.items())])


def buckling() -> None:
    """Force on the gripper while the free length buckles, for three curvatures at rest."""
    figure = Figure(figsize=(7.6, 3.2), layout="constrained")
    axes = figure.subplots()
    for curvature in (0.05, 0.1, 0.5):
        part = anywhere.component("free_gap")(segments=20, tip_length=0.0, curvature=curvature)
        part.start(0.0)
        path = 8e-3 * np.linspace(0.0, 1.0, 1600)
        push = []
        for i, place in enumerate(path):
            part.gripper_position = place
            part.advance(i * H, H)
            push.append(-float(part.reaction_force))
        axes.plot(1e3 * path, push, label=f"bodies, curved by {curvature} 1/m at rest")
    for factor in (0.5, 0.7):
        load = euler_load(2e-3, 70e-3, factor)
        axes.axhline(load, color="gray", ls="--", lw=0.8)
        axes.annotate(f"Euler, factor {factor}", (0.1, load + 0.2), color="gray", fontsize=8)
    axes.set(xlabel="gripper [mm]", ylabel="push [N]", ylim=(0, None))
    axes.legend(loc="lower right", fontsize=8)
    save(figure, "bench_buckling.svg")


def run(name: str, folder: Path) -> RunResult:
    """Run a scenario with its first seed and keep its results out of the way."""
    scenario = load_scenario(ROOT / "scenarios" / f"{name}.yaml", ("seeds=[1]",))
    return run_scenario(scenario, RunOptions(root=folder / "runs", build=ROOT / "build", report=False))


def compared(outcomes: dict[str, RunResult]) -> str:
    """The same metrics of the paper, the lumped model and the bodies."""
    rows = ["| metric | variant | paper | lumped | bodies |", "|---|---|---|---|---|"]
    for lumped, others, metrics in COMPARED:
        for name in metrics:
            one = outcomes[lumped].summary["metrics"][name]
            for variant, values in one["variants"].items():
                paper = "" if values["paper"] is None else f"{values['paper']:.3g} {one['unit']}".rstrip()
                for other in others:
                    found = outcomes[other].summary["metrics"][name]["variants"].get(variant)
                    if found:
                        where = ", on a wall of bodies" if other == "bench_wall" else ""
                        cells = " | ".join(f"{each['mean']:.3g} {one['unit']}".rstrip() for each in (values, found))
                        rows.append(f"| {one['description'] or name} | {variant}{where} | {paper} | {cells} |")
    regripping = outcomes["bench_regripping"].summary["metrics"]
    for name, paper in REGRIPPED.items():
        one = regripping[name]
        cells = " | ".join(f"{one['variants'][variant]['mean']:.3g} {one['unit']}" for variant in ("lumped", "bodies"))
        rows.append(f"| {one['description']} | regripping over 300 mm | {paper} | {cells} |")
    return "\n".join([*rows, *played(outcomes)])


def playing(gripper: np.ndarray[Any, Any], half: float) -> np.ndarray[Any, Any]:
    """What a play operator of this half width [m] makes of a gripper's way."""
    place, found = gripper[0], np.empty_like(gripper)
    for i, one in enumerate(gripper):
        place = min(max(place, one - half), one + half)
        found[i] = place
    return found


def fitted_play(outcome: RunResult) -> tuple[float, float, float]:
    """Width [m] and gain of the play that fits the chirp best, an offset aside, and the rms of what it leaves [m]."""
    signals = outcome.tables["chirp", 1].values
    gripper, tip = signals["servomotor.position"][::5], signals["sheath.tip_position"][::5]

    def left(half: float) -> tuple[float, np.ndarray[Any, Any]]:
        columns = np.column_stack((playing(gripper, half), np.ones(len(gripper))))
        constants = np.linalg.lstsq(columns, tip, rcond=None)[0]
        return float(np.std(tip - columns @ constants)), constants

    found = minimize_scalar(lambda half: left(half)[0], bounds=(0.0, 4e-3), method="bounded", options={"xatol": 1e-7})
    rms, constants = left(found.x)
    return 2.0 * float(found.x), float(constants[0]), rms


def played(outcomes: dict[str, RunResult]) -> list[str]:
    """Rows with the play that fits the chirp, of the lumped model and of the bodies."""
    both = [fitted_play(outcomes[name]) for name in ("hysteresis_identification", "bench_hysteresis")]
    rows = (
        ("width of the play that fits best", 1e3, " mm"),
        ("its gain", 1.0, ""),
        ("rms of what it leaves", 1e3, " mm"),
    )
    return [
        f"| {name} | chirp |  | {' | '.join(f'{scale * one[i]:.3g}{unit}' for one in both)} |"
        for i, (name, scale, unit) in enumerate(rows)
    ]


def loops(outcomes: dict[str, RunResult]) -> None:
    """Gripper and tip under the chirp at its beginning, and under compensation."""
    figure = Figure(figsize=(7.6, 3.4), layout="constrained")
    for axes, (first, last) in zip(figure.subplots(1, 2), ((2.0, 14.0), (70.0, 72.0)), strict=True):
        for label, name in (("lumped", "hysteresis_identification"), ("bodies", "bench_hysteresis")):
            signals = outcomes[name].tables["chirp", 1].values
            time = outcomes[name].tables["chirp", 1].time
            at = (time >= first) & (time <= last)
            axes.plot(1e3 * signals["servomotor.position"][at], 1e3 * signals["sheath.tip_position"][at], label=label)
        axes.set(xlabel="gripper [mm]", ylabel="tip [mm]", title=f"{first:g} to {last:g} s of the chirp")
        axes.legend(fontsize=8)
    save(figure, "bench_loops.svg")


def main() -> None:
    """Draw and write everything."""
    tables = {"theory": theory(), "belts": belts(), "plays": plays()}
    buckling()
    names = [name for lumped, others, _ in COMPARED for name in (lumped, *others)] + ["bench_regripping"]
    with tempfile.TemporaryDirectory() as folder:
        outcomes = {name: run(name, Path(folder)) for name in names}
        tables["compared"] = compared(outcomes)
        loops(outcomes)
    write_table(PAGE, "bench plays", select(tables["plays"], SHOWN))
    for name, text in tables.items():
        write_data(f"bench_{name}", text)


if __name__ == "__main__":
    main()
