"""What the profiles compute from a drive's objects: units, doubts about them, limits of current, speed deviation and supply."""

from math import inf, pi

import pytest

from hw_bridge.dictionary import U16, U32, Dictionary, var
from hw_bridge.profiles import Currents, Units, cia402, profile
from tests.every_case import every_case

RPM = 2.0 * pi / 60.0  # [rad/s]
INCREMENT = 2.0 * pi / 2000  # of the EC-i 40's encoder: 500 pulses, four increments each
NUMBER, STRUCTURE, RESOLUTION = (0x3010, 1), (0x3000, 2), (0x3000, 5)  # of EPOS4


def stored(name, values, lacks=()):
    """Dictionary of a drive with these values, and without these objects."""
    dictionary = Dictionary(profile(name).objects, 1)
    dictionary.values.update(values)
    for index in lacks:
        dictionary.remove(index)
    return dictionary


# the SI value of one device unit: position, velocity, acceleration, current
UNITS = [
    ("epos4", {}, None, (INCREMENT, RPM, RPM, 5e-3)),
    ("epos4", {NUMBER: 1024, (0x3001, 1): 2500}, None, (2 * pi / 4096, RPM, RPM, 2.5e-3)),
    ("epos4", {RESOLUTION: 8192}, None, (2 * pi / 8192, RPM, RPM, 5e-3)),
    ("epos4", {RESOLUTION: 1}, None, (2 * pi, RPM, RPM, 5e-3)),
    ("epos4", {RESOLUTION: 0}, None, (INCREMENT, RPM, RPM, 5e-3)),
    # the prefix is a signed power of ten: mrpm; 10 rpm/s; the largest and the smallest
    ("epos4", {(0x60A9, 0): 0xFDB44700}, None, (INCREMENT, 1e-3 * RPM, RPM, 5e-3)),
    ("epos4", {(0x60AA, 0): 0x01C00300}, None, (INCREMENT, RPM, 10 * RPM, 5e-3)),
    ("epos4", {(0x60A9, 0): 0x7FB44700}, None, (INCREMENT, 1e127 * RPM, RPM, 5e-3)),
    ("epos4", {(0x60A9, 0): 0x80B44700}, None, (INCREMENT, 1e-128 * RPM, RPM, 5e-3)),
    ("epos2", {}, None, (INCREMENT, RPM, RPM, 0.0)),
    ("epos2", {(0x2210, 1): 256, (0x608B, 0): -3, (0x608D, 0): -1}, None, (2 * pi / 1024, 1e-3 * RPM, 0.1 * RPM, 0.0)),
    # um, mm/s, mm/s2, thousandths of 790 mA
    ("faulhaber_v3", {}, None, (1e-6, 1e-3, 1e-3, 0.79e-3)),
    ("faulhaber_v3", {}, 0.018, (0.75e-6, 0.75e-3, 0.75e-3, 0.79e-3)),
    ("faulhaber_v3", {(0x6092, 1): 18000}, None, (1e-6, 1e-3, 1e-3, 0.79e-3)),  # the pitch of an LM 1247 in um
    ("faulhaber_v3", {(0x6092, 1): 20000}, None, (1.2e-6, 1.2e-3, 1.2e-3, 0.79e-3)),  # of no motor: an LM 2070
    ("faulhaber_v3", {(0x6092, 1): 48000, (0x6092, 2): 2}, None, (1e-6, 1e-3, 1e-3, 0.79e-3)),
    ("faulhaber_v3", {(0x608F, 1): 6000, (0x608F, 2): 4}, 0.024, (0.5e-6, 0.5e-3, 0.5e-3, 0.79e-3)),
    ("faulhaber_v3", {(0x6091, 1): 3, (0x6091, 2): 2}, 0.024, (1.5e-6, 1.5e-3, 1.5e-3, 0.79e-3)),
    ("faulhaber_v3", {(0x6096, 1): 1, (0x6096, 2): 60}, None, (1e-6, 1e-6, 1e-3, 0.79e-3)),  # um/s
    ("faulhaber_v3", {(0x6096, 1): 5, (0x6096, 2): 60}, None, (1e-6, 0.2e-6, 1e-3, 0.79e-3)),
    ("faulhaber_v3", {(0x6075, 0): 1000}, None, (1e-6, 1e-3, 1e-3, 1e-3)),
    ("mclm", {}, None, (1e-6, 1e-3, 1e-3, 0.0)),
    ("mclm", {}, 0.024, (4e-6 / 3, 4e-3 / 3, 4e-3 / 3, 0.0)),  # set for 18 mm, on a motor with 24 mm
    ("mclm", {(0x2350, 4): 24}, 0.024, (1e-6, 1e-3, 1e-3, 0.0)),
    ("mclm", {(0x6092, 1): 500, (0x6092, 2): 3}, None, (6e-6, 1e-3, 1e-3, 0.0)),
    ("mclm", {(0x6091, 1): 5, (0x6091, 2): 2}, None, (2.5e-6, 1e-3, 1e-3, 0.0)),
]


