"""Draw the figures of docs/explanation/sensing.md, and write its result tables, from runs made now.

python docs/sensing.py                 all
python docs/sensing.py fiber_shape     the tables of these scenarios alone
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from figures import ROOT, draw_plots, run, save
from fmus.fiber.model import Fiber
from fmus.fiber_shape.model import FiberShape
from fmus.guided_tip.model import GuidedTip
from matplotlib.figure import Figure
from tables import pivot, write_data, write_table

from twin.results import plotting
from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario

if TYPE_CHECKING:
    from collections.abc import Sequence

PAGE = ROOT / "docs" / "explanation" / "sensing.md"
PUBLISHED = (0.35, 1.15)  # mean error over 38 cm of Jackle et al., for shapes of different complexity [mm]
FIBERS = 40
SEEDS = 20  # of a place of the gratings, and of a place of the tip in the vessel
PLACES = range(10)  # of the gratings along the path [mm]

TABLES = {
    "fiber_shape": ("error_mean", "error_max", "residual", "status"),
    "tip_tracking": ("error_mean", "error_std", "error_max", "error_rms", "status"),
    "travel_distance": ("difference", "hall_error", "shift_error", "fused_error", "hall_rms", "shift_rms", "fused_rms"),
}
PATHS: dict[str, dict[str, Any]] = {
    "plane": {"segment_length": (0.203, 0.0785, 0.0785, 1.0, 1.0, 1.0)},
    "3-D": {
        "segment_length": (0.203, 0.0785, 0.0785, 1.0, 1.0, 1.0),
        "segment_angle": (0.0, 0.0, np.radians(110.0), 0.0, 0.0, 0.0),
    },
    "arch": {
        "segment_length": (0.1, 0.1, 0.125, 1.0, 1.0, 1.0),
        "segment_curvature": (0.0, 5.0, 25.0, 0.0, 0.0, 0.0),
        "segment_angle": (0.0, np.radians(70.0), 0.0, 0.0, 0.0, 0.0),
    },
}


def distances(path: dict[str, Any], fiber: dict[str, Any], sampled: dict[str, Any], seed: int) -> Any:
    """Distance of the reconstructed curve from the true one at each node [mm], for one fiber."""
    tip = GuidedTip(**path, **sampled)
    tip.start()
    sensed = Fiber(seed=seed, **fiber, **sampled)
    sensed.curvature[:] = tip.curvature
    sensed.start()
    shape = FiberShape(wavelength=sensed.wavelength, grating_count=sensed.grating_count, **sampled)
    shape.start()
    nodes = int(tip.count) + 1
    return 1e3 * np.linalg.norm(shape.shape[:nodes] - tip.shape[:nodes], axis=1)


def fibers(path: str, fiber: dict[str, Any] | None = None, sampled: dict[str, Any] | None = None) -> Any:
    """The same for many fibers, one row each; their gratings lie at all places of a pitch along the path."""
    sampled = sampled or {"pitch": 10e-3}
    first, *rest = PATHS[path]["segment_length"]
    found = []
    for seed in range(FIBERS):
        lengths = first - sampled["pitch"] * seed / FIBERS, *rest
        found.append(distances({**PATHS[path], "segment_length": lengths}, fiber or {}, sampled, seed))
    return np.array(found)


def draw_along(axis: Any) -> None:
    """Error along the fiber, mean of all fibers and where four of five are."""
    for number, path in enumerate(PATHS):
        found = fibers(path)
        s = np.linspace(0.0, 380.0, found.shape[1])
        color = plotting.COLORS[number]
        axis.plot(s, found.mean(axis=0), color=color, label=f"{path}: mean {found[:, 1:].mean():.2f} mm")
        axis.fill_between(s, *np.quantile(found, (0.1, 0.9), axis=0), color=color, alpha=0.15, linewidth=0)
    axis.axhspan(*PUBLISHED, color="0.85", zorder=0, label="published means")
    axis.set(xlabel="distance from the base [mm]", ylabel="error [mm]", xlim=(0, 380), ylim=(0, None))
    axis.legend(loc="upper left")


def draw_growth(axis: Any, label: str, values: list[float], cases: list[tuple[Any, Any]]) -> None:
    """Mean error over something that is made worse."""
    for number, path in enumerate(PATHS):
        means = [fibers(path, fiber, sampled)[:, 1:].mean() for fiber, sampled in cases]
        axis.plot(values, means, "o-", color=plotting.COLORS[number], markersize=3.5, label=path)
    axis.axhspan(*PUBLISHED, color="0.85", zorder=0)
    axis.set(xlabel=label, ylim=(0, None), xlim=(0, None))


def draw_shape() -> None:
    """Error of the shape along the fiber, and how it grows."""
    pitches = [10.0, 12.5, 20.0, 31.67, 40.0]
    counts = [38, 30, 19, 12, 9]
    angles = [0.0, 1.0, 2.0, 3.0, 5.0]
    offsets = [0.0, 1.0, 2.0, 5.0, 10.0]
    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": "shape"}):
        figure = Figure((9.0, 6.4), layout="constrained")
        grid = figure.add_gridspec(2, 3, height_ratios=(1.3, 1.0))
        draw_along(figure.add_subplot(grid[0, :]))
        panels = [figure.add_subplot(grid[1, k]) for k in range(3)]
        sampled = [{"pitch": 1e-3 * pitch, "count": count} for pitch, count in zip(pitches, counts, strict=True)]
        draw_growth(panels[0], "distance of gratings [mm]", pitches, [(None, one) for one in sampled])
        turned = [({"angle_error": np.radians(angle)}, None) for angle in angles]
        draw_growth(panels[1], "error of the cores' angles [deg]", angles, turned)
        moved = [({"reference_error": 1e-12 * offset}, None) for offset in offsets]
        draw_growth(panels[2], "error of the references [pm]", offsets, moved)
        panels[0].set_ylabel("mean error [mm]")
        panels[0].legend(loc="upper left")
        save(figure, "fiber_shape.svg")


def many(
    scenario: str, variants: tuple[str, ...], metrics: tuple[str, ...], folder: Path, *options: str
) -> dict[str, Any]:
    """Values of metrics over many seeds, in their units, by variant and metric."""
    path = ROOT / "scenarios" / f"{scenario}.yaml"
    loaded = load_scenario(path, [f"seeds={list(range(1, SEEDS + 1))}", *options])
    outcome = run_scenario(
        loaded, RunOptions(variants=list(variants), root=folder / "many", build=ROOT / "build", report=False)
    )
    table = outcome.summary["metrics"]
    return {
        variant: {one: np.array(list(table[one]["variants"][variant]["values"].values())) for one in metrics}
        for variant in variants
    }


def places(folder: Path) -> str:
    """Fiber minus EM tracker over places of the gratings, with and without what is learned of the interpolation."""
    metrics = ("error_mean", "error_std", "error_max")
    rows = [
        "| gratings | mean of fiber minus EM, over 20 seeds | spread | largest | mean, not learned | spread | largest |",
        "|---|---|---|---|---|---|---|",
    ]
    means: dict[str, list[Any]] = {"heart": [], "not learned": []}
    for place in PLACES:
        moved = f"guided_tip.segment_length[1]={203 + place} mm"
        found = many("tip_tracking", ("heart", "not learned"), metrics, folder, moved)
        cells = []
        for variant, own in found.items():
            mean, spread, largest = (own[one] for one in metrics)
            means[variant].append(mean)
            cells.append(f"{mean.mean():.2f} +- {mean.std():.2f} mm | {spread.mean():.2f} mm | {largest.max():.2f} mm")
        rows.append(f"| {place} mm | {' | '.join(cells)} |")
    both = [f"{np.mean(one):.2f} mm; rms {np.sqrt(np.mean(np.square(one))):.2f} mm | | " for one in means.values()]
    return "\n".join([*rows, f"| all | {'| '.join(both)}|"])


def fused(folder: Path) -> str:
    """Fusion of gripper and fiber over many seeds, by where the tip is."""
    names = ("hall", "shift", "fused")
    metrics = tuple(f"{name}_{kind}" for kind in ("rms", "error") for name in names)
    variants = ("abdomen", "diaphragm", "thorax", "arch")
    rows = [
        (
            "| tip | rms by Hall sensors | by shift | by both "
            "| runs in which the combination beats each measure alone | the same, at one instant |"
        ),
        "|---|---|---|---|---|---|",
    ]
    for variant, own in many("travel_distance", variants, metrics, folder).items():
        rms, once = ([own[f"{name}_{kind}"] for name in names] for kind in ("rms", "error"))
        better = [int(np.sum(one[2] < np.minimum(one[0], one[1]))) for one in (rms, once)]
        values = " | ".join(f"{one.mean():.2f} mm" for one in rms)
        rows.append(f"| {variant} | {values} | {better[0]} of {SEEDS} | {better[1]} of {SEEDS} |")
    return "\n".join(rows)


def main(asked: Sequence[str]) -> None:
    """Draw and write everything, or write the tables of some scenarios."""
    with tempfile.TemporaryDirectory() as name:
        outcomes = {scenario: run(scenario, Path(name)) for scenario in asked or TABLES}
        for scenario, outcome in outcomes.items():
            write_data(scenario, shown(outcome.summary, TABLES[scenario]))
        if asked:
            return
        write_data("tip_places", places(Path(name)))
        write_table(PAGE, "travel_fused", fused(Path(name)))
    draw_shape()
    draw_plots(outcomes["tip_tracking"], {"Tip motion by fiber and by EM tracker": "tip_tracking.svg"})


def shown(summary: Any, metrics: tuple[str, ...]) -> str:
    """Metrics as columns, for those variants that have all of them."""
    variants = set.intersection(*(set(summary["metrics"][name]["variants"]) for name in metrics))
    kept = {
        name: {
            **summary["metrics"][name],
            "variants": {
                variant: one for variant, one in summary["metrics"][name]["variants"].items() if variant in variants
            },
        }
        for name in metrics
    }
    return pivot({"metrics": kept}, metrics)


if __name__ == "__main__":
    main(sys.argv[1:])
