"""Two masses joined by a spring, cut into two components."""

from twin.component import Component, input, output, parameter, solver, state


class Sprung(Component):
    """A mass on a spring to the wall that gives the force on the coupling spring."""

    mass = parameter(1.0, "kg", "mass", source="assumed")
    stiffness = parameter(10.0, "N/m", "to the wall", source="assumed")
    damping = parameter(0.1, "N.s/m", "to the wall", source="assumed")
    coupling = parameter(1000.0, "N/m", "to the other", source="assumed")
    other = input("m", "position of the other mass")
    x = state(1.0, "m", "position")
    v = state(0.0, "m/s", "velocity")
    force = output("N", "on the other")
    method = solver.rk4(1e-4)

    def derivatives(self, t):
        self.force = self.coupling * (self.x - self.other)
        self.der_x = self.v
        self.der_v = (-self.stiffness * self.x - self.damping * self.v - self.force) / self.mass


class Free(Component):
    """A mass that a force pushes."""

    mass = parameter(1.0, "kg", "mass", source="assumed")
    damping = parameter(0.1, "N.s/m", "damping", source="assumed")
    force = input("N", "force")
    x = state(0.0, "m", "position")
    v = state(0.0, "m/s", "velocity")
    method = solver.rk4(1e-4)

    def derivatives(self, t):
        self.der_x = self.v
        self.der_v = (self.force - self.damping * self.v) / self.mass
