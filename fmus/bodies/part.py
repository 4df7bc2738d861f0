"""Base of components with an instrument of bodies: its parameters, its world and its outputs."""

from __future__ import annotations

from dataclasses import fields
from typing import ClassVar

import numpy as np

from fmus.bodies.rod import Rod, Segments, cut
from fmus.bodies.world import World, length
from twin.component import Int32, PythonComponent, Role, input, local, output, parameter
from twin.scene import Environment, read_environment

POINTS = 61  # of the shape that is shown, however many segments there are


# fmt: off
class RodPart(PythonComponent):
    """An instrument in an environment."""

    environment: ClassVar[str] = "two_bends"

    tip_position = output("m", "way of the tip along the end of the path, positive distal", display_unit="mm")
    tip_velocity = output("m/s", "its speed", display_unit="mm/s")
    shape = local(0.0, "m", "places along the instrument, from the gripper to the tip", shape=(POINTS, 2), display_unit="mm")
    support_force = local(0.0, "N", "force of the walls on the instrument at these places", shape=(POINTS, 2))
    kinetic_energy = local(0.0, "J", "of the bodies, mass scaling included")
    elastic_energy = local(0.0, "J", "in bending and elongation")
    mass_scale = local(1.0, "", "mass of the bodies over that of the instrument, as the substep needs it")
    lowest_mode = local(0.0, "Hz", "lowest axial mode of the bodies, gripper held and tip free")

    segments = parameter(60, "", "number of rigid segments", type=Int32, minimum=2, fixed=True)
    substep = parameter(0.25e-3, "s", "step of the bodies", display_unit="ms", minimum=1e-7, fixed=True,
                        source="chosen: mass scale 15 with 60 segments, and three times real time")
    largest_mass_scale = parameter(20.0, "", "mass scale at which a longer substep is refused", minimum=1.0, fixed=True,
                                   source="chosen: inertia then stays below a tenth of the friction")
    settling = parameter(0.3, "s", "time to come to rest before the start", minimum=0.0, fixed=True,
                         source="chosen: the rest is below 1 mN after it")
    diameter = parameter(2.67e-3, "m", "outer diameter", display_unit="mm", minimum=1e-5, fixed=True, source="8 Fr")
    density = parameter(8e-3, "kg/m", "mass per length", display_unit="g/m", minimum=1e-6, fixed=True,
                        source="estimate: 5.6 mm^2 of polymer, braid and wires at 1.5 g/cm^3")
    axial_stiffness = parameter(920.0, "N", "EA of the braided shaft", minimum=1e-3, fixed=True,
                                source="sheath: identified there from the paper's tracking error without compensation")
    bending_stiffness = parameter(2e-3, "N*m^2", "EI of the shaft", minimum=1e-9, fixed=True,
                                  source="instrument: estimate, 1 to 3e-3 for an 8 Fr shaft")
    tip_bending_stiffness = parameter(4.3e-4, "N*m^2", "EI of the tip", minimum=1e-9, fixed=True,
                                      source="Khoshnam, thesis: ablation catheter")
    tip_length = parameter(48e-3, "m", "length of the soft tip", display_unit="mm", minimum=0.0, fixed=True,
                           source="wall: protruding length")
    tip_curvature = parameter(0.0, "1/m", "curvature of the tip at rest, positive to the left", fixed=True,
                              source="straight: no curve is reported")
    curvature = parameter(0.1, "1/m", "curvature of the shaft at rest, positive to the left", fixed=True,
                          source="estimate: 1 mm over 300 mm; a perfectly straight rod would not buckle")
    friction = parameter(0.15, "", "friction at walls that have none of their own", minimum=0.0, fixed=True,
                         source="estimate: 0.05 to 0.2")
    relaxation = parameter(0.5e-3, "s", "damping over stiffness of the instrument, at least one substep, at most four",
                           display_unit="ms", minimum=0.0, fixed=True,
                           source="estimate: loss factor 0.03 at 10 Hz; more than numerical damping is not seen")
    picture_period = parameter(5e-3, "s", "how often shape, forces on it and energies are brought up to date",
                               display_unit="ms", minimum=0.0, fixed=True, source="chosen: as often as scenarios record")
    # fmt: on

    _world: World | None = None
    _key = b""
    _next = 0.0  # when the picture is due [s]

    def initialize(self) -> None:
        """Lay the instrument and let it settle: anew if a parameter has changed or time has passed."""
        key = b"".join(self.views[v.name].tobytes() for v in self.variables if v.role is Role.parameter)
        if self._world is None or self._world.time or key != self._key:
            environment, name = read_environment(self.environment), type(self).__module__.split(".")[-2]
            rod = self.rod(environment)
            segments = cut(rod, float(self.substep), float(self.largest_mass_scale), name)
            self._world, self._key = self._made(environment, rod, segments, name), key
            self.mass_scale, self.lowest_mode = segments.mass_scale, segments.lowest_mode
            self._world.settle(float(self.settling))
        self._next = 0.0
        self._show(self._world)

    def _made(self, environment: Environment, rod: Rod, segments: Segments, name: str) -> World:
        return World(environment, rod, segments, name, rod.friction)

    def rod(self, environment: Environment) -> Rod:
        """The instrument as the parameters say, as long as the environment's path."""
        names = (field.name for field in fields(Rod) if field.name not in ("length", "segments"))
        values = {name: float(getattr(self, name)) for name in names}
        return Rod(length=length(environment.path), segments=int(self.segments), **values)

    def _show(self, world: World) -> None:
        """Write the outputs that all components of bodies share."""
        self.tip_position = world.tip_travel
        self.tip_velocity = world.tip_speed
        if world.time >= self._next - 1e-9:
            self._next = world.time + float(self.picture_period)
            self._draw(world)

    def _draw(self, world: World) -> None:
        """Write the outputs for scenes and plots: energies, shape and support forces."""
        self.kinetic_energy, self.elastic_energy = world.kinetic_energy, world.elastic_energy
        forces = world.contact_forces()
        if world.nodes.shape[1] == POINTS:
            self.shape, self.support_force = world.nodes.T, forces.T
            return
        fraction, every = np.linspace(0.0, 1.0, POINTS), np.linspace(0.0, 1.0, world.nodes.shape[1])
        nearest = np.rint(every * (POINTS - 1)).astype(int)
        for i in (0, 1):
            self.shape[:, i] = np.interp(fraction, every, world.nodes[i])
            self.support_force[:, i] = np.bincount(nearest, forces[i], POINTS)


class HeldRodPart(RodPart):
    """An instrument whose first node a gripper holds and moves."""

    gripper_position = input("m", "position of the gripped end, positive distal", display_unit="mm", nominal=5e-3)

    reaction_force = output("N", "force of the instrument on the gripper, positive distal")

    def _move(self, h: float, heart: float = 0.0, tip_force: float = 0.0) -> None:
        """Go on by h [s]."""
        assert self._world is not None
        load = -tip_force * self._world.end if tip_force else (0.0, 0.0)
        self._world.step(h, float(self.gripper_position), heart, load)
        self._show(self._world)

    def _show(self, world: World) -> None:
        super()._show(world)
        self.reaction_force = world.reaction
