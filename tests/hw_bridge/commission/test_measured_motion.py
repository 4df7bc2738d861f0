"""What commissioning computes from measured motion: step responses, direction, quick stop by SDO, limits beside limits."""

from types import SimpleNamespace

import numpy as np
import pytest

from hw_bridge.commission import direction, power
from hw_bridge.commission.limits import Row, wider
from hw_bridge.commission.ramp import Ramp
from hw_bridge.commission.step import Response, difference, response
from hw_bridge.dictionary import State
from hw_bridge.master import SdoError, SilentError
from tests.every_case import every_case
from tests.hw_bridge.unconnected import WORDS, unconnected_node
from twin.errors import SimulationError

MS = 1_000_000


@every_case("step", [2e-3, -2e-3])
@every_case(
    ("parts", "rise", "overshoot", "settled", "left"),
    [
        # every 10 ms, the step at 0
        ([0.0, 0.05, 0.1, 0.5, 0.9, 1.0], 0.02, 0.0, 0.05, 0.0),
        ([0.0, 0.2, 0.95, 1.2, 1.04, 1.06, 1.02, 1.01], 0.01, 0.2, 0.06, -0.01),
        ([0.0, 0.5, 1.2, 0.96, 0.94], 0.01, 0.2, np.nan, 0.06),
        ([0.0, 0.5, 0.8], np.nan, 0.0, np.nan, 0.2),
    ],
)
def test_figures_of_a_step_response(step, parts, rise, overshoot, settled, left):
    time = 0.01 * np.arange(len(parts))
    found = Response(time, step * np.array(parts), np.zeros(len(parts)), step).figures()
    expected = {"rise": rise, "overshoot": overshoot, "settled": settled, "left": left * step}
    assert found == pytest.approx(expected, nan_ok=True, abs=1e-12)


def test_the_difference_of_two_responses_is_taken_at_the_times_of_the_first():
    real = Response(np.array([0.0, 0.1, 0.2]), np.array([0.0, 1.0, 2.0]), None, 1.0)
    twin = Response(np.array([0.0, 0.2]), np.array([0.0, 5.0]), None, 1.0)
    assert difference(real, twin) == pytest.approx(np.sqrt((0.0 + 1.5**2 + 3.0**2) / 3))


