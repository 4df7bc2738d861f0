"""Parts of a forecast: held inputs, changed values, bounds, chances and quantiles, without a model."""

from types import SimpleNamespace

import numpy as np
import pytest

from twin.errors import SimulationError
from twin.follow import forecast
from twin.follow.forecast import Forecast, Forecaster, ForecastSettings


def settings(**values):
    defaults = {"horizon": 10, "interval": 4, "repeat": 1, "signals": ("a.x", "a.y"), "limits": {}, "planned": ()}
    return ForecastSettings(**defaults | {"draws": 3, "seed": 0} | values)


def forecaster(**attributes):
    own = object.__new__(Forecaster)
    own.settings = settings()
    vars(own).update(attributes)
    return own


@pytest.mark.parametrize(
    ("limits", "chances"),
    [
        ({}, [np.nan, np.nan]),
        ({"a.x": (0.0, 2.0)}, [0.0, np.nan]),  # at its limits it is within
        ({"a.x": (0.5, 2.0), "a.y": (-1.0, 1.5)}, [1 / 3, 1 / 3]),
        ({"a.x": (0.0, 1.5), "a.y": (5.0, 9.0)}, [2 / 3, 1.0]),
    ],
)
def test_chances_count_draws_that_leave_their_limits_at_any_time(limits, chances):
    x = [[0.0, 1.0, 2.0], [2.0, 1.0, 1.0]]  # of two times and three draws
    y = [[0.0, 0.0, 0.0], [0.0, 2.0, 1.0]]
    draws = np.stack([x, y], axis=2)
    np.testing.assert_allclose(forecaster(settings=settings(limits=limits)).chances(draws), chances)


def test_bands_are_quantiles_over_the_draws():
    draws = np.arange(101.0).reshape(1, 101, 1) * np.array([1.0, -2.0])
    found = Forecast(0.0, np.array([1.0]), ("a.x", "a.y"), draws, np.zeros(2)).bands
    np.testing.assert_allclose(found, [[[5.0, -190.0]], [[50.0, -100.0]], [[95.0, -10.0]]])


def test_inputs_are_held_unless_they_are_planned():
    """Those of a rig (here the fourth) are never planned; one that the case does not record stays as it is."""
    held = []
    inputs = [SimpleNamespace(column=name) for name in ("force", "speed", "missing")]
    case = SimpleNamespace(members=["recorded 1", "recorded 2", "recorded 4"])
    own = forecaster(
        settings=settings(planned=("speed",)),
        problem=SimpleNamespace(
            experiment=SimpleNamespace(inputs=inputs, case=case), keys=SimpleNamespace(inputs=range(4))
        ),
        batch=SimpleNamespace(hold=held.append),
    )
    own._hold_inputs()
    assert held == ["recorded 1", "recorded 4"]


def test_parameters_and_free_inputs_are_changed_in_all_copies(monkeypatch):
    kinds = {"a.k": "parameter", "a.u": "input", "a.fed": "input", "a.x": "output"}
    monkeypatch.setattr(
        forecast, "find", lambda name, _: SimpleNamespace(variable=SimpleNamespace(causality=kinds[name]))
    )
    changed = {}
    connections = [SimpleNamespace(target="a.fed")]
    own = forecaster(
        problem=SimpleNamespace(
            experiment=SimpleNamespace(catalog=None, case=SimpleNamespace(connections=connections))
        ),
        batch=SimpleNamespace(set_variable=changed.__setitem__),
    )
    own._override({"a.k": 2.0, "a.u": -1.0})
    for name in ("a.fed", "a.x"):
        with pytest.raises(SimulationError, match=rf"{name}: is no parameter and no unconnected input"):
            own._override({name: 1.0})
    assert changed == {"a.k": 2.0, "a.u": -1.0}


class Batch:
    """Copies of a model with one state that falls by a tenth in each step; what is done with it is kept."""

    def __init__(self, calls):
        self.calls, self.now = calls, 0

    def branch(self, source, numbers):
        self.calls.append(("branch", source, numbers))

    def write(self, points, sharing):
        assert sharing == 0
        self.points = points.copy()

    def advance(self, tick):
        self.calls.append(("advance", tick))
        self.points = self.points - 0.1

    def outputs(self, numbers):
        assert list(numbers) == [0, 1]
        return np.hstack([self.points, 2.0 * self.points])

    def read(self):
        return self.points.copy()


@pytest.mark.parametrize(("shares_memory", "sources"), [(True, [0, 0, 0]), (False, [0, 1, 0])])
def test_a_forecast_goes_in_intervals_to_its_horizon(shares_memory, sources):
    """From draws of the estimate; at the begin of each interval they walk, with the deviation of its length."""
    calls = []
    own = forecaster(
        batch=Batch(calls),
        problem=SimpleNamespace(experiment=SimpleNamespace(inputs=[]), keys=SimpleNamespace(inputs=())),
        _random=SimpleNamespace(standard_normal=np.ones),
        _walk=np.array([3.0]),
        _step=0.25,
        _begin=1.0,
        _override=lambda overrides: calls.append(("override", overrides)),
    )
    draws = np.array([[1.0], [2.0], [4.0]])
    filter_ = SimpleNamespace(
        shares_memory=shares_memory, count=2, low=-99.0, high=99.0, draw=lambda random, count: draws[:count]
    )
    found = own.forecast("source", filter_, 20, 10, {"a.k": 1.0})
    assert calls[0] == ("branch", "source", sources)
    assert [call[1] for call in calls[1:] if call[0] == "advance"] == [24, 28, 30]
    assert calls.count(("override", {"a.k": 1.0})) == 3
    assert (found.start, found.time.tolist(), found.signals) == (6.0, [7.0, 8.0, 8.5], ("a.x", "a.y"))
    walked, shorter = 3.0 * np.sqrt(4 * 0.25), 3.0 * np.sqrt(2 * 0.25)
    steps = np.array([-0.1 + walked, -0.2 + 2 * walked, -0.3 + 2 * walked + shorter])
    expected = draws[:, 0] + steps[:, None]
    np.testing.assert_allclose(found.draws, np.stack([expected, 2.0 * expected], axis=2))
    assert np.isnan(found.chance).all()
