"""One drive on the master's side: identity, set-up, targets and actual values of each cycle."""

from __future__ import annotations

import struct
from collections import deque
from math import degrees
from operator import itemgetter
from typing import TYPE_CHECKING

from hw_bridge.bus import Frame
from hw_bridge.dictionary import Mode, State, cia402, state_of
from hw_bridge.hardware import motor_data
from hw_bridge.master import pdo_mapping
from hw_bridge.master.acceleration import AccelerationLimit
from hw_bridge.master.age import ValueAge
from hw_bridge.master.limits import OwnLimits
from hw_bridge.master.pdo_mapping import ProcessData
from hw_bridge.master.set_points import SetPoints
from hw_bridge.master.station import Station
from hw_bridge.profiles import magnetic_pitch

if TYPE_CHECKING:
    from hw_bridge.bus import Network
    from hw_bridge.hardware import NodeKeys
    from hw_bridge.master.station import Waiting
    from hw_bridge.profiles import Profile

RECEIVE_PDOS = (0x200, 0x300, 0x400, 0x500)
STATE_PDO, SPEED_PDO, ACKNOWLEDGE_PDO = 0x180, 0x280, 0x380
COMMANDED = itemgetter(0)  # of a pair (commanded distance, actual position)
WINDOW = 1.0  # of the following error in csv [s]: a blocked drive is detected at speeds above limit / window
MARGIN = 1e-3  # by which a drive may swing back while it leaves an end stop [m or rad]
TORQUES = (-32768, 32767)  # of an INTEGER16

UP = {  # controlword on the way to Operation enabled
    State.DISABLED: 0x06,
    State.READY: 0x07,
    State.SWITCHED_ON: 0x0F,
    State.ENABLED: 0x0F,
}
ON = {  # controlword on the way to Switched on, and there: no current
    State.DISABLED: 0x06,
    State.READY: 0x07,
    State.SWITCHED_ON: 0x07,
}
DOWN = {  # on the way to a standstill
    State.ENABLED: 0x02,
    State.QUICK_STOP: 0x02,
}
AT_REST = cia402.AT_REST
CONTROLWORD = 0x60400010


