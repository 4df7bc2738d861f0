"""Draw the figure of gains in docs/explanation/force_experiment.md and write its tables, from runs made now; takes ten minutes.

python docs/gain.py
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
from matplotlib.ticker import NullLocator
from tables import write_data

import twin
from twin.results import plotting

sys.path.insert(0, str(ROOT))
from benchmarks import margins as loop

PAPER = 0.150  # m/(s N)
COLORS = ("#0b62a4", "#7b5ea7", "#d1495b", "#2f855a", "#4a5568", "#9aa5b1", "#319795", "#b7791f")
NETWORK = {"sensor.latency": 10e-3}
SHORT = {"wall.free_length": 10e-3, "wall.surface_position": -1.3e-3}
SHORT_CORNER = {
    "wall.wall_modulus": 126e3,
    "sensor.latency": 5e-3,
    "sheath.drag": (7.2, 3.6, 3.6),
}  # a fifth more, and 5 ms
VARIANTS = {
    "the twin": loop.Plant(),
    "10 ms more: a PDO each way": loop.Plant(NETWORK),
    "sensor and controller every 25 ms": loop.Plant(period=25e-3),
    "bent tip, 30 deg, friction 0.1": loop.Plant(wall="tip_contact"),
    "silicone alone: 10 mm protrude": loop.Plant(SHORT, small=0.2e-3),
    "the same in its corner": loop.Plant(SHORT | SHORT_CORNER, small=0.2e-3),
}
GAINS = (0.15, 0.3, 0.6, 0.9, 1.25, 2.0, 3.0, 4.5, 6.0)  # m/(s N)
RATIOS = (0.0, 0.5, 1.0, 2.0)  # integral over proportional gain [1/s]
CONTROLLERS = ("PI", "PI+FF", "PI+FF+BW")
TIP_MASS, WALL_STIFFNESS, WALL_DAMPING = 1.1e-3, 260.0, 1.7  # as heart_wall.svg; 1 g and a quarter of the section's
LESSON = "11 s"  # when the estimator no longer learns from the tip, which a high gain would move
AT_WORK = (0.5, 1.5, 2.5, 3.5)  # Hz


def bent(frequencies: loop.Array) -> loop.Array:
    """What a mass at the tip, between the bent section and the silicone, does to the force: over that without a mass."""
    s, spring = 2j * np.pi * frequencies, 3 * 4.3e-4 / 48e-3**3
    silicone = WALL_STIFFNESS + WALL_DAMPING * s
    return (silicone + spring) / (TIP_MASS * s * s + silicone + spring)


def measured() -> dict[str, list[tuple[Any, Any]]]:
    """Responses of each variant; the stiff one only for small deviations, since the tip would leave the wall."""
    found = {
        name: loop.responses(plant) if plant.small == loop.SMALL else [loop.response(plant.sliding(), plant.small)]
        for name, plant in VARIANTS.items()
    }
    found["the twin, a tip of 1 g"] = [(f, one * bent(f)) for f, one in found["the twin"]]
    slow = found["sensor and controller every 25 ms"]
    found["every 25 ms, and 10 ms more"] = [(f, one * np.exp(-2j * np.pi * f * 10e-3)) for f, one in slow]
    return found


def variants(found: dict[str, list[tuple[Any, Any]]]) -> str:
    """Margins at the paper's gain, and the largest gain that keeps what is asked for."""
    rows = [
        "| loop | crossover at 150 mm/(s N) | gain margin there | phase margin there | largest gain, small deviations | largest gain, motions as the heart's |",
        "|---" * 6 + "|",
    ]
    for name, responses in found.items():
        period = 25e-3 if "25 ms" in name else 5e-3
        f, small = responses[0]
        one = loop.margins(f, PAPER * small)
        limits = [f"{1e3 * loop.allowed([each], period=period):.0f} mm/(s N)" for each in responses] + [""]
        gain = f"{one.gain:.0f} dB" if np.isfinite(one.gain) else "no -180 deg below 20 Hz"
        rows.append(f"| {name} | {one.crossover:.2f} Hz | {gain} | {one.phase:.0f} deg | {limits[0]} | {limits[1]} |")
    return "\n".join(rows)


def working() -> str:
    """The loop at work on a beating heart, beside the one of small deviations."""
    rows = ["| frequency | small deviations | PI | PI+FF | PI+FF+BW |", "|---" * 5 + "|"]
    names = ("pi_control", "pi_feedforward_control", "pi_bouc_wen_control")
    for frequency in AT_WORK:
        small = loop.harmonic(loop.Plant().sliding(), frequency, loop.SMALL)
        found = [small, *(loop.at_work(loop.Plant(), name, 1.0, frequency) for name in names)]
        cells = [f"{abs(one):.2f}, {np.degrees(np.angle(one)):.0f} deg" for one in found]
        rows.append(f"| {frequency} Hz | {' | '.join(cells)} |")
    return "\n".join(rows)


def scenario(cases: dict[str, tuple[str, float, dict[str, float]]]) -> str:
    """The force experiment with cases: controller, gain after the training time, and corner of the parameters."""
    components = {"PI": "pi_control", "PI+FF": "pi_feedforward_control", "PI+FF+BW": "pi_bouc_wen_control"}
    variants = {}
    for name, (control, gain, corner) in cases.items():
        members: dict[str, Any] = {"controller": {"component": components[control]}}
        for path, value in loop.Plant().changed(**corner).values.items():
            member, own = path.split(".", 1)
            plain = list(value) if isinstance(value, tuple) else value
            members.setdefault(member, {"parameters": {}})["parameters"][own] = plain
        variants[name] = {"members": members, "events": [{"at": LESSON, "set": {"controller.proportional": gain}}]}
    content = {
        "extends": str(ROOT / "scenarios" / "heart_wall_replay.yaml"),
        "variants": dict.fromkeys(CONTROLLERS) | variants,
        "metrics": {name: {"reference": None, "tolerance": None} for name in ("force_error_std", "force_error_max")},
        "expect": [],
        "plots": [],
    }
    return yaml.safe_dump(content, sort_keys=False)


