"""Numbers that follow from a hardware file: quantities, sizes of process data, bounds of a stall, absurd limits, homing."""

from math import pi, sin

import pytest

from hw_bridge.bus import Frame, bit_count
from hw_bridge.dictionary import Dictionary
from hw_bridge.fault import Cause, Fault
from hw_bridge.hardware import FaultKeys, HardwareKeys, gain_problem, motor_data, stall_bounds
from hw_bridge.hardware.contradictions import max_gain
from hw_bridge.hardware.file import bus_load, overloaded, process_data
from hw_bridge.hardware.homing_checks import homing_conflict, search_direction
from hw_bridge.hardware.keys import object_address, object_names, output_bits
from hw_bridge.hardware.quantities import format_quantity, parse, positive_milliseconds, timed, without_unit
from tests.every_case import every_case
from tests.hw_bridge.axis import node as node_keys

LIMITS = {"position": ["-25 mm", "35 mm"], "velocity": "100 mm/s", "acceleration": "4 m/s^2", "force": "5 N"}


def file(profile="faulhaber_v3", late_cycle=None, cycle="5 ms", bit_rate=1_000_000, **keys):
    """A hardware file of one drive."""
    nodes = {"axis": node_keys(profile, **{"limits": LIMITS, **keys})}
    root = {"simulated": True, "nodes": nodes, "late_cycle": late_cycle or {}, "cycle": cycle, "bit_rate": bit_rate}
    return HardwareKeys.model_validate(root)


@every_case(
    ("value", "unit", "text"),
    [
        (0.0123456789, "m", "12.3457 mm"),
        (-0.05, "m/s", "-50 mm/s"),
        (99.9, "m", "99900 mm"),
        (100.0, "m", "100 m"),
        (-100.0, "m/s", "-100 m/s"),
        (4.0, "m/s^2", "4 m/s^2"),
        (pi, "rad", "180 deg"),
        (pi / 2, "rad/s", "90 deg/s"),
        (999.0, "mA", "999 mA"),
        (1000.0, "mA", "1 A"),
        (-12345.0, "mV", "-12.35 V"),
        (0.12345, "N", "0.1235 N"),
    ],
)
def test_quantities_as_text(value, unit, text):
    assert format_quantity(value, unit) == text


@every_case(
    ("value", "bare"),
    [
        (3, True),
        ("3", True),
        (0, False),
        ("0.0", False),
        (True, False),
        ("3 mm", False),
        (float("inf"), False),
        (None, False),
        (-1e-9, True),
    ],
)
def test_a_bare_number_has_no_unit(value, bare):
    assert without_unit(value) is bare


def test_quantities_are_in_si():
    assert parse("5 mm", ("m", "rad")) == (pytest.approx(0.005), "m")
    assert parse("180 deg", ("m", "rad")) == (pytest.approx(pi), "rad")
    assert parse("1000 km", ("m", "rad")) == (1e6, "m")
    assert parse(0, ("m", "rad")) == (0.0, "m")
    for value, text in (
        ("1000.1 km", "at most 1e\\+06"),
        ("-1000.1 km", "at most"),
        (5, "5 has no unit.* such as 30 mm"),
        ("5 s", "`5 s` does not convert to m"),
    ):
        with pytest.raises(ValueError, match=text):
            parse(value, ("m", "rad"))


def test_times_are_above_zero():
    assert (timed("1.5 us"), positive_milliseconds("1 ms"), positive_milliseconds("2 s")) == (
        1500,
        1_000_000,
        2_000_000_000,
    )
    for convert, values in ((timed, ("0 ms", "-1 ms", 60)), (positive_milliseconds, ("0 ms", "1.5 ms", "-5 ms", 60))):
        for value in values:
            with pytest.raises(ValueError, match=r"has no unit|above zero"):
                convert(value)


def test_addresses_and_bits():
    assert object_address("607Dh", "1") == (0x607D, 1)
    assert object_address("FFFF", "255") == (0xFFFF, 255)
    for index, sub in (("10000", "0"), ("607D", "256"), ("607D", "-1"), ("-1", "0"), ("xyz", "0")):
        with pytest.raises(ValueError):
            object_address(index, sub)
    assert object_names(["6083h", "607D.1"]) == frozenset({(0x6083, None), (0x607D, 1)})
    assert object_names("all") == "all"
    assert output_bits({0: "a.b", "31": "a.c"}) == {0: "a.b", 31: "a.c"}
    for bits in ({32: "a.b"}, {-1: "a.b"}, {1: "a.b", "01": "a.c"}):
        with pytest.raises(ValueError, match=r"expected a bit from 0 to 31|given twice"):
            output_bits(bits)