class Node(Station):
    """A drive. Positions [m] count from the place where `zero` was called; all other quantities are in SI too."""

    keys: NodeKeys
    profile: Profile

    def __init__(self, name: str, keys: NodeKeys, profile: Profile, network: Network, wait: Waiting) -> None:
        super().__init__(name, keys, profile, network, wait)
        self.own = OwnLimits(keys.limits)
        self.sign = -keys.scale if keys.inverted else keys.scale
        self.acceleration = AccelerationLimit(keys.limits.acceleration, keys.limits.velocity)
        self.identity: list[int] = []  # vendor, product and serial number as read
        self.rotary = False  # whether positions are angles
        self.absent: frozenset[int] = frozenset()  # objects of a run that the drive does not have
        self._process_data: ProcessData | None = None
        self.has_reference = False  # whether this run has homed it, or proven that it counts from its reference
        self._origin = 0.0
        self.entered_from: float | None = None  # where homing ended, on the way to where the scenario begins [m]
        self.goal = State.DISABLED
        self.homing = False
        self.mode = Mode.CSV
        self.target_position = self.target_velocity = self.target_force = 0.0
        self.previous_target: float | None = None  # target position of the previous cycle; None: there was none [m]
        self._previous_position = 0.0  # start of this cycle's motion to it [m]
        self.speed = self.offset = 0.0  # of this target position, and its feedforward part in csp [m/s]
        self.has_target_force = False  # whether process data have room for a force
        self.outputs = self.safe_outputs = keys.safe_outputs or 0  # 60FEh.1, and what it is at rest
        self.word, self.word_at = 0, 0  # the last statusword, and when it came [ns], also by SDO
        self.velocity_at = 0  # when the last velocity came [ns]
        self.raw_position = self.raw_velocity = self.raw_current = 0
        self.shown_mode: int | None = None  # 6061h of the last process data
        self.was_remote = False  # whether its statusword had the remote bit in this run
        self.cycles_in_other_mode = 0  # consecutive cycles in another mode than the commanded one
        self._last_values: dict[int, int] = {}  # values of the last frames, by index
        self.set_points = SetPoints()
        self.rounding_residual = self.offset_rounding_residual = 0.0  # of the last target and offset [device units]
        self.distances: deque[tuple[float, float]] = deque()  # commanded distance and actual position of each cycle [m]
        self.use_units()

    # ------------------------------------------------------------------------------------------------------ scaling

    def use_units(self) -> None:
        """Update units after the drive's scaling is known."""
        units = self.profile.units(self.mirror, magnetic_pitch(self.keys.motor))
        self.units = units
        self.ampere = pdo_mapping.current_unit(self.process_data, units)
        self.force_constant = motor_data.force_constant_of(self.keys)

    @property
    def process_data(self) -> ProcessData:
        """PDO mappings of a run, of objects that the drive has as far as known."""
        if self._process_data is None:
            self.use_process_data()
        assert self._process_data is not None
        return self._process_data

    def use_process_data(self) -> None:
        """Update process data after the drive's objects are known, and whether it receives a target force."""
        data = self._process_data = pdo_mapping.process_data(
            self.mirror, self.profile, self.keys, self.has_target_force
        )
        self._received = [
            (base + self.number, pdo_mapping.layout(words), words)
            for base, words in zip(RECEIVE_PDOS, data.receive, strict=True)
            if words
        ]
        self._state, self._speed = pdo_mapping.layout(data.transmit[0]), pdo_mapping.layout(data.transmit[1])

    @property
    def origin(self) -> float:
        """The drive's position count where the position is 0 [m]. Setting it keeps the last target in place."""
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
        """Permitted positions [m]. An end stop is beyond the limits: a drive sent there may come back."""
        low, high = self.keys.limits.position
        here = self.entered_from
        return (low, high) if here is None else (min(low, here - MARGIN), max(high, here + MARGIN))

    def zero(self, position: float) -> None:
        """Define the actual position."""
        self.origin += self.position - position

    def format_length(self, value: float) -> str:
        """Format a position or distance with its unit."""
        return f"{degrees(value):.2f} deg" if self.rotary else f"{1e3 * value:.2f} mm"

    def device_position(self, position: float) -> int:
        """Convert a position to device units."""
        return round((position + self.origin) / (self.sign * self.units.position))

    def device_force(self, force: float) -> float:
        """Convert a force [N] to the unit of 6071h, clamped to its range."""
        current = (-1.0 if self.keys.inverted else 1.0) * force / self.force_constant
        entry = self.mirror.entry(0x6071)
        low, high = (TORQUES[0] if entry.low is None else entry.low), (TORQUES[1] if entry.high is None else entry.high)
        return min(max(current / self.units.torque, low), high)

    def round_target(self, value: float) -> int:
        """Round a target; the residual is added to the next cycle's, so that the mean is exact."""
        integer = round(value + self.rounding_residual)
        self.rounding_residual += value - integer
        return integer

    def round_offset(self, value: float) -> int:
        """Round an offset in the same way; 0 leaves no residual."""
        integer = round(value + self.offset_rounding_residual) if value else 0
        self.offset_rounding_residual += value - integer
        return integer

    # -------------------------------------------------------------------------------------------------- each cycle

    def measure_age(self, cycle: int) -> None:
        """Measure the age of actual values from now on, with one SYNC per `cycle` [ns]."""
        self.ages = {STATE_PDO: ValueAge(cycle), SPEED_PDO: ValueAge(cycle)}

    def set_target(self, position: float, cycle: int) -> None:
        """Set the target position of this cycle [m]. Its speed is the slope of the drive's interpolation."""
        self._previous_position = position if self.previous_target is None else self.previous_target
        self.speed = 0.0 if self.previous_target is None else (position - self.previous_target) / cycle * 1e9
        self.previous_target = self.target_position = position

    def clear_target(self) -> None:
        """Clear the target position: the next one has no speed."""
        self.previous_target, self.speed, self.offset = None, 0.0, 0.0

    def first_half_step(self) -> None:
        """Targets of the first half of a cycle at half speed."""
        self.target_velocity, self.offset = 0.5 * self.target_velocity, 0.5 * self.offset
        if self.previous_target is not None:
            self.target_position = 0.5 * (self._previous_position + self.previous_target)

    def second_half_step(self) -> None:
        """Targets of the second half."""
        if self.previous_target is not None:
            self.target_position = self.previous_target

    @property
    def last_target(self) -> float:
        """Last target position, or the actual one if there was none [m]."""
        return self.position if self.previous_target is None else self.previous_target

    @property
    def tracking_error(self) -> float:
        """Distance to the last target position [m]."""
        return self.last_target - self.position

    @property
    def own_mode(self) -> Mode:
        """The commanded mode, or its substitute where the drive does not have it."""
        if self.homing:
            return Mode.HM
        wanted = (self.mode, pdo_mapping.SUBSTITUTES.get(self.mode, self.mode), Mode.CSP, Mode.PP)
        return next((mode for mode in wanted if self.offers(mode)), self.mode)

    def offers(self, mode: Mode) -> bool:
        """Whether it has a mode, by 6502h."""
        return bool(self.mirror.get(0x6502) >> (mode - 1) & 1)

    @property
    def mode_problem(self) -> str:
        """Problem text if the drive has no mode for its targets, else empty."""
        if self.homing or self.offers(self.mode) or self.offers(pdo_mapping.SUBSTITUTES.get(self.mode, self.mode)):
            return ""
        return f"{self.name}: has no mode for {self.mode.name.lower()}: 6502h is {self.mirror.get(0x6502):X}h."

    @property
    def follows(self) -> bool:
        """Whether the drive follows its targets."""
        return self.state is State.ENABLED and self.goal is State.ENABLED and not self.homing

    def limit_acceleration(self, cycle: int, synced: int) -> None:
        """Before the frames of a cycle [ns]: limit targets to `limits.acceleration`. `synced`: time of the last SYNC."""
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
        self.cycles_in_other_mode = self.cycles_in_other_mode + 1 if strange else 0
        is_position_mode = mode in (Mode.CSP, Mode.PP)
        position = (
            self.device_position(self.acceleration.position) if follows and is_position_mode else self.raw_position
        )
        velocity = torque = 0
        if follows and mode is Mode.CST:
            torque = self.round_target(self.device_force(self.target_force))
        elif follows and not is_position_mode:
            velocity = self.round_target(self.acceleration.velocity / (self.sign * self.units.velocity))
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
            values[0x60B1] = self.round_offset(offset / (self.sign * self.units.velocity))
        self._last_values = values
        return pdo_mapping.encode_frames(self.name, self._received, values)

    def _set_point(self) -> int:
        """Set-point bits of the controlword in pp. In other modes an edge would be lost, and bit 12 has another meaning."""
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
        control = [pdo for pdo in self._received if CONTROLWORD in pdo[2]]
        return pdo_mapping.encode_frames(self.name, control, values)

    def controlword(self, state: State) -> int:
        """Controlword of the next transition to the goal."""
        if self.goal is State.ENABLED:
            word = UP.get(state, 0)  # nothing in Fault: to reset it is for a person who knows the cause
            return word | cia402.NEW_SET_POINT if self.homing and state is State.ENABLED else word
        if self.goal is State.SWITCHED_ON:
            return ON.get(state, 0)
        if self.goal is State.QUICK_STOP:
            return DOWN.get(state, 0)
        return 0

    def process_frame(self, frame: Frame, now: int) -> None:
        """Process a frame of this drive."""
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
        elif (
            base == ACKNOWLEDGE_PDO
            and self.process_data.transmit[2] == pdo_mapping.ACKNOWLEDGE
            and len(frame.data) == 2
        ):
            self.word, self.word_at = struct.unpack("<H", frame.data)[0], now
        else:
            super().process_frame(frame, now)

    def follow(self, cycle: int, elapsed: int) -> None:
        """Before a SYNC: record commanded and actual distance. `elapsed`: time since the last one [ns], longer after a stall."""
        if self.mode is not Mode.CSV:  # in cst no way is asked for
            self.distances.clear()
            return
        if self.distances:
            commanded, position = self.distances[-1]
            self.distances[-1] = commanded * elapsed / cycle, position
        commanded = self.acceleration.velocity * cycle / 1e9
        self.distances.append((commanded, self.position))
        while len(self.distances) * cycle > WINDOW * 1e9:
            self.distances.popleft()

    def forget(self) -> None:
        """Reset statistics at the start of a run."""
        super().forget()
        self.cycles_in_other_mode = 0
        self.was_remote = False
        self.distances.clear()
        self.acceleration.forget()

    @property
    def following_error(self) -> float:
        """Commanded minus actual distance [m]: instantaneous in csp, over a window in csv, none in cst."""
        if self.mode is Mode.CSP:
            return self.target_position - self.position
        if not self.distances:
            return 0.0
        commanded: float = sum(map(COMMANDED, self.distances))
        return commanded - (self.position - self.distances[0][1])
