import numpy as np
import pytest
from fmus.weights.model import Weights
from fmus.weights.trials import over_diameter, over_pressure

GRAVITY = 9.80665
H = 10e-3
EXACT = {"increment_scatter": 0.0}


def held(weights, seconds, limit=np.inf, stiffness=4e3, reading="position", begin=0.0, slip=0.1e-3):
    """Loads and forces on a spring that gives way, 0.1 mm per step or what is told, beyond a limit."""
    rows, slipped = [], 0.0
    for step in range(round(seconds / H)):
        assert weights.advance(begin + step * H, H) == 0
        force = -float(weights.tip_force)
        slipped += slip if force > limit else 0.0
        setattr(weights, reading, force / stiffness + slipped)
        rows.append((float(weights.load), force, int(weights.state)))
    return np.array(rows)


def test_adds_weight_by_weight():
    weights = Weights(**EXACT)
    weights.start(0.0)
    load, force, state = held(weights, 6.0).T
    steps = np.unique(load)
    assert steps[1:] / GRAVITY == pytest.approx(0.1 + 0.05 * np.arange(len(steps) - 1))
    assert len(steps) == 11  # none for 1 s, then one in 0.5 s
    assert np.all(state == 1)
    assert np.all(force <= 0.99 * load + 1e-12)
    assert np.abs(np.diff(force)).max() < 0.1 * GRAVITY * H / 0.2 * 1.01  # let down, not dropped


def test_elastic_motion_is_not_taken_for_slip():
    weights = Weights(**EXACT)
    weights.start(0.0)
    assert held(weights, 20.0, stiffness=300.0)[-1, 2] == 1
    assert weights.slip_load == 0.0


def test_finds_the_load_that_slips():
    weights = Weights(**EXACT)
    weights.start(0.0)
    rows = held(weights, 20.0, limit=10.0)
    assert weights.held_load * 0.99 <= 10.0 < weights.slip_load * 0.99
    assert weights.slip_load - weights.held_load == pytest.approx(0.05 * GRAVITY)
    assert weights.slip_torque == pytest.approx(0.02 * weights.slip_load)
    assert weights.trial == 1

    # taken off after the reaction time, and not touched again
    seen = rows[:, 2] == 2
    assert seen.sum() * H == pytest.approx(0.3)
    assert np.all(rows[np.flatnonzero(seen)[-1] + 1 :, 1] == 0.0)
    assert weights.state == 3


def test_rotation_is_seen_too():
    weights = Weights(**EXACT)
    weights.start(0.0)
    held(weights, 20.0, limit=10.0, stiffness=1e3, reading="angle")
    assert weights.state == 1  # 0.1 mrad per step is 3 mrad in the time of looking
    weights = Weights(visible_angle=2e-3, **EXACT)
    weights.start(0.0)
    held(weights, 20.0, limit=10.0, stiffness=1e3, reading="angle")
    assert weights.trial == 1


@pytest.mark.parametrize(("reading", "slip"), [("position", 2e-3), ("angle", 0.1)])
def test_box_stands_on_the_table_after_its_clearance(reading, slip):
    weights = Weights(**EXACT)
    weights.start(0.0)
    rows = held(weights, 20.0, limit=10.0, stiffness=1e4, reading=reading, slip=slip)
    assert (rows[:, 2] == 2).sum() * H < 0.15
    assert weights.trial == 1
    assert rows[-1, 1] == 0.0


def test_each_rise_of_loading_is_a_trial():
    weights = Weights(**EXACT)
    weights.start(0.0)
    held(weights, 20.0, limit=5.0)
    weights.loading = False
    held(weights, 0.1, begin=20.0)
    assert weights.state == 0
    weights.loading = True
    held(weights, 20.0, limit=10.0, begin=20.1)
    assert weights.trial == 2
    assert weights.slip_load == pytest.approx(10.0 / 0.99, abs=0.05 * GRAVITY)


@pytest.mark.slow
def test_weights_scatter_with_the_seed():
    found = []
    for seed in (1, 2):
        weights = Weights(seed=seed)
        weights.start(0.0)
        found.append(np.diff(np.unique(held(weights, 30.0)[:, 0])[1:]) / GRAVITY)
    assert not np.allclose(*found)
    for steps in found:
        assert np.mean(steps) == pytest.approx(0.05, rel=0.05)
        assert np.std(steps) == pytest.approx(0.005, rel=0.4)


def test_trials_become_a_curve():
    trial = np.repeat([0, 1, 2, 3], 5)
    pressure = np.repeat([2e5, 2e5, 0.0, 4e5], 5)  # of the trial that the next step ends
    load = np.repeat([0.0, 6.0, 1.0, 10.0], 5)
    found = over_pressure(pressure, load, trial)
    assert found["pressure"].shape == found["load"].shape == trial.shape
    assert found["load"] == pytest.approx(np.interp(found["pressure"], [0.0, 2e5, 4e5], [1.0, 6.0, 10.0]))
    assert found["least"] == 2e5  # nothing was tried between 0 and that: a piston that its seals hold does not close
    found = over_diameter(pressure * 1e-8, load, trial)
    assert found["thinnest"] == pytest.approx(2e-3)
    assert found["thickest"] == pytest.approx(4e-3)
    too_thick = np.where(pressure == 4e5, 1.0, load)
    assert over_diameter(pressure * 1e-8, too_thick, trial)["thickest"] == pytest.approx(2e-3)


def test_no_trial_gives_no_curve():
    nothing = np.zeros(10)
    assert np.isnan(over_pressure(nothing, nothing, nothing)["load"]).all()
    assert np.isnan(over_diameter(nothing, nothing, nothing)["thinnest"])


def test_compiled_is_the_interpreted_to_the_bit(native):
    """The standard trajectory ends before the first weight: this one has weights, slip and a second trial."""
    found = []
    for make in (Weights, native):
        weights = make() if make is Weights else make(Weights)
        weights.start(0.0)
        rows = [held(weights, 10.0, limit=5.0)]
        weights.loading = False
        rows.append(held(weights, 0.1, begin=10.0))
        weights.loading = True
        rows.append(held(weights, 10.0, limit=5.0, begin=10.1))
        found.append(np.concatenate(rows))
    np.testing.assert_array_equal(*found)
    assert found[0].max() > 5.0
