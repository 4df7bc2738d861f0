"""Compare force controllers over conditions: the table and the figure of docs/explanation/operating_range.md.

python docs/operating_range.py                  run all controllers under all conditions, write and draw; a quarter of an hour when nothing else runs
python docs/operating_range.py map NAME ...     run these controllers, keep the others from docs/explanation/operating_range.csv
python docs/operating_range.py draw             write the table and draw from that file
python docs/operating_range.py true             run the conditions of beyond_paper, where the wall is told
python docs/operating_range.py tune NAME ...    40 trials over the controller's parameters, printed; some ten minutes each

Over 400 lines: conditions, rivals, tuning and drawing of one page, which share their tables.
"""

from __future__ import annotations

import csv
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import yaml
from figures import ROOT, save
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from tables import write_data

from twin.results import plotting
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, parse_scenario

PAGE = ROOT / "docs" / "explanation" / "operating_range.md"
DATA = PAGE.with_suffix(".csv")
SEEDS, TUNED = (9101, 9102, 9103), (10101, 10102, 10103)  # of the map, of the tuning; used for nothing else
SETTLED = 12.0  # [s] from which the force is judged
LEAST, MOST = 100.0, 400.0  # clinical range of the true force [mN]
TRIALS = 40
MOTOR = 15.0  # peak force of the motor that a bench allows [N]; each newton beyond costs as much as PENALTY [mN]
PENALTY = 5.0


@dataclass(frozen=True)
class Rival:
    """A controller of the comparison: values that differ from the declared ones, and parameters that are tuned, from and to."""

    component: str
    wall: bool = False
    values: dict[str, float] = field(default_factory=dict)
    knobs: dict[str, tuple[float, float]] = field(default_factory=dict)


