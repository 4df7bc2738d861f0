"""Components that tests follow."""

from twin.component import Component, input, output, parameter, solver, state


class VanDerPol(Component):
    """The oscillator of van der Pol, Phil. Mag. 2, 1926, with a force."""

    method = solver.rk4(1e-2)

    u = input("m/s2", "force per mass", start=0.0)
    mu = parameter(1.0, "1/s", "damping", minimum=0.0)
    side = parameter(1.0, "", "only read at the start", fixed=True)
    y = output("m", "position", display_unit="mm")
    x = state(1.0, "m", "position")
    v = state(0.0, "m/s", "velocity")

    def derivatives(self, t):
        self.der_x = self.v
        self.der_v = self.mu * (1.0 - self.x * self.x) * self.v - self.x + self.u
        self.y = self.x


class Mass(Component):
    """A free mass, of which the position is measured: linear."""

    method = solver.rk4(5e-2)

    y = output("m", "position")
    x = state(0.0, "m", "position")
    v = state(0.0, "m/s", "velocity")

    def derivatives(self, t):
        self.der_x = self.v
        self.der_v = 0.0
        self.y = self.x


class Sampler(Component):
    """A sensor that publishes what it sampled 50 ms ago."""

    period = 50e-3

    u = input("m", "measured quantity")
    y = output("m", "sample")

    def step(self, t, h):
        self.y = self.u


class Controller(Component):
    """A sampled controller: a force against the position of 50 ms ago."""

    period = 50e-3

    u = input("m", "measured position")
    y = output("m/s2", "force per mass")

    def step(self, t, h):
        self.y = -0.5 * self.u


class Damper(Component):
    """A sampled controller that damps with an estimated velocity."""

    period = 10e-3

    v = input("m/s", "estimated velocity")
    gain = parameter(4.0, "1/s", "damping")
    u = output("m/s2", "force per mass")

    def step(self, t, h):
        self.u = -self.gain * self.v


class Spring(Component):
    """A spring that hardens, without states."""

    u = input("m", "length")
    k = parameter(0.7, "1/s2", "stiffness per mass")
    y = output("m/s2", "force per mass")

    def derivatives(self, t):
        self.y = -self.k * self.u * (1.0 + self.u * self.u)


class Stiff(Component):
    """A lag, integrated by an implicit method."""

    method = solver.ros2(1e-2)

    y = output("m", "position")
    x = state(1.0, "m", "position")

    def derivatives(self, t):
        self.der_x = -50.0 * self.x
        self.y = self.x
