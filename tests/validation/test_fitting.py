"""Fits of a set to its data, and the correction of a run with its first third, on models that are formulas."""

import numpy as np
import pytest
from scipy import stats

from tests.validation.arrays import data_of
from tests.validation.model import GAIN, REST, Formula
from twin.identify import Unknown
from twin.validation.fitting import (
    SetPredictor,
    correction,
    first_third,
    fit,
    refit,
    rezeroed,
    weighted_residuals,
)

U = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
ALL = np.ones(6, bool)


def measured(rest=1.0, gain=2.0, errors=0.0):
    return data_of([U[:, None]], [np.stack([rest + gain * U + errors, U, -U], 1)])


def test_first_third_of_each_file():
    """Of 7, 2 and 1 rows 2, 1 and 1; windows of a file count together."""
    data = data_of(
        [np.zeros((n, 1)) for n in (4, 3, 2, 1)], [np.zeros((n, 1)) for n in (4, 3, 2, 1)], files=[0, 0, 1, 2]
    )
    assert np.flatnonzero(first_third(data)).tolist() == [0, 1, 7, 9]


def test_a_noise_is_a_difference_of_temperatures():
    own = Formula([GAIN])
    own.units["angle"], own.keys.outputs["a"].noise = "K", "0.1 degC"
    noise = SetPredictor(own, measured(), [GAIN], U > 2, {}).problem.outputs[0].noise
    assert noise == pytest.approx(0.1)


def test_what_is_compared_are_the_chosen_rows_of_each_output():
    own = Formula([REST, GAIN])
    own.keys.outputs["x"].noise = "2 mm"
    predictor = SetPredictor(own, measured(errors=0.5), [GAIN], U > 2, {"rest": 0.0})
    a, x, y = predictor.problem.outputs
    assert [one.values.tolist() for one in (a, x, y)] == [[7.5, 9.5, 11.5], [3, 4, 5], [-3, -4, -5]]
    assert a.time == pytest.approx([0.3, 0.4, 0.5])
    assert [one.noise for one in (a, x, y)] == [None, 0.002, None]
    assert [(one.column, one.signal, one.unit, one.delay, one.offset) for one in (a, x)] == [
        ("a", "angle", "rad", 0.0, 0.0),
        ("x", "tip_x", "m", 0.0, 0.0),
    ]
    first, *_ = predictor.predicted(np.array([0.5]))  # the middle of a logarithm from 0.5 to 8 is 2
    assert first == pytest.approx([6, 8, 10])
    assert predictor.slopes(np.array([0.5])) is None
    assert (predictor.count, predictor.refused, predictor.compared, predictor.used) == (1, "", False, False)


def test_residuals_are_weighted_by_what_they_are_at_first():
    """As stated, else their root mean square; 1 if they vanish."""
    own = Formula([REST])
    own.keys.outputs["y"].noise = "3 m"
    predictor = SetPredictor(own, measured(errors=np.array([0, 3, -3, 3, 0, 3])), [REST], ALL, {"gain": 2.0})
    assert weighted_residuals(predictor, np.array([REST.position(1.0)])).sigmas == [pytest.approx(np.sqrt(6)), 1.0, 3.0]


def test_a_fit_finds_values_and_their_intervals():
    """With one output that is not exact; the interval of a logarithm is that of its place."""
    errors = 0.01 * np.array([1, -1, -1, 1, 1, -1])
    own, data = Formula([REST]), measured(rest=0.7, gain=1.0, errors=errors)
    steps = []
    fitted = fit(own, data, ALL, starts=2, seed=1, progress=lambda *step: steps.append(step))
    mean = 0.7 + np.mean(errors)
    assert list(fitted) == ["rest"]
    assert fitted["rest"]["value"] == pytest.approx(mean, abs=1e-6)
    low, high = fitted["rest"]["interval"]
    assert (low + high) / 2 == pytest.approx(mean, abs=1e-6)
    assert 0.0 < high - low < 0.1
    assert fitted["rest"]["unit"] == "rad"
    assert len(steps) > 4
    assert steps[0][:2] == ("first guess", 0.0)
    own = Formula([GAIN])
    fitted = fit(own, measured(rest=0.5, gain=4.0, errors=errors), ALL, starts=1, seed=0, progress=lambda *_: None)
    value, (low, high) = fitted["gain"]["value"], fitted["gain"]["interval"]
    assert value == pytest.approx(4.0, abs=0.01)
    assert low < value < high
    assert low * high == pytest.approx(value**2)  # even on a logarithmic scale
    assert fit(Formula(), data, ALL, starts=1, seed=0, progress=lambda *_: None) == {}


