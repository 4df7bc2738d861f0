"""A fast model of two carriages on one rail with pneumatic grips, and an independent judge of what happens on it.

Nothing here knows the sequencer's insides: the judge sees true positions and true grips.
"""

from ctypes import c_bool, c_double, c_int32
from dataclasses import dataclass, field
from math import copysign, exp

import numpy as np
from fmus.regripping_sequencer.model import RegrippingSequencer

from twin.component import OK

STEP = 1e-3  # of the rail [s]
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

    def __post_init__(self):
        self.share = [exp(-STEP / lag) for lag in self.lag]  # of the difference in speed, left after a step

    def advance(self, target, valve, pressure_ok, drive_ok):
        h = STEP
        for k in (0, 1):
            # a lost drive brakes by friction alone: 1.5 N on 0.65 kg
            last, wanted = self.velocity[k], target[k]
            if drive_ok[k]:
                v = wanted + (last - wanted) * self.share[k]
            else:
                v = copysign(max(abs(last) - 2.3 * h, 0.0), last)
            self.position[k] += 0.5 * h * (v + last)
            self.velocity[k] = v
            if valve[k] != self.valve[k]:
                # half of the delay nothing moves, then the piston travels
                delay = self.random.uniform(*self.delay)
                self.valve[k] = valve[k]
                self.wait[k] = 0.5 * delay
                self.piston[k] = CLOSED / (0.5 * delay)
            extension = self.extension[k]
            if not pressure_ok:
                extension -= self.leak * h
            else:
                self.wait[k] -= h
                if self.wait[k] <= 0.0:
                    extension += h * self.piston[k] * (1 if self.valve[k] else -1)
            self.extension[k] = 0.0 if extension < 0.0 else min(extension, CLOSED)

    def measured(self):
        first, second = self.position
        return [round(first / INCREMENT) * INCREMENT, round(second / INCREMENT) * INCREMENT]


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
        first, second = extension
        x1, x2 = position[0] + 25e-3, position[1] - 25e-3
        held = first >= TRUE_GRIP or second >= TRUE_GRIP
        self.held_before = enable and (self.held_before or held)
        if self.held_before and not held:
            self.seen.add("not held")
        if not (0.0 <= x1 <= STROKE and -STROKE <= x2 <= 0.0):
            self.seen.add("stroke")
        gap = self.gap_at_home + x2 - x1
        if gap < self.gap:
            self.gap = gap
        if self.gap < self.gap_minimum:
            self.seen.add("collision")
        if first < TRUE_TOUCH or second < TRUE_TOUCH or not both_drives:
            self.touched_at = None
            return
        if self.touched_at is None:
            self.touched_at = x1 - x2
        drag = abs(x1 - x2 - self.touched_at)
        if drag > self.drag:
            self.drag = drag
        if self.drag > self.drag_allowed:
            self.seen.add("dragged")


def places(component):
    """Memory of a component's scalars by name, as C arrays: each step looks at many, ten times as fast as by NumPy."""
    address, dtype = component.record.ctypes.data, component.record.dtype
    kinds = {
        np.dtype(np.float64): c_double,
        np.dtype(np.int32): c_int32,
        np.dtype(bool): c_bool,
        np.dtype(np.int8): c_bool,
    }
    return {
        variable.name: (kinds[dtype[variable.name].base] * variable.size).from_address(
            address + dtype.fields[variable.name][1]
        )
        for variable in component.variables
    }


@dataclass
class Rig:
    """Sequencer and rail together, with the sequencer's sampling: outputs are one period late."""

    sequencer: RegrippingSequencer
    rail: Rail
    judge: Judge
    h: float = STEP
    t: float = 0.0
    instrument: float = 0.0
    speed: float = 0.0
    log: list = field(default_factory=list)  # speed of the instrument, step number, speed wanted of it

    def __post_init__(self):
        self.places = places(self.sequencer)

    def start(self):
        self.sequencer.start(0.0)
        self.tell()

    def tell(self):
        self.places["position"][:] = self.rail.measured()
        self.places["extension"][:] = self.rail.extension

    def run(self, seconds, velocity=None, enable=None, pressure_ok=None, drive_ok=None, until=None):
        """Advance with changed inputs; stop early where `until(rig)` holds, and say whether it did."""
        s, rail, look, h = self.sequencer, self.rail, self.judge.look, self.h
        for name, value in (("target_velocity", velocity), ("enable", enable), ("pressure_ok", pressure_ok)):
            if value is not None:
                setattr(s, name, value)
        if drive_ok is not None:
            s.drive_ok[:] = drive_ok
        pressure_ok, enable, drives = bool(s.pressure_ok), bool(s.enable), s.drive_ok.astype(bool).tolist()
        both, parts = all(drives), range(round(h / STEP))
        targets, valves = self.places["gripper_target_velocity"], self.places["valve"]
        for _ in range(round(seconds / h)):
            if until is not None and until(self):
                return True
            target, valve = targets[:], valves[:]
            self.tell()
            assert s.advance(self.t, h) == OK
            for _ in parts:
                rail.advance(target, valve, pressure_ok, drives)
                look(rail.position, rail.extension, enable, both)
            self.follow()
            self.t += h
        return False

    def follow(self):
        """The instrument goes with whoever holds it."""
        (first, second), (v, w) = self.rail.extension, self.rail.velocity
        if first >= TRUE_GRIP:
            self.speed = 0.5 * (v + w) if second >= TRUE_GRIP else v
        else:
            self.speed = w if second >= TRUE_GRIP else 0.0
        self.instrument += self.h * self.speed
        self.log.append((self.speed, self.places["step_number"][0], self.places["instrument_target_velocity"][0]))

    @property
    def table(self):
        return np.array(self.log)


def make(native, seed=0, lag=(6e-3, 6e-3), delay=(15e-3, 40e-3), leak=0.0, h=STEP, **parameters):
    """A rig with the compiled sequencer, started."""
    rail = Rail(np.random.default_rng(seed), lag, delay, leak)
    gap = parameters.get("home_distance", 0.18) - parameters.get("carriage_length", 0.06)
    rig = Rig(native(RegrippingSequencer, **parameters), rail, Judge(gap), h)
    rig.start()
    return rig
