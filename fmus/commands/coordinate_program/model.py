"""Coordinates that the feedforward controller is tested with."""

from math import floor

from fmus.noisy import Noisy
from twin.component import Int32, Int64, local, output, parameter, seed_stream, terminal, uniform

RANDOM, NEEDLE_TABLE = 0, 1
PULLS, LENGTHS = 5, 3


class CoordinateProgram(Noisy):
    """Coordinates one after another, each held for `dwell`: random over a rectangle, or the needle table's 15 cases.

    Cheng and Law (paper B) tested 26 coordinates, which are not printed, and Table 2. In random order the needle is
    drawn in before the tip moves and comes out when it rests; in the table's order it stays out, as in the paper.
    """

    period = 10e-3

    target_y = output("m", "wanted tip position across", display_unit="mm")
    target_z = output("m", "wanted tip position along", display_unit="mm")
    target_needle_length = output("m", "wanted needle length", display_unit="mm")
    number = output("", "which coordinate it is, from 1; 0 at the very start", type=Int64)

    target = terminal("wanted coordinate", y=target_y, z=target_z, needle_length=target_needle_length)

    order = parameter(RANDOM, "", "0: random; 1: needle table", type=Int32, fixed=True, source="chosen")
    dwell = parameter(6.0, "s", "time for each coordinate", minimum=0.01,
                      source="chosen: the longest move, the needle and a rest")
    needle_delay = parameter(3.5, "s", "time from the coordinate to the needle", minimum=0.0,
                             source="chosen: the longest move takes 3 s")
    y_maximum = parameter(15e-3, "m", "largest y; the least is 0", display_unit="mm", minimum=0.0,
                          source="paper, calibration method")
    z_maximum = parameter(20e-3, "m", "largest z; the least is 0", display_unit="mm", minimum=0.0,
                          source="paper, calibration method")
    needle_minimum = parameter(3e-3, "m", "least needle length", display_unit="mm", source="paper, Table 2")
    needle_maximum = parameter(5e-3, "m", "largest needle length", display_unit="mm", source="paper, Table 2")
    table_y = parameter(
        (0.0, 1.92e-3, 6.05e-3, 10.82e-3, 14.68e-3), "m", "y of the needle table", display_unit="mm",
        source="eq. (4) at pulls of 0, 2, 4, 6, 8 mm",
    )
    table_z = parameter(9e-3, "m", "z of the needle table", display_unit="mm",
                        source="chosen: 15 mm of advance at the largest pull, where eq. (6) is nearly zero")
    seed = parameter(14, "", "seed of the coordinates", type=Int64, fixed=True, source="arbitrary")

    length = local(0.0, "m", "needle length of this coordinate", display_unit="mm")

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        self.target_y = 0.0
        self.target_z = 0.0
        self.target_needle_length = 0.0
        self.length = 0.0
        self.number = 0

    def step(self, t: float, h: float) -> None:
        if floor((t + 0.5 * h) / self.dwell) >= self.number:
            self.number += 1
            choose(self)
        elif t + 0.5 * h >= (self.number - 1) * self.dwell + self.needle_delay:
            self.target_needle_length = self.length


def choose(self: CoordinateProgram) -> None:
    """The next coordinate."""
    reach = self.needle_maximum - self.needle_minimum
    if self.order == RANDOM:
        self.target_y = self.y_maximum * uniform(self.stream)
        self.target_z = self.z_maximum * uniform(self.stream)
        self.length = self.needle_minimum + reach * uniform(self.stream)
        self.target_needle_length = 0.0
        return
    index = self.number - 1
    self.target_y = self.table_y[index % PULLS]
    self.target_z = self.table_z
    self.length = self.needle_minimum + reach * (min(index // PULLS, LENGTHS - 1) / (LENGTHS - 1.0))

    # a new length begins with the needle drawn in, and is then kept while the tip bends
    if index % PULLS == 0:
        self.target_needle_length = 0.0