def errors(
    folder: Path, cases: dict[str, tuple[str, float, dict[str, float]]], seeds: tuple[int, ...] = (1,)
) -> dict[str, float]:
    """Standard deviation of the force error of each case [N], mean of the seeds."""
    path = folder / "gains.yaml"
    path.write_text(scenario(cases))
    run = twin.load(path).run(list(cases), list(seeds), report=False, out=folder)
    found = run.summary["metrics"]["force_error_std"]["variants"]
    return {name: found[name]["mean"] for name in cases}


def curves(folder: Path) -> dict[str, list[float]]:
    """Errors over the gains."""
    cases = {f"{name} {gain}": (name, gain, {}) for name in CONTROLLERS for gain in GAINS}
    found = errors(folder, cases)
    return {name: [found[f"{name} {gain}"] for gain in GAINS] for name in CONTROLLERS}


def compared(folder: Path, over: dict[str, list[float]], limit: float) -> str:
    """Each controller at the paper's gain and at its best within the margins, on three seeds and in the worst corner."""
    rows = ["| controller | gain | mean of 3 seeds | worst of 16 corners | paper |", "|---" * 5 + "|"]
    printed = {"PI": 0.0362, "PI+FF": 0.0238, "PI+FF+BW": 0.0119}
    for name in CONTROLLERS:
        best = min((error, gain) for error, gain in zip(over[name], GAINS, strict=True) if gain <= limit)[1]
        for gain in dict.fromkeys((PAPER, best)):
            mean = errors(folder, {"nominal": (name, gain, {})}, (1, 2, 3))["nominal"]
            corners = errors(folder, {f"corner {i}": (name, gain, one) for i, one in enumerate(loop.CORNERS)})
            paper = f"{printed[name]:.4f} N" if gain == PAPER else ""
            rows.append(
                f"| {name} | {1e3 * gain:.0f} mm/(s N) | {mean:.4f} N | {max(corners.values()):.4f} N | {paper} |"
            )
    return "\n".join(rows)


def draw(found: dict[str, list[tuple[Any, Any]]], over: dict[str, list[float]], limit: float) -> None:
    """Margins over the gain, and what is left of the force error."""
    gains = np.geomspace(0.05, 8.0, 100)
    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": "gain"}):
        figure = Figure((9.6, 6.6), layout="constrained")
        (first, second), (third, fourth) = figure.subplots(2, 2)
        for (name, responses), color in zip(found.items(), COLORS, strict=False):
            for (f, response), dash in zip(responses, ("-", "--"), strict=False):
                each = [loop.margins(f, gain * response) for gain in gains]
                label = name if dash == "-" else None
                first.semilogx(1e3 * gains, [one.gain for one in each], dash, color=color, label=label)
                second.semilogx(1e3 * gains, [one.phase for one in each], dash, color=color)
        first.set(title="Gain margin", ylabel="dB", ylim=(-5, 45))
        first.axhline(loop.GAIN_MARGIN, color="k", lw=0.8, ls=":")
        second.set(title="Phase margin", ylabel="deg", ylim=(-20, 95))
        second.axhline(loop.PHASE_MARGIN, color="k", lw=0.8, ls=":")
        for name, color in zip(CONTROLLERS, ("#9aa5b1", "#b7791f", "#0b62a4"), strict=True):
            third.loglog(
                [1e3 * one for one in GAINS], [1e3 * one for one in over[name]], "o-", ms=3, color=color, label=name
            )
        third.axvspan(50, 1e3 * limit, color="#2f855a", alpha=0.08)
        third.set(title="Force error; green: margins hold in all corners", ylabel="standard deviation [mN]")
        third.set_yticks([8, 10, 15, 20, 30, 40], labels=["8", "10", "15", "20", "30", "40"])
        third.yaxis.set_minor_locator(NullLocator())
        third.legend(fontsize=7)
        for axes in (first, second, third):
            axes.axvline(1e3 * PAPER, color="#9aa5b1", lw=0.8)
            axes.set(xlabel="P [mm/(s N)]", xlim=(50, 8000))
        handles, labels = first.get_legend_handles_labels()
        fourth.axis("off")
        fourth.legend(
            handles,
            labels,
            loc="center left",
            fontsize=8,
            title="solid: small deviations\ndashed: motions as the heart's",
        )
        save(figure, "gain.svg")


def main() -> None:
    """Draw and write everything."""
    found = measured()
    corners = loop.corner_responses()
    limits = {ratio: loop.allowed(corners, ratio) for ratio in RATIOS}
    tables = {"loops": variants(found), "at_work": working()}
    told = (f"{1e3 * gain:.0f} mm/(s N)" if gain else "none" for gain in limits.values())
    tables["integral"] = "\n".join(
        ["| I / P | largest P in all corners |", "|---|---|"]
        + [f"| {ratio:g} 1/s | {one} |" for ratio, one in zip(limits, told, strict=True)]
    )
    with tempfile.TemporaryDirectory() as name:
        over = curves(Path(name))
        tables["compared"] = compared(Path(name), over, 1.001 * limits[0.0])
    draw(found, over, limits[0.0])
    for name, text in tables.items():
        write_data(f"gain_{name}", text)


if __name__ == "__main__":
    main()
