"""Write the result table of docs/explanation/hysteresis.md, and draw its figure, from a run made now.

python docs/hysteresis.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from figures import ROOT, run, save
from fmus.bouc_wen_compensator.identify import PAPER, Fit, correlation, identify, simulate
from fmus.bouc_wen_compensator.model import BoucWenCompensator
from fmus.hysteresis_models import constants
from fmus.prandtl_ishlinskii_compensator import identify as plays
from fmus.prandtl_ishlinskii_compensator.model import PrandtlIshlinskiiCompensator
from matplotlib.figure import Figure
from tables import span, write_data, write_table

from twin.results import plotting

if TYPE_CHECKING:
    from collections.abc import Mapping

PAGE = ROOT / "docs" / "explanation" / "hysteresis.md"
MOTIONS = ("chirp", "heart", "fast heart")

# shown -> suffix of the variant, metric of the model's error
ROWS = {
    "none": ("", None),
    "Prandtl-Ishlinskii": (" PI", "prandtl_ishlinskii_error"),
    "Bouc-Wen as printed": (" BW", "bouc_wen_error"),
    "Bouc-Wen with a lag": (" rate BW", "rate_bouc_wen_error"),
    "Bouc-Wen with a lag, fitted from the drive's target": (" rate BW+drive", "with_drive_error"),
}


def table(summary: Mapping[str, Any]) -> str:
    """One row for each model; errors in mm, least to largest of the seeds."""
    shown = ("the chirp", "heart, 1 Hz", "heart, 1.6 Hz")
    columns = [*(f"model: {one}" for one in shown), *(f"tracking: {one}" for one in shown), "largest: heart, 1 Hz"]
    rows = [f"| model | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]

    def value(metric: str, variant: str) -> str:
        return span(summary["metrics"][metric]["variants"][variant]["values"].values(), ".2f")

    for name, (suffix, error) in ROWS.items():
        cells = [value(error, motion) if error else "" for motion in MOTIONS]
        cells += [value("tracking_error_std", motion + suffix) for motion in MOTIONS]
        rows.append(f"| {name} | {' | '.join(cells)} | {value('tracking_error_max', 'heart' + suffix)} |")
    return "\n".join(rows)


def known(name: str, values: np.ndarray, covariance: np.ndarray) -> str:
    """Row of a parametrization: relative standard deviations, correlations, and how unlike its combinations are known."""
    relative = np.sqrt(np.diag(covariance)) / np.abs(values)
    scaled = np.sqrt(np.linalg.eigvalsh(covariance / np.outer(values, values)))
    between = np.abs(correlation(covariance)[2:, 2:][np.triu_indices(3, 1)]).max()
    cells = [
        *(f"{100.0 * one:.1f} %" for one in relative),
        f"{between:.2f}",
        f"{100.0 * scaled[-1]:.0f} %",
        f"{scaled[-1] / scaled[0]:.0f}",
    ]
    return f"| {name} | {' | '.join(cells)} |"


def identifiability(fits: Mapping[int, Fit]) -> str:
    """What the chirp tells of the constants and of the shape, for each seed of the tracker."""
    rows = [
        "| seed: as | alpha_x | alpha | beta, amplitude | delta, share | gamma | largest correlation of the last three | worst known combination | over the best known |",
        "|---" * 9 + "|",
    ]
    for seed, fit in fits.items():
        c = fit.constants
        printed = f"{seed}: beta {c.beta:.3f}, delta {c.delta:.3f}, gamma {c.gamma:.2f}"
        rows.append(known(printed, np.array(c), fit.covariance))
        shaped = f"{seed}: amplitude {fit.shape.amplitude:.2f} mm, share {fit.shape.share:.2f}, gamma {c.gamma:.2f}"
        rows.append(known(shaped, np.array((c.alpha_x, c.alpha, *fit.shape, c.gamma)), fit.shape_covariance))
    return "\n".join(rows)


def draw_loops() -> None:
    """The loop of each rate-independent model under a sine of 5 mm, from its second period on."""
    path = 5e-3 * np.sin(2.0 * np.pi * np.arange(0.0, 3.0, 1e-3))
    sum_of_plays = PrandtlIshlinskiiCompensator
    answers = {
        "Bouc-Wen, the paper's constants": simulate(PAPER, path),
        "Bouc-Wen, identified here": simulate(constants(BoucWenCompensator), path),
        "Prandtl-Ishlinskii": plays.simulate(sum_of_plays.weight.start, path, sum_of_plays.threshold.start),
    }
    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": "loops"}):
        figure = Figure((8.4, 3.2), layout="constrained")
        for axis, (name, tip) in zip(figure.subplots(1, 3), answers.items(), strict=True):
            axis.plot(1e3 * path[1000:], 1e3 * tip[1000:], color=plotting.COLORS[0], linewidth=1.2)
            axis.set(xlabel="gripper [mm]", title=name)
        figure.axes[0].set(ylabel="tip [mm]")
        save(figure, "hysteresis_loops.svg")


def main() -> None:
    """Draw and write everything."""
    with tempfile.TemporaryDirectory() as name:
        outcome = run("hysteresis_models", Path(name))
        chirps = run("hysteresis_identification", Path(name)).tables
    fits = {
        seed: identify(one.values["tracker.sampled_reference"][1:], one.values["tracker.measured_position"][1:])
        for (variant, seed), one in chirps.items()
        if variant == "chirp"
    }
    write_table(PAGE, "hysteresis_models", table(outcome.summary))
    write_data("hysteresis_identifiability", identifiability(fits))
    draw_loops()


if __name__ == "__main__":
    main()
