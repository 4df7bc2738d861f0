"""Friction of a catheter and a guidewire in a vessel, and in each other."""

from math import exp, sqrt

from fmus.vessel_travel.model import CURVATURE_1, CURVATURE_2, POINTS, SPACING

from twin.component import Component, input, local, output, parameter, terminal

# what rubs on what
CATHETER, WIRE, BETWEEN = 0, 1, 2
CONTACTS = 3


class VesselFriction(Component):
    """Three bristles that slip at Coulomb friction: catheter in vessel, wire in catheter, wire in the vessel beyond it.

    Friction grows with the bends that a tip has passed, and with the thrust in them (capstan), as in vessel_travel.
    Forces act where the instruments enter, lumped; positions go in and nothing else, so it takes a soft bristle at 1 ms.
    """

    catheter_position = input("m", "length of catheter in the vessel", display_unit="mm", nominal=0.3)
    wire_position = input("m", "length of wire in the vessel, with and without catheter around it", display_unit="mm",
                          nominal=0.3)

    catheter_force = output("N", "on the catheter, positive proximal")
    wire_force = output("N", "on the wire, positive proximal")
    wall_force = output("N", "of the vessel on both, positive proximal")
    between_force = output("N", "of the catheter on the wire, positive proximal; of the wire on the catheter its opposite")
    limit = output("N", "friction at which each slips: catheter in vessel, wire in vessel, wire in catheter",
                   shape=(CONTACTS,))

    catheter = terminal("the catheter where it enters", position=catheter_position, force=catheter_force)
    wire = terminal("the wire where it enters", position=wire_position, force=wire_force)

    curvature_1 = parameter(CURVATURE_1, "1/m", "curvature along the first direction, every 20 mm from the entry",
                            source="as vessel_travel")
    curvature_2 = parameter(CURVATURE_2, "1/m", "along the second", source="as vessel_travel")
    dry = parameter((0.5, 0.38, 0.38), "N", "friction per radian of bend, without thrust; contacts as those of limit",
                    minimum=0.0, source="vessel_travel: 0.8 N in pi/2; guidewire's parameter set: 0.6 N in pi/2, PTFE")
    coefficient = parameter((0.15, 0.1, 0.1), "", "friction per normal force of the thrust; contacts as those of limit",
                            minimum=0.0, source="vessel_travel; guidewire's parameter set")
    entry_friction = parameter(0.6, "N", "of the valve at the entry on the catheter", minimum=0.0, source="sheath: 0.6 N")
    viscous = parameter(5.0, "s/m", "viscous part of friction, per speed and dry friction", minimum=0.0,
                        source="sheath: a fifth of the dry friction at 40 mm/s")
    bristle_stiffness = parameter(500.0, "N/m", "stiffness of each contact before it slips", display_unit="N/mm",
                                  minimum=1.0, source="coaxial_friction: no stiffer, so that 1 ms is enough")

    angle = local(0.0, "rad", "bend of the piece before each point of the table", shape=(POINTS,))
    bristle = local(0.0, "m", "elastic deflection of each contact, positive if the instrument is ahead",
                    shape=(CONTACTS,), display_unit="mm")
    catheter_last = local(0.0, "m", "length of catheter in the step before", display_unit="mm")
    wire_last = local(0.0, "m", "length of wire in the step before", display_unit="mm")

    def initialize(self) -> None:
        before = 0.0
        for j in range(POINTS):
            k = sqrt(self.curvature_1[j] * self.curvature_1[j] + self.curvature_2[j] * self.curvature_2[j])
            self.angle[j] = 0.5 * (k + before) * SPACING if j > 0 else 0.0
            before = k
        for c in range(CONTACTS):
            self.bristle[c] = 0.0
        self.catheter_last = self.catheter_position
        self.wire_last = self.wire_position
        measure(self)
        publish(self)

    def step(self, t: float, h: float) -> None:
        catheter = self.catheter_position - self.catheter_last
        wire = self.wire_position - self.wire_last
        self.catheter_last = self.catheter_position
        self.wire_last = self.wire_position
        measure(self)
        give(self, CATHETER, catheter, h)
        give(self, WIRE, wire, h)
        give(self, BETWEEN, wire - catheter, h)
        publish(self)


def measure(self: VesselFriction) -> None:
    """Friction of each contact: gathered from the tip to the entry."""
    shared = min(self.catheter_position, self.wire_position)
    self.limit[CATHETER] = gathered(self, CATHETER, 0.0, self.catheter_position, 0.0)
    if self.catheter_position > 0.0:
        self.limit[CATHETER] += self.entry_friction
    self.limit[WIRE] = gathered(self, WIRE, max(self.catheter_position, 0.0), self.wire_position, 0.0)

    # in the catheter the wire is thrust against its bends by what it meets beyond
    self.limit[BETWEEN] = gathered(self, BETWEEN, 0.0, shared, self.limit[WIRE]) - self.limit[WIRE]


def gathered(self: VesselFriction, c: int, start: float, end: float, force: float) -> float:
    """Thrust at one location of the vessel [m] that moves the instrument between it and another, where a thrust acts [N]."""
    for back in range(POINTS - 1):
        j = POINTS - 1 - back
        low = (j - 1) * SPACING
        length = min(max(end - low, 0.0), SPACING) - min(max(start - low, 0.0), SPACING)
        if length > 0.0:
            bend = self.angle[j] * length / SPACING
            force = (force + self.dry[c] * bend) * exp(self.coefficient[c] * bend)
    return force


def give(self: VesselFriction, c: int, move: float, h: float) -> None:
    """A contact over one step: slip by implicit Euler, |k z| = limit (1 + viscous * slip rate)."""
    self.bristle[c] += move
    stretch = self.limit[c] / self.bristle_stiffness
    excess = abs(self.bristle[c]) - stretch
    if excess > 0.0:
        slip = excess * h / (self.viscous * stretch + h)
        self.bristle[c] -= slip if self.bristle[c] > 0.0 else -slip


def publish(self: VesselFriction) -> None:
    """Equal and opposite between the two."""
    k = self.bristle_stiffness
    self.between_force = k * self.bristle[BETWEEN]
    self.catheter_force = k * self.bristle[CATHETER] - self.between_force
    self.wire_force = k * self.bristle[WIRE] + self.between_force
    self.wall_force = k * (self.bristle[CATHETER] + self.bristle[WIRE])
