"""A load for a motor that is told a force."""

from math import pi, sin

from twin.component import OK, Component, input, output, parameter, terminal


class Spring(Component):
    """A spring that a motor deflects, and the force that the motor is asked for."""

    position = input("m", "deflection")
    load_force = output("N", "force of the spring on the motor")
    target_force = output("N", "force that is asked for")
    rod = terminal("end of the motor's rod", position=position, force=load_force)
    drive = terminal("what the motor is told", target_force=target_force)
    stiffness = parameter(500.0, "N/m", "stiffness", source="chosen: 6 N deflect it by 12 mm")
    amplitude = parameter(6.0, "N", "amplitude of the force that is asked for", source="chosen: half of the limit")
    rate = parameter(2.0, "1/s", "periods in a second", source="chosen: some in a short run")

    def initialize(self) -> None:
        self.load_force = -self.stiffness * self.position
        self.target_force = 0.0

    def step(self, t: float, h: float) -> int:
        self.load_force = -self.stiffness * self.position
        self.target_force = self.amplitude * sin(2.0 * pi * self.rate * (t + h))
        return OK
