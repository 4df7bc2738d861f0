"""Modes of operation: demand in a control cycle, and bits 10, 12 and 13 of the statusword."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple

from hw_bridge.bus import MILLISECOND
from hw_bridge.device.axis import OFF
from hw_bridge.device.trajectory import Trajectory, to_position, to_velocity
from hw_bridge.dictionary import cia402

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.device.axis import Axis


class DecelerationRamp:
    """Deceleration ramp to standstill from any motion."""

    def __init__(self, axis: Axis, deceleration: float) -> None:
        self.axis = axis
        self.by_position = axis.holds_position
        position = axis.demand if self.by_position else axis.position
        now = axis.event_queue.now
        self.motion = to_velocity(now, position, axis.speed, 0.0, deceleration, deceleration)

    def cycle(self) -> bool:
        """Demand the next point; return whether it stands."""
        now = self.axis.event_queue.now
        position, speed = self.motion.at(now)
        if self.by_position:
            self.axis.follow_position(position, speed)
        else:
            self.axis.follow_velocity(speed)
        return now >= self.motion.end


class ModeOfOperation(ABC):
    """One mode. `word` is the controlword; `error(code)` reports a fault of the target."""

    def __init__(self, axis: Axis, error: Callable[[int], None]) -> None:
        self.axis = axis
        self.dictionary = axis.dictionary
        self.error = error
        self.word = 0

    @abstractmethod
    def begin(self) -> None:
        """Start: operation was enabled in this mode, or this mode selected while enabled."""

    @abstractmethod
    def cycle(self) -> None:
        """Set the demand of the next control cycle."""

    @abstractmethod
    def bits(self) -> int:
        """Bits 10, 12 and 13 of the statusword."""

    def control(self, word: int) -> None:
        """Process a controlword."""
        self.word = word

    @property
    def halted(self) -> bool:
        """Whether bit 8 asks for a halt."""
        return bool(self.word & cia402.HALT)

    def halting_rate(self) -> float:
        """Deceleration of a halt: 605Dh."""
        option = self.axis.profile.option(self.dictionary, 0x605D)
        return self.axis.rate(0x6085 if option == 2 else 0x6084)

    def following_error(self) -> bool:
        """Whether the following error is outside its window."""
        window = self.dictionary.get(0x6065, missing=OFF)
        return window != OFF and abs(self.axis.following_error) > window * self.axis.units.position


class SetPoint(NamedTuple):
    """A target position, sampled when bit 4 rose."""

    target: float
    speed: float
    acceleration: float
    deceleration: float
    clipped: bool  # the target was outside 607Dh


class ProfilePosition(ModeOfOperation):
    """pp: set-points with a handshake on bits 4 and 12, one being executed and one waiting."""

    def begin(self) -> None:
        """Stand where the motor is; a set-point needs a rising edge from now on."""
        self.active: SetPoint | None = None
        self.waiting: SetPoint | None = None
        self.acknowledged = False
        self.reached = True
        self.halting = False
        axis = self.axis
        self.motion = to_velocity(
            axis.event_queue.now, axis.demand, axis.speed, 0.0, axis.rate(0x6084), axis.rate(0x6084)
        )

    def control(self, word: int) -> None:
        """Take over a set-point at the rising edge of bit 4."""
        rising = word & ~self.word & cia402.NEW_SET_POINT
        super().control(word)
        if rising and (point := self._set_point(word)) is not None:
            if word & cia402.CHANGE_IMMEDIATELY or self.reached:
                self.waiting = None
                self._start(point)
                self.acknowledged = True
            elif self.waiting is None:
                self.waiting = point
                self.acknowledged = True
        self._acknowledge()

    def _acknowledge(self) -> None:
        """Bit 12 falls when bit 4 has fallen and another set-point could be taken."""
        if not self.word & cia402.NEW_SET_POINT and self.waiting is None:
            self.acknowledged = False

    def _set_point(self, word: int) -> SetPoint | None:
        axis, dictionary = self.axis, self.dictionary
        target = dictionary.get(0x607A) * axis.units.position
        if word & cia402.RELATIVE:
            last = self.waiting or self.active
            target += last.target if last else axis.demand
        low, high = axis.range()
        if not low <= target <= high:
            if axis.profile.target_beyond_limit:
                self.error(axis.profile.target_beyond_limit)
                return None
        clipped, target = not low <= target <= high, min(max(target, low), high)
        speed = min(max(dictionary.get(0x6081), 1) * axis.units.velocity, axis.fastest())
        return SetPoint(target, speed, axis.rate(0x6083), axis.rate(0x6084), clipped)

    def _start(self, point: SetPoint) -> None:
        self.active, self.reached = point, False
        self.axis.windows.pop(0x6067, None)
        position, speed = self.motion.at(self.axis.event_queue.now)
        self._plan(position, speed, point)

    def _plan(self, position: float, speed: float, point: SetPoint) -> None:
        now = self.axis.event_queue.now
        self.motion = to_position(
            now, position, speed, point.target, point.speed, point.acceleration, point.deceleration
        )

    def cycle(self) -> None:
        """Follow the trajectory; at its target start the waiting set-point."""
        now = self.axis.event_queue.now
        position, speed = self.motion.at(now)
        if self.halted is not self.halting:
            self.halting = self.halted
            if self.halting:
                rate = self.halting_rate()
                self.motion = to_velocity(now, position, speed, 0.0, rate, rate)
            elif self.active:
                self._plan(position, speed, self.active)
        self.axis.follow_position(position, speed)
        self.axis.clipped |= self.active is not None and self.active.clipped
        if self.active and not self.halting and now >= self.motion.end:
            self.reached = self._arrived()
            if self.reached and self.waiting is not None:
                point, self.waiting = self.waiting, None
                self._start(point)
        self._acknowledge()

    def _arrived(self) -> bool:
        axis, dictionary = self.axis, self.dictionary
        window = dictionary.get(0x6067, missing=OFF)
        assert self.active is not None
        inside = abs(self.active.target - axis.position) <= window * axis.units.position
        return window == OFF or axis.lasting(0x6067, inside, dictionary.get(0x6068))

    def bits(self) -> int:
        """Target reached (or halted), acknowledge, following error."""
        standing = self.axis.event_queue.now >= self.motion.end if self.halting else self.reached
        bits = cia402.TARGET_REACHED if standing else 0
        bits |= cia402.BIT_12 if self.acknowledged else 0
        return bits | (cia402.BIT_13 if self.following_error() else 0)


class ProfileVelocity(ModeOfOperation):
    """pv: ramps to the target velocity, whatever it is when operation is enabled."""

    def begin(self) -> None:
        """Start from the present speed; no window has lasted yet."""
        axis = self.axis
        for window in (0x606D, 0x606F):
            axis.windows.pop(window, None)
        self.motion = Trajectory(axis.event_queue.now, 0.0, axis.velocity, (), 0.0, axis.velocity)
        self.goal: tuple[float, float, float] | None = None

    def cycle(self) -> None:
        """Follow the ramp; a new target or ramp begins a new one."""
        axis = self.axis
        target = 0.0 if self.halted else self.dictionary.get(0x60FF) * axis.units.velocity
        target = min(max(target, -axis.fastest()), axis.fastest())
        up, down = axis.rate(0x6083), axis.rate(0x6084)
        if self.halted:
            down = self.halting_rate()
        goal = (target, up, down)
        now = axis.event_queue.now
        _, speed = self.motion.at(now)
        if goal != self.goal:
            self.goal = goal
            self.motion = to_velocity(now, 0.0, speed, *goal)
        axis.follow_velocity(speed)

    def bits(self) -> int:
        """Target velocity reached; speed is 0."""
        axis, dictionary = self.axis, self.dictionary
        target = self.goal[0] if self.goal else 0.0
        units = axis.units.velocity
        window = dictionary.get(0x606D, missing=OFF)  # without one, the demand counts
        near = window == OFF or abs(axis.velocity - target) <= max(window, 1) * units
        threshold = dictionary.get(0x606F, missing=dictionary.get(0x30E0, 1))
        still = abs(axis.velocity) <= max(threshold, 1) * units
        rest = dictionary.get(0x6070, missing=dictionary.get(0x30E0, 2))
        has_lasted = axis.lasting(
            0x606D, near, dictionary.get(0x606E)
        )  # also on a ramp: it ends the window of the last target
        bits = cia402.TARGET_REACHED if has_lasted and axis.event_queue.now >= self.motion.end else 0
        return bits | (cia402.BIT_12 if axis.lasting(0x606F, still, rest) else 0)


class CyclicPosition(ModeOfOperation):
    """csp: follows 607Ah at once; with 60C2h it interpolates linearly over the period between targets.

    With a late target it stays at the last one, or continues at the same speed for as many periods as the
    profile has; then it holds, and whether that is an error is the profile's. 60B0h is added to the target; 60B1h and 60B2h
    are fed forward into the loops of speed and current.
    """

    def begin(self) -> None:
        """Follow the target: a host that did not set it to the actual position makes the motor jump."""
        self.target = self.origin = self._target()
        self.since, self.last_target_at = self.axis.event_queue.now, self.axis.last_target_at

    def _target(self) -> float:
        return (self.dictionary.get(0x607A) + self.dictionary.get(cia402.POSITION_OFFSET)) * self.axis.units.position

    def period(self) -> int:
        """Interpolation period [ns]; 0: none."""
        exponent = self.dictionary.get(0x60C2, 2, missing=-3)
        return int(self.dictionary.get(0x60C2, 1) * 10 ** max(exponent + 9, 0))

    def cycle(self) -> None:
        """Take over a new target and interpolate to it."""
        now, period = self.axis.event_queue.now, self.period()
        target, beyond = self._target(), self.axis.profile.extrapolation
        if target != self.target or (
            beyond and self.last_target_at != self.axis.last_target_at
        ):  # extrapolation needs to know that it is constant
            self.origin, self.target, self.since, self.last_target_at = (
                self.axis.demand,
                target,
                now,
                self.axis.last_target_at,
            )
        end = 1.0 + beyond
        share = 1.0 if not period else min((now - self.since + MILLISECOND) / period, end)
        speed = (self.target - self.origin) / (period / 1e9) if period and share < end else 0.0
        units, dictionary = self.axis.units, self.dictionary
        offset = dictionary.get(cia402.VELOCITY_OFFSET) * units.velocity
        current = dictionary.get(cia402.TORQUE_OFFSET) * units.torque
        self.axis.follow_position(self.origin + share * (self.target - self.origin), speed, offset, current)

    def bits(self) -> int:
        """Follows the command; following error."""
        return cia402.BIT_12 | (cia402.BIT_13 if self.following_error() else 0)


class DirectMode(ModeOfOperation):
    """A mode that follows its command at once."""

    def begin(self) -> None:
        """Nothing to prepare."""

    def bits(self) -> int:
        """Follows the command."""
        return cia402.BIT_12


class CyclicVelocity(DirectMode):
    """csv: follows 60FFh with 60B1h added at once; 60B2h is fed forward into the loop of the current."""

    def cycle(self) -> None:
        """Demand target and offset."""
        units, dictionary = self.axis.units, self.dictionary
        demand = dictionary.get(0x60FF) + dictionary.get(cia402.VELOCITY_OFFSET)
        current = dictionary.get(cia402.TORQUE_OFFSET) * units.torque
        self.axis.follow_velocity(demand * units.velocity, None, current)


class CyclicTorque(DirectMode):
    """cst: follows 6071h at once, in per mille of the rated torque."""

    def cycle(self) -> None:
        """Demand target and offset."""
        demand = self.dictionary.get(0x6071) + self.dictionary.get(cia402.TORQUE_OFFSET)
        self.axis.follow_current(demand * self.axis.units.torque)


class NoMode(DirectMode):
    """Mode 0: no current."""

    def cycle(self) -> None:
        """Let the motor run out."""
        self.axis.off()

    def bits(self) -> int:
        """None."""
        return 0
