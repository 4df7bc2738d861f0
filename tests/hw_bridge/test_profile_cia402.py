"""Units of any CiA 402 drive, by what its objects tell (CiA 303-2, the factor group of CiA 402) and what a hardware file gives."""

from math import pi

import pytest

from hw_bridge.dictionary import I16, I32, U16, U32, Dictionary, Mode, record, sub, var
from hw_bridge.profiles import GivenUnits, Units, generic, profile, units_without_object, unknown_units
from hw_bridge.profiles.cia402 import stated_unit
from tests.every_case import every_case

DEGREE, TURN, MINUTE = pi / 180, 2 * pi, 60.0
POSITION, VELOCITY, ACCELERATION = 0x60A8, 0x60A9, 0x60AA


def objects(values):
    """Entries with these values: an index for an object without subindices, else a pair of values of a record."""
    rows = []
    for index, value in values.items():
        if isinstance(value, tuple):
            rows += record(index, "", *(sub(n, "", U32, "ro", one) for n, one in enumerate(value, 1)))
        else:
            rows += var(index, "", U32, "ro", value)
    return tuple(rows)


@every_case(
    ("kind", "values", "unit"),
    [
        # 60A8h to 60AAh: prefix, numerator, denominator
        ("position", {POSITION: 0x00010000}, (1.0, "m")),
        ("position", {POSITION: 0xFA010000}, (1e-6, "m")),
        ("position", {POSITION: 0x00100000}, (1.0, "rad")),
        ("position", {POSITION: 0xFD410000}, (1e-3 * DEGREE, "rad")),
        ("position", {POSITION: 0x00B40000}, (TURN, "rad")),
        ("position", {POSITION: 0x7F010000}, (1e127, "m")),
        ("position", {POSITION: 0x80010000}, (1e-128, "m")),
        ("velocity", {VELOCITY: 0x00010300}, (1.0, "m/s")),
        ("velocity", {VELOCITY: 0x00B44700}, (TURN / MINUTE, "rad/s")),
        ("velocity", {VELOCITY: 0x00C00000}, (TURN / MINUTE, "rad/s")),
        ("acceleration", {ACCELERATION: 0x00C00300}, (TURN / MINUTE, "rad/s^2")),
        ("acceleration", {ACCELERATION: 0xFD015700}, (1e-3, "m/s^2")),
        # increments of the encoder, by 608Fh
        ("position", {POSITION: 0x00B50000, 0x608F: (4000, 2)}, (TURN / 2000, "rad")),
        ("velocity", {VELOCITY: 0x01B50300, 0x608F: (4000, 1)}, (10 * TURN / 4000, "rad/s")),
        ("velocity", {VELOCITY: 0x00B54700, 0x608F: (4000, 1)}, (TURN / 4000 / MINUTE, "rad/s")),
        ("position", {POSITION: 0x00B50000}, None),
        ("position", {POSITION: 0x00B50000, 0x608F: (0, 1)}, None),
        ("position", {POSITION: 0x00B50000, 0x608F: (1, 0)}, None),
        ("position", {POSITION: 0x00B50000, 0x608F: (1, 1)}, (TURN, "rad")),
        # a unit of another kind, or an unknown one
        ("position", {POSITION: 0x00010300}, None),
        ("velocity", {VELOCITY: 0x00010000}, None),
        ("acceleration", {ACCELERATION: 0x00010300}, None),
        ("position", {POSITION: 0x00020000}, None),
        ("position", {POSITION: 0x00010100}, None),
        ("velocity", {}, None),
        # without 60A8h: feed constant and gear, else an increment
        ("position", {0x6092: (360, 1)}, (DEGREE, "rad")),
        ("position", {0x6092: (360, 2), 0x6091: (5, 3)}, (2 * DEGREE * 5 / 3, "rad")),
        ("position", {POSITION: 0, 0x6092: (1, 1)}, (TURN, "rad")),
        ("position", {0x6092: (0, 1)}, None),
        ("position", {0x6092: (1, 0)}, None),
        ("position", {0x6092: (1, 1), 0x6091: (0, 1)}, None),
        ("position", {0x6092: (1, 1), 0x6091: (1, 0)}, None),
        ("position", {0x608F: (2000, 1)}, (TURN / 2000, "rad")),
        ("position", {0x608F: (2000, 1), 0x6092: (0, 1)}, None),
        ("position", {0x608F: (2000, 1), 0x6093: (1, 1)}, None),  # a factor that may be either way round
        ("position", {}, None),
        ("velocity", {0x608F: (2000, 1)}, None),
    ],
)
def test_what_a_drive_tells_of_its_units(kind, values, unit):
    stated = stated_unit(Dictionary(objects(values), 1), kind)
    assert stated == (unit and (pytest.approx(unit[0], rel=1e-12), unit[1]))


TOLD = {POSITION: 0xFD410000, VELOCITY: 0xFDB44700, ACCELERATION: 0x00C00300, 0x6075: 2000, 0x6077: 0}
MISSING = "units.{}: the drive does not tell it ({}), nor does the hardware file"
CURRENT = (
    "units.current: 6077h and 6078h count in thousandths of 6075h, which the drive does not tell, nor does the file"
)


