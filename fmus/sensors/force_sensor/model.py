"""Contact force sensor."""

from math import floor

from twin.component import Component, Int64, input, local, normal, output, parameter, seed_stream


class ForceSensor(Component):
    """Force sensor behind the wall: white noise, then rounding to the sensor's resolution.

    ATI Nano17 SI-12-0.12, one axis. A value is published one period after it was sampled.
    """

    period = 5e-3

    force = input("N", "true contact force", minimum=0.0, maximum=17.0, nominal=0.3)
    measured_force = output("N", "measured contact force")

    noise = parameter(3e-3, "N", "standard deviation of the noise", display_unit="mN", minimum=0.0,
                      source="estimate: about the resolution")
    resolution = parameter(1.0 / 320.0, "N", "smallest step", display_unit="mN", minimum=1e-9,
                           source="Nano17 datasheet, recalled")
    seed = parameter(1, "", "seed of the noise; give every noisy member its own", type=Int64, fixed=True,
                     source="arbitrary")

    stream = local(0, "", "state of the random numbers", type=Int64, shape=(6,))

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        self.measured_force = rounded(self.force, self.resolution)

    def step(self, t: float, h: float) -> None:
        self.measured_force = rounded(self.force + self.noise * normal(self.stream), self.resolution)


def rounded(force: float, resolution: float) -> float:
    """The nearest multiple of the resolution."""
    return resolution * floor(force / resolution + 0.5)
