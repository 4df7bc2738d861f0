"""Simple models that a component must beat: fitted to the training data once, then frozen.

`line`, `quadratic` (with cross terms), `cubic`: static polynomials in the inputs. `play_cubic`: a Prandtl-Ishlinskii
operator (sum of play operators, Kuhnen, European Journal of Control 9(4), 2003) with the terms of a cubic.
`linear_second_order`: each output as a second-order system driven by the inputs, rolled out from its first sample.
`narx` predicts increments of the outputs from their past and the inputs, and is rolled out on its own predictions
(nonlinear autoregressive model with exogenous inputs: Billings, Nonlinear System Identification, 2013). `network`: a static
map of the inputs; `play_network`: one of the inputs and their plays, so that a black box has a memory as long as hysteresis
has. They are fitted by scikit-learn (extra `learn`); the frozen weights are evaluated without it.

Where recordings have turned frames (`turned` of a set), a component learns the frame and the start from the first sample,
and so does each baseline.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import TwinError
from twin.installed import import_optional

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from twin.arrays import Array
    from twin.validation.data import Data

PLAYS = 8  # play operators per input
RIDGE = 1e-9  # Tikhonov regularization relative to the features' squares: inputs may be collinear
LAGS = {
    "narx": (1, 2, 4),
    "network": (0,),
    "play_network": (0,),
}  # numbers of earlier outputs and inputs that are tried
HIDDEN = 12  # neurons
INTERVALS = (0.02, 0.1, 0.3, 0.6)  # between predictions, that are tried [s]
PREDICTIONS = 10  # in the shortest window at least
REGULARIZATIONS = (1e-3, 1e-1, 10.0)  # L2 penalties that are tried
ROWS = 4000  # of the table of a fit at most, evenly spaced
ITERATIONS = 200  # of L-BFGS at most
LIMIT = 4.0  # standard deviations to which a roll-out is confined


def polynomial(inputs: Array, degree: int, *, cross: bool) -> Array:
    """Features 1, u, u^2, ... of each input, with products of two inputs if `cross`, shape (rows, features)."""
    columns = [np.ones(len(inputs))]
    columns += [inputs[:, i] ** power for power in range(1, degree + 1) for i in range(inputs.shape[1])]
    if cross:
        columns += [inputs[:, i] * inputs[:, k] for i in range(inputs.shape[1]) for k in range(i)]
    return np.stack(columns, 1)


def plays(window: Array, spans: Sequence[float]) -> Array:
    """Outputs of play operators of rising half width, at rest at the window's start, shape (rows, plays)."""
    outputs = np.empty((len(window), len(spans) * PLAYS))
    half = np.concatenate([span * np.arange(1, PLAYS + 1) / (2 * (PLAYS + 1)) for span in spans])
    repeated = np.repeat(window, PLAYS, axis=1)
    memory = repeated[0].copy()
    for k, row in enumerate(repeated):
        memory = np.minimum(np.maximum(memory, row - half), row + half)
        outputs[k] = memory
    return outputs


def features(name: str, data: Data, spans: Sequence[float]) -> Array:
    """Features of a baseline that is linear in its coefficients, at the samples. `spans`: of the training inputs."""
    inputs = np.concatenate(data.inputs)
    if name == "line":
        grid = polynomial(inputs, 1, cross=False)
    elif name == "quadratic":
        grid = polynomial(inputs, 2, cross=True)
    else:
        grid = polynomial(inputs, 3, cross=False)
        if name == "play_cubic":
            grid = np.hstack([grid, np.concatenate([plays(window, spans) for window in data.inputs])])
    return data.at_samples(grid)


def least_squares(matrix: Array, values: Array) -> Array:
    """Coefficients of a linear model, shape (features, outputs), slightly regularized; columns are scaled first."""
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    scale[scale == 0] = 1.0
    scaled = matrix / scale
    normal = scaled.T @ scaled + RIDGE * len(matrix) * np.eye(matrix.shape[1])
    return np.asarray(np.linalg.solve(normal, scaled.T @ values) / scale[:, None])


def second_order(data: Data, coefficients: Array, output: int) -> Array:
    """Roll out one output of `linear_second_order` on the grid. Coefficients: a1, a2, c, then one per input.

    y[k] = a1 y[k-1] + a2 y[k-2] + b u[k] + c, from the first measured value and its rate.
    """
    from scipy.signal import lfilter

    a1, a2, constant = coefficients[:3]
    parts = []
    for w, (window, first) in enumerate(zip(data.inputs, data.first_measured()[:, output], strict=True)):
        before = first - data.rates[w, output] * data.step
        state = np.array([a1 * first + a2 * before, a2 * first])
        force = window[1:] @ coefficients[3:] + constant
        rest = lfilter([1.0], [1.0, -a1, -a2], force, zi=state)[0] if len(force) else []
        parts.append(np.concatenate([[first], rest]))
    return np.concatenate(parts)


def fit_second_order(data: Data, rows: Array, output: int) -> Array:
    """Minimize the roll-out error of one output; the search begins at several natural frequencies, damping 1."""
    from scipy.optimize import least_squares as search

    values = data.measured[rows, output]
    scale = float(np.std(values)) or 1.0
    line = least_squares(features("line", data, [])[rows], data.measured[rows][:, output : output + 1])[:, 0]

    def coefficients(position: Array) -> Array:
        radius, angle = 1 / (1 + np.exp(-position[0])), np.exp(position[1])  # pole inside the unit circle
        a1, a2 = 2 * radius * np.cos(min(angle, np.pi)), -(radius**2)
        return np.concatenate([[a1, a2], position[2:] * (1 - a1 - a2)])

    def residuals(position: Array) -> Array:
        predicted = data.at_samples(second_order(data, coefficients(position), output))[rows]
        return np.asarray(np.clip(np.nan_to_num(predicted - values, nan=1e6), -1e6, 1e6) / scale)

    results = []
    for frequency in (5.0, 20.0):  # [rad/s]
        decay = np.exp(-frequency * data.step)
        begin = np.array([np.log(decay / (1 - decay)), np.log(0.3 * frequency * data.step), line[0], *line[1:]])
        results.append(search(residuals, begin, max_nfev=40, x_scale=np.maximum(np.abs(begin), 1e-3)))
    best: Any = min(results, key=lambda result: result.cost)
    return coefficients(best.x)