GAIN = {"controller.proportional": (0.15, 1.5)}  # m/(s N): from the paper's to that of phase_locked_control
LEAD = {"controller.lead": (0.0, 0.03)}
RIVALS = {
    "PI, paper": Rival("pi_control"),
    "PI, best": Rival(
        "pi_control",
        values={"controller.proportional": 2.78, "controller.integral": 0.87},
        knobs={"controller.proportional": (0.15, 6.0), "controller.integral": (0.0, 1.0)},  # the gain of LQG
    ),
    "harmonics": Rival("adaptive_harmonic_control", knobs=GAIN | {"controller.learning": (0.05, 2.0)} | LEAD),
    "harmonics, slow": Rival(
        "adaptive_harmonic_control",  # tuned by hand with a sensor at 20 Hz, nine settings, seeds 10101 and 10102
        values={"controller.proportional": 0.5, "controller.learning": 0.2, "controller.lead": 50e-3},
    ),
    "repetitive": Rival(
        "repetitive_control",
        knobs=GAIN | {"controller.learning": (0.1, 1.0)} | LEAD | {"controller.width": (0.5, 5.0)},
    ),
    "LQG": Rival(
        "lqg_control",
        knobs={"controller.proportional": (0.15, 6.0), "controller.harmonic_process_noise": (0.05e-3, 3e-3)}
        | {"controller.level_process_noise": (0.1e-3, 6e-3)}
        | LEAD,
    ),
    "locked": Rival(
        "phase_locked_control",
        knobs=GAIN | {"controller.proportional_beyond": (0.0, 3.0)} | LEAD | {"controller.learning": (0.1, 1.0)},
    ),
    "PI+FF+BW": Rival("pi_bouc_wen_control", wall=True),
    "with preview": Rival(
        "pi_bouc_wen_control",
        wall=True,
        values={
            "controller.proportional": 0.44,
            "controller.slope_minimum": 0.35,
            "estimate.estimator.horizon": 15e-3,
        },
        knobs=GAIN | {"controller.slope_minimum": (0.1, 0.7), "estimate.estimator.horizon": (0.0, 0.05)},
    ),
    "preview MPC": Rival(
        "preview_control",
        wall=True,
        values={"estimate.estimator.horizon": 23e-3},
        knobs={"controller.correction": (0.05, 1.0), "controller.weight": (0.3, 300.0)}
        | {"estimate.estimator.horizon": (0.0, 0.065)},
    ),
    "locked, wall": Rival("phase_locked_control", wall=True),
}
CLASSES = {
    "force alone": [name for name, rival in RIVALS.items() if not rival.wall],
    "force and measured wall": [name for name, rival in RIVALS.items() if rival.wall],
}
CONDITIONS: dict[str, dict[str, float]] = {
    "nominal: heart 1 Hz, breath 0.25 Hz, 3 mN, 200 Hz": {},
    **{f"heart {rate} Hz": {"heart.rate": rate} for rate in (0.8, 1.5, 2.0, 2.5)},
    **{f"breath {rate} Hz": {"heart.respiration_rate": rate} for rate in (0.1, 0.15, 0.2, 0.3, 0.35, 0.4)},
    **{f"sensor noise {noise} mN": {"sensor.noise": 1e-3 * noise} for noise in (6, 12)},
    **{f"stiffness x {factor}": {"wall.bending_stiffness": 4.3e-4 * factor} for factor in (0.5, 1.5, 2.0)},
    **{f"sensor at {rate} Hz": {"sensor.period": 1.0 / rate} for rate in (50, 20)},
    **{f"sensor {late} ms later": {"sensor.latency": 1e-3 * late} for late in (10, 20)},
    "heart 2 Hz, breath 0.4 Hz, stiffness x 2": {
        "heart.rate": 2.0,
        "heart.respiration_rate": 0.4,
        "wall.bending_stiffness": 8.6e-4,
    },
    "heart 2 Hz, noise 12 mN, 10 ms later": {"heart.rate": 2.0, "sensor.noise": 12e-3, "sensor.latency": 10e-3},
    "breath 0.4 Hz, noise 12 mN, 20 ms later": {
        "heart.respiration_rate": 0.4,
        "sensor.noise": 12e-3,
        "sensor.latency": 20e-3,
    },
    "heart 0.8 Hz, breath 0.15 Hz, sensor at 20 Hz": {
        "heart.rate": 0.8,
        "heart.respiration_rate": 0.15,
        "sensor.period": 50e-3,
    },
}
TUNING: dict[str, dict[str, float]] = {
    "nominal": {},
    "heart 1.4 Hz, breath 0.33 Hz": {"heart.rate": 1.4, "heart.respiration_rate": 0.33},
    "stiffness x 1.4, noise 5 mN, 5 ms later": {
        "wall.bending_stiffness": 6.02e-4,
        "sensor.noise": 5e-3,
        "sensor.latency": 5e-3,
    },
}
SCENARIO = """
extends: heart_wall_ten_minutes.yaml
members:
  heart: {parameters: {ectopic_share: 0}}
  sensor: {parameters: {zero_deviation: 0 mN, drift_maximum: 0 mN/min}}
analyses: {windows: null}
metrics: {worst_window_std: null, estimate_error_std: null}
record: {every: 5 ms, variables: [wall.force, controller.setpoint, sensor.measured_force, servomotor.force]}
expect: null
plots: []
"""


TRUE_WALL = """
extends: beyond_paper.yaml
metrics: null
expect: null
plots: []
record: {every: 5 ms, variables: [wall.force, servomotor.force]}
"""
AHEAD: dict[str, tuple[Rival, float]] = {  # with the true wall: the rival, and how far it is told ahead [s]
    "PI+FF+BW, paper": (RIVALS["PI+FF+BW"], 0.0),
    "PI+FF+BW, 1250 mm/(s N)": (Rival("pi_bouc_wen_control", True, {"controller.proportional": 1.25}), 0.0),
    "the same, 25 ms of preview": (Rival("pi_bouc_wen_control", True, {"controller.proportional": 1.25}), 25e-3),
    "preview MPC, 25 ms and its horizon": (Rival("preview_control", True), 40e-3),
}


