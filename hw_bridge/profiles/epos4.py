"""maxon EPOS4 (Module 50/5) with an EC-i 40, from the facts of its public EDS of 2021.

Traps, all simulated: TPDO 2 to 4 are disabled by default; no interpolation in csp until 60C2h is set; 8250h when cyclic
targets stay away; a following error trips at once; objects that others have are absent.
"""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING

from hw_bridge.dictionary import (
    BLOCKS_MAXON,
    I8,
    I32,
    METHODS,
    OCTETS,
    U8,
    U16,
    U32,
    U64,
    Code,
    Mode,
    NodeId,
    record,
    sub,
    supported,
    var,
)
from hw_bridge.profiles.description import (
    CONNECTION,
    DISABLED_AFTER_QUICK_STOP,
    MILLIAMPERE,
    OFF,
    QUICK_STOP_WHEN_LOST,
    RAMP,
    Currents,
    Profile,
    Rules,
    SetupWrite,
    Units,
    faults,
)
from hw_bridge.profiles.maxon import CONSUMERS, DISABLED, ERROR_HISTORY, NO_RTR
from hw_bridge.profiles.motors import PULSES, RPM
from hw_bridge.profiles.rows import adapted, joined, process_data, standard

if TYPE_CHECKING:
    from hw_bridge.dictionary import Dictionary

HOMING = {n: METHODS[n] for n in (1, 2, 7, 11, 17, 18, 23, 27, 33, 34, 37)} | BLOCKS_MAXON
MODES = (Mode.PP, Mode.PV, Mode.HM, Mode.CSP, Mode.CSV, Mode.CST)
UNDERVOLTAGE, OVERVOLTAGE = 8000, 58000  # [mV]
INCREMENTS, TURNS_PER_MINUTE, TURNS_PER_MINUTE_AND_SECOND = 0xB50000, 0xB44700, 0xC00300  # units without their prefix
DIMENSIONS = {  # objects that have to hold these units, and what they say otherwise
    0x60A8: (INCREMENTS, "positions are no increments"),
    0x60A9: (TURNS_PER_MINUTE, "velocities are no rpm"),
    0x60AA: (TURNS_PER_MINUTE_AND_SECOND, "accelerations are no rpm/s"),
}
GEAR = 0x3000  # of 3000h.2, bits 12 and 13: a gear between sensors, recalled
MAIN_SENSOR = (0x3000, 5)  # increments of a turn, as newer firmware computes them; not in the EDS of 2021

COMMUNICATION = joined(
    adapted(0x1000, 0x00020192),
    adapted(0x1001, mappable=False),
    ERROR_HISTORY,
    adapted(0x1005, access="const"),
    adapted(0x1008, "EPOS4"),
    record(0x1010, "Store parameters", sub(1, "Save all parameters", U32, "rw", 1)),
    record(
        0x1011,
        "Restore default parameters",
        sub(1, "Restore all default parameters", U32, "rw", 1),
        sub(4, "Restore specific default parameters", U32, "rw", 1),
    ),
    adapted(0x1014, access="ro"),
    CONSUMERS,
    standard(0x1017),
    adapted(0x1018, (0xFB, 0x61500000, 0x01700000, 1)),
    standard(0x1029, 0x1200),
)

PROCESS_DATA = process_data(
    12,
    ((0x60400010,), (0x60400010, 0x60600008), (0x60400010, 0x607A0020), (0x60400010, 0x60FF0020)),
    ((0x60410010,), (0x60410010, 0x60610008), (0x60410010, 0x60640020), (0x60410010, 0x606C0020)),
    transmit_flags=(NO_RTR, DISABLED, DISABLED, DISABLED),
    inhibit=10,
)

