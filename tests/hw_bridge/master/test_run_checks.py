"""What ends a run, at its limit and just beyond: messages of a drive, its state, and the limits of the hardware file."""

from types import SimpleNamespace

import pytest

from hw_bridge.dictionary import Mode, NmtState, State
from hw_bridge.master.run_checks import control_problem, drive_problem
from hw_bridge.master.station import EmergencyMessage
from tests.every_case import every_case
from tests.hw_bridge.unconnected import WORDS, unconnected_node

MS = 1_000_000
CYCLE = 5 * MS
LIMITS = {
    "position": ["-20 mm", "30 mm"],
    "velocity": "100 mm/s",
    "force": "5 N",
    "following_error": "2 mm",
    "acceleration": "4 m/s^2",
}


def problem(node, now=60 * MS, oldest=20 * MS):
    """The problem of a drive whose last heartbeat came at 0, at a time [ns]."""
    master = SimpleNamespace(network=SimpleNamespace(now=now), max_missed_cycles=5, oldest=oldest, cycle=CYCLE)
    return drive_problem(master, node)


@pytest.fixture(params=[False, True], ids=["", "inverted"])
def drive(request):
    """A drive that follows in csp without any problem; 1 um, 1 mm/s and 10 mN for each of its units."""
    node = unconnected_node(inverted=request.param, limits=LIMITS, force_constant=f"{0.01 / 0.79e-3} N/A")
    node.word, node.goal, node.mode, node.nmt_state = (
        WORDS[State.ENABLED],
        State.ENABLED,
        Mode.CSP,
        NmtState.OPERATIONAL,
    )
    for age in node.ages.values():
        age.sampled_at = age.last = 50 * MS
    assert problem(node) == ""
    return node


def at_member(node, **values):
    """Set actual values in units of the drive, in the member's direction."""
    for name, value in values.items():
        setattr(node, f"raw_{name}", -value if node.keys.inverted else value)
    node.target_position = node.position


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"position": 30_000}, ""),
        ({"position": 30_001}, "axis: position 30.00 mm is outside -20.00 mm to 30.00 mm."),
        ({"position": -20_000}, ""),
        ({"position": -20_010}, "axis: position -20.01 mm is outside -20.00 mm to 30.00 mm."),
        ({"velocity": 100}, ""),
        ({"velocity": 101}, "axis: velocity 101.00 mm/s is above 100.00 mm/s."),
        ({"velocity": -101}, "axis: velocity -101.00 mm/s is above 100.00 mm/s."),
        ({"current": 499}, ""),
        ({"current": 501}, "axis: force 5.01 N is above 5 N."),
        ({"current": -501}, "axis: force -5.01 N is above 5 N."),
    ],
)
def test_actual_values_beyond_a_limit(drive, values, text):
    at_member(drive, **values)
    if "position" in values:  # exact in double precision
        drive.keys.limits.position[:] = [-0.02 - 1e-9, 0.03 + 1e-9]
    assert problem(drive) == text
    if values.get("current", 0) > 500:
        drive.rotary = True
        assert problem(drive) == "axis: force 5.01 N m is above 5 N m."


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (1.999e-3, ""),
        (-1.999e-3, ""),
        (2.01e-3, "axis: following error 2.01 mm is above 2.00 mm."),
        (-2.01e-3, "axis: following error -2.01 mm is above 2.00 mm."),
    ],
)
def test_a_following_error_of_either_sign(drive, error, text):
    drive.target_position = drive.position + error
    assert problem(drive) == text


@every_case(
    ("mode", "acceleration", "force", "is_problem"),
    [
        (Mode.CST, 4.1, 0.05, True),
        (Mode.CST, -4.1, -0.05, True),
        (Mode.CST, 3.9, 1.0, False),
        (Mode.CST, 4.1, -1.0, False),  # it is braked by its motor
        (Mode.CST, 4.1, 0.0, False),
        (Mode.CSV, 4.1, 1.0, False),  # there its targets are limited
    ],
)
def test_in_cst_the_measured_acceleration_is_limited(mode, acceleration, force, is_problem):
    node = unconnected_node(limits=LIMITS)
    node.word, node.goal, node.mode = WORDS[State.ENABLED], State.ENABLED, mode
    node.raw_current = round(force / 11.64 / 0.79e-3)
    for cycle in range(5):
        node.acceleration.measure(acceleration * 0.005 * cycle, CYCLE * cycle)
    for age in node.ages.values():
        age.sampled_at = age.last = 0
    text = "axis: acceleration 4.1 m/s^2 is above 4 m/s^2 in cst, where only the force can be bounded."
    assert problem(node) == (text if is_problem else "")


