"""Small components for the tests of FMUs: one of each kind, every type, and one that fails on demand."""

from math import exp

from twin.component import Component, Int32, Int64, input, local, normal, output, parameter, seed_stream, solver, state


class Masses(Component):
    """Two masses on springs."""

    method = solver.rk4(1e-3)

    push = input("N", "force on both masses", display_unit="mN")
    pushes = input("N", "force on each mass", start=(0.0, 0.0))
    total = output("m", "sum of displacements", display_unit="mm")
    acceleration = output("m/s**2", "acceleration of each mass", shape=(2,))
    stiffness = parameter(10.0, "N/m", "spring stiffness", source="test")
    mass = parameter(0.5, "kg", "mass of one body", fixed=True)
    x = state((0.1, 0.2), "m", "displacement", nominal=0.1)
    v = state((0.0, 0.0), "m/s", "speed")

    def derivatives(self, t):
        for i in range(2):
            self.der_x[i] = self.v[i]
            self.acceleration[i] = (self.push + self.pushes[i] - self.stiffness * self.x[i]) / self.mass
            self.der_v[i] = self.acceleration[i]
        self.total = self.x[0] + self.x[1]


class Stiff(Component):
    """A fast decay after an input, with a state that starts from a parameter."""

    method = solver.ros2(1e-3)

    u = input("", "input")
    y = output("", "output")
    rate = parameter(5000.0, "1/s", "rate of decay")
    first = parameter(0.3, "", "first value")
    x = state(0.0, "", "decaying state")

    def initialize(self):
        self.x = self.first

    def derivatives(self, t):
        self.der_x = self.rate * (exp(-self.x * self.x) * self.u - self.x)
        self.y = self.x + 0.5 * self.u


class Sampler(Component):
    """Counts, draws and holds every 10 ms; all types."""

    period = 0.01

    u = input("V", "voltage", minimum=-5.0, maximum=5.0)
    enable = input("", "counts while true", start=False)
    step_size = input("", "what is counted up", start=1, type=Int32)
    y = output("V", "held voltage with noise")
    active = output("", "whether it counted", start=False)
    count = output("", "count", start=0, type=Int32)
    wide = output("", "count times 2^30", start=0, type=Int64)
    delay = output("V", "last four voltages", shape=(4,))
    seed = parameter(7, "", "seed of the noise", type=Int64, fixed=True)
    noise = parameter(0.1, "V", "standard deviation")
    stream = local((0,) * 6, "", "random-number stream", type=Int64)
    odd = local(False, "", "whether the tick is odd")

    def initialize(self):
        seed_stream(self.stream, self.seed)
        self.y = self.u

    def step(self, t, h):
        self.y = self.u + self.noise * normal(self.stream)
        for i in range(3):
            self.delay[3 - i] = self.delay[2 - i]
        self.delay[0] = self.u
        if self.enable:
            self.count += self.step_size
        self.active = self.enable
        self.odd = not self.odd
        self.wide = self.count * 1073741824


class Failing(Component):
    """Returns the status it is told to."""

    status = input("", "status of the next step", start=0, type=Int32)
    y = output("", "number of steps begun", start=0, type=Int32)

    def step(self, t, h) -> int:
        self.y += 1
        return self.status


PARTS = (Masses, Stiff, Sampler, Failing)
