"""Video tracking of the tip."""

from math import floor

from fmus.noisy import Noisy, noise_seed
from twin.component import input, normal, output, parameter, seed_stream, terminal


class CameraTracker(Noisy):
    """Video camera and Tracker: planar position of the tip's tag and length of the needle, one frame old.

    Cheng and Law (paper B), bench setup. Noise of the tracked center, rounded to what the evaluation resolves.
    """

    period = 40e-3

    tip_y = input("m", "true position across the catheter", display_unit="mm", nominal=10e-3)
    tip_z = input("m", "true position along the catheter", display_unit="mm", nominal=10e-3)
    needle_length = input("m", "true length of the needle outside of the tip", display_unit="mm", nominal=4e-3)

    measured_y = output("m", "measured position across the catheter", display_unit="mm")
    measured_z = output("m", "measured position along the catheter", display_unit="mm")
    measured_needle_length = output("m", "measured length of the needle", display_unit="mm")

    tip = terminal("the tip that is seen", rule="bus", y=tip_y, z=tip_z, needle_length=needle_length)

    noise = parameter(0.02e-3, "m", "standard deviation of each coordinate in a frame", display_unit="mm", minimum=0.0,
                      source="estimate: a fifth of a pixel of 0.1 mm, below the 0.042 mm the paper measured")
    resolution = parameter(0.02e-3, "m", "what a coordinate is rounded to; 0: not at all", display_unit="mm", minimum=0.0,
                           source="estimate: Tracker finds the center of a tag to a fifth of a pixel")
    needle_bias = parameter(0.0, "m", "what the needle is seen too short by", display_unit="mm",
                            source="none; paper, Table 2, would be met on average with 0.095 mm, of unknown cause")
    seed = noise_seed(11, "the noise")

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        self.measured_y = rounded(self.tip_y, self.resolution)
        self.measured_z = rounded(self.tip_z, self.resolution)
        self.measured_needle_length = rounded(self.needle_length - self.needle_bias, self.resolution)

    def step(self, t: float, h: float) -> None:
        self.measured_y = rounded(self.tip_y + self.noise * normal(self.stream), self.resolution)
        self.measured_z = rounded(self.tip_z + self.noise * normal(self.stream), self.resolution)
        self.measured_needle_length = rounded(
            self.needle_length - self.needle_bias + self.noise * normal(self.stream), self.resolution
        )


def rounded(value: float, resolution: float) -> float:
    """The nearest multiple of a resolution."""
    if resolution <= 0.0:
        return value
    return resolution * floor(value / resolution + 0.5)
