"""A twin of the measured tendon robot: slack and friction followed from run to run, and errors of forecasts of the next second.

    python -m benchmarks.follow_tendon --data FOLDER [--seeds N]  prints `name: least, largest` over runs and seeds

The recordings are the decaying sines of `validation/tendon_robot.yaml`, which says where to get them. Each run is followed with the ensemble
filter from the frozen parameters; slack, friction (half width of the narrowest play) and rest angle begin at the last estimates of the run
before. Every 250 ms the bending angle one second later is forecast, with the displacement of the tendon as it will be. The same second is
predicted by the frozen model alone, by the frozen model plus its present error, and by the present angle. The frozen
parameters were fitted to these runs, which favors them. Then the same with a tendon that was slackened by 0.6 mm before the third run: its
displacements are larger by that, except at rest. The walks were chosen while looking at these runs.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
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

FILE = Path(__file__).parents[1] / "validation" / "tendon_robot.yaml"
SET, PATTERN, MEMBER, SIGNAL = "decaying", "tendon_robot/decaying/*.txt", "tendon_bending", "bending_angle"
INTERVAL, NOISE = 0.05, 5e-3  # of the measurements [s], [rad]
SIZE = 60  # of the ensemble
SLACKENED, FROM = 0.6e-3, 2  # [m], number of the first slackened run, counted from 0
ESTIMATE = {  # SI; starts are the frozen parameters
    "slack": {"start": 2e-5, "deviation": 5e-5, "walk": 1e-5, "from": 0.0, "to": 2e-3},
    "half_width[1]": {"deviation": 3e-5, "walk": 1e-5, "from": 1e-5, "to": 6e-4},
    "rest_angle": {"deviation": 2e-2, "walk": 1e-2},
}
BETWEEN = {"slack": 3e-4}  # least deviation at the begin of a run, where a machine may have been touched
PREDICTORS = ("followed_deg", "frozen_deg", "frozen_corrected_deg", "present_deg")  # errors of the forecasts
SHOWN = (  # last estimates of a run
    ("slack", "slack", "mm", 1e3),
    ("half_width[1]", "half_width", "mm", 1e3),
    ("rest_angle", "rest", "deg", float(np.degrees(1.0))),
)


def follow_file(prediction: Prediction, starts: dict[str, dict[str, float]], seed: int) -> dict[str, Any]:
    """Return a follow file for a run, with the frozen parameters and the starts of the estimates."""
    keys, data = prediction.set.keys, prediction.data
    values = {**keys.set, **read_frozen(FILE)[SET].values, **{name: one[0] for name, one in data.initial.items()}}
    return {
        "component": MEMBER,
        "step": f"{data.step} s",
        "data": [{"file": "input.csv"}, {"file": "output.csv"}],
        "set": {
            f"{MEMBER}.{name}": value if isinstance(value, list) else float(value) for name, value in values.items()
        },
        "inputs": {"tendon [m]": f"{MEMBER}.tendon_displacement"},
        "outputs": {"angle [rad]": {"signal": f"{MEMBER}.{SIGNAL}", "noise": NOISE}},
        "estimate": {f"{MEMBER}.{name}": {**keys, **starts.get(name, {})} for name, keys in ESTIMATE.items()},
        "method": {"name": "ensemble", "size": SIZE, "seed": seed},
        "forecast": {
            "horizon": "1 s",
            "every": "250 ms",
            "interval": "1 s",
            "draws": SIZE,
            "signals": [f"{MEMBER}.{SIGNAL}"],
            "planned": ["tendon [m]"],
        },
    }


def followed(prediction: Prediction, tendon: Array, starts: dict[str, dict[str, float]], seed: int) -> list[Estimate]:
    """Follow a run. `tendon`: its displacement at the steps of the model [m]."""
    data = prediction.data
    time, angle = data.time - data.time[0], data.measured[:, column(prediction)]
    rows = np.unique(np.searchsorted(time, np.arange(0.0, time[-1], INTERVAL)))
    with tempfile.TemporaryDirectory() as folder:
        for name, label, table in (
            ("input", "tendon [m]", [np.arange(len(tendon)) * data.step, tendon]),
            ("output", "angle [rad]", [time[rows], angle[rows]]),
        ):
            path = Path(folder) / f"{name}.csv"
            np.savetxt(path, np.column_stack(table), "%.9g", ",", header=f"time [s],{label}", comments="")
        path = Path(folder) / "run.yaml"
        path.write_text(yaml.safe_dump(follow_file(prediction, starts, seed), sort_keys=False))
        return list(follow(load(path), BUILD))


def column(prediction: Prediction) -> int:
    """Return the column of the angle in measurements and predictions."""
    return [output.signal for output in prediction.set.keys.outputs.values()].index(SIGNAL)


def slackened(prediction: Prediction) -> tuple[Prediction, Array]:
    """Return what the frozen model predicts for a tendon that was slackened, and the displacements of that."""
    tendon = prediction.data.inputs[0]
    tendon = np.where(tendon > 0.0, tendon + SLACKENED, tendon)
    data = replace(prediction.data, inputs=(tendon,))
    predicted = prediction.set.predict(data, read_frozen(FILE)[SET].values)
    return replace(prediction, data=data, predicted=predicted), tendon[:, 0]


def forecast_errors(prediction: Prediction, estimates: list[Estimate]) -> tuple[Array, Array]:
    """Return errors of the forecasts by `PREDICTORS` [deg], (k, 4), and whether the 90 % band held the angle, (k,)."""
    time = prediction.data.time - prediction.data.time[0]
    measured, frozen = (table[:, column(prediction)] for table in (prediction.data.measured, prediction.predicted))
    forecasts = [one.forecast for one in estimates if one.forecast is not None and one.forecast.time[-1] <= time[-1]]
    begin, end = (np.array([moment(one) for one in forecasts]) for moment in (lambda f: f.start, lambda f: f.time[-1]))
    low, median, high = np.array([one.bands[:, -1, 0] for one in forecasts]).T
    true, present = np.interp(end, time, measured), np.interp(begin, time, measured)
    base = np.interp(end, time, frozen)
    predicted = [median, base, base + present - np.interp(begin, time, frozen), present]
    return np.degrees(np.array(predicted) - true).T, (low <= true) & (true <= high)


def followed_runs(predictions: Sequence[Prediction], first_slackened: int, seed: int) -> dict[str, Array]:
    """Follow runs one after the other; return name -> a value for each run."""
    starts: dict[str, dict[str, float]] = {}
    rows = []
    for number, prediction in enumerate(predictions):
        own, tendon = (
            slackened(prediction) if number >= first_slackened else (prediction, prediction.data.inputs[0][:, 0])
        )
        estimates = followed(own, tendon, starts, seed)
        errors, inside = forecast_errors(own, estimates)
        last = {
            name: (float(value), float(deviation))
            for name, value, deviation in zip(ESTIMATE, estimates[-1].values, estimates[-1].deviations, strict=True)
        }
        starts = {
            name: {"start": value, "deviation": max(deviation, ESTIMATE[name]["deviation"], BETWEEN.get(name, 0.0))}
            for name, (value, deviation) in last.items()
        }
        row = dict(zip(PREDICTORS, np.sqrt((errors**2).mean(axis=0)).tolist(), strict=True))
        row |= {f"{name}_{unit}": factor * last[variable][0] for variable, name, unit, factor in SHOWN}
        rows.append({**row, "in_band": float(inside.mean()), "nis_in_band": in_band(estimates)})
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print errors and estimates of the runs as they are, and of the runs with a slackened tendon."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--data", type=Path, help="folder of the measured data")
    parser.add_argument("--seeds", type=int, default=2, help="number of random seeds of the ensemble")
    options = parser.parse_args(arguments)
    try:
        predictions = validate(load_validation(FILE, options.data, BUILD), [PATTERN])
    except TwinError as error:
        print(error, file=sys.stderr)
        return 1
    for title, first in (("recorded", len(predictions)), ("slackened", FROM)):
        tables = [followed_runs(predictions, first, seed) for seed in range(options.seeds)]
        for name in tables[0]:
            values = np.array([table[name] for table in tables])[:, first if first < len(predictions) else 0 :]
            print(f"follow_tendon_{title}_{name}: {values.min():.4g}, {values.max():.4g}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
