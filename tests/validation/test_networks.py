"""Small neural networks as baselines: what they are trained on, and roll-outs of frozen weights.

scikit-learn is optional: a regressor that records what it is given stands in for it.
"""

import sys
import warnings
from types import ModuleType

import numpy as np
import pytest

from tests.every_case import every_case
from tests.validation.arrays import data_of
from twin.errors import TwinError
from twin.validation import baselines
from twin.validation.baselines import fit_baseline, predict_baseline

TWO = [np.array([[1.0], [2.0], [4.0], [8.0]]), np.array([[5.0], [7.0], [6.0]])]
THREE = [np.array([[0.0], [1.0], [3.0], [6.0]]), np.array([[2.0], [4.0], [0.0]])]


@every_case(
    ("step", "lengths", "strides"),
    [
        (0.01, [900, 5000], [2, 10, 30, 60]),  # 20 ms to 0.6 s between predictions
        (0.004, [500], [5, 25, 50]),  # ten predictions in the shortest window
        (0.004, [500, 49], [4]),
        (0.004, [500, 9], [1]),
        (0.1, [500], [1, 3, 6]),
    ],
)
def test_rows_between_predictions(step, lengths, strides):
    data = data_of([np.zeros((n, 1)) for n in lengths], [np.zeros((n, 1)) for n in lengths], step=step)
    assert baselines.strides(data, 2) == strides
    assert baselines.strides(data, 0) == [1]


def test_rows_before_a_window_continue_it():
    window, first, change = np.array([[5.0, 1.0], [6.0, 3.0]]), np.array([5.0, 1.0]), np.array([1.0, -2.0])
    assert baselines.padded(window, first, change, 2).tolist() == [[3, 5], [4, 3], [5, 1], [6, 3]]
    assert baselines.padded(window, first, change, 0).tolist() == window.tolist()


def test_regressors_are_earlier_outputs_and_all_inputs_the_newest_first():
    y, u = np.array([[0.0], [1.0], [2.0], [3.0]]), np.array([[10.0], [11.0], [12.0], [13.0]])
    assert baselines.regressors(y, u, 2, 2).tolist() == [1, 0, 12, 11, 10]
    assert baselines.regressors(y, u, np.array([2, 3]), 2).tolist() == [[1, 0, 12, 11, 10], [2, 1, 13, 12, 11]]
    assert baselines.regressors(y, u, np.array([0, 3]), 0).tolist() == [[10], [13]]


def test_scales_are_of_the_rows_of_a_fit():
    """Outputs by the rows that count, inputs by all; what is constant is not scaled."""
    inputs = [np.stack([[1.0, 2.0, 4.0, 8.0], np.full(4, 3.0)], 1)]
    data = data_of(inputs, [np.stack([[0.0, 2.0, 4.0, 90.0], np.full(4, 7.0)], 1)], step=0.01)
    found = baselines.scales(data, np.array([True, True, True, False]), 2, 1)
    assert (found["lags"], found["stride"]) == (2, 1)
    assert found["center"] == [[2.0, 7.0], [3.75, 3.0]]
    assert found["scale"][0] == pytest.approx([np.std([0, 2, 4]), 1.0])
    assert found["scale"][1] == pytest.approx([np.std([1, 2, 4, 8]), 1.0])


def test_measurements_on_the_grid():
    """A sample between two rows counts for both sides; next to a row that is left out nothing is known."""
    data = data_of(TWO, THREE)
    found = baselines.measured_on_grid(data, np.array([True, True, False, True, True, True, True]))
    assert found[:, 0] == pytest.approx([0.0, 1.0, np.nan, 6.0, 2.0, 4.0, 0.0], nan_ok=True)
    data = data_of([np.zeros((4, 1)), np.zeros((3, 1))], [[[1.0], [3.0]], [[5.0], [9.0]]])
    data.lower[:], data.weight[:] = [0, 2, 4, 5], [0.0, 0.5, 0.0, 1.0]  # in rows 0 and 2.5 of 4, 0 and 2 of 3
    assert baselines.measured_on_grid(data, np.ones(4, bool))[:, 0] == pytest.approx([1, 1.8, 2.6, 3, 5, 7, 9])


def test_windows_are_scaled_and_begin_at_their_measured_rates():
    data = data_of(TWO, THREE, step=0.5, rates=[[2.0], [-1.0]])
    frozen = {"lags": 2, "stride": 2, "center": [[1.0], [4.0]], "scale": [[2.0], [0.5]]}
    (y, u), (z, v) = baselines.scaled_windows(frozen, data, data.measured)
    # predictions are 1 s apart: (0 - 1) / 2 less one or two times 2 / 2
    assert y[:, 0].tolist() == [-2.5, -1.5, -0.5, 1.0]
    assert u[:, 0].tolist() == [-6, -6, -6, 0]
    assert z[:, 0].tolist() == [1.5, 1.0, 0.5, -0.5]
    assert v[:, 0].tolist() == [2, 2, 2, 4]


