"""Estimate of the heart motion from the shape-sensing fiber."""

from math import floor, pi, sqrt

from fmus.noisy import Noisy, noise_seed
from twin.component import ERROR, OK, Int64, input, local, normal, output, parameter, seed_stream

LINE = 64


class HeartEstimate(Noisy):
    """A stand-in that looks at the truth: the heart's motion, late and with a smooth error. Not for controllers, see `heart_motion`.

    Error of Al-Ahmad et al. (RACS), section IV.C. The delay is whole periods: 1 to 64 ms, else ERROR.
    """

    period = 1e-3
    buffers = (("latency", LINE),)

    position = input("m", "true wall position", display_unit="mm", nominal=5e-3)
    estimated_position = output("m", "estimated wall position", display_unit="mm")

    latency = parameter(
        11e-3, "s", "age of the estimate when it is published", display_unit="ms", minimum=1e-3, maximum=64e-3,
        source="estimate: interrogator at 250 Hz 4 ms, shape and filter 5 to 10 ms",
    )
    noise = parameter(
        0.5e-3, "m", "standard deviation of the error", display_unit="mm", minimum=0.0,
        source="paper, section IV.C: 0.60 mm against EM, whose own 0.2 mm is taken off",
    )
    noise_frequency = parameter(
        1.0, "Hz", "corner of the error's spectrum", minimum=0.0,
        source="estimate: a quasi-periodic filter follows amplitude and phase over about a cycle",
    )
    seed = noise_seed(2, "the error")

    error = local(0.0, "m", "error of the estimate", display_unit="mm")
    error_rate = local(0.0, "m/s", "rate of the error", display_unit="mm/s")
    line = local(0.0, "m", "positions of the last periods, a ring", shape=(LINE,))
    head = local(0, "", "place of the latest position in the ring", type=Int64)

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        for i in range(LINE):
            self.line[i] = self.position
        self.head = 0
        self.error = 0.0
        self.error_rate = 0.0
        self.estimated_position = self.position

    def step(self, t: float, h: float) -> int:
        # what is published at t + h was sampled at t: one period of age is the least
        age = floor(self.latency / h + 0.5) - 1
        if age < 0 or age >= LINE:
            return ERROR
        self.head = (self.head + 1) % LINE
        self.line[self.head] = self.position

        # e'' + 2 w e' + w^2 e = white noise of density S has variance S / (4 w^3)
        w = 2.0 * pi * self.noise_frequency
        kick = self.noise * sqrt(4.0 * w * w * w * h) * normal(self.stream)
        self.error_rate += h * (-2.0 * w * self.error_rate - w * w * self.error) + kick
        self.error += h * self.error_rate

        self.estimated_position = self.line[(self.head - age + LINE) % LINE] + self.error
        return OK