VENDOR = joined(
    var(0x2000, "Node-ID", U8, "ro", NodeId(0)),
    var(0x2001, "CAN bit rate", U8, "rw", 0, 0, 9),
    record(0x2200, "Power supply", sub(1, "Power supply voltage [0.1 V]", U16, "ro", 240, pdo=True)),
    record(0x2201, "Voltage limits", sub(1, "Undervoltage limit [mV]", U32, "rw", UNDERVOLTAGE),
           sub(2, "Overvoltage limit [mV]", U32, "rw", OVERVOLTAGE)),
    record(0x3000, "Axis configuration", sub(1, "Sensors", U32, "rw", 0x00100001),
           sub(2, "Control structure", U32, "rw", 0x00010111), sub(3, "Commutation sensors", U32, "rw", 0x31),
           sub(4, "Miscellaneous", U32, "rw", 0)),
    record(0x3001, "Motor data", sub(1, "Nominal current [mA]", U32, "rw", 5000, 1),
           sub(2, "Output current limit [mA]", U32, "rw", 15000), sub(3, "Number of pole pairs", U8, "rw", 1, 1),
           sub(4, "Thermal time constant winding [0.1 s]", U16, "rw", 40, 1),
           sub(5, "Torque constant [uNm/A]", U32, "rw", 0)),
    # acts on nothing, like 3003h, 30A3h and 3142h
    record(0x3002, "Electrical data motor", sub(1, "Resistance [mOhm]", U32, "rw", 0), sub(2, "Inductance [uH]", U16, "rw", 0)),
    record(0x3003, "Gear configuration", sub(1, "Reduction numerator", U32, "rw", 1, 1),
           sub(2, "Reduction denominator", U32, "rw", 1, 1), sub(3, "Max input speed [rpm]", U32, "rw", 100000)),
    record(0x3010, "Digital incremental encoder 1", sub(1, "Number of pulses", U32, "rw", PULSES, 16),
           sub(2, "Type", U16, "rw", 1)),
    record(0x30A0, "Current control", sub(1, "P gain", U32, "rw", 1171880), sub(2, "I gain", U32, "rw", 3906250)),
    record(0x30A1, "Position control", sub(1, "P gain", U32, "rw", 1500000), sub(2, "I gain", U32, "rw", 780000),
           sub(3, "D gain", U32, "rw", 16000), sub(4, "FF velocity gain", U32, "rw", 0),
           sub(5, "FF acceleration gain", U32, "rw", 0)),
    record(0x30A2, "Velocity control", sub(1, "P gain", U32, "rw", 20000), sub(2, "I gain", U32, "rw", 500000),
           sub(3, "FF velocity gain", U32, "rw", 0), sub(4, "FF acceleration gain", U32, "rw", 0),
           sub(5, "Filter cut-off frequency", U16, "rw", 600)),
    record(0x30A3, "Velocity observer", *(sub(n, f"Parameter {n}", U32, "rw", value)
           for n, value in enumerate((400, 100000, 33, 10, 1000), 1))),
    var(0x30B0, "Home position", I32, "rw", 0),
    var(0x30B1, "Home offset move distance", I32, "rw", 0, 0, 0),  # the move is not simulated
    var(0x30B2, "Current threshold for homing [mA]", U16, "rw", 500),
    record(0x30D1, "Current actual values", sub(1, "Averaged [mA]", I32, "ro", pdo=True),
           sub(2, "Actual [mA]", I32, "ro", pdo=True)),
    record(0x30E0, "Standstill window", sub(1, "Window [velocity units]", U32, "rw", 30), sub(2, "Time [ms]", U16, "rw", 2),
           sub(3, "Timeout [ms]", U16, "rw", 1000)),
    record(0x3142, "Digital input configuration", *(sub(n, f"Input {n}", U8, "rw", function)
           for n, function in enumerate((0, 1, 2, 19, 255, 255, 255, 255), 1))),
    record(0x3200, "Thermal overload", sub(1, "I2t level motor [%]", U16, "ro"),
           sub(2, "I2t level power stage [%]", U16, "ro")),
)  # fmt: skip

