"""`narx` and `network`: small neural networks as black-box baselines.

`narx` predicts increments of the outputs from their past and the inputs, and is rolled out on its own predictions
(nonlinear autoregressive model with exogenous inputs: Billings, Nonlinear System Identification, 2013). `network` is a static
map of the inputs. They are fitted by scikit-learn (`pip install 'catheter-twin[learn]'`); the frozen weights are evaluated
without it.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import TwinError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from twin.validation.data import Data

    Array = np.ndarray[Any, Any]

LAGS = {"narx": 2, "network": 0, "play_network": 0}  # earlier outputs and inputs
HIDDEN = 12  # neurons
INTERVAL = 0.02  # shortest interval between predictions [s]: closer samples hardly differ
PREDICTIONS = 10  # in the shortest window at least
REGULARIZATIONS = (1e-3, 1e-1, 10.0)  # L2 penalties that are tried
ROWS = 4000  # of the table of a fit at most, evenly spaced
ITERATIONS = 200  # of L-BFGS at most
LIMIT = 4.0  # standard deviations to which a roll-out is confined


def stride_of(data: Data, lags: int) -> int:
    """Grid rows between predictions."""
    shortest = min(len(window) for window in data.inputs)
    return max(1, min(round(INTERVAL / data.step), shortest // PREDICTIONS)) if lags else 1


def padded(window: Array, first: Array, change: Array, lags: int) -> Array:
    """Prepend `lags` rows to a window that continue it before its start: `first` less `change` per row."""
    earlier = first - np.arange(lags, 0, -1)[:, None] * change
    return np.concatenate([earlier, window])


def scaled_windows(frozen: dict[str, Any], data: Data, measured: Array) -> Iterator[tuple[Array, Array]]:
    """Yield scaled outputs and inputs of each window at the predictions' grid, with the rows before the start.

    `measured`: outputs on the grid, NaN where unknown. Before the start, outputs change at their measured rates (0 if not
    measured) and inputs rest.
    """
    lags, stride = frozen["lags"], frozen["stride"]
    center, scale = ([np.array(own) for own in frozen[key]] for key in ("center", "scale"))
    starts = (data.first_measured() - center[0]) / scale[0]
    changes = data.rates * data.step * stride / scale[0]
    begin = 0
    for window, start, change in zip(data.inputs, starts, changes, strict=True):
        u = ((window - center[1]) / scale[1])[::stride]
        y = ((measured[begin : begin + len(window)] - center[0]) / scale[0])[::stride]
        begin += len(window)
        yield padded(y, start, change, lags), padded(u, u[0], np.zeros(u.shape[1]), lags)


def measured_on_grid(data: Data, rows: Array) -> Array:
    """Measurements on the grid; NaN between samples that are not in `rows`, shape (grid rows, outputs)."""
    values = np.where(rows[:, None], data.measured, np.nan)
    grids = []
    begin = 0
    for w, window in enumerate(data.inputs):
        own = data.window_index == w
        position = data.lower[own] + data.weight[own] - begin
        grid = np.arange(len(window))
        grids.append(np.stack([np.interp(grid, position, column) for column in values[own].T], 1))
        begin += len(window)
    return np.concatenate(grids)


def regressors(outputs: Array, inputs: Array, k: Array | int, lags: int) -> Array:
    """Regressors of row(s) k: earlier outputs, the newest first, then this input and earlier ones."""
    earlier = [outputs[k - lag] for lag in range(1, lags + 1)]
    return np.concatenate([*earlier, *(inputs[k - lag] for lag in range(lags + 1))], axis=-1)


def require_scikit_learn(name: str) -> None:
    """TwinError if a network cannot be fitted."""
    try:
        import sklearn  # noqa: F401 - optional
    except ImportError:
        raise TwinError(
            f"baseline {name}: needs scikit-learn. Install it: pip install 'catheter-twin[learn]', or leave {name} out."
        ) from None


def fit_network(name: str, data: Data, rows: Array) -> dict[str, Any]:
    """Fit `narx` or `network` to some rows; the penalty is chosen by leaving out their middle third."""
    require_scikit_learn(name)
    common = scales(data, rows, LAGS[name])
    left_out = np.zeros(len(rows), bool)
    left_out[np.array_split(np.flatnonzero(rows), 3)[1]] = True
    errors = [
        roll_out_error(trained(common, data, rows & ~left_out, penalty), data, left_out) for penalty in REGULARIZATIONS
    ]
    return trained(common, data, rows, REGULARIZATIONS[int(np.argmin(errors))])


def roll_out_error(frozen: dict[str, Any], data: Data, rows: Array) -> float:
    """Mean square of the scaled prediction error in some rows."""
    difference = (predict_network(frozen, data) - data.measured)[rows] / np.array(frozen["scale"][0])
    return float(np.mean(difference**2))


def scales(data: Data, rows: Array, lags: int) -> dict[str, Any]:
    """Centers and scales of outputs and inputs."""
    inputs = np.concatenate(data.inputs)
    deviations = [np.std(data.measured[rows], axis=0), np.std(inputs, axis=0)]
    return {
        "lags": lags,
        "stride": stride_of(data, lags),
        "center": [np.mean(data.measured[rows], axis=0).tolist(), np.mean(inputs, axis=0).tolist()],
        "scale": [np.where(own > 0, own, 1.0).tolist() for own in deviations],
    }


def trained(common: dict[str, Any], data: Data, rows: Array, penalty: float) -> dict[str, Any]:
    """Train a network on the one-step predictions whose samples are in `rows`."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPRegressor

    lags = common["lags"]
    features, targets = [], []
    for y, u in scaled_windows(common, data, measured_on_grid(data, rows)):
        k = np.arange(lags + 1 if lags else 0, len(u))  # the first sample is known
        features.append(regressors(y, u, k, lags))
        targets.append(y[k] - y[k - 1] if lags else y[k])
    matrix, values = np.concatenate(features), np.concatenate(targets)
    complete = np.flatnonzero(np.isfinite(matrix).all(axis=1) & np.isfinite(values).all(axis=1))
    complete = complete[np.linspace(0, len(complete) - 1, min(len(complete), ROWS)).astype(int)]
    matrix, values = matrix[complete], values[complete]
    spread = np.where(np.std(values, axis=0) > 0, np.std(values, axis=0), 1.0)
    network = MLPRegressor(
        hidden_layer_sizes=(HIDDEN,),
        activation="tanh",
        solver="lbfgs",
        alpha=penalty,
        max_iter=ITERATIONS,
        max_fun=10**6,
        random_state=0,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        network.fit(matrix, values / spread if values.shape[1] > 1 else (values / spread)[:, 0])
    return common | {
        "spread": spread.tolist(),
        "weights": [own.tolist() for own in network.coefs_],
        "biases": [own.tolist() for own in network.intercepts_],
    }


def predict_network(frozen: dict[str, Any], data: Data) -> Array:
    """Predict the measurements: a static map, or roll-outs from the first sample of each window, shape (N, outputs)."""
    lags, stride = frozen["lags"], frozen["stride"]
    center, scale = (np.array(frozen[key][0]) for key in ("center", "scale"))
    first, second = (np.array(own) for own in frozen["weights"])
    biases = [np.array(own) for own in frozen["biases"]]
    spread = np.array(frozen["spread"])
    unknown = np.full((sum(len(window) for window in data.inputs), data.measured.shape[1]), np.nan)
    parts = []
    for window, start, (y, u) in zip(
        data.inputs, data.first_measured(), scaled_windows(frozen, data, unknown), strict=True
    ):
        if lags:
            y[lags] = (start - center) / scale
            for k in range(lags + 1, len(u)):
                hidden = np.tanh(regressors(y, u, k, lags) @ first + biases[0])
                y[k] = np.clip(y[k - 1] + spread * (hidden @ second + biases[1]), -LIMIT, LIMIT)
        else:
            y[:] = spread * (np.tanh(u @ first + biases[0]) @ second + biases[1])
        values = y[lags:] * scale + center
        rows = np.arange(len(window))
        parts.append(np.stack([np.interp(rows, stride * np.arange(len(values)), v) for v in values.T], 1))
    return data.at_samples(np.concatenate(parts))
