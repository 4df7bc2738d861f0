"""`narx`: a small neural network that predicts each output from its past and the inputs, rolled out on its own predictions.

Nonlinear autoregressive model with exogenous inputs (Billings, Nonlinear System Identification, 2013). It is fitted by
scikit-learn (`pip install 'catheter-twin[learn]'`); the frozen weights are evaluated without it.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import TwinError

if TYPE_CHECKING:
    from twin.validation.data import Data

    Array = np.ndarray[Any, Any]

LAGS = 2  # earlier outputs and inputs
HIDDEN = 12  # neurons
INTERVAL = 0.02  # shortest interval between predictions [s]: closer samples hardly differ
REGULARIZATIONS = (1e-3, 1.0)  # L2 penalties that are tried
SEEDS = 2  # initial weights that are tried with each
ITERATIONS = 500  # of L-BFGS at most
LIMIT = 4.0  # standard deviations to which a roll-out is confined


def stride_of(data: Data) -> int:
    """Grid rows between predictions."""
    return max(1, round(INTERVAL / data.step))


def coarse(window: Array, stride: int) -> Array:
    """Every `stride`-th row of a window, the first one included."""
    return np.asarray(window[::stride])


def measured_on_grid(data: Data, rows: Array) -> list[Array]:
    """Measurements on the grid of each window; NaN between samples that are not in `rows`, shape (grid rows, outputs)."""
    values = np.where(rows[:, None], data.measured, np.nan)
    grids = []
    begin = 0
    for w, window in enumerate(data.inputs):
        own = data.window_index == w
        position = data.lower[own] + data.weight[own] - begin
        grid = np.arange(len(window))
        grids.append(np.stack([np.interp(grid, position, column) for column in values[own].T], 1))
        begin += len(window)
    return grids


def regressors(outputs: Array, inputs: Array, k: int) -> Array:
    """Regressors of row k: earlier outputs, the newest first, then this input and earlier ones."""
    earlier = [outputs[..., k - lag, :] for lag in range(1, LAGS + 1)]
    return np.concatenate([*earlier, *(inputs[..., k - lag, :] for lag in range(LAGS + 1))], axis=-1)


def fit_narx(data: Data, rows: Array) -> dict[str, Any]:
    """Fit increments of the outputs to some rows, several times; returns the one with the least roll-out error on them."""
    try:
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.neural_network import MLPRegressor
    except ImportError:
        raise TwinError(
            "baseline narx: needs scikit-learn. Install it: pip install 'catheter-twin[learn]', or leave narx out."
        ) from None
    common, matrix, increments = training_table(data, rows)
    best, least = {}, np.inf
    for alpha in REGULARIZATIONS:
        for seed in range(SEEDS):
            network = MLPRegressor(
                hidden_layer_sizes=(HIDDEN,),
                activation="tanh",
                solver="lbfgs",
                alpha=alpha,
                max_iter=ITERATIONS,
                max_fun=10**6,
                random_state=seed,
            )
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ConvergenceWarning)
                network.fit(matrix, increments if increments.shape[1] > 1 else increments[:, 0])
            frozen = common | {
                "weights": [own.tolist() for own in network.coefs_],
                "biases": [own.tolist() for own in network.intercepts_],
            }
            difference = (predict_narx(frozen, data) - data.measured)[rows] / np.array(common["scale"][0])
            if (error := float(np.mean(difference**2))) < least:
                best, least = frozen, error
    return best


def training_table(data: Data, rows: Array) -> tuple[dict[str, Any], Array, Array]:
    """Scales, regressors and increments of all predictions whose samples are in `rows`."""
    stride = stride_of(data)
    center = [np.mean(data.measured[rows], axis=0), np.mean(np.concatenate(data.inputs), axis=0)]
    scale = [np.std(data.measured[rows], axis=0), np.std(np.concatenate(data.inputs), axis=0)]
    scale = [np.where(own > 0, own, 1.0) for own in scale]
    features, targets = [], []
    for window, measured in zip(data.inputs, measured_on_grid(data, rows), strict=True):
        u = coarse((window - center[1]) / scale[1], stride)
        y = coarse((measured - center[0]) / scale[0], stride)
        for k in range(LAGS, len(y)):
            features.append(regressors(y, u, k))
            targets.append(y[k] - y[k - 1])
    matrix, increments = np.array(features), np.array(targets)
    is_complete = np.isfinite(matrix).all(axis=1) & np.isfinite(increments).all(axis=1)
    matrix, increments = matrix[is_complete], increments[is_complete]
    spread = np.where(np.std(increments, axis=0) > 0, np.std(increments, axis=0), 1.0)
    common = {
        "stride": stride,
        "center": [own.tolist() for own in center],
        "scale": [own.tolist() for own in scale],
        "spread": spread.tolist(),
    }
    return common, matrix, increments / spread


def predict_narx(frozen: dict[str, Any], data: Data) -> Array:
    """Roll out from the first sample of each window, at rest before it, shape (N, outputs)."""
    stride = frozen["stride"]
    center, scale = ([np.array(own) for own in frozen[key]] for key in ("center", "scale"))
    first, second = (np.array(own) for own in frozen["weights"])
    biases = [np.array(own) for own in frozen["biases"]]
    spread = np.array(frozen["spread"])
    parts = []
    for window, start in zip(data.inputs, data.first_measured(), strict=True):
        u = coarse((window - center[1]) / scale[1], stride)
        u = np.concatenate([np.repeat(u[:1], LAGS, axis=0), u])
        y = np.tile((start - center[0]) / scale[0], (len(u), 1))
        for k in range(LAGS + 1, len(u)):
            hidden = np.tanh(regressors(y, u, k) @ first + biases[0])
            y[k] = np.clip(y[k - 1] + spread * (hidden @ second + biases[1]), -LIMIT, LIMIT)
        values = y[LAGS:] * scale[0] + center[0]
        places = np.arange(len(window))
        parts.append(np.stack([np.interp(places, stride * np.arange(len(values)), v) for v in values.T], 1))
    return data.at_samples(np.concatenate(parts))
