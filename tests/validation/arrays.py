"""Measured data of a set from arrays, without a file."""

import numpy as np

from twin.validation.data import Data


def data_of(inputs, measured, *, step=0.1, rates=None, files=None, labels=(), initial=None, jumps=0, turned=()):
    """Windows whose samples lie on the grid: per window arrays of shape (rows, inputs) and (rows, outputs).

    `files`: the file of each window, one for all by default.
    """
    inputs, measured = ([np.array(window, float) for window in windows] for windows in (inputs, measured))
    counts = [len(window) for window in measured]
    files = [0] * len(inputs) if files is None else files
    total = sum(counts)
    return Data(
        files=tuple(f"run {k}" for k in range(max(files) + 1)),
        hashes=tuple("0" for _ in range(max(files) + 1)),
        step=step,
        inputs=tuple(inputs),
        initial=initial or {},
        measured=np.concatenate(measured),
        rates=np.zeros((len(inputs), measured[0].shape[1])) if rates is None else np.array(rates, float),
        time=step * np.concatenate([np.arange(count) for count in counts]),
        file_index=np.repeat(files, counts),
        window_index=np.repeat(np.arange(len(inputs)), counts),
        lower=np.arange(total),
        weight=np.zeros(total),
        labels=np.array(labels),
        jumps=jumps,
        changes={},
        turned=turned,
    )