@every_case(
    ("values", "given", "lines"),
    [
        (TOLD, {}, []),
        (TOLD | {POSITION: 0}, {}, [MISSING.format("position", "60A8h, or 6092h, or 608Fh")]),
        (TOLD | {VELOCITY: 0}, {}, [MISSING.format("velocity", "60A9h")]),
        (TOLD | {ACCELERATION: 0}, {"acceleration": (1.0, "rad/s^2")}, []),
        (TOLD | {ACCELERATION: 0}, {"acceleration": (1.0, "m/s^2")}, ["units: some are of a line, others of a turn"]),
        (TOLD | {0x6075: 0}, {}, [CURRENT]),
        (TOLD | {0x6075: 1}, {}, []),
        (TOLD | {0x6075: 0}, {"current": (1e-3, "A")}, []),
        ({index: TOLD[index] for index in (POSITION, VELOCITY, ACCELERATION)}, {}, []),  # it tells no current at all
        ({index: TOLD[index] for index in (POSITION, VELOCITY, ACCELERATION)} | {0x6078: 0}, {}, [CURRENT]),
        (
            {},
            {},
            [
                MISSING.format("position", "60A8h, or 6092h, or 608Fh"),
                MISSING.format("velocity", "60A9h"),
                MISSING.format("acceleration", "60AAh"),
            ],
        ),
    ],
)
def test_units_that_nothing_tells_are_named(values, given, lines):
    assert unknown_units(Dictionary(objects(values), 1), GivenUnits(**given)) == lines


@every_case(
    ("indices", "missing"),
    [
        ((POSITION, VELOCITY, ACCELERATION), {}),
        ((0x6092, VELOCITY, ACCELERATION, 0x6077, 0x6075), {}),
        ((0x608F, VELOCITY), {"acceleration": "60AAh"}),
        ((VELOCITY, ACCELERATION, 0x6078), {"position": "60A8h, or 6092h, or 608Fh", "current": "6075h"}),
        ((POSITION, ACCELERATION, 0x6077), {"velocity": "60A9h", "current": "6075h"}),
    ],
)
def test_units_for_which_a_drive_has_no_object(indices, missing):
    assert units_without_object(objects(dict.fromkeys(indices, 0))) == missing


DRIVE = (
    *var(0x1000, "Device type", U32, "const", 0),
    *var(0x6041, "Statusword", U16, "ro"),
    *var(0x6064, "Position actual value", I32, "ro"),
    *var(0x6077, "Torque actual value", I16, "ro"),
    *objects(TOLD | {0x6502: 0x0A1}),  # pp, hm and csp
)


def test_the_profile_of_any_drive():
    made = generic(DRIVE, GivenUnits(), "A drive")
    assert (made.name, made.title, made.motor_name, made.bus_off) == ("cia402", "A drive", "ec_i_40", 0x8140)
    assert made.modes == (Mode.PP, Mode.HM, Mode.CSP)
    assert made.scaling == ((POSITION, 0), (VELOCITY, 0), (ACCELERATION, 0), (0x6075, 0))
    dictionary = Dictionary(made.objects, 1)
    assert made.units(dictionary) == Units(*map(pytest.approx, (1e-3 * DEGREE, 1e-3 * TURN / 60, TURN / 60, 2e-3)))
    assert made.unsure(dictionary, None) == []
    # what every drive has is added, once
    assert dictionary.get(0x1000) == 0x00020192
    assert {0x1001, 0x1003, 0x6061} <= {*dictionary.objects}
    assert len(made.objects) == len({(row.index, row.sub) for row in made.objects})
    told = generic((*var(0x1000, "", U32, "const", 0x420192), *var(0x6061, "", U16, "ro", 7)), GivenUnits(), "")
    stored = Dictionary(told.objects, 1)
    assert (stored.get(0x1000), stored.get(0x6061)) == (0x420192, 7)


def test_the_hardware_file_goes_before_the_drive():
    given = GivenUnits((1e-3, "m"), (2e-3, "m/s"), (3e-3, "m/s^2"), (4e-3, "A"))
    made = generic(DRIVE, given, "")
    assert made.motor_name == "lm2070"
    assert made.units(Dictionary(made.objects, 1)) == Units(1e-3, 2e-3, 3e-3, 4e-3)


def test_without_6502h_all_modes_are_tried_and_unknown_units_count_as_1():
    made = generic(objects({0x6064: 0}), GivenUnits(), "")
    assert made.modes == (Mode.PP, Mode.PV, Mode.HM, Mode.CSP, Mode.CSV, Mode.CST)
    assert made.units(Dictionary(made.objects, 1)) == Units(1.0, 1.0, 1.0, 0.0)
    assert len(made.unsure(Dictionary(made.objects, 1), None)) == 3


def test_records_of_scaling_are_read_without_their_count():
    made = generic(objects({0x6091: (1, 1), 0x6092: (360, 1)}), GivenUnits(), "")
    # the row of the count has no title in this table, but subindices do count
    assert {(0x6091, 1), (0x6091, 2), (0x6092, 1), (0x6092, 2)} <= set(made.scaling)


def test_units_of_the_hardware_file_stand_where_no_object_tells_them():
    drive = profile("faulhaber_v3")
    dictionary = Dictionary(drive.objects, 1)
    assert drive.with_units(GivenUnits(position=(5.0, "m"))) is drive  # the drive tells that itself
    stated = drive.with_units(GivenUnits(position=(5.0, "m"), acceleration=(1e-2, "m/s^2")))
    assert stated.unstated_units == ()
    assert stated.units(dictionary) == Units(*map(pytest.approx, (1e-6, 1e-3, 1e-2, 0.79e-3)))
    assert stated.units(dictionary, 0.012).position == pytest.approx(0.5e-6)
