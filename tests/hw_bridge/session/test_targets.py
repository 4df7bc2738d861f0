"""Targets of a member as a drive receives them: checks, limits, modes of following; outputs that show its values."""

from math import inf, nan
from types import SimpleNamespace

import pytest

from hw_bridge.dictionary import Mode, State
from hw_bridge.hardware import HardwareKeys, LimitKeys
from hw_bridge.session import targets
from hw_bridge.session.output_bindings import DRIVE_OUTPUTS
from hw_bridge.session.outputs import levels
from hw_bridge.session.run_outcome import RunOutcome
from hw_bridge.session.target_dispatcher import TargetDispatcher
from tests.every_case import every_case
from tests.hw_bridge.axis import node as node_keys
from tests.hw_bridge.unconnected import WORDS, unconnected_node
from twin.errors import SimulationError

CYCLE = 5_000_000
LIMITS = {"velocity": "100 mm/s", "force": "5 N", "following_error": "2 mm"}


def member(**views):
    """A member with these variables."""
    return SimpleNamespace(views=views)


@pytest.mark.parametrize(("value", "target"), [(0.079, 0.079), (0.081, 0.08), (-0.081, -0.08), (0.0, 0.0)])
def test_a_velocity_target_is_clamped_to_80_percent(value, target):
    limits = LimitKeys.model_validate(LIMITS)
    assert targets.velocity("axis", member(target_velocity=value), limits) == pytest.approx(target)


@every_case(
    ("views", "scale", "force"),
    [
        ({"target_force": 3.0}, 2.0, 3.0),
        ({"target_force": -9.0}, 2.0, -4.0),
        ({"target_force": 9.0}, 2.0, 4.0),
        ({"target_torque": 0.02}, 0.01, 2.0),  # 10 mm of the member for 1 rad of the motor
        ({"target_torque": -0.02, "target_force": 1.0}, 0.01, 1.0),
    ],
)
def test_a_force_target_is_that_of_the_member(views, scale, force):
    assert targets.force("axis", member(**views), LimitKeys.model_validate(LIMITS), scale) == pytest.approx(force)


@pytest.mark.parametrize("value", [inf, -inf, nan])
def test_a_target_that_is_not_finite_ends_the_run(value):
    text = f"axis: target_velocity is {value}, no number that a drive can follow. All drives stop."
    with pytest.raises(SimulationError) as caught:
        targets.velocity("axis", member(target_velocity=value), LimitKeys())
    assert str(caught.value) == text


def test_a_position_target_that_jumps_ends_the_run():
    node = unconnected_node(limits=LIMITS)
    node.raw_position = 10_000
    assert targets.position(node, member(target_position=0.0119)) == 0.0119
    assert targets.position(node, member(target_position=0.0081)) == 0.0081
    for position, text in ((0.0121, "12.10"), (0.0079, "7.90")):
        with pytest.raises(SimulationError) as caught:
            targets.position(node, member(target_position=position))
        expected = f"axis: target_position {text} mm is 2.10 mm from where the drive is, a jump. All drives stop."
        assert str(caught.value) == expected


@every_case(
    ("wanted", "profile", "variables", "problem"),
    [
        (8, "mclm", (), ""),
        (9, "mclm", (), ""),
        (10, "faulhaber_v3", ("target_force",), ""),
        (10, "faulhaber_v3", ("target_torque",), ""),
        (1, "faulhaber_v3", (), "mode_of_operation 1: no cyclic mode. Use 8 (csp), 9 (csv) or 10 (cst)."),
        (
            10,
            "faulhaber_v3",
            ("force",),
            "mode_of_operation 10: cst needs a member with target_force or target_torque. Use 8 (csp) or 9 (csv).",
        ),
        (
            10,
            "mclm",
            ("target_force",),
            "mode_of_operation 10: FAULHABER MCLM 300x CO has no cst. Use 8 (csp) or 9 (csv), or a drive that has it.",
        ),
    ],
)
def test_modes_that_cannot_be_followed(wanted, profile, variables, problem):
    assert targets.unknown_mode(wanted, unconnected_node(profile).profile, variables) == problem


def case(parameters=(), actions=()):
    """A case whose member `axis` has these parameters, and actions on these variables."""
    return SimpleNamespace(
        members={"axis": SimpleNamespace(parameters=dict.fromkeys(parameters, 0.0))},
        actions=[SimpleNamespace(variable=name) for name in actions],
    )