FROZEN = {
    "center": [[1.0], [4.0]],
    "scale": [[2.0], [5.0]],
    "spread": [0.5],
    "biases": [[0.1, -0.2], [0.05]],
}
NARX = FROZEN | {
    "lags": 2,
    "stride": 1,
    "weights": [[[0.5, -0.1], [-0.3, 0.2], [0.4, 0.6], [0.1, -0.5], [-0.2, 0.3]], [[0.7], [-0.4]]],
}


def by_hand(u, first, rate, step):
    """Outputs of NARX over one window: increments from the past outputs and inputs, of which the first is known."""
    hidden, output = (np.array(one) for one in NARX["weights"])
    u = [(x - 4) / 5 for x in u]
    u = [u[0], u[0], *u]
    y = [(first - 1) / 2 - k * rate * step / 2 for k in (2, 1, 0)]
    for k in range(3, len(u)):
        neurons = np.tanh(np.array([y[k - 1], y[k - 2], u[k], u[k - 1], u[k - 2]]) @ hidden + [0.1, -0.2])
        y.append(float(np.clip(y[k - 1] + 0.5 * ((neurons @ output)[0] + 0.05), -4, 4)))
    return [2 * x + 1 for x in y[2:]]


def test_roll_out_of_a_network():
    data = data_of(TWO, THREE, step=0.5, rates=[[2.0], [-1.0]])
    expected = by_hand([1, 2, 4, 8], 0.0, 2.0, 0.5) + by_hand([5, 7, 6], 2.0, -1.0, 0.5)
    assert predict_baseline("narx", NARX, data)[:, 0] == pytest.approx(expected)
    assert expected[0] == 0.0  # the first sample is known


@pytest.mark.parametrize(("sign", "end"), [(1.0, 9.0), (-1.0, -7.0)])
def test_a_roll_out_stays_within_four_standard_deviations(sign, end):
    weights = [np.zeros((5, 2)).tolist(), [[0.0], [0.0]]]
    frozen = NARX | {"weights": weights, "biases": [[0.0, 0.0], [sign * 3.0]]}
    data = data_of([np.zeros((20, 1))], [np.zeros((20, 1))])
    assert predict_baseline("narx", frozen, data)[[1, 19], 0] == pytest.approx([sign * 3.0, end])


def test_between_predictions_a_roll_out_is_straight():
    weights = [np.zeros((5, 2)).tolist(), [[0.0], [0.0]]]
    frozen = NARX | {"stride": 2, "weights": weights, "biases": [[0.0, 0.0], [0.4]]}  # 0.4 per prediction
    data = data_of([np.zeros((6, 1))], [np.full((6, 1), 3.0)])
    assert predict_baseline("narx", frozen, data)[:, 0] == pytest.approx([3.0, 3.2, 3.4, 3.6, 3.8, 3.8])


def test_a_static_network_is_a_function_of_the_inputs():
    frozen = FROZEN | {"lags": 0, "stride": 1, "weights": [[[0.5, -0.1]], [[0.7], [-0.4]]]}
    u = (np.concatenate(TWO)[:, 0] - 4) / 5
    neurons = np.tanh([0.5 * u + 0.1, -0.1 * u - 0.2])
    y = 1 + 2 * 0.5 * (0.7 * neurons[0] - 0.4 * neurons[1] + 0.05)
    data = data_of(TWO, THREE)
    assert predict_baseline("network", frozen, data)[:, 0] == pytest.approx(y)
    rows = np.array([False, True, True, False, False, True, False])
    error = ((y - data.measured[:, 0]) / 2)[rows]
    assert baselines.roll_out_error(frozen, data, rows) == pytest.approx(np.mean(error**2))


class Regressor:
    """Stands in for the multilayer perceptron of scikit-learn."""

    made: list["Regressor"] = []  # noqa: RUF012 - all of a test

    def __init__(self, **options):
        self.options = options
        self.coefs_, self.intercepts_ = [np.zeros((1, 1)), np.ones((1, 1))], [np.zeros(1), np.array([2.0])]
        self.made.append(self)

    def fit(self, matrix, values):
        warnings.warn("it did not converge", self.warning, stacklevel=1)
        self.matrix, self.values = matrix, values


@pytest.fixture
def regressors(monkeypatch):
    """scikit-learn with a regressor that records what it is given."""
    package, exceptions, network = (ModuleType(f"sklearn{name}") for name in ("", ".exceptions", ".neural_network"))
    exceptions.ConvergenceWarning = type("ConvergenceWarning", (UserWarning,), {})
    network.MLPRegressor = Regressor
    monkeypatch.setattr(Regressor, "made", [])
    monkeypatch.setattr(Regressor, "warning", exceptions.ConvergenceWarning, raising=False)
    for module in (package, exceptions, network):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    return Regressor.made


