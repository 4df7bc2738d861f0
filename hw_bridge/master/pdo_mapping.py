"""Process data of a run, as tables: which object is in which PDO."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

from hw_bridge.bus import Frame
from hw_bridge.dictionary import Mode, cia402
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from hw_bridge.dictionary import Dictionary
    from hw_bridge.hardware import NodeKeys
    from hw_bridge.profiles import Profile, Units

# Process data. The lower identifier goes first, and so does the lower number at SYNC: the target, then the controlword.
TARGET, CONTROL = (0x607A0020,), (0x60400010, 0x60600008, 0x60FF0020)
TRANSMIT = (0x60410010, 0x60610008, 0x60640020)
FORCE = (0x60710010,)  # target force: in a PDO of its own, the others are full
OFFSET = (0x60B10020,)  # velocity feedforward: in the target's PDO, so that neither arrives alone
SPEED = 0x606C0020
ACKNOWLEDGE = (0x60410010,)  # of a drive with set-points (pp): sent on change
TARGET_OBJECTS = (0x607A, 0x60FF, 0x6071, 0x60B1)
PDOS = range(4)
SIGNED, UNSIGNED = {8: "b", 16: "h", 32: "i"}, {0x6040: "H", 0x6041: "H", 0x60FE: "I"}  # by bits, by object

# substitutes for modes that a drive does not have
SUBSTITUTES = {Mode.CSP: Mode.PP, Mode.CSV: Mode.PV}


class ProcessData(NamedTuple):
    """Mapping words of four PDOs in each direction, empty for unused ones; only objects that the drive has.

    `current`: mapping word of the current, 0 without one; `per_unit`: one unit of it [A], 0: as 6077h counts.
    """

    receive: tuple[tuple[int, ...], ...]
    transmit: tuple[tuple[int, ...], ...]
    current: int
    per_unit: float


def process_data(mirror: Dictionary, profile: Profile, keys: NodeKeys, forces: bool) -> ProcessData:
    """Process data of a run; digital outputs that follow signals share the target's PDO, or use the last RPDO.

    `mirror`: the drive's objects, with the modes of 6502h. `forces`: whether it receives a target force.
    """

    def present(*words: int) -> tuple[int, ...]:
        return tuple(word for word in words if _mappable(mirror, word))

    levels = (cia402.LEVELS_WORD,) if keys.outputs else ()
    extra, last = (OFFSET, levels) if keys.offset else (levels, ())
    received = (present(*TARGET, *extra), present(*CONTROL), present(*FORCE) if forces else (), present(*last))
    current, per_unit = next((row for row in profile.current_objects if _mappable(mirror, row[0])), (0, 0.0))
    shown = ACKNOWLEDGE if takes_set_points(mirror) else ()
    sent = (present(*TRANSMIT), present(SPEED, *([current] if current else [])), shown, ())
    return ProcessData(received, sent, current, per_unit)


def layout(words: tuple[int, ...]) -> struct.Struct:
    """Layout of the objects of mapping words in a frame."""
    return struct.Struct("<" + "".join(UNSIGNED.get(word >> 16, SIGNED[word & 0xFF]) for word in words))


def encode_frames(
    name: str, pdos: Iterable[tuple[int, struct.Struct, tuple[int, ...]]], values: Mapping[int, int]
) -> list[Frame]:
    """Frames of the RPDOs of a drive, each with its identifier, layout and mapping words. `values`: by object.

    SimulationError for a value that an object cannot hold: it would be another target if it wrapped around.
    """
    try:
        return [Frame(number, form.pack(*(values[word >> 16] for word in words))) for number, form, words in pdos]
    except struct.error:
        targets = ", ".join(f"{index:04X}h = {values[index]}" for index in TARGET_OBJECTS if index in values)
        raise SimulationError(
            f"{name}: a target is more than the drive can count ({targets}). Check limits, scale and units, or home a drive that "
            f"counts from far away. All drives stop."
        ) from None


def takes_set_points(mirror: Dictionary) -> bool:
    """Whether positions are commanded as acknowledged set-points (pp): the drive has no csp."""
    return not mirror.get(0x6502) >> (Mode.CSP - 1) & 1


def _mappable(mirror: Dictionary, word: int) -> bool:
    entry = mirror.find(word >> 16, word >> 8 & 0xFF)
    return entry is not None and entry.mappable


def current_unit(data: ProcessData, units: Units) -> float:
    """Current of one unit of the mapped object [A]."""
    return data.per_unit or units.torque
