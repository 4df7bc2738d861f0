"""Profile generators: limits kept, target reached exactly, no jump between segments."""

import itertools

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hw_bridge.device.trajectory import to_position, to_velocity
from tests.every_case import every_case

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


# duration [s] and acceleration of each segment, end of the motion [ns]; rates 2 up and 1 down, at most 1
TO_POSITION = [
    (0.0, 0.0, 3.0, [(0.5, 2.0), (2.25, 0.0), (1.0, -1.0)], 3.75),  # 0.25 up, 2.25 at speed, 0.5 down
    (0.0, 0.0, -3.0, [(0.5, -2.0), (2.25, 0.0), (1.0, 1.0)], 3.75),
    (1.0, 0.0, 1.75, [(0.5, 2.0), (0.0, 0.0), (1.0, -1.0)], 1.5),  # the speed is just reached
    (0.0, 0.0, 0.1875, [(0.25, 2.0), (0.0, 0.0), (0.5, -1.0)], 0.75),  # it is not: 0.0625 up to 0.5, 0.125 down
    (0.0, 0.5, 1.1875, [(0.25, 2.0), (0.5, 0.0), (1.0, -1.0)], 1.75),  # already on the way
    (0.0, -0.5, 2.625, [(0.5, 1.0), (0.5, 2.0), (2.0, 0.0), (1.0, -1.0)], 4.0),  # turns round at -0.125
    (0.0, 1.0, 0.3, [(1.0, -1.0), (0.25819889, -2.0), (0.0, 0.0), (0.51639778, 1.0)], None),  # too late to brake
    (0.0, 2.0, 3.0, [(1.0, -1.0), (0.0, 2.0), (1.0, 0.0), (1.0, -1.0)], 3.0),  # too fast: 1.5 to slow down
    (0.0, -2.0, -3.0, [(1.0, 1.0), (0.0, -2.0), (1.0, 0.0), (1.0, 1.0)], 3.0),
    (0.0, 1.0, 0.5, [(0.0, 2.0), (0.0, 0.0), (1.0, -1.0)], 1.0),  # just in time
    (1.0, 0.0, 1.0, [(0.0, 2.0), (0.0, -1.0)], 0.0),  # there
]


@every_case(("x", "v", "target", "segments", "end"), TO_POSITION)
def test_segments_to_a_position(x, v, target, segments, end):
    motion = to_position(7, x, v, target, 1.0, 2.0, 1.0)
    assert motion.segments == tuple(pytest.approx(segment, abs=1e-8) for segment in segments)
    assert end is None or motion.end - 7 == pytest.approx(end * 1e9, abs=1)
    assert (motion.start, motion.position, motion.velocity) == (7, x, v)
    assert (motion.target, motion.velocity_end) == (target, 0.0)
    # the segments alone end there
    for duration, acceleration in motion.segments:
        x, v = x + v * duration + 0.5 * acceleration * duration**2, v + acceleration * duration
    assert (x, v) == (pytest.approx(target), pytest.approx(0.0, abs=1e-8))


@every_case(
    ("v", "target", "segments", "end"),
    [
        (0.0, 1.0, [(0.5, 2.0)], 0.25),
        (1.0, 2.0, [(0.5, 2.0)], 0.75),
        (1.0, 0.5, [(0.5, -1.0)], 0.375),
        (1.0, 0.0, [(1.0, -1.0)], 0.5),
        (-1.0, 0.0, [(1.0, 1.0)], -0.5),
        (1.0, -2.0, [(1.0, -1.0), (1.0, -2.0)], 0.5 - 1.0),  # through zero
        (-1.0, 2.0, [(1.0, 1.0), (1.0, 2.0)], -0.5 + 1.0),
        (0.0, -1.0, [(0.5, -2.0)], -0.25),
    ],
)
def test_segments_to_a_speed(v, target, segments, end):
    motion = to_velocity(7, 10.0, v, target, 2.0, 1.0)
    assert motion.segments == tuple(segments)
    assert (motion.target, motion.velocity_end) == (pytest.approx(10.0 + end), target)
    length = sum(duration for duration, _ in segments)
    assert motion.end == 7 + length * 1e9
    assert motion.at(motion.end + 500_000_000) == (pytest.approx(10.0 + end + 0.5 * target), target)


def test_a_motion_of_no_length_is_over_at_once():
    assert to_velocity(5, 1.0, 0.5, 0.5, 1.0, 1.0).end == 5
    assert to_velocity(5, 1.0, 0.5, 0.5, 1.0, 1.0).at(5 + 10**9) == (1.5, 0.5)
    assert to_position(5, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0).end == 5
    assert to_velocity(5, 1.0, 0.0, LEAST, 1.0, 1.0).end == 6