@pytest.mark.parametrize("cycle", [1_000_000, 5_000_000, 10_000_000])
def test_the_largest_gain_of_a_loop_with_dead_time(cycle):
    """A cycle and 5 ms of dead time; half of the gain at which x[k+1] = x[k] - h K x[k-n] oscillates."""
    cycles = 1.0 + 5e6 / cycle
    oscillates = 2.0 * sin(pi / (4.0 * cycles + 2.0)) / (cycle / 1e9)
    assert max_gain(cycle) == pytest.approx(0.5 * oscillates)
    assert gain_problem(0.5 * oscillates * (1 - 1e-9), cycle) == ""
    text = gain_problem(0.5 * oscillates * (1 + 1e-9), cycle)
    assert (
        f"the position loop is unstable from about {oscillates:.0f} 1/s. Use at most {int(0.5 * oscillates)} 1/s"
        in text
    )


@every_case(
    ("profile", "keys", "sizes"),
    [
        ("faulhaber_v3", {}, (4, 7, 7, 8, 1)),
        ("mclm", {}, (4, 7, 7, 8, 1, 7, 2, 2)),  # the handshake of profile position
        ("faulhaber_v3", {"outputs": {0: "a.b"}, "safe_outputs": 0}, (8, 7, 7, 8, 1)),
        ("faulhaber_v3", {"follow": {"feedforward": 1.0}}, (8, 7, 7, 8, 1)),
        ("faulhaber_v3", {"follow": {"feedforward": 1.0, "mode": "csv"}}, (4, 7, 7, 8, 1)),
        (
            "faulhaber_v3",
            {"outputs": {0: "a.b"}, "safe_outputs": 0, "follow": {"feedforward": 0.1}},
            (8, 7, 7, 8, 1, 4),
        ),
    ],
)
def test_bytes_of_a_drive_in_a_cycle(profile, keys, sizes):
    keys = file(profile, **keys)
    assert process_data(keys.nodes["axis"]) == sizes
    bits = (
        sum(bit_count(Frame(0, bytes(size))) for size in (*sizes, 2)) + bit_count(Frame(0)) + bit_count(Frame(0, b"0"))
    )
    assert bus_load(keys, 1) == pytest.approx(bits / 5000)


def test_a_bus_may_be_filled_to_80_percent():
    bits = round(bus_load(file()) * 5000)
    for rate, is_full in ((bits / 0.005 / 0.79, False), (bits / 0.005 / 0.81, True)):
        text = overloaded(file(bit_rate=round(rate)))
        assert bool(text) is is_full
        assert text.startswith("cycle: process data fills 81 % of 5 ms at" if is_full else "")


@every_case(
    ("late_cycle", "follow", "tolerated", "displacements"),
    [
        # at 100 mm/s, and 1.25 mm of braking with 4 m/s^2; 60 ms without a heartbeat
        ({}, {}, 60, (6e-3, 7.25e-3)),
        ({"at_most": "20 ms"}, {}, 20, (2e-3, 7.25e-3)),
        ({"at_most": "2 ms"}, {}, 5, (0.5e-3, 7.25e-3)),
        ({"policy": "stop", "at_most": "20 ms"}, {}, 5, (0.5e-3, 7.25e-3)),
        ({"policy": "slow_down"}, {"mode": "csv"}, 60, (6e-3, 7.25e-3)),
        ({}, {"mode": "csp"}, 60, (0.5e-3, 1.75e-3)),  # it stands at its last target
    ],
)
def test_displacement_of_a_drive_without_this_program(late_cycle, follow, tolerated, displacements):
    keys = file(late_cycle=late_cycle, follow=follow)
    assert stall_bounds.tolerated_lateness(keys) == tolerated * 1_000_000
    assert stall_bounds.max_displacement(keys, keys.nodes["axis"]) == pytest.approx(displacements)


