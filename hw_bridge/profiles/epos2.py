"""maxon EPOS2 (50/5) with an EC-i 40, from the facts of its public EDS.

It has no cyclic synchronous modes and no 6071h, 6077h, 605Ah, 6080h, 60FDh, 60FEh and 1029h: a closed limit switch (2071h) is
not named. What runs is profile position (a target in each
cycle, with its acknowledge) and profile velocity. Its own modes (position -1, velocity -2, current -3, at 2062h, 206Bh and
2030h) and interpolated position (7, a buffer of its own at 20C1h and 20C4h) are not used. 60C2h belongs to mode 7.
"""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING

from hw_bridge.dictionary import (
    BLOCKS_MAXON,
    I8,
    I16,
    I32,
    METHODS,
    U8,
    U16,
    U32,
    Code,
    Mode,
    record,
    sub,
    supported,
    var,
)
from hw_bridge.profiles.description import CONNECTION, MILLIAMPERE, OFF, RAMP, Currents, Profile, Rules, Units, faults
from hw_bridge.profiles.maxon import CONSUMERS, DISABLED, ERROR_HISTORY, NO_RTR
from hw_bridge.profiles.motors import PULSES, RPM
from hw_bridge.profiles.rows import adapted, joined, process_data, standard

if TYPE_CHECKING:
    from hw_bridge.dictionary import Dictionary

HOMING = {n: METHODS[n] for n in (1, 2, 7, 11, 17, 18, 23, 27, 33, 34, 35)} | BLOCKS_MAXON  # recalled
MODES = (Mode.PP, Mode.PV, Mode.HM)
COUNTS, TURNS_PER_MINUTE = 0xAC, 0xA4  # of 608Ah; of 608Ch, and a second of it of 608Eh: the defaults of the EDS
DIMENSIONS = {  # objects that have to hold these values, and what they say otherwise
    0x608A: (COUNTS, "positions are no counts"),
    0x608C: (TURNS_PER_MINUTE, "velocities are no rpm"),
    0x608E: (TURNS_PER_MINUTE, "accelerations are no rpm/s"),
}
ENCODERS = (1, 2)  # of 2210h.2: incremental encoder 1 with and without index, recalled

COMMUNICATION = joined(
    adapted(0x1000, 0x00020192),
    adapted(0x1001, mappable=False),
    ERROR_HISTORY,
    adapted(0x1005, None, 0x80, 0x80),
    adapted(0x1008, "EPOS2"),
    standard(0x100C, 0x100D),
    record(0x1010, "Store parameters", sub(1, "Save all parameters", U32, "rw", 1)),
    record(0x1011, "Restore default parameters", sub(1, "Restore all default parameters", U32, "rw", 1)),
    standard(0x1014),
    CONSUMERS,
    standard(0x1017),
    adapted(0x1018, (0xFB, 0x63220000, 0, 1)),
)

PROCESS_DATA = process_data(
    8,
    ((0x60400010,), (0x60400010, 0x607A0020), (0x60400010, 0x60FF0020), (0x206B0020,)),
    ((0x60410010, 0x60640020), (0x20270010, 0x20280020), (), ()),
    transmit_flags=(NO_RTR, NO_RTR, DISABLED, DISABLED),
    inhibit=10,
)

VENDOR = joined(
    var(0x2027, "Current actual value averaged [mA]", I16, "ro", pdo=True),
    var(0x2028, "Velocity actual value averaged", I32, "ro", pdo=True),
    var(0x206B, "Velocity mode setting value", I32, "rw", pdo=True),
    var(0x2080, "Current threshold for homing [mA]", U16, "rw", 500),
    var(0x2081, "Home position", I32, "rw", pdo=True),
    record(
        0x2210,
        "Sensor configuration",
        sub(1, "Pulse number incremental encoder 1", U32, "rw", PULSES, 16, 2_500_000),
        sub(2, "Position sensor type", U16, "rw", 1),
    ),
)

