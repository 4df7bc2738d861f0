"""One drive as the master sees it: who it is, how it is set up, what it is told and what it says in each cycle."""

from __future__ import annotations

import struct
from collections import deque
from math import degrees
from operator import itemgetter
from typing import TYPE_CHECKING

from hw_bridge.bus import Frame
from hw_bridge.dictionary import Mode, State, cia402, state_of
from hw_bridge.master import vendor
from hw_bridge.master.acceleration import AccelerationLimit
from hw_bridge.master.age import ValueAge
from hw_bridge.master.limits import OwnLimits
from hw_bridge.master.set_points import SetPoints
from hw_bridge.master.station import Station
from hw_bridge.master.vendor import ProcessData
from hw_bridge.profiles import magnetic_pitch, motor_parameters

if TYPE_CHECKING:
    from hw_bridge.bus import Network
    from hw_bridge.hardware import NodeKeys
    from hw_bridge.master.station import Waiting
    from hw_bridge.profiles import Profile

RECEIVE_PDOS = (0x200, 0x300, 0x400, 0x500)
STATE_PDO, SPEED_PDO, ACKNOWLEDGE_PDO = 0x180, 0x280, 0x380
ASKED = itemgetter(0)  # of a way
WINDOW = 1.0  # time over which the way that was driven is compared with the way that was asked for [s]: what stands
# against an end stop is noticed at a speed of the limit over this time
MARGIN = 1e-3  # by which a drive may swing back while it leaves an end stop [m or rad]
TORQUES = (-32768, 32767)  # of an INTEGER16

UP = {  # controlword on the way to Operation enabled
    State.DISABLED:    0x06,
    State.READY:       0x07,
    State.SWITCHED_ON: 0x0F,
    State.ENABLED:     0x0F,
}  # fmt: skip
ON = {  # controlword on the way to Switched on, and there: no current
    State.DISABLED:    0x06,
    State.READY:       0x07,
    State.SWITCHED_ON: 0x07,
}  # fmt: skip
DOWN = {  # on the way to a standstill
    State.ENABLED:    0x02,
    State.QUICK_STOP: 0x02,
}  # fmt: skip
AT_REST = cia402.AT_REST
CONTROLWORD = 0x60400010


def constant_of(keys: NodeKeys) -> float:
    """Force [N] or torque [N*m] on the member of one ampere: as the hardware file has it, or the profile's motor."""
    return keys.force_constant or motor_parameters(keys.drive, keys.motor).model.force_constant / keys.scale


