"""A twin of the measured tendon robot: slack and friction followed from run to run, and errors of forecasts of the next second.

    python -m benchmarks.follow_tendon --data FOLDER              prints `name: value` lines

The recordings are those of `validation/tendon_robot.yaml`, which says where to get them. Each run is followed with the ensemble filter from
the frozen parameters; slack, friction (half width of the narrowest play) and what belongs to the rest begin at the last estimates of the run before. Every 250 ms the
angle or the tip one second later is forecast, with the displacement of the tendon as it will be; the same second is predicted by the frozen model
alone, and by the frozen model plus its error at the time of the forecast. The frozen parameters were fitted to these runs, which favors them.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from benchmarks.follow_rig import BUILD
from twin.errors import TwinError
from twin.follow import follow, in_band, load
from twin.validation.runner import load as load_validation
from twin.validation.runner import validate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.follow import FollowProblem
    from twin.validation.runner import Prediction

    Array = np.ndarray[Any, Any]

FILE = Path(__file__).parents[1] / "validation" / "tendon_robot.yaml"
MEMBER = "tendon_bending"
SIZE = 60  # of the ensemble


@dataclass(frozen=True)
class FollowedSet:
    """How the runs of a set are followed. `interval` [s]: between two measurements; `noise`: of each signal; `estimate`: variable -> keys."""

    interval: float
    noise: dict[str, float]
    estimate: dict[str, dict[str, float]]
    shown: tuple[str, float, str]  # quantity, factor from the variables' unit, unit


SETS = {
    "decaying": FollowedSet(
        0.05,
        {"bending_angle": 5e-3},
        {
            "slack": {"start": 2e-5, "deviation": 5e-5, "walk": 1e-5, "from": 0.0, "to": 2e-3},
            "half_width[1]": {"deviation": 3e-5, "walk": 1e-5, "from": 1e-5, "to": 6e-4},
            "rest_angle": {"deviation": 2e-2, "walk": 5e-3},
        },
        ("bending angle", np.degrees(1.0), "deg"),
    ),
}


def written(folder: Path, prediction: Prediction, own: FollowedSet, starts: dict[str, dict[str, float]]) -> FollowProblem:
    """Write a run and its follow file."""
    data, keys = prediction.data, prediction.set.keys
    time = data.time - data.time[0]
    rows = np.unique(np.searchsorted(time, np.arange(0.0, time[-1], own.interval)))
    signals = [output.signal for output in keys.outputs.values()]
    measured = data.measured[rows][:, [signals.index(signal) for signal in own.noise]]
    grid = np.arange(len(data.inputs[0])) * data.step
    for name, table, columns in (
        ("input", np.column_stack([grid, data.inputs[0]]), ["tendon [m]"]),
        ("output", np.column_stack([time[rows], measured]), list(own.noise)),
    ):
        np.savetxt(folder / f"{name}.csv", table, "%.9g", ",", header=",".join(["time [s]", *columns]), comments="")
    frozen = {name: float(value) for name, value in prediction_parameters(prediction).items()}
    text = {
        "component": MEMBER,
        "step": f"{data.step} s",
        "data": [{"file": "input.csv"}, {"file": "output.csv"}],
        "set": {f"{MEMBER}.{name}": value for name, value in {**keys.set, **frozen}.items()},
        "inputs": {"tendon [m]": f"{MEMBER}.tendon_displacement"},
        "outputs": {name: {"signal": f"{MEMBER}.{name}", "noise": noise} for name, noise in own.noise.items()},
        "estimate": {f"{MEMBER}.{name}": {**one, **starts.get(name, {})} for name, one in own.estimate.items()},
        "method": {"name": "ensemble", "size": SIZE, "seed": 0},
        "forecast": {
            "horizon": "1 s",
            "every": "250 ms",
            "interval": "1 s",
            "signals": [f"{MEMBER}.{name}" for name in own.noise],
            "planned": ["tendon [m]"],
            "draws": SIZE,
        },
    }
    (folder / "run.yaml").write_text(yaml.safe_dump(text))
    return load(folder / "run.yaml")


def prediction_parameters(prediction: Prediction) -> dict[str, float]:
    from twin.validation.frozen import read_frozen

    data = prediction.data
    return {**read_frozen(FILE)[prediction.set.name].values, **{k: v[0] for k, v in data.initial.items()}}


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--data", type=Path)
    arguments = parser.parse_args(argv)
    predictions = validate(load_validation(FILE, arguments.data, BUILD), ["tendon_robot/decaying/*.txt"])
    for name, own in SETS.items():
        starts: dict[str, dict[str, float]] = {}
        for prediction in [one for one in predictions if one.set.name == name]:
            with tempfile.TemporaryDirectory() as folder:
                problem = written(Path(folder), prediction, own, starts)
                estimates = list(follow(problem, BUILD))
            last = estimates[-1]
            data = prediction.data
            time = data.time - data.time[0]
            signals = [output.signal for output in prediction.set.keys.outputs.values()]
            columns = [signals.index(signal) for signal in own.noise]
            at = lambda table, when: np.array([np.interp(when, time, table[:, c]) for c in columns])
            errors = []
            inside = []
            for one in estimates:
                f = one.forecast
                if f is None or f.time[-1] > time[-1]:
                    continue
                true = at(data.measured, f.time[-1])
                frozen = at(prediction.predicted, f.time[-1])
                offset = at(data.measured - prediction.predicted, f.start)
                low, median, high = f.bands[:, -1]
                inside.append((low <= true) & (true <= high))
                errors.append([np.linalg.norm(median - true), np.linalg.norm(frozen - true), np.linalg.norm(frozen + offset - true), np.linalg.norm(at(data.measured, f.start)-true)])
            quantity, factor, unit = own.shown
            rms = factor * np.sqrt(np.mean(np.square(errors), axis=0))
            print(data.files[0], "followed, frozen, frozen+offset, hold", rms.round(4), unit, "inside", np.mean(inside).round(3), "nis", round(in_band(estimates), 3), len(errors))
            print("    ", {e.name: (float(v), float(d)) for e, v, d in zip(problem.estimates, last.values, last.deviations)}, flush=True)
            starts = {e.name.partition(".")[2]: {"start": float(v), "deviation": float(max(d, own.estimate[e.name.partition(".")[2]]["deviation"]))} for e, v, d in zip(problem.estimates, last.values, last.deviations)}


if __name__ == "__main__":
    main()
