"""Keys of the hardware file: which drives on which bus stand for which members of a scenario, and what they may do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from hw_bridge.bus import NEVER
from hw_bridge.fault import Cause, Fault, inject
from hw_bridge.hardware.quantities import (
    LARGEST,
    MILLISECOND,
    Acceleration,
    Distance,
    Force,
    ForceConstant,
    Lapse,
    Milliseconds,
    Position,
    Speed,
    quantity,
    sized,
)
from hw_bridge.profiles import DEVICES, DRIVE_PROFILES, GENERIC, MOTORS, GivenUnits, profile
from twin.scenario import Keys, Period, Reference, Text, Time, reference, short

if TYPE_CHECKING:
    from hw_bridge.bus import Device, Medium
    from hw_bridge.profiles import Profile

SOFTWARE = ("virtual", "udp_multicast")  # interfaces of python-can without any hardware
MASTER = "master"  # this program, where a fault names a node
BITS = 32  # digital outputs


def catalogued(value: Any) -> int:
    """A number as data sheets print it: 11601, 0x61500000 or 61500000h."""
    text = str(value)
    try:
        if isinstance(value, bool | float):
            raise ValueError  # noqa: TRY301, TRY004
        return int(text[:-1], 16) if text.endswith("h") else int(text, 0)
    except ValueError:
        raise ValueError(f"expected a number such as 11601 or 0x61500000, not {short(value)}") from None


Unsigned32 = Annotated[int, BeforeValidator(catalogued), Field(ge=0, lt=2**32)]


def object_address(index: str, sub: str) -> tuple[int, int]:
    """Parse index (`3001` or `3001h`, hexadecimal) and subindex (decimal); ValueError beyond those of CANopen."""
    address = int(index.removesuffix("h"), 16), int(sub)
    if not (0 <= address[0] <= 0xFFFF and 0 <= address[1] <= 0xFF):
        raise ValueError
    return address


def object_name(value: Any) -> dict[tuple[int, int], int]:
    """`{3001.1: 2410}`: index and subindex in hexadecimal and decimal."""
    if not isinstance(value, dict):
        raise ValueError(f"expected objects such as {{'3001h.1': 2410}}, not {short(value)}")  # noqa: TRY004
    objects = {}
    for key, number in value.items():
        index, _, sub = str(key).partition(".")
        try:
            if isinstance(number, bool | float):  # a part of a number would be lost
                raise ValueError  # noqa: TRY301, TRY004
            address = object_address(index, sub or "0")
            value_of = catalogued(number)
        except (ValueError, TypeError):
            raise ValueError(f"expected an object such as '3001h.1': 2410, not {short(key)}: {short(number)}") from None
        if address in objects:
            raise ValueError(f"{address[0]:04X}h.{address[1]} is given twice. Keep one")
        objects[address] = value_of
    return objects


def object_names(value: Any) -> Any:
    """`all`, or a list such as `[6083h, 607Dh.1]`: a subindex, or a whole object."""
    if value == "all" or isinstance(value, frozenset):
        return value
    if not isinstance(value, list):
        raise ValueError(f"expected all, or objects such as [6083h, 607Dh.1], not {short(value)}")  # noqa: TRY004
    addresses = set()
    for item in value:
        index, mark, sub = str(item).partition(".")
        try:
            address = object_address(index, sub if mark else "0")
        except ValueError:
            raise ValueError(f"expected an object such as 607Dh.1, not {short(item)}") from None
        addresses.add((address[0], address[1] if mark else None))
    return frozenset(addresses)


def output_bits(value: Any) -> dict[int, str]:
    """`{0: "sequencer.valve[1]"}`: a bit of 60FEh.1 and the signal that it follows."""
    if not isinstance(value, dict):
        raise ValueError(f"expected bits such as {{0: 'sequencer.valve[1]'}}, not {short(value)}")  # noqa: TRY004
    bits = {}
    for key, signal in value.items():
        text = str(key)
        if not (text.isdecimal() and int(text) < BITS):
            raise ValueError(f"expected a bit from 0 to {BITS - 1}, not {short(key)}")
        if int(text) in bits:
            raise ValueError(f"bit {int(text)} is given twice. Keep one")
        bits[int(text)] = reference(signal)
    return bits


def emergency_code(value: Any) -> int:
    """`7300h`, or a number."""
    try:
        return value if isinstance(value, int) else int(str(value).removesuffix("h"), 16)
    except ValueError:
        raise ValueError(f"expected an EMCY code such as 7300h, not {short(value)}") from None


class LimitKeys(Keys):
    """What a drive may do; checked each cycle, and written into the drive where it has objects for it."""

    position: Annotated[list[Position], Field(min_length=2, max_length=2)] = Field(default=[-0.035, 0.035])
    velocity: Speed = 0.3
    force: Force = 15.0
    following_error: Distance = 5e-3
    acceleration: Acceleration = 10.0
    actual_value_age: Lapse = 0  # 4.25 cycles, or `at_most` of late cycles


class HeartbeatKeys(Keys):
    """Producer heartbeat time of each side, and the time after which a missing heartbeat is an error."""

    every: Milliseconds = 20 * MILLISECOND
    lost_after: Milliseconds = 60 * MILLISECOND


class HomingKeys(Keys):
    """A method of 6098h, and the position `at` of its reference. Then the drive moves to its start position.

    Without homing, the drive's initial position is the scenario's start position.
    """

    method: Annotated[int, Field(strict=True, ge=-128, le=127)]
    at: Position = 0.0
    speed: Speed = 0.02
    timeout: Milliseconds = 30_000 * MILLISECOND


class FollowKeys(Keys):
    """Tracking mode of positions and speeds; without `mode` the member's.

    `feedforward`: share of the target's speed that is fed forward, in csp as the velocity offset 60B1h. `gain`: of the
    position loop that this program closes where a position is tracked in csv. That of an LM 2070's own loop, 50 1/s; the
    time that a cycle of 5 ms takes, 10 ms in the mean, costs it 29 of 90 degrees of phase.
    """

    mode: Literal["csp", "csv"] | None = None
    feedforward: Annotated[float, Field(ge=0, le=1)] = 0.0
    gain: Annotated[float, quantity("1/s"), Field(gt=0)] = 50.0


class ContactKeys(Keys):
    """A monitored contact force: above the limit, or without change, the drive retracts.

    Without it, the only output `measured_force` of the scenario is monitored, unless `watch_contact` is false.
    """

    signal: Reference
    above: Force = 0.4
    silent_for: Lapse = 100 * MILLISECOND
    distance: Distance = 30e-3  # the sheath keeps 8 mm of it, and the wall was pressed in
    speed: Speed = 0.05
    direction: Literal["positive", "negative"] = "negative"


class ShadowKeys(Keys):
    """Bands of a shadow's residuals, as means over `window`; `moving`: above this speed it moves.

    Estimates, none of them measured on a real bench: position, five increments of 8 um and as much for a belt or
    coupling; velocity, an increment in a cycle of 5 ms; current, half of what 1.5 N of friction take on an LM 2070. On a
    bench run the scenario without a fault first, and take three times the largest residual that the report shows.
    """

    position: Distance = 0.1e-3
    velocity: Speed = 2e-3
    current: Annotated[float, quantity("A"), Field(gt=0)] = 0.06
    window: Lapse = 1_000 * MILLISECOND
    moving: Speed = 2e-3


class FaultKeys(Keys):
    """A fault of a simulated bench at a time of the scenario. `node`: a member, or `master`. `offset`: of the member."""

    at: Time
    fault: Literal[tuple(Cause)]  # type: ignore[valid-type]
    node: Text = ""
    code: Annotated[int, BeforeValidator(emergency_code)] = 0
    lasting: bool = False
    duration: Period = NEVER
    share: Annotated[float, Field(gt=0, le=1)] = 1.0
    count: Annotated[int, Field(strict=True, ge=1)] = NEVER
    delay: Period = 10 * MILLISECOND
    jitter: Time = 0
    offset: Position = 0.0
    factor: Annotated[float, Field(ge=0, le=LARGEST)] = 2.0
    identifiers: (
        Annotated[list[Annotated[int, BeforeValidator(catalogued)]], Field(min_length=2, max_length=2)] | None
    ) = None

    @property
    def text(self) -> str:
        """Fault and node: `heartbeat of servomotor`."""
        return f"{self.fault} of {self.node}"

    def act(self, medium: Medium, number: int, device: Device | None, sign: float) -> None:
        """Inject it now: given at the member, applied at the motor."""
        fault = self.made()
        inject(replace(fault, offset=fault.offset / sign), medium, number, device)

    def made(self) -> Fault:
        """Convert to the injected fault."""
        values = self.model_dump(exclude={"at", "fault", "node", "identifiers"})
        ends = None if self.identifiers is None else (self.identifiers[0], self.identifiers[1])
        return Fault(Cause(self.fault), identifiers=ends, **values)


class UnitKeys(Keys):
    """Size of a drive's units, at the motor, where no object of it states them. `current`: of 6077h or 6078h."""

    position: Annotated[tuple[float, str] | None, sized("m", "rad")] = None
    velocity: Annotated[tuple[float, str] | None, sized("m/s", "rad/s")] = None
    acceleration: Annotated[tuple[float, str] | None, sized("m/s^2", "rad/s^2")] = None
    current: Annotated[tuple[float, str] | None, sized("A")] = None

    @property
    def given(self) -> GivenUnits:
        """The same for a profile."""
        return GivenUnits(**self.model_dump())


