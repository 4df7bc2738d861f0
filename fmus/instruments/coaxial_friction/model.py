"""Friction between a catheter and the guidewire in it."""

from math import sqrt

from twin.component import Component, input, local, output, parameter, terminal


class CoaxialFriction(Component):
    """Elastic bristle that slips at Coulomb friction plus viscous drag, both in proportion to the overlap.

    The bristle bends along the wire and around it, and slips in the one direction of its force: turning eases pushing.

    Its force acts on both tips, lumped. What comes out depends on motion through the bristle alone: no stiff coupling.
    """

    former_names = (("apart_last", "last_separation"),)

    wire_position = input("m", "depth of the wire's tip in the sheath", display_unit="mm", nominal=0.3)
    catheter_position = input("m", "depth of the catheter's tip in the sheath", display_unit="mm", nominal=0.3)
    catheter_load = input("N", "what else acts on the catheter's tip, such as a wall, positive proximal", nominal=0.2)

    wire_angle = input("rad", "angle of the wire's tip", display_unit="deg", nominal=1.0)
    catheter_angle = input("rad", "angle of the catheter's tip", display_unit="deg", nominal=1.0)

    wire_force = output("N", "on the wire's tip, positive proximal")
    catheter_force = output("N", "on the catheter's tip with its load, positive proximal")
    wire_torque = output("N*m", "on the wire's tip, positive against positive angles", display_unit="mN*m")
    catheter_torque = output("N*m", "on the catheter's tip, positive against positive angles", display_unit="mN*m")
    overlap = output("m", "length of wire in the part of the catheter that is in the sheath", display_unit="mm")
    relative_position = output("m", "wire's tip beyond the catheter's", display_unit="mm")

    wire = terminal("the wire's tip", position=wire_position, angle=wire_angle, force=wire_force, torque=wire_torque)
    catheter = terminal(
        "the catheter's tip", position=catheter_position, angle=catheter_angle, force=catheter_force, torque=catheter_torque,
    )

    friction = parameter(
        2.4, "N/m", "dry friction per length of overlap", minimum=0.0,
        source="guidewire's parameter set: 0.6 N in each of two bends, spread over 500 mm",
    )
    viscosity = parameter(6.0, "N*s/m^2", "viscous drag per length of overlap", minimum=0.0,
                          source="guidewire's parameter set: 3 N s/m in the bends, over 500 mm")
    bristle_stiffness = parameter(
        500.0, "N/m", "stiffness before it slips", display_unit="N/mm", minimum=1.0,
        source="chosen: 2.4 mm at 1.2 N, as the wire's lateral play in the bends; no stiffer, so that 1 ms is enough",
    )

    radius = parameter(0.45e-3, "m", "radius of the wire, on which they touch", display_unit="mm", minimum=0.0,
                       source="paper, section III.A: guidewire of 0.9 mm")

    bristle = local(0.0, "m", "elastic deflection, positive if the wire is ahead", display_unit="mm")
    bristle_around = local(0.0, "m", "the same around the wire, positive if the wire is turned ahead", display_unit="mm")
    turned_last = local(0.0, "rad", "wire minus catheter in the step before", display_unit="deg")
    last_separation = local(0.0, "m", "wire minus catheter in the step before", display_unit="mm")

    def initialize(self) -> None:
        self.bristle = 0.0
        self.bristle_around = 0.0
        self.turned_last = self.wire_angle - self.catheter_angle
        self.last_separation = self.wire_position - self.catheter_position
        publish(self)

    def step(self, t: float, h: float) -> None:
        separation = self.wire_position - self.catheter_position
        self.bristle += separation - self.last_separation
        self.last_separation = separation
        turned = self.wire_angle - self.catheter_angle
        self.bristle_around += self.radius * (turned - self.turned_last)
        self.turned_last = turned
        length = overlapping(self)

        # slip of this step by implicit Euler: |k z| = limit + drag * slip rate
        limit = self.friction * length / self.bristle_stiffness
        drag = self.viscosity * length / self.bristle_stiffness
        around = self.bristle_around
        size = abs(self.bristle) if around == 0.0 else sqrt(self.bristle * self.bristle + around * around)
        excess = size - limit
        if excess > 0.0:
            slip = excess * h / (drag + h)
            along = slip if around == 0.0 else slip * abs(self.bristle) / size
            self.bristle -= along if self.bristle > 0.0 else -along
            self.bristle_around -= slip * around / size
        publish(self)


def overlapping(self: CoaxialFriction) -> float:
    """Length in which they touch [m]: as deep as the one that is less deep."""
    return max(min(self.wire_position, self.catheter_position), 0.0)


def publish(self: CoaxialFriction) -> None:
    """Equal and opposite forces, and the catheter's load with its own."""
    self.wire_force = self.bristle_stiffness * self.bristle
    self.catheter_force = self.catheter_load - self.wire_force
    self.wire_torque = self.radius * self.bristle_stiffness * self.bristle_around
    self.catheter_torque = -self.wire_torque
    self.overlap = overlapping(self)
    self.relative_position = self.wire_position - self.catheter_position
