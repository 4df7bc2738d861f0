"""Calibrate and test the injection catheter on a plant that knows none of the paper's equations: tables of its page.

python docs/coordinates.py          ten minutes when nothing else runs

Each seed has its own bench: `tendon_catheter` takes the place of `pull_wire_catheter`. Its readings get the paper's fits
(`fmus.coordinate_feedforward.calibrate`), cold, in one session; the controller with these values goes to 26 other places
after half an hour of current. The 158 moves are made once, at 2375 steps/s, not at five speeds: of the plant, only
the creep of its guide knows of time.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from fmus.coordinate_feedforward import calibrate
from fmus.coordinate_feedforward.record import SOURCES, column
from fmus.coordinate_feedforward.statistics import ends
from tables import write_data, write_table

from twin.run import apply_analyses, build_simulation, noop, recorded_signals, resolve_catalogs, run_case
from twin.scenario import Backend, parse_scenario

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from twin.results import Signals
    from twin.scenario import Case, ScenarioSpec

    Values = NDArray[np.float64]
    Figures = dict[tuple[str, str], list[float]]  # (variant, metric) -> value in mm for each seed

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "explanation" / "injection_catheter.md"
BUILD = ROOT / "build"
SEEDS, SOME, FEW = 200, 25, 5  # without friction of the wire, with it, for each part that is changed
CATHETER = "tendon_catheter"
SESSION = {"linear": 0.0, "deflection": 1000.0, "coupling": 1100.0, "calibration": 0.0}  # motors' time with current [s]

FRICTIONLESS = {"friction_coefficient": 0.0}

# changed in the plant whose wire has no friction -> its parameters
PARTS: dict[str, dict[str, Any]] = {
    "nothing": {},
    "a fifth of the wire's friction, 0.02": {"friction_coefficient": 0.02},
    "half of it, 0.05": {"friction_coefficient": 0.05},
    "no creep of the guide": {"creep": 0.0},
    "friction at rest as in sliding": {"breakaway": 1.0},
    "friction and tilt the same everywhere": {"friction_deviation": 0.0, "tilt_deviation": 0.0},
    "no warmth": {"warm": 0.0},
    "a shaft that is not compressed": {"shaft_stiffness": 1e9},
}


def patched(name: str, patch: Mapping[str, Any]) -> ScenarioSpec:
    """A scenario with a patch over it."""
    return parse_scenario(json.dumps({"extends": f"{name}.yaml", **patch}), ROOT / "scenarios" / f"{name} patched.yaml")


def ran(case: Case, catalogs: Mapping[str, Any]) -> Signals:
    """All recorded signals of one case."""
    simulated = build_simulation(case, catalogs[case.variant], Backend.compiled, BUILD)
    try:
        run_case(case, simulated, noop)
        return recorded_signals(simulated, complete=True)
    finally:
        simulated.terminate()


def plant(parameters: Mapping[str, Any], powered: float) -> dict[str, Any]:
    """The catheter of a run."""
    return {"component": CATHETER, "parameters": {**parameters, "powered": f"{powered:g} s"}}


def readings(name: str, seed: int, parameters: Mapping[str, Any]) -> dict[str, dict[str, Values]]:
    """Table -> column -> readings at rest [mm], of the paper's experiments of one scenario."""
    sources = {variant: source for (scenario, variant), source in SOURCES.items() if scenario == name}
    own = {one: {"members": {"catheter": plant(parameters, SESSION[one])}} for one in sources}
    if "linear" in own:
        own["linear"] |= {"stop_time": "210 s"}
        own["linear"]["members"] |= {"program": {"parameters": {"repeats": 1}}}
    scenario = patched(name, {"members": {"catheter": plant(parameters, 0.0)}, "variants": own})
    catalogs = resolve_catalogs(scenario)
    tables = {}
    for case in scenario.cases(list(sources), [seed]):
        table, names = sources[case.variant]
        recorded = ran(case, catalogs)
        at = ends(recorded.values["program.number"])
        rows = [column(one, recorded.values[one][at], table) for one in names]
        tables[table] = dict(zip(calibrate.TABLES[table], rows, strict=True))
    return tables


def calibrated(seed: int, parameters: Mapping[str, Any], *, needle: bool) -> dict[str, Any]:
    """Parameters of the controller by the paper's fits, of one bench; with `needle` also those of eqs. (7) to (9)."""
    tables = readings("catheter_calibration", seed, parameters)
    if needle:
        tables |= readings("needle", seed, parameters)
    return calibrate.calibrate(tables)[0]


# ------------------------------------------------------------------------------------------------------------- the test

WARM = 1800.0  # time with current when the coordinates begin [s]
BIAS = 0.095e-3  # what Table 2 of the paper is too short by on average [m]
CONTROLLERS: dict[str, dict[str, Any]] = {
    "unmodified": {"mode": 0},
    "calibrated": {"mode": 1},
    "unmodified, released": {"mode": 0, "release": True},
    "calibrated, released": {"mode": 1, "release": True},
}
AS_PRINTED = ("unmodified", "calibrated")
METRICS = ("rms_z", "rms_y", "t_test_z", "t_test_y", "refused")
PAPER = {"unmodified": ("1.22 mm", "0.58 mm", "no", "no"), "calibrated": ("0.14 mm", "0.18 mm", "yes", "yes")}


