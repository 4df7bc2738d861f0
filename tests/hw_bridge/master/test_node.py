"""One drive on the master's side, without a bus: units and signs, frames of each mode, bookkeeping of targets.

A FAULHABER V3.0 counts 1 um, 1 mm/s and 0.79 mA; an LM 2070 has 11.64 N/A.
"""

import struct

import pytest

from hw_bridge.dictionary import Mode, State
from hw_bridge.master.node import Node
from tests.every_case import every_case
from tests.hw_bridge.unconnected import WORDS, frame, unconnected_node
from twin.errors import SimulationError

CYCLE = 5_000_000
H = 0.005


def enabled(mode, profile="faulhaber_v3", **keys):
    """A drive in Operation enabled that follows targets in this mode."""
    node = unconnected_node(profile, **keys)
    node.word, node.goal, node.mode = WORDS[State.ENABLED], State.ENABLED, mode
    return node


@every_case(
    ("keys", "position", "velocity", "current", "force"),
    [
        ({}, 1e-3, 3e-3, 0.079, 0.91956),
        ({"inverted": True}, -1e-3, -3e-3, -0.079, -0.91956),
        ({"scale": 2.0}, 2e-3, 6e-3, 0.079, 0.45978),  # twice the displacement, half of the force
        ({"scale": 2.0, "inverted": True}, -2e-3, -6e-3, -0.079, -0.45978),
        ({"force_constant": "10 N/A", "scale": 2.0}, 2e-3, 6e-3, 0.079, 0.79),  # at the member, whatever the scale
    ],
)
def test_actual_values_of_the_member(keys, position, velocity, current, force):
    node = unconnected_node(**keys)
    node.raw_position, node.raw_velocity, node.raw_current = 1000, 3, 100
    assert (node.position, node.velocity) == (pytest.approx(position), pytest.approx(velocity))
    assert (node.current, node.force) == (pytest.approx(current), pytest.approx(force))
    node.zero(0.01)
    assert node.position == pytest.approx(0.01)
    assert node.device_position(0.01) == 1000
    assert node.device_position(0.01 + position) == 2000
    assert node.device_force(force) == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("profile", "force", "count"),
    [("faulhaber_v3", 1e6, 6000), ("faulhaber_v3", -1e6, -6000), ("epos4", 1e6, 32767), ("epos4", -1e6, -32768)],
)
def test_a_force_beyond_the_range_of_its_object_is_clamped(profile, force, count):
    assert unconnected_node(profile).device_force(force) == count


@pytest.mark.parametrize("side", [1, -1])
def test_a_target_beyond_what_the_drive_counts_is_an_error_and_does_not_wrap_around(side):
    """A drive that counts from far away, near the end of its INTEGER32."""
    node = enabled(Mode.CSP)
    node.raw_position = side * (2**31 - 10)
    node.zero(0.0)
    node.acceleration.begin(side * 9e-6)
    assert len(node.frames()) == 2
    node.acceleration.begin(side * 11e-6)
    with pytest.raises(
        SimulationError, match=r"^axis: a target is more than the drive can count \(607Ah = -?21474836\d\d"
    ):
        node.frames()


def test_a_new_origin_keeps_the_limited_target_in_place():
    node = unconnected_node()
    node.acceleration.begin(0.002)
    node.acceleration.follow_position(0.002, H)
    node.raw_position = 1000
    node.zero(0.011)  # 10 mm more than it was
    assert node.origin == pytest.approx(-0.010)
    assert node.acceleration.position == pytest.approx(0.012)
    node.acceleration.follow_position(0.012, H)
    assert not node.acceleration.limited


def test_lengths_and_angles_as_text():
    node = unconnected_node()
    assert node.format_length(-0.0123456) == "-12.35 mm"
    node.rotary = True
    assert node.format_length(1.0) == "57.30 deg"


def test_rounding_residuals_make_the_mean_exact():
    node = unconnected_node()
    assert [node.round_target(0.4) for _ in range(5)] == [0, 1, 0, 1, 0]
    assert [node.round_target(-0.4) for _ in range(5)] == [0, -1, 0, -1, 0]
    assert [node.round_offset(0.4) for _ in range(5)] == [0, 1, 0, 1, 0]
    node.round_offset(0.4)
    assert node.round_offset(0.0) == 0


