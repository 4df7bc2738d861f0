"""A fast model of two carriages on one rail with pneumatic grips, and an independent judge of what happens on it.

Nothing here knows the sequencer's insides: the judge sees true positions and true grips.
"""

from dataclasses import dataclass, field
from math import copysign, exp

import numpy as np
from fmus.regripping_sequencer.model import RegrippingSequencer

from twin.component import OK

STROKE = 50e-3
TRUE_GRIP = 3.8e-3  # extension from which the model's sleeves really hold [m]
TRUE_TOUCH = 2.5e-3  # extension from which they touch [m]
CLOSED = 4.6e-3  # extension at which the braid stops the piston [m]
INCREMENT = 8e-6  # of the Hall sensors [m]


@dataclass
class Rail:
    """Two carriages that follow a speed with a lag, two cylinders that arrive after a random delay."""

    random: np.random.Generator
    lag: tuple[float, float] = (6e-3, 6e-3)
    delay: tuple[float, float] = (10e-3, 60e-3)
    leak: float = 0.0  # speed at which the sleeves open without air [m/s]
    position: list[float] = field(default_factory=lambda: [-25e-3, 25e-3])
    velocity: list[float] = field(default_factory=lambda: [0.0, 0.0])
    extension: list[float] = field(default_factory=lambda: [0.0, 0.0])
    valve: list[bool] = field(default_factory=lambda: [False, False])
    piston: list[float] = field(default_factory=lambda: [0.0, 0.0])
    wait: list[float] = field(default_factory=lambda: [0.0, 0.0])

    def advance(self, h, target, valve, pressure_ok, drive_ok):
        for k in range(2):
            # a lost drive brakes by friction alone: 1.5 N on 0.65 kg
            last = self.velocity[k]
            if drive_ok[k]:
                v = target[k] + (last - target[k]) * exp(-h / self.lag[k])
            else:
                v = copysign(max(abs(last) - 2.3 * h, 0.0), last)
            self.position[k] += 0.5 * h * (v + last)
            self.velocity[k] = v
            if bool(valve[k]) != self.valve[k]:
                # half of the delay nothing moves, then the piston travels
                delay = self.random.uniform(*self.delay)
                self.valve[k] = bool(valve[k])
                self.wait[k] = 0.5 * delay
                self.piston[k] = CLOSED / (0.5 * delay)
            extension = self.extension[k]
            if not pressure_ok:
                extension -= self.leak * h
            else:
                self.wait[k] -= h
                if self.wait[k] <= 0.0:
                    extension += h * self.piston[k] * (1 if self.valve[k] else -1)
            self.extension[k] = min(max(extension, 0.0), CLOSED)

    def measured(self):
        return [round(x / INCREMENT) * INCREMENT for x in self.position]


@dataclass
class Judge:
    """What must never happen, told from the truth; `seen` lists what did."""

    gap_at_home: float = 0.12
    gap_minimum: float = 5e-3
    drag_allowed: float = 0.6e-3
    held_before: bool = False
    touched_at: float | None = None
    seen: set = field(default_factory=set)
    drag: float = 0.0
    gap: float = np.inf

    def look(self, position, extension, enable, both_drives):
        x1, x2 = position[0] + 25e-3, position[1] - 25e-3
        held = max(extension) >= TRUE_GRIP
        self.held_before = enable and (self.held_before or held)
        if self.held_before and not held:
            self.seen.add("not held")
        if not (0.0 <= x1 <= STROKE and -STROKE <= x2 <= 0.0):
            self.seen.add("stroke")
        self.gap = min(self.gap, self.gap_at_home + x2 - x1)
        if self.gap < self.gap_minimum:
            self.seen.add("collision")
        if min(extension) < TRUE_TOUCH or not both_drives:
            self.touched_at = None
            return
        if self.touched_at is None:
            self.touched_at = x1 - x2
        self.drag = max(self.drag, abs(x1 - x2 - self.touched_at))
        if self.drag > self.drag_allowed:
            self.seen.add("dragged")


@dataclass
class Rig:
    """Sequencer and rail together, with the sequencer's sampling: outputs are one period late."""

    sequencer: RegrippingSequencer
    rail: Rail
    judge: Judge
    h: float = 1e-3
    t: float = 0.0
    instrument: float = 0.0
    speed: float = 0.0
    log: list = field(default_factory=list)

    def start(self):
        self.sequencer.start(0.0)
        self.tell()

    def tell(self):
        self.sequencer.position[:] = self.rail.measured()
        self.sequencer.extension[:] = self.rail.extension

    def run(self, seconds, velocity=None, enable=None, pressure_ok=None, drive_ok=None, until=None):
        """Advance with changed inputs; stop early where `until(rig)` holds, and say whether it did."""
        s = self.sequencer
        for name, value in (("target_velocity", velocity), ("enable", enable), ("pressure_ok", pressure_ok)):
            if value is not None:
                setattr(s, name, value)
        if drive_ok is not None:
            s.drive_ok[:] = drive_ok
        for _ in range(round(seconds / self.h)):
            if until is not None and until(self):
                return True
            target, valve = s.gripper_target_velocity.tolist(), s.valve.tolist()
            pressure_ok, enable, drives = bool(s.pressure_ok), bool(s.enable), s.drive_ok.tolist()
            self.tell()
            assert s.advance(self.t, self.h) == OK
            for _ in range(round(self.h / 1e-3)):
                self.rail.advance(1e-3, target, valve, pressure_ok, drives)
                self.judge.look(self.rail.position, self.rail.extension, enable, all(drives))
            self.follow()
            self.t += self.h
        return False

    def follow(self):
        """The instrument goes with whoever holds it."""
        gripping = [v for v, x in zip(self.rail.velocity, self.rail.extension, strict=True) if x >= TRUE_GRIP]
        self.speed = sum(gripping) / len(gripping) if gripping else 0.0
        self.instrument += self.h * self.speed
        s = self.sequencer
        self.log.append(
            (
                self.t,
                self.speed,
                *self.rail.position,
                *self.rail.extension,
                int(s.step_number),
                int(s.leading),
                int(s.state),
                float(s.instrument_target_velocity),
            )
        )

    @property
    def table(self):
        return np.array(self.log)


def make(native, seed=0, lag=(6e-3, 6e-3), delay=(15e-3, 40e-3), leak=0.0, h=1e-3, **parameters):
    """A rig with the compiled sequencer, started."""
    rail = Rail(np.random.default_rng(seed), lag, delay, leak)
    gap = parameters.get("home_distance", 0.18) - parameters.get("carriage_length", 0.06)
    rig = Rig(native(RegrippingSequencer, **parameters), rail, Judge(gap), h)
    rig.start()
    return rig
