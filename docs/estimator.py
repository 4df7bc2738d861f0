"""Draw the figures of docs/explanation/heart_estimator.md, and write its result tables, from runs made now.

python docs/estimator.py            all
python docs/estimator.py rates      docs/data/heart_rates.csv alone: two minutes of each heart rate and seed
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import yaml
from figures import ROOT, draw_plots, run, save
from fmus.beat_search import candidate_rate
from fmus.heart.model import Heart
from fmus.heart_motion.model import SEARCHING, HeartMotion
from matplotlib.figure import Figure
from tables import select, span, write_data, write_table

from twin.results import plotting
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, parse_scenario

PAGE = ROOT / "docs" / "explanation" / "heart_estimator.md"
SAMPLE = 4e-3  # [s] of tip tracking
RATES = (0.8, 1.0, 1.3, 1.6, 2.0, 2.2, 2.3, 2.5, 2.8, 3.0, 3.3)  # [Hz] of hearts; the last two are beyond the search
RATE_SEEDS = range(61, 67)  # used for nothing else
LEARNED = 10.0  # [s]


def table(summary: Mapping[str, Any], names: tuple[str, ...]) -> str:
    """Metrics as columns, least to largest of the seeds; one row for each variant."""
    metrics = [summary["metrics"][name] for name in names]
    rows = [f"| variant | {' | '.join(one['description'] for one in metrics)} |", "|---" * (len(names) + 1) + "|"]
    for variant in metrics[0]["variants"]:
        values = [f"{span(one['variants'][variant]['values'].values(), '.2g')} {one['unit']}" for one in metrics]
        rows.append(f"| {variant} | {' | '.join(values)} |")
    return "\n".join(rows)


def searched(rate: float) -> tuple[list[float], list[float], float]:
    """Rates, the part of the motion that each leaves, and the one that was chosen, of a heart that breathes."""
    heart = Heart(rate=rate, respiration=3e-3, blend_in=0.0)
    part = HeartMotion()
    noise = np.random.default_rng(1)
    part.start(0.0)
    k = 0
    while part.mode == SEARCHING:
        heart.start(k * SAMPLE)
        part.tip_position[2] = heart.position + 0.5e-3 * noise.normal()
        part.advance(k * SAMPLE, SAMPLE)
        k += 1
    rates = [candidate_rate(part, i) for i in range(len(part.rests))]
    return rates, part.rests.tolist(), float(part.search_rate)


def draw_search() -> None:
    """What each rate leaves of a heart at 0.8, 1.2 and 2 Hz."""
    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": "search"}):
        figure = Figure((8.4, 3.0), layout="constrained")
        axis = figure.subplots()
        for rate, color in ((0.8, "#0b62a4"), (1.2, "#d1495b"), (2.0, "#2f855a")):
            rates, rests, found = searched(rate)
            axis.plot(rates, rests, color=color, label=f"heart at {rate} Hz, found {found:.2f} Hz")
            axis.axvline(found, color=color, linestyle=":", linewidth=0.8)
        axis.set(xlabel="rate [Hz]", ylabel="part of the motion that is left", ylim=(0, 1))
        axis.legend()
        save(figure, "heart_rate_search.svg")


def rates_table(folder: Path) -> str:
    """A row for each heart rate: parts of the time in which the filter's rate is off by a quarter or more, and its status."""
    variants = {f"{rate} Hz": {"members": {"heart": {"parameters": {"rate": f"{rate} Hz"}}}} for rate in RATES}
    content: dict[str, Any] = {
        "extends": "heart_motion.yaml",
        "stop_time": "120 s",
        "variants": variants,
        "metrics": None,
        "expect": None,
        "plots": [],
        "record": {"every": "20 ms", "variables": ["heart.position", "heart.pace", "estimator.*"]},
    }
    scenario = parse_scenario(yaml.safe_dump(content, sort_keys=False), ROOT / "scenarios" / "heart rates.yaml", [])
    options = RunOptions(
        backend=Backend.compiled,
        variants=list(variants),
        seeds=list(RATE_SEEDS),
        root=folder,
        build=ROOT / "build",
        report=False,
    )
    outcome = run_scenario(scenario, options)
    rows = [
        "| heart | rate wrong | rate wrong, status valid | in doubt | largest error while valid | largest error |",
        "|---" * 6 + "|",
    ]
    for rate in RATES:
        wrong, valid, off = [], [], []
        for seed in RATE_SEEDS:
            signals = outcome.tables[f"{rate} Hz", seed]
            late = signals.time >= LEARNED
            values = {name: column[late] for name, column in signals.values.items()}
            ratio = values["estimator.rate"] / (rate * values["heart.pace"])
            wrong.append((ratio < 0.8) | (ratio > 1.25))
            valid.append(values["estimator.status"] == 0)
            error = 1e3 * (values["estimator.position"] - values["heart.position"])
            off.append(np.abs(error - np.median(error)))
        wrongs, sure, errors = np.concatenate(wrong), np.concatenate(valid), np.concatenate(off)
        shares = [f"{100.0 * part.mean():.2f} %" for part in (wrongs, wrongs & sure, ~sure)]
        largest = f"{errors[sure].max():.1f} mm" if sure.any() else ""
        rows.append(f"| {rate} Hz | {' | '.join(shares)} | {largest} | {errors.max():.1f} mm |")
    return "\n".join(rows)


def main() -> None:
    """Draw and write everything, or the table of rates alone."""
    with tempfile.TemporaryDirectory() as name:
        write_data("heart_rates", rates_table(Path(name)))
    if sys.argv[1:] == ["rates"]:
        return
    with tempfile.TemporaryDirectory() as name:
        motion, force = run("heart_motion", Path(name)), run("heart_wall_ahead", Path(name))
    text = table(motion.summary, ("error_std", "error_range", "velocity_error_std"))
    write_data("heart_motion", text)
    write_table(PAGE, "heart_motion", select(text, ("paper", "usual", "fast", "ectopic", "losses", "in contact")))
    names = ("force_error_std", "force_error_max", "estimate_error_std", "estimate_velocity_error_std")
    write_data("heart_wall_ahead", table(force.summary, names))
    draw_plots(motion, {"Estimate and truth": "heart_motion.svg"})
    draw_plots(force, {"Heart and estimate": "heart_ahead.svg"})
    draw_search()


if __name__ == "__main__":
    main()