# what users and the vendor's tools read and write beside it; acts on nothing
TOOLS = joined(
    record(0x3012, "SSI absolute encoder", sub(1, "Data rate", U16, "rw", 2000, 400, 2000),
           sub(2, "Number of data bits", U32, "rw", 0xC00), sub(3, "Encoding type", U16, "rw", 1),
           sub(5, "Timeout time", U16, "rw", 30, 0, 50), sub(6, "Special bits trailing data", U16, "ro", pdo=True),
           sub(7, "Refresh frequency", U32, "ro"), sub(8, "Power up time", U16, "rw", 200, 0, 10000),
           sub(9, "Position raw value", U32, "ro"), sub(10, "Commutation offset value", U32, "rw"),
           sub(11, "Position bits", U32, "rw", 12), sub(12, "Special bits leading data", U16, "ro", pdo=True),
           sub(13, "Position raw value complete", U64, "ro")),
    record(0x301A, "Digital Hall sensor", sub(1, "Type", U16, "rw", 0), sub(2, "Pattern", U16, "ro")),
    record(0x3150, "Digital output properties", sub(1, "Logic state", U16, "ro", pdo=True),
           sub(2, "Polarity", U16, "rw")),
    record(0x3151, "Digital output configuration", sub(1, "Output 1", U8, "rw", 16), sub(2, "Output 2", U8, "rw", 17),
           sub(3, "High-speed output 1", U8, "rw", 255)),
    record(0x3158, "Holding brake", sub(1, "Rise time", U16, "rw", 10, 0, 5000),
           sub(2, "Fall time", U16, "rw", 10, 0, 5000), sub(3, "State", U8, "ro")),
    record(0x31E0, "Recorder variables", *(sub(n, f"Variable {n}", U32, "rw") for n in range(1, 5))),
    record(0x31E1, "Recorder configuration", sub(1, "Sampling period", U16, "rw", 120, 40, 65534),
           sub(2, "Number of samples", U16, "rw", 500, 1, 500)),
    record(0x31E2, "Recorder trigger", sub(1, "Variable", U32, "rw"), sub(2, "Mode", U8, "rw"),
           sub(3, "High value", U32, "rw"), sub(4, "Low value", U32, "rw"), sub(5, "Mask", U32, "rw", 0xFFFFFFFF),
           sub(6, "Preceding samples", U16, "rw", 0, 0, 499)),
    record(0x31E4, "Recorder control", sub(1, "Controlword", U16, "rw"), sub(2, "Statusword", U16, "ro")),
    record(0x31E5, "Recorder data", sub(1, "Recorded samples", U16, "ro"), sub(2, "Time stamp", U32, "ro"),
           sub(3, "Snapshot", OCTETS, "ro", "")),
    *(record(0x31E5 + n, f"Recorder buffer {n}", sub(1, "Complete", OCTETS, "ro", ""), sub(2, "Part 1", OCTETS, "ro", ""))
      for n in range(1, 5)),
    record(0x3202, "Functional safety", sub(1, "STO input states", U8, "ro")),
    record(0x324B, "Mechanical tuning configuration", sub(1, "Cut-off frequency", U32, "rw", 8000, 1, 200000),
           sub(2, "Target amplitude", U32, "rw", 1, 1, 82000), sub(3, "Identify Km", U8, "rw", 1, 0, 1),
           sub(4, "P gain dynamic friction", U32, "rw", 1000), sub(5, "I gain dynamic friction", U32, "rw", 100),
           sub(0x20, "Target velocity", I32, "rw"), sub(0x21, "Profile acceleration", U32, "rw", 10000, 1),
           sub(0x22, "Profile deceleration", U32, "rw", 10000, 1)),
    record(0x324C, "Mechanical tuning parameters", sub(1, "Cycle duration", U32, "ro"), sub(2, "Set current", U16, "ro"),
           sub(3, "Position peak", U32, "ro"), sub(4, "Dynamic friction", U32, "ro"), sub(6, "Extra delay", U32, "ro"),
           sub(0x20, "Velocity demand", I32, "ro"), sub(0x21, "Velocity averaged", I32, "ro")),
    record(0x324D, "Velocity tuning configuration", sub(1, "Step amplitude", U32, "rw", 500, 1, 2500000),
           sub(2, "Cycle time", U32, "ro"), sub(3, "Target amplitude", U16, "rw", 3, 3, 3000),
           sub(4, "Max cycle time factor", U16, "rw", 11, 11, 60)),
    record(0x324E, "Velocity tuning parameter", sub(1, "Excitation amplitude", U32, "ro")),
    record(0x324F, "Velocity tuning positions", *(sub(n, f"Positions {n}", OCTETS, "ro", "") for n in range(1, 8))),
    record(0x3250, "Velocity tuning offset", *(sub(n, f"Offset {n}", I32, "ro") for n in range(1, 4))),
)  # fmt: skip