@every_case(("name", "values", "pitch", "units"), UNITS)
def test_units_follow_the_objects_of_the_drive(name, values, pitch, units):
    assert profile(name).units(stored(name, values), pitch) == Units(
        *(pytest.approx(value, rel=1e-12) for value in units)
    )


def test_without_6075h_the_rated_current_is_2329h():
    dictionary = stored("faulhaber_v3", {(0x2329, 1): 500}, lacks=(0x6075,))
    assert profile("faulhaber_v3").units(dictionary).torque == pytest.approx(0.5e-3)
    assert profile("faulhaber_v3").currents(dictionary) == pytest.approx((0.5, 1.0, 15.0))
    assert profile("faulhaber_v3").unsure(dictionary, None) == []


SSI = "the main sensor (3000h) is an SSI encoder (3012h), and no 3000h.5 tells its increments for a turn"
SENSOR = "the main sensor (3000h) is sensor {} of type {}, and no 3000h.5 tells its increments for a turn"
GEAR = "3000h.2 is {:X}h: a gear is configured, and what counts before and after it is not known"
TORQUE = "6076h is {} uNm, 3001h tells 455000: torques are not thousandths of the nominal current"
MOTOR = {(0x3001, 1): 5000, (0x3001, 5): 91000}  # [mA], [uNm/A]: 455000 uNm
SPEED = (
    "a unit of velocity is {} m/s (6096h), no power of ten: the vendor's base of velocities, the minute, is not proven for it. "
    "Set 6096h so that it is 1 mm/s (1/60000 where positions are um)"
)
PITCH = "a magnetic pitch is {} user units (608Fh, 6091h, 6092h), that of no known motor in um"
DOUBTS = [
    ("epos4", {}, None, []),
    ("epos4", {(0x60A8, 0): 0xFDB50000, (0x60A9, 0): 0xFDB44700, (0x60AA, 0): 0xFDC00300}, None, []),  # prefixes
    ("epos4", {(0x60A8, 0): 0x00410000}, None, ["60A8h is 410000h: positions are no increments"]),
    ("epos4", {(0x60A9, 0): 0x00B40300}, None, ["60A9h is B40300h: velocities are no rpm"]),
    ("epos4", {(0x60AA, 0): 0x00B44700}, None, ["60AAh is B44700h: accelerations are no rpm/s"]),
    ("epos4", {STRUCTURE: 0x00011111}, None, [GEAR.format(0x11111)]),
    ("epos4", {STRUCTURE: 0x00012111}, None, [GEAR.format(0x12111)]),
    ("epos4", {STRUCTURE: 0x00014111}, None, []),
    ("epos4", {**MOTOR, (0x6076, 0): 455000}, None, []),
    ("epos4", {**MOTOR, (0x6076, 0): 459550}, None, []),  # within 1 %
    ("epos4", {**MOTOR, (0x6076, 0): 459551}, None, [TORQUE.format(459551)]),
    ("epos4", {**MOTOR, (0x6076, 0): 450449}, None, [TORQUE.format(450449)]),
    ("epos4", {**MOTOR, (0x6076, 0): 0}, None, []),
    ("epos4", {(0x6076, 0): 455000}, None, []),  # the drive was not told its motor
    (
        "epos4",
        {(0x3001, 1): 0, (0x6076, 0): 455000},
        None,
        ["3001h.1 is 0 mA: no object tells the nominal current, whose thousandths are measured and limited"],
    ),
    ("epos4", {RESOLUTION: 2000}, None, []),
    ("epos4", {RESOLUTION: 4096}, None, ["3000h.5 tells 4096 increments for a turn, 3010h.1 2000"]),
    ("epos4", {(0x3000, 1): 0x301, STRUCTURE: 0x00020111}, None, [SSI]),
    ("epos4", {(0x3000, 1): 0x301, STRUCTURE: 0x00020111, RESOLUTION: 4096}, None, []),
    ("epos4", {(0x3000, 1): 0x201, STRUCTURE: 0x00020111}, None, [SENSOR.format(2, 2)]),
    ("epos4", {(0x3000, 1): 0x30003, STRUCTURE: 0x00030111}, None, [SENSOR.format(3, 3)]),
    ("epos4", {(0x3000, 1): 0x302, STRUCTURE: 0x00010111}, None, [SENSOR.format(1, 2)]),
    ("epos4", {(0x3000, 1): 0x301, STRUCTURE: 0x00000111}, None, [SENSOR.format(0, 1)]),
    ("epos2", {}, None, []),
    ("epos2", {(0x2210, 2): 2}, None, []),
    ("epos2", {(0x2210, 2): 3}, None, ["2210h.2 is 3: the position sensor is no incremental encoder 1"]),
    ("epos2", {(0x6089, 0): -1}, None, ["6089h is -1: positions have a prefix"]),
    ("epos2", {(0x608A, 0): 1}, None, ["608Ah is 1h: positions are no counts"]),
    (
        "epos2",
        {(0x608C, 0): 0xA3, (0x608E, 0): 0xAC},
        None,
        ["608Ch is A3h: velocities are no rpm", "608Eh is ACh: accelerations are no rpm/s"],
    ),
    ("faulhaber_v3", {}, None, []),
    ("faulhaber_v3", {(0x6092, 1): 18000}, None, []),
    ("faulhaber_v3", {(0x6096, 2): 60}, None, []),
    ("faulhaber_v3", {(0x6092, 1): 20000}, 0.020, []),
    ("faulhaber_v3", {(0x6092, 1): 20000}, None, [SPEED.format(0.0012), PITCH.format(20000)]),
    ("faulhaber_v3", {(0x6096, 1): 4096, (0x6096, 2): 1}, None, [SPEED.format("4.06901e-12")]),
    ("faulhaber_v3", {(0x6092, 1): 2400}, None, [PITCH.format(2400)]),
    ("faulhaber_v3", {(0x6075, 0): 0}, None, ["no object tells the rated current (6075h, 2329h.1)"]),
    ("mclm", {}, None, []),
    ("mclm", {(0x608F, 1): 2000}, None, ["608Fh.1 is 2000: the sensor is not the motor's Hall sensors"]),
]