@every_case(
    ("goal", "homing", "words"),
    [
        (State.ENABLED, False, [0, 0x06, 0x07, 0x0F, 0x0F, 0, 0, 0]),
        (State.ENABLED, True, [0, 0x06, 0x07, 0x0F, 0x1F, 0, 0, 0]),  # bit 4 starts homing
        (State.SWITCHED_ON, False, [0, 0x06, 0x07, 0x07, 0, 0, 0, 0]),
        (State.QUICK_STOP, False, [0, 0, 0, 0, 0x02, 0x02, 0, 0]),
        (State.DISABLED, False, [0, 0, 0, 0, 0, 0, 0, 0]),
    ],
)
def test_controlword_of_each_state_on_the_way_to_a_goal(goal, homing, words):
    """States in the order of CiA 402; a fault is never reset by the master."""
    node = unconnected_node()
    node.goal, node.homing = goal, homing
    assert [node.controlword(state) for state in WORDS] == words


@pytest.mark.parametrize(
    ("mode", "goal", "state", "homing", "follows"),
    [
        (Mode.CSP, State.ENABLED, State.ENABLED, False, True),
        (Mode.CSP, State.ENABLED, State.ENABLED, True, False),
        (Mode.CSP, State.ENABLED, State.SWITCHED_ON, False, False),
        (Mode.CSP, State.QUICK_STOP, State.ENABLED, False, False),
    ],
)
def test_targets_are_followed_only_in_operation_enabled(mode, goal, state, homing, follows):
    node = unconnected_node()
    node.mode, node.goal, node.word, node.homing = mode, goal, WORDS[state], homing
    assert node.follows is follows


@pytest.mark.parametrize("inverted", [False, True])
def test_frames_of_each_mode(inverted):
    """Target position in the first RPDO; controlword, mode and target velocity in the second; a force in the third."""
    sign = -1 if inverted else 1

    def frames(mode, follows=True, forces=False):
        node = enabled(mode, inverted=inverted)
        if forces:
            node.has_target_force = True
            node.use_process_data()
        node.goal = State.ENABLED if follows else State.QUICK_STOP
        node.raw_position, node.raw_velocity = 500, 7
        node.acceleration.position, node.acceleration.velocity, node.target_force = 0.002, 0.004, 0.91956
        return [(sent.id, sent.data) for sent in node.frames()]

    def second(word, mode, velocity):
        return 0x303, struct.pack("<Hbi", word, mode, velocity)

    assert frames(Mode.CSP) == [(0x203, struct.pack("<i", sign * 2000)), second(0x0F, 8, 0)]
    assert frames(Mode.CSV) == [(0x203, struct.pack("<i", 500)), second(0x0F, 9, sign * 4)]
    assert frames(Mode.CST, forces=True) == [
        (0x203, struct.pack("<i", 500)),
        second(0x0F, 10, 0),
        (0x403, struct.pack("<h", sign * 100)),
    ]
    for mode in (Mode.CSP, Mode.CSV):
        assert frames(mode, follows=False) == [(0x203, struct.pack("<i", 500)), second(0x02, mode, 0)]
    assert frames(Mode.CST, follows=False, forces=True)[2] == (0x403, b"\0\0")


@pytest.mark.parametrize(
    ("goal", "outputs"), [(State.ENABLED, 9), (State.QUICK_STOP, 9), (State.SWITCHED_ON, 9), (State.DISABLED, 2)]
)
def test_outputs_stay_until_the_drive_is_to_be_disabled(goal, outputs):
    node = unconnected_node(outputs={0: "a.b", 3: "a.c"}, safe_outputs=2)
    assert (node.outputs, node.safe_outputs) == (2, 2)
    node.outputs, node.goal = 9, goal
    assert node.frames()[0].data == struct.pack("<iI", 0, outputs)


@pytest.mark.parametrize(
    ("mode", "offset", "sent"),
    [(Mode.CSP, 0.0104, [10, 11, 10]), (Mode.CSP, -0.02, [-20] * 3), (Mode.CSV, 0.02, [0] * 3)],
)
def test_a_velocity_offset_is_sent_with_the_target_position_in_csp_alone(mode, offset, sent):
    node = enabled(mode, follow={"feedforward": 1.0})
    node.offset = offset
    assert [struct.unpack("<ii", node.frames()[0].data)[1] for _ in sent] == sent
    node.goal = State.QUICK_STOP
    assert struct.unpack("<ii", node.frames()[0].data)[1] == 0


