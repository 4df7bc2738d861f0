"""Tables of CiA 402 for simulated drives, the master and the tests alike: power state machine, modes, bits of words."""

from __future__ import annotations

from enum import IntEnum, StrEnum
from typing import NamedTuple


class State(StrEnum):
    """States of the power drive system."""

    NOT_READY = "Not ready to switch on"
    DISABLED = "Switch on disabled"
    READY = "Ready to switch on"
    SWITCHED_ON = "Switched on"
    ENABLED = "Operation enabled"
    QUICK_STOP = "Quick stop active"
    REACTION = "Fault reaction active"
    FAULT = "Fault"


AT_REST = (State.DISABLED, State.READY, State.NOT_READY, State.FAULT)  # no current


class Pattern(NamedTuple):
    """Bits that are looked at, and what they have to be."""

    mask: int
    value: int

    def fits(self, word: int) -> bool:
        """Whether a word shows this pattern."""
        return word & self.mask == self.value


STATUS = {  # statusword 6041h
    State.NOT_READY: Pattern(0x4F, 0x00),
    State.DISABLED: Pattern(0x4F, 0x40),
    State.READY: Pattern(0x6F, 0x21),
    State.SWITCHED_ON: Pattern(0x6F, 0x23),
    State.ENABLED: Pattern(0x6F, 0x27),
    State.QUICK_STOP: Pattern(0x6F, 0x07),
    State.REACTION: Pattern(0x4F, 0x0F),
    State.FAULT: Pattern(0x4F, 0x08),
}


class Command(StrEnum):
    """What a controlword asks for."""

    SHUTDOWN = "Shutdown"
    SWITCH_ON = "Switch on"  # also "Disable operation": the same bits
    ENABLE = "Enable operation"
    DISABLE_VOLTAGE = "Disable voltage"
    QUICK_STOP = "Quick stop"
    FAULT_RESET = "Fault reset"  # a rising edge
    NONE = ""  # the drive's own doing


CONTROL = {  # controlword 6040h, bits 7, 3, 2, 1, 0
    Command.SHUTDOWN: Pattern(0x87, 0x06),
    Command.SWITCH_ON: Pattern(0x8F, 0x07),
    Command.ENABLE: Pattern(0x8F, 0x0F),
    Command.DISABLE_VOLTAGE: Pattern(0x82, 0x00),
    Command.QUICK_STOP: Pattern(0x86, 0x02),
}
TYPICAL = {
    Command.SHUTDOWN: 0x06,
    Command.SWITCH_ON: 0x07,
    Command.ENABLE: 0x0F,
    Command.DISABLE_VOLTAGE: 0x00,
    Command.QUICK_STOP: 0x02,
    Command.FAULT_RESET: 0x80,
}

NEW_SET_POINT = 0x0010  # controlword bit 4 in pp: rising edge; in hm: start homing while set
CHANGE_IMMEDIATELY = 0x0020
RELATIVE = 0x0040
FAULT_RESET = 0x0080
HALT = 0x0100

VOLTAGE_ENABLED = 0x0010  # statusword
WARNING = 0x0080
REMOTE = 0x0200
TARGET_REACHED = 0x0400
INTERNAL_LIMIT = 0x0800
BIT_12 = 0x1000  # pp: set-point acknowledge; pv: speed is 0; hm: attained; csp, csv, cst: follows the command
BIT_13 = 0x2000  # pp, csp: following error; hm: homing error


class Mode(IntEnum):
    """Modes of operation 6060h; 6502h has bit `mode - 1` for each that a drive offers."""

    NONE = 0
    PP = 1
    PV = 3
    HM = 6
    CSP = 8
    CSV = 9
    CST = 10


INPUTS = 0x60FD
SWITCHES = {0x1: "negative limit switch", 0x2: "positive limit switch"}  # bits of 60FDh, in the drive's own direction

# added to targets of position, velocity and torque; in csp and csv those of velocity and torque are fed forward
POSITION_OFFSET, VELOCITY_OFFSET, TORQUE_OFFSET = OFFSETS = (0x60B0, 0x60B1, 0x60B2)

# digital outputs
OUTPUTS, LEVELS, MASK = 0x60FE, 1, 2
LEVELS_WORD = 0x60FE0120  # of a mapping


class Transition(NamedTuple):
    """One arrow of the state diagram."""

    number: int
    source: State
    command: Command
    target: State


TRANSITIONS = (
    Transition(1, State.NOT_READY, Command.NONE, State.DISABLED),
    Transition(2, State.DISABLED, Command.SHUTDOWN, State.READY),
    Transition(3, State.READY, Command.SWITCH_ON, State.SWITCHED_ON),
    Transition(3, State.READY, Command.ENABLE, State.SWITCHED_ON),  # 4 follows by itself
    Transition(4, State.SWITCHED_ON, Command.ENABLE, State.ENABLED),
    Transition(5, State.ENABLED, Command.SWITCH_ON, State.SWITCHED_ON),
    Transition(6, State.SWITCHED_ON, Command.SHUTDOWN, State.READY),
    Transition(7, State.READY, Command.DISABLE_VOLTAGE, State.DISABLED),
    Transition(7, State.READY, Command.QUICK_STOP, State.DISABLED),
    Transition(8, State.ENABLED, Command.SHUTDOWN, State.READY),
    Transition(9, State.ENABLED, Command.DISABLE_VOLTAGE, State.DISABLED),
    Transition(10, State.SWITCHED_ON, Command.DISABLE_VOLTAGE, State.DISABLED),
    Transition(10, State.SWITCHED_ON, Command.QUICK_STOP, State.DISABLED),
    Transition(11, State.ENABLED, Command.QUICK_STOP, State.QUICK_STOP),
    Transition(12, State.QUICK_STOP, Command.DISABLE_VOLTAGE, State.DISABLED),
    Transition(13, State.ENABLED, Command.NONE, State.REACTION),  # from any state, on an error
    Transition(14, State.REACTION, Command.NONE, State.FAULT),
    Transition(15, State.FAULT, Command.FAULT_RESET, State.DISABLED),
    Transition(16, State.QUICK_STOP, Command.ENABLE, State.ENABLED),
)

_BY_COMMAND: dict[tuple[State, Command], Transition] = {
    (transition_row.source, transition_row.command): transition_row
    for transition_row in TRANSITIONS
    if transition_row.command is not Command.NONE
}

_LOOKED_AT = 0x6F  # bits of the statusword that any pattern looks at
_BY_BITS = [
    next((state for state, pattern in STATUS.items() if pattern.fits(bits)), State.NOT_READY)
    for bits in range(_LOOKED_AT + 1)
]


def state_of(statusword: int) -> State:
    """The state that a statusword shows."""
    return _BY_BITS[statusword & _LOOKED_AT]


def command_of(controlword: int, previous: int) -> Command:
    """What a controlword asks for, given the one before it."""
    if controlword & FAULT_RESET:
        return Command.NONE if previous & FAULT_RESET else Command.FAULT_RESET
    return next((command for command, pattern in CONTROL.items() if pattern.fits(controlword)), Command.NONE)


def transition(state: State, controlword: int, previous: int) -> Transition | None:
    """The transition that a controlword triggers in a state, if any."""
    return _BY_COMMAND.get((state, command_of(controlword, previous)))


def closed_limit_switches(inputs: int) -> str:
    """Limit switches that 60FDh shows as closed, or nothing."""
    return " and ".join(name for bit, name in SWITCHES.items() if inputs & bit)


def supported(*modes: Mode) -> int:
    """6502h of a drive that offers these modes."""
    return sum(1 << (mode - 1) for mode in modes)
