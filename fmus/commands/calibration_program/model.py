"""Movements of the calibration experiments."""

from math import floor

from fmus.injection import MILLIMETER
from fmus.noisy import Noisy
from twin.component import Boolean, Int32, Int64, input, local, output, parameter, seed_stream, uniform

STEPPERS, LINEAR, DEFLECTION, COUPLING, NEEDLE = 0, 1, 2, 3, 4
SPEEDS = 10
PULLS = 10  # 0 to 9 mm
ADVANCES = 11  # 0 to 20 mm by 2
SLIDES = 18  # needle's slide, 3 to 11.5 mm by 0.5
NEEDLE_PULLS = 5  # 0 to 8 mm by 2


class CalibrationProgram(Noisy):
    """Sends the slides through an experiment of the calibration, one move after the other, with a rest for a reading.

    Cheng and Law (paper B): 0 one revolution both ways at 10 speeds, Fig. 5; 1 random moves of the handle at 5 speeds,
    Fig. 6; 2 pull wire in 1 mm increments, Fig. 7; 3 handle forth and back at every pull, Fig. 8; 4 needle, Fig. 9.
    """

    period = 10e-3

    handle_moving = input("", "whether the handle's slide moves", type=Boolean)
    wire_moving = input("", "whether the wire's slide moves", type=Boolean)
    needle_moving = input("", "whether the needle's slide moves", type=Boolean)

    handle_steps = output("", "position for the handle's slide", type=Int64)
    wire_steps = output("", "position for the wire's slide", type=Int64)
    needle_steps = output("", "position for the needle's slide", type=Int64)
    step_rate = output("Hz", "programmed speed")
    number = output("", "number of the move, from 1", type=Int64)

    experiment = parameter(STEPPERS, "", "0 steppers, 1 linear, 2 deflection, 3 coupling, 4 needle", type=Int32, fixed=True,
                           source="paper, Figs. 5 to 9")
    rest = parameter(0.2, "s", "time at rest before the next move", minimum=0.0,
                     source="chosen: five frames of the camera")
    repeats = parameter(5, "", "how often an experiment is repeated; linear: speeds", type=Int64, minimum=1,
                        source="paper for the speeds, chosen for the others")
    moves = parameter(158, "", "linear: moves at each speed", type=Int64, minimum=1, source="paper, bench top set-up")
    rate_minimum = parameter(250.0, "Hz", "slowest programmed speed", minimum=1.0, source="paper, Fig. 5")
    rate_maximum = parameter(4500.0, "Hz", "fastest programmed speed", minimum=1.0, source="paper, Fig. 5")
    rate = parameter(2000.0, "Hz", "programmed speed of the other experiments", minimum=1.0, source="chosen")
    lead = parameter(7.7e-3, "m", "travel per revolution that the program assumes", display_unit="mm", minimum=1e-6,
                     source="paper, eq. (1)")
    advance_at_rest = parameter(
        15.0, "", "advance [mm] in the deflection experiment",
        source="chosen: there eq. (6) is within 0.03 mm of zero, so that eqs. (4), (5) are seen alone",
    )
    seed = parameter(15, "", "seed of the linear moves", type=Int64, fixed=True, source="arbitrary")

    rested = local(0.0, "s", "time since the last slide came to rest")

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        self.rested = self.rest
        self.number = 0
        self.step_rate = self.rate
        self.handle_steps = 0
        self.wire_steps = 0
        self.needle_steps = 0

    def step(self, t: float, h: float) -> None:
        if self.handle_moving or self.wire_moving or self.needle_moving:
            self.rested = 0.0
            return
        self.rested += h
        if self.rested >= self.rest:
            self.rested = 0.0
            if self.experiment == STEPPERS:
                steppers(self, self.number)
            elif self.experiment == LINEAR:
                linear(self, self.number)
            elif self.experiment == DEFLECTION:
                deflection(self, self.number)
            elif self.experiment == COUPLING:
                forth_and_back(self, self.number)
            else:
                needle(self, self.number)


def steps(self: CalibrationProgram, distance: float) -> int:
    """Convert a distance [mm] to motor steps."""
    return floor(distance * 1600.0 * MILLIMETER / self.lead + 0.5)


def steppers(self: CalibrationProgram, k: int) -> None:
    """One revolution forth and one back, at each speed `repeats` times."""
    if k < 2 * SPEEDS * self.repeats:
        speed = k // (2 * self.repeats)
        self.step_rate = self.rate_minimum + (self.rate_maximum - self.rate_minimum) * speed / (SPEEDS - 1.0)
        self.handle_steps = 1600 * (1 - k % 2)
        self.number += 1


def linear(self: CalibrationProgram, k: int) -> None:
    """Positions from 0 to 20 mm in random order; the same order at each of the speeds."""
    if k < self.moves * self.repeats:
        if k % self.moves == 0:
            seed_stream(self.stream, self.seed)
        span = self.rate_maximum - self.rate_minimum
        self.step_rate = self.rate_minimum + span * (k // self.moves + 1.0) / (self.repeats + 1.0)
        self.handle_steps = steps(self, 20.0 * uniform(self.stream))
        self.number += 1


def deflection(self: CalibrationProgram, k: int) -> None:
    """Pull from 0 to 9 mm, then again from 0."""
    if k < PULLS * self.repeats:
        self.handle_steps = steps(self, self.advance_at_rest)
        self.wire_steps = steps(self, 1.0 * (k % PULLS))
        self.number += 1


def forth_and_back(self: CalibrationProgram, k: int) -> None:
    """At every pull: advance from 0 to 20 mm, and back, in steps of 2 mm."""
    each = 2 * ADVANCES
    if k < PULLS * each:
        index = k % each
        self.wire_steps = steps(self, 1.0 * (k // each))
        self.handle_steps = steps(self, 2.0 * (index if index < ADVANCES else each - 1 - index))
        self.number += 1


def needle(self: CalibrationProgram, k: int) -> None:
    """At every pull: needle out from 3 to 11.5 mm of its slide and in again; then the pull at a slide of 9 mm."""
    each = 2 * SLIDES
    if k < NEEDLE_PULLS * each:
        index = k % each
        self.wire_steps = steps(self, 2.0 * (k // each))
        self.needle_steps = steps(self, 3.0 + 0.5 * (index if index < SLIDES else each - 1 - index))
        self.number += 1
    elif k < NEEDLE_PULLS * each + PULLS:
        # from far back, so that the play is used up by going out
        self.wire_steps = steps(self, 1.0 * (k - NEEDLE_PULLS * each))
        self.needle_steps = steps(self, 9.0)
        self.number += 1
