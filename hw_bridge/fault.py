"""Faults of simulated drives and of their bus: what there is, and how each is done. Every one is a row of a table.

A fault either acts on a drive, or disturbs frames on the way; the deterministic bus and `twin drive` take the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Protocol, cast

from hw_bridge.agenda import MILLISECOND, NEVER
from hw_bridge.bus import Disturbance, Kind
from hw_bridge.slave.nmt import RESET_NODE
from twin.coupling import nearest
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.drive.drive import Drive
    from hw_bridge.profile import Profile
    from hw_bridge.slave.slave import Slave

SENDS = (0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700)  # identifiers of a slave, without its node-ID
TO_BUS_OFF = 32  # destroyed frames in a row: 8 each to 256
SYNC, ERROR_CONTROL = 0x080, 0x700
HIGHEST = 0x7FF  # identifier
LARGEST = 1e6  # factor and offset: more is a mistake
RANGES = {  # of a fault's numbers; not a number is outside all of them
    "code":     (0, 0xFFFF),
    "duration": (0, NEVER),
    "share":    (0.0, 1.0),
    "count":    (1, NEVER),
    "delay":    (0, NEVER),
    "jitter":   (0, NEVER),
    "offset":   (-LARGEST, LARGEST),
    "factor":   (0.0, LARGEST),
}  # fmt: skip

# what the vendors call these; the MCLM does not notice its encoder
OVERCURRENT = {"epos4": 0x2310, "mclm": 0x2310, "faulhaber_v3": 0x5410}
ENCODER = {"epos4": 0x7320, "faulhaber_v3": 0x7300}


class Cause(StrEnum):
    """What can go wrong."""

    EMCY = "emcy"
    OVERCURRENT = "overcurrent"
    ENCODER = "encoder"
    ENCODER_OFFSET = "encoder_offset"
    FRICTION = "friction"
    GRIP = "grip"
    SLOW = "slow"
    RESET = "reset"
    HEARTBEAT = "heartbeat"
    SYNC = "sync"
    DROP = "drop"
    DELAY = "delay"
    CORRUPT = "corrupt"
    BUS_OFF = "bus_off"


MEANINGS = {
    Cause.EMCY:           "an error of the vendor's table, by its code",
    Cause.OVERCURRENT:    "the vendor's error for too much current",
    Cause.ENCODER:        "the position sensor stands still; where the drive notices, its error",
    Cause.ENCODER_OFFSET: "the position sensor is wrong by `offset` from now on; the drive does not notice",
    Cause.FRICTION:       "the motor's dry friction becomes `factor` times what it was",
    Cause.GRIP:           "only `factor` of the load reaches the motor: a sleeve slips",
    Cause.SLOW:           "the gains of the motor's velocity loop become `factor` times what they were",
    Cause.RESET:          "the drive starts anew by itself",
    Cause.HEARTBEAT:      "the heartbeat of a drive, or of the master, is not heard",
    Cause.SYNC:           "SYNC does not come",
    Cause.DROP:           "frames are lost",
    Cause.DELAY:          "frames come later by `delay`, and up to `jitter` more",
    Cause.CORRUPT:        "frames are destroyed on the wire and repeated by their sender",
    Cause.BUS_OFF:        "so many frames are destroyed that their sender is disconnected",
}  # fmt: skip


@dataclass(frozen=True)
class Fault:
    """One fault. Times in ns; `duration` holds for what disturbs frames. `offset` in the motor's unit [m or rad]."""

    cause: Cause
    code: int = 0
    lasting: bool = False
    duration: int = NEVER
    share: float = 1.0
    count: int = NEVER
    delay: int = 10 * MILLISECOND
    jitter: int = 0
    offset: float = 0.0
    factor: float = 2.0
    identifiers: tuple[int, int] | None = None


class Place(Protocol):
    """Where frames can be disturbed: the deterministic bus, or the wire of `twin drive`."""

    disturbances: list[Disturbance]

    @property
    def now(self) -> int:
        """Time [ns]."""


def inject(fault: Fault, place: Place, node: int, slave: Slave | None) -> None:
    """Let a fault happen now. `node` sends the frames that are hit; without a drive or module it is the master."""
    if fault.cause is not Cause.RESET and fault.cause not in ACTIONS:
        place.disturbances.append(disturbance(fault, place.now, node, slave is None))
        return
    if slave is None:
        raise SimulationError(f"{fault.cause}: is a fault of a drive. Name a drive instead of the master.")
    slave.advance(max(place.now, slave.port.agenda.now))
    if fault.cause is Cause.RESET:
        slave.nmt.command(bytes([RESET_NODE, slave.node]))
    else:
        ACTIONS[fault.cause](fault, cast("Drive", slave))  # `problem` keeps it from modules