class Hand:
    """A session that follows its targets at once, on a clock of 10 ms."""

    def __init__(self, gain=1.0):
        self.network, self.samples, self.moves = SimpleNamespace(now=0), [], []
        limits = SimpleNamespace(velocity=0.3, acceleration=10.0)
        self.keys = SimpleNamespace(limits=limits)
        self.node = SimpleNamespace(target_position=0.005)
        self.gain = gain

    def go(self, position):
        self.network.now += 10 * MS
        self.node.target_position = position
        self.samples.append(SimpleNamespace(time=self.network.now / 1e9, position=self.gain * position, current=0.2))

    def rest(self, duration):
        for _ in range(duration // (10 * MS)):
            self.go(self.node.target_position)

    def move(self, goal, speed, acceleration):
        self.moves.append((goal, speed, acceleration))


def test_a_response_is_recorded_before_and_after_its_step():
    hand = Hand()
    hand.rest(100 * MS)
    found = response(hand, -0.001)
    assert found.time == pytest.approx(0.01 * np.arange(-4, 41))
    assert found.displacement == pytest.approx([0.0] * 5 + [-0.001] * 40)
    assert found.current == pytest.approx([0.2] * 45)
    assert found.step == -0.001
    assert hand.moves == [(0.005, pytest.approx(0.03), pytest.approx(1.0))]


class Push:
    """An axis that moves by 1 um for each push above 1 N, in the direction of `sign`; cycles of 10 ms."""

    def __init__(self, sign=1.0, threshold=1.0, speed=0.0, limit="300 mm/s"):
        self.node = unconnected_node(limits={"velocity": limit})
        self.node.raw_velocity = speed
        self.network, self.forces = SimpleNamespace(now=0), []
        self.sign, self.threshold = sign, threshold

    def push(self, force):
        self.network.now += 10 * MS
        self.forces.append(force)
        if abs(force) > self.threshold:
            self.node.raw_position += int(self.sign * np.sign(force)) * 16


@pytest.mark.parametrize(("sign", "agrees"), [(1.0, True), (-1.0, False)])
def test_the_direction_of_an_encoder(sign, agrees):
    """Eight increments of 8 um are a motion: the push grows by 20 mN in each cycle until then."""
    session = Push(sign)
    found = direction.pushes(session, 2.0)
    assert [push.direction for push in found] == [1, -1]
    assert [push.moved for push in found] == pytest.approx([sign * 64e-6, -sign * 64e-6])
    assert [push.force for push in found] == pytest.approx([1.08, 1.08])
    assert [push.agrees for push in found] == [agrees] * 2
    assert session.forces[:56] == pytest.approx([0.02 * cycle for cycle in range(55)] + [0.0])
    assert session.forces[55:85] == [0.0] * 30
    assert session.forces[85:88] == pytest.approx([0.0, -0.02, -0.04])


def test_a_motor_coasts_after_a_push():
    """By 16 um in the first cycle without a force."""
    session = Push()
    push = session.push

    def coasting_push(force):
        begins_to_coast = force == 0.0 and session.forces and session.forces[-1] > 0.0
        push(force)
        session.node.raw_position += 16 if begins_to_coast else 0

    session.push = coasting_push
    found = direction.pushes(session, 2.0)
    assert [push.farthest - push.moved for push in found] == pytest.approx([16e-6, 0.0], abs=1e-9)


def test_a_push_that_moves_nothing():
    found = direction.pushes(Push(threshold=5.0), 2.0)
    assert [(push.force, push.moved, push.agrees) for push in found] == [(2.0, 0.0, False)] * 2


@pytest.mark.parametrize(("speed", "runs_away"), [(75, False), (76, True), (-76, True)])
def test_a_push_that_runs_away_is_stopped(speed, runs_away):
    session = Push(speed=speed)
    if not runs_away:
        assert len(direction.pushes(session, 2.0)) == 2
        return
    with pytest.raises(SimulationError, match=rf"^axis: runs away at {speed}\.00 mm/s from a push\. It stops\.$"):
        direction.pushes(session, 2.0)


@pytest.mark.parametrize(("moved", "found"), [(1001, 1.001e-3), (-1001, -1.001e-3), (1000, 0.0)])
def test_motion_by_hand(moved, found):
    node = unconnected_node(values={(0x6064, 0): -500})
    network = SimpleNamespace(now=0)

    def wait(duration):
        network.now += duration
        if network.now >= 200 * MS:
            node.server.dictionary.values[0x6064, 0] = -500 + moved

    session = SimpleNamespace(network=network, wait=wait)
    assert direction.measure_manual_motion(session, node, 1e-3, 1000 * MS) == pytest.approx(found)
    assert network.now == (200 if found else 1000) * MS


@pytest.mark.parametrize(("wait_until", "inverted"), [(40, False), (40, True)])
def test_motion_by_hand_counts_as_the_member(wait_until, inverted):
    node = unconnected_node(values={(0x6064, 0): 0}, inverted=inverted, scale=2.0)
    network = SimpleNamespace(now=0)

    def wait(duration):
        network.now += duration
        node.server.dictionary.values[0x6064, 0] = 1000

    session = SimpleNamespace(network=network, wait=wait)
    expected = -2e-3 if inverted else 2e-3
    assert direction.measure_manual_motion(session, node, 1e-3, 1000 * MS) == pytest.approx(expected)


def stopping(states, speeds=(0,)):
    """A drive whose states follow each other with each look, and the session that looks at it."""
    node = unconnected_node()
    remaining, running = list(states), list(speeds)
    written, network = [], SimpleNamespace(now=0)

    def number(index, sub=0):
        assert (index, sub) == (0x6041, 0)
        return WORDS[remaining.pop(0) if len(remaining) > 1 else remaining[0]]

    node.sdo = SimpleNamespace(
        number=number,
        read=lambda index: (running.pop(0) if len(running) > 1 else running[0]).to_bytes(4, "little", signed=True),
        write=lambda index, sub, data: written.append((index, sub, data)),
    )

    def wait(duration):
        network.now += duration

    return SimpleNamespace(network=network, wait=wait, nmt=lambda *_: None), node, written


QUICK_STOP, OFF = (0x6040, 0, b"\x02\0"), (0x6040, 0, b"\0\0")


@every_case(
    ("states", "speeds", "written", "duration", "end"),
    [
        ([State.DISABLED], [0], [OFF], 0, State.DISABLED),
        ([State.READY, State.DISABLED], [0], [OFF], 0, State.DISABLED),
        (
            [State.ENABLED, State.QUICK_STOP, State.QUICK_STOP, State.QUICK_STOP, State.DISABLED],
            [30, -7, 0],
            [QUICK_STOP, OFF],
            20 * MS,
            State.DISABLED,
        ),
        ([State.QUICK_STOP, State.QUICK_STOP, State.DISABLED], [0], [OFF], 0, State.DISABLED),
        ([State.REACTION, State.REACTION, State.FAULT], [0], [OFF], 20 * MS, State.FAULT),
        ([State.QUICK_STOP] * 201 + [State.DISABLED], [9], [OFF], 2000 * MS, State.DISABLED),
    ],
)
def test_a_drive_brakes_before_its_power_is_switched_off(states, speeds, written, duration, end):
    session, node, sent = stopping(states, speeds)
    assert power.disable(session, node) is end
    assert (sent, session.network.now) == (written, duration)


@pytest.mark.parametrize("state", [State.ENABLED, State.SWITCHED_ON, State.QUICK_STOP])
def test_a_drive_that_is_enabled_again(state):
    session, node, sent = stopping([State.READY, state])
    with pytest.raises(SimulationError, match=rf"^axis: is still in {state}: another program enables it again"):
        power.disable(session, node)
    assert sent == [OFF]


def test_a_drive_that_does_not_answer_is_made_pre_operational_first():
    session, node, _ = stopping([State.DISABLED])
    commands, answers = [], node.sdo.number
    session.nmt = lambda *command: commands.append(command)

    def number(index, sub=0):
        if not commands:
            raise SilentError("no answer")
        return answers(index, sub)

    node.sdo.number = number
    assert power.disable(session, node) is State.DISABLED
    assert commands == [(0x80, 3)]


@pytest.mark.parametrize("error", [SdoError("refused", 0x06020000), SilentError("no answer")])
def test_a_drive_whose_speed_is_unknown_is_switched_off_after_its_longest_stop(error):
    session, node, sent = stopping([State.ENABLED] + [State.QUICK_STOP] * 200 + [State.DISABLED])

    def read(index):
        raise error

    node.sdo.read = read
    assert power.disable(session, node) is State.DISABLED
    assert (sent, session.network.now) == ([QUICK_STOP, OFF], 2000 * MS)


@every_case(
    ("file", "own", "lines"),
    [
        (0.2, 0.2, []),
        (0.2019, 0.2, []),
        (0.2, 0.0, []),
        (0.2, -1.0, []),
        (0.2021, 0.2, [("axis: limits.velocity 202.1 mm/s is above the drive's own 200 mm/s (6080h).", False)]),
        (2.0, 0.2, [("axis: limits.velocity 2000 mm/s is above the drive's own 200 mm/s (6080h).", False)]),
        (
            2.1,
            0.2,
            [
                (
                    "axis: limits.velocity 2100 mm/s is above the drive's own 200 mm/s (6080h). Correct the unit or the number.",
                    True,
                )
            ],
        ),
    ],
)
def test_limits_above_those_of_the_drive(file, own, lines):
    row = Row("velocity", file, own, "6080h", "m/s")
    assert list(wider(unconnected_node(), [row])) == lines


def test_a_ramp_slows_down_with_its_own_deceleration():
    """1 m/s^2 up, 2 m/s^2 down, cycles of 10 ms; through zero it changes from one to the other."""
    ramp = Ramp(0.0, 1.0, 2.0)
    speeds = []
    for speed in (0.02, 0.02, 0.03, 0.03, 0.0, 0.0, -0.02, -0.02, -0.02, 0.01, 0.01):
        ramp.follow(speed, 0.01)
        speeds.append(ramp.velocity)
    assert speeds == pytest.approx([0.01, 0.02, 0.03, 0.03, 0.01, 0.0, -0.01, -0.02, -0.02, 0.0, 0.01], abs=1e-12)
    assert ramp.position == pytest.approx(0.01 * sum(speeds))
    for sign in (1.0, -1.0):
        ramp = Ramp(0.5, 1.0, 2.0, low=0.499, high=0.501)
        for _ in range(100):
            ramp.follow(sign * 9.0, 0.01)
        assert ramp.position == pytest.approx(0.5 + sign * 0.001)
        assert ramp.velocity == pytest.approx(0.0, abs=1e-9)
