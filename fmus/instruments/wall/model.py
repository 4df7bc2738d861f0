"""Distal section of the instrument on the heart wall."""

from math import sqrt

from twin.component import Component, input, local, output, parameter, solver, state, terminal


class Wall(Component):
    """Contact of the protruding distal section, a cantilever, with the wall's silicone.

    Hunt and Crossley, J. Appl. Mech. 42(2), 1975, in series with the bending stiffness 3 EI / L^3.
    The cantilever belongs here: the wall's 260 N/m on a massless tip would be unstable across an exchange of 1 ms.
    """

    method = solver.rk4(1e-4)
    switches = ("load", "indentation")

    tip_position = input("m", "root of the distal section, positive distal", display_unit="mm", nominal=5e-3)
    heart_position = input("m", "wall position, positive away from the instrument", display_unit="mm", nominal=5e-3)

    force = output("N", "contact force, never negative")
    displacement = output("m", "of the free end by the contact, across it, positive distal", display_unit="mm")

    instrument = terminal("root of the distal section", position=tip_position, force=force)
    heart = terminal("the heart that moves the wall", position=heart_position)

    bending_stiffness = parameter(4.3e-4, "N*m^2", "EI of the distal section", minimum=0.0,
                                  source="Khoshnam, thesis: ablation catheter")
    free_length = parameter(48e-3, "m", "protruding length", display_unit="mm", minimum=1e-3,
                            source="chosen for the stiffness that the paper's force and motion errors imply")
    surface_position = parameter(
        -18.3e-3, "m", "wall surface at heart position zero", display_unit="mm",
        source="chosen: 0.2 N at the start; the velocity loop makes up for any other place",
    )
    tip_radius = parameter(1.33e-3, "m", "radius of the hemispherical tip", display_unit="mm", minimum=0.0,
                           source="8 Fr")
    wall_modulus = parameter(105e3, "Pa", "E* = E / (1 - nu^2) of the silicone", display_unit="kPa", minimum=0.0,
                             source="EcoFlex 00-30 and 00-50, estimate: E 80 kPa")
    dissipation = parameter(8.0, "s/m", "damping force per elastic force and speed", minimum=0.0,
                            source="estimate: 5 to 20 s/m")
    gel_drag = parameter(
        0.1, "N*s/m", "viscous drag of the gel surface", minimum=0.02,
        source="estimate; keeps the speed finite at the first touch, rows do not see it",
    )

    indentation = state(0.0, "m", "indentation of the wall", display_unit="mm", nominal=1e-3)
    load = local(0.0, "N", "what the bent section would press with; below zero it has lost the wall")

    def initialize(self) -> None:
        self.indentation = 0.0

    def derivatives(self, t: float) -> None:
        bending = 3.0 * self.bending_stiffness / (self.free_length * self.free_length * self.free_length)
        approach = self.tip_position - self.heart_position - self.surface_position
        self.load = bending * (approach - self.indentation)

        # Hertz, sphere on half-space [N]
        depth = max(self.indentation, 0.0)
        elastic = 4.0 / 3.0 * self.wall_modulus * sqrt(self.tip_radius * depth) * depth
        self.force = max(self.load, 0.0)
        self.displacement = -self.force / bending

        # contact pushes only: where the tip is off the silicone, that recovers by itself, however far the tip is away
        self.der_indentation = (self.force - elastic) / (self.dissipation * elastic + self.gel_drag)