def disturbance(fault: Fault, now: int, node: int, master: bool) -> Disturbance:
    """What happens to the frames that a fault hits."""
    kind, count = KINDS[fault.cause], fault.count
    if fault.cause is Cause.BUS_OFF:
        count = TO_BUS_OFF
    if fault.identifiers is not None:
        chosen = frozenset(range(fault.identifiers[0], fault.identifiers[1] + 1))
    elif fault.cause is Cause.SYNC:
        chosen = frozenset({SYNC})
    elif fault.cause is Cause.HEARTBEAT:
        chosen = frozenset({ERROR_CONTROL + node})
    elif master:
        chosen = MASTER | {ERROR_CONTROL + node}
    else:
        chosen = frozenset(base + node for base in SENDS)
    end = now + fault.duration if fault.duration < NEVER else NEVER
    return Disturbance(
        kind, start=now, end=end, share=fault.share, count=count, delay=fault.delay, jitter=fault.jitter, only=chosen
    )


# NMT, SYNC, RPDOs and SDO requests of all nodes
MASTER = frozenset({0, SYNC}) | {
    base + node for base in (0x200, 0x300, 0x400, 0x500, 0x600) for node in range(1, 128)
}  # fmt: skip

KINDS = {
    Cause.HEARTBEAT: Kind.DROP, Cause.SYNC: Kind.DROP, Cause.DROP: Kind.DROP, Cause.DELAY: Kind.DELAY,
    Cause.CORRUPT: Kind.CORRUPT, Cause.BUS_OFF: Kind.CORRUPT,
}  # fmt: skip


def _emcy(fault: Fault, drive: Drive) -> None:
    drive.inject(fault.code, fault.lasting)


def _overcurrent(fault: Fault, drive: Drive) -> None:
    drive.inject(OVERCURRENT[drive.profile.name], fault.lasting)


def _encoder(fault: Fault, drive: Drive) -> None:
    drive.axis.motor.stick()
    if (code := ENCODER.get(drive.profile.name)) is not None:
        drive.inject(code, fault.lasting)


def _encoder_offset(fault: Fault, drive: Drive) -> None:
    drive.axis.motor.offset = fault.offset


def _friction(fault: Fault, drive: Drive) -> None:
    drive.axis.motor.scale("friction_coulomb", fault.factor)


def _grip(fault: Fault, drive: Drive) -> None:
    drive.axis.motor.grip = fault.factor


def _slow(fault: Fault, drive: Drive) -> None:
    for name in ("velocity_gain", "velocity_integral"):
        drive.axis.motor.scale(name, fault.factor)


ACTIONS: dict[Cause, Callable[[Fault, Drive], None]] = {
    Cause.EMCY: _emcy, Cause.OVERCURRENT: _overcurrent, Cause.ENCODER: _encoder,
    Cause.ENCODER_OFFSET: _encoder_offset, Cause.FRICTION: _friction, Cause.GRIP: _grip, Cause.SLOW: _slow,
}  # fmt: skip


def problem(fault: Fault, profile: Profile | None, master: bool = True) -> str:
    """What is wrong with a fault for a drive of this profile, or without one for the master or a module; or nothing."""
    for name, (low, high) in RANGES.items():
        value = getattr(fault, name)
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            return f"{name} is {value}: expected a number from {low:g} to {high:g}"
    ends = fault.identifiers
    if ends is not None and not (len(ends) == 2 and all(isinstance(one, int) for one in ends)
                                 and 0 <= ends[0] <= ends[1] <= HIGHEST):  # fmt: skip
        return f"identifiers are {ends}: expected two of 0 to 0x7FF, the lower one first"
    if profile is None:
        own = fault.cause in ACTIONS or (master and fault.cause is Cause.RESET)
        return f"{fault.cause} is a fault of a drive. Name a drive" if own else ""
    if fault.cause is Cause.EMCY and fault.code not in profile.faults:
        known = ", ".join(f"{one:04X}h" for one in sorted(profile.faults))
        return f"{profile.title} has no error {fault.code:04X}h. There are: {known}"
    return ""


def cause(text: str) -> Cause:
    """A cause by its name."""
    try:
        return Cause(text)
    except ValueError:
        raise SimulationError(f"There is no fault {text!r}. {nearest(text, [*Cause])}") from None
