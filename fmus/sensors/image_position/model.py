"""Position of the tip from images."""

from math import floor

from fmus.noisy import Noisy, noise_seed
from twin.component import (
    ERROR,
    OK,
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

LINE = 64


class ImagePosition(Noisy):
    """Tip position that an imaging system finds: few frames, noise, late, some frames without the tip.

    For ultrasound or biplane fluoroscopy as Cheng and Law (paper B) propose. The latency is whole periods, 1 to 64, else ERROR.
    """

    period = 20e-3
    former_names = (("found", "latest"),)
    buffers = (("latency", LINE),)

    tip_x = input("m", "true tip position", display_unit="mm", nominal=8e-3)
    tip_y = input("m", "true tip position", display_unit="mm", nominal=8e-3)
    tip_z = input("m", "true tip position", display_unit="mm", nominal=8e-3)
    blind = input("", "whether the images do not show the tip", type=Boolean)

    measured_x = output("m", "tip position of the latest frame", display_unit="mm")
    measured_y = output("m", "tip position of the latest frame", display_unit="mm")
    measured_z = output("m", "tip position of the latest frame", display_unit="mm")
    frame = output("", "number of the latest frame with a position, from 1; 0: none yet", type=Int64)
    valid = output("", "whether the latest frame had one", type=Boolean)

    tip = terminal("the tip that is seen", x=tip_x, y=tip_y, z=tip_z)
    image = terminal("latest frame", rule="bus", x=measured_x, y=measured_y, z=measured_z, frame=frame, valid=valid)

    frame_period = parameter(0.5, "s", "time between frames", minimum=0.02,
                             source="issue: 2 Hz; segmentation of volume ultrasound, recalled: 1 to 10 Hz")
    latency = parameter(0.3, "s", "age of a frame when it is published", minimum=0.02, maximum=1.28,
                        source="estimate: acquisition 0.1 s, segmentation 0.1 to 0.3 s")
    noise = parameter(0.5e-3, "m", "standard deviation of a coordinate", display_unit="mm", minimum=0.0,
                      source="issue: 0.5 mm; tips in volume ultrasound, recalled: 0.5 to 2 mm")
    loss = parameter(0.05, "", "part of the frames in which the tip is not found", minimum=0.0, maximum=1.0,
                     source="estimate: a few in a hundred")
    seed = noise_seed(19, "the noise")

    line = local(0.0, "m", "measured positions that wait for their latency, a ring: x, y, z, kind", shape=(LINE, 4))
    latest = local(0.0, "m", "position of the latest frame: x, y, z", shape=(3,))
    head = local(0, "", "place of the latest in the ring", type=Int64)
    frames = local(0, "", "frames taken", type=Int64)

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        for i in range(LINE):
            self.line[i, 3] = 0.0  # no frame: the other columns are never read
        self.head = 0
        self.frames = 0
        for i in range(3):
            self.latest[i] = 0.0
        publish(self)
        self.frame = 0
        self.valid = True

    def step(self, t: float, h: float) -> int:
        # what is published at t + h was taken at t: one period of age is the least
        age = floor(self.latency / h + 0.5) - 1
        if age < 0 or age >= LINE:
            return ERROR
        self.head = (self.head + 1) % LINE
        self.line[self.head, 3] = 0.0
        if floor((t + 0.5 * h) / self.frame_period) >= self.frames:
            self.frames += 1
            is_detected = uniform(self.stream) >= self.loss and not self.blind
            self.line[self.head, 0] = self.tip_x + self.noise * normal(self.stream)
            self.line[self.head, 1] = self.tip_y + self.noise * normal(self.stream)
            self.line[self.head, 2] = self.tip_z + self.noise * normal(self.stream)
            self.line[self.head, 3] = 1.0 if is_detected else -1.0

        due = (self.head - age + LINE) % LINE
        if self.line[due, 3] != 0.0:
            self.valid = self.line[due, 3] > 0.0
        if self.line[due, 3] > 0.0:
            for i in range(3):
                self.latest[i] = self.line[due, i]
            self.frame += 1
        publish(self)
        return OK


def publish(self: ImagePosition) -> None:
    """Outputs from the memory."""
    self.measured_x = self.latest[0]
    self.measured_y = self.latest[1]
    self.measured_z = self.latest[2]
