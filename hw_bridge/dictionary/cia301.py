"""Numbers of CiA 301 that all nodes share: identifiers, NMT, bits of COB-ID entries."""

from __future__ import annotations

from enum import IntEnum

# identifiers; of most a node-ID is added
NMT = 0x000
SYNC = EMCY = 0x080
TIME = 0x100
SDO_RESPONSE, SDO_REQUEST = 0x580, 0x600
ERROR_CONTROL = 0x700  # heartbeat, guarding, boot-up

# NMT commands
START, STOP, PRE_OPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 1, 2, 128, 129, 130

UNCONFIGURED = 255  # node-ID of a device that has none (CiA 305)

# bits of a COB-ID entry
INVALID, NO_REMOTE, EXTENDED = 1 << 31, 1 << 30, 1 << 29


# bits of the error register 1001h
REGISTER = ("generic", "current", "voltage", "temperature", "communication", "device profile", "bit 6", "manufacturer")


def error_register(value: int) -> str:
    """The bits of error register 1001h."""
    return ", ".join(name for bit, name in enumerate(REGISTER) if value >> bit & 1) or "none"


class NmtState(IntEnum):
    """NMT states with their code in the heartbeat; the code of Initializing is that of the boot-up message."""

    INITIALIZING = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F
