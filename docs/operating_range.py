"""Write the table of docs/explanation/operating_range.md: the force error over rates, breath, stiffness, noise and sensor rate.

python docs/operating_range.py
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from figures import ROOT

from twin.run import run_scenario
from twin.scenario import Form, parse_scenario

PAGE = ROOT / "docs" / "explanation" / "operating_range.md"
SEEDS = (9001, 9002, 9003)  # used for nothing else
CONTROLLERS = ("PI", "PI+FF", "PI+FF+BW", "locked")
SCENARIO = """
extends: heart_wall_ten_minutes.yaml
stop_time: 72 s
members:
  heart: {parameters: {ectopic_share: 0}}
  sensor: {parameters: {zero_deviation: 0 mN, drift_maximum: 0 mN/min}}
variants:
  locked: {title: phase-locked, members: {controller: {component: phase_locked_control}, tip: null, estimate: null},
    connections: [{from: null, to: controller.heart_position}, {from: null, to: estimate.contact.force}]}
analyses: {windows: null}
metrics: {worst_window_std: null, estimate_error_std: null}
record: {every: 5 ms, variables: [wall.force, controller.setpoint, sensor.measured_force]}
expect: null
plots: []
"""
CONDITIONS = {
    "heart at 60 /min, breath at 15 /min": "",
    **{f"heart at {rate:.0f} /min": f"heart.rate={rate} /min" for rate in (48, 90, 120, 150)},
    **{f"breath at {rate:.0f} /min": f"heart.respiration_rate={rate} /min" for rate in (6, 9, 12, 18, 21, 24)},
    "half the stiffness": "wall.free_length=60.5 mm",
    "twice the stiffness": "wall.free_length=38.1 mm",
    "sensor noise 6 mN": "sensor.noise=6 mN",
    "sensor noise 12 mN": "sensor.noise=12 mN",
    "sensor 20 ms later": "sensor.latency=20 ms",
}


def errors(option: str, folder: Path) -> dict[str, list[tuple[float, float, float]]]:
    """Of each controller and seed: standard deviation, least and largest true force from 12 s on [mN]."""
    scenario = parse_scenario(SCENARIO, ROOT / "scenarios" / "operating range.yaml", [option] if option else [])
    outcome = run_scenario(scenario, Form.compiled, seeds=SEEDS, root=folder, build=ROOT / "build", report=False)
    found: dict[str, list[tuple[float, float, float]]] = {}
    for (variant, _), signals in outcome.tables.items():
        force = 1e3 * signals.values["wall.force"][signals.time >= 12.0]
        found.setdefault(variant, []).append((float(np.std(force)), float(force.min()), float(force.max())))
    return found


def cell(values: list[tuple[float, float, float]]) -> str:
    """`7.1 to 7.4`, and the range of the force where it leaves 0.1 to 0.4 N."""
    deviations = [one[0] for one in values]
    low, high = min(one[1] for one in values), max(one[2] for one in values)
    text = f"{min(deviations):.1f} to {max(deviations):.1f}"
    return text if low >= 100 and high <= 400 else f"{text} ({low:.0f} to {high:.0f})"


def table(found: dict[str, dict[str, Any]]) -> str:
    """A row for each condition; the best controller in bold."""
    rows = [f"| condition | {' | '.join(CONTROLLERS)} |", "|---" * (len(CONTROLLERS) + 1) + "|"]
    for condition, own in found.items():
        best = min(CONTROLLERS, key=lambda name: max(one[0] for one in own[name]))
        cells = [f"**{cell(own[name])}**" if name == best else cell(own[name]) for name in CONTROLLERS]
        rows.append(f"| {condition} | {' | '.join(cells)} |")
    return "\n".join(rows)


def main() -> None:
    """Run everything and write the table."""
    with tempfile.TemporaryDirectory() as name:
        found = {condition: errors(option, Path(name)) for condition, option in CONDITIONS.items()}
    marks = re.compile(r"(<!-- results operating_range -->\n).*?(<!-- end -->)", re.DOTALL)
    PAGE.write_text(marks.sub(lambda match: f"{match[1]}{table(found)}\n{match[2]}", PAGE.read_text()))


if __name__ == "__main__":
    main()