def test_targets_of_a_drive_without_csp_are_acknowledged_set_points():
    """Profile position: bit 5 in every cycle, bit 4 rises with bit 12 low, and falls as soon as it is acknowledged."""
    node = enabled(Mode.CSP, "mclm")
    assert (node.own_mode, node.mode_problem) == (Mode.PP, "")

    def control(frames):
        return [struct.unpack_from("<Hb", sent.data) for sent in frames if sent.id == 0x303]

    assert control(node.frames()) == [(0x2F, 1)]  # 6061h does not show the mode yet: no edge
    assert node.acknowledge() == []
    node.shown_mode = 1
    assert control(node.frames()) == [(0x3F, 1)]
    assert node.acknowledge() == []
    node.word |= 0x1000
    assert control(node.acknowledge()) == [(0x2F, 1)]
    assert node.acknowledge() == []
    assert node.set_points.unacknowledged == 0
    node.word &= ~0x1000
    assert control(node.frames()) == [(0x3F, 1)]
    assert control(node.frames()) == [(0x3F, 1)]
    assert node.set_points.unacknowledged == 2
    node.goal = State.QUICK_STOP
    assert control(node.frames()) == [(0x02, 1)]
    assert node.set_points.unacknowledged == 0


@every_case(
    ("profile", "mode", "homing", "own", "problem"),
    [
        ("faulhaber_v3", Mode.CSP, False, Mode.CSP, ""),
        ("faulhaber_v3", Mode.CST, False, Mode.CST, ""),
        ("faulhaber_v3", Mode.CSP, True, Mode.HM, ""),
        ("mclm", Mode.CSP, False, Mode.PP, ""),
        ("mclm", Mode.CSV, False, Mode.PV, ""),
        ("mclm", Mode.CST, False, Mode.PP, "axis: has no mode for cst: 6502h is 25h."),
        ("mclm", Mode.CST, True, Mode.HM, ""),
    ],
)
def test_mode_or_its_substitute(profile, mode, homing, own, problem):
    node = unconnected_node(profile)
    node.mode, node.homing = mode, homing
    assert (node.own_mode, node.mode_problem) == (own, problem)


def test_cycles_in_another_mode_are_counted_while_targets_are_followed():
    node = enabled(Mode.CSV)
    counts = []
    for shown in (None, 9, 8, 8, 9, 8):
        node.shown_mode = shown
        node.frames()
        counts.append(node.cycles_in_other_mode)
    assert counts == [0, 0, 1, 2, 0, 1]
    node.goal = State.QUICK_STOP
    node.frames()
    assert node.cycles_in_other_mode == 0


def test_a_target_position_has_the_slope_of_its_cycle():
    node = unconnected_node()
    node.raw_position = 3000
    assert (node.last_target, node.tracking_error) == (pytest.approx(3e-3), 0.0)
    node.set_target(0.001, CYCLE)
    assert (node.target_position, node.speed) == (0.001, 0.0)
    assert node.tracking_error == pytest.approx(-2e-3)
    node.set_target(0.0015, CYCLE)
    assert node.speed == pytest.approx(0.1)
    node.offset, node.target_velocity = 0.08, 0.3
    node.first_half_step()
    assert (node.target_position, node.target_velocity, node.offset) == (
        pytest.approx(0.00125),
        pytest.approx(0.15),
        pytest.approx(0.04),
    )
    node.second_half_step()
    assert node.target_position == pytest.approx(0.0015)
    node.set_target(0.001, CYCLE)
    assert node.speed == pytest.approx(-0.1)
    node.clear_target()
    assert (node.previous_target, node.speed, node.offset) == (None, 0.0, 0.0)
    node.target_position = 0.7
    node.first_half_step()
    node.second_half_step()
    assert node.target_position == 0.7
    node.set_target(0.002, CYCLE)
    assert node.speed == 0.0


