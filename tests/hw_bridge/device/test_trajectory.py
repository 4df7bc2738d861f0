"""Profile generators: limits kept, target reached exactly, no jump between segments."""

import itertools

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hw_bridge.device.trajectory import to_position, to_velocity

PLACE = st.floats(-1.0, 1.0)
SPEED = st.floats(-2.0, 2.0)
RATE = st.floats(0.1, 50.0)
TINY = 1e-9
LEAST = 5e-324  # with these rates the speed to come so far, and the duration to stop from it, underflow to 0


def samples(motion):
    span = max(motion.end - motion.start, 1)
    times = [motion.start + span * k // 200 for k in range(201)]
    return [(time, *motion.at(time)) for time in times]


@given(PLACE, SPEED, PLACE, st.floats(0.01, 2.0), RATE, RATE)
@example(LEAST, 0.0, 0.0, 1.0, 0.1, 0.1)
@example(0.0, LEAST, 0.0, 1.0, 50.0, 50.0)
def test_to_position(x, v, target, speed, up, down):
    motion = to_position(1000, x, v, target, speed, up, down)
    assert motion.at(1000) == (x, v)
    assert motion.at(motion.end) == (target, 0.0)
    rows = samples(motion)
    for (t0, x0, v0), (t1, x1, v1) in itertools.pairwise(rows):
        dt = (t1 - t0) / 1e9
        assert abs(v1) <= max(speed, abs(v0)) + TINY
        assert abs(v1 - v0) <= max(up, down) * dt + 1e-6
        assert x1 - x0 == pytest.approx(0.5 * (v0 + v1) * dt, abs=max(up, down) * dt * dt / 4 + 1e-6)


@given(PLACE, SPEED, SPEED, RATE, RATE)
@example(0.0, 0.0, LEAST, 50.0, 50.0)
def test_to_velocity(x, v, target, up, down):
    motion = to_velocity(0, x, v, target, up, down)
    assert motion.at(0) == (x, v)
    assert motion.at(motion.end)[1] == pytest.approx(target, abs=1e-6)
    rows = samples(motion)
    for (t0, _, v0), (t1, _, v1) in itertools.pairwise(rows):
        assert abs(v1 - v0) <= max(up, down) * (t1 - t0) / 1e9 + 1e-6
    later, speed = motion.at(motion.end + 10**9)
    assert speed == target
    assert later - motion.at(motion.end)[0] == pytest.approx(target, abs=1e-6)


def test_a_known_trapezoid():
    """10 mm with 20 mm/s and 100 mm/s2: 0.2 s up, 0.3 s at speed, 0.2 s down."""
    motion = to_position(0, 0.0, 0.0, 0.010, 0.020, 0.1, 0.1)
    assert motion.end == pytest.approx(700_000_000, abs=2)
    assert motion.at(200_000_000) == pytest.approx((0.002, 0.020))
    assert motion.at(350_000_000) == pytest.approx((0.005, 0.020))
    assert motion.at(600_000_000) == pytest.approx((0.0095, 0.010))
