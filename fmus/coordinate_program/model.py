"""Coordinates that the feedforward controller is tested with."""

from math import floor

from twin.component import Component
from twin.noise import seed_stream, uniform
from twin.variable import Int64, local, output, parameter


class CoordinateProgram(Component):
    """Random coordinates one after another, uniform over a rectangle, each held for `dwell`; the first at once.

    Cheng and Law (paper B) tested 26 coordinates, which are not printed.
    """

    period = 10e-3

    target_y = output("m", "wanted tip position across", display_unit="mm")
    target_z = output("m", "wanted tip position along", display_unit="mm")
    target_needle_length = output("m", "wanted needle length", display_unit="mm")
    number = output("", "which coordinate it is, from 1; 0 at the very start", type=Int64)

    dwell = parameter(6.0, "s", "time for each coordinate", minimum=0.01,
                      source="chosen: the longest move and a rest")  # fmt: skip
    y_maximum = parameter(15e-3, "m", "largest y; the least is 0", display_unit="mm", minimum=0.0,
                          source="paper, calibration method")  # fmt: skip
    z_maximum = parameter(20e-3, "m", "largest z; the least is 0", display_unit="mm", minimum=0.0,
                          source="paper, calibration method")  # fmt: skip
    needle_minimum = parameter(3e-3, "m", "least needle length", display_unit="mm", source="paper, Table 2")
    needle_maximum = parameter(5e-3, "m", "largest needle length", display_unit="mm", source="paper, Table 2")
    seed = parameter(14, "", "seed of the coordinates", type=Int64, fixed=True, source="arbitrary")

    stream = local(0, "", "state of the random numbers", type=Int64, shape=(6,))

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        self.target_y = 0.0
        self.target_z = 0.0
        self.target_needle_length = 0.0
        self.number = 0

    def step(self, t: float, h: float) -> None:
        if floor((t + 0.5 * h) / self.dwell) >= self.number:
            self.number += 1
            self.target_y = self.y_maximum * uniform(self.stream)
            self.target_z = self.z_maximum * uniform(self.stream)
            reach = self.needle_maximum - self.needle_minimum
            self.target_needle_length = self.needle_minimum + reach * uniform(self.stream)
