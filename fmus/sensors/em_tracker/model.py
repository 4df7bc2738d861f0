"""Electromagnetic tracker."""

from twin.component import Component, Int64, input, local, normal, output, parameter, seed_stream


class EMTracker(Component):
    """Electromagnetic tracker on the tip, along the line of motion, with a reference sampled at the same instant.

    NDI Aurora at 40 Hz. Both outputs are 25 ms old when published: compare them with each other, not with the present.
    """

    period = 25e-3

    position = input("m", "true position of the tracked sensor", display_unit="mm", nominal=5e-3)
    reference = input("m", "signal to sample with it, such as the gripper's position", display_unit="mm", nominal=5e-3)

    measured_position = output("m", "measured position", display_unit="mm")
    sampled_reference = output("m", "reference at the instant of the measurement", display_unit="mm")
    difference = output("m", "sampled reference minus measured position", display_unit="mm")

    noise = parameter(0.2e-3, "m", "standard deviation of the noise", display_unit="mm", minimum=0.0,
                      source="estimate: jitter 0.1 to 0.3 mm")
    seed = parameter(3, "", "seed of the noise; give every noisy member its own", type=Int64, fixed=True,
                     source="arbitrary")

    stream = local(0, "", "state of the random numbers", type=Int64, shape=(6,))

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        self.measured_position = self.position
        self.sampled_reference = self.reference
        self.difference = self.reference - self.position

    def step(self, t: float, h: float) -> None:
        self.measured_position = self.position + self.noise * normal(self.stream)
        self.sampled_reference = self.reference
        self.difference = self.sampled_reference - self.measured_position
