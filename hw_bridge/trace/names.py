"""Names for numbers on the bus that no object dictionary has."""

from __future__ import annotations

from hw_bridge.dictionary import Mode, NmtState, cia301, cia402, command_of, state_of

COMMANDS = {
    cia301.START: "start",
    cia301.STOP: "stop",
    cia301.PRE_OPERATIONAL: "enter pre-operational",
    cia301.RESET_NODE: "reset node",
    cia301.RESET_COMMUNICATION: "reset communication",
}

STATES = {
    NmtState.INITIALIZING: "boot-up",
    NmtState.STOPPED: "stopped",
    NmtState.OPERATIONAL: "operational",
    NmtState.PRE_OPERATIONAL: "pre-operational",
}

EMERGENCIES = {  # classes of CiA 301 by the high byte of the code; the longer match counts
    "00": "no error", "10": "generic", "20": "current", "21": "current, input side", "22": "current inside the device",
    "23": "current, output side", "30": "voltage", "31": "mains voltage", "32": "voltage inside the device",
    "33": "output voltage", "40": "temperature", "41": "ambient temperature", "42": "device temperature",
    "50": "device hardware", "60": "device software", "61": "internal software", "62": "user software",
    "63": "data set", "70": "additional modules", "80": "monitoring", "81": "communication", "82": "protocol",
    "90": "external", "F0": "additional functions", "FF": "device specific",
}  # fmt: skip

FLAGS = {  # of the statusword besides its state
    cia402.WARNING: "warning",
    cia402.TARGET_REACHED: "target reached",
    cia402.INTERNAL_LIMIT: "internal limit",
    cia402.BIT_12: "bit 12",
    cia402.BIT_13: "bit 13",
}
CONTROL_FLAGS = {  # of the controlword besides its command
    cia402.NEW_SET_POINT: "new set-point",
    cia402.CHANGE_IMMEDIATELY: "immediately",
    cia402.RELATIVE: "relative",
    cia402.HALT: "halt",
}


def emergency(code: int) -> str:
    """The class of an EMCY code."""
    digits = f"{code:04X}"[:2]
    return EMERGENCIES.get(digits) or EMERGENCIES.get(f"{digits[0]}0", "unknown")


def statusword(word: int) -> str:
    """State and flags of 6041h."""
    return ", ".join([state_of(word), *(text for bit, text in FLAGS.items() if word & bit)])


def controlword(word: int) -> str:
    """Command and flags of 6040h; whether a fault reset is an edge is not seen in one word."""
    return ", ".join([command_of(word, 0), *(text for bit, text in CONTROL_FLAGS.items() if word & bit)])


def mode(value: int) -> str:
    """Mode of operation by its abbreviation."""
    try:
        return Mode(value).name.lower()
    except ValueError:
        return "unknown"


def nmt_state(value: int) -> str:
    """State in a heartbeat or a guarding response."""
    try:
        return STATES[NmtState(value)]
    except ValueError:
        return f"unknown state {value:02X}h"
