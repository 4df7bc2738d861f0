"""What a master has to know of each vendor's drive to use it, as tables. Traps are told where they are avoided."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hw_bridge.dictionary import Mode, cia402

if TYPE_CHECKING:
    from hw_bridge.profiles import Units

QUICK_STOP_WHEN_LOST = (0x6007, 0, 3, "a quick stop when this program's heartbeat stays away")


@dataclass(frozen=True)
class Vendor:
    """Objects to write (index, subindex, value, reason) and where the current is. `per_unit`: [A]; 0: as 6077h counts."""

    rows: tuple[tuple[int, int, int, str], ...]
    current: int  # mapping word
    per_unit: float

    @property
    def setup(self) -> tuple[tuple[int, int, int], ...]:
        """Index, subindex and value of each."""
        return tuple(row[:3] for row in self.rows)

    @property
    def reasons(self) -> dict[tuple[int, int], str]:
        """Why each is written."""
        return {row[:2]: row[3] for row in self.rows}


VENDORS = {
    "faulhaber_v3": Vendor(
        # units stay um and mm/s: finer ones would limit ramps to 3 m/s2. What rounding leaves over is carried on.
        rows=(QUICK_STOP_WHEN_LOST,),
        current=0x60770010,
        per_unit=0.0,
    ),
    "mclm": Vendor(
        # not the continuous overcurrent, which derates
        rows=(
            (0x2321, 2, 0x7BDE, "errors trip instead of being told only, also the heartbeat's"),
            (0x2338, 2, 1, "software limits act in velocity mode too"),
        ),
        current=0x60780010,
        per_unit=1e-3,
    ),
    "epos4": Vendor(
        # out of Quick stop active, where it would stay, a controlword that goes on coming enables again
        rows=(
            (0x60A9, 0, 0xFDB44700, "velocities in mrpm instead of rpm"),
            QUICK_STOP_WHEN_LOST,
            (0x605A, 0, 2, "a quick stop ends disabled"),
        ),
        current=0x30D10220,
        per_unit=1e-3,
    ),
}

# Process data. The lower identifier goes first, and so does the lower number at SYNC: the target, then the controlword.
TARGET, CONTROL = (0x607A0020,), (0x60400010, 0x60600008, 0x60FF0020)
TRANSMIT = (0x60410010, 0x60610008, 0x60640020)
FORCE = (0x60710010,)  # of a drive that is told a force: in a PDO of its own, the others are full
OFFSET = (0x60B10020,)  # of one whose targets' speed is fed forward: beside the target, so that neither comes alone
SPEED = 0x606C0020

# what stands for a mode that a drive has not
SUBSTITUTES = {Mode.CSP: Mode.PP, Mode.CSV: Mode.PV}


def receive(outputs: bool, force: bool, offset: bool) -> tuple[tuple[int, ...], ...]:
    """Mapping of four RPDOs; digital outputs that follow signals find room beside the target, or in the last one."""
    levels = (cia402.LEVELS_WORD,) if outputs else ()
    beside, last = (OFFSET, levels) if offset else (levels, ())
    return (TARGET + beside, CONTROL, FORCE if force else (), last)


def current_unit(vendor: Vendor, units: Units) -> float:
    """Current of one unit of the mapped object [A]."""
    return vendor.per_unit or units.torque
