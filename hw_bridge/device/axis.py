"""Actual values, demands and limits of a drive: motor quantities in SI against device units in the dictionary."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp
from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND
from hw_bridge.device.motor import CYCLE, Motor
from hw_bridge.dictionary import HomingEvent
from twin import clock

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.bus import EventQueue
    from hw_bridge.dictionary import Dictionary
    from hw_bridge.profiles import Profile

OFF = 0xFFFFFFFF  # a window of this size is none


STILL_AHEAD = 4  # increments of the sensor within which a position demand asks for no motion
STILL = 1e-6  # slower than this [m/s or rad/s] is what filters leave over


@dataclass
class Switches:
    """Where switches close, in the motor's own coordinate [m or rad]; None: not wired."""

    negative: float | None = None
    positive: float | None = None
    home: tuple[float, float] | None = None
    probes: tuple[tuple[float, float] | None, tuple[float, float] | None] = (None, None)  # inputs of touch probes 1, 2

    def closed(self, position: float) -> tuple[bool, bool, bool]:
        """Negative limit, positive limit and home switch at a position."""
        negative = self.negative is not None and position <= self.negative
        positive = self.positive is not None and position >= self.positive
        home = self.home is not None and self.home[0] <= position <= self.home[1]
        return negative, positive, home


class Axis:
    """One motor on its drive's side. Positions [m or rad] count from the origin that homing sets."""

    def __init__(self, profile: Profile, dictionary: Dictionary, event_queue: EventQueue, motor: Motor) -> None:
        self.profile, self.dictionary, self.event_queue, self.motor = profile, dictionary, event_queue, motor
        self.switches = Switches()
        self._version = -1
        self._actual = [  # of what this drive has: place, smallest and largest value, and what is shown there
            ((index, sub), *dictionary.entry(index, sub).type.span, value)
            for (index, sub), value in ACTUAL.items()
            if dictionary.find(index, sub)
        ]
        self.start()

    def start(self) -> None:
        """Initialize as after power-on: the sensor counts from the motor's position."""
        self.origin = self.motor.measured_position
        self.referenced = False  # whether homing has set the origin
        self.heat = 0.0  # mean square of the current [A2]
        self.derated = self.limited = self.clipped = False
        self.demand = 0.0  # position demand
        self.speed = 0.0  # speed demand
        self.heading = 0.0  # sign of the motion that is demanded; 0: none
        self.holds_position = False  # whether the demand is a position
        self.last_target_at = 0  # [ns]
        self.windows: dict[int, int] = {}
        self.off()
        self.measure()

    # ------------------------------------------------------------------------------------------------------ actual

    def measure(self) -> None:
        """Update the actual values of the dictionary."""
        dictionary, motor = self.dictionary, self.motor
        if self._version != dictionary.version:  # scaling and limits are parameters
            self._version = dictionary.version
            self.units = self.profile.units(dictionary, motor.model.index)
            self.currents = self.profile.currents(dictionary)
            self.warming = 1.0 - exp(-clock.seconds(CYCLE) / self.currents.lag)  # towards the square, in a cycle
            self._tune()
        measured = motor.measured_position
        self.position = measured - self.origin
        self.velocity = motor.measured_velocity
        self._derate(motor.current)
        if not self.holds_position:
            self.demand = self.position
        values = dictionary.values
        for address, low, high, actual in self._actual:
            integer = round(actual(self))
            values[address] = integer if low <= integer <= high else low if integer < low else high
        negative, positive, home = self.switches.closed(measured)
        dictionary.put(0x60FD, negative | positive << 1 | home << 2)

    def _tune(self) -> None:
        """Gains of the dictionary: with its defaults the motor's loops are as its component has them."""
        factors: dict[str, float] = {}
        for address, powers in self.profile.gains.items():
            default = self.dictionary.entry(*address).default
            assert isinstance(default, int)
            factor = max(self.dictionary.get(*address), 1) / default
            for name, power in powers.items():
                factors[name] = factors.get(name, 1.0) * factor**power
        for name, factor in factors.items():
            self.motor.tune(name, factor)

    @property
    def following_error(self) -> float:
        """Demand minus actual position."""
        return self.demand - self.position

    def _derate(self, current: float) -> None:
        """I2t: mean square with the thermal time constant; above the continuous current that one is the limit."""
        limits = self.currents
        self.heat += (current * current - self.heat) * self.warming
        square = limits.continuous * limits.continuous
        self.derated = self.heat >= square if not self.derated else self.heat > 0.81 * square
        self.level = self.heat / square if square else 0.0
        self.limit = min(limits.continuous, limits.peak) if self.derated else limits.peak
        self.limited = self.motor.powered and abs(current) >= 0.999 * min(self.limit, self.motor.strongest)

    # ------------------------------------------------------------------------------------------------------ demand

    def off(self) -> None:
        """Switch the current off."""
        self.motor.off()
        self.holds_position = False
        self.speed = self.heading = 0.0

    def follow_position(self, position: float, speed: float = 0.0, offset: float = 0.0, current: float = 0.0) -> None:
        """Demand a position, within the software limits. `offset` and `current` [A]: 60B1h and 60B2h, fed forward."""
        low, high = self.range()
        self.demand = min(max(position, low), high)
        self.clipped = self.demand != position
        self.speed, self.holds_position = speed, True
        ahead = self.demand - self.position
        self.heading = ahead if abs(ahead) > STILL_AHEAD * self.motor.model.resolution else 0.0
        if offset:  # the largest speed bounds it too
            largest = self.fastest()
            self.clipped |= abs(offset) > largest
            offset = min(max(offset, -largest), largest)
        self.motor.follow_position(self.demand + self.origin, self.limit, offset, current)

    def follow_velocity(self, velocity: float, limit: float | None = None, current: float = 0.0) -> None:
        """Demand a speed, within the largest one; with no more than `limit` [A] where given. `current` [A]: 60B2h."""
        largest = self.fastest()
        self.speed = min(max(velocity, -largest), largest)
        self.clipped = self.speed != velocity
        self.heading = self.speed if abs(self.speed) > STILL else 0.0
        self.holds_position = False
        self.motor.follow_velocity(self.speed, self.limit if limit is None else min(limit, self.limit), current)

    def follow_current(self, current: float) -> None:
        """Demand a current [A]."""
        self.speed, self.holds_position = self.velocity, False
        self.heading = current or (self.velocity if abs(self.velocity) > STILL else 0.0)
        self.clipped = abs(current) > self.limit
        self.motor.follow_current(current, self.limit)

    def limit_switch(self, heading: float) -> HomingEvent | None:
        """The closed limit switch in this direction."""
        if heading == 0.0 or (self.switches.negative is None and self.switches.positive is None):
            return None
        negative, positive, _ = self.switches.closed(self.motor.measured_position)
        if heading > 0.0 and positive:
            return HomingEvent.POSITIVE
        return HomingEvent.NEGATIVE if heading < 0.0 and negative else None

    def range(self) -> tuple[float, float]:
        """Software position limits 607Dh."""
        dictionary = self.dictionary
        low, high = dictionary.get(0x607D, 1), dictionary.get(0x607D, 2)
        none = self.profile.limits_off_when_zero and low == 0 and high == 0
        if none or not dictionary.get(0x2338, 3, missing=1):
            return float("-inf"), float("inf")
        return low * self.units.position, high * self.units.position

    def fastest(self) -> float:
        """The smaller of 607Fh and 6080h."""
        limits = [self.dictionary.get(index) for index in (0x607F, 0x6080) if index in self.dictionary]
        return min(limits, default=OFF) * self.units.velocity

    def rate(self, index: int) -> float:
        """An acceleration; 6084h, then 6083h, replace an object that the drive does not have. 0 counts as the smallest one."""
        present = next((candidate for candidate in (index, 0x6084, 0x6083) if candidate in self.dictionary), index)
        return max(self.dictionary.get(present), 1) * self.units.acceleration

    # ----------------------------------------------------------------------------------------------------- windows

    def lasting(self, name: int, condition: bool, time: int) -> bool:
        """Whether a condition has held for `time` [ms]; `name`, an object, distinguishes conditions."""
        now = self.event_queue.now
        if not condition:
            self.windows.pop(name, None)
            return False
        return now - self.windows.setdefault(name, now) >= time * MILLISECOND


