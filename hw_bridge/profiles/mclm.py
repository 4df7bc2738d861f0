"""FAULHABER MCLM 300x CO (Motion Control V2) with a linear motor LM 2070-080-11, from the facts of its public EDS.

Traps, all simulated: software limits of +-9 996 um that act in position mode; a magnetic pitch of 18 mm by default,
while this motor has 24 mm, so that a "um" is 1.333 um until 2350h.4 is set for it; errors that are told but do not trip.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.dictionary import (
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
from hw_bridge.profiles.description import MILLIAMPERE, RAMP, Currents, Fault, Profile, Rules, SetupWrite, Units
from hw_bridge.profiles.faulhaber import HOMING_SPEEDS, communication
from hw_bridge.profiles.motors import PER_PITCH
from hw_bridge.profiles.rows import adapted, joined, process_data, standard

if TYPE_CHECKING:
    from hw_bridge.dictionary import Dictionary

MODES = (Mode.PP, Mode.PV, Mode.HM)

COMMUNICATION = communication("MCLM300x", "3150.69C", (3150, 3), errors=2, groups=(9, 6))

PROCESS_DATA = process_data(
    4,
    ((0x60400010,), (0x60400010, 0x607A0020), (0x60400010, 0x60FF0020), (0x60400010, 0x257A0020)),
    ((0x60410010,), (0x60410010, 0x60640020), (0x60410010, 0x606C0020), (0x60640020, 0x606C0020)),
    event=0,
)

VENDOR = joined(
    var(0x2320, "Fault register", U16, "ro", pdo=True),
    record(0x2321, "Error mask", sub(1, "EMCY mask", U16, "rw", 0xFFFF), sub(2, "Fault mask", U16, "rw", 0),
           sub(3, "Errout mask", U16, "rw", 0x00FF)),
    record(0x2322, "Deviation", sub(1, "Delay [ms]", U16, "rw", 200), sub(2, "Maximum [mm/s]", U16, "rw", 30000)),
    record(0x2330, "Sampling", sub(1, "Sampling rate", U16, "rw", 1, 1, 20)),
    # acts on nothing; defaults are values in use on real LM motors or assumed (2331h)
    record(0x2331, "Velocity control", sub(1, "P term POR", U16, "rw", 40, 1, 255),
           sub(2, "I term", U16, "rw", 50, 1, 255)),
    record(0x2332, "Position control", sub(1, "P term PP", U16, "rw", 15, 1, 255),
           sub(2, "D term PD", U16, "rw", 10, 1, 255)),
    record(0x2333, "Current control", sub(1, "Continuous current [mA]", U16, "rw", 790, 0, 12000),  # currents: those
           sub(2, "Peak current [mA]", U16, "rw", 2370, 0, 12000), sub(3, "Integral", U16, "rw", 3, 1, 255)),  # of LM 2070
    var(0x2334, "Current limit [mA]", U16, "ro", pdo=True),
    record(0x2338, "General settings", sub(1, "Commutation", U16, "rw", 1, 0, 1),
           sub(2, "Limits in velocity mode", U16, "rw", 0, 0, 1), sub(3, "Limits in position mode", U16, "rw", 1, 0, 1)),
    # a range of 200 to 65400 without a unit is taken for ms, its default is assumed
    record(0x2350, "Motor", sub(1, "KN", U16, "rw", 14000, 0, 16383), sub(2, "RM", U32, "rw", 200000, 0, 320000),
           sub(4, "Magnetic pitch [mm]", U8, "rw", 18, 8, 60),
           sub(5, "Thermal time constant [ms]", U16, "rw", 15000, 200, 65400)),
    var(0x2562, "Position demand internal [increments]", I32, "ro", pdo=True),
    var(0x257A, "Target position internal [increments]", I32, "rw", pdo=True),
)  # fmt: skip

APPLICATION = joined(
    standard(0x6040, 0x6041),
    adapted(0x6060, 1, -9, 8),
    standard(0x6061, 0x6062, 0x6063, 0x6064),
    adapted(0x6067, 120, mappable=True),
    adapted(0x6068, 200, mappable=True),
    standard(0x606B, 0x606C),
    adapted(0x606D, 20),
    adapted(0x606E, 200),
    adapted(0x606F, 20),
    adapted(0x6070, 200),
    standard(0x6078, 0x607A),
    record(0x607B, "Position range limit", sub(1, "Min", I32, "ro", -18_000_000), sub(2, "Max", I32, "ro", 18_000_000)),
    standard(0x607C),
    adapted(0x607D, (-9996, 9996)),
    standard(0x607E),
    adapted(0x607F, 30000, 0, 30000),  # mm/s; default assumed
    adapted(0x6081, 1000, 0, 30000),  # default assumed
    *(adapted(index, 30000, 0, 32000) for index in (0x6083, 0x6084, 0x6085)),  # mm/s2
    record(0x608F, "Position encoder resolution", sub(1, "Encoder increments", U32, "ro", PER_PITCH),
           sub(2, "Pitch [mm]", U32, "ro", 18)),
    record(0x6091, "Gear ratio", sub(1, "Motor revolutions", U32, "ro", 1), sub(2, "Shaft revolutions", U32, "ro", 1)),
    adapted(0x6092, (1000, 1)),
    record(0x6093, "Position factor", sub(1, "Numerator", U32, "ro", PER_PITCH),
           sub(2, "Feed constant", U32, "ro", 18000)),
    adapted(0x6098, 20, 0, 36),
    HOMING_SPEEDS,
    adapted(0x609A, 50, 1),
    standard(0x60FD, 0x60FF),
    adapted(0x6502, supported(*MODES)),
)  # fmt: skip

FAULTS = {  # reactions act only where the fault mask 2321h.2 has the bit
    code: Fault(register, bits, RAMP, meaning)
    for code, register, bits, meaning in (  # EMCY, bits of 1001h, bits of 2320h
        (0x2310, 0x02, 0x0001, "continuous overcurrent"),
        (0x8400, 0x20, 0x0002, "speed deviation"),
        (0x8611, 0x20, 0x0002, "following error"),
        (0x3210, 0x04, 0x0004, "overvoltage"),
        (0x4310, 0x08, 0x0008, "temperature"),
        (0x5530, 0x01, 0x0010, "flash memory"),
        (0x8120, 0x10, 0x0040, "CAN error passive"),
        (0x8110, 0x10, 0x0080, "CAN overrun"),
        (0x8130, 0x10, 0x0100, "life guard or heartbeat"),
        (0x8140, 0x10, 0x0200, "recovered from bus-off"),
        (0xFF01, 0x01, 0x0800, "conversion overflow"),
        (0x6100, 0x01, 0x1000, "software"),
        (0x8220, 0x10, 0x2000, "PDO too long"),
        (0x8210, 0x10, 0x4000, "PDO too short"),
    )
}


def units(dictionary: Dictionary, pitch: float | None = None) -> Units:
    """User units are um, mm/s, mm/s2 of a motor with the pitch of 2350h.4.

    `pitch`: that of the motor that is there [m]; without it the drive's own counts.
    """
    millimeter = 1e-3 if pitch is None else pitch / dictionary.get(0x2350, 4)  # what the drive takes for 1 mm [m]
    get = dictionary.get
    position = millimeter * get(0x6092, 2) / get(0x6092, 1) * get(0x6091, 1) / get(0x6091, 2)
    return Units(position, millimeter, millimeter, 0.0)


def unsure(dictionary: Dictionary, _pitch: float | None) -> list[str]:
    """Why lengths may be others than those of the motor's pitch: another sensor is in use (2351h)."""
    increments = dictionary.get(0x608F, 1)
    return [f"608Fh.1 is {increments}: the sensor is not the motor's Hall sensors"] if increments != PER_PITCH else []


