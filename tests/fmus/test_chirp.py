import numpy as np
import pytest
from fmus.chirp.model import Chirp


def at(chirp, times):
    values = []
    for t in times:
        chirp.start(t)
        values.append((float(chirp.position), float(chirp.velocity), float(chirp.frequency)))
    return np.array(values).T


def test_is_equation_3(native):
    times = np.arange(0.0, 80.0, 0.025)
    position, _, frequency = at(native(Chirp), times)

    # the integral of f_s + (f_f - f_s) t / t_tot, by a fine sum
    fine = np.linspace(0.0, 80.0, 800_001)
    rate = 0.1 + 2.9 / 80.0 * fine
    cycles = np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(fine))))
    np.testing.assert_allclose(position, 5e-3 * np.sin(2 * np.pi * np.interp(times, fine, cycles)), atol=1e-9)
    np.testing.assert_allclose(frequency, 0.1 + 2.9 / 80.0 * times)


def test_velocity_is_the_rate_of_position(native):
    times = np.arange(78.0, 79.0, 1e-4)
    position, velocity, _ = at(native(Chirp), times)
    np.testing.assert_allclose(np.gradient(position, times)[1:-1], velocity[1:-1], atol=1e-5)
    assert np.abs(velocity).max() == pytest.approx(2 * np.pi * 3.0 * 5e-3, rel=0.05)


def test_ends_at_zero(native):
    position, velocity, _ = at(native(Chirp), [79.999999, 80.0, 90.0])
    assert position[0] == pytest.approx(0.0, abs=1e-6)
    assert list(position[1:]) == [0.0, 0.0]
    assert list(velocity[1:]) == [0.0, 0.0]