def test_messages_of_a_station_end_a_run(drive):
    """The order is that of causes: an EMCY first, then a missing heartbeat, then process data."""
    assert problem(drive, now=60 * MS) == ""
    heartbeat = "axis: no heartbeat for 61 ms. Check its power and the bus."
    assert problem(drive, now=61 * MS) == heartbeat
    drive.emergencies.append(EmergencyMessage(0, 0x0000))
    assert problem(drive) == ""  # the end of an error
    drive.emergencies.append(EmergencyMessage(0, 0x0100, 1))
    assert problem(drive, now=61 * MS).startswith("axis: EMCY 0100h")
    drive.emergencies[1] = EmergencyMessage(0, 0x4310, 8, bytes([0x21, 0, 0, 0, 0]))
    text = "axis: EMCY 4310h, temperature (1001h 08h temperature; vendor's bytes 21 00 00 00 00, 2320h speed deviation, temperature)."
    assert problem(drive) == text


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"silent": 4}, ""),
        ({"silent": 5}, "axis: no process data for 5 cycles. Check the bus."),
        ({"boots": 1, "silent": 1}, "axis: started anew by itself. Check its supply."),
        ({"boots": 1, "silent": 0}, ""),
        (
            {"boots": 1, "booted_at": 5, "answered_at": 6},
            "axis: two nodes have node-ID 3. Take one off the bus, and give it another: twin hil lss.",
        ),
        ({"boots": 1, "booted_at": 5, "answered_at": 5}, ""),
        (
            {"nmt_state": NmtState.STOPPED},
            "axis: left NMT Operational: Stopped. Another master stopped it, or an error of its own.",
        ),
        (
            {"nmt_state": NmtState.PRE_OPERATIONAL},
            "axis: left NMT Operational: Pre-operational. Another master stopped it, or an error of its own.",
        ),
        ({"nmt_state": None}, ""),
        ({"word": WORDS[State.QUICK_STOP]}, "axis: left Operation enabled: Quick stop active."),
        ({"cycles_in_other_mode": 5, "shown_mode": 9}, ""),
        (
            {"cycles_in_other_mode": 6, "shown_mode": 9},
            "axis: is in mode 9 (6061h), not in csp: another program sets it, perhaps the vendor's over USB. End that program.",
        ),
    ],
)
def test_a_state_that_a_run_does_not_expect(drive, values, text):
    for name, value in values.items():
        setattr(drive, name, value)
    assert problem(drive) == text


def test_who_controls_a_drive():
    node = unconnected_node("mclm")
    node.word = WORDS[State.ENABLED]
    assert control_problem(node, 5) == ""
    node.word &= ~0x200
    assert control_problem(node, 5) == ""  # it never had the bit: few drives have
    node.was_remote = True
    assert control_problem(node, 5) == (
        "axis: does not obey the bus any more (6041h, bit 9 is 0): it is operated locally, perhaps by the vendor's "
        "program over USB. End that program."
    )
    node.word |= 0x200
    node.set_points.unacknowledged = 5
    assert control_problem(node, 5) == ""
    node.set_points.unacknowledged = 6
    assert control_problem(node, 5) == (
        "axis: does not acknowledge set-points (6041h, bit 12). Look at its statusword and limits."
    )


def test_actual_values_that_are_too_old(drive):
    """The age counts to the end of the cycle: a sample that lags by three cycles is four old."""
    for age in drive.ages.values():
        age.last = 65 * MS
    assert problem(drive, oldest=20 * MS) == ""
    text = (
        "axis: its actual values are 20 ms old, more than 19 ms: SYNC or process data come late. Check the bus and the "
        "adapter, or set limits.actual_value_age."
    )
    assert problem(drive, oldest=19 * MS) == text
    drive.silent = 1  # it is told by what is missing
    assert problem(drive, oldest=19 * MS) == ""
    drive.silent = 0
    drive.ages[0x180].in_doubt = True
    assert problem(drive, oldest=19 * MS) == ""
    drive.ages[0x180].in_doubt = False
    drive.keys.limits.actual_value_age = 25 * MS  # the file's limit counts
    assert problem(drive, oldest=19 * MS) == ""
    drive.keys.limits.actual_value_age = 19 * MS
    assert problem(drive, oldest=25 * MS) == text


def test_a_mode_that_a_drive_does_not_have(drive):
    drive.mirror.values[0x6502, 0] = 1 << Mode.CSV - 1
    assert problem(drive) == "axis: has no mode for csp: 6502h is 100h."
