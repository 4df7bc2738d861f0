"""What makes one vendor's drive: its dictionary, units, errors and choices, as data."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

from hw_bridge.bus import MILLISECOND
from hw_bridge.profiles.motors import MOTORS

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.dictionary import Code, Dictionary, Entry, Mode, Move
    from hw_bridge.profiles.motor import MotorModel


class Reaction(StrEnum):
    """What an error does to the drive."""

    REPORT = "only told"
    CONNECTION = "abort connection option 6007h"
    RAMP = "fault, with reaction option 605Eh"
    OFF = "fault, power stage off at once"


REPORT, CONNECTION, RAMP, OFF = Reaction.REPORT, Reaction.CONNECTION, Reaction.RAMP, Reaction.OFF


class Fault(NamedTuple):
    """A row of a vendor's table of errors: bits of the error register 1001h, of the vendor's own register 2320h."""

    register: int
    vendor: int
    reaction: Reaction
    meaning: str


def faults(*rows: tuple[int, int, Reaction, str]) -> dict[int, Fault]:
    """Errors by EMCY code, of a vendor without a register of its own. Rows: code, bits of 1001h, reaction, meaning."""
    return {code: Fault(register, 0, reaction, meaning) for code, register, reaction, meaning in rows}


class Units(NamedTuple):
    """SI value of one device unit: the only table that scales."""

    position: float  # [m or rad]
    velocity: float  # [m/s or rad/s]
    acceleration: float  # [m/s2 or rad/s2]
    torque: float  # current [A] of one unit of 6071h and 6077h; 0 where there is none


class GivenUnits(NamedTuple):
    """SI value of one device unit as a hardware file gives it, with its symbol; None where it does not."""

    position: tuple[float, str] | None = None  # m or rad
    velocity: tuple[float, str] | None = None
    acceleration: tuple[float, str] | None = None
    current: tuple[float, str] | None = None  # A


@dataclass(frozen=True, slots=True)
class Rules:
    """How a vendor's drive behaves where CiA 301 leaves a choice. `remap`: abort for a mapping that is in use."""

    objects: int
    remap: Code


class Currents(NamedTuple):
    """Limits of the current."""

    continuous: float  # [A]
    peak: float  # [A]
    lag: float  # thermal time constant of the limit [s]


# what options mean where a drive has no object for them
FIXED = {0x605A: 2, 0x605B: 0, 0x605C: 1, 0x605D: 1, 0x605E: 2, 0x6007: 0}


@dataclass(frozen=True, slots=True)
class SetupWrite:
    """An object that a run writes where the drive has it, and why."""

    index: int
    sub: int
    value: int
    reason: str


@dataclass(frozen=True)
class Device:
    """A CANopen device. `commands`, `output_objects`: its own objects that act at once when they are written."""

    name: str
    title: str
    objects: tuple[Entry, ...]
    faults: dict[int, Fault]
    rules: Rules
    boot_time: int = 100 * MILLISECOND
    sdo_time: int = MILLISECOND
    commands: frozenset[int] = frozenset()  # they move it, or have a command of their own
    output_objects: frozenset[int] = frozenset()  # valves, brakes, fault pins


QUICK_STOP_WHEN_LOST = SetupWrite(0x6007, 0, 3, "a quick stop when this program's heartbeat is missing")
DISABLED_AFTER_QUICK_STOP = SetupWrite(0x605A, 0, 2, "a quick stop ends disabled")
RATED, MILLIAMPERE = 0.0, 1e-3  # current of one unit of an object [A]; RATED: as 6077h counts


@dataclass(frozen=True, kw_only=True)
class Profile(Device):
    """One vendor's drive: all that the simulated drive, the master, commissioning and traces know of it.

    `current_objects`: mapping words with the current [A] of one unit, the first that a drive has counts.
    `homing_force`: index, subindex and current [A] of one unit of the objects that bound the force while it homes.
    """

    related: tuple[tuple[int, int], ...] = ()  # vendor and product code of other products that it fits
    modes: tuple[Mode, ...]
    homing: dict[int, tuple[Move, ...]]  # methods of 6098h
    motor_name: str  # of `MOTORS`: the one of a hardware file that names none
    units: Callable[..., Units]  # of the dictionary, and of the motor's magnetic pitch [m] if that is known
    currents: Callable[[Dictionary], Currents]
    bus_off: int  # EMCY after recovery from bus-off
    setup: tuple[SetupWrite, ...] = (QUICK_STOP_WHEN_LOST,)
    current_objects: tuple[tuple[int, float], ...]
    homing_force: tuple[tuple[int, int, float], ...] = ()
    scaling: tuple[tuple[int, int], ...] = ()  # objects that `units` uses: without one of them a scale is assumed
    optional_scaling: tuple[tuple[int, int], ...] = ()  # those of newer firmware, or of some drives only
    # why the units may not be those of the drive; the pitch of the motor that the hardware file names [m], or None
    unsure: Callable[[Dictionary, float | None], list[str]] = lambda _, __: []
    unstated_units: tuple[str, ...] = ()  # kinds of unit that no object states: the hardware file has to
    target_beyond_limit: int = 0  # EMCY for a target outside 607Dh; 0: it is clipped
    overcurrent: int = 0x2310  # EMCY of too much current
    encoder_error: int | None = None  # EMCY of a lost encoder; None: not noticed
    reference_bit: int | None = None  # of 6041h: whether positions count from a reference since power-on
    limits_off_when_zero: bool = False  # 607Dh with both limits 0 means none
    power_stage_bit: bool = False  # statusword bit 4 shows the power stage instead of the supply
    rpdo_timeout: bool = False  # 8250h when cyclic targets stay away
    extrapolation: int = 0  # so many periods of 60C2h a late target position is gone on to; then it holds
    deviation: Callable[[Dictionary], tuple[float, int]] | None = None  # of speed: window [device units], time [ms]
    gains: dict[tuple[int, int], dict[str, int]] = field(default_factory=dict)  # what a gain does to the motor's: power
    twins: dict[int, int] = field(default_factory=dict)  # targets in increments: object, the one in user units
    masks: bool = False  # 2321h says which errors are told and which trip
    supply: Callable[[Dictionary], tuple[float, float]] = lambda _: (9.0, 56.0)  # under- and overvoltage [V]

    @property
    def motor(self) -> MotorModel:
        """The motor that a simulated drive of this profile moves."""
        return MOTORS[self.motor_name].model

    def with_units(self, given: GivenUnits) -> Profile:
        """The profile with the hardware file's units where no object of the drive states them."""
        stated = {kind: unit[0] for kind in self.unstated_units if (unit := getattr(given, kind)) is not None}
        if not stated:
            return self

        def units(dictionary: Dictionary, pitch: float | None = None) -> Units:
            return self.units(dictionary, pitch)._replace(**stated)

        return replace(self, units=units, unstated_units=tuple(k for k in self.unstated_units if k not in stated))

    def option(self, dictionary: Dictionary, index: int) -> int:
        """An option code, from the dictionary or as the vendor fixed it."""
        return dictionary.get(index, missing=FIXED[index])