def tested(
    seed: int, parameters: Mapping[str, Any], fitted: Mapping[str, Any], controllers: Iterable[str]
) -> dict[tuple[str, str], float]:
    """(controller, metric) -> value of one bench; lengths in mm. `table` is no controller but Table 2 of the needle."""
    own = {one: {"members": {"feedforward": {"parameters": {**fitted, **CONTROLLERS[one]}}}} for one in controllers}
    found = visited("coordinate_feedforward", own, METRICS, seed, parameters)
    if "needle" in fitted:
        seen = {"feedforward": {"parameters": dict(fitted)}, "camera": {"parameters": {"needle_bias": BIAS}}}
        found |= visited("needle", {"table": {"members": seen}}, ("table_mean", "table_std"), seed, parameters)
    return found


def visited(
    name: str, variants: Mapping[str, Any], metrics: Iterable[str], seed: int, parameters: Mapping[str, Any]
) -> dict[tuple[str, str], float]:
    """(variant, metric) -> value of a scenario with the plant in it."""
    scenario = patched(name, {"members": {"catheter": plant(parameters, WARM)}, "variants": variants})
    catalogs = resolve_catalogs(scenario)
    found = {}
    for case in scenario.cases(list(variants), [seed]):
        table = apply_analyses(scenario, case.variant, ran(case, catalogs))
        for metric in metrics:
            spec = scenario.metrics[metric]
            scale = 1e3 if spec.unit == "mm" else 1.0
            found[case.variant, metric] = scale * float(table.evaluate(spec.signal)[1][-1])
    return found


def figures(
    seeds: Iterable[int], parameters: Mapping[str, Any], controllers: Iterable[str], *, needle: bool = False
) -> Figures:
    """(controller, metric) -> value for each seed: every bench is calibrated, and then tested."""
    found: Figures = {}
    for seed in seeds:
        fitted = calibrated(seed, parameters, needle=needle)
        for key, value in tested(seed, parameters, fitted, controllers).items():
            found.setdefault(key, []).append(value)
    return found


def low_middle_high(values: list[float]) -> str:
    """Median, and in brackets the 5th and 95th percentile, of lengths in mm."""
    low, middle, high = np.percentile(values, (5, 50, 95))
    return f"{middle:.2f} ({low:.2f} to {high:.2f}) mm"


def part(values: list[float]) -> str:
    """How many of the seeds pass a t test, as the paper's runs do with p > 0.05."""
    return f"{100 * np.mean(np.array(values) > 0.05):.0f} %"


def table(groups: Mapping[str, Figures]) -> str:
    """Unmodified and calibrated beside the paper."""
    rows = ["| wire | control | RMS along | RMS across | t test passed along | across |", "|---|---|---|---|---|---|"]
    rows += [f"| paper | {name} | {' | '.join(cells)} |" for name, cells in PAPER.items()]
    for plant_name, found in groups.items():
        for name in dict.fromkeys(variant for variant, metric in found if metric == "rms_z"):
            lengths = [low_middle_high(found[name, one]) for one in ("rms_z", "rms_y")]
            passed = [part(found[name, one]) for one in ("t_test_z", "t_test_y")]
            rows.append(f"| {plant_name} | {name} | {' | '.join(lengths + passed)} |")
    return "\n".join(rows)


def needles(groups: Mapping[str, Figures]) -> str:
    """Table 2: wanted less measured length of the calibrated needle."""
    rows = ["| wire | mean | standard deviation |", "|---|---|---|", "| paper | 0.095 mm | 0.042 mm |"]
    for name, found in groups.items():
        if ("table", "table_mean") not in found:
            continue
        cells = [low_middle_high(found["table", one]) for one in ("table_mean", "table_std")]
        rows.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(rows)


def parts(groups: Mapping[str, Figures]) -> str:
    """What each part of the plant costs."""
    rows = ["| changed | unmodified along, across | calibrated along, across |", "|---|---|---|"]
    for name, found in groups.items():
        cells = [", ".join(f"{np.mean(found[one, axis]):.2f}" for axis in ("rms_z", "rms_y")) for one in AS_PRINTED]
        rows.append(f"| {name} | {' mm | '.join(cells)} mm |")
    return "\n".join(rows)


def main(seeds: int = SEEDS, some: int = SOME, few: int = FEW) -> None:
    """Measure, and write the tables into the page."""
    groups = {
        f"no friction, {seeds} seeds": figures(range(1, seeds + 1), FRICTIONLESS, AS_PRINTED),
        f"friction 0.1, {some} seeds": figures(range(1, some + 1), {}, CONTROLLERS, needle=True),
    }
    every = range(1, few + 1)
    write(groups, {name: figures(every, {**FRICTIONLESS, **one}, AS_PRINTED) for name, one in PARTS.items()})


def write(groups: Mapping[str, Figures], changed: Mapping[str, Figures]) -> None:
    """Write the tables into the page and to docs/data."""
    write_table(PAGE, "plant", table(groups))
    write_data("tendon_catheter_needle", needles(groups))
    write_data("tendon_catheter_parts", parts(changed))


if __name__ == "__main__":
    main(*(int(one) for one in sys.argv[1:]))
