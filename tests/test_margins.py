"""Margins of the force loop: of loops that are known, and of the twin's against its own limit of stability."""

import numpy as np
import pytest

from benchmarks import margins as loop

FREQUENCIES = np.geomspace(0.05, 50.0, 60)


@pytest.mark.parametrize(("gain", "delay"), [(1.0, 0.02), (10.0, 0.02), (40.0, 0.03)])
def test_integrator_with_a_delay(gain, delay):
    """K e^(-sT) / s: it crosses at K rad/s, phase margin 90 deg - K T, gain margin pi / (2 K T)."""
    s = 2j * np.pi * FREQUENCIES
    found = loop.margins(FREQUENCIES, gain * np.exp(-s * delay) / s)
    assert found.crossover == pytest.approx(gain / (2 * np.pi), rel=5e-3)
    assert found.phase == pytest.approx(90 - np.degrees(gain * delay), abs=1.0)
    assert found.gain == pytest.approx(20 * np.log10(np.pi / (2 * gain * delay)), abs=0.2)
    assert found.enough == (found.gain >= 6 and found.phase >= 45)


def test_three_lags():
    """K / (1 + s)^3: -180 deg at sqrt(3) rad/s, where it is K / 8."""
    s = 2j * np.pi * np.geomspace(0.01, 10.0, 80)
    found = loop.margins(np.geomspace(0.01, 10.0, 80), 4.0 / (1 + s) ** 3)
    assert found.gain == pytest.approx(20 * np.log10(2.0), abs=0.1)
    assert found.phase == pytest.approx(180 - 3 * np.degrees(np.arctan(np.sqrt(4 ** (2 / 3) - 1))), abs=0.5)


def test_a_loop_that_is_not_seen_to_cross_has_no_margin():
    s = 2j * np.pi * FREQUENCIES
    assert not loop.margins(FREQUENCIES, 1e4 / s).enough
    assert not loop.margins(FREQUENCIES, 1e-6 / s).enough


def test_the_largest_gain_has_just_the_margins():
    s = 2j * np.pi * FREQUENCIES
    responses = [(FREQUENCIES, np.exp(-0.02 * s) / s * 11.2)]
    gain = loop.allowed(responses)
    assert gain == pytest.approx(np.deg2rad(45) / 0.02 / 11.2, rel=0.03)  # the phase margin comes first
    assert loop.allowed(responses, ratio=4.0) < 0.95 * gain


@pytest.fixture(scope="module")
def sliding():
    """Response of the twin's sliding sheath about where it turns to -180 deg."""
    return loop.response(loop.Plant().sliding(), loop.SMALL, np.array([1.0, 3.0, 7.0, 9.0, 11.0, 13.0, 16.0, 20.0]))


def swings(gain):
    """How far the force still swings five seconds after the start [N], with PI alone while drive and sheath slide."""
    system = loop.Plant().sliding().system()
    system.add("control", "pi_control", proportional=gain, setpoint=0.205)
    system.connect("sensor.measured_force", "control.force")
    system.connect("control.target_velocity", "servomotor.target_velocity")
    with system.simulate(step="1 ms", record=["wall.force"], every=5e-3) as running:
        running.advance("6 s")
        return np.ptp(running.results["wall.force"].to_numpy()[1000:])


@pytest.mark.slow
def test_the_gain_margin_is_where_the_twin_begins_to_ring(sliding):
    limit = 10 ** (loop.margins(sliding[0], sliding[1]).gain / 20)
    assert 6.0 < limit < 7.5
    assert swings(0.95 * limit) < 0.5e-3
    assert swings(1.05 * limit) > 50e-3


@pytest.mark.slow
def test_a_gain_of_6000_has_the_margins_that_the_page_says():
    """docs/explanation/force_experiment.md, `P = 6000 with PI alone is no result`."""
    frequencies = np.array([1.0, 10.0, 10.5, 11.0, 11.5, 12.0, 12.5, 13.0])
    frequencies, response = loop.response(loop.Plant().sliding(), loop.SMALL, frequencies)
    found = loop.margins(frequencies, loop.controller(frequencies, 6.0) * response)
    assert (f"{found.gain:.1f} dB", f"{found.phase:.0f} deg") == ("1.0 dB", "11 deg")


@pytest.mark.slow
def test_below_crossover_it_is_stiffness_over_s_and_a_delay(sliding):
    """Cantilever in series with the silicone; sampling, holding and publishing twice, drive and sheath make 18.5 ms."""
    frequencies, response = sliding
    s = 2j * np.pi * frequencies[:2]
    stiffness = 1 / (48e-3**3 / (3 * 4.3e-4) + 1 / 262)
    assert np.abs(response[:2] * s) == pytest.approx(stiffness, rel=0.03)
    late = -np.angle(response[1] * s[1]) / (2 * np.pi * frequencies[1])
    assert late == pytest.approx(18.5e-3, abs=1.5e-3)


@pytest.mark.slow
def test_friction_and_play_keep_small_motions():
    assert abs(loop.harmonic(loop.Plant(), 3.0, 1e-3)) < 1e-3 * abs(loop.harmonic(loop.Plant().sliding(), 3.0, 1e-3))
