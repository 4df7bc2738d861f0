"""A twin of the measured tendon robot: slack and friction followed from run to run, and errors of forecasts of the next second.

    python -m benchmarks.follow_tendon --data FOLDER [--seeds N]  prints `name: least, largest` over runs and seeds

The recordings are those of `validation/tendon_robot.yaml`, which says where to get them: decaying sines with a measured bending angle, and sines
of another day with a measured tip. Each run is followed with the ensemble filter from the frozen parameters; slack, friction (half
width of the narrowest play) and rest angle begin at the last estimates of the run before. Several times in a second the angle or the tip one
second later is forecast, with the displacement of the tendon as it will be. The same second is predicted by the frozen model alone, by the
frozen model plus its present error, and by the present value. The frozen parameters were fitted to these runs, which favors them, and the
noises and walks were chosen while looking at these runs. `slackened` are the decaying sines with a tendon that was slackened by 0.6 mm
before the third run: from then on its displacements are larger by that, except at rest.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from benchmarks.follow_rig import BUILD
from twin.errors import TwinError
from twin.follow import follow, in_band, load
from twin.validation import load as load_validation
from twin.validation import read_frozen, validate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.follow import Estimate
    from twin.validation import Prediction

    Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class FollowedSet:
    """How the runs of a set are followed, in SI. `interval` [s]: between measurements; `anew`: estimates that begin anew in each run."""

    signals: tuple[str, ...]
    noise: float
    interval: float
    estimate: dict[str, dict[str, float]]
    anew: tuple[str, ...]
    factor: float  # to the unit of the errors
    unit: str


FILE = Path(__file__).parents[1] / "validation" / "tendon_robot.yaml"
MEMBER = "tendon_bending"
SIZE = 60  # of the ensemble
SLACKENED, FROM = 0.6e-3, 2  # [m], number of the first slackened run, counted from 0
SETS = {  # estimates start at the frozen parameters
    "decaying": FollowedSet(
        ("bending_angle",),
        5e-3,
        0.05,
        {
            "slack": {"start": 2e-5, "deviation": 5e-5, "walk": 1e-5, "from": 0.0, "to": 2e-3},
            "half_width[1]": {"deviation": 3e-5, "walk": 1e-5, "from": 1e-5, "to": 6e-4},
            "rest_angle": {"deviation": 2e-2, "walk": 1e-2},
        },
        (),
        float(np.degrees(1.0)),
        "deg",
    ),
    "sine": FollowedSet(
        ("tip_x", "tip_y", "tip_z"),
        1e-3,
        0.0,
        {
            "slack": {"deviation": 1e-4, "walk": 1e-5, "from": 0.0, "to": 2e-3},
            "half_width[1]": {"start": 5e-5, "deviation": 5e-5, "walk": 5e-6, "from": 1e-6, "to": 6e-4},
            "tilt": {"start": 0.0, "deviation": 2e-2, "walk": 2e-3},
        },
        ("tilt",),
        1e3,
        "mm",
    ),
}
BETWEEN = {"slack": 3e-4}  # least deviation at the begin of a run, where a machine may have been touched
PREDICTORS = ("followed", "frozen", "frozen_corrected", "present")  # whose errors are printed
SHOWN = (("slack", "slack_mm", 1e3), ("half_width[1]", "half_width_mm", 1e3))  # last estimates of a run

Starts = dict[str, dict[str, float]]


def follow_file(prediction: Prediction, own: FollowedSet, starts: Starts, seed: int) -> dict[str, Any]:
    """Return a follow file for a run, with the frozen parameters and the starts of the estimates."""
    keys, data = prediction.set.keys, prediction.data
    initial = {name: float(values[0]) for name, values in data.initial.items()}
    parameters = {**keys.set, **read_frozen(FILE)[prediction.set.name].values, **initial}
    return {
        "component": MEMBER,
        "step": f"{data.step} s",
        "data": [{"file": "input.csv"}, {"file": "output.csv"}],
        "set": {f"{MEMBER}.{name}": value for name, value in parameters.items()},
        "inputs": {"tendon": f"{MEMBER}.tendon_displacement"},
        "outputs": {name: {"signal": f"{MEMBER}.{name}", "noise": own.noise} for name in own.signals},
        "estimate": {f"{MEMBER}.{name}": {**one, **starts.get(name, {})} for name, one in own.estimate.items()},
        "method": {"name": "ensemble", "size": SIZE, "seed": seed},
        "forecast": {
            "horizon": "1 s",
            "every": "250 ms",
            "interval": "1 s",
            "draws": SIZE,
            "signals": [f"{MEMBER}.{name}" for name in own.signals],
            "planned": ["tendon"],
            "calibrate": "30 s",
        },
    }


def followed(prediction: Prediction, own: FollowedSet, starts: Starts, seed: int) -> list[Estimate]:
    """Follow a run."""
    data, tendon = prediction.data, prediction.data.inputs[0]
    time = data.time - data.time[0]
    rows = np.arange(len(time))
    if own.interval:
        rows = np.unique(np.searchsorted(time, np.arange(0.0, time[-1], own.interval)))
    measured = data.measured[rows][:, columns(prediction, own)]
    with tempfile.TemporaryDirectory() as folder:
        for name, names, table in (
            ("input", ["tendon"], [np.arange(len(tendon)) * data.step, tendon]),
            ("output", own.signals, [time[rows], measured]),
        ):
            path, head = Path(folder) / f"{name}.csv", ",".join(["time [s]", *names])
            np.savetxt(path, np.column_stack(table), "%.9g", ",", header=head, comments="")
        path = Path(folder) / "run.yaml"
        path.write_text(yaml.safe_dump(follow_file(prediction, own, starts, seed), sort_keys=False))
        return list(follow(load(path), BUILD))


def columns(prediction: Prediction, own: FollowedSet) -> list[int]:
    """Return the columns of the followed signals in measurements and predictions."""
    names = [output.signal for output in prediction.set.keys.outputs.values()]
    return [names.index(signal) for signal in own.signals]


def slackened(prediction: Prediction) -> Prediction:
    """Return what the frozen model predicts for a tendon that was slackened."""
    tendon = prediction.data.inputs[0]
    data = replace(prediction.data, inputs=(np.where(tendon > 0.0, tendon + SLACKENED, tendon),))
    predicted = prediction.set.predict(data, read_frozen(FILE)[prediction.set.name].values)
    return replace(prediction, data=data, predicted=predicted)


def forecast_errors(
    prediction: Prediction, own: FollowedSet, estimates: list[Estimate]
) -> tuple[Array, dict[str, float]]:
    """Return sizes of the errors of forecasts by `PREDICTORS`, (4, k), and shares of signals that 90 % bands held.

    `in_band`: bands of the filter alone; `in_calibrated_band`: with the widths that past errors gave them.
    """
    time, used = prediction.data.time - prediction.data.time[0], columns(prediction, own)
    measured, frozen = prediction.data.measured[:, used], prediction.predicted[:, used]
    forecasts = [one.forecast for one in estimates if one.forecast is not None and one.forecast.time[-1] <= time[-1]]
    begin, end = np.array([[one.start, one.time[-1]] for one in forecasts]).T
    low, median, high = np.array([one.bands[:, -1] for one in forecasts]).transpose(1, 0, 2)
    factors = np.array([one.factors[-1] for one in forecasts if one.factors is not None])

    def at(moments: Array, table: Array) -> Array:
        return np.column_stack([np.interp(moments, time, values) for values in table.T])

    true, present, base = at(end, measured), at(begin, measured), at(end, frozen)
    predicted = [median, base, base + present - at(begin, frozen), present]
    inside = {
        name: float(np.mean((median + (low - median) / by <= true) & (true <= median + (high - median) / by)))
        for name, by in (("in_band", factors), ("in_calibrated_band", 1.0))
    }
    return own.factor * np.linalg.norm(np.array(predicted) - true, axis=2), inside


def followed_runs(
    predictions: Sequence[Prediction], own: FollowedSet, first_slackened: int, seed: int
) -> dict[str, Array]:
    """Follow runs one after the other; return name -> a value for each run."""
    starts: Starts = {}
    rows = []
    for number, recorded in enumerate(predictions):
        prediction = slackened(recorded) if number >= first_slackened else recorded
        estimates = followed(prediction, own, starts, seed)
        errors, inside = forecast_errors(prediction, own, estimates)
        last = dict(zip(own.estimate, estimates[-1].values.tolist(), strict=True))
        deviations = dict(zip(own.estimate, estimates[-1].deviations.tolist(), strict=True))
        starts = {
            name: {
                "start": value,
                "deviation": max(deviations[name], own.estimate[name]["deviation"], BETWEEN.get(name, 0.0)),
            }
            for name, value in last.items()
            if name not in own.anew
        }
        names = [f"{name}_{own.unit}" for name in PREDICTORS]
        row = dict(zip(names, np.sqrt((errors**2).mean(axis=1)).tolist(), strict=True))
        row |= {name: factor * last[variable] for variable, name, factor in SHOWN}
        rows.append({**row, **inside, "nis_in_band": in_band(estimates)})
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print errors and estimates of the runs as they are, and of the runs with a slackened tendon."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--data", type=Path, help="folder of the measured data")
    parser.add_argument("--seeds", type=int, default=2, help="number of random seeds of the ensemble")
    options = parser.parse_args(arguments)
    try:
        predictions = validate(load_validation(FILE, options.data, BUILD))
    except TwinError as error:
        print(error, file=sys.stderr)
        return 1
    for title, name, first in (("decaying", "decaying", 0), ("slackened", "decaying", FROM), ("sine", "sine", 0)):
        runs = [one for one in predictions if one.set.name == name]
        if not runs:
            continue
        is_altered = title == "slackened"
        tables = [
            followed_runs(runs, SETS[name], first if is_altered else len(runs), seed) for seed in range(options.seeds)
        ]
        for key in tables[0]:
            values = np.array([table[key] for table in tables])[:, first:]
            print(f"follow_tendon_{title}_{key}: {values.min():.4g}, {values.max():.4g}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
