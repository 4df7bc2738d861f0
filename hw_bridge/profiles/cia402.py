"""Any drive of CiA 402: its objects are those of an EDS file, its units those that it tells or that the hardware file gives.

Nothing is assumed: where neither tells a unit, the file is refused. Currents are thousandths of 6075h, as
CiA 402 has them, unless the file says otherwise. What is simulated of such a drive (`twin drive -p cia402 --eds FILE`) is CiA 402 and nothing of a vendor's.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf, pi
from typing import TYPE_CHECKING

from hw_bridge.dictionary import I8, METHODS, U8, U32, Code, Dictionary, Mode, record, sub, var
from hw_bridge.profiles.description import (
    CONNECTION,
    DISABLED_AFTER_QUICK_STOP,
    OFF,
    QUICK_STOP_WHEN_LOST,
    RAMP,
    Currents,
    GivenUnits,
    Profile,
    Rules,
    Units,
    faults,
)
from hw_bridge.profiles.description import RATED as AS_RATED
from hw_bridge.profiles.quantities import SUFFIXES
from hw_bridge.profiles.rows import joined

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hw_bridge.dictionary import Entry

NAME = "cia402"
DEVICE_TYPE = 0x00020192
POSITION_UNIT, VELOCITY_UNIT, ACCELERATION_UNIT = 0x60A8, 0x60A9, 0x60AA
ENCODER, GEAR, FEED, FACTOR, RATED = 0x608F, 0x6091, 0x6092, 0x6093, 0x6075
REVOLUTION = 2.0 * pi  # [rad]
INCREMENT = 0xB5
# units of CiA 303-2, bits 16 to 23 of 60A8h to 60AAh; C0h: turns per minute, as maxon has it
NUMERATORS = {
    0x01: (1.0, "m"),
    0x10: (1.0, "rad"),
    0x41: (pi / 180.0, "rad"),
    0xB4: (REVOLUTION, "rad"),
    0xC0: (REVOLUTION / 60.0, "rad/s"),
}
DENOMINATORS = {0x00: (1.0, ""), 0x03: (1.0, "/s"), 0x47: (60.0, "/s"), 0x57: (1.0, "/s^2")}  # bits 8 to 15
OBJECTS = {"position": "60A8h, or 6092h, or 608Fh", "velocity": "60A9h", "acceleration": "60AAh"}

FAULTS = faults(  # codes of CiA 402
    (0x2310, 0x03, OFF, "continuous overcurrent"),
    (0x2320, 0x03, OFF, "short circuit"),
    (0x3210, 0x05, OFF, "overvoltage"),
    (0x3220, 0x05, OFF, "undervoltage"),
    (0x4210, 0x09, OFF, "temperature of the device"),
    (0x4310, 0x09, OFF, "temperature of the drive"),
    (0x5113, 0x05, OFF, "logic supply voltage"),
    (0x6100, 0x21, OFF, "internal software"),
    (0x6320, 0x21, RAMP, "parameter"),
    (0x7305, 0x21, OFF, "incremental encoder 1"),
    (0x8110, 0x11, CONNECTION, "CAN overrun (objects lost)"),
    (0x8120, 0x11, CONNECTION, "CAN error passive"),
    (0x8130, 0x11, CONNECTION, "life guarding or heartbeat"),
    (0x8140, 0x11, CONNECTION, "recovered from bus-off"),
    (0x8210, 0x11, CONNECTION, "PDO not processed, length"),
    (0x8220, 0x11, CONNECTION, "PDO too long"),
    (0x8611, 0x21, RAMP, "following error"),
)


def stated_unit(dictionary: Dictionary, kind: str) -> tuple[float, str] | None:
    """What a drive tells of its unit of `position`, `velocity` or `acceleration`: SI value and symbol; None: nothing."""
    index = {"position": POSITION_UNIT, "velocity": VELOCITY_UNIT, "acceleration": ACCELERATION_UNIT}[kind]
    if (code := dictionary.get(index)) and (unit := _coded(dictionary, code)) is not None:
        return unit if unit[1].lstrip("mrad") == SUFFIXES[kind] else None
    return _geared(dictionary) if kind == "position" and not code else None


def _coded(dictionary: Dictionary, code: int) -> tuple[float, str] | None:
    """A unit of CiA 303-2: prefix, numerator, denominator."""
    prefix, numerator, denominator = code >> 24, code >> 16 & 0xFF, code >> 8 & 0xFF
    if denominator not in DENOMINATORS:
        return None
    ten = 10.0 ** (prefix - 256 * (prefix > 127))
    per, suffix = DENOMINATORS[denominator]
    if numerator == INCREMENT:
        increment = _increment(dictionary)
        return None if increment is None else (ten * increment / per, f"rad{suffix}")
    if numerator not in NUMERATORS:
        return None
    value, symbol = NUMERATORS[numerator]
    return ten * value / per, f"{symbol}{suffix}".replace("/s/s", "/s^2")


def _increment(dictionary: Dictionary) -> float | None:
    """An increment of the encoder at the motor [rad], by 608Fh."""
    increments, turns = dictionary.get(ENCODER, 1), dictionary.get(ENCODER, 2)
    return REVOLUTION * turns / increments if increments > 0 and turns > 0 else None


def _geared(dictionary: Dictionary) -> tuple[float, str] | None:
    """A unit of position at the motor [rad] by the feed constant 6092h and the gear 6091h; else an increment.

    Nothing where a position factor 6093h stands alone: it makes another unit of an increment, which way differs.
    """
    feed, turns = dictionary.get(FEED, 1), dictionary.get(FEED, 2)
    motor, shaft = dictionary.get(GEAR, 1, missing=1), dictionary.get(GEAR, 2, missing=1)
    if feed > 0 and turns > 0 and motor > 0 and shaft > 0:
        return REVOLUTION * turns / feed * motor / shaft, "rad"
    increment = None if FEED in dictionary or FACTOR in dictionary else _increment(dictionary)
    return None if increment is None else (increment, "rad")


def unknown_units(dictionary: Dictionary, given: GivenUnits) -> list[str]:
    """A line for each unit that neither the drive nor the hardware file tells, or that are of two kinds of axis."""
    units = {kind: getattr(given, kind) or stated_unit(dictionary, kind) for kind in SUFFIXES}
    missing = [
        f"units.{kind}: the drive does not tell it ({OBJECTS[kind]}), nor does the hardware file"
        for kind, item in units.items()
        if item is None
    ]
    axes = {item[1].partition("/")[0] for item in units.values() if item is not None}
    missing += ["units: some are of a line, others of a turn"] if len(axes) > 1 else []
    if given.current is None and (0x6077 in dictionary or 0x6078 in dictionary) and dictionary.get(RATED) <= 0:
        missing.append(
            "units.current: 6077h and 6078h count in thousandths of 6075h, which the drive does not tell, nor does the file"
        )
    return missing


def units_without_object(objects: Iterable[Entry]) -> dict[str, str]:
    """Units for which a drive has no object at all, each with the objects that could tell it."""
    has = {entry.index for entry in objects}
    missing = {
        kind: OBJECTS[kind]
        for kind, indices in (
            ("position", {POSITION_UNIT, FEED, ENCODER}),
            ("velocity", {VELOCITY_UNIT}),
            ("acceleration", {ACCELERATION_UNIT}),
        )
        if not has & indices
    }
    return missing | ({"current": "6075h"} if has & {0x6077, 0x6078} and RATED not in has else {})


def _with_required_objects(objects: tuple[Entry, ...]) -> tuple[Entry, ...]:
    """The objects with a device type where the file leaves it open, and with what every drive has, for a simulated one."""
    by_address = {(entry.index, entry.sub): entry for entry in objects}
    if (kind := by_address.get((0x1000, 0))) is not None and not kind.default:
        by_address[0x1000, 0] = replace(kind, default=DEVICE_TYPE)
    own = joined(
        var(0x1001, "Error register", U8, "ro"),
        record(0x1003, "Pre-defined error field", sub(0, "Number of errors", U8, "rw"), sub(1, "Error 1", U32, "ro")),
        var(0x6061, "Modes of operation display", I8, "ro"),
    )
    has = {entry.index for entry in objects}
    return (*by_address.values(), *(value for value in own if value.index not in has))


def generic(objects: tuple[Entry, ...], given: GivenUnits, title: str) -> Profile:
    """The profile of a drive with these objects, those of an EDS file."""
    objects = _with_required_objects(objects)
    dictionary = Dictionary(objects, 1)

    def units(dictionary: Dictionary, _pitch: float | None = None) -> Units:
        """By the hardware file, else by the drive; 1 where neither tells, and the drive is not moved then."""
        position, velocity, acceleration = (
            (getattr(given, kind) or stated_unit(dictionary, kind) or (1.0, ""))[0] for kind in SUFFIXES
        )
        current = given.current[0] if given.current is not None else dictionary.get(RATED) * 1e-6
        return Units(position, velocity, acceleration, current)

    def unsure(dictionary: Dictionary, _pitch: float | None) -> list[str]:
        return unknown_units(dictionary, given)

    position = given.position or stated_unit(dictionary, "position")
    moves = position is not None and position[1] == "m"
    offered = dictionary.get(0x6502)
    modes = tuple(mode for mode in Mode if mode and (not offered or offered >> (mode - 1) & 1))
    needed = (POSITION_UNIT, VELOCITY_UNIT, ACCELERATION_UNIT, ENCODER, GEAR, FEED, RATED)
    return Profile(
        name=NAME,
        title=title,
        objects=objects,
        modes=modes,
        homing=METHODS,
        faults=FAULTS,
        motor_name="lm2070" if moves else "ec_i_40",
        units=units,
        scaling=tuple(
            (entry.index, entry.sub) for entry in objects if entry.index in needed and (entry.sub or not entry.title)
        ),
        unsure=unsure,
        setup=(QUICK_STOP_WHEN_LOST, DISABLED_AFTER_QUICK_STOP),
        current_objects=((0x60770010, AS_RATED), (0x60780010, AS_RATED)),
        encoder_error=0x7305,
        currents=currents,
        rules=Rules(objects=64, remap=Code.UNSUPPORTED_ACCESS),
        bus_off=0x8140,
    )


def currents(dictionary: Dictionary) -> Currents:
    """Rated current 6075h and 6073h, its multiple; no limit where the drive does not tell."""
    rated = dictionary.get(RATED) / 1e3
    if rated <= 0.0:
        return Currents(inf, inf, 15.0)
    peak = dictionary.get(0x6073) / 1e3 * rated
    return Currents(
        rated, peak if peak > 0.0 else inf, 15.0
    )  # time constant [s]: estimate, of the simulated drive only