@every_case(
    ("given", "connected", "receives"),
    [
        (case(), (), False),
        (case(["target_velocity"]), (), False),
        (case(["target_force"]), (), True),
        (case(["target_torque"]), (), True),
        (case(), ("axis.target_force",), True),
        (case(), ("b.target_force",), False),
        (case(actions=["axis.target_torque"]), (), True),
        (case(actions=["axis.target_velocity"]), (), False),
    ],
)
def test_process_data_have_a_force_where_a_case_sets_one(given, connected, receives):
    assert targets.receives_target_force("axis", given, connected) is receives


def dispatcher(forced=(), **views):
    """The targets of one axis, whose drive stands at 10 mm."""
    keys = {"follow": views.pop("follow", {}), "limits": LIMITS}
    file = HardwareKeys.model_validate({"simulated": True, "nodes": {"axis": node_keys(number=3, **keys)}})
    made = TargetDispatcher(file)
    made.axes["axis"] = member(**views)
    made.forced = set(forced)
    node = unconnected_node(**keys)
    node.raw_position = 10_000
    return made, node


@every_case(
    ("follow", "mode", "speeds", "offset"),
    [
        # 0.5 mm in a cycle of 5 ms are 100 mm/s, clamped to 80
        ({}, Mode.CSP, 0.0, 0.0),
        ({"feedforward": 0.5}, Mode.CSP, 0.0, 0.05),
        ({"feedforward": 1.0}, Mode.CSP, 0.0, 0.08),
        # 50 1/s times the error of the cycle before, 0.2 mm, and what is fed forward
        ({"mode": "csv"}, Mode.CSV, 0.01, 0.0),
        ({"mode": "csv", "gain": "20 1/s"}, Mode.CSV, 0.004, 0.0),
        ({"mode": "csv", "feedforward": 0.5}, Mode.CSV, 0.06, 0.05),
        ({"mode": "csv", "feedforward": 1.0}, Mode.CSV, 0.08, 0.08),
    ],
)
def test_a_position_followed_in_either_mode(follow, mode, speeds, offset):
    made, node = dispatcher(follow=follow, target_position=0.0102)
    made.set_drive_targets(node, Mode.CSP)
    made.axes["axis"].views["target_position"] = 0.0107
    assert made.set_drive_targets(node, Mode.CSP) is mode
    assert node.target_position == 0.0107
    assert (node.target_velocity, node.offset) == (pytest.approx(speeds), pytest.approx(offset))


@pytest.mark.parametrize(("speed", "limited"), [(0.04, 0.04), (-0.09, -0.08)])
def test_a_speed_followed_in_either_mode(speed, limited):
    made, node = dispatcher(target_velocity=speed)
    node.set_target(0.5, CYCLE)
    assert made.set_drive_targets(node, Mode.CSV) is Mode.CSV
    assert (node.target_velocity, node.offset, node.previous_target) == (pytest.approx(limited), 0.0, None)

    made, node = dispatcher(target_velocity=speed, follow={"mode": "csp", "feedforward": 0.5})
    positions = []
    for _ in range(3):
        assert made.set_drive_targets(node, Mode.CSV) is Mode.CSP
        positions.append(node.target_position)
    assert positions == pytest.approx([0.01 + 0.005 * limited * cycle for cycle in (1, 2, 3)])
    assert node.offset == pytest.approx(0.5 * limited)


def test_a_force_is_followed_as_a_force_whatever_the_file_says_of_positions():
    made, node = dispatcher(forced=["axis"], target_force=1.0, follow={"mode": "csp"})
    node.set_target(0.5, CYCLE)
    assert made.set_drive_targets(node, Mode.CST) is Mode.CST
    assert (node.previous_target, node.offset) == (None, 0.0)


