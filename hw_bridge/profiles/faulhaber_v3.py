"""FAULHABER Motion Control V3.0 (MC 3001, 3603, 5004, 5005, 5010, MCS) with a linear motor LM 2070-080-11.

From the communications manual 7000.05050 and public code. Recalled, not found: the product code of the MC 5005, and every
default marked so in the table.

Two public EDS files of this family (605.0131.01-M of MC 5004 and 5005, 605.0141.01-L of the MC3 stamp) were compared with the
table. They have the same default RPDOs, 2329h, 2344h, 6007h = 1, 605Ah = 2, 605Bh = 0, 605Ch = 1, 605Dh = 1, 605Eh = 2, 60B0h
to 60B2h and 60E0h, 60E1h = 6000. TPDO 1 is {6041h, 6064h} and TPDO 2 {6077h, 606Ch} by default. They have four objects a PDO,
not eight; no 603Fh, 6075h (2329h.1 instead), 607Fh, 60C2h (a 2332h of unknown unit instead), 60FEh (2311h.4 instead) and 6402h;
6072h cannot be written; 2321h.2, which errors trip, is 0; 60C5h, 60C6h, 607Eh and 6096h are there. No file that has the objects
of this table was found. The drive is asked what it has.

Velocities: both files have 6092h.1 = 4096 and 6096h = 1/4096 by default, and public code for an MCS gives 6080h and 6081h of
a drive with defaults in 1/min. So a velocity is positions per minute times 6096h.1 / 6096h.2. A public catheter robot scales
its MC 5004 the same way. That the minute is the base of a linear motor too was not found: see `unsure`. No object tells the
unit of accelerations (6097h is in neither file): 1/s2 in that code for turns, mm/s2 for linear motors recalled; by 6096h it would
be 60 mm/s2. The section on units of the vendor's "Drive Functions" (7000.05048) was not found. The hardware file has to state it.
"""

from __future__ import annotations

from fractions import Fraction
from math import log10
from typing import TYPE_CHECKING

