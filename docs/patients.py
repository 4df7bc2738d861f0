"""Draw docs/figures/patients.svg and write docs/data/patients_*.csv, for docs/explanation/patients.md.

python docs/patients.py FOLDER   from the folder of a run of scenarios/studies/thousand_patients.yaml
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from figures import save
from matplotlib.figure import Figure
from pyarrow import parquet
from tables import write_data

from twin.results import plotting

SHOWN = ("force_error_std", "force_error_max", "force_min", "force_max")
STRONGEST = 3


def quantiles(told: dict[str, Any]) -> str:
    """Metrics in mN, a row for each variant."""
    rows = ["| metric [mN] | controller | 5 % | median | 95 % (interval) | worst |", "|---|---|---|---|---|---|"]
    for one in told["metrics"]:
        if one["metric"] not in SHOWN:
            continue
        low, middle, high = (1e3 * item["value"] for item in one["quantiles"])
        ends = [1e3 * one["quantiles"][2][end] for end in ("low", "high")]
        worst = one["least"][1] if one["metric"] == "force_min" else one["most"][1]
        rows.append(
            f"| {one['metric']} | {one['variant']} | {low:.1f} | {middle:.1f} | {high:.1f} ({ends[0]:.1f} to {ends[1]:.1f}) | "
            f"{1e3 * worst:.1f} |"
        )
    return "\n".join(rows)


def shares(told: dict[str, Any]) -> str:
    """How often what is expected holds."""
    rows = ["| expected | controller | holds in | 95 % interval (Wilson) |", "|---|---|---|---|"]
    for one in told["expectations"]:
        part, low, high = (100 * one[key] for key in ("part", "low", "high"))
        rows.append(
            f"| {one['name']} | {one['variant']} | {part:.1f} % of {one['count']} | {low:.1f} to {high:.1f} % |"
        )
    return "\n".join(rows)


def drivers(told: dict[str, Any]) -> str:
    """The strongest factors of the error's deviation."""
    rows = ["| controller | what drives the deviation of the force error: rank correlation |", "|---|---|"]
    for one in told["drivers"]:
        if one["metric"] == "force_error_std":
            named = [f"{item['factor']} {item['first']:+.2f}" for item in one["effects"][:STRONGEST]]
            rows.append(f"| {one['variant']} | {', '.join(named)} |")
    return "\n".join(rows)


def draw(folder: Path) -> None:
    """How often an error is larger than that, and which smallest and largest forces go together."""
    cases = parquet.read_table(folder / "cases.parquet").to_pandas()
    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": "patients"}):
        figure = Figure((8.4, 3.4), layout="constrained")
        left, right = figure.subplots(1, 2)
        for variant, color in zip(cases["variant"].unique(), plotting.COLORS, strict=False):
            own = cases[cases["variant"] == variant]
            errors = np.sort(1e3 * own["force_error_std"].dropna())
            left.step(
                errors, 100 * (1 - np.arange(len(errors)) / len(errors)), where="post", color=color, label=variant
            )
            few = own.iloc[:: max(1, len(own) // 100)]
            right.plot(1e3 * few["force_min"], 1e3 * few["force_max"], ".", color=color, markersize=3)
        left.set_yscale("log")
        left.set_xlabel("deviation of the force error [mN]")
        left.set_ylabel("patients with a larger one [%]")
        left.legend(frameon=False)
        right.axvspan(100, 400, ymax=1, color="#2a9d6f", alpha=0.08)
        right.axhline(400, color="#2a9d6f", linewidth=0.8)
        right.axvline(100, color="#2a9d6f", linewidth=0.8)
        right.set_xlabel("smallest force [mN]")
        right.set_ylabel("largest force [mN]")
        save(figure, "patients.svg")


def main() -> None:
    """All of it."""
    folder = Path(sys.argv[1])
    told = json.loads((folder / "answers.json").read_text())
    for name, table in (("quantiles", quantiles), ("shares", shares), ("drivers", drivers)):
        write_data(f"patients_{name}", table(told))
    draw(folder)


if __name__ == "__main__":
    main()
