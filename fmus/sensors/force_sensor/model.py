"""Contact force sensor."""

from math import floor

from fmus.noisy import Noisy, noise_seed
from twin.component import ERROR, OK, Int64, input, local, normal, output, parameter, seed_stream, uniform

LINE = 32  # periods that a value may wait


class ForceSensor(Noisy):
    """Force sensor behind the wall: zero error, drift and white noise, then rounding to the sensor's resolution.

    ATI Nano17 SI-12-0.12, one axis. The zero error and the drift rate of a run are drawn from the seed at the start. A value
    is published one period after it was sampled, and `latency` later still: whole periods up to 31, else ERROR.
    Temperature, hysteresis and latency are off unless they are set.
    """

    period = 5e-3
    former_names = (("drawn_zero", "initial_zero_error"), ("drawn_drift", "drift_rate"))
    buffers = (("latency", LINE - 1),)

    force = input("N", "true contact force", minimum=0.0, maximum=17.0, nominal=0.3)
    measured_force = output("N", "measured contact force")

    noise = parameter(3e-3, "N", "standard deviation of the noise", display_unit="mN", minimum=0.0,
                      source="estimate: about the resolution")
    resolution = parameter(1.0 / 320.0, "N", "smallest step", display_unit="mN", minimum=1e-9,
                           source="Nano17 datasheet, recalled")
    seed = noise_seed(1, "the noise")

    zero_deviation = parameter(2e-3, "N", "standard deviation of the zero error that is left when a run starts", display_unit="mN",
                               minimum=0.0, source="paper, section V.B: mean errors of 1.6 to 2.0 mN; two thirds of the resolution")
    drift_maximum = parameter(5.0 / 60e3, "N/s", "largest rate at which the zero drifts during a run; drawn evenly from minus that to that",
                              display_unit="mN/min", minimum=0.0, source="estimate: slow drift of 1 to 5 mN/min")
    zero_offset = parameter(0.0, "N", "zero error beyond the one that is drawn", display_unit="mN",
                            source="0: zeroed before each run; a fault")
    drift = parameter(0.0, "N/s", "drift rate beyond the one that is drawn", display_unit="mN/min", source="0: a fault")
    temperature = parameter(293.15, "K", "of the sensor", source="20 degC, where it was zeroed")
    temperature_sensitivity = parameter(0.0, "N/K", "change of the zero per temperature",
                                        source="0: a bench at rest; estimate 5 mN/K, 0.03 % of 17 N")
    hysteresis = parameter(0.0, "N", "difference of the readings under rising and falling force", display_unit="mN",
                           minimum=0.0, source="0: below the noise; estimate 0.1 % of a cycle's force and more with a mount")
    latency = parameter(0.0, "s", "age of a value beyond one period, such as of a filter or a network", display_unit="ms",
                        minimum=0.0, source="0: its own controller reads it")

    initial_zero_error = local(0.0, "N", "zero error of this run, drawn from the seed")
    drift_rate = local(0.0, "N/s", "drift rate of this run, drawn from the seed")
    shown = local(0.0, "N", "force behind the hysteresis")
    line = local(0.0, "N", "values of the last periods, a ring", shape=(LINE,))
    head = local(0, "", "place of the latest value in the ring", type=Int64)

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        self.initial_zero_error = self.zero_deviation * normal(self.stream)
        self.drift_rate = self.drift_maximum * (2.0 * uniform(self.stream) - 1.0)
        self.shown = self.force
        value = rounded(self.force + zero_error(self, 0.0), self.resolution)
        for i in range(LINE):
            self.line[i] = value
        self.head = 0
        self.measured_force = value

    def step(self, t: float, h: float) -> int:
        age = floor(self.latency / h + 0.5)
        if age >= LINE:
            return ERROR

        # play: what is shown stays until the force has gone back by the hysteresis
        self.shown = min(max(self.shown, self.force - 0.5 * self.hysteresis), self.force + 0.5 * self.hysteresis)
        self.head = (self.head + 1) % LINE
        self.line[self.head] = rounded(self.shown + zero_error(self, t) + self.noise * normal(self.stream), self.resolution)
        self.measured_force = self.line[(self.head - age + LINE) % LINE]
        return OK


def zero_error(self: ForceSensor, t: float) -> float:
    """What the sensor shows without any force [N]: zero error, drift and temperature."""
    zero = self.initial_zero_error + self.zero_offset + (self.drift_rate + self.drift) * t
    return zero + self.temperature_sensitivity * (self.temperature - 293.15)


def rounded(force: float, resolution: float) -> float:
    """The nearest multiple of the resolution."""
    return resolution * floor(force / resolution + 0.5)
