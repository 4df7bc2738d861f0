"""What a master has to know of each vendor's drive to use it, as tables. Traps are told where they are avoided."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from hw_bridge.bus import Frame
from hw_bridge.dictionary import Mode, cia402

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from hw_bridge.dictionary import Dictionary
    from hw_bridge.hardware import NodeKeys
    from hw_bridge.profiles import Units

QUICK_STOP_WHEN_LOST = (0x6007, 0, 3, "a quick stop when this program's heartbeat stays away")
DISABLED_AFTER_QUICK_STOP = (0x605A, 0, 2, "a quick stop ends disabled")


@dataclass(frozen=True)
class Vendor:
    """Objects to write (index, subindex, value, reason) where the drive has them, and where its current is.

    `trips`: whether `rows` let it stop without this program's heartbeat where it has no 6007h. `currents`: mapping words with the current [A] of one unit, the first that a drive has; 0: as 6077h counts.
    """

    rows: tuple[tuple[int, int, int, str], ...]
    currents: tuple[tuple[int, float], ...]
    trips: bool = False

    @property
    def setup(self) -> tuple[tuple[int, int, int], ...]:
        """Index, subindex and value of each."""
        return tuple(row[:3] for row in self.rows)

    @property
    def reasons(self) -> dict[tuple[int, int], str]:
        """Why each is written."""
        return {row[:2]: row[3] for row in self.rows}


MILLIAMPERES = 1e-3
VENDORS = {
    "faulhaber_v3": Vendor(
        # units stay um and mm/s: finer ones would limit ramps to 3 m/s2. What rounding leaves over is carried on.
        rows=(QUICK_STOP_WHEN_LOST,),
        currents=((0x60770010, 0.0),),
    ),
    "mclm": Vendor(
        # not the continuous overcurrent, which derates
        rows=(
            (0x2321, 2, 0x7BDE, "errors trip instead of being told only, also the heartbeat's"),
            (0x2338, 2, 1, "software limits act in velocity mode too"),
        ),
        currents=((0x60780010, MILLIAMPERES),),
        trips=True,
    ),
    "epos4": Vendor(
        # out of Quick stop active, where it would stay, a controlword that goes on coming enables again
        rows=(
            (0x60A9, 0, 0xFDB44700, "velocities in mrpm instead of rpm"),
            QUICK_STOP_WHEN_LOST,
            DISABLED_AFTER_QUICK_STOP,
        ),
        currents=((0x30D10220, MILLIAMPERES),),
    ),
    "epos2": Vendor(rows=(QUICK_STOP_WHEN_LOST,), currents=((0x60780010, MILLIAMPERES),)),
    "cia402": Vendor(
        rows=(QUICK_STOP_WHEN_LOST, DISABLED_AFTER_QUICK_STOP),
        currents=((0x60770010, 0.0), (0x60780010, 0.0)),
    ),
}

# Process data. The lower identifier goes first, and so does the lower number at SYNC: the target, then the controlword.
TARGET, CONTROL = (0x607A0020,), (0x60400010, 0x60600008, 0x60FF0020)
TRANSMIT = (0x60410010, 0x60610008, 0x60640020)
FORCE = (0x60710010,)  # of a drive that is told a force: in a PDO of its own, the others are full
OFFSET = (0x60B10020,)  # of one whose targets' speed is fed forward: beside the target, so that neither comes alone
SPEED = 0x606C0020
ACKNOWLEDGE = (0x60410010,)  # of one that takes set-points (pp): told as soon as it changes
PDOS = range(4)
SIGNED, UNSIGNED = {8: "b", 16: "h", 32: "i"}, {0x6040: "H", 0x6041: "H", 0x60FE: "I"}  # by bits, by object

# what stands for a mode that a drive has not
SUBSTITUTES = {Mode.CSP: Mode.PP, Mode.CSV: Mode.PV}


class ProcessData(NamedTuple):
    """Mapping words of four PDOs each way, empty for those that are not used; of objects that the drive has.

    `current`: the word that tells the current, 0 without one, and what one unit of it is [A]; 0: as 6077h counts.
    """

    receive: tuple[tuple[int, ...], ...]
    transmit: tuple[tuple[int, ...], ...]
    current: int
    per_unit: float


def process_data(mirror: Dictionary, vendor: Vendor, keys: NodeKeys, forces: bool) -> ProcessData:
    """What a run exchanges with a drive; digital outputs that follow signals find room beside the target, or in the last RPDO.

    `mirror`: what the drive has, with the modes of 6502h. `forces`: whether it is told one.
    """

    def present(*words: int) -> tuple[int, ...]:
        return tuple(word for word in words if _mappable(mirror, word))

    levels = (cia402.LEVELS_WORD,) if keys.outputs else ()
    beside, last = (OFFSET, levels) if keys.offset else (levels, ())
    received = (present(*TARGET, *beside), present(*CONTROL), present(*FORCE) if forces else (), present(*last))
    current, per_unit = next((one for one in vendor.currents if _mappable(mirror, one[0])), (0, 0.0))
    shown = ACKNOWLEDGE if takes_set_points(mirror) else ()
    sent = (present(*TRANSMIT), present(SPEED, *([current] if current else [])), shown, ())
    return ProcessData(received, sent, current, per_unit)


def layout(words: tuple[int, ...]) -> struct.Struct:
    """How the objects of mapping words lie in a frame."""
    return struct.Struct("<" + "".join(UNSIGNED.get(word >> 16, SIGNED[word & 0xFF]) for word in words))


def encode_frames(pdos: Iterable[tuple[int, struct.Struct, tuple[int, ...]]], values: Mapping[int, int]) -> list[Frame]:
    """Frames of RPDOs, each with its identifier, layout and mapping words. `values`: by object."""
    return [Frame(number, form.pack(*(values[word >> 16] for word in words))) for number, form, words in pdos]


def takes_set_points(mirror: Dictionary) -> bool:
    """Whether positions go as set-points with an acknowledge (pp): it has no csp."""
    return not mirror.get(0x6502) >> (Mode.CSP - 1) & 1


def _mappable(mirror: Dictionary, word: int) -> bool:
    entry = mirror.objects.get(word >> 16, {}).get(word >> 8 & 0xFF)
    return entry is not None and entry.mappable


def current_unit(data: ProcessData, units: Units) -> float:
    """Current of one unit of the mapped object [A]."""
    return data.per_unit or units.torque
