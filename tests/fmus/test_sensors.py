import numpy as np
import pytest
from fmus.em_tracker.model import EMTracker
from fmus.force_sensor.model import ForceSensor
from fmus.heart_estimate.model import HeartEstimate

from twin.component import ERROR


def sampled(member, output, count, h):
    member.start(0.0)
    values = np.empty(count)
    for step in range(count):
        assert member.advance(step * h, h) == 0
        values[step] = getattr(member, output)
    return values


def test_force_is_noisy_and_rounded(native):
    values = sampled(
        native(ForceSensor, force=0.2, zero_deviation=0.0, drift_maximum=0.0), "measured_force", 20000, 5e-3
    )
    np.testing.assert_allclose(values * 320.0, np.round(values * 320.0), atol=1e-9)
    assert values.mean() == pytest.approx(0.2, abs=2e-4)
    assert values.std() == pytest.approx(np.hypot(3e-3, 1 / 320 / np.sqrt(12)), rel=0.03)


def test_force_is_published_one_period_later():
    sensor = ForceSensor(force=0.1, noise=0.0, zero_deviation=0.0, drift_maximum=0.0)
    sensor.start(0.0)
    sensor.force = 0.2
    for step in range(5):
        assert sensor.measured_force == pytest.approx(0.1)
        sensor.advance(step * 1e-3, 1e-3)
    assert sensor.measured_force == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("cls", "output"),
    [(ForceSensor, "measured_force"), (EMTracker, "measured_position"), (HeartEstimate, "estimated_position")],
)
def test_noise_depends_on_the_seed_alone(native, cls, output):
    member = native(cls, seed=7)
    h = cls.period
    first = sampled(member, output, 50, h)
    np.testing.assert_array_equal(first, sampled(member, output, 50, h))
    assert not np.array_equal(first, sampled(native(cls, seed=8), output, 50, h))


def test_tracker_compares_signals_of_one_instant(native):
    tracker = native(EMTracker, position=1e-3, reference=3e-3)
    values = sampled(tracker, "difference", 4000, 25e-3)
    assert values.mean() == pytest.approx(2e-3, abs=2e-5)
    assert values.std() == pytest.approx(0.2e-3, rel=0.05)
    assert tracker.sampled_reference == 3e-3


def test_estimate_is_late_by_its_latency():
    estimate = HeartEstimate(noise=0.0)
    estimate.start(0.0)
    found = []
    for step in range(100):
        estimate.position = 1e-3 * step
        estimate.advance(step * 1e-3, 1e-3)
        found.append(float(estimate.estimated_position))

    # found[k] is published at (k + 1) ms
    np.testing.assert_allclose(found[30:], 1e-3 * (np.arange(31, 101) - 11), rtol=1e-12)


@pytest.mark.slow
def test_estimate_error_is_smooth_and_of_the_given_size(native):
    values = sampled(native(HeartEstimate), "estimated_position", 300_000, 1e-3)[3000:]
    assert values.std() == pytest.approx(0.5e-3, rel=0.15)

    # a second-order error of 1 Hz has a rate of w times its size
    assert np.diff(values).std() / 1e-3 == pytest.approx(2 * np.pi * values.std(), rel=0.1)


@pytest.mark.parametrize("latency", [0.2e-3, 66e-3])
def test_estimate_refuses_a_latency_it_cannot_hold(latency):
    estimate = HeartEstimate(latency=latency)
    estimate.start(0.0)
    assert estimate.advance(0.0, 1e-3) == ERROR