APPLICATION = joined(
    standard(0x6007, 0x6040, 0x6041, 0x605B, 0x605C, 0x605E, 0x6060, 0x6061, 0x6062, 0x6064),
    var(0x6065, "Max following error", U32, "rw", 2000, pdo=True),
    standard(0x6067, 0x6068, 0x606B, 0x606C),
    var(0x606D, "Velocity window", U32, "rw", 30),  # default of the EDS is 0, which never is reached
    adapted(0x606E, mappable=False),
    standard(0x6078, 0x607A),
    var(0x607C, "Home offset", I32, "rw", pdo=True),
    adapted(0x607D, (-0x80000000, 0x7FFFFFFF)),
    adapted(0x607F, 25000, 0, 25000),
    standard(0x6081, 0x6083, 0x6084, 0x6085, 0x6086),  # rpm, rpm/s
    var(0x6089, "Position notation index", I8, "rw", 0, 0, 0),
    var(0x608A, "Position dimension index", U8, "rw", COUNTS, COUNTS, COUNTS),
    var(0x608B, "Velocity notation index", I8, "rw", 0, -3, 0),
    var(0x608C, "Velocity dimension index", U8, "rw", TURNS_PER_MINUTE, TURNS_PER_MINUTE, TURNS_PER_MINUTE),
    var(0x608D, "Acceleration notation index", I8, "rw", 0, 0, 0),
    var(0x608E, "Acceleration dimension index", U8, "rw", TURNS_PER_MINUTE, TURNS_PER_MINUTE, TURNS_PER_MINUTE),
    *(adapted(index, mappable=True) for index in (0x6098, 0x6099, 0x609A)),
    standard(0x60C5, 0x60FF, 0x6402),
    record(0x6410, "Motor data", sub(1, "Continuous current limit [mA]", U16, "rw", 5000, 0, 5000, pdo=True),
           sub(2, "Output current limit [mA]", U16, "rw", 10000, 0, 10000, pdo=True), sub(3, "Pole pair number", U8, "rw", 1),
           sub(4, "Maximal motor speed", U32, "rw", 25000, pdo=True),
           sub(5, "Thermal time constant winding [0.1 s]", U16, "rw", 40, 1, 5400)),
    adapted(0x6502, supported(*MODES)),
)  # fmt: skip

FAULTS = faults(  # EMCY: bits of 1001h, recalled; bit 7 is a motion error
    (0x1000, 0x01, OFF, "generic"),
    (0x2310, 0x03, OFF, "overcurrent"),
    (0x3210, 0x05, OFF, "overvoltage"),
    (0x3220, 0x05, OFF, "undervoltage"),
    (0x4210, 0x09, OFF, "temperature"),
    (0x5113, 0x05, OFF, "logic supply voltage too low"),
    (0x6100, 0x21, OFF, "internal software"),
    (0x6320, 0x21, RAMP, "software parameter"),
    (0x7320, 0xA1, OFF, "position sensor"),
    (0x8110, 0x11, CONNECTION, "CAN overrun (objects lost)"),
    (0x8120, 0x11, CONNECTION, "CAN error passive"),
    (0x8130, 0x11, CONNECTION, "life guarding or heartbeat"),
    (0x8150, 0x11, CONNECTION, "transmit COB-ID collision"),
    (0x81FD, 0x11, CONNECTION, "CAN bus off"),
    (0x8210, 0x11, CONNECTION, "PDO length"),
    (0x8611, 0xA1, RAMP, "following error"),
)


def units(dictionary: Dictionary, _pitch: float | None = None) -> Units:
    """Quadrature counts of encoder 1 (2210h.1), rpm with the prefix of 608Bh, rpm/s with that of 608Dh; no torque."""
    get = dictionary.get
    return Units(2.0 * pi / (4 * get(0x2210, 1)), RPM * 10.0 ** get(0x608B), RPM * 10.0 ** get(0x608D), 0.0)


def unsure(dictionary: Dictionary, _pitch: float | None) -> list[str]:
    """Why counts may be others than those of the incremental encoder 1, and units others than the vendor's."""
    sensor, index = dictionary.get(0x2210, 2), dictionary.get(0x6089)
    doubts = [f"2210h.2 is {sensor}: the position sensor is no incremental encoder 1"] if sensor not in ENCODERS else []
    doubts += [f"6089h is {index}: positions have a prefix"] if index else []
    return doubts + [
        f"{index:04X}h is {stored:X}h: {meaning}"
        for index, (expected, meaning) in DIMENSIONS.items()
        if (stored := dictionary.get(index)) != expected
    ]


def currents(dictionary: Dictionary) -> Currents:
    """Continuous and output current limit with the winding's time constant."""
    get = dictionary.get
    return Currents(get(0x6410, 1) / 1000.0, get(0x6410, 2) / 1000.0, get(0x6410, 5) / 10.0)


PROFILE = Profile(
    name="epos2",
    title="maxon EPOS2",
    objects=COMMUNICATION + PROCESS_DATA + VENDOR + APPLICATION,
    modes=MODES,
    homing=HOMING,
    faults=FAULTS,
    motor_name="ec_i_40",
    units=units,
    scaling=((0x2210, 1), (0x2210, 2), *((index, 0) for index in range(0x6089, 0x608F))),
    unsure=unsure,
    current_objects=((0x60780010, MILLIAMPERE),),
    homing_force=((0x2080, 0, MILLIAMPERE),),
    encoder_error=0x7320,
    commands=frozenset({0x2000, 0x2001, 0x2030, 0x2062, 0x206B, 0x20C1}),  # node-ID, bit rate; targets of its own modes
    output_objects=frozenset({0x2078, 0x2079}),  # state and function of outputs
    currents=currents,
    rules=Rules(objects=8, remap=Code.DEVICE_STATE),
    bus_off=0x81FD,
    power_stage_bit=True,
)
