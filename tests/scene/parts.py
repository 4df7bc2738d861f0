"""A line that swings between the walls of a channel, as a component."""

import math

from twin.component import PythonComponent, output


class Swing(PythonComponent):
    """Three points, of which the last one swings; it touches something while it is above the middle."""

    period = 1e-2

    shape = output("mm", "its points", shape=(3, 2))
    spatial = output("m", "the same in space: y is z here", shape=(3, 3))
    contact_point = output("m", "where it touches", shape=(2, 2))
    contact_force = output("mN", "on it", shape=(2, 2))
    tip = output("m", "its last point", shape=(2,))
    travel = output("m", "how far it is in")
    heart = output("m", "how far the wall is out")

    def initialize(self):
        self.draw(0.0)

    def step(self, t, h):
        self.draw(t + h)

    def draw(self, t):
        y = 2e-3 * math.sin(2.0 * math.pi * t)
        self.shape = [[0.0, 0.0], [50.0, 0.0], [100.0, 1e3 * y]]
        self.spatial = [[0.0, 7.0, 0.0], [0.05, 7.0, 0.0], [0.1, 7.0, y]]
        self.contact_point = [[0.1, y], [0.0, 0.0]]
        self.contact_force = [[0.0, -1e5 * max(y, 0.0)], [0.0, 0.0]]
        self.tip = [0.1, y]
        self.travel = 0.1 + y
        self.heart = y