def test_bounds_as_text():
    keys = file(late_cycle={"stiffness": "200 N/m"}, force_constant="10 N/A")
    (line,) = stall_bounds.bounds(keys, {"axis": False})
    assert line == (
        "axis: late_cycle hold, up to 60 ms: at 100 mm/s at most 6 mm; a program that dies: 7.25 mm until it misses the "
        "heartbeat and stands, 1.2 N and 1.45 N more against 200 N/m. Above 5 N this program stops it; without it the "
        "drive's current limit does, 15.8 N as its profile has it. Apart from that, actual values that are more than 21.25 ms "
        "old at SYNC end the run (limits.actual_value_age)."
    )
    for more in ({"at_most": "40 ms"}, {"policy": "stop"}):
        assert stall_bounds.bounds(file(late_cycle=more), {"axis": False})[0].endswith("as its profile has it.")
    keys = file(late_cycle={"stiffness": "200000 N/m"}, force_constant="10 N/A")
    assert ", 15.8 N and 15.8 N more against" in stall_bounds.bounds(keys, {"axis": False})[0]
    turning = {
        "limits": {
            "velocity": "90 deg/s",
            "acceleration": "900 deg/s^2",
            "force": "5 N*m",
            "position": ["0 deg", "90 deg"],
        }
    }
    (line,) = stall_bounds.bounds(file("epos4", late_cycle={"stiffness": "200 N/m"}, **turning), {"axis": True})
    assert line.startswith(
        "axis: late_cycle hold, up to 60 ms: at 90 deg/s at most 5.4 deg; a program that dies: 9.9 deg until"
    )
    assert "stands. Above 5 N m this program" in line


def test_the_force_of_a_drive_is_that_of_its_own_current_limits():
    """6072h, 2000 of a thousand of 790 mA, is less than the motor's peak; `objects` of the file replace what was read."""
    constant = motor_data.force_constant_of(file().nodes["axis"])
    lowered = file(objects={"6072h": 500}).nodes["axis"]
    read = Dictionary(lowered.drive.objects, 1)
    read.put(0x6072, 1000)
    assert motor_data.drive_force(file().nodes["axis"]) == pytest.approx(1.58 * constant)
    assert motor_data.drive_force(file().nodes["axis"], read) == pytest.approx(0.79 * constant)
    assert motor_data.drive_force(lowered, read) == motor_data.drive_force(lowered) == pytest.approx(0.395 * constant)
    assert read.get(0x6072) == 1000
    given = file(limits={**LIMITS, "actual_value_age": "21 ms"}, late_cycle={"at_most": "60 ms"})
    assert "more than 21 ms old at SYNC" in stall_bounds.bound(given, "axis", given.nodes["axis"], False, read)
    assert "9.196 N as it is set." in stall_bounds.bound(given, "axis", given.nodes["axis"], False, read)


def test_the_peak_force_is_that_at_the_member():
    """What a motor gives at its peak current, by the force constant; less where the member moves farther."""
    model = file().nodes["axis"].drive.motor
    own = motor_data.reached(model)["current"] * model.force_constant
    assert motor_data.peak(file().nodes["axis"]) == pytest.approx(own)
    assert motor_data.peak(file(scale=2.0).nodes["axis"]) == pytest.approx(0.5 * own)
    given = motor_data.peak(file(scale=2.0, force_constant="10 N/A").nodes["axis"])
    assert given == pytest.approx(10.0 * motor_data.reached(model)["current"])


@pytest.mark.parametrize("name", ["velocity", "force"])
@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_a_limit_of_more_than_ten_times_what_the_motor_reaches(name, scale):
    keys = file(scale=scale).nodes["axis"]
    model = keys.drive.motor
    reached = motor_data.reached(model)["velocity"] * scale if name == "velocity" else motor_data.peak(keys)
    unit = {"velocity": "m/s", "force": "N"}[name]
    for share, is_absurd in ((9.99, False), (10.01, True)):
        made = file(scale=scale, limits={name: f"{share * reached} {unit}"}).nodes["axis"]
        problems = motor_data.check(made)
        assert [path for path, _ in problems] == ([("limits", name)] if is_absurd else [])
        if is_absurd:
            what = "the motor reaches" if name == "velocity" else "the motor's peak current gives"
            value = made.limits.velocity if name == "velocity" else made.limits.force
            assert (
                problems[0][1]
                == f"{value:g} {unit} is no limit: {what} {reached:.3g} {unit}. Correct the unit or the number."
            )
    assert motor_data.check(file(motor="member", limits={name: f"{100 * reached} {unit}"}).nodes["axis"]) == []


