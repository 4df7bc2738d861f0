"""Simple models: their features, and fits that find the model from which the data are."""

import numpy as np
import pytest

from tests.validation.arrays import data_of
from twin.errors import TwinError
from twin.validation.baselines import (
    features,
    fit_baseline,
    least_squares,
    plays,
    polynomial,
    predict_baseline,
    second_order,
)

INPUTS = np.array([[2.0, 3.0], [-1.0, 5.0]])
SINES = np.stack([2 * np.sin(np.arange(60) / 5), np.cos(np.arange(60) / 7)], 1)


@pytest.mark.parametrize(
    ("degree", "cross", "columns"),
    [
        (1, False, [[1, 2, 3], [1, -1, 5]]),
        (1, True, [[1, 2, 3, 6], [1, -1, 5, -5]]),
        (2, True, [[1, 2, 3, 4, 9, 6], [1, -1, 5, 1, 25, -5]]),
        (3, False, [[1, 2, 3, 4, 9, 8, 27], [1, -1, 5, 1, 25, -1, 125]]),
    ],
)
def test_terms_of_a_polynomial(degree, cross, columns):
    assert polynomial(INPUTS, degree, cross=cross).tolist() == columns


def test_products_of_three_inputs():
    assert polynomial(np.array([[2.0, 3.0, 5.0]]), 1, cross=True).tolist() == [[1, 2, 3, 5, 6, 10, 15]]


def test_a_play_follows_at_its_half_width():
    """Half widths of 0.5 to 4 for a span of 9; each begins at rest at the first value."""
    window = np.array([[0.0, 7.0], [3.0, 7.0], [0.0, 7.0], [-3.0, 9.0]])
    outputs = plays(window, [9.0, 18.0])
    assert outputs.shape == (4, 16)
    assert outputs[:, :8].tolist() == [
        [0.0] * 8,
        [2.5, 2.0, 1.5, 1.0, 0.5, 0.0, 0.0, 0.0],
        [0.5, 1.0, 1.5, 1.0, 0.5, 0.0, 0.0, 0.0],
        [-2.5, -2.0, -1.5, -1.0, -0.5, 0.0, 0.0, 0.0],
    ]
    assert outputs[:3, 8:].tolist() == [[7.0] * 8] * 3
    assert outputs[3, 8:].tolist() == [8.0] + [7.0] * 7


def test_features_of_each_baseline():
    """Plays begin anew with each window; features lie at the samples, here between two rows."""
    data = data_of([INPUTS[:, :1], INPUTS[:, 1:]], [[[0.0], [0.0]]] * 2)
    u = [2.0, -1.0, 3.0, 5.0]
    assert features("line", data, []).tolist() == [[1, x] for x in u]
    assert features("quadratic", data, []).tolist() == [[1, x, x**2] for x in u]
    assert features("cubic", data, []).tolist() == [[1, x, x**2, x**3] for x in u]
    of_plays = features("play_cubic", data, [3.6])  # half widths 0.2 to 1.6
    assert of_plays[:, :4].tolist() == features("cubic", data, []).tolist()
    half = 0.2 * np.arange(1, 9)
    assert of_plays[:, 4:] == pytest.approx(np.array([[2.0] * 8, -1.0 + half, [3.0] * 8, 5.0 - half]))
    data.weight[:] = [0.25, 0.0, 0.5, 0.0]
    assert features("line", data, [])[:, 1].tolist() == [1.25, -1.0, 4.0, 5.0]


def test_coefficients_of_a_linear_model():
    """A column of zeros has no part; two equal columns share theirs."""
    u = np.arange(1.0, 6.0)
    matrix = np.stack([np.ones(5), u, np.zeros(5), 1e6 * u], 1)
    assert least_squares(matrix[:, :3], np.stack([2 + 3 * u, -u], 1)) == pytest.approx(
        np.array([[2, 0], [3, -1], [0, 0]]), abs=1e-6
    )
    assert least_squares(matrix[:, [1, 3]], 4 * u[:, None])[:, 0] == pytest.approx([2.0, 2e-6], rel=1e-6)


def test_a_second_order_system_is_its_recursion():
    """y[k] = a1 y[k-1] + a2 y[k-2] + b u[k] + c, each window from its first value and rate."""
    windows, measured = [SINES[:5], SINES[5:6], SINES[6:9]], [np.full((n, 2), x) for n, x in ((5, 1), (1, 2), (3, -4))]
    data = data_of(windows, measured, step=0.5, rates=[[9, 2], [9, 3], [9, -1]])
    a1, a2, c, b = 1.2, -0.5, 0.3, np.array([0.7, -0.2])
    expected = []
    for window, first, rate in zip(windows, (1, 2, -4), (2, 3, -1), strict=True):
        y = [first - 0.5 * rate, first]
        for u in window[1:]:
            y.append(a1 * y[-1] + a2 * y[-2] + b @ u + c)
        expected += y[1:]
    assert second_order(data, np.array([a1, a2, c, *b]), 1) == pytest.approx(np.array(expected))


