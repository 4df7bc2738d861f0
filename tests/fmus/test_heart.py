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


ALIVE = {"wander": 0.05, "sinus_arrhythmia": 0.05, "respiration": 3e-3, "ectopic_every": 6}


@pytest.mark.parametrize("rate", [0.8, 1.3, 2.0])
def test_velocity_is_the_rate_of_position_of_a_heart_that_is_alive(native, rate):
    times = np.arange(0.0, 20.0, 1e-4)
    position, velocity = at(native(Heart, rate=rate, **ALIVE), times)
    np.testing.assert_allclose(np.gradient(position, times)[1:-1], velocity[1:-1], atol=1e-3)  # of 0.4; it bends


def test_a_change_of_the_rate_keeps_the_phase():
    heart = Heart(blend_in=0.0)
    heart.start(0.0)
    before = []
    for step in range(4000):
        if step in (1234, 2345):
            heart.rate += 0.4
        heart.advance(step * 1e-3, 1e-3)
        before.append(float(heart.position))
    assert np.abs(np.diff(before)).max() < 1.8 * 42e-3 * 1e-3  # speeds grow with the rate, no more


def test_the_rate_wanders_as_far_as_it_is_told_and_by_the_seed_alone(native):
    times = np.arange(0.0, 600.0, 0.01)
    plain, sine = (1e-3, *(0.0,) * 6), (0.0,) * 7
    first, _ = at(native(Heart, amplitude=plain, phase=sine, wander=0.05, blend_in=0.0), times)
    again, _ = at(native(Heart, amplitude=plain, phase=sine, wander=0.05, blend_in=0.0), times)
    other, _ = at(native(Heart, amplitude=plain, phase=sine, wander=0.05, blend_in=0.0, seed=22), times)
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    up = np.flatnonzero((first[:-1] < 0.0) & (first[1:] >= 0.0))
    part = first[up] / (first[up] - first[up + 1])
    beats = np.diff(times[up] + 0.01 * part)
    assert np.std(1.0 / beats) == pytest.approx(0.05, rel=0.1)


def test_an_ectopic_beat_comes_early_and_its_pause_makes_up_for_it(native):
    times = np.arange(0.0, 12.0, 1e-3)
    usual, _ = at(native(Heart), times)
    early, _ = at(native(Heart, ectopic_every=6, ectopic_coupling=0.65), times)
    off = times[np.abs(early - usual) > 1e-6]
    assert off.min() == pytest.approx(4.65, abs=0.02)  # beats 4 and 5 of each six
    assert {int(t) for t in off} == {4, 5, 10, 11}


def test_respiration_is_added(native):
    times = np.arange(1.0, 9.0, 1e-2)
    position, _ = at(native(Heart, respiration=3e-3), times)
    usual, _ = at(native(Heart), times)
    np.testing.assert_allclose(position - usual, 3e-3 * np.sin(2 * np.pi * 0.25 * times), atol=1e-12)
