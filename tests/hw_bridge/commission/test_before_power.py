"""What is shown, limited and checked before a drive gets power."""

from types import SimpleNamespace

import pytest

from hw_bridge.command.bench.motion import ramp
from hw_bridge.command.bench.single_axis import check_before_power
from hw_bridge.commission import Axis, planned_rows
from hw_bridge.dictionary import State
from hw_bridge.master.plan import plan_drive
from tests.every_case import every_case
from tests.hw_bridge.unconnected import WORDS, unconnected_node
from twin.errors import SimulationError


@every_case(
    ("velocity", "acceleration", "expected"),
    [
        (None, None, (2e-3, 0.4)),
        ("80 mm/s", "4 m/s^2", (0.08, 4.0)),
        (
            "81 mm/s",
            None,
            "--velocity 81 mm/s: must be above 0 and at most 80 mm/s, 80 % of nodes.axis.limits.velocity of the hardware file.",
        ),
        (
            "0 mm/s",
            None,
            "--velocity 0 mm/s: must be above 0 and at most 80 mm/s, 80 % of nodes.axis.limits.velocity of the hardware file.",
        ),
        (
            None,
            "4.1 m/s^2",
            "--acceleration 4.1 m/s^2: must be above 0 and at most 4 m/s^2, nodes.axis.limits.acceleration of the hardware file.",
        ),
    ],
)
def test_speeds_of_a_motion_keep_to_the_limits(velocity, acceleration, expected):
    """Where nothing is said, 2 % of the velocity and 10 % of the acceleration; at most 80 % of the velocity."""
    keys = unconnected_node(limits={"velocity": "100 mm/s", "acceleration": "4 m/s^2"}).keys
    if isinstance(expected, tuple):
        assert ramp(Axis("axis", keys, False), velocity, acceleration) == pytest.approx(expected)
        return
    with pytest.raises(SimulationError) as caught:
        ramp(Axis("axis", keys, False), velocity, acceleration)
    assert str(caught.value) == expected


def test_planned_writes_for_users():
    """Each in the units of its own time: 1/min before, mrpm after 60A9h was written; 0.18 deg for an increment."""
    limits = {
        "velocity": "50 rad/s",
        "acceleration": "100 rad/s^2",
        "following_error": "0.2 rad",
        "position": ["-1 rad", "3 rad"],
        "force": "0.1 N*m",
    }
    node = unconnected_node("epos4", limits=limits)
    rows = {row.object: row[1:] for row in planned_rows(plan_drive(node, 5_000_000, 127))}
    assert len(rows) == 30
    assert rows["607Fh.0"] == (
        "Max profile velocity",
        "300000 deg/s (50000)",
        "2864.79 deg/s (477465)",
        "limits.velocity",
    )
    assert rows["6081h.0"] == ("Profile velocity", "6000 deg/s (1000)", "2864.79 deg/s (477465)", "limits.velocity")
    assert rows["6065h.0"] == ("Following error window", "360 deg (2000)", "11.52 deg (64)", "limits.following_error")
    assert rows["607Dh.1"][1:3] == ("none if both are 0 (0)", "-80.28 deg (-446)")
    assert rows["1017h.0"] == ("Producer heartbeat time", "0 ms (0)", "20 ms (20)", "heartbeat.every")
    assert rows["1400h.2"][:3] == ("RPDO 1: Transmission type", "255", "1")
    assert rows["1600h.1"][:3] == ("RPDO 1: Mapped object 1", "60400010h", "607A0020h")
    assert rows["1A00h.2"][1:3] == ("0h", "60610008h")
    assert rows["1A00h.0"][:3] == ("TPDO 1: Number of mapped objects", "1", "3")
    assert rows["1801h.1"][:3] == ("TPDO 2: COB-ID", "C0000283h", "40000283h")
    assert "1601h.1" not in rows  # it stays as it is
    assert node.units.velocity == pytest.approx(6.283185307179586 / 60_000)


@pytest.mark.parametrize(
    ("values", "limits", "problem", "printed"),
    [
        ({}, {}, "", ""),
        ({(0x6041, 0): WORDS[State.ENABLED]}, {}, "axis: is in Operation enabled: somebody drives it.", ""),
        (
            {(0x1001, 0): 0x10},
            {},
            "axis: reports an earlier error (1001h is 10h). Reset it first: twin hil reset -f FILE",
            "",
        ),
        ({(0x1001, 0): 0x10, (0x6041, 0): WORDS[State.FAULT]}, {}, "", ""),  # the master reports that
        (
            {},
            {"velocity": "2.5 m/s"},
            "",
            "note: axis: limits.velocity 2500 mm/s is above the drive's own 2000 mm/s (6080h).",
        ),
        (
            {},
            {"velocity": "21 m/s"},
            "axis: limits.velocity 21000 mm/s is above the drive's own 2000 mm/s (6080h). Correct the unit",
            "",
        ),
    ],
)
def test_what_is_checked_before_power(capsys, values, limits, problem, printed):
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED], **values}, limits={"force": "15 N", **limits})
    waits = []
    session = SimpleNamespace(network=SimpleNamespace(wall_clock=False), wait=waits.append, drive=lambda _: node)
    axis = Axis("axis", node.keys, False)
    if problem:
        with pytest.raises(SimulationError) as caught:
            check_before_power(session, axis, "FILE")
        assert str(caught.value).startswith(problem)
    else:
        check_before_power(session, axis, "FILE")
    assert waits == [500_000_000]
    assert node.rotary is axis.rotary
    assert " ".join(capsys.readouterr().out.split()).startswith(printed)
    session.network.wall_clock = True
    if not problem:
        check_before_power(session, axis, "FILE")
        assert len(waits) == 1