@dataclass(frozen=True)
class Result:
    """True force from `SETTLED` on [mN], and the motor's largest force [N]."""

    std: float
    least: float
    largest: float
    motor: float


def variant(rival: Rival, values: dict[str, float]) -> dict[str, Any]:
    """The rival under a condition, as a variant of the scenario."""
    members: dict[str, Any] = {"controller": {"component": rival.component}}
    if not rival.wall:
        members |= {"tip": None, "estimate": None}
    for path, value in values.items():
        member, own = path.split(".", 1)
        place = members.setdefault(member, {})
        if own != "period":
            place = place.setdefault("parameters", {})
        place[own] = f"{1e3 * value:g} ms" if own == "period" else value
    connections: list[Any] = []
    if not rival.wall:
        connections = [{"from": None, "to": name} for name in ("controller.heart_position", "estimate.contact.force")]
    elif rival.component == "phase_locked_control":
        connections = ["estimate.estimator.status -> controller.heart_status"]
    return {"members": members, "connections": connections}


def run(
    rival: Rival, conditions: dict[str, dict[str, float]], seeds: tuple[int, ...], length: float
) -> dict[str, list[Result]]:
    """Results of the rival under each condition, of all seeds."""
    variants = {name: variant(rival, rival.values | values) for name, values in conditions.items()}
    return run_variants(SCENARIO, variants, seeds, length)


def run_true_wall(seeds: tuple[int, ...]) -> dict[str, list[Result]]:
    """Results on the conditions of beyond_paper: no breath, the wall is not measured but told, early by a delay of the real one."""
    variants = {}
    for name, rival in RIVALS.items():
        if not rival.wall:
            variants[name] = {
                "members": {"controller": {"component": rival.component, "parameters": parameters(rival)}}
            }
    for name, (rival, preview) in AHEAD.items():
        members: dict[str, Any] = {"controller": {"component": rival.component, "parameters": parameters(rival)}}
        connections = ["heart.position -> controller.heart_position"]
        if preview > 0.0:
            members["delay"] = {"component": "heart_estimate", "parameters": {"latency": preview, "noise": 0.0}}
            connections += ["heart.position -> delay.position", "delay.estimated_position -> wall.heart_position"]
        variants[name] = {"members": members, "connections": connections}
    return run_variants(TRUE_WALL, variants, seeds, 30.0)


def parameters(rival: Rival) -> dict[str, float]:
    """Values of its controller."""
    return {
        path.removeprefix("controller."): value
        for path, value in rival.values.items()
        if path.startswith("controller.")
    }


def run_variants(base: str, variants: dict[str, Any], seeds: tuple[int, ...], length: float) -> dict[str, list[Result]]:
    """Run variants of a scenario; results of each, of all seeds."""
    content = yaml.safe_load(base)
    content["stop_time"] = f"{length} s"
    content["variants"] = variants
    scenario = parse_scenario(yaml.safe_dump(content, sort_keys=False), ROOT / "scenarios" / "operating range.yaml", [])
    found: dict[str, list[Result]] = {}
    with tempfile.TemporaryDirectory() as folder:
        outcome = run_scenario(
            scenario,
            RunOptions(
                backend=Backend.compiled,
                variants=list(variants),
                seeds=seeds,
                root=Path(folder),
                build=ROOT / "build",
                report=False,
            ),
        )
        for (name, _), signals in outcome.tables.items():
            late = signals.time >= SETTLED
            force = 1e3 * signals.values["wall.force"][late]
            motor = np.abs(signals.values["servomotor.force"][late]).max()
            result = Result(float(np.std(force)), float(force.min()), float(force.max()), float(motor))
            found.setdefault(name, []).append(result)
    if outcome.run.status != "completed":
        raise SystemExit(f"a run failed: {outcome.run.reason}")
    return found