COMMON = {"lags": 2, "stride": 1, "center": [[0.0], [0.0]], "scale": [[1.0], [1.0]]}


def test_a_network_is_trained_on_increments_of_complete_rows(regressors):
    """The first sample of a window is known, and before it the outputs lie on a line; row 2 of window 1 is left out."""
    u = [np.arange(10.0, 16.0)[:, None], np.arange(20.0, 23.0)[:, None]]
    y = [np.array([[0.0], [1.0], [3.0], [6.0], [10.0], [15.0]]), np.array([[5.0], [3.0], [-1.0]])]
    data = data_of(u, y, step=1.0, rates=[[1.0], [2.0]])
    rows = np.arange(9) != 2
    frozen = baselines.trained(COMMON, data, rows, 0.5)
    (made,) = regressors
    assert made.matrix.tolist() == [
        [0, -1, 11, 10, 10],
        [10, 6, 15, 14, 13],
        [5, 3, 21, 20, 20],
        [3, 5, 22, 21, 20],
    ]
    targets = np.array([1.0, 5.0, -2.0, -4.0])
    assert made.values == pytest.approx(targets / np.std(targets))
    assert made.options == {
        "hidden_layer_sizes": (baselines.HIDDEN,),
        "activation": "tanh",
        "solver": "lbfgs",
        "alpha": 0.5,
        "max_iter": baselines.ITERATIONS,
        "max_fun": 10**6,
        "random_state": 0,
    }
    assert frozen == COMMON | {
        "spread": [pytest.approx(np.std(targets))],
        "weights": [[[0.0]], [[1.0]]],
        "biases": [[0.0], [2.0]],
    }


def test_a_static_network_is_trained_on_the_outputs(regressors, monkeypatch):
    """Two outputs, of which one is constant; of more rows than allowed evenly spaced ones."""
    common = COMMON | {"lags": 0, "center": [[0.0, 0.0], [0.0]], "scale": [[1.0, 1.0], [1.0]]}
    y = np.stack([np.arange(9.0) ** 2, np.full(9, 4.0)], 1)
    data = data_of([np.arange(9.0)[:, None]], [y])
    monkeypatch.setattr(baselines, "ROWS", 5)
    frozen = baselines.trained(common, data, np.ones(9, bool), 1.0)
    (made,) = regressors
    assert made.matrix.tolist() == [[0], [2], [4], [6], [8]]
    spread = np.std([0.0, 4.0, 16.0, 36.0, 64.0])
    assert made.values == pytest.approx(y[::2] / [spread, 1.0])
    assert frozen["spread"] == pytest.approx([spread, 1.0])


BEST = {"narx": (4, 3, 0.1), "network": (0, 1, 0.1)}


@pytest.mark.parametrize("name", ["narx", "network"])
def test_memory_and_penalty_are_chosen_by_the_middle_third(regressors, monkeypatch, name):
    """Rows 0 and 10 do not count; of the nine others 4 to 6 are left out. One choice predicts them best."""
    data = data_of([np.zeros((11, 1))] * 4, [np.zeros((11, 1))] * 4, step=1.0)
    monkeypatch.setattr(baselines, "PREDICTIONS", 3)
    monkeypatch.setattr(baselines, "INTERVALS", (0.2, 1.0, 3.0))
    rows = (np.arange(44) > 0) & (np.arange(44) < 10)
    calls = []

    def train(common, _data, trained_rows, penalty):
        choice = (common["lags"], common["stride"], penalty)
        assert common == baselines.scales(data, rows, *choice[:2])
        calls.append((choice, np.flatnonzero(trained_rows).tolist()))
        return {"choice": choice}

    def error(frozen, _data, left_out):
        assert np.flatnonzero(left_out).tolist() == [4, 5, 6]
        return 1.0 if frozen["choice"] == BEST[name] else 2.0

    monkeypatch.setattr(baselines, "trained", train)
    monkeypatch.setattr(baselines, "roll_out_error", error)
    assert fit_baseline(name, data, rows) == {"choice": BEST[name]}
    *tried, last = calls
    assert last == (BEST[name], list(range(1, 10)))
    assert all(trained_rows == [1, 2, 3, 7, 8, 9] for _, trained_rows in tried)
    memories = [(lags, stride) for lags in (1, 2, 4) for stride in (1, 3)] if name == "narx" else [(0, 1)]
    assert [choice for choice, _ in tried] == [
        (*memory, penalty) for memory in memories for penalty in (1e-3, 0.1, 10.0)
    ]


def test_without_scikit_learn(monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn", None)
    with pytest.raises(TwinError, match=r"^baseline narx needs sklearn, .* pip install"):
        fit_baseline("narx", data_of(TWO, THREE), np.ones(7, bool))
