"""Coordinates that the omnidirectional catheter is tested with."""

from math import cos, floor, pi, sin, sqrt

from fmus.noisy import Noisy
from twin.component import Int64, output, parameter, seed_stream, terminal, uniform


class OmnidirectionalProgram(Noisy):
    """Random coordinates one after another, uniform over a cylinder, each held for `dwell`.

    After the 26 coordinates of Cheng and Law (paper B), which lay in one plane.
    """

    period = 10e-3

    target_x = output("m", "wanted tip position across", display_unit="mm")
    target_y = output("m", "wanted tip position across", display_unit="mm")
    target_z = output("m", "wanted tip position along", display_unit="mm")
    number = output("", "which coordinate it is, from 1; 0 at the very start", type=Int64)

    target = terminal("wanted coordinate", x=target_x, y=target_y, z=target_z)

    dwell = parameter(6.0, "s", "time for each coordinate", minimum=0.01, source="chosen: the longest move and a rest")
    across_maximum = parameter(15e-3, "m", "radius of the cylinder", display_unit="mm", minimum=0.0,
                               source="paper, calibration method")
    z_maximum = parameter(13.5e-3, "m", "length of the cylinder, from z = 0", display_unit="mm", minimum=0.0,
                          source="chosen: at the largest deflection it takes 20 mm of advance, as far as was measured")
    seed = parameter(17, "", "seed of the coordinates", type=Int64, fixed=True, source="arbitrary")

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        self.target_x = 0.0
        self.target_y = 0.0
        self.target_z = 0.0
        self.number = 0

    def step(self, t: float, h: float) -> None:
        if floor((t + 0.5 * h) / self.dwell) >= self.number:
            self.number += 1
            radius = self.across_maximum * sqrt(uniform(self.stream))
            angle = 2.0 * pi * uniform(self.stream)
            self.target_x = radius * cos(angle)
            self.target_y = radius * sin(angle)
            self.target_z = self.z_maximum * uniform(self.stream)
