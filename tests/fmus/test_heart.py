import numpy as np
import pytest
from fmus.heart.model import Heart

R = np.array([4, 2, 0.4, 0.1, 0.005, 0.001, 0.0005]) * 1e-3
THETA = np.array([0, 2.8, 2.8, 0, 3.7, 1.2, 5.6])


def at(heart, times):
    values = []
    for t in times:
        heart.start(t)
        values.append((float(heart.position), float(heart.velocity)))
    return np.array(values).T


def test_is_equation_4(native):
    times = np.linspace(1.0, 3.0, 400)
    position, velocity = at(native(Heart), times)
    i = np.arange(1, 8)
    angle = 2 * np.pi * np.outer(times, i)
    np.testing.assert_allclose(position, np.sin(angle + THETA) @ R, atol=1e-15)
    np.testing.assert_allclose(velocity, np.cos(angle + THETA) @ (2 * np.pi * i * R), atol=1e-14)
    assert np.ptp(position) == pytest.approx(10.65e-3, rel=1e-3)


def test_velocity_is_the_rate_of_position_also_while_blending_in(native):
    times = np.arange(0.0, 1.5, 1e-4)
    position, velocity = at(native(Heart, rate=1.3, scale=0.7, offset=2e-3), times)
    assert position[0] == 2e-3
    assert velocity[0] == 0.0
    np.testing.assert_allclose(np.gradient(position, times)[1:-1], velocity[1:-1], atol=1e-5)


def test_blend_in_can_be_left_out(native):
    position, _ = at(native(Heart, blend_in=0.0), [0.0])
    assert position[0] == pytest.approx(np.sin(THETA) @ R)


def test_advance_gives_the_end_of_the_step(native):
    heart, other = native(Heart), native(Heart)
    heart.start(0.0)
    heart.advance(0.4, 0.1)
    other.start(0.5)
    assert heart.position == other.position