def test_intervals_end_at_the_bounds():
    errors = np.array([30, -30, -30, 30, 30, -30])
    fitted = fit(Formula([REST]), measured(errors=errors), ALL, starts=1, seed=0, progress=lambda *_: None)
    assert fitted["rest"]["interval"] == [-1.0, 3.0]


def test_a_fold_is_fitted_to_the_other_rows():
    data = measured(errors=np.where(U < 2, 50.0, 0.0))
    found = refit(Formula([REST, GAIN]), data, U >= 2, {"rest": 0.4, "gain": 3.0})
    assert found == {"rest": pytest.approx(1.0, abs=1e-5), "gain": pytest.approx(2.0, abs=1e-5)}
    assert refit(Formula(), data, U >= 2, {}) == {}


@pytest.mark.parametrize(("frozen", "valley"), [(1.0, -1.0), (-9.0, 1.0)])
def test_a_correction_is_searched_in_each_half_of_its_bounds(frozen, valley):
    """(p^2 - 1)^2 has valleys at -1 and 1; a second output says which one is meant."""
    own = Formula(
        rezero=[Unknown("rest", "rad", -2.0, 2.0, 0.0, member="model", variable="rest")],
        function=lambda u, v: np.stack([0 * u + (v["rest"] ** 2 - 1) ** 2, 0 * u + v["rest"], -u], 1),
    )
    data = data_of([U[:, None]], [np.stack([0 * U, np.where(U < 2, valley, 90.0), -U], 1)])
    assert correction(own, data, {"rest": frozen}) == {"rest": pytest.approx(valley, abs=1e-4)}
    assert correction(Formula(), data, {"rest": frozen}) == {}


def test_a_run_is_corrected_with_its_first_third():
    """Values in `rezero` are looked for; the others stay as frozen. The last two thirds have no influence."""
    data = measured(rest=1.5, errors=np.where(U < 2, 0.0, 7.0))
    predicted, corrected = rezeroed(Formula(rezero=[REST]), data, {"rest": 1.0, "gain": 2.0})
    assert corrected == {"rest": pytest.approx(1.5, abs=1e-5)}
    assert predicted[:, 0] == pytest.approx(1.5 + 2 * U, abs=1e-5)
    # a start value of the model where nothing is frozen
    assert rezeroed(Formula(rezero=[REST]), data, {"gain": 2.0})[1] == {"rest": pytest.approx(1.5, abs=1e-5)}


def test_without_anything_to_correct_the_mean_error_is_taken_off():
    data = measured(errors=np.array([0.2, 0.4, 9, 9, 9, 9]))
    predicted, corrected = rezeroed(Formula(), data, {"rest": 1.0, "gain": 2.0})
    assert corrected == {}
    assert predicted == pytest.approx(np.stack([1.3 + 2 * U, U, -U], 1))


def test_a_correction_that_cannot_be_simulated_is_left_out(monkeypatch):
    monkeypatch.setattr("twin.validation.fitting.correction", lambda *_: {"rest": 2.5})
    own = Formula(rezero=[REST], fails=lambda values: values["rest"] == 2.5)
    data = measured(errors=np.array([0.2, 0.4, 9, 9, 9, 9]))
    predicted, corrected = rezeroed(own, data, {"rest": 1.0, "gain": 2.0})
    assert corrected == {}
    assert predicted[:, 0] == pytest.approx(1.3 + 2 * U)


def test_the_interval_of_a_fit_is_students():
    """One unknown, three outputs of six values each, of which the first has errors."""
    errors = 0.01 * np.array([1, -1, -1, 1, 1, -1])
    own = Formula([REST])
    for keys in own.keys.outputs.values():
        keys.noise = "0.01"
    low, high = fit(own, measured(gain=1.0, errors=errors), ALL, starts=1, seed=0, progress=lambda *_: None)["rest"][
        "interval"
    ]
    assert (high - low) / 2 == pytest.approx(stats.t.ppf(0.975, 17) * 0.01 / np.sqrt(6), rel=1e-4)