def currents(dictionary: Dictionary) -> Currents:
    """Continuous and peak current with their thermal time constant."""
    return Currents(dictionary.get(0x2333, 1) / 1e3, dictionary.get(0x2333, 2) / 1e3, dictionary.get(0x2350, 5) / 1e3)


def deviation(dictionary: Dictionary) -> tuple[float, int]:
    """Window and time of the speed deviation."""
    return float(dictionary.get(0x2322, 2)), dictionary.get(0x2322, 1)


PROFILE = Profile(
    name="mclm",
    title="FAULHABER MCLM 300x CO",
    objects=COMMUNICATION + PROCESS_DATA + VENDOR + APPLICATION,
    modes=MODES,
    homing={n: moves for n, moves in METHODS.items() if n != 37},
    faults=FAULTS,
    motor_name="lm2070",
    units=units,
    scaling=((0x2350, 4), (0x608F, 1), (0x6091, 1), (0x6091, 2), (0x6092, 1), (0x6092, 2)),
    unsure=unsure,
    setup=(  # not the continuous overcurrent, which derates
        SetupWrite(0x2321, 2, 0x7BDE, "errors trip instead of being told only, also the heartbeat's"),
        SetupWrite(0x2338, 2, 1, "software limits act in velocity mode too"),
    ),
    current_objects=((0x60780010, MILLIAMPERE),),
    commands=frozenset({0x2400, 0x257A}),  # bit rate; target position in increments
    output_objects=frozenset({0x2315}),  # function of the fault pin
    currents=currents,
    rules=Rules(objects=4, remap=Code.UNSUPPORTED_ACCESS),
    bus_off=0x8140,
    deviation=deviation,
    masks=True,
    twins={0x257A: 0x607A},
)
