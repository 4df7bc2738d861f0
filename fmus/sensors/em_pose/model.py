"""Electromagnetic tracker of a pose."""

from math import cos, floor, pi, sin

from fmus.noisy import Noisy, noise_seed
from twin.component import input, normal, output, parameter, seed_stream, terminal


class EMPose(Noisy):
    """Electromagnetic tracker on the tip of an instrument in its sheath: position in space and roll angle.

    NDI Aurora at 40 Hz. Path of Al-Ahmad et al. (RACS), Fig. 3E: straight along x, a bend towards y, one back, straight on.
    All outputs are 25 ms old when published: compare them with the sampled references, not with the present.
    The roll angle knows no turns, `evaluate.py` counts them.
    """

    period = 25e-3

    path_position = input("m", "length of the path from the sheath's valve to the tip", display_unit="mm", nominal=0.3)
    roll_angle = input("rad", "angle of the tip about the path", display_unit="deg", nominal=4.0)
    path_reference = input("m", "length to sample with it, such as what was commanded", display_unit="mm", nominal=0.3)
    roll_reference = input("rad", "angle to sample with it, such as the frame's", display_unit="deg", nominal=4.0)

    measured_position = output("m", "measured position x, y, z", shape=(3,), display_unit="mm")
    measured_angle = output("rad", "measured roll angle, from -180 to 180 deg", display_unit="deg")
    sampled_path_reference = output("m", "length reference at the instant of the measurement", display_unit="mm")
    sampled_roll_reference = output("rad", "angle reference at the instant of the measurement", display_unit="deg")

    tip = terminal("the tip that it sits on", position=path_position, angle=roll_angle)

    straight_length = parameter(0.343, "m", "path before the first bend", display_unit="mm", minimum=0.0,
                                source="estimate: 500 mm of sheath less two bends, as instrument")
    bend_radius = parameter(0.05, "m", "radius of both bends of 90 deg", display_unit="mm", minimum=1e-3,
                            source="paper, section II.C")
    noise = parameter(
        0.1e-3, "m", "standard deviation of the noise of each axis", display_unit="mm", minimum=0.0,
        source="estimate: jitter 0.1 to 0.3 mm in all; 0.2 per axis would contradict the paper's small error at 5 mm/s",
    )
    angle_noise = parameter(3e-3, "rad", "standard deviation of the noise of the angle", display_unit="deg",
                            minimum=0.0, source="estimate: 0.1 to 0.3 deg")
    seed = noise_seed(5, "the noise")

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        measure(self, 0.0)

    def step(self, t: float, h: float) -> None:
        measure(self, 1.0)


def measure(self: EMPose, noisy: float) -> None:
    """Pose of this instant; the noise times `noisy`."""
    for axis in range(3):
        self.measured_position[axis] = noisy * self.noise * normal(self.stream)
    compute_pose(self)
    angle = self.roll_angle + noisy * self.angle_noise * normal(self.stream)
    self.measured_angle = angle - 2.0 * pi * floor(angle / (2.0 * pi) + 0.5)
    self.sampled_path_reference = self.path_reference
    self.sampled_roll_reference = self.roll_reference


def compute_pose(self: EMPose) -> None:
    """Add the true position of the tip on the path to its noise."""
    radius = self.bend_radius
    bend = 0.5 * pi * radius
    along = self.path_position - self.straight_length
    first = min(max(along, 0.0), bend)
    second = min(max(along - bend, 0.0), bend)
    beyond = max(along - 2.0 * bend, 0.0)
    x = min(self.path_position, self.straight_length)
    x += radius * sin(first / radius) + radius * (1.0 - cos(second / radius)) + beyond
    self.measured_position[0] += x
    self.measured_position[1] += radius * (1.0 - cos(first / radius)) + radius * sin(second / radius)
    self.measured_position[2] += 0.0  # a plane; no noise is 0.0, not -0.0