@pytest.mark.parametrize(("error", "is_absurd"), [("59.9 mm", False), ("60.1 mm", True)])
def test_a_following_error_of_the_whole_range_is_no_limit(error, is_absurd):
    made = file(limits={"position": ["-25 mm", "35 mm"], "following_error": error}).nodes["axis"]
    assert [path for path, _ in motor_data.check(made)] == ([("limits", "following_error")] if is_absurd else [])


def mm(value):
    return f"{1e3 * value:.0f} mm"


@every_case(
    ("method", "inverted", "at", "conflict"),
    [
        # -3 searches the negative end of the drive, -4 the positive one; from -25 to 35 mm
        (-3, False, "5 mm", ""),
        (-3, False, "-25 mm", ""),
        (-3, False, "-85 mm", ""),
        (
            -3,
            False,
            "6 mm",
            "method -3 goes to the negative end, but `at` 6 mm is at the positive end of -25 mm to 35 mm: it would run through the limits. Correct method, `at` or `inverted`.",
        ),
        (
            -4,
            False,
            "4 mm",
            "method -4 goes to the positive end, but `at` 4 mm is at the negative end of -25 mm to 35 mm: it would run through the limits. Correct method, `at` or `inverted`.",
        ),
        (-4, False, "6 mm", ""),
        (-4, True, "4 mm", ""),
        (-3, True, "6 mm", ""),
        (
            -3,
            True,
            "4 mm",
            "method -3 goes to the positive end, but `at` 4 mm is at the negative end of -25 mm to 35 mm: it would run through the limits. Correct method, `at` or `inverted`.",
        ),
        (37, False, "-25 mm", ""),
        (37, False, "35 mm", ""),  # it does not move
        (
            -3,
            False,
            "-86 mm",
            "`at` -86 mm is 61 mm outside of limits.position, -25 mm to 35 mm, more than the way between them. Correct one of them.",
        ),
        (
            -4,
            False,
            "96 mm",
            "`at` 96 mm is 61 mm outside of limits.position, -25 mm to 35 mm, more than the way between them. Correct one of them.",
        ),
    ],
)
def test_homing_goes_to_the_end_where_its_reference_is(method, inverted, at, conflict):
    made = file(inverted=inverted, homing={"method": method, "at": at}).nodes["axis"]
    assert search_direction(made) == {-3: -1, -4: 1, 37: 0}[method] * (-1 if inverted else 1)
    assert homing_conflict(made, mm) == conflict


@pytest.mark.parametrize(("speed", "fits"), [("100 mm/s", True), ("101 mm/s", False)])
def test_homing_keeps_to_the_velocity_limit(speed, fits):
    made = file(homing={"method": 37, "speed": speed}).nodes["axis"]
    text = "speed 101 mm/s is above limits.velocity 100 mm/s. Lower it."
    assert homing_conflict(made, mm) == ("" if fits else text)


@pytest.mark.parametrize(
    ("interface", "channel", "is_software"),
    [
        ("virtual", "a", True),
        ("udp_multicast", "239.74.163.2", True),
        ("socketcan", "can0", False),
        ("socketcan", "vcan0", True),
        ("slcan", "/dev/pts/3", True),
        ("slcan", "LINK", True),  # to a pseudo terminal
        ("slcan", "/dev/ttyACM0", False),
        ("pcan", "PCAN_USBBUS1", False),
    ],
)
def test_a_bus_on_which_no_current_can_flow(tmp_path, interface, channel, is_software):
    if channel == "LINK":
        (tmp_path / "line").symlink_to("/dev/pts/99999")
        channel = str(tmp_path / "line")
    nodes = {"axis": {"node": 1, "profile": "mclm"}}
    for simulated in (False, True):
        keys = HardwareKeys.model_validate(
            {"simulated": simulated, "nodes": nodes}
            | ({} if simulated else {"interface": interface, "channel": channel})
        )
        assert keys.is_software() is (simulated or is_software)


@every_case("cause", Cause)
def test_a_fault_of_a_file_has_the_values_of_one_by_name_alone(cause):
    keys = FaultKeys.model_validate({"at": "1 s", "fault": str(cause), "node": "axis"})
    assert keys.made() == Fault(cause)
    assert keys.text == f"{cause} of axis"
