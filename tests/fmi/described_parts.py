"""A continuous and a sampled component with every kind of variable, whose descriptions are tested to the letter."""

from twin.component import Boolean, Component, Int32, Int64, input, local, output, parameter, state


class Swinging(Component):
    """Two masses on springs. Their mean follows the force at once."""

    f = input("N", "force", start=1.0, minimum=-5.0, maximum=5.0)
    many = input("", "whole number", type=Int32, start=2, minimum=0, maximum=7)
    on = input("", "whether it moves", type=Boolean, start=True)
    mean = output("m", "mean position", display_unit="mm")
    energy = output("J", "of both")
    k = parameter((2.0, 3.0), "N/m", "stiffness", source="assumed", nominal=2.5)
    size = parameter(1.5, "m", "length at rest", source="assumed", fixed=True)
    x = state((0.1, 0.2), "m", "positions", nominal=0.5)
    v = state((0.0, 0.0), "m/s", "velocities")
    margin = local(0.0, "m", "way to the stop")
    switches = ("margin",)

    def initialize(self):
        self.energy = 0.5 * self.k[0] * self.x[0] * self.x[0]

    def derivatives(self, t):
        for i in range(2):
            self.der_x[i] = self.v[i]
            self.der_v[i] = self.f - self.k[i] * self.x[i]
        self.mean = 0.5 * (self.x[0] + self.x[1]) + 0.0 * self.f
        self.energy = 0.5 * self.v[0] * self.v[0]
        self.margin = self.size - self.x[0]


class Counting(Component):
    """Counts "ticks" <of> 5 ms & more."""

    period = 5e-3

    reset = input("", "sets it to zero", type=Boolean)
    u = input("V", "voltage", shape=(2,))
    ticks = output("", "ticks so far", type=Int64)
    high = output("", "whether the voltage is high", type=Boolean)
    limit = parameter(3.0, "V", "limit?", source="assumed", minimum=0.0)
    stream = local(7, "", "state of a generator", type=Int64)

    def initialize(self):
        self.ticks = 0
        self.high = False

    def step(self, t, h):
        self.ticks = 0 if self.reset else self.ticks + 1
        self.high = self.u[0] + self.u[1] > self.limit
