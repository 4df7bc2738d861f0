"""Write the tables of docs/explanation/operating_range_force.md and draw its figure, from runs made now.

python docs/force_range.py              all, ten minutes when nothing else runs
python docs/force_range.py range        that table alone: minutes, range, details
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import yaml
from figures import ROOT, save
from matplotlib.figure import Figure
from tables import select, write_data, write_table

from twin.results import plotting
from twin.run import RunOptions, RunResult, run_scenario
from twin.scenario import load_scenario

PAGE = ROOT / "docs" / "explanation" / "operating_range_force.md"
SCENARIO = ROOT / "scenarios" / "heart_wall_ten_minutes.yaml"
CONTROLLERS = {"PI": "pi_control", "PI+FF": "pi_feedforward_control", "PI+FF+BW": "pi_bouc_wen_control"}
LENGTH, SEEDS = "120 s", (1, 2, 3, 4, 5)
LEAST, MOST = 0.1, 0.4  # clinical range of the true force [N]
STEADY = {"heart.wander": 0, "heart.sinus_arrhythmia": 0, "heart.respiration": 0, "heart.ectopic_share": 0}

# label -> parameters that differ from the heart and the plant of ten minutes
CASES: dict[str, dict[str, Any]] = {
    "as over ten minutes": {},
    "the paper's heart: nothing wanders, no breath": STEADY,
    "heart rate 0.8 Hz": {"heart.rate": 0.8},
    "heart rate 1.3 Hz": {"heart.rate": 1.3},
    "heart rate 1.6 Hz": {"heart.rate": 1.6},
    "heart rate 2.0 Hz": {"heart.rate": 2.0},
    "heart rate 2.5 Hz": {"heart.rate": 2.5},
    "breath rate 0.1 Hz": {"heart.respiration_rate": 0.1},
    "breath rate 0.4 Hz": {"heart.respiration_rate": 0.4},
    "breath 5 mm": {"heart.respiration": 5e-3},
    "rate wanders by 10 %": {"heart.wander": 0.1},
    "one beat in ten comes early": {"heart.ectopic_share": 0.1},
    "every second beat comes early": {"heart.ectopic_share": 0, "heart.ectopic_every": 2},
    "beats differ by 20 %, as in fibrillation": {"heart.irregularity": 0.2},
    "the heart moves half as far": {"heart.scale": 0.5},
    "the heart moves 1.5 times as far": {"heart.scale": 1.5},
    "half the stiffness": {"wall.bending_stiffness": 2.15e-4},
    "twice the stiffness": {"wall.bending_stiffness": 8.6e-4},
    "friction 30 % less": {"sheath.friction": [0.42, 0.56, 0.56]},
    "friction 30 % more": {"sheath.friction": [0.78, 1.04, 1.04]},
    "half as much play again": {"sheath.play": [0, 0.45e-3, 0.45e-3]},
    "sensor noise 6 mN": {"sensor.noise": 6e-3},
    "zero off by 50 mN": {"sensor.zero_offset": -50e-3},
    "force 10 ms later": {"sensor.latency": 10e-3},
    "wall's normal taken 5 deg too steep": {"estimate.contact.normal": [0, 1, 1.192]},
    "wall's normal taken 10 deg too steep": {"estimate.contact.normal": [0, 1, 1.428]},
    "wall's normal taken 10 deg too flat": {"estimate.contact.normal": [0, 1, 0.700]},
    "a fifth of the fiber's samples lost": {"estimate.fiber.loss": 0.2},
    "2 Hz, one beat in ten early, twice the stiffness, 6 mN": {
        "heart.rate": 2.0,
        "heart.ectopic_share": 0.1,
        "wall.bending_stiffness": 8.6e-4,
        "sensor.noise": 6e-3,
    },
}


def case(controller: str, values: dict[str, Any]) -> dict[str, Any]:
    """A variant of the scenario."""
    members: dict[str, Any] = {"controller": {"component": CONTROLLERS[controller]}}
    for path, value in values.items():
        member, own = path.split(".", 1)
        members.setdefault(member, {}).setdefault("parameters", {})[own] = value
    return {"members": members}


def run(folder: Path, cases: dict[str, dict[str, Any]], length: str, seeds: tuple[int, ...]) -> RunResult:
    """Outcome of all cases with all controllers; variants are named `controller, label`."""
    variants = {f"{name}, {label}": case(name, values) for label, values in cases.items() for name in CONTROLLERS}
    content = {
        "extends": str(SCENARIO),
        "stop_time": length,
        "variants": dict.fromkeys(CONTROLLERS) | variants,
        "metrics": {
            "doubt": {"signal": "estimate.estimator.status", "reduce": "mean", "from": "12 s"},
            "measured_std": {"signal": "sensor.measured_force", "reduce": "std", "from": "12 s", "unit": "N"},
        }
        | {name: {"to": length} for name in ("force_error_std", "force_error_max", "force_error_mean")},
        "expect": [],
        "plots": [],
    }
    path = folder / "range.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return run_scenario(
        load_scenario(path, [f"seeds={list(seeds)}"]), RunOptions(root=folder, build=ROOT / "build", report=False)
    )


def values(outcome: RunResult, metric: str, variant: str) -> np.ndarray:
    """A metric of all seeds."""
    return np.array(list(outcome.summary["metrics"][metric]["variants"][variant]["values"].values()), float)


def span(found: np.ndarray, factor: float = 1e3, digits: int = 1) -> str:
    """Least to largest of the seeds."""
    return " to ".join(dict.fromkeys(f"{factor * value:.{digits}f}" for value in (found.min(), found.max())))


def in_range(outcome: RunResult, variant: str) -> str:
    """In how many runs the true force never left the clinical range."""
    least, most = values(outcome, "true_force_min", variant), values(outcome, "true_force_max", variant)
    return f"{np.sum((least >= LEAST) & (most <= MOST))} of {len(least)}"


def minutes(folder: Path) -> str:
    """Ten minutes with ten seeds."""
    outcome = run(folder, {"ten minutes": {}}, "600 s", tuple(range(1, 11)))
    rows = [
        "| controller | worst ten seconds, true force | all ten minutes, true | all, measured | true force | runs within 0.1 to 0.4 N | mean true force |",
        "|---" * 7 + "|",
    ]
    for name in CONTROLLERS:
        variant = f"{name}, ten minutes"
        whole, mean = [], []
        for seed in range(1, 11):
            force = outcome.tables[variant, seed].values["wall.force"]
            force = force[round(12.0 / 5e-3) :]
            whole.append(force.std())
            mean.append(force.mean())
        least, most = values(outcome, "true_force_min", variant), values(outcome, "true_force_max", variant)
        rows.append(
            f"| {name} | {span(values(outcome, 'worst_window_std', variant))} mN | {span(np.array(whole))} mN "
            f"| {span(values(outcome, 'measured_std', variant))} mN | {least.min():.3f} to {most.max():.3f} N "
            f"| {in_range(outcome, variant)} | {span(np.array(mean), 1.0, 3)} N |"
        )
    draw(outcome)
    return "\n".join(rows)


def draw(outcome: RunResult) -> None:
    """Standard deviation of the true force over the worst ten seconds of each twenty, ten seeds."""
    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": "force_range"}):
        figure = Figure((8.2, 3.4), layout="constrained")
        axes = figure.subplots()
        for k, name in enumerate(CONTROLLERS):
            for seed in range(1, 11):
                table = outcome.tables[f"{name}, ten minutes", seed]
                std = table.values["windows.force_std"][round(22.0 / 5e-3) :]
                worst = (
                    std[: len(std) // 2000 * 2000].reshape(-1, 2000).max(axis=1)
                )  # of the windows that end in ten seconds
                axes.plot(
                    22.0 + 10.0 * np.arange(1, len(worst) + 1),
                    1e3 * worst,
                    color=f"C{k}",
                    linewidth=0.7,
                    alpha=0.6,
                    label=name if seed == 1 else None,
                )
        axes.axhline(11.9, color="0.4", linestyle="--", linewidth=0.8, label="paper, PI+FF+BW, a periodic heart")
        axes.set(xlabel="end of the ten seconds [s]", ylabel="std of the true force [mN]", ylim=(0, None))
        axes.legend(ncols=2, fontsize="small")
        save(figure, "force_range.svg")


def ranges(folder: Path) -> str:
    """What an opponent would vary, one thing at a time."""
    outcome = run(folder, CASES, LENGTH, SEEDS)
    rows = [
        f"| {LENGTH}, {len(SEEDS)} seeds | PI | PI+FF | PI+FF+BW | true force with PI+FF+BW | within 0.1 to 0.4 N: PI, PI+FF, PI+FF+BW | in doubt |",
        "|---" * 7 + "|",
    ]
    for label in CASES:
        names = [f"{name}, {label}" for name in CONTROLLERS]
        stds = " | ".join(span(values(outcome, "worst_window_std", name)) for name in names)
        least, most = values(outcome, "true_force_min", names[2]), values(outcome, "true_force_max", names[2])
        kept = ", ".join(in_range(outcome, name).split()[0] for name in names)
        doubt = 100.0 * values(outcome, "doubt", names[2]).max()
        rows.append(f"| {label} | {stds} | {least.min():.3f} to {most.max():.3f} N | {kept} | {doubt:.0f} % |")
    return "\n".join(rows)


AWARE = {  # the age of samples is made up for
    "component": f"{ROOT / 'scenarios' / 'heart_motion.yaml'}#chain",
    "parameters": {
        "estimator.training_time": "10 s",
        "estimator.rate_process_noise": "0.002 Hz",
        "estimator.phase_process_noise": "0.01 rad",
    },
}

# what the paper leaves open of its own experiment: label -> members that differ
DETAILS: dict[str, dict[str, Any]] = {
    "as in `heart_wall_replay`: estimate of the sample's instant, 12 ms old; all at 200 Hz": {},
    "controller at 100 Hz": {"controller": {"period": "10 ms"}},
    "estimate advanced by the age of its samples": {"estimate": AWARE},
    "the same; controller and force sensor at 125 Hz": {
        "estimate": AWARE,
        "controller": {"period": "8 ms"},
        "sensor": {"period": "8 ms"},
    },
    "the same; controller and force sensor at 100 Hz": {
        "estimate": AWARE,
        "controller": {"period": "10 ms"},
        "sensor": {"period": "10 ms"},
    },
    "gratings 2.5 mm farther proximally": {"tip": {"parameters": {"segment_length[1]": "172.5 mm"}}},
    "gratings 5 mm farther proximally": {"tip": {"parameters": {"segment_length[1]": "175 mm"}}},
    "gratings 7.5 mm farther proximally": {"tip": {"parameters": {"segment_length[1]": "177.5 mm"}}},
    "registration with even weights, as the paper's": {
        "estimate": {"parameters": {"tracking.registered_length": "10 m"}},
    },
    "references of the gratings off by 10 pm, not 2": {"estimate": {"parameters": {"fiber.reference_error": "10 pm"}}},
    "the estimator learns for 7 s": {"estimate": {"parameters": {"estimator.training_time": "7 s"}}},
    "process noise of the filter as for a heart": {
        "estimate": {
            "parameters": {"estimator.rate_process_noise": "0.03 Hz", "estimator.phase_process_noise": "0.1 rad"}
        },
    },
}
PRINTED = {"PI": 0.0362, "PI+FF": 0.0238, "PI+FF+BW": 0.0119}  # paper, section V.B [N]


def details(folder: Path) -> str:
    """The paper's own method and window, read in the ways that its text allows."""
    variants = {
        f"{name}, {label}": {
            "members": {"controller": {"component": CONTROLLERS[name]}}
            | {
                member: ({"component": CONTROLLERS[name]} if member == "controller" else {}) | patch
                for member, patch in members.items()
            }
        }
        for label, members in DETAILS.items()
        for name in CONTROLLERS
    }
    content = {
        "extends": str(ROOT / "scenarios" / "heart_wall_replay.yaml"),
        "seeds": [1, 2, 3],
        "variants": dict.fromkeys(CONTROLLERS) | variants,
        "metrics": {name: {"reference": None, "tolerance": None} for name in ("force_error_std", "force_error_max")},
        "expect": [],
        "plots": [],
    }
    path = folder / "details.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    outcome = run_scenario(load_scenario(path), RunOptions(root=folder, build=ROOT / "build", report=False))
    rows = ["| interpretation | PI | PI+FF | PI+FF+BW |", "|---" * 4 + "|"]
    least, most = dict.fromkeys(CONTROLLERS, np.inf), dict.fromkeys(CONTROLLERS, 0.0)
    for label in DETAILS:
        cells = []
        for name in CONTROLLERS:
            ratio = values(outcome, "force_error_std", f"{name}, {label}") / PRINTED[name]
            least[name], most[name] = min(least[name], ratio.min()), max(most[name], ratio.max())
            cells.append(span(ratio, 1.0, 2))
        rows.append(f"| {label} | {' | '.join(cells)} |")
    whole = " | ".join(f"**{least[name]:.2f} to {most[name]:.2f}**" for name in CONTROLLERS)
    return "\n".join([*rows, f"| **all of them** | {whole} |"])


FILES = {"range": "force_range_conditions", "details": "force_readings"}  # complete tables, in docs/data
SHOWN: dict[str, tuple[tuple[str, ...], tuple[int, ...] | None]] = {  # rows and columns of the page's tables
    "details": (
        (
            "as in `heart_wall_replay`: estimate of the sample's instant, 12 ms old; all at 200 Hz",
            "controller at 100 Hz",
            "estimate advanced by the age of its samples",
            "the same; controller and force sensor at 100 Hz",
            "registration with even weights, as the paper's",
            "the estimator learns for 7 s",
            "**all of them**",
        ),
        None,
    ),
}
TABLES = {"minutes": minutes, "range": ranges, "details": details}


def main(asked: list[str]) -> None:
    """Tables that were asked for, or all."""
    with tempfile.TemporaryDirectory() as folder:
        for name in asked or TABLES:
            text = TABLES[name](Path(folder))
            if name in FILES:
                write_data(FILES[name], text)
            if name != "range":
                write_table(PAGE, name, select(text, *SHOWN[name]) if name in SHOWN else text)
            print(text)


if __name__ == "__main__":
    main(sys.argv[1:])