class NodeKeys(Keys):
    """The drive that stands for a member. `motor`: the parameter set of the motor that is wired to it; without one a
    simulated drive moves that of its profile, or with `member` the member's own.

    `eds`: the drive's own EDS file, beside the hardware file; a generic profile needs one. `units`: where
    no object of the drive states them. `watch_force`: false for a drive that tells no current, so that `limits.force` cannot be watched.

    `keep`: objects that stay as a run wrote them, `all` or a list. `scaling`: values of objects that lengths follow from,
    where the drive does not tell them.

    `outputs`: bits of 60FEh.1 and the Boolean signals that they follow, for valves of grippers. `safe_outputs`: all of
    60FEh.1 before the start and after every stop.
    """

    node: Annotated[int, Field(strict=True, ge=1, le=126)]
    profile: Literal[(*DRIVE_PROFILES, *GENERIC)]  # type: ignore[valid-type]
    eds: Text = ""
    units: UnitKeys = UnitKeys()
    motor: Literal[("profile", "member", *MOTORS)] = "profile"  # type: ignore[valid-type]
    product: Unsigned32 | None = None
    serial: Unsigned32 | None = None
    scale: Annotated[float, Field(ge=1 / LARGEST, le=LARGEST)] = 1.0
    inverted: bool = False
    force_constant: ForceConstant | None = None
    limits: LimitKeys = LimitKeys()
    heartbeat: HeartbeatKeys = HeartbeatKeys()
    homing: HomingKeys | None = None
    follow: FollowKeys = FollowKeys()
    contact: ContactKeys | None = None
    watch_contact: bool = True
    watch_force: bool = True
    shadow: ShadowKeys | None = None
    outputs: Annotated[dict[int, str], BeforeValidator(output_bits)] = Field(default={})
    safe_outputs: Unsigned32 | None = None
    objects: Annotated[dict[tuple[int, int], int], BeforeValidator(object_name)] = Field(default={})
    keep: Annotated[Literal["all"] | frozenset[tuple[int, int | None]], BeforeValidator(object_names)] = frozenset()
    scaling: Annotated[dict[tuple[int, int], int], BeforeValidator(object_name)] = Field(default={})
    description: Text = ""

    @property
    def drive(self) -> Profile:
        """The profile, with the dictionary of its EDS file where the hardware file names one. DeclarationError if it is none."""
        if not self.eds and self.profile in DRIVE_PROFILES:
            return profile(self.profile).with_units(self.units.given)
        from hw_bridge.eds import load_profile  # canopen, which a hardware file without an EDS file does not need

        return load_profile(self.profile, self.eds, self.units.given)

    @property
    def offset(self) -> bool:
        """Whether process data have room for a velocity offset."""
        return self.follow.mode != "csv" and self.follow.feedforward > 0.0


