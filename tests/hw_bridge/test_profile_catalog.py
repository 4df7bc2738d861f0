"""Which profile a device has, what its motor is, in which units its objects count, and which objects act at once."""

from dataclasses import replace
from math import pi

import pytest

from hw_bridge.dictionary import I16, I32, U8, U16, U32, Dictionary, NodeId, record, sub, var
from hw_bridge.profiles import (
    DRIVE_PROFILES,
    MOTORS,
    Measure,
    MotorModel,
    Units,
    acting,
    device,
    disagreement,
    identity,
    magnetic_pitch,
    measure,
    member_load,
    motor_parameters,
    profile,
    profile_for,
    symbol,
    unsupported_product,
)
from hw_bridge.profiles.catalog import listed
from hw_bridge.profiles.rows import joined, pdo
from tests.every_case import every_case
from twin.errors import DeclarationError

MAXON, FAULHABER = 0xFB, 327


@every_case(
    ("vendor", "product", "name"),
    [
        (FAULHABER, 11601, "faulhaber_v3"),
        (FAULHABER, 3150, "mclm"),
        (MAXON, 0x61500000, "epos4"),
        (MAXON, 0x65510000, "epos4"),  # EPOS4 50/15
        (MAXON, 0x63220000, "epos2"),
        (MAXON, 3150, ""),
        (FAULHABER, 0x61500000, ""),
        (0, 0, ""),
    ],
)
def test_a_profile_is_found_by_exactly_its_product(vendor, product, name):
    assert profile_for(vendor, product) == name


@every_case(
    ("vendor", "product", "device_type", "title"),
    [
        (MAXON, 0x68500000, 0x00020192, "maxon EPOS4 Micro 24/5"),
        (MAXON, 0x68500000, 0, "maxon EPOS4 Micro 24/5"),
        (MAXON, 0x61500000, 0x00020192, None),
        (FAULHABER, 3150, 0x00020192, "FAULHABER MCLM 300x CF"),
        (FAULHABER, 3150, 0x00420192, None),  # the CO has the same product code
        (FAULHABER, 0x68500000, 0x00020192, None),
    ],
)
def test_unsupported_products(vendor, product, device_type, title):
    product = unsupported_product(vendor, product, device_type)
    assert (product and product.title) == title


def test_identities_and_names():
    assert identity("epos4") == {0: 4, 1: MAXON, 2: 0x61500000, 3: 0x01700000, 4: 1}
    assert identity("mclm") == {0: 4, 1: FAULHABER, 2: 3150, 3: 3, 4: 1}
    assert [*listed()] == ["faulhaber_v3", "mclm", "epos4", "epos2", "cia402", "cia401"]
    assert device("cia401").name == "cia401"
    with pytest.raises(DeclarationError, match=r"There is no drive profile 'mclx'\. Did you mean 'mclm'"):
        profile("mclx")


UNITS = Units(1e-6, 1e-3, 2e-3, 5e-4)


@every_case(
    ("row", "units", "axis", "expected"),
    [
        # by the unit in the object's name
        (var(0x2334, "Current limit [mA]", U16, "ro"), None, "m", (1.0, "mA")),
        (var(0x2325, "Motor supply [10 mV]", U16, "ro"), None, "m", (10.0, "mV")),
        (var(0x2200, "Power supply voltage [0.1 V]", U16, "ro"), UNITS, "m", (0.1, "V")),
        (var(0x6075, "Motor rated current [mA]", U32, "rw"), UNITS, "m", (1.0, "mA")),
        # as CiA 402 counts
        (var(0x1017, "Producer heartbeat time", U16, "rw"), None, "m", (1.0, "ms")),
        (var(0x6068, "Position window time", U16, "rw"), UNITS, "m", (1.0, "ms")),
        (var(0x6064, "Position actual value", I32, "ro"), UNITS, "m", (1e-6, "m")),
        (var(0x6064, "Position actual value", I32, "ro"), UNITS, "rad", (1e-6, "rad")),
        (var(0x60FF, "Target velocity", I32, "rw"), UNITS, "rad", (1e-3, "rad/s")),
        (var(0x6083, "Profile acceleration", U32, "rw"), UNITS, "m", (2e-3, "m/s^2")),
        (var(0x6071, "Target torque", I16, "rw"), UNITS, "m", (5e-4, "A")),
        # no unit: none known, plain numbers, the count of a record, a drive without a unit of torque
        (var(0x6064, "Position actual value", I32, "ro"), None, "m", None),
        (var(0x6041, "Statusword", U16, "ro"), UNITS, "m", None),
        (var(0x30E0, "Window [velocity units]", U32, "rw"), UNITS, "m", None),
        (record(0x607D, "Software position limit", sub(1, "Min", I32, "rw")), UNITS, "m", None),
        (record(0x607D, "Software position limit", sub(1, "Min", I32, "rw"))[1:], UNITS, "m", (1e-6, "m")),
        (var(0x6071, "Target torque", I16, "rw"), Units(1.0, 1.0, 1.0, 0.0), "m", None),
    ],
)
def test_units_of_objects(row, units, axis, expected):
    assert measure(row[0], units, axis) == (expected and Measure(*expected))


