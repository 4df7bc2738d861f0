"""How long a controller takes until the force is quiet."""

import numpy as np

SAMPLE, WINDOW = 5e-3, 200  # [s] between samples of the record, and samples of a second
QUIET = 6e-3  # [N]: the goal under disturbances, twice that of a heart that only wanders


def analysis(force, setpoint):
    """Time [s] after which the root mean square of the force error over a second stays below 6 mN."""
    square = np.cumsum(np.append(0.0, (force - setpoint) ** 2))
    rms = np.sqrt((square[WINDOW:] - square[:-WINDOW]) / WINDOW)
    loud = np.flatnonzero(rms > QUIET)
    return {"settling_time": SAMPLE * (loud[-1] + WINDOW) if loud.size else 0.0}


analysis.outputs = {"settling_time": "s"}
analysis.row_interval, analysis.first_row = SAMPLE, 0.0
