"""Faults of simulated drives and of their bus, as a table."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from hw_bridge.bus import MILLISECOND, NEVER

LARGEST = 1e6  # factor and offset: more is a mistake


class Cause(StrEnum):
    """Kinds of faults."""

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
    Cause.EMCY: "an error of the vendor's table, by its code",
    Cause.OVERCURRENT: "the vendor's error for too much current",
    Cause.ENCODER: "the position sensor stands still; the drive may notice",
    Cause.ENCODER_OFFSET: "the position sensor is wrong by `offset`, undetected",
    Cause.FRICTION: "the motor's dry friction becomes `factor` times what it was",
    Cause.GRIP: "only `factor` of the load reaches the motor: a sleeve slips",
    Cause.SLOW: "the velocity loop's gains become `factor` times what they were",
    Cause.RESET: "the drive starts anew by itself",
    Cause.HEARTBEAT: "the heartbeat of a drive, or of the master, is not heard",
    Cause.SYNC: "SYNC does not come",
    Cause.DROP: "frames are lost",
    Cause.DELAY: "frames come later by `delay`, and up to `jitter` more",
    Cause.CORRUPT: "frames are destroyed on the wire and repeated by their sender",
    Cause.BUS_OFF: "so many frames are destroyed that their sender is disconnected",
}


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