class ModuleKeys(Keys):
    """An I/O module: bits of its outputs (6200h, from 0) and the Boolean signals that they follow, for valves.

    `safe_outputs`: all of them before the start, after every stop, and when the module misses this program.
    """

    node: Annotated[int, Field(strict=True, ge=1, le=126)]
    profile: Literal[tuple(DEVICES)] = "cia401"  # type: ignore[valid-type]
    vendor: Unsigned32 | None = None
    product: Unsigned32 | None = None
    serial: Unsigned32 | None = None
    heartbeat: HeartbeatKeys = HeartbeatKeys()
    outputs: Annotated[dict[int, str], BeforeValidator(output_bits), Field(min_length=1)]
    safe_outputs: Unsigned32
    objects: Annotated[dict[tuple[int, int], int], BeforeValidator(object_name)] = Field(default={})
    keep: Annotated[Literal["all"] | frozenset[tuple[int, int | None]], BeforeValidator(object_names)] = frozenset()
    description: Text = ""


class LateCycleKeys(Keys):
    """Policy for a cycle that is late by more than a period, because the host was stalled.

    `hold`: the scenario continues from there. `slow_down`: and for a second at half speed. `stop`: the run ends. One that is
    later than `at_most` ends it in any case; without it, the shortest `lost_after` of the heartbeats, after which drives
    have stopped by themselves. Where it is given, process data of a drive may be missing as long, else for five cycles.
    `stiffness` [N/m]: of the pressed object, for the printed bound. `rpdo_timeout`:
    whether drives that have one (8250h of an EPOS4) monitor late targets, as long as 60C2h says. Without, 60C2h is 0:
    no interpolation either, and the heartbeat alone bounds what a dead host leaves moving.
    """

    policy: Literal["hold", "slow_down", "stop"] = "hold"
    at_most: Lapse | None = None
    stiffness: Annotated[float, quantity("N/m"), Field(gt=0)] | None = None
    rpdo_timeout: Annotated[bool, Field(strict=True)] = True