def test_a_second_order_system_is_found():
    """Natural frequency 9 rad/s, damping 0.6: from half of the rows the others are predicted."""
    step, w, d = 0.02, 9.0, 0.6
    decay, turn = np.exp(-d * w * step), w * np.sqrt(1 - d**2) * step
    a1, a2 = 2 * decay * np.cos(turn), -(decay**2)
    coefficients = np.array([a1, a2, 0.01, 0.03, -0.02])
    windows = [np.concatenate([SINES, 1.5 * SINES[::-1]])]
    data = data_of(windows, [np.full((120, 1), 0.4)], step=step, rates=[[1.0]])
    data.measured[:, 0] = second_order(data, coefficients, 0)
    rows = np.arange(120) < 60
    frozen = fit_baseline("linear_second_order", data, rows)
    assert frozen == {"coefficients": [pytest.approx(coefficients, abs=1e-4)]}
    assert predict_baseline("linear_second_order", frozen, data) == pytest.approx(data.measured, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "function", "coefficients"),
    [
        ("line", lambda u, v: 1 + 2 * u - v, [1, 2, -1]),
        ("quadratic", lambda u, v: 1 + u - 3 * v**2 + 4 * u * v, [1, 1, 0, 0, -3, 4]),
        ("cubic", lambda u, v: u**2 - 2 * v**3, [0, 0, 0, 1, 0, 0, -2]),
    ],
)
def test_a_polynomial_is_found_from_some_rows(name, function, coefficients):
    u, v = SINES.T
    y = function(u, v)
    data = data_of([SINES[:25], SINES[25:]], [np.stack([y, -y], 1)[:25], np.stack([y, -y], 1)[25:]])
    data.measured[:10] += 5.0
    rows = np.arange(60) >= 10
    frozen = fit_baseline(name, data, rows)
    assert frozen["spans"] == pytest.approx([u.max() - u.min(), v.max() - v.min()])
    assert np.array(frozen["coefficients"]) == pytest.approx(
        np.array([coefficients, np.negative(coefficients)]), abs=1e-5
    )
    assert predict_baseline(name, frozen, data)[10:] == pytest.approx(data.measured[10:], abs=1e-5)


def test_plays_are_found():
    """A play of a third of the span, and nothing else: no polynomial follows it."""
    window = SINES[:, :1] * np.linspace(1, 0.3, 60)[:, None]
    span = float(np.ptp(window))
    own = plays(window, [span])[:, 5:6]  # half width 6 / 18 of the span
    data = data_of([window], [own])
    frozen = fit_baseline("play_cubic", data, np.ones(60, bool))
    assert predict_baseline("play_cubic", frozen, data) == pytest.approx(own, abs=1e-5)
    frozen = fit_baseline("cubic", data, np.ones(60, bool))
    assert np.max(np.abs(predict_baseline("cubic", frozen, data) - own)) > 0.1


def test_baselines_learn_the_frame_and_the_start_from_the_first_sample():
    """The frame of the second window is turned in its first output, and both windows begin elsewhere."""
    u = np.linspace(0.0, 2.0, 9)[:, None]
    y = np.hstack([1.0 + 3.0 * u, 2.0 - u, 0.5 * u])
    measured = [y, y * [-1.0, 1.0, 1.0] + [0.1, 0.2, -0.3]]
    data = data_of([u, u], measured, turned=(0,), files=[0, 1])
    frozen = fit_baseline("line", data, data.window_index == 0)
    assert predict_baseline("line", frozen, data) == pytest.approx(data.measured, abs=1e-6)
    plain = data_of([u, u], measured, files=[0, 1])
    with pytest.raises(TwinError, match="was fitted with the key `turned`"):
        predict_baseline("line", frozen, plain)
    without = predict_baseline("line", fit_baseline("line", plain, plain.window_index == 0), plain)
    assert np.max(np.abs(without - plain.measured)) > 5.0


def test_a_network_of_plays_knows_hysteresis():
    """A static map of the input alone cannot tell the branches of a loop apart."""
    pytest.importorskip("sklearn")
    u = 2 * np.sin(np.arange(400) / 20)[:, None]
    y = plays(u, [4.0])[:, 4:5]
    data = data_of([u], [y])
    rows = np.ones(400, bool)
    errors = {}
    for name in ("network", "play_network"):
        predicted = predict_baseline(name, fit_baseline(name, data, rows), data)
        errors[name] = np.sqrt(np.mean((predicted - data.measured)[50:] ** 2))
    assert errors["play_network"] < 0.2 * errors["network"]
