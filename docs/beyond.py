"""Draw the figure of docs/explanation/beyond_paper.md, and write its result table.

python docs/beyond.py            from a run of scenarios/beyond_paper.yaml with twenty seeds made now, minutes long
python docs/beyond.py RUN        from the folder of an earlier one
python docs/beyond.py --rig      docs/data/rig_on_wall_rates.csv, from runs of scenarios/rig_on_wall.yaml
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from figures import ROOT, save
from matplotlib.figure import Figure
from tables import select, write_data, write_table

import twin
from twin.results import plotting
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, parse_scenario

PAGE = ROOT / "docs" / "explanation" / "beyond_paper.md"
COLUMNS = {  # metric -> heading, factor, digits
    "force_error_std": ("std [mN]", 1e3, 1),
    "force_error_max": ("max [mN]", 1e3, 0),
    "settling_time": ("settled [s]", 1.0, 1),
    "speed_mean": ("travel [mm/s]", 1.0, 0),
    "speed_max": ("peak speed [mm/s]", 1.0, 0),
    "current_rms": ("current, rms [A]", 1.0, 2),
    "current_max": ("peak current [A]", 1.0, 2),
}
RIG_VARIANTS = ("PI", "PI+FF", "PI+FF+BW", "locked")
RIG_RATES = [(rate, 15) for rate in (48, 60, 90, 120, 132, 150)] + [
    (rate, breath) for rate in (60, 120) for breath in (9, 21)
]
SHOWN = (
    "PI",
    "PI, gain 1500",
    "PI+FF",
    "PI+FF+BW",
    "locked",
    "locked, + + +",
    "ectopic",
    "respiration",
    "fibrillation",
    "observer",
)
HELD = 28.0, 88.0  # [s] in which the rig holds the force
SEEDS = range(8001, 8021)  # held out: none of which chose a parameter
NOTE = {"textcoords": "offset points", "color": "#2f855a", "fontsize": 8, "annotation_clip": False}
FIRST = {"force_error_std", "force_error_max"}  # with the worst seed


def table(metrics: dict[str, Any]) -> str:
    """Mean over the seeds, of the errors the worst seed too; one row for each variant."""
    rows = [f"| condition | {' | '.join(head for head, _, _ in COLUMNS.values())} |", "|---" * (len(COLUMNS) + 1) + "|"]
    for variant in metrics["force_error_std"]["variants"]:
        cells = []
        for name, (_, factor, digits) in COLUMNS.items():
            values = factor * np.array(list(metrics[name]["variants"][variant]["values"].values()))
            worst = f" (worst {values.max():.{digits}f})" if name in FIRST else ""
            cells.append(f"{values.mean():.{digits}f}{worst}")
        rows.append(f"| {variant} | {' | '.join(cells)} |")
    return "\n".join(rows)


def signal(run: Any, name: str, variant: str) -> tuple[np.ndarray, np.ndarray]:
    """Time [s] and values of the first seed."""
    data = run[name].sel(variant=variant, seed=run.seeds[0])
    return data.time.to_numpy(), data.to_numpy()


def draw(run: Any) -> None:
    """The force that the wall feels under three controllers, and while a beat comes early; what the gripper does for it."""
    rows = (("PI", "the paper's PI"), ("PI+FF+BW", "the paper's best, told the true heart"), ("locked", "phase-locked"))
    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": "beyond"}):
        figure = Figure((8.4, 7.6), layout="constrained")
        top, early, motion = figure.subplots(3, 1)
        for (variant, label), color in zip(rows, ("#9aa5b1", "#0b62a4", "#d1495b"), strict=True):
            time, force = signal(run, "wall.force", variant)
            top.plot(time, force, color=color, linewidth=0.9, label=label)
        top.set(title="Force on the heart wall: it searches for 5 s, then learns", xlim=(0, 20))
        time, force = signal(run, "wall.force", "ectopic")
        early.plot(time, force, color="#d1495b", linewidth=0.9)
        early.set(title="The same, every tenth beat comes early", xlim=(10, 30))
        for axis in (top, early):
            axis.axhspan(0.1, 0.4, color="#2f855a", alpha=0.08)
            axis.axhline(0.2, color="#2f855a", linewidth=0.8, linestyle=":")
            axis.annotate("wanted", (1.0, 0.2), xycoords=("axes fraction", "data"), xytext=(4, -3), **NOTE)
            axis.annotate("safe and in contact", (0.0, 0.1), xycoords=("axes fraction", "data"), xytext=(6, 4), **NOTE)
            axis.set(ylabel="force [N]", ylim=(0.08, 0.42))
        top.legend(ncols=3, loc="upper right")
        lines = (("heart.position", "heart"), ("sheath.tip_position", "tip"), ("servomotor.position", "gripper"))
        for (name, label), color in zip(lines, ("#2f855a", "#0b62a4", "#d1495b"), strict=True):
            time, place = signal(run, name, "locked")
            motion.plot(time, 1e3 * place, color=color, label=label)
        motion.set(title="At each turn the gripper leaps ahead, across friction and play", xlim=(20, 23))
        motion.set(xlabel="time [s]", ylabel="position [mm]")
        motion.legend(ncols=3, loc="upper right")
        save(figure, "beyond_paper.svg")


def rig_row(rate: int, breath: int) -> str:
    """Standard deviation and range of the true force [mN], and the share of the time in range, of each variant at one rate."""
    options = [
        f"heart.rate={rate} /min",
        f"heart.respiration_rate={breath} /min",
        "heart.respiration=3 mm",
    ]
    path = ROOT / "scenarios" / "rig_on_wall.yaml"
    scenario = parse_scenario(path.read_text(), path, options)
    with tempfile.TemporaryDirectory() as name:
        folders = {"root": Path(name), "build": ROOT / "build"}
        outcome = run_scenario(
            scenario, RunOptions(backend=Backend.compiled, variants=RIG_VARIANTS, report=False, **folders)
        )
    cells = []
    for variant in RIG_VARIANTS:
        signals = outcome.tables[variant, scenario.seeds[0]]
        force = 1e3 * signals.values["wall.force"][(signals.time >= HELD[0]) & (signals.time <= HELD[1])]
        share = 100 * np.mean((force >= 100) & (force <= 400))
        cells.append(f"{force.std():.1f}; {force.min():.0f} to {force.max():.0f}; {share:.1f} %")
    return f"| {rate} | {breath} | {' | '.join(cells)} |"


def write_rig() -> None:
    """Write the table of rates."""
    rows = [f"| heart [/min] | breath [/min] | {' | '.join(RIG_VARIANTS)} |", "|---" * (len(RIG_VARIANTS) + 2) + "|"]
    rows += [rig_row(rate, breath) for rate, breath in RIG_RATES]
    write_data("rig_on_wall_rates", "\n".join(rows))


def main() -> None:
    """Draw and write everything."""
    if sys.argv[1:] == ["--rig"]:
        write_rig()
        return
    with tempfile.TemporaryDirectory() as name:
        if len(sys.argv) > 1:
            run = twin.open_run(sys.argv[1])
        else:
            run = twin.load(ROOT / "scenarios" / "beyond_paper.yaml").run(
                seeds=list(SEEDS), report=False, out=Path(name)
            )
        draw(run)
        text = table(run.summary["metrics"])
        write_data("beyond_paper", text)
        write_table(PAGE, "beyond_paper", select(text, SHOWN, (0, 1, 2)))


if __name__ == "__main__":
    main()