def test_acceleration_of_targets_is_limited_in_the_mode_of_the_drive():
    """At 4 m/s^2 a cycle of 5 ms changes a speed by 20 mm/s."""
    keys = {"limits": {"acceleration": "4 m/s^2"}, "follow": {"feedforward": 0.5}}
    node = enabled(Mode.CSV, **keys)
    node.target_velocity = 0.05
    speeds = []
    for _ in range(3):
        node.limit_acceleration(CYCLE, 0)
        speeds.append(node.acceleration.velocity)
    assert speeds == pytest.approx([0.02, 0.04, 0.05])
    node.goal = State.QUICK_STOP
    node.raw_position = 1234
    node.limit_acceleration(CYCLE, 0)
    assert (node.acceleration.position, node.acceleration.velocity) == (pytest.approx(1.234e-3), 0.0)

    node = enabled(Mode.CST, **keys)
    node.raw_velocity = 30  # a mode that follows begins at the speed that it has
    node.limit_acceleration(CYCLE, 0)
    assert node.acceleration.velocity == pytest.approx(0.03)

    for sign in (1, -1):
        node = enabled(Mode.CSP, **keys)
        node.limit_acceleration(CYCLE, 0)
        node.target_position, node.offset = 0.02 * sign, sign * 2.0
        node.limit_acceleration(CYCLE, 0)
        assert node.acceleration.velocity == pytest.approx(sign * 0.02)
        assert node.offset == pytest.approx(sign * 0.01)  # half of the limited speed, not of the target's


def test_process_data_are_taken_only_in_their_own_size():
    node = unconnected_node()
    node.process_frame(frame(0x180, struct.pack("<Hbi", 0x227, 8, -1500)), 7)
    assert (node.word, node.shown_mode, node.raw_position, node.word_at) == (0x227, 8, -1500, 7)
    assert (node.answered, node.answered_at, node.was_remote) == (1, 7, True)
    node.process_frame(frame(0x280, struct.pack("<ih", -12, 34)), 8)
    assert (node.raw_velocity, node.raw_current, node.velocity_at) == (-12, 34, 8)
    node.process_frame(frame(0x180, struct.pack("<Hb", 0x240, 9)), 9)
    node.process_frame(frame(0x280, b"\1\0"), 9)
    node.process_frame(frame(0x380, struct.pack("<H", 0x1227)), 9)  # none is mapped there
    assert (node.word, node.shown_mode, node.raw_velocity, node.word_at, node.velocity_at) == (0x227, 8, -12, 7, 8)
    node.process_frame(frame(0x180, struct.pack("<Hbi", 0x027, 8, 0)), 10)
    assert (node.answered, node.was_remote) == (2, True)
    node.forget()
    assert node.was_remote is False

    node = unconnected_node("mclm")
    node.process_frame(frame(0x380, struct.pack("<H", 0x1227)), 9)
    assert (node.word, node.word_at, node.answered) == (0x1227, 9, 0)
    node.process_frame(frame(0x380, b"\0"), 11)
    assert node.word_at == 9


def test_following_error_of_each_mode():
    """In csp against the target; in csv the commanded distance of a second minus the actual one; in cst none."""
    node = enabled(Mode.CSP)
    node.raw_position, node.target_position = 1000, 0.0015
    assert node.following_error == pytest.approx(0.5e-3)

    node = enabled(Mode.CSV)
    assert node.following_error == 0.0
    node.acceleration.velocity = 0.1
    node.raw_position = 1000
    for _ in range(3):
        node.follow(CYCLE, CYCLE)
    assert node.following_error == pytest.approx(1.5e-3)
    node.raw_position = 1400
    assert node.following_error == pytest.approx(1.1e-3)
    node.follow(CYCLE, 2 * CYCLE)  # the last cycle took twice its time
    assert node.following_error == pytest.approx(2.1e-3)
    for _ in range(300):
        node.follow(CYCLE, CYCLE)
    assert len(node.distances) == 200
    node.follow(CYCLE, CYCLE)
    assert node.following_error == pytest.approx(0.1)
    node.mode = Mode.CST
    node.follow(CYCLE, CYCLE)
    assert node.following_error == 0.0


@pytest.mark.parametrize(
    ("entered_from", "limits"),
    [(None, (-0.035, 0.035)), (0.01, (-0.035, 0.035)), (-0.04, (-0.041, 0.035)), (0.04, (-0.035, 0.041))],
)
def test_a_drive_may_come_back_from_beyond_its_limits(entered_from, limits):
    node: Node = unconnected_node()
    node.entered_from = entered_from
    assert node.position_limits == pytest.approx(limits)