APPLICATION = joined(
    adapted(0x6007, 3),
    standard(0x603F, 0x6040, 0x6041),
    adapted(0x605A, 6),
    standard(0x605B, 0x605C, 0x605E, 0x6060, 0x6061, 0x6062, 0x6064, 0x6065),
    adapted(0x6066, 0, 0, 0),
    standard(0x6067, 0x6068, 0x606B, 0x606C, 0x6071),
    var(0x6076, "Motor rated torque [uNm]", U32, "ro", 0),
    standard(0x6077, 0x607A),
    record(0x607B, "Position range limit", sub(1, "Min position range limit", I32, "rw", 0, 0, 0, pdo=True),
           sub(2, "Max position range limit", I32, "rw", 0, 0, 0, pdo=True)),
    standard(0x607D),
    adapted(0x607F, 50000, 1),
    adapted(0x6080, 50000, 1),
    *(adapted(index, low=1) for index in (0x6081, 0x6083, 0x6084, 0x6085)),  # rpm, rpm/s
    standard(0x6086),
    adapted(0x6098, mappable=True),
    standard(0x6099),
    adapted(0x609A, low=1),
    var(0x60A8, "SI unit position", U32, "const", INCREMENTS),
    var(0x60A9, "SI unit velocity", U32, "rw", TURNS_PER_MINUTE),
    var(0x60AA, "SI unit acceleration", U32, "const", TURNS_PER_MINUTE_AND_SECOND),
    standard(0x60B0, 0x60B1, 0x60B2, *range(0x60B8, 0x60BE)),
    record(0x60C2, "Interpolation time period", sub(1, "Period value", U8, "rw", 0, 0, 100),
           sub(2, "Time index", I8, "rw", -3, -3, -3)),
    standard(0x60C5),
    record(0x60E3, "Supported homing methods", *(sub(n, f"Method {n}", I8, "ro", method)
           for n, method in enumerate(sorted(HOMING), 1))),
    record(0x60E4, "Additional position actual values", *(sub(n, f"Position sensor {n}", I32, "ro", pdo=True)
           for n in range(1, 4))),
    record(0x60E5, "Additional velocity actual values", *(sub(n, f"Velocity sensor {n}", I32, "ro", pdo=True)
           for n in range(1, 4)), *(sub(8 + n, f"Velocity averaged sensor {n}", I32, "ro", pdo=True)
           for n in range(1, 4))),
    standard(0x60F4, 0x60FD),
    record(0x60FE, "Digital outputs", sub(1, "Physical outputs", U32, "rw", 0, pdo=True)),
    standard(0x60FF, 0x6402),
    adapted(0x6502, supported(*MODES)),
)  # fmt: skip

FAULTS = faults(  # EMCY: bits of 1001h, where recalled; bit 7 is a motion error
    (0x1000, 0x01, OFF, "generic"),
    (0x2310, 0x03, OFF, "overcurrent"),
    (0x2320, 0x03, OFF, "power stage protection"),
    (0x3210, 0x05, OFF, "overvoltage"),
    (0x3220, 0x05, RAMP, "undervoltage"),
    (0x4210, 0x09, OFF, "thermal overload"),
    (0x4380, 0x09, OFF, "thermal motor overload"),
    (0x5113, 0x05, OFF, "logic supply voltage too low"),
    (0x6180, 0x01, OFF, "internal software"),
    (0x6320, 0x01, RAMP, "software parameter"),
    (0x7320, 0x81, OFF, "position sensor"),
    (0x7388, 0x81, OFF, "Hall sensor"),
    (0x8110, 0x11, CONNECTION, "CAN overrun (objects lost)"),
    (0x8120, 0x11, CONNECTION, "CAN error passive"),
    (0x8130, 0x11, CONNECTION, "heartbeat"),
    (0x8150, 0x11, CONNECTION, "PDO COB-ID collision"),
    (0x81FD, 0x11, CONNECTION, "CAN bus turned off"),
    (0x8210, 0x11, CONNECTION, "PDO length"),
    (0x8250, 0x11, RAMP, "RPDO timeout"),
    (0x8611, 0x81, RAMP, "following error"),
    (0x8A80, 0x81, RAMP, "negative limit switch"),
    (0x8A81, 0x81, RAMP, "positive limit switch"),
    (0x8A82, 0x81, RAMP, "software position limit"),
    (0x8A88, 0x81, OFF, "STO"),
)


def units(dictionary: Dictionary, _pitch: float | None = None) -> Units:
    """Increments, rpm with the prefix of 60A9h, rpm/s with that of 60AAh, per mille of the rated torque.

    An increment is that of the main sensor: 3000h.5 where a drive tells it, else a quarter pulse of encoder 1.
    """
    stored = dictionary.values.get(MAIN_SENSOR, 0)
    increment = 2.0 * pi / (stored if isinstance(stored, int) and stored > 0 else 4 * dictionary.get(0x3010, 1))
    velocity, acceleration = (RPM * 10.0 ** _prefix(dictionary.get(index)) for index in (0x60A9, 0x60AA))
    return Units(increment, velocity, acceleration, dictionary.get(0x3001, 1) * 1e-6)


def _prefix(unit: int) -> int:
    """The power of ten of a unit of CiA 303-2, its highest byte."""
    prefix = unit >> 24
    return prefix - 256 * (prefix > 127)