def tune(name: str) -> None:
    """Search the rival's parameters by 40 trials of the same optimizer; print each better one, and the best."""
    import optuna

    rival = RIVALS[name]
    optuna.logging.set_verbosity(optuna.logging.WARNING)

    def cost(trial: optuna.Trial) -> float:
        values = {
            path: trial.suggest_float(path, low, high, log=low > 0.0) for path, (low, high) in rival.knobs.items()
        }
        found = run(Rival(rival.component, rival.wall, rival.values | values), TUNING, TUNED, 42.0)
        worst = [max(result.std for result in results) for results in found.values()]
        motor = max(result.motor for results in found.values() for result in results)
        total = float(np.mean(worst)) + PENALTY * max(motor - MOTOR, 0.0)
        print(f"{name} {trial.number}: {total:.2f} {np.round(worst, 2)} {motor:.1f} N {values}", flush=True)
        return total

    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1))
    study.optimize(cost, n_trials=TRIALS)
    print(f"{name}, best of {TRIALS}: {study.best_value:.2f} mN, {study.best_params}", flush=True)


def read() -> dict[str, dict[str, list[Result]]]:
    """Results of each controller under each condition, from the file."""
    found: dict[str, dict[str, list[Result]]] = {}
    with DATA.open(newline="") as file:
        for row in csv.DictReader(file):
            result = Result(*(float(row[name]) for name in ("std", "least", "largest", "motor")))
            found.setdefault(row["controller"], {}).setdefault(row["condition"], []).append(result)
    return found