@every_case(("name", "values", "pitch", "doubts"), DOUBTS)
def test_doubts_about_units_are_named(name, values, pitch, doubts):
    assert profile(name).unsure(stored(name, values), pitch) == doubts


# continuous and peak current [A], thermal time constant [s]
CURRENTS = [
    ("epos4", {}, (), (5.0, 15.0, 4.0)),
    ("epos4", {(0x3001, 1): 2000, (0x3001, 2): 3000, (0x3001, 4): 1}, (), (2.0, 3.0, 0.1)),
    ("epos2", {}, (), (5.0, 10.0, 4.0)),
    ("epos2", {(0x6410, 1): 2000, (0x6410, 2): 3000, (0x6410, 5): 1}, (), (2.0, 3.0, 0.1)),
    ("faulhaber_v3", {}, (), (0.79, 1.58, 15.0)),
    ("faulhaber_v3", {(0x60E0, 0): 500}, (), (0.79, 0.395, 15.0)),
    ("faulhaber_v3", {}, (0x6072, 0x60E0, 0x60E1), (0.79, 4.74, 15.0)),
    ("mclm", {}, (), (0.79, 2.37, 15.0)),
    ("mclm", {(0x2333, 1): 500, (0x2333, 2): 600, (0x2350, 5): 200}, (), (0.5, 0.6, 0.2)),
]


@every_case(("name", "values", "lacks", "currents"), CURRENTS)
def test_limits_of_the_current(name, values, lacks, currents):
    assert profile(name).currents(stored(name, values, lacks)) == Currents(*map(pytest.approx, currents))


@pytest.mark.parametrize(
    ("name", "values", "window"),
    [
        ("faulhaber_v3", {}, (65535.0, 100)),
        ("faulhaber_v3", {(0x2344, 3): 20, (0x2344, 4): 5}, (20.0, 5)),
        ("mclm", {}, (30000.0, 200)),
        ("mclm", {(0x2322, 2): 20, (0x2322, 1): 5}, (20.0, 5)),
    ],
)
def test_window_and_time_of_the_speed_deviation(name, values, window):
    assert profile(name).deviation(stored(name, values)) == window


def test_no_speed_deviation_at_maxon():
    assert (profile("epos4").deviation, profile("epos2").deviation) == (None, None)


@pytest.mark.parametrize(
    ("name", "values", "lacks", "limits"),
    [
        ("epos4", {}, (), (8.0, 58.0)),
        ("epos4", {}, (0x2201,), (8.0, 58.0)),  # older firmware
        ("epos4", {(0x2201, 1): 20_000, (0x2201, 2): 30_000}, (), (20.0, 30.0)),
        ("faulhaber_v3", {}, (), (9.0, 56.0)),
    ],
)
def test_limits_of_the_supply(name, values, lacks, limits):
    assert profile(name).supply(stored(name, values, lacks)) == limits


def test_options_are_those_of_the_dictionary_or_the_vendors_own():
    """FAULHABER's MCLM has none of the objects: a quick stop by 6085h, disable operation and errors with a ramp."""
    fixed = stored("mclm", {})
    options = (0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6007)
    assert [profile("mclm").option(fixed, index) for index in options] == [2, 0, 1, 1, 2, 0]
    chosen = stored("epos4", {(0x605A, 0): 5, (0x605B, 0): 1, (0x605C, 0): 0, (0x605E, 0): 1, (0x6007, 0): 2})
    assert [profile("epos4").option(chosen, index) for index in options] == [5, 1, 0, 1, 1, 2]


def test_infinite_currents_are_those_of_a_drive_that_does_not_tell():
    def limits(rated, peak):
        return cia402.currents(Dictionary((*var(0x6075, "", U32, "rw", rated), *var(0x6073, "", U16, "rw", peak)), 1))

    assert limits(0, 1000) == (inf, inf, 15.0)
    assert limits(2000, 0) == (2.0, inf, 15.0)
    assert limits(1, 1) == pytest.approx((1e-3, 1e-6, 15.0))
    assert limits(2000, 1500) == (2.0, 3.0, 15.0)
