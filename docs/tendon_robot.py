"""Draw the figure of docs/explanation/tendon_robot.md from the measured data, if their folder is there.

TWIN_VALIDATION_DATA=FOLDER python docs/tendon_robot.py
"""

from __future__ import annotations

import sys

import matplotlib as mpl
import numpy as np
from figures import ROOT, save
from matplotlib.figure import Figure

from twin.errors import TwinError
from twin.results import plotting
from twin.validation import load, validate

RUN = "tendon_robot/decaying/data_4.txt"
POINTS = 500  # drawn of each run


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


if __name__ == "__main__":
    main()