class HardwareKeys(Keys):
    """A hardware file. `simulated`: drives and bus are part of the run, in simulated time."""

    title: Text = ""
    description: Text = ""
    simulated: bool = False
    interface: Text = ""
    channel: Text = ""
    bit_rate: Annotated[int, Field(strict=True)] = 1_000_000
    options: dict[str, Any] = Field(default={})
    cycle: Milliseconds = 5 * MILLISECOND
    late_cycle: LateCycleKeys = LateCycleKeys()
    master: Annotated[int, Field(strict=True, ge=1, le=127)] = 127
    nodes: Annotated[dict[str, NodeKeys], Field(min_length=1)]
    modules: dict[str, ModuleKeys] = Field(default={})
    faults: list[FaultKeys] = Field(default=[])

    def stations(self) -> list[tuple[str, str, NodeKeys | ModuleKeys]]:
        """Group, name and keys of all drives and modules."""
        drives = [("nodes", name, node) for name, node in self.nodes.items()]
        return [*drives, *(("modules", name, module) for name, module in self.modules.items())]

    def is_software(self) -> bool:
        """Whether no current can flow: the bus is simulated, or its interface exists in software only."""
        channel = self.channel
        pty = channel.startswith("/dev/pts/") or (
            channel.startswith("/") and str(Path(channel).resolve()).startswith("/dev/pts/")
        )
        return self.simulated or self.interface in SOFTWARE or channel.startswith("vcan") or pty
