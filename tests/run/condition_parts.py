"""Components of the tests of conditions: outputs of all types that grow with time, and what reads them."""

from twin.component import Component, input, output


class Ramp(Component):
    """Numbers that grow with time."""

    period = 1e-3

    y = output("mm", "time")
    on = output("", "whether 30 ms are over", type="Boolean")
    count = output("", "steps made", type="Int32")
    p = output("m", "one, two and three times the time", shape=(3,))
    q = output("", "zeros", shape=(2,))

    def initialize(self):
        self.y = 0.0
        self.on = False
        self.count = 0
        for i in range(3):
            self.p[i] = 0.0
        for i in range(2):
            self.q[i] = 0.0

    def step(self, t, h):
        self.count = self.count + 1
        self.y = 1e3 * (t + h)
        self.on = t + h > 0.0299
        for i in range(3):
            self.p[i] = (i + 1) * (t + h)


class End(Component):
    """First of the numbers that it gets."""

    period = 1e-3

    q = input("", "numbers", shape=(2,))
    y = output("", "the first")

    def initialize(self):
        self.y = 0.0

    def step(self, t, h):
        self.y = self.q[0]