def test_modes_of_a_member():
    made, _ = dispatcher(forced=["axis"], mode_of_operation=10, target_force=0.0)
    made.begin()
    assert made.mode("axis") is Mode.CST
    made, _ = dispatcher()
    assert made.mode("axis") is Mode.CSV
    made, _ = dispatcher(mode_of_operation=10, target_force=0.0)
    made.begin()  # the initial mode decides about process data
    assert made.forced == {"axis"}
    made, _ = dispatcher(mode_of_operation=8, target_force=0.0, target_position=0.0)
    made.begin()
    assert made.forced == set()
    made.axes["axis"].views["mode_of_operation"] = 10
    with pytest.raises(SimulationError, match=r"^axis: mode_of_operation 10: its process data have no force\. Begin"):
        made.mode("axis")
    made.axes["axis"].views["mode_of_operation"] = 1
    with pytest.raises(SimulationError, match=r"^axis: mode_of_operation 1: no cyclic mode.* All drives stop\.$"):
        made.mode("axis")
    made, _ = dispatcher(target_position=nan)
    with pytest.raises(SimulationError, match="target_position is nan"):
        made.begin()


def retraction(velocity, reason="too much", done=False):
    """A monitor of the contact force that retracts, or not."""
    return SimpleNamespace(reason=reason, velocity=lambda: velocity, done=lambda: done, outcome=lambda: "Retracted.")


def test_while_one_drive_retracts_the_others_stand():
    made, node = dispatcher(target_velocity=0.05)
    other, module = unconnected_node(), SimpleNamespace(outputs=5)
    made.axes |= {"other": member(target_velocity=0.05)}
    nodes = {"axis": node, "other": other}
    for drive in nodes.values():
        drive.set_target(0.3, CYCLE)
        drive.outputs = 3
    master = SimpleNamespace(nodes=nodes, modules={"valves": module})
    watches = {"axis": retraction(-0.03), "other": retraction(-0.09, reason="")}
    made.set_targets(master, watches)
    assert [drive.mode for drive in nodes.values()] == [Mode.CSV, Mode.CSV]
    assert [drive.target_velocity for drive in nodes.values()] == [-0.03, 0.0]
    assert [drive.previous_target for drive in nodes.values()] == [None, None]
    assert (node.outputs, module.outputs) == (3, 5)
    watches["axis"] = retraction(0.0, done=True)
    with pytest.raises(SimulationError, match=r"^Retracted\. All drives stop\.$"):
        made.set_targets(master, watches)


def test_values_of_a_drive_by_names_of_outputs():
    node = unconnected_node(scale=2.0, inverted=True, force_constant="10 N/A")
    node.raw_position, node.raw_velocity, node.raw_current, node.age = 1000, 3, 100, 7_000_000
    node.word = WORDS[State.ENABLED] | 0x0800
    position, velocity = pytest.approx(-2e-3), pytest.approx(-6e-3)
    assert {name: value(node) for name, value in DRIVE_OUTPUTS.items()} == {
        "position_actual_value": position,
        "position": position,
        "angle": position,
        "motor_angle": pytest.approx(-1e-3),
        "velocity_actual_value": velocity,
        "velocity": velocity,
        "angular_velocity": velocity,
        "current": pytest.approx(-0.079),
        "force": pytest.approx(-0.79),
        "torque": pytest.approx(-1.58),
        "limited": True,
        "actual_value_age": pytest.approx(0.007),
    }
    node.word &= ~0x0800
    assert DRIVE_OUTPUTS["limited"](node) is False


def test_levels_of_outputs():
    """Bits with a signal follow it, the others are those at rest."""
    assert levels({0: "a", 3: "b"}, 0b0111, member(output_0=False, output_3=True)) == 0b1110
    assert levels({0: "a", 3: "b"}, 0b1000, member(output_0=True, output_3=False)) == 0b0001
    assert levels({}, 5, member()) == 5


def test_events_of_a_case_are_sorted_by_time():
    outcome = RunOutcome()
    fault = SimpleNamespace(at=1_500_000_000, text="drop of axis")
    events = ["2.000000 s: node 3 EMCY", "before: boot-up", "0.100000 s: node 3 Operational"]
    assert outcome.timeline([], events) == [events[1], events[2], events[0]]
    outcome.stopped = 1_900_000_000, "too fast"
    assert outcome.timeline([fault], events) == [
        events[1],
        events[2],
        "1.500000 s: FAULT drop of axis",
        "1.900000 s: STOP too fast",
        events[0],
    ]
    outcome.unsafe = ["moves.", "outputs 1."]
    found = outcome.termination()
    assert (found.time_ns, found.reason, found.unsafe) == (1_900_000_000, "too fast", "moves. outputs 1.")
