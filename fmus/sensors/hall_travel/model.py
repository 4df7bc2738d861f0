"""Travel measured by the grippers' carriages."""

from math import floor, pi, sin

from fmus.noisy import Noisy
from twin.component import (
    Boolean,
    Int64,
    input,
    local,
    normal,
    output,
    parameter,
    seed_stream,
    terminal,
    uniform,
)


class HallTravel(Noisy):
    """Hall sensors of the linear motors: travel of the carriages while holding, summed over strokes.

    Al-Ahmad et al. (RACS), sections III.C and VI. What the instrument does in the gripper, behind it and in the vessel is unseen.
    """

    period = 4e-3

    carriage_travel = input("m", "travel of the grippers' carriages while they hold, positive distal", display_unit="mm",
                            nominal=0.1)

    measured_travel = output("m", "the same as measured, from 0", display_unit="mm")
    age = output("s", "age of the sample when it was published", display_unit="ms")

    hall = terminal("travel by the Hall sensors", measured_travel=measured_travel, age=age)

    resolution = parameter(8e-6, "m", "increment", display_unit="um", minimum=1e-9,
                           source="LM 2070 and MCLM: 3000 increments in a pitch of 24 mm")
    noise = parameter(8e-6, "m", "standard deviation of a sample", display_unit="um", minimum=0.0,
                      source="estimate: one increment")
    linearity = parameter(0.1e-3, "m", "amplitude of the error within a magnetic pitch", display_unit="mm", minimum=0.0,
                          source="estimate: precision of linear DC-servomotors 0.1 to 0.2 mm")
    magnetic_pitch = parameter(24e-3, "m", "of the rod's magnets", display_unit="mm", minimum=1e-3,
                               source="LM 2070 datasheet, recalled")
    stroke = parameter(0.05, "m", "travel after which the other carriage takes over", display_unit="mm", minimum=1e-3,
                       source="paper, section III.C: regripping every 50 mm")
    handover_error = parameter(50e-6, "m", "standard deviation of what a takeover adds", display_unit="um", minimum=0.0,
                               source="regripping_sequencer: carriages match within 0.05 mm")
    stopped = parameter(False, "", "whether the reading stands", type=Boolean, source="false: a fault, set by an event")
    seed = parameter(22, "", "seed of phases and noise", type=Int64, fixed=True, source="arbitrary")

    phase = local(0.0, "rad", "place within a magnetic pitch at first")
    origin = local(0.0, "m", "reading at first", display_unit="mm")
    added = local(0.0, "m", "what takeovers have added", display_unit="mm")
    strokes = local(0, "", "number of the stroke", type=Int64)
    missed = local(0, "", "samples missed in a row", type=Int64)

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        self.phase = 2.0 * pi * uniform(self.stream)
        self.strokes = floor(self.carriage_travel / self.stroke + 0.5)
        self.added = 0.0
        self.missed = 0
        self.origin = self.carriage_travel + self.linearity * sin(
            2.0 * pi * self.carriage_travel / self.magnetic_pitch + self.phase
        )
        self.measured_travel = 0.0
        self.age = 0.0

    def step(self, t: float, h: float) -> None:
        stroke = floor(self.carriage_travel / self.stroke + 0.5)
        if stroke != self.strokes:
            self.strokes = stroke
            self.added += self.handover_error * normal(self.stream)
        error = self.linearity * sin(2.0 * pi * self.carriage_travel / self.magnetic_pitch + self.phase)
        reading = self.carriage_travel + error + self.added - self.origin + self.noise * normal(self.stream)
        if self.stopped:
            self.missed += 1
        else:
            self.missed = 0
            self.measured_travel = self.resolution * floor(reading / self.resolution + 0.5)
        self.age = (self.missed + 1) * h