class Node(Station):
    """A drive. Positions [m] count from where `zero` was called; all else is in SI too, by the table of units."""

    keys: NodeKeys
    profile: Profile

    def __init__(self, name: str, keys: NodeKeys, profile: Profile, network: Network, wait: Waiting) -> None:
        super().__init__(name, keys, profile, network, wait)
        self.vendor = vendor.VENDORS[profile.name]
        self.own = OwnLimits(keys.limits)
        self.sign = -keys.scale if keys.inverted else keys.scale
        self.acceleration = AccelerationLimit(keys.limits.acceleration, keys.limits.velocity)
        self.identity: list[int] = []  # vendor, product and serial number that it told
        self.rotary = False  # whether positions are angles
        self.absent: frozenset[int] = frozenset()  # objects of a run that the drive was found not to have
        self._process_data: ProcessData | None = None
        self.has_reference = False  # whether this run has homed it, or proven that it counts from its reference
        self._origin = 0.0
        self.entered_from: float | None = None  # where homing ended, on the way to where the scenario begins [m]
        self.goal = State.DISABLED
        self.homing = False
        self.mode = Mode.CSV
        self.target_position = self.target_velocity = self.target_force = 0.0
        self.aimed: float | None = None  # target position of the cycle before; None: there was none [m]
        self._left = 0.0  # where this cycle's way to it begins [m]
        self.speed = self.offset = 0.0  # of this target position, and what of it is fed forward in csp [m/s]
        self.told_force = False  # whether process data have room for a force
        self.outputs = self.safe_outputs = keys.safe_outputs or 0  # 60FEh.1, and what it is at rest
        self.word, self.word_at = 0, 0  # the last statusword, and when it came [ns], also by SDO
        self.velocity_at = 0  # when the last velocity came [ns]
        self.raw_position = self.raw_velocity = self.raw_current = 0
        self.shown_mode: int | None = None  # 6061h of the last process data
        self.was_remote = False  # whether its statusword told in this run that it obeys the bus
        self.strange_mode = 0  # cycles in a row in which it was in another mode than it was told
        self._last_values: dict[int, int] = {}  # values of the last frames, by index
        self.set_points = SetPoints()
        # parts of the last target and offset that rounding left over [device units]
        self.carried = self.offset_carried = 0.0
        self.ways: deque[tuple[float, float]] = deque()  # asked for and driven, one for each cycle [m]
        self.use_units()

    # ------------------------------------------------------------------------------------------------------ scaling

    def use_units(self) -> None:
        """Take over units after the drive's scaling is known."""
        units = self.profile.units(self.mirror, magnetic_pitch(self.keys.motor))
        self.units = units
        self.ampere = vendor.current_unit(self.process_data, units)
        self.force_constant = constant_of(self.keys)

    @property
    def process_data(self) -> ProcessData:
        """What is exchanged in each cycle, of what the drive has as far as it is known."""
        if self._process_data is None:
            self.use_process_data()
        assert self._process_data is not None
        return self._process_data

    def use_process_data(self) -> None:
        """Take over process data after it is known what the drive has, and whether it is told a force."""
        data = self._process_data = vendor.process_data(self.mirror, self.vendor, self.keys, self.told_force)
        self._received = [
            (base + self.number, vendor.layout(words), words)
            for base, words in zip(RECEIVE_PDOS, data.receive, strict=True)
            if words
        ]
        self._state, self._speed = vendor.layout(data.transmit[0]), vendor.layout(data.transmit[1])

    @property
    def origin(self) -> float:
        """What the drive counts where the position is 0 [m]. What it was told last stays where it is."""
        return self._origin

    @origin.setter
    def origin(self, value: float) -> None:
        self.acceleration.shift(self._origin - value)
        self._origin = value

    @property
    def position(self) -> float:
        """Actual position [m]."""
        return self.sign * self.raw_position * self.units.position - self.origin

    @property
    def velocity(self) -> float:
        """Actual velocity [m/s]."""
        return self.sign * self.raw_velocity * self.units.velocity

    @property
    def current(self) -> float:
        """Actual current [A], positive where it pushes to positive positions."""
        return (-1.0 if self.keys.inverted else 1.0) * self.raw_current * self.ampere

    @property
    def force(self) -> float:
        """Force of the motor by its current [N]."""
        return self.force_constant * self.current

    @property
    def state(self) -> State:
        """State of the power drive system."""
        return state_of(self.word)

    @property
    def position_limits(self) -> tuple[float, float]:
        """Where it may be [m]. An end stop is beyond the limits: who was sent there may come back."""
        low, high = self.keys.limits.position
        here = self.entered_from
        return (low, high) if here is None else (min(low, here - MARGIN), max(high, here + MARGIN))

    def zero(self, position: float) -> None:
        """Here is this position."""
        self.origin += self.position - position

    def way(self, value: float) -> str:
        """A position or a way for people."""
        return f"{degrees(value):.2f} deg" if self.rotary else f"{1e3 * value:.2f} mm"

    def device_position(self, position: float) -> int:
        """A position as the drive counts."""
        return round((position + self.origin) / (self.sign * self.units.position))

    def device_force(self, force: float) -> float:
        """A force [N] as 6071h counts, within what it takes."""
        current = (-1.0 if self.keys.inverted else 1.0) * force / self.force_constant
        entry = self.mirror.entry(0x6071)
        low, high = (TORQUES[0] if entry.low is None else entry.low), (TORQUES[1] if entry.high is None else entry.high)
        return min(max(current / self.units.torque, low), high)

    def rounded(self, value: float) -> int:
        """The whole number of a target; the rest is carried on to the next cycle, so that the mean is right."""
        whole = round(value + self.carried)
        self.carried += value - whole
        return whole

    def rounded_offset(self, value: float) -> int:
        """The same of an offset; none leaves nothing over."""
        whole = round(value + self.offset_carried) if value else 0
        self.offset_carried += value - whole
        return whole

    # -------------------------------------------------------------------------------------------------- each cycle

    def measure_age(self, cycle: int) -> None:
        """From now on SYNC comes once in a cycle [ns]: measure how old the actual values are."""
        self.ages = {STATE_PDO: ValueAge(cycle), SPEED_PDO: ValueAge(cycle)}

    def aim(self, position: float, cycle: int) -> None:
        """The target position of this cycle [m]. Its speed is that of the way on which the drive interpolates."""
        self._left = position if self.aimed is None else self.aimed
        self.speed = 0.0 if self.aimed is None else (position - self.aimed) / cycle * 1e9
        self.aimed = self.target_position = position

    def lose_aim(self) -> None:
        """No target position in this cycle: the next one has no speed."""
        self.aimed, self.speed, self.offset = None, 0.0, 0.0

    def halve(self) -> None:
        """Targets of this cycle at half speed: the first half of the way."""
        self.target_velocity, self.offset = 0.5 * self.target_velocity, 0.5 * self.offset
        if self.aimed is not None:
            self.target_position = 0.5 * (self._left + self.aimed)

    def complete(self) -> None:
        """The second half."""
        if self.aimed is not None:
            self.target_position = self.aimed

    @property
    def goes_to(self) -> float:
        """The last target position, or where it is if there was none [m]."""
        return self.position if self.aimed is None else self.aimed

    @property
    def lag(self) -> float:
        """How far it is behind the last target position [m]."""
        return self.goes_to - self.position

    @property
    def own_mode(self) -> Mode:
        """The wanted mode, or what stands for it where the drive has it not."""
        if self.homing:
            return Mode.HM
        wanted = (self.mode, vendor.SUBSTITUTES.get(self.mode, self.mode), Mode.CSP, Mode.PP)
        return next((mode for mode in wanted if self.offers(mode)), self.mode)

    def offers(self, mode: Mode) -> bool:
        """Whether it has a mode, by 6502h."""
        return bool(self.mirror.get(0x6502) >> (mode - 1) & 1)

    @property
    def unable(self) -> str:
        """That it has no mode for what it is told, or nothing."""
        if self.homing or self.offers(self.mode) or self.offers(vendor.SUBSTITUTES.get(self.mode, self.mode)):
            return ""
        return f"{self.name}: has no mode for {self.mode.name.lower()}: 6502h is {self.mirror.get(0x6502):X}h."

    def disobeys(self, patience: int) -> str:
        """That it obeys another program, or for more than `patience` cycles takes no mode or set-point; or nothing."""
        if self.strange_mode > patience:
            return (
                f"{self.name}: is in mode {self.shown_mode} (6061h), not in {self.own_mode.name.lower()}: another program sets it, "
                f"perhaps the vendor's over USB. End that program."
            )
        if self.was_remote and not self.word & cia402.REMOTE:
            return (
                f"{self.name}: does not obey the bus any more (6041h, bit 9 is 0): it is operated locally, perhaps by the vendor's "
                f"program over USB. End that program."
            )
        if self.set_points.unacknowledged > patience:
            return f"{self.name}: does not acknowledge set-points (6041h, bit 12). Look at its statusword and limits."
        return ""

    @property
    def follows(self) -> bool:
        """Whether it does what its targets say."""
        return self.state is State.ENABLED and self.goal is State.ENABLED and not self.homing

    def limit_acceleration(self, cycle: int, synced: int) -> None:
        """Before the frames of a cycle [ns]: what it is told, by the targets and `limits.acceleration`. `synced`: last SYNC."""
        limit, h = self.acceleration, cycle / 1e9
        limit.measure(self.velocity, synced)
        if not self.follows:
            limit.begin(self.position)
        elif self.mode is Mode.CST:
            limit.begin(self.position, self.velocity)
        elif self.mode is Mode.CSV:
            limit.follow_velocity(self.target_velocity, self.position, h)
        else:
            limit.follow_position(self.target_position, h)
            if limit.limited:
                fed = self.keys.follow.feedforward * abs(limit.velocity)
                self.offset = min(max(self.offset, -fed), fed)

    def frames(self) -> list[Frame]:
        """Target and controlword of this cycle. Until the drive is enabled the targets are its actual values."""
        mode, state, follows = self.own_mode, self.state, self.follows
        strange = follows and self.shown_mode not in (None, mode)
        self.strange_mode = self.strange_mode + 1 if strange else 0
        places = mode in (Mode.CSP, Mode.PP)
        position = self.device_position(self.acceleration.position) if follows and places else self.raw_position
        velocity = torque = 0
        if follows and mode is Mode.CST:
            torque = self.rounded(self.device_force(self.target_force))
        elif follows and not places:
            velocity = self.rounded(self.acceleration.velocity / (self.sign * self.units.velocity))
        word = self.controlword(state)
        if mode is Mode.PP and follows:
            word |= self._set_point()
        else:
            self.set_points.reset()
        offset = self.offset if follows and mode is Mode.CSP else 0.0  # in other modes it would be added to the speed
        values = {
            0x607A: position,
            0x6040: word,
            0x6060: mode,
            0x60FF: velocity,
            0x6071: torque,
            0x60FE: self.safe_outputs if self.goal is State.DISABLED else self.outputs,  # until the drive stands
        }
        if self.keys.offset:
            values[0x60B1] = self.rounded_offset(offset / (self.sign * self.units.velocity))
        self._last_values = values
        return vendor.encode_frames(self._received, values)

    def _set_point(self) -> int:
        """Bits of the controlword in pp. An edge in another mode would be lost, and bit 12 means something else there."""
        shown = self._last_values.get(0x6060) if self.shown_mode is None else self.shown_mode
        if shown == Mode.PP:
            return self.set_points.control_bits(self.word)
        self.set_points.reset()
        return cia402.CHANGE_IMMEDIATELY

    def acknowledge(self) -> list[Frame]:
        """After a statusword: bit 4 falls as soon as a set-point is acknowledged, so that the next one can be given."""
        if not self.follows or not self.set_points.acknowledge(self.word):
            return []
        values = {**self._last_values, 0x6040: self._last_values[0x6040] & ~cia402.NEW_SET_POINT}
        return vendor.encode_frames([one for one in self._received if CONTROLWORD in one[2]], values)

    def controlword(self, state: State) -> int:
        """The next step towards the goal."""
        if self.goal is State.ENABLED:
            word = UP.get(state, 0)  # nothing in Fault: to reset it is for a person who knows the cause
            return word | cia402.NEW_SET_POINT if self.homing and state is State.ENABLED else word
        if self.goal is State.SWITCHED_ON:
            return ON.get(state, 0)
        if self.goal is State.QUICK_STOP:
            return DOWN.get(state, 0)
        return 0

    def heard(self, frame: Frame, now: int) -> None:
        """A frame of this drive arrived."""
        base = frame.id - self.number
        if base in self.ages:
            self.ages[base].received(now)
        if base == STATE_PDO and len(frame.data) == self._state.size:
            self.word, *shown, self.raw_position = self._state.unpack(frame.data)
            self.word_at = now
            self.was_remote |= bool(self.word & cia402.REMOTE)
            self.answered, self.answered_at = self.answered + 1, now
            self.shown_mode = shown[0] if shown else None
        elif base == SPEED_PDO and len(frame.data) == self._speed.size:
            self.raw_velocity, *current = self._speed.unpack(frame.data)
            self.velocity_at = now
            self.raw_current = current[0] if current else 0
        elif base == ACKNOWLEDGE_PDO and self.process_data.transmit[2] == vendor.ACKNOWLEDGE and len(frame.data) == 2:
            self.word, self.word_at = struct.unpack("<H", frame.data)[0], now
        else:
            super().heard(frame, now)

    def follow(self, cycle: int, elapsed: int) -> None:
        """Before a SYNC: which way was asked for and driven. `elapsed` [ns] since the last one: a stall lengthens the way."""
        if self.mode is not Mode.CSV:  # in cst no way is asked for
            self.ways.clear()
            return
        if self.ways:
            asked, place = self.ways[-1]
            self.ways[-1] = asked * elapsed / cycle, place
        asked = self.acceleration.velocity * cycle / 1e9
        self.ways.append((asked, self.position))
        while len(self.ways) * cycle > WINDOW * 1e9:
            self.ways.popleft()

    def forget(self) -> None:
        """A run begins: what happened before does not count."""
        super().forget()
        self.strange_mode = 0
        self.was_remote = False
        self.ways.clear()
        self.acceleration.forget()

    @property
    def following_error(self) -> float:
        """Way that was asked for minus the one that was driven [m]: now in csp, over a time in csv, none in cst."""
        if self.mode is Mode.CSP:
            return self.target_position - self.position
        if not self.ways:
            return 0.0
        asked: float = sum(map(ASKED, self.ways))
        return asked - (self.position - self.ways[0][1])