def with_plays(data: Data, spans: Sequence[float]) -> Data:
    """The data with plays of the inputs as further inputs."""
    return replace(data, inputs=tuple(np.hstack([window, plays(window, spans)]) for window in data.inputs))


def from_first_sample(data: Data, usual: Array) -> tuple[Data, Array, Array]:
    """The data less the first sample of each window, in the frame of `usual`; signs of that frame and first samples, (N, outputs).

    The signs of `turned` outputs are those that bring a window's first sample closer to `usual`.
    """
    starts = data.first_measured()
    signs = np.ones_like(starts)
    for sign, start in zip(signs, starts, strict=True):
        opposite = sign.copy()
        opposite[list(data.turned)] = -1.0
        if np.sum((opposite * start - usual) ** 2) < np.sum((start - usual) ** 2):
            sign[:] = opposite
    signs, starts = signs[data.window_index], starts[data.window_index]
    return replace(data, measured=signs * (data.measured - starts), turned=()), signs, starts


def less_first(values: Array, data: Data) -> Array:
    """Values at the samples less that at the first sample of their window."""
    _, first = np.unique(data.window_index, return_index=True)
    return np.asarray(values - values[first][data.window_index])


def fit_baseline(name: str, data: Data, rows: Array, *, relative: bool = False) -> dict[str, Any]:
    """Fit a baseline to some rows of the data; returns plain numbers. `relative`: measurements are less the first sample."""
    if data.turned:
        usual = data.measured[rows][0]
        own = fit_baseline(name, from_first_sample(data, usual)[0], rows, relative=True)
        return {**own, "usual": usual.tolist()}
    if name == "linear_second_order":
        return {"coefficients": [fit_second_order(data, rows, i).tolist() for i in range(data.measured.shape[1])]}
    spans = np.ptp(np.concatenate(data.inputs), axis=0).tolist()
    if name == "play_network":
        return {**fit_network(name, with_plays(data, spans), rows), "spans": spans}
    if name in LAGS:
        return fit_network(name, data, rows)
    matrix = features(name, data, spans)
    if relative:
        matrix = less_first(matrix, data)
    return {"spans": spans, "coefficients": least_squares(matrix[rows], data.measured[rows]).T.tolist()}


def predict_baseline(name: str, frozen: dict[str, Any], data: Data) -> Array:
    """Predict the measurements with a frozen baseline, shape (N, outputs)."""
    if bool(data.turned) != ("usual" in frozen):
        raise TwinError(
            f"baseline {name} was fitted with{'' if 'usual' in frozen else 'out'} the key `turned`. Fit again with --fit."
        )
    if data.turned:
        own = {key: values for key, values in frozen.items() if key != "usual"}
        relative, signs, starts = from_first_sample(data, np.array(frozen["usual"]))
        return np.asarray(starts + signs * less_first(predict_baseline(name, own, relative), data))
    if name in LAGS:
        return predict_network(frozen, with_plays(data, frozen["spans"]) if name == "play_network" else data)
    coefficients = np.array(frozen["coefficients"])
    if name == "linear_second_order":
        grid = np.stack([second_order(data, row, i) for i, row in enumerate(coefficients)], 1)
        return data.at_samples(grid)
    return np.asarray(features(name, data, frozen["spans"]) @ coefficients.T)


def strides(data: Data, lags: int) -> list[int]:
    """Numbers of grid rows between predictions that are tried."""
    longest = min(len(window) for window in data.inputs) // PREDICTIONS
    return sorted({max(1, min(round(interval / data.step), longest)) if lags else 1 for interval in INTERVALS})


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


def fit_network(name: str, data: Data, rows: Array) -> dict[str, Any]:
    """Fit a network to some rows; lags, interval and penalty are chosen by the roll-outs of their middle third, left out."""
    import_optional("sklearn", "learn", f"baseline {name}")
    left_out = np.zeros(len(rows), bool)
    left_out[np.array_split(np.flatnonzero(rows), 3)[1]] = True
    candidates = [
        (scales(data, rows, lags, stride), penalty)
        for lags in LAGS[name]
        for stride in strides(data, lags)
        for penalty in REGULARIZATIONS
    ]
    errors = [
        roll_out_error(trained(common, data, rows & ~left_out, penalty), data, left_out)
        for common, penalty in candidates
    ]
    common, penalty = candidates[int(np.argmin(errors))]
    return trained(common, data, rows, penalty)


def roll_out_error(frozen: dict[str, Any], data: Data, rows: Array) -> float:
    """Mean square of the scaled prediction error in some rows."""
    difference = (predict_network(frozen, data) - data.measured)[rows] / np.array(frozen["scale"][0])
    return float(np.mean(difference**2))


def scales(data: Data, rows: Array, lags: int, stride: int) -> dict[str, Any]:
    """Centers and scales of outputs and inputs, with the memory of a network."""
    inputs = np.concatenate(data.inputs)
    deviations = [np.std(data.measured[rows], axis=0), np.std(inputs, axis=0)]
    return {
        "lags": lags,
        "stride": stride,
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
