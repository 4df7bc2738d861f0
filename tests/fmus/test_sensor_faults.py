"""Errors and faults of EM tracker and force sensor: off they change nothing, on they do what they say."""

import numpy as np
import pytest
from fmus.em_tracker.model import EMTracker
from fmus.force_sensor.model import ForceSensor

from fmus.gratings import DEGRADED, LOST, VALID
from twin.component import ERROR

STILL = {"noise": 0.0, "resolution": 1e-9, "zero_deviation": 0.0, "drift_maximum": 0.0}  # a sensor without errors


def stepped(member, count, change=None):
    member.start(0.0)
    h = member.period
    for step in range(count):
        if change:
            change(member, step)
        assert member.advance(step * h, h) == 0
        yield member


def test_metal_bends_the_field_most_where_it_is_nearest():
    def error(position):
        tracker = EMTracker(position=position, noise=0.0, distortion=2e-3, metal_position=0.03, metal_distance=0.05)
        tracker.start()
        return tracker.measured_position - position

    assert error(0.03) == pytest.approx(2e-3)
    assert error(0.08) == pytest.approx(2e-3 / 2**1.5)
    assert error(0.03 + 0.5) < 0.01e-3


def test_a_lost_sample_stands_and_is_told(native):
    def blind(tracker, step):
        tracker.position = 1e-3 * step
        tracker.blind = 3 <= step < 13

    found = [
        (int(one.status), int(one.missed), float(one.measured_position))
        for one in stepped(native(EMTracker, noise=0.0), 15, blind)
    ]
    states, missed, positions = zip(*found, strict=True)
    assert states == (VALID,) * 3 + (DEGRADED,) * 4 + (LOST,) * 6 + (VALID,) * 2
    assert missed == (0, 0, 0, *range(1, 11), 0, 0)
    assert positions[3:13] == (pytest.approx(2e-3),) * 10
    assert positions[13] == pytest.approx(13e-3)


def test_losses_are_as_many_as_asked_and_the_noise_is_no_other_without(native):
    lost = [int(one.missed) > 0 for one in stepped(native(EMTracker, loss=0.2), 4000)]
    assert np.mean(lost) == pytest.approx(0.2, abs=0.02)
    plain = [float(one.measured_position) for one in stepped(native(EMTracker), 50)]
    assert len(set(plain)) == 50


def test_the_force_drifts_and_follows_the_temperature(native):
    sensor = native(ForceSensor, force=0.2, **STILL, drift=1e-3, temperature_sensitivity=5e-3)
    values = [float(one.measured_force) for one in stepped(sensor, 2001)]
    assert values[-1] == pytest.approx(0.2 + 1e-3 * 10.0, abs=1e-8)
    sensor.temperature = 295.15
    sensor.start()
    assert sensor.measured_force == pytest.approx(0.21, abs=1e-8)


@pytest.mark.slow
def test_zero_error_and_drift_are_drawn_once_per_run(native):
    """Each seed is another run: a zero error and a drift rate of the distributions that are stated."""
    zeros, drifts = [], []
    for seed in range(1, 401):
        sensor = native(ForceSensor, force=0.2, seed=seed, noise=0.0, resolution=1e-9)
        sensor.start(0.0)
        zeros.append(float(sensor.measured_force) - 0.2)
        assert sensor.advance(60.0, 5e-3) == 0
        drifts.append(float(sensor.measured_force) - 0.2 - zeros[-1])
    assert np.mean(zeros) == pytest.approx(0.0, abs=4e-4)
    assert np.std(zeros) == pytest.approx(2e-3, rel=0.1)
    assert np.std(drifts) == pytest.approx(10e-3 / np.sqrt(12), rel=0.1)  # in a minute
    assert np.abs(drifts).max() <= 5e-3 + 1e-9
    assert abs(np.corrcoef(zeros, drifts)[0, 1]) < 0.15


def test_zero_offset_is_a_fault_beyond_the_drawn_zero_error(native):
    sound, faulty = (native(ForceSensor, force=0.2, zero_offset=zero) for zero in (0.0, -0.15))
    difference = [
        float(b.measured_force) - float(a.measured_force)
        for a, b in zip(stepped(sound, 50), stepped(faulty, 50), strict=True)
    ]
    np.testing.assert_allclose(difference, -0.15, atol=1e-9)  # 48 steps of the resolution


def test_hysteresis_is_the_width_of_the_loop(native):
    def cycle(sensor, step):
        sensor.force = 0.3 - 0.2 * np.cos(2 * np.pi * step / 100)

    sensor = native(ForceSensor, **STILL, hysteresis=0.02)
    values = [float(one.measured_force) for one in stepped(sensor, 200, cycle)]
    rising, falling = values[125], values[175]
    assert falling - rising == pytest.approx(0.02, abs=1e-6)


def test_latency_is_beyond_the_period(native):
    def ramp(sensor, step):
        sensor.force = float(step)

    sensor = native(ForceSensor, **STILL, latency=20e-3)
    values = [float(one.measured_force) for one in stepped(sensor, 30, ramp)]
    np.testing.assert_allclose(values[4:], np.arange(26), atol=1e-8)


def test_a_latency_that_it_cannot_hold_is_refused():
    sensor = ForceSensor(latency=0.5)
    sensor.start()
    assert sensor.advance(0.0, 5e-3) == ERROR