# units of user-defined objects by CiA 402-2 and 402-3, for all drives; others are plain numbers or carry a unit in their name
POSITIONS = (0x6062, 0x6064, 0x6065, 0x6067, 0x607A, 0x607C, 0x607D, 0x60B0, 0x60F4)
VELOCITIES = (0x606B, 0x606C, 0x607F, 0x6080, 0x6081, 0x6099, 0x60B1, 0x60FF)
ACCELERATIONS = (0x6083, 0x6084, 0x6085, 0x609A, 0x60C5)
TORQUES = (0x6071, 0x6072, 0x6077, 0x60B2, 0x60E0, 0x60E1)
TIMES = (0x1017, 0x6066, 0x6068, 0x606E, 0x6070)


def test_every_standard_object_of_the_drives_has_its_unit():
    expected = dict.fromkeys(POSITIONS, "m") | dict.fromkeys(VELOCITIES, "m/s") | dict.fromkeys(ACCELERATIONS, "m/s^2")
    expected |= dict.fromkeys(TORQUES, "A") | dict.fromkeys(TIMES, "ms")
    found = {}
    for name in DRIVE_PROFILES:
        for entry in profile(name).objects:
            is_standard = entry.index < 0x2000 or entry.index >= 0x6000
            if is_standard and not entry.unit and (unit := measure(entry, UNITS, "m")) is not None:
                found[entry.index] = unit.unit
    assert found == expected


@every_case(
    ("given", "in_si"),
    [
        ((10.0, "mV"), (0.01, "V")),
        ((1.0, "mA"), (1e-3, "A")),
        ((4.0, "ms"), (4e-3, "s")),
        ((24.0, "mm"), (0.024, "m")),
        ((1.0, "mm/s"), (1e-3, "m/s")),
        ((1.0, "m"), (1.0, "m")),
        ((1.0, "rpm"), (1.0, "rpm")),
        ((1.0, "mrad"), (1.0, "mrad")),
    ],
)
def test_the_prefix_milli_is_taken_off(given, in_si):
    assert Measure(*given).in_si() == Measure(pytest.approx(in_si[0]), in_si[1])


def test_symbols_of_kinds():
    kinds = ("position", "velocity", "acceleration", "torque")
    assert [symbol(kind, "m") for kind in kinds] == ["m", "m/s", "m/s^2", "A"]
    assert [symbol(kind, "rad") for kind in kinds] == ["rad", "rad/s", "rad/s^2", "A"]


def test_motors_by_their_names():
    assert {name: magnetic_pitch(name) for name in (*MOTORS, "other")} == {
        "lm2070": pytest.approx(0.024),
        "lm1247": pytest.approx(0.018),
        "ec_i_40": 0.0,
        "other": None,
    }
    epos4 = profile("epos4")
    assert [motor_parameters(epos4, name).name for name in ("profile", "member", "lm1247")] == [
        "ec_i_40",
        "ec_i_40",
        "lm1247",
    ]
    with pytest.raises(DeclarationError, match=r"There is no motor 'lm2071'\. Did you mean 'lm2070'"):
        motor_parameters(epos4, "lm2071")


@every_case(
    ("name", "motor", "stored", "text"),
    [
        ("faulhaber_v3", "lm2070", {(0x6092, 1): 24000, (0x608F, 1): 3000}, ""),
        ("faulhaber_v3", "lm2070", {(0x608F, 1): 3000}, ""),  # an object that it has not
        ("faulhaber_v3", "lm1247", {(0x6092, 1): 24000}, "6092h.1 is 24000, 18000 with this motor"),
        ("mclm", "lm2070", {(0x2350, 4): 18}, "2350h.4 is 18, 24 with this motor"),
        (
            "faulhaber_v3",
            "lm1247",
            {(0x6092, 1): 24000, (0x608F, 1): 2000},
            "6092h.1 is 24000, 18000 with this motor; 608Fh.1 is 2000, 3000 with this motor",
        ),
        ("epos4", "ec_i_40", {(0x3010, 1): 1024}, "3010h.1 is 1024, 500 with this motor"),
        ("epos4", "lm2070", {(0x3010, 1): 1024}, ""),  # nothing is known of this pair
    ],
)
def test_objects_that_are_not_those_of_the_motor(name, motor, stored, text):
    assert disagreement(profile(name), MOTORS[motor], stored) == text


