"""Force over every ten seconds, which is how long the paper recorded."""

import numpy as np

SAMPLE, LENGTH, BEGIN = 5e-3, 10.0, 12.0  # [s] between samples of the record, of a window, when the first one begins


def analysis(force):
    """Standard deviation [N] of the force over the ten seconds before each sample; before 22 s that of the first window.

    A run that ends before 22 s has no complete window, and no result.
    """
    first, count = round(BEGIN / SAMPLE), round(LENGTH / SAMPLE)
    if len(force) < first + count:
        return {}
    total = np.cumsum(np.append(0.0, force))
    square = np.cumsum(np.append(0.0, force**2))
    last = np.arange(first + count, len(force) + 1)
    mean = (total[last] - total[last - count]) / count
    variance = (square[last] - square[last - count]) / count - mean * mean
    deviations = np.sqrt(np.maximum(variance, 0.0))
    return {"force_std": np.append(np.full(len(force) - len(last), deviations[0]), deviations)}


analysis.outputs = {"force_std": "N"}
analysis.row_interval, analysis.first_row, analysis.window_length = SAMPLE, 0.0, LENGTH
