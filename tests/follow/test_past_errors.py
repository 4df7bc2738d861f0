"""Widths of forecast bands from past errors: quantile, times, and a model that is wrong."""

import numpy as np
import pytest

from twin.errors import ScenarioError
from twin.follow import follow, load
from twin.follow.forecast import Forecast, PastErrors, widened

BAND = np.array([[[-1.0]], [[0.0]], [[2.0]]])  # low, median and high of one point and one signal


def errors_of(values, memory=1000, first=1):
    """Past errors of forecasts with the same band, one for each measured value, a step apart."""
    past = PastErrors(memory, {0: 0})
    past.measure(first - 1, 0, 0.0)
    for i, value in enumerate(values):
        past.add(np.array([first + i]), BAND)
        past.measure(first + i, 0, value)
    return past


def test_nine_errors_change_a_band_by_their_largest():
    values = [0.2, -0.1, 0.4, 6.0, -0.5, 1.0, 0.3, -2.0, 0.0]  # in half widths: at most 3, of 6 above the median
    assert errors_of(values[:8]).factors(9, 1, 1) == 1.0
    assert errors_of(values).factors(9, 1, 1) == 3.0


def test_ninety_percent_of_the_errors_are_within():
    values = 2.0 * np.linspace(0.01, 1.0, 100)
    factor = float(errors_of(values).factors(100, 1, 1)[0, 0])
    assert factor == pytest.approx(0.91)  # the 91st of 100: with the next one, 91 of 101 are within


def test_old_errors_are_forgotten():
    past = errors_of([20.0] * 20 + [2.0] * 20, memory=15)
    assert past.factors(40, 1, 1) == 1.0
    assert errors_of([20.0] * 20 + [2.0] * 20).factors(40, 1, 1) == 10.0


def test_a_measured_value_is_that_at_the_time_of_the_point():
    past = PastErrors(1000, {3: 0})
    for i in range(9):
        past.add(np.array([10 * i + 5]), BAND)
    for i in range(10):
        past.measure(10 * i, 3, 2.0 * (i % 2))  # 1 in the middle of each: half the upper half width
        past.measure(10 * i, 3, 50.0)  # repeated
        past.measure(10 * i - 7, 3, 50.0)  # late
        past.measure(10 * i, 1, 50.0)  # of another signal
    assert past.factors(90, 1, 1) == 0.5


def test_a_point_and_a_signal_have_errors_of_their_own():
    past = PastErrors(1000, {0: 0, 1: 1})
    bands = np.array([[[-1.0, -1.0]] * 2, [[0.0, 0.0]] * 2, [[1.0, 1.0]] * 2])
    for tick in range(20):
        past.add(np.array([tick + 1, tick + 5]), bands)
        past.measure(tick, 0, 3.0)
        past.measure(tick, 1, -0.5)
    found = past.factors(20, 3, 2)
    np.testing.assert_array_equal(found, [[3.0, 0.5], [3.0, 0.5], [1.0, 1.0]])


def test_what_is_never_measured_takes_no_memory():
    past = PastErrors(10, {0: 0, 1: 1})
    for tick in range(200):
        past.add(np.array([tick + 3]), np.zeros((3, 1, 2)))
        past.measure(tick, 0, 1.0)
    assert len(past._due) < 20
    assert past.factors(200, 1, 2).tolist() == [[1.0, 1.0]]  # a band without width is not widened


def test_draws_are_moved_away_from_their_median():
    draws = np.array([[[1.0], [2.0], [4.0]], [[0.0], [0.0], [1.0]]])
    found = widened(Forecast(0.0, np.array([1.0, 2.0]), ("a.x",), draws, np.zeros(1)), np.array([[2.0], [0.5]]))
    np.testing.assert_array_equal(found[:, :, 0], [[0.0, 2.0, 6.0], [0.0, 0.0, 0.5]])


TEXT = """
component: "tests.follow.parts:Mass"
step: 50 ms
data: data.csv
outputs: {"position [m]": {signal: Mass.y, noise: 1 mm}}
estimate: {Mass.x: {deviation: 1 m, walk: 1 mm}, Mass.v: {deviation: 1, walk: 0.01}}
forecast: {horizon: 200 ms, every: 100 ms, interval: 200 ms, signals: [Mass.y], draws: 100}
"""


def share(folder, build, text):
    """The share of bands that hold the measured value, from 3 s on."""
    (folder / "mass.yaml").write_text(text)
    inside = []
    estimates = list(follow(load(folder / "mass.yaml"), build))
    measured = {round(one.time, 3): float(one.measured[0]) for one in estimates}
    for one in estimates:
        if one.forecast is not None and one.time > 3.0 and (end := round(float(one.forecast.time[-1]), 3)) in measured:
            low, _, high = one.forecast.bands[:, -1, 0]
            inside.append(low <= measured[end] <= high)
    return np.mean(inside)


def test_bands_of_a_model_that_is_too_certain_are_widened(tmp_path, build):
    """The mass is pushed, which the model does not know."""
    time = np.arange(0.0, 40.0, 0.05)
    position = (
        np.sin(1.3 * time) + 0.3 * np.sin(4.0 * time) + 0.01 * np.random.default_rng(1).standard_normal(len(time))
    )
    rows = [f"{t:.2f},{x:.6f}" for t, x in zip(time, position, strict=True)]
    (tmp_path / "data.csv").write_text("\n".join(["time [s],position [m]", *rows]) + "\n")
    assert share(tmp_path, build, TEXT) < 0.1
    assert 0.85 < share(tmp_path, build, TEXT.replace("draws: 100", "draws: 100, calibrate: 10 s")) < 0.95


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("calibrate: 70 ms", "70 ms is no multiple of the communication step of 50 ms"),
        ("calibrate: 0 s", "expected a time above zero, not 0 s"),
        ("calibrate: 1 s, signals: [Mass.v]", "none of the signals is measured"),
    ],
)
def test_bad_times(tmp_path, key, message):
    (tmp_path / "data.csv").write_text("time [s],position [m]\n0,0\n0.05,1\n0.1,2\n")
    text = TEXT.replace("signals: [Mass.y], draws: 100", key if "signals" in key else f"signals: [Mass.y], {key}")
    (tmp_path / "mass.yaml").write_text(text)
    with pytest.raises(ScenarioError, match=message):
        load(tmp_path / "mass.yaml")