def test_force_of_an_ampere_and_load_of_a_member():
    assert [motor.model.force_constant for motor in MOTORS.values()] == [11.64, 6.43, 0.091]
    assert MotorModel("servomotor", "m", 1e-6, 1e-3, {"force_constant": 3.0}).force_constant == 3.0
    assert member_load({"load_force": 2.0, "recoil_force": -0.5, "other": 9.0}) == 1.5
    assert member_load({"load_torque": -3.0}) == -3.0
    assert member_load({"other": 9.0}) is None


def test_motors_and_increments_of_the_rig():
    """3000 increments a magnetic pitch; 500 pulses of four increments a turn; index pulses once a pitch or turn."""
    sensors = {name: (motor.model.resolution, motor.model.index) for name, motor in MOTORS.items()}
    assert sensors == {
        "lm2070": (pytest.approx(8e-6), pytest.approx(0.024)),
        "lm1247": (pytest.approx(6e-6), pytest.approx(0.018)),
        "ec_i_40": (pytest.approx(pi / 1000), pytest.approx(2 * pi)),
    }
    assert MOTORS["ec_i_40"].model.parameters["velocity_maximum"] == pytest.approx(8000 * 2 * pi / 60 / 5)
    half = {name: motor.settings.get("mclm") for name, motor in MOTORS.items()}
    assert half["lm2070"] == half["lm1247"] == {(0x607D, 1): -40_000, (0x607D, 2): 40_000}  # a stroke of 80 mm


@every_case(
    ("name", "index", "moves", "switches"),
    [
        ("epos4", 0x6040, True, False),
        ("epos4", 0x60B1, True, False),
        ("epos4", 0x2001, True, False),  # bit rate
        ("mclm", 0x2001, False, False),
        ("mclm", 0x257A, True, False),
        ("epos4", 0x6064, False, False),
        ("epos4", 0x60FE, False, True),
        ("epos4", 0x3150, False, True),  # polarity of outputs
        ("mclm", 0x6200, False, True),
    ],
)
def test_objects_that_act_at_once(name, index, moves, switches):
    assert (index in acting.commands(profile(name))) is moves
    assert acting.sets_output(profile(name), index) is switches


@pytest.mark.parametrize(
    ("index", "may"), [(0x1FFF, False), (0x2000, False), (0x2FFF, True), (0x5FFF, True), (0x6000, False)]
)
def test_a_vendors_object_that_no_profile_has_may_switch(index, may):
    """Also where an EDS file has it: the file states its type, not its effect."""
    drive = profile("epos4")
    assert acting.switches(drive, index, 0) is may
    listed = replace(drive.objects[0], index=index, sub=0)
    assert acting.switches(replace(drive, objects=(*drive.objects, listed)), index, 0) is may
    assert acting.switches(replace(drive, name="cia402"), index, 0) is (index in acting.VENDORS_OWN)


def test_commands_of_all_profiles():
    assert acting.all_commands() - acting.COMMANDS == {
        0x2000,
        0x2001,
        0x2030,
        0x2062,
        0x206B,
        0x20C1,
        0x2400,
        0x257A,
        0x31E4,
    }


@pytest.mark.parametrize(
    ("number", "receive", "options", "communication", "mapping"),
    [
        (1, True, {}, {0: 2, 1: NodeId(0x200), 2: 255}, {0: 1, 1: 0x60400010, 2: 0, 3: 0}),
        (
            4,
            False,
            {"flags": 1 << 31, "inhibit": 10, "event": 7},
            {0: 5, 1: NodeId(0x80000200), 2: 255, 3: 10, 5: 7},
            {0: 1, 1: 0x60400010, 2: 0, 3: 0},
        ),
    ],
)
def test_rows_of_a_pdo(number, receive, options, communication, mapping):
    rows = pdo(number, 0x200, (0x60400010,), receive=receive, objects=3, **options)
    start = (0x1400 if receive else 0x1800) + number - 1
    found = {start: communication, start + 0x200: mapping}
    assert {(row.index, row.sub): row.default for row in rows} == {
        (index, sub): value for index, values in found.items() for sub, value in values.items()
    }
    node = Dictionary(rows, 5)
    assert node.get(start, 1) == communication[1] + 5
    assert {row.name for row in rows if row.index == start} >= {"COB-ID", "Transmission type"}


def test_rows_are_joined_in_their_order():
    first, second = var(0x2000, "a", U8, "ro"), record(0x2001, "b", sub(1, "c", U8, "ro"))
    assert joined(first, (), second) == (*first, *second)