def unsure(dictionary: Dictionary, _pitch: float | None) -> list[str]:
    """Why units may be others than those of the table: other dimensions, another sensor, a gear, another rated torque."""
    get = dictionary.get
    doubts = [
        f"{index:04X}h is {get(index):X}h: {meaning}"
        for index, (expected, meaning) in DIMENSIONS.items()
        if get(index) & 0xFFFFFF != expected
    ]
    if get(0x3000, 2) & GEAR:
        doubts.append(
            f"3000h.2 is {get(0x3000, 2):X}h: a gear is configured, and what counts before and after it is not known"
        )
    if get(0x3001, 1) == 0:
        doubts.append(
            "3001h.1 is 0 mA: no object tells the nominal current, whose thousandths are measured and limited"
        )
    rated = get(0x6076)
    product = get(0x3001, 1) * get(0x3001, 5) // 1000  # [uNm]; 0 where the drive was not told its motor
    if rated and product and abs(rated - product) > 0.01 * product:
        doubts.append(
            f"6076h is {rated} uNm, 3001h tells {product}: torques are not thousandths of the nominal current"
        )
    return doubts + _unsure_increments(dictionary)


def _unsure_increments(dictionary: Dictionary) -> list[str]:
    """Why increments may be others than those of the digital incremental encoder 1 (3010h.1).

    3000h.1 has the type of sensor 1 in its lowest byte (1: digital incremental encoder), that of sensor 2 in the next one
    (3: SSI, 3012h); 3000h.2 has the number of the main sensor in bits 16 to 19.
    """
    sensors, structure = dictionary.get(0x3000, 1), dictionary.get(0x3000, 2)
    main = structure >> 16 & 0xF
    stored = dictionary.values.get(MAIN_SENSOR, 0)
    resolution = stored if isinstance(stored, int) else 0
    encoder = main == 1 and sensors & 0xFF == 1
    if encoder and resolution in (0, 4 * dictionary.get(0x3010, 1)):
        return []
    if encoder:
        return [f"3000h.5 tells {resolution} increments for a turn, 3010h.1 {4 * dictionary.get(0x3010, 1)}"]
    if resolution:
        return []
    kind = sensors >> 8 * max(main - 1, 0) & 0xFF
    what = "an SSI encoder (3012h)" if main == 2 and kind == 3 else f"sensor {main} of type {kind}"
    return [f"the main sensor (3000h) is {what}, and no 3000h.5 tells its increments for a turn"]


def currents(dictionary: Dictionary) -> Currents:
    """Nominal current and output limit with the winding's time constant."""
    get = dictionary.get
    return Currents(get(0x3001, 1) / 1000.0, get(0x3001, 2) / 1000.0, get(0x3001, 4) / 10.0)


def supply(dictionary: Dictionary) -> tuple[float, float]:
    """Voltage limits."""
    get = dictionary.get  # firmware 0110h has no such object
    return get(0x2201, 1, missing=UNDERVOLTAGE) / 1000.0, get(0x2201, 2, missing=OVERVOLTAGE) / 1000.0


GAINS = {
    (0x30A1, 1): {"position_gain": 1},
    (0x30A2, 1): {"velocity_gain": 1},
    (0x30A2, 2): {"velocity_integral": 1},
}

PROFILE = Profile(
    name="epos4",
    title="maxon EPOS4",
    objects=COMMUNICATION + PROCESS_DATA + VENDOR + TOOLS + APPLICATION,
    modes=MODES,
    homing=HOMING,
    faults=FAULTS,
    motor_name="ec_i_40",
    units=units,
    scaling=((0x3000, 1), (0x3000, 2), (0x3010, 1), (0x3001, 1), (0x60A8, 0), (0x60A9, 0), (0x60AA, 0)),
    unsure=unsure,
    optional_scaling=(MAIN_SENSOR, (0x6076, 0)),
    setup=(
        SetupWrite(0x60A9, 0, 0xFDB44700, "velocities in mrpm instead of rpm"),
        QUICK_STOP_WHEN_LOST,
        # out of Quick stop active, where it would stay, a controlword that goes on coming enables again
        DISABLED_AFTER_QUICK_STOP,
    ),
    current_objects=((0x30D10220, MILLIAMPERE),),
    homing_force=((0x30B2, 0, MILLIAMPERE),),
    encoder_error=0x7320,
    reference_bit=15,  # recalled
    related=((0xFB, 0x65510000),),  # EPOS4 50/15, by its public EDS file
    commands=frozenset({0x2001, 0x31E4}),  # bit rate; recorder control
    output_objects=frozenset({0x3150, 0x3151}),  # polarity and function of outputs, also the one of a brake
    currents=currents,
    rules=Rules(objects=12, remap=Code.DEVICE_STATE),
    bus_off=0x81FD,
    target_beyond_limit=0x8A82,
    limits_off_when_zero=True,
    power_stage_bit=True,
    rpdo_timeout=True,
    gains=GAINS,
    supply=supply,
)
