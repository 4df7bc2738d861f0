"""`limits.acceleration` acts on what a drive is told, in csv and in csp; in cst a run ends that exceeds it."""

import math
from itertools import pairwise

import numpy as np
import pytest

from hw_bridge.bus import Frame
from hw_bridge.dictionary import State
from hw_bridge.master.acceleration import AccelerationLimit
from tests.every_case import every_case
from tests.hw_bridge.axis import Rig, node
from twin.errors import SimulationError

H = 5e-3
SLOW = {"acceleration": "0.1 m/s^2"}


def speeds(rig, milliseconds):
    """True speed of the motor at each millisecond [m/s]."""
    found = []
    for _ in range(milliseconds):
        rig.go(1)
        found.append(rig.drive.axis.velocity)
    return np.array(found)


def test_a_jump_of_the_speed_is_a_ramp_of_the_limit(build):
    """The issue's case: 26, 86, 102 mm/s after 6, 12, 18 ms."""
    rig = Rig(build, {"servomotor": node(limits=SLOW)})
    rig.go(20)
    rig.set(target_velocity=0.1)
    found = speeds(rig, 500)
    assert np.max(found[:20]) < 0.1 * 0.020 + 1e-3
    assert np.polyfit(np.arange(500) / 1000, found, 1)[0] == pytest.approx(0.1, rel=0.05)
    assert np.max(np.abs(found - np.arange(500) * 1e-4)[100:]) < 4e-3  # it counts in mm/s; friction holds it at first
    assert found[-1] == pytest.approx(0.05, abs=2e-3)
    assert rig.master.report()["nodes"]["servomotor"]["limited_targets"] > 90


@pytest.mark.parametrize("feedforward", [0.0, 0.3])
def test_a_jump_of_the_position_is_a_ramp_of_the_limit(build, feedforward):
    rig = Rig(build, {"servomotor": node(limits=SLOW, follow={"feedforward": feedforward})})
    rig.set(mode_of_operation=8)
    rig.go(20)
    rig.set(target_position=2e-3)
    found = speeds(rig, 600)
    assert np.max(np.abs(found)) < math.sqrt(2e-3 * 0.1) * 1.1  # of a triangle of this acceleration
    assert rig.get("position") == pytest.approx(2e-3, abs=3e-5)
    assert np.max(np.diff(found[::50])) / 0.05 < 0.15


def test_a_force_that_accelerates_too_much_ends_the_run(build):
    rig = Rig(build, {"servomotor": node(limits={"acceleration": "1 m/s^2"})})
    rig.set(mode_of_operation=10)
    rig.go(20)
    rig.set(target_force=5.0)
    with pytest.raises(SimulationError, match=r"acceleration [\d.]+ m/s\^2 is above 1 m/s\^2"):
        rig.go(100)
    assert rig.drive.state is not State.ENABLED


@pytest.mark.slow
def test_targets_within_the_limit_are_sent_as_they_are(build):
    """Frame for frame, with a limit that just suffices and with one that never acts."""
    sent = []
    for acceleration in ("0.6 m/s^2", "20 m/s^2"):
        rig = Rig(build, {"servomotor": node(limits={"acceleration": acceleration})})
        rig.set(mode_of_operation=8)
        frames = []
        rig.go(1)
        rig.session.bench.bus.observers.append(
            lambda _, frame, frames=frames: frames.append(frame) if frame.id in (0x201, 0x301) else None
        )
        for k in range(1000):
            t = max(k - 20, 0) / 1000
            rig.set(target_position=2e-3 * (1.0 - math.cos(2.0 * math.pi * 2.5 * t)))  # 0.49 m/s2
            rig.go(1)
        sent.append(frames)
    assert len(sent[0]) > 300
    assert isinstance(sent[0][0], Frame)
    assert sent[0] == sent[1]


@pytest.mark.parametrize("way", [1e-5, 1e-3, -0.05])
def test_a_jump_is_reached_without_overshoot(way):
    limit = AccelerationLimit(0.5, 0.1)
    limit.begin(0.0)
    positions, velocity = [0.0], 0.0
    while limit.position != way:
        limit.follow_position(way, H)
        positions.append(limit.position)
        assert abs(limit.velocity - velocity) <= 0.5 * H * (1 + 1e-6)
        assert abs(limit.velocity) <= 0.1 * (1 + 1e-9)
        velocity = limit.velocity
        assert len(positions) < 3000
    assert all(math.copysign(1.0, way) * (b - a) >= 0.0 for a, b in pairwise(positions))
    limit.follow_position(way, H)
    assert limit.velocity == 0.0


def test_a_moving_target_is_caught_up_with():
    """It jumps by 2 mm while it goes on at 20 mm/s; overshoot stays below a tenth of the jump."""
    limit = AccelerationLimit(1.0, 0.2)
    limit.begin(0.0)
    target, errors = 0.0, []
    for k in range(400):
        target += 0.02 * H + (2e-3 if k == 100 else 0.0)
        before = limit.velocity
        limit.follow_position(target, H)
        assert abs(limit.velocity - before) <= 1.0 * H * (1 + 1e-6)
        errors.append(target - limit.position)
    assert max(errors) > 1.5e-3
    assert min(errors[101:]) > -0.2e-3
    assert errors[-100:] == [0.0] * 100


def test_the_measured_acceleration_is_that_of_the_time_that_passed():
    """Also where this program came late."""
    limit = AccelerationLimit(1.0, 0.2)
    for k, time in enumerate((0, 5, 10, 60, 65, 70)):
        limit.measure(2.0 * time / 1000, time * 1_000_000)
        assert limit.measured == pytest.approx(2.0 if k >= 4 else 0.0)


def test_a_run_begins_with_no_limited_target_and_no_measured_acceleration():
    limit = AccelerationLimit(1.0, 0.2)
    limit.follow_velocity(0.1, 0.0, H)
    assert limit.count == 1
    limit.forget()
    for time in range(4):
        limit.measure(2.0 * time, time * 1_000_000_000)
    assert (limit.count, limit.measured) == (0, 0.0)


@every_case("jump", [2e-3, -2e-3])
@every_case("part", [0.3, 0.7, 0.9])
def test_a_target_that_needs_the_limit_itself_is_caught_up_with(part, jump):
    """It swings with a part of the limit and jumps meanwhile; what is left for the way bounds the overshoot."""
    limit, frequency = AccelerationLimit(1.0, 0.2), 4.0 * math.pi
    limit.begin(0.0)
    errors = []
    for k in range(400):
        target = part / frequency**2 * (1.0 - math.cos(frequency * k * H)) + jump * (k >= 100)
        limit.follow_position(target, H)
        errors.append(math.copysign(1.0, jump) * (target - limit.position))
    assert max(errors) > 1.5e-3
    assert min(errors) > -0.1e-3
    assert errors[-100:] == [0.0] * 100
