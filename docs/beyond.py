"""Draw the figure of docs/explanation/beyond_paper.md, and write its result table.

python docs/beyond.py            from a run of scenarios/beyond_paper.yaml with twenty seeds made now, minutes long
python docs/beyond.py RUN        from the folder of an earlier one
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from figures import ROOT, save
from matplotlib.figure import Figure

import twin
from twin.results import plotting

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
SEEDS = range(2001, 2021)  # none of which chose a parameter
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


def main() -> None:
    """Draw and write everything."""
    with tempfile.TemporaryDirectory() as name:
        if len(sys.argv) > 1:
            run = twin.open_run(sys.argv[1])
        else:
            run = twin.load(ROOT / "scenarios" / "beyond_paper.yaml").run(
                seeds=list(SEEDS), report=False, out=Path(name)
            )
        draw(run)
        marks = re.compile(r"(<!-- results beyond_paper -->\n).*?(<!-- end -->)", re.DOTALL)
        text = table(run.summary["metrics"])
        PAGE.write_text(marks.sub(lambda match: match[1] + text + "\n" + match[2], PAGE.read_text()))


if __name__ == "__main__":
    main()