ACTUAL: dict[tuple[int, int], Callable[[Axis], float]] = {  # rounded, and saturated to the object's type
    (0x6064, 0): lambda axis: axis.position / axis.units.position,
    (0x6062, 0): lambda axis: axis.demand / axis.units.position,
    (0x606C, 0): lambda axis: axis.velocity / axis.units.velocity,
    (0x606B, 0): lambda axis: axis.speed / axis.units.velocity,
    (0x60F4, 0): lambda axis: axis.following_error / axis.units.position,
    (0x6063, 0): lambda axis: axis.motor.measured_position / axis.motor.model.resolution,
    (0x2562, 0): lambda axis: axis.demand / axis.motor.model.resolution,
    (0x6077, 0): lambda axis: axis.motor.current / axis.units.torque if axis.units.torque else 0.0,
    (0x6078, 0): lambda axis: 1000.0 * axis.motor.current,  # [mA], FAULHABER
    (0x30D1, 2): lambda axis: 1000.0 * axis.motor.current,  # [mA], EPOS4
    (0x2200, 1): lambda axis: 10.0 * axis.motor.supply,  # [0.1 V], EPOS4
    (0x2325, 7): lambda axis: 100.0 * axis.motor.supply,  # [10 mV], FAULHABER V3
    (0x3200, 1): lambda axis: 100.0 * axis.level,
    (0x2334, 0): lambda axis: 1000.0 * axis.limit,
}
