"""Friction between a catheter and the guidewire in it."""

from twin.component import Component, input, local, output, parameter, terminal


class CoaxialFriction(Component):
    """Elastic bristle that slips at Coulomb friction plus viscous drag, both in proportion to the overlap.

    Its force acts on both tips, lumped. What comes out depends on motion through the bristle alone: no stiff coupling.
    """

    wire_position = input("m", "depth of the wire's tip in the sheath", display_unit="mm", nominal=0.3)
    catheter_position = input("m", "depth of the catheter's tip in the sheath", display_unit="mm", nominal=0.3)
    catheter_load = input("N", "what else acts on the catheter's tip, such as a wall, positive proximal", nominal=0.2)

    wire_force = output("N", "on the wire's tip, positive proximal")
    catheter_force = output("N", "on the catheter's tip with its load, positive proximal")
    overlap = output("m", "length of wire in the part of the catheter that is in the sheath", display_unit="mm")
    relative_position = output("m", "wire's tip beyond the catheter's", display_unit="mm")

    wire = terminal("the wire's tip", position=wire_position, force=wire_force)
    catheter = terminal("the catheter's tip", position=catheter_position, force=catheter_force)

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

    bristle = local(0.0, "m", "elastic deflection, positive if the wire is ahead", display_unit="mm")
    apart_last = local(0.0, "m", "wire minus catheter in the step before", display_unit="mm")

    def initialize(self) -> None:
        self.bristle = 0.0
        self.apart_last = self.wire_position - self.catheter_position
        publish(self)

    def step(self, t: float, h: float) -> None:
        apart = self.wire_position - self.catheter_position
        self.bristle += apart - self.apart_last
        self.apart_last = apart
        length = overlapping(self)

        # slip of this step by implicit Euler: |k z| = limit + drag * slip rate
        limit = self.friction * length / self.bristle_stiffness
        drag = self.viscosity * length / self.bristle_stiffness
        excess = abs(self.bristle) - limit
        if excess > 0.0:
            slip = excess * h / (drag + h)
            self.bristle -= slip if self.bristle > 0.0 else -slip
        publish(self)


def overlapping(self: CoaxialFriction) -> float:
    """Length in which they touch [m]: as deep as the one that is less deep."""
    return max(min(self.wire_position, self.catheter_position), 0.0)


def publish(self: CoaxialFriction) -> None:
    """Equal and opposite forces, and the catheter's load with its own."""
    self.wire_force = self.bristle_stiffness * self.bristle
    self.catheter_force = self.catheter_load - self.wire_force
    self.overlap = overlapping(self)
    self.relative_position = self.wire_position - self.catheter_position
