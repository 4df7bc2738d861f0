"""Instrument in its guiding sheath."""

from math import pi

from fmus.dead_zone import dead_zone
from twin.component import Component, input, local, output, parameter, solver, state, terminal

NODES = 3


class Sheath(Component):
    """Transmission from gripper to tip: an overdamped chain of three nodes with play, friction, capstan and drag.

    Geometry of Al-Ahmad et al. (RACS), Fig. 3E: a straight part, then two opposite bends of 90 deg, radius 50 mm.
    Stiff: fastest mode 1.1e4 1/s; explicit substeps above 0.25 ms, or a drag under 1.2 N s/m, are unstable.
    """

    method = solver.rk4(1e-4)

    gripper_position = input("m", "position of the gripped end, positive distal", display_unit="mm", nominal=5e-3)
    contact_force = input("N", "force of the wall on the tip, positive proximal", minimum=0.0, nominal=0.3)

    reaction_force = output("N", "force of the instrument on the gripper, positive distal")
    tip_position = output("m", "end of the sheathed part, positive distal", display_unit="mm")
    tip_velocity = output("m/s", "speed of the end of the sheathed part", display_unit="mm/s")

    gripper = terminal("gripped end", position=gripper_position, force=reaction_force)
    tip = terminal("end of the sheathed part", position=tip_position, force=contact_force)

    stiffness = parameter(
        (2.2e3, 12.0e3, 12.0e3), "N/m", "axial stiffness up to each node", display_unit="N/mm", minimum=1.0,
        source="first: identified from the paper's tracking error without compensation, EA 0.92 kN over 0.42 m; "
        "others: the same EA over a bend's 78.5 mm",
    )
    play = parameter(
        (0.0, 0.3e-3, 0.3e-3), "m", "axial play before each spring", display_unit="mm", minimum=0.0,
        source="clearance 0.19 mm (8 Fr in 2.86 mm) times pi/2 per bend",
    )
    friction = parameter(
        (0.6, 0.8, 0.8), "N", "friction of each node without thrust", minimum=0.0,
        source="estimate: sum an order of magnitude above the contact force, as the paper says; first: valve",
    )
    wrap = parameter((0.0, pi / 2, pi / 2), "rad", "angle a node's part is bent by", display_unit="deg", minimum=0.0,
                     source="paper, section II.C: sheath path")
    friction_coefficient = parameter(0.15, "", "friction per normal force in the bends", minimum=0.0,
                                     source="estimate: 0.05 to 0.2")
    drag = parameter(
        (6.0, 3.0, 3.0), "N*s/m", "viscous friction of each node", minimum=1.2,
        source="estimate: a fifth of the dry friction at 40 mm/s; the weakest-sourced value, rows hardly see it",
    )

    position = state(0.0, "m", "node positions, positive distal", shape=(NODES,), display_unit="mm", nominal=1e-3)
    thrust = local(0.0, "N", "compression before each node, last: at the tip", shape=(NODES + 1,))

    def initialize(self) -> None:
        for i in range(NODES):
            self.position[i] = self.gripper_position

    def derivatives(self, t: float) -> None:
        upstream = self.gripper_position
        for i in range(NODES):
            self.thrust[i] = self.stiffness[i] * dead_zone(upstream - self.position[i], 0.5 * self.play[i])
            upstream = self.position[i]
        self.thrust[NODES] = self.contact_force

        for i in range(NODES):
            # a bend presses the instrument on the sheath by its angle times the thrust
            normal = self.wrap[i] * 0.5 * (abs(self.thrust[i]) + abs(self.thrust[i + 1]))
            limit = self.friction[i] + self.friction_coefficient * normal
            self.der_position[i] = dead_zone(self.thrust[i] - self.thrust[i + 1], limit) / self.drag[i]

        self.reaction_force = -self.thrust[0]
        self.tip_position = self.position[NODES - 1]
        self.tip_velocity = self.der_position[NODES - 1]
