"""Injection of faults: into a drive, or as disturbance of frames.

The deterministic bus and `twin drive` share it. The faulty properties of a drive are declared here; the simulated drive has
them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, cast

from hw_bridge.bus import NEVER, Device, Disturbance, Kind
from hw_bridge.dictionary import cia301
from hw_bridge.fault.fault import Cause, Fault
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.bus import Medium
    from hw_bridge.profiles import Profile

SENDS = (0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700)  # identifiers of a slave, without its node-ID
TO_BUS_OFF = 32  # destroyed frames in a row: 8 each to 256


class Motor(Protocol):
    """Properties of a motor and its sensor that can be faulty."""

    grip: float  # share of the load that reaches it
    offset: float  # error of the sensor [m or rad]

    def stick(self) -> None:
        """Freeze the sensor."""

    def scale(self, parameter: str, factor: float) -> None:
        """Multiply a parameter of the motor."""


class Axis(Protocol):
    """A drive's view of its motor."""

    @property
    def motor(self) -> Motor:
        """The motor."""


class Drive(Device, Protocol):
    """A simulated drive."""

    profile: Profile

    @property
    def axis(self) -> Axis:
        """The drive's view of its motor."""

    def inject(self, code: int, lasting: bool = False) -> None:
        """Raise an error of the vendor's table."""


def inject(fault: Fault, medium: Medium, node: int, device: Device | None) -> None:
    """Inject a fault now. `node` sends the disturbed frames; without a drive or module it is the master."""
    if fault.cause is not Cause.RESET and fault.cause not in ACTIONS:
        medium.disturbances.append(disturbance(fault, medium.now, node, device is None))
        return
    if device is None:
        raise SimulationError(f"{fault.cause}: is a fault of a drive. Name a drive instead of the master.")
    device.advance(max(medium.now, device.now))
    if fault.cause is Cause.RESET:
        device.restart()
    else:
        ACTIONS[fault.cause](fault, cast("Drive", device))  # `problem` keeps it from modules


def disturbance(fault: Fault, now: int, node: int, master: bool) -> Disturbance:
    """Disturbance of the frames that a fault hits."""
    kind, count = KINDS[fault.cause], fault.count
    if fault.cause is Cause.BUS_OFF:
        count = TO_BUS_OFF
    if fault.identifiers is not None:
        chosen = frozenset(range(fault.identifiers[0], fault.identifiers[1] + 1))
    elif fault.cause is Cause.SYNC:
        chosen = frozenset({cia301.SYNC})
    elif fault.cause is Cause.HEARTBEAT:
        chosen = frozenset({cia301.ERROR_CONTROL + node})
    elif master:
        chosen = MASTER | {cia301.ERROR_CONTROL + node}
    else:
        chosen = frozenset(base + node for base in SENDS)
    end = now + fault.duration if fault.duration < NEVER else NEVER
    return Disturbance(
        kind, start=now, end=end, share=fault.share, count=count, delay=fault.delay, jitter=fault.jitter, only=chosen
    )


# NMT, SYNC, RPDOs and SDO requests of all nodes
MASTER = frozenset({0, cia301.SYNC}) | {
    base + node for base in (0x200, 0x300, 0x400, 0x500, 0x600) for node in range(1, 128)
}

KINDS = {
    Cause.HEARTBEAT: Kind.DROP,
    Cause.SYNC: Kind.DROP,
    Cause.DROP: Kind.DROP,
    Cause.DELAY: Kind.DELAY,
    Cause.CORRUPT: Kind.CORRUPT,
    Cause.BUS_OFF: Kind.CORRUPT,
}


def _emcy(fault: Fault, drive: Drive) -> None:
    drive.inject(fault.code, fault.lasting)


def _overcurrent(fault: Fault, drive: Drive) -> None:
    drive.inject(drive.profile.overcurrent, fault.lasting)


def _encoder(fault: Fault, drive: Drive) -> None:
    drive.axis.motor.stick()
    if (code := drive.profile.encoder_error) is not None:
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
    Cause.EMCY: _emcy,
    Cause.OVERCURRENT: _overcurrent,
    Cause.ENCODER: _encoder,
    Cause.ENCODER_OFFSET: _encoder_offset,
    Cause.FRICTION: _friction,
    Cause.GRIP: _grip,
    Cause.SLOW: _slow,
}
