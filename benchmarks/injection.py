"""The 26 coordinates of the injection catheter over many seeds: the distribution of what the paper has one sample of.

    python -m benchmarks.injection           prints `name: value` lines: 200 seeds and three groups, ten minutes

Each seed has its own coordinates, slides and noise. Printed are mean and the 5th, 50th and 95th percentile over the
seeds, how much of the distribution lies below the paper's figure, and the part of the seeds with p > 0.05. The second
and third group change one thing: leads that differ from slide to slide by all of the printed 0.081 mm, and coordinates
from the whole workspace.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from twin.run import apply_analyses, build_simulation, noop, recorded_signals, resolve_catalogs, run_case
from twin.scenario import Backend, ScenarioSpec, load_scenario

if TYPE_CHECKING:
    from collections.abc import Iterable

BUILD = Path("build")
SCENARIO = Path("scenarios/coordinate_feedforward.yaml")
SEEDS = 200
GROUPS = {
    "seeds": (),
    "leads": tuple(f"{axis}.lead_deviation=0.081 mm" for axis in ("handle", "wire", "needle")),
    "workspace": ("program.z_maximum=20 mm",),
}


def figures(scenario: ScenarioSpec, seeds: Iterable[int]) -> dict[tuple[str, str], list[float]]:
    """(variant, metric) -> value in the metric's unit for each seed."""
    catalogs = resolve_catalogs(scenario)
    found: dict[tuple[str, str], list[float]] = {}
    for case in scenario.cases(seeds=list(seeds)):
        simulated = build_simulation(case, catalogs[case.variant], Backend.compiled, BUILD)
        try:
            run_case(case, simulated, noop)
            if simulated.failure:
                raise RuntimeError(f"{case.name}: {simulated.failure}")
            table = apply_analyses(scenario, case.variant, recorded_signals(simulated, complete=True))
        finally:
            simulated.terminate()
        for name, metric in scenario.metrics.items():
            values = table.evaluate(metric.signal)[1]
            factor = 1e3 if metric.unit == "mm" else 1.0
            found.setdefault((case.variant, name), []).append(float(values[-1]) * factor)
    return found


def measure(seeds: int = SEEDS, groups: Iterable[str] = tuple(GROUPS)) -> None:
    """Print the distributions."""
    for group in groups:
        scenario = load_scenario(SCENARIO, GROUPS[group])
        for (variant, name), values in figures(scenario, range(1, seeds + 1)).items():
            label = f"injection_{group}_{variant}_{name}"
            metric = scenario.metrics[name]
            print(f"{label}_mean: {np.mean(values):.4g}")
            print(f"{label}_percentiles: {', '.join(f'{one:.4g}' for one in np.percentile(values, (5, 50, 95)))}")
            if variant in metric.paper:
                paper = metric.paper[variant] * (1e3 if metric.unit == "mm" else 1.0)
                print(f"{label}_below_paper: {np.mean(np.array(values) < paper):.3f}")
            if "_test_" in name:
                print(f"{label}_above_0.05: {np.mean(np.array(values) > 0.05):.3f}")


if __name__ == "__main__":
    measure(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS)
