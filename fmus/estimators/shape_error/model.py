"""Distance of a reconstructed curve from the true one."""

from math import sqrt

from fmus.gratings import GRATINGS, NODES
from twin.component import Component, Int32, input, local, output, parameter


class ShapeError(Component):
    """How far each node of a curve is from the same node of another, as accuracy of shape sensing is stated.

    Jackle et al. (2019): mean and largest distance along the fiber. Both curves must be given in one frame. An evaluation:
    it sees the truth, so nothing that controls may be connected behind it.
    """

    shape = input("m", "reconstructed curve", shape=(NODES, 3), display_unit="mm", nominal=0.1)
    true_shape = input("m", "true curve in the same frame", shape=(NODES, 3), display_unit="mm", nominal=0.1)

    distance = output("m", "distance at each node; behind the tip: that at the tip", shape=(NODES,), display_unit="mm")
    mean = output("m", "mean of the distances, without the base", display_unit="mm")
    largest = output("m", "largest distance", display_unit="mm")

    count = parameter(38, "", "gratings per core, and nodes behind the base", type=Int32, fixed=True, minimum=4,
                      maximum=GRATINGS, source="as fiber")
    used = local(4, "", "gratings in use: count, as far as there is room", type=Int32)

    def initialize(self) -> None:
        self.used = max(min(self.count, GRATINGS), 4)
        compare(self)

    def step(self, t: float, h: float) -> None:
        compare(self)


def compare(self: ShapeError) -> None:
    """Distances of now."""
    total = 0.0
    largest = 0.0
    for i in range(NODES):
        node = min(i, self.used)
        square = 0.0
        for j in range(3):
            off = self.shape[node, j] - self.true_shape[node, j]
            square += off * off
        self.distance[i] = sqrt(square)
        if 0 < i <= self.used:
            total += self.distance[i]
            largest = max(largest, self.distance[i])
    self.mean = total / self.used
    self.largest = largest
