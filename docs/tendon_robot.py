"""Draw the figure of docs/explanation/tendon_robot.md and write its tables in docs/data, if the data are there.

TWIN_VALIDATION_DATA=FOLDER python docs/tendon_robot.py
"""

from __future__ import annotations

import itertools
import sys
from typing import Any

import matplotlib as mpl
import numpy as np
from figures import ROOT, save
from matplotlib.figure import Figure
from tables import span, write_data

from twin.errors import TwinError
from twin.identify import FileKeys, RecordedFile
from twin.results import plotting
from twin.validation import ValidationFile, load, read_frozen, validate
from twin.validation.runner import predict_folds

RUN = "tendon_robot/decaying/data_4.txt"
POINTS = 500  # drawn of each run
FIRST = 50  # samples at the start whose mean current is a feature
SMOOTHED = 100  # samples over which the current is averaged
FAR = (0.15, 0.75)  # part of the largest distance of the tip from rest where tensions are compared
BINS = 13

Array = np.ndarray[Any, Any]


def column(own: ValidationFile, name: str, file: str, signal: str) -> Array:
    """Values of another column of a file, at the rows that the set compares."""
    keys = own.keys.sets[name]
    recorded = RecordedFile(
        FileKeys(file=file, time=keys.time, missing=keys.missing, duplicates=keys.duplicates), own.folder
    )
    return recorded.column(signal).values


def left_out_errors(residuals: Array, folds: Array, features: Array) -> list[float]:
    """RMS of each fold's residuals, shape (N, outputs), less a linear form of features that is fitted to the other folds.

    Each fold has the same weight; there is no constant.
    """
    weights = 1 / np.sqrt(np.bincount(folds)[folds])[:, None]
    errors = []
    for fold in np.unique(folds):
        own = folds == fold
        weight = weights[~own]
        coefficients = np.linalg.lstsq(features[~own] * weight, residuals[~own] * weight, rcond=None)[0]
        rest = residuals[own] - features[own] @ coefficients
        errors.append(float(np.sqrt(np.mean(np.sum(rest**2, axis=1)))))
    return errors


def added(own: ValidationFile) -> str:
    """Errors with and without current and tension, each run left out."""
    rows = []
    frozen = read_frozen(own.path)
    for name in own.keys.sets:
        current = own.open_set(name)
        data = current.reader(training=True).read(own.folder, list(frozen[name].files))
        predicted, _ = predict_folds(current, data, frozen[name].values)
        folds = data.file_index
        if name == "decaying":
            residuals, unit = np.degrees(data.measured - predicted)[:, :1], "deg"
            values = [column(own, name, file, "Motor Curr.") for file in data.files]
            smooth = np.concatenate([np.convolve(each, np.ones(SMOOTHED) / SMOOTHED, "same") for each in values])
            first = np.concatenate([np.full(len(each), np.mean(each[:FIRST])) for each in values])
            features = {
                "nothing": np.zeros((len(folds), 1)),
                "motor current": smooth[:, None] - np.mean(smooth),
                "motor current of the first samples": first[:, None] - np.mean(first),
            }
        else:
            residuals, unit = 1e3 * (data.measured - predicted), "mm"
            sides = np.sign([data.measured[folds == fold][0, 1] for fold in np.unique(folds)])
            residuals[:, :2] *= sides[folds][:, None]  # the frame of some runs is turned by half a turn
            tension = np.concatenate([column(own, name, file, "Tension") for file in data.files])
            pull = np.concatenate([column(own, name, file, "Stroke") for file in data.files])
            features = {
                "nothing": np.zeros((len(folds), 1)),
                "tendon tension": tension[:, None],
                "tension, and tension times pull": np.stack([tension, tension * pull], 1),
            }
        for what, matrix in features.items():
            errors = left_out_errors(residuals, folds, matrix)
            rows.append(f"| {name} | {what} | {np.mean(errors):.2f} {unit} | {span(errors, '.2f')} {unit} |")
    return "\n".join(["| set | added | mean error | runs left out |", "|---|---|---|---|", *rows])


def capstan(own: ValidationFile) -> str:
    """Half the logarithm of the tensions while pulling and releasing at the same tip position: the capstan exponent."""
    rows = ["| run | tension | exponent, median and quartiles |", "|---|---|---|"]
    for file in read_frozen(own.path)["sine"].files:
        tip = np.stack([column(own, "sine", file, f"tip_marker[{i}]") for i in (1, 2, 3)], 1)
        tension, pull = (column(own, "sine", file, name) for name in ("Tension", "Stroke"))
        distance, speed = np.linalg.norm(tip - tip[0], axis=1), np.gradient(pull)
        moving = 0.02 * np.max(np.abs(speed))
        edges = np.linspace(*FAR, BINS) * np.max(distance)
        exponents = []
        for low, high in itertools.pairwise(edges):
            inside = (distance >= low) & (distance < high)
            pulled, released = tension[inside & (speed > moving)], tension[inside & (speed < -moving)]
            if len(pulled) > 1 and len(released) > 1:
                exponents.append(0.5 * np.log(np.mean(pulled) / np.mean(released)))
        quartiles = np.percentile(exponents, (50, 25, 75))
        frequency = int(file.rpartition("/f")[2][:3]) / 100
        rows.append(
            f"| {frequency:.2f} Hz | up to {np.max(tension):.1f} N "
            f"| {quartiles[0]:.2f} ({quartiles[1]:.2f} to {quartiles[2]:.2f}) |"
        )
    return "\n".join(rows)


def main() -> None:
    """Loops of one run, and the errors of all runs over their periods."""
    try:
        own = load(ROOT / "validation" / "tendon_robot.yaml", None, ROOT / "build")
    except TwinError as problem:
        sys.exit(f"docs/tendon_robot.py: nothing is drawn: {problem}")
    predictions = validate(own, ["tendon_robot/decaying/*.txt"])
    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": "tendon robot"}):
        figure = Figure((8.4, 3.4), layout="constrained")
        loops, errors = figure.subplots(1, 2)
        for number, each in enumerate(predictions):
            time = each.data.time - each.data.time[0]
            rows = np.linspace(0, len(time) - 1, POINTS).astype(int)
            measured, predicted = np.degrees(each.data.measured[rows, 0]), np.degrees(each.predicted[rows, 0])
            if each.file == RUN:
                grid = each.data.step * np.arange(len(each.data.inputs[0]))
                pull = 1e3 * np.interp(time[rows], grid, each.data.inputs[0][:, 0])
                loops.plot(pull, measured, color="0.6", linewidth=2, label="measured")
                loops.plot(pull, predicted, color=plotting.COLORS[0], linewidth=1, label="model")
            frequency = 0.1 * (number + 1)
            errors.plot(
                time[rows] * frequency,
                predicted - measured,
                color=plotting.COLORS[number],
                linewidth=1,
                label=f"{frequency:.1f} Hz",
            )
        loops.set(xlabel="tendon displacement [mm]", ylabel="bending angle [deg]", title="0.4 Hz")
        errors.set(xlabel="periods", ylabel="model less measured [deg]", title="all five runs")
        loops.legend()
        errors.legend(ncols=2)
        save(figure, "tendon_robot.svg")
    write_data("tendon_robot_current_and_tension", added(own))
    write_data("tendon_robot_capstan", capstan(own))


if __name__ == "__main__":
    main()