def write(found: dict[str, dict[str, list[Result]]]) -> None:
    """Keep the results: forces in mN, the motor's in N."""
    with DATA.open("w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(("controller", "condition", "seed", "std", "least", "largest", "motor"))
        for name in RIVALS:
            for condition, results in found.get(name, {}).items():
                for seed, one in zip(SEEDS, results, strict=True):
                    values = (f"{value:.2f}" for value in (one.std, one.least, one.largest, one.motor))
                    rows.writerow((name, condition, seed, *values))


def worst(results: list[Result]) -> float:
    """Standard deviation of the worst seed [mN]."""
    return max(result.std for result in results)


def in_range(results: list[Result]) -> bool:
    """Whether the true force stays within the clinical range at every seed."""
    return all(result.least >= LEAST and result.largest <= MOST for result in results)


def cell(results: list[Result]) -> str:
    """`7.1 to 7.4`, and the range of the force where it leaves 0.1 to 0.4 N."""
    text = span(results)
    low, high = min(result.least for result in results), max(result.largest for result in results)
    return text if in_range(results) else f"{text} ({low:.0f} to {high:.0f})"


def table(found: dict[str, dict[str, list[Result]]], names: list[str]) -> str:
    """A row for each condition, the best in bold and named; then how often each is the best, and its worst motor force."""
    rows = [f"| condition | {' | '.join(names)} | best |", "|---" * (len(names) + 2) + "|"]
    best = {condition: min(names, key=lambda name: worst(found[name][condition])) for condition in CONDITIONS}
    for condition, winner in best.items():
        cells = [
            f"**{cell(found[name][condition])}**" if name == winner else cell(found[name][condition]) for name in names
        ]
        rows.append(f"| {condition} | {' | '.join(cells)} | {winner} |")
    wins = [sum(winner == name for winner in best.values()) for name in names]
    inside = [sum(in_range(results) for results in found[name].values()) for name in names]
    medians = [np.median([worst(results) for results in found[name].values()]) for name in names]
    motor = [max(result.motor for results in found[name].values() for result in results) for name in names]
    rows.append(f"| best in | {' | '.join(f'{n} rows' for n in wins)} | |")
    rows.append(f"| within 0.1 to 0.4 N in | {' | '.join(f'{n} rows' for n in inside)} | |")
    rows.append(f"| median of the rows | {' | '.join(f'{value:.1f}' for value in medians)} | |")
    rows.append(f"| largest force of the motor [N] | {' | '.join(f'{value:.1f}' for value in motor)} | |")
    return "\n".join(rows)


def true_wall_table(found: dict[str, list[Result]]) -> str:
    """A row for each controller."""
    head = "| controller | standard deviation [mN] | true force [mN] | largest force of the motor [N] |"
    rows = [head, "|---" * 4 + "|"]
    for name, own in found.items():
        low, high = min(result.least for result in own), max(result.largest for result in own)
        motor = max(result.motor for result in own)
        rows.append(f"| {name} | {span(own)} | {low:.0f} to {high:.0f} | {motor:.1f} |")
    return "\n".join(rows)


def span(results: list[Result]) -> str:
    """Least to largest standard deviation of the seeds [mN]."""
    return " to ".join(dict.fromkeys(f"{f(result.std for result in results):.1f}" for f in (min, max)))


def draw(found: dict[str, dict[str, list[Result]]]) -> None:
    """Conditions over controllers, a panel for each class of information; framed: the force leaves the clinical range."""
    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": "operating_range"}):
        figure = Figure((9.6, 8.0), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True, width_ratios=[len(names) for names in CLASSES.values()])
        for axes, names, title in zip(panels, CLASSES.values(), CLASSES, strict=True):
            values = np.array([[worst(found[name][condition]) for name in names] for condition in CONDITIONS])
            image = axes.imshow(values, norm=LogNorm(2.0, 100.0), cmap="YlOrRd", aspect="auto")
            for (row, column), value in np.ndenumerate(values):
                inside = in_range(found[names[column]][list(CONDITIONS)[row]])
                lead = value <= 1.001 * values[row].min()
                axes.text(
                    column,
                    row,
                    f"{value:.1f}" if value < 99.95 else f"{value:.0f}",
                    ha="center",
                    va="center",
                    fontsize=8,
                    color="white" if value > 40.0 else "black",
                    weight="bold" if lead else "normal",
                )
                if not inside:
                    axes.add_patch(Rectangle((column - 0.46, row - 0.44), 0.92, 0.88, fill=False, ec="#1a202c", lw=1.0))
            axes.set_title(title, fontsize=10)
            axes.set_xticks(range(len(names)), names, rotation=30, ha="left", fontsize=8)
            axes.xaxis.tick_top()
            axes.set_yticks(range(len(CONDITIONS)), list(CONDITIONS), fontsize=8)
            axes.tick_params(length=0)
            axes.grid(visible=False)
        bar = figure.colorbar(
            image, ax=panels, location="bottom", fraction=0.03, aspect=60, ticks=[2, 5, 10, 20, 50, 100]
        )
        bar.ax.set_xticklabels(["2", "5", "10", "20", "50", "100"])
        bar.set_label(
            "standard deviation of the true force, worst of three seeds [mN]; bold: best; framed: leaves 0.1 to 0.4 N",
            fontsize=8,
        )
        save(figure, "operating_range.svg")


def main(action: str = "", *names: str) -> None:
    """See the head of this file."""
    if action == "tune":
        for name in names:
            tune(name)
        return
    found = read() if action else {}
    if action not in ("draw", "true"):
        for name in names or RIVALS:
            found[name] = run(RIVALS[name], CONDITIONS, SEEDS, 72.0)
            write(found)
    found = read()  # rounded: what is written below does not depend on whether it was run now
    draw(found)
    for name, members in CLASSES.items():
        write_data(f"operating_range_{name.replace(' ', '_')}", table(found, members))
    if action in ("", "true"):
        write_data("operating_range_true_wall", true_wall_table(run_true_wall(SEEDS)))


if __name__ == "__main__":
    main(*sys.argv[1:])
