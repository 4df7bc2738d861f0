"""Texts for statusword, controlword, modes, errors and homing sequences, with remedies."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from hw_bridge.dictionary import HomingEvent, Mode, State, cia402, command_of, state_of
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from hw_bridge.dictionary import Move
    from hw_bridge.master import SdoClient
    from hw_bridge.profiles import Fault

MODES = {
    Mode.NONE: "no mode",
    Mode.PP: "profile position (pp)",
    Mode.PV: "profile velocity (pv)",
    Mode.HM: "homing (hm)",
    Mode.CSP: "cyclic synchronous position (csp)",
    Mode.CSV: "cyclic synchronous velocity (csv)",
    Mode.CST: "cyclic synchronous torque (cst)",
}
MODES_BY_VALUE = {int(mode): mode for mode in Mode}
BITS = {  # of the statusword, in all modes
    cia402.VOLTAGE_ENABLED: "voltage",
    cia402.WARNING: "warning",
    cia402.REMOTE: "remote",
    cia402.TARGET_REACHED: "target reached",
    cia402.INTERNAL_LIMIT: "internal limit active",
}
MODE_BITS = {
    Mode.PP: {cia402.BIT_12: "set-point acknowledged", cia402.BIT_13: "following error"},
    Mode.PV: {cia402.BIT_12: "speed is 0"},
    Mode.HM: {cia402.BIT_12: "homing attained", cia402.BIT_13: "homing error"},
    Mode.CSP: {cia402.BIT_12: "follows the target", cia402.BIT_13: "following error"},
    Mode.CSV: {cia402.BIT_12: "follows the target"},
    Mode.CST: {cia402.BIT_12: "follows the target"},
}
REMEDIES = {  # by error code; the meaning is the vendor's, in the profile
    0x1000: "Read the vendor's text of this code; switch off and on.",
    0x2310: "Lower accelerations and limits of current; look for a jam or a short circuit in the motor's cable.",
    0x2320: "Look for a short circuit in the motor's cable; let it cool.",
    0x3210: "Braking feeds the supply: lower decelerations, add a brake resistor, measure the supply.",
    0x3220: "Measure the supply while it moves: fuse, cable, current limit of the power supply.",
    0x4210: "Let it cool; lower the mean current.",
    0x4310: "Let it cool; lower the mean current.",
    0x4380: "Let the motor cool; look for a jam; check 3001h, the motor's data.",
    0x43F0: "It will switch off soon: lower the mean current.",
    0x5113: "Measure the logic supply.",
    0x5410: "Look for a short circuit in the motor's cable.",
    0x5530: "Store the parameters anew (twin hil store); if it comes again the drive's memory is broken.",
    0x6100: "Switch off and on; ask the vendor about this firmware.",
    0x6180: "Switch off and on; ask the vendor about this firmware.",
    0x6320: "A parameter does not fit the others: twin hil compare with a DCF that worked.",
    0x7200: "Switch off and on; if it comes again the drive is broken.",
    0x7300: "Check the encoder's plug, cable and supply, and its type in the drive.",
    0x7320: "Check the encoder's plug, cable and supply, and its type in the drive (3000h, 3010h).",
    0x7388: "Check the plug and the order of the Hall sensors (301Ah).",
    0x7400: "Switch off and on; if it comes again the drive is broken.",
    0x8110: "The bus is too full: a longer cycle or a higher bit rate.",
    0x8120: "Check wiring, both terminating resistors of 120 ohm and the bit rate of all nodes.",
    0x8130: "The program that it watched (1016h) ended or stalled. Start it anew once the drive is reset.",
    0x8140: "Check wiring, both terminating resistors of 120 ohm and the bit rate of all nodes.",
    0x8150: "Two PDOs have one COB-ID: twin hil defaults, or compare with a DCF that worked.",
    0x81FD: "Check wiring, both terminating resistors of 120 ohm and the bit rate of all nodes.",
    0x8210: "Somebody sends a PDO shorter than its mapping: is another master on the bus?",
    0x8220: "Somebody sends a PDO longer than its mapping: is another master on the bus?",
    0x8250: "Cyclic targets stayed away: the program ended or stalled. A longer cycle gives it more time.",
    0x8310: "Somebody floods the serial port.",
    0x8400: "It cannot follow: look for a jam, lower velocity and acceleration, check the current limit.",
    0x84F0: "It cannot follow: look for a jam, lower velocity and acceleration, check the current limit.",
    0x84FF: "Check direction and type of the encoder (twin hil direction), and the loops' gains.",
    0x8611: "It cannot follow: look for a jam, lower velocity and acceleration, check 6065h.",
    0x8A80: "It stands on the negative limit switch: move it off by hand, or check the switch's polarity.",
    0x8A81: "It stands on the positive limit switch: move it off by hand, or check the switch's polarity.",
    0x8A82: "It was told to go beyond 607Dh: check homing and the limits.",
    0x8A88: "STO is open: close both inputs, as the vendor's manual shows.",
    0xFF01: "A value is too large for the drive: check 6092h and the limits.",
}
ENDS = {
    HomingEvent.NEGATIVE: ("the negative limit switch closes", "the negative limit switch opens"),
    HomingEvent.POSITIVE: ("the positive limit switch closes", "the positive limit switch opens"),
    HomingEvent.HOME: ("the home switch closes", "the home switch opens"),
    HomingEvent.INDEX: ("the next index pulse", "the next index pulse"),
    HomingEvent.BLOCK: ("it stands against its end stop", "it stands against its end stop"),
}


def statusword(word: int, mode: int) -> str:
    """Describe 6041h: the state, then further bits."""
    bits = BITS | MODE_BITS.get(MODES_BY_VALUE.get(mode, Mode.NONE), {})
    more = ", ".join(name for bit, name in bits.items() if word & bit)
    return f"{state_of(word)}{f'; {more}' if more else ''}"


def controlword(word: int) -> str:
    """Describe 6040h: its command."""
    command = command_of(word, 0)
    return f"{command}{', halt' if word & cia402.HALT else ''}" if command else "nothing"


def mode(value: int) -> str:
    """Describe a mode of operation."""
    return MODES[MODES_BY_VALUE[value]] if value in MODES_BY_VALUE else f"mode {value} of the vendor"


def remedy(code: int) -> str:
    """Remedy for an error."""
    return REMEDIES.get(code, "Read the vendor's manual on this code.")


def read_faults(client: SdoClient, faults: Mapping[int, Fault]) -> list[str]:
    """Read 603Fh and the history 1003h: each code with its meaning and remedy, the latest first, each once."""
    codes: list[int] = []
    with suppress(SimulationError):  # not every drive has it
        codes.append(client.number(0x603F) & 0xFFFF)
    with suppress(SimulationError):
        codes += [client.number(0x1003, sub + 1) & 0xFFFF for sub in range(client.number(0x1003))]
    texts = []
    for code in dict.fromkeys(filter(None, codes)):
        meaning = faults[code].meaning if code in faults else "a code of the vendor's"
        texts.append(f"{code:04X}h {meaning}. {remedy(code)}")
    return texts


def errors_and_history(client: SdoClient, faults: Mapping[int, Fault]) -> list[str]:
    """Texts of `read_faults`, as earlier ones if neither the error register 1001h nor the state of the drive tells of one."""
    texts = read_faults(client, faults)
    with suppress(SimulationError):
        in_fault = state_of(client.number(0x6041) & 0xFFFF) in (State.FAULT, State.REACTION)
        if texts and not in_fault and client.number(0x1001) == 0:
            return ["none now", *(f"earlier (1003h): {text}" for text in texts)]
    return texts


def homing(moves: Iterable[Move]) -> list[str]:
    """Describe a method of 6098h step by step."""
    steps = [
        f"{'slowly' if move.slow else 'fast'} to {'positive' if move.direction > 0 else 'negative'} positions of the "
        f"drive until {ENDS[move.until][0 if move.closed else 1]}"
        for move in moves
    ]
    return steps or ["it does not move: where it stands is the reference"]