from hw_bridge.dictionary import (
    BLOCKS_FAULHABER,
    I8,
    I16,
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
from hw_bridge.profiles.description import CONNECTION, OFF, RAMP, RATED, REPORT, Currents, Fault, Profile, Rules, Units
from hw_bridge.profiles.faulhaber import HOMING_SPEEDS, communication
from hw_bridge.profiles.motors import MOTORS, PER_PITCH
from hw_bridge.profiles.rows import adapted, joined, process_data, standard

if TYPE_CHECKING:
    from hw_bridge.dictionary import Dictionary

MODES = (Mode.PP, Mode.PV, Mode.HM, Mode.CSP, Mode.CSV, Mode.CST)
PITCH = MOTORS["lm2070"].pitch
FAR = 2_000_000_000
NO_LIMIT = 6000  # of a torque, in thousandths of the rated one
MINUTE = 60  # [s], base of velocities

COMMUNICATION = communication("MC5005", "0111.02O", (11601, 1), errors=8, groups=(3, 3), hardware="1.0")

# RPDO and TPDO as recalled: the controlword in every RPDO
PROCESS_DATA = process_data(
    8,
    ((0x60400010,), (0x60400010, 0x607A0020), (0x60400010, 0x60FF0020), (0x60400010, 0x60710010)),
    ((0x60410010,), (0x60410010, 0x60640020), (0x60410010, 0x606C0020), (0x60410010, 0x60770010)),
    inhibit=0,
    event=0,
)

APPLICATION = joined(
    var(0x2320, "Error word", U16, "ro", pdo=True),
    record(0x2325, "Voltages", sub(7, "Motor supply [10 mV]", U16, "ro", 2400, pdo=True)),
    record(0x2326, "Temperatures", sub(1, "CPU [degC]", I16, "ro", 35), sub(2, "Power stage [degC]", I16, "ro", 35),
           sub(3, "Winding [degC]", I16, "ro", 30)),
    # of this motor; a drive that was not set up has 0
    record(0x2329, "Motor and application data", sub(1, "Rated current [mA]", U16, "rw", 790),
           sub(2, "Continuous current [mA]", U16, "rw", 790), sub(3, "Peak current [mA]", U16, "rw", 2370)),
    # 2342h and 2343h act on nothing; types as of 2344h, defaults assumed
    record(0x2342, "Torque control", sub(1, "Gain", U32, "rw", 1000), sub(2, "Integral time [us]", U16, "rw", 150)),
    record(0x2343, "Flux control", sub(1, "Gain", U32, "rw", 1000), sub(2, "Integral time [us]", U16, "rw", 150)),
    record(0x2344, "Velocity control", sub(1, "Gain", U32, "rw", 1000), sub(2, "Integral time [100 us]", U16, "rw", 80),
           sub(3, "Deviation threshold", U16, "rw", 65535), sub(4, "Deviation time [ms]", U16, "rw", 100)),
    adapted(0x6007, 1),  # default recalled
    standard(0x603F, 0x6040, 0x6041, 0x605A, 0x605B, 0x605C),  # defaults of 605A to 605E recalled
    var(0x605D, "Halt option code", I16, "rw", 1, 1, 2),
    standard(0x605E),
    adapted(0x6060, 0, -4, 10),
    standard(0x6061, 0x6062, 0x6063, 0x6064),
    adapted(0x6065, 0xFFFFFFFF, mappable=True),  # assumed off
    adapted(0x6066, 100, mappable=True),
    adapted(0x6067, 40, mappable=True),
    adapted(0x6068, 48, mappable=True),
    standard(0x606B, 0x606C),
    adapted(0x606D, 32),  # 606D to 6070 recalled
    adapted(0x606E, 48),
    adapted(0x606F, 16),
    adapted(0x6070, 48),
    adapted(0x6071, 0, -6000, 6000),
    var(0x6072, "Max torque", U16, "rw", 2000, 0, 6000, pdo=True),
    var(0x6075, "Motor rated current [mA]", U32, "rw", 790),
    standard(0x6077, 0x6078, 0x607A, 0x607C),
    adapted(0x607D, (-FAR, FAR), mappable=True),
    standard(0x607E),
    adapted(0x607F, 2000, 0, 32767, mappable=True),  # mm/s
    adapted(0x6080, 2000, 0, 32767, mappable=True),
    adapted(0x6081, 1000, 1, 32767),
    adapted(0x6083, 1000, 1, 32750),  # mm/s2
    adapted(0x6084, 1000, 1, 32750),
    adapted(0x6085, 10000, 1, 32750),
    standard(0x6086),
    record(0x608F, "Position encoder resolution", sub(1, "Encoder increments", U32, "rw", 3000, 1),
           sub(2, "Motor revolutions", U32, "rw", 1, 1)),
    record(0x6091, "Gear ratio", sub(1, "Motor shaft revolutions", U32, "rw", 1, 1),
           sub(2, "Driving shaft revolutions", U32, "rw", 1, 1)),
    adapted(0x6092, (24000, 1)),  # um for one magnetic pitch
    record(0x6096, "Velocity factor", sub(1, "Numerator", U32, "rw", 1, 1),  # um/min to mm/s
           sub(2, "Divisor", U32, "rw", 60_000, 1)),
    adapted(0x6098, 37),
    HOMING_SPEEDS,
    adapted(0x609A, 500, 1),
    standard(0x60B0, 0x60B1, 0x60B2, *range(0x60B8, 0x60BE)),
    record(0x60C2, "Interpolation time period", sub(1, "Period value", U8, "rw", 0, 0, 255),
           sub(2, "Time index", I8, "rw", -3, -6, 0)),
    var(0x60E0, "Positive torque limit", U16, "rw", 6000, 0, 6000, pdo=True),
    var(0x60E1, "Negative torque limit", U16, "rw", 6000, 0, 6000, pdo=True),
    standard(0x60F4, 0x60FD),
    record(0x60FE, "Digital outputs", sub(1, "Physical outputs", U32, "rw", pdo=True),
           sub(2, "Bit mask", U32, "rw", 0xFFFFFFFF)),
    standard(0x60FF),
    adapted(0x6402, 3),
    adapted(0x6502, supported(*MODES)),
)  # fmt: skip

FAULTS = {
    code: Fault(register, bits, reaction, meaning)
    for code, register, bits, reaction, meaning in (  # EMCY, bits of 1001h, bits of 2320h
        (0x84F0, 0x20, 0x0001, RAMP, "speed deviation"),
        (0x8611, 0x20, 0x0002, RAMP, "following error"),
        (0x3210, 0x04, 0x0004, OFF, "overvoltage"),
        (0x3220, 0x04, 0x0008, OFF, "undervoltage"),
        (0x43F0, 0x08, 0x0010, REPORT, "temperature warning"),
        (0x4310, 0x08, 0x0020, OFF, "temperature"),
        (0x7300, 0x20, 0x0040, OFF, "encoder"),
        (0x5410, 0x01, 0x0080, OFF, "output stage"),
        (0x7400, 0x01, 0x0100, OFF, "module"),
        (0x7200, 0x02, 0x0200, OFF, "current measurement"),
        (0x5530, 0x01, 0x0400, REPORT, "EEPROM"),
        (0x8110, 0x10, 0x0800, REPORT, "CAN overrun"),
        (0x8130, 0x10, 0x0800, CONNECTION, "node guarding or heartbeat"),
        (0x8140, 0x10, 0x0800, REPORT, "recovered from bus-off"),
        (0x8210, 0x10, 0x0800, REPORT, "PDO too short"),
        (0x8220, 0x10, 0x0800, REPORT, "PDO too long"),
        (0x8310, 0x10, 0x0800, REPORT, "RS232 overrun"),
        (0x6100, 0x01, 0x1000, OFF, "software"),
        (0x84FF, 0x20, 0x2000, RAMP, "speed too high"),
    )
}


def units(dictionary: Dictionary, pitch: float | None = None) -> Units:
    """User units follow the factor group: um and mm/s with the defaults of this table. No object tells the mm/s2.

    `pitch`: that of the motor [m]. No object tells it: without it the motor is the one whose pitch is the feed in um, by
    the vendor's convention; else an LM 2070.
    """
    if pitch is None:
        pitch = _pitch_in_micrometers(dictionary) or PITCH
    position = pitch * _pitches(dictionary)
    factor = Fraction(dictionary.get(0x6096, 1), dictionary.get(0x6096, 2))
    return Units(position, float(1 / (MINUTE * factor)) * position, 1000.0 * position, rated(dictionary) * 1e-6)


def rated(dictionary: Dictionary) -> int:
    """Rated current [mA]: 6075h where a drive has it, else 2329h.1, as the vendor's EDS files have it."""
    return dictionary.get(0x6075) if 0x6075 in dictionary else dictionary.get(0x2329, 1)


def _pitches(dictionary: Dictionary) -> float:
    """Magnetic pitches of one user unit, by the factor group."""
    get = dictionary.get
    increments = get(0x608F, 1) / get(0x608F, 2) * get(0x6091, 1) / get(0x6091, 2) * get(0x6092, 2) / get(0x6092, 1)
    return increments / PER_PITCH


def _pitch_in_micrometers(dictionary: Dictionary) -> float:
    """The pitch of a known motor that user units of 1 um mean [m]; 0 where it is none."""
    feed = 1e-6 / _pitches(dictionary)
    return next((motor.pitch for motor in MOTORS.values() if motor.pitch and abs(feed - motor.pitch) < 1e-9), 0.0)


def unsure(dictionary: Dictionary, pitch: float | None) -> list[str]:
    """Why lengths may be others: no object tells the motor's magnetic pitch. `pitch`: that of the motor of the hardware file.

    The velocity unit has to be a power of ten of m/s, such as 1 mm/s. A drive that counts by the second would show a unit that
    is none, because it would be wrong by 60. So the base is proven before anything moves.
    """
    lost = [] if rated(dictionary) else ["no object tells the rated current (6075h, 2329h.1)"]
    velocity = units(dictionary, pitch).velocity
    power = log10(velocity)
    if abs(power - round(power)) > 1e-6:
        lost.append(
            f"a unit of velocity is {velocity:g} m/s (6096h), no power of ten: the vendor's base of velocities, the minute, is "
            f"not proven for it. Set 6096h so that it is 1 mm/s (1/60000 where positions are um)"
        )
    if pitch is not None or _pitch_in_micrometers(dictionary):
        return lost
    return [
        *lost,
        f"a magnetic pitch is {1.0 / _pitches(dictionary):g} user units (608Fh, 6091h, 6092h), that of no known motor in um",
    ]


def currents(dictionary: Dictionary) -> Currents:
    """Rated current, and the torque limits as a multiple of it."""
    current = rated(dictionary) / 1000.0
    peak = min(dictionary.get(index, missing=NO_LIMIT) for index in (0x6072, 0x60E0, 0x60E1)) / 1000.0
    return Currents(current, peak * current, 15.0)  # the winding's time constant of the LM 2070 [s], estimate


def deviation(dictionary: Dictionary) -> tuple[float, int]:
    """Window and time of the speed deviation."""
    return float(dictionary.get(0x2344, 3)), dictionary.get(0x2344, 4)


# the integral part of a PI controller is its gain over its integral time
GAINS = {(0x2344, 1): {"velocity_gain": 1, "velocity_integral": 1}, (0x2344, 2): {"velocity_integral": -1}}

PROFILE = Profile(
    name="faulhaber_v3",
    title="FAULHABER Motion Control V3.0",
    objects=COMMUNICATION + PROCESS_DATA + APPLICATION,
    modes=MODES,
    homing={n: moves for n, moves in METHODS.items() if n != 35} | BLOCKS_FAULHABER,
    faults=FAULTS,
    motor_name="lm2070",
    units=units,
    scaling=(*((index, sub) for index in (0x608F, 0x6091, 0x6092, 0x6096) for sub in (1, 2)), (0x6075, 0)),
    unsure=unsure,
    unstated_units=("acceleration",),
    # units stay um and mm/s: finer ones would limit ramps to 3 m/s2. What rounding leaves over is carried on.
    current_objects=((0x60770010, RATED),),
    # 2350h and 2351h: against an end stop
    homing_force=((0x60E0, 0, RATED), (0x60E1, 0, RATED), (0x2350, 0, RATED), (0x2351, 0, RATED)),
    overcurrent=0x5410,
    encoder_error=0x7300,
    commands=frozenset({0x2400}),  # bit rate
    output_objects=frozenset({0x2311, 0x2315}),  # digital outputs, function of the fault pin; recalled
    currents=currents,
    rules=Rules(objects=8, remap=Code.UNSUPPORTED_ACCESS),
    bus_off=0x8140,
    deviation=deviation,
    gains=GAINS,
)
