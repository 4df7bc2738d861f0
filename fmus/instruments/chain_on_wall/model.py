"""Instrument of bodies in its guiding sheath and on a moving wall."""

from typing import ClassVar

import numpy as np

from fmus.bodies.part import HeldRodPart
from fmus.bodies.world import World
from fmus.gratings import GRATINGS
from twin.component import Int32, input, output, parameter, terminal


class ChainOnWall(HeldRodPart):
    """Instrument from the gripper to the wall that the heart moves: stands where `sheath` and `wall` stand together.

    How it bends on the wall, slides there and leaves it comes from contact; see `chain` for the instrument.
    """

    environment: ClassVar[str] = "heart_wall"

    heart_position = input("m", "wall position, positive away from the instrument", display_unit="mm", nominal=5e-3)

    force = output("N", "contact force along the wall's motion, never negative")
    wall_force = output("N", "contact force on walls that give way, along x and y", shape=(2,))

    fiber_curvature = output("1/m", "curvature at the gratings of a fiber that ends at the tip: none, and to the left; mean over each",
                             shape=(GRATINGS, 2))

    wall_friction = parameter(0.0, "", "friction at walls that give way", minimum=0.0, fixed=True,
                              source="as in wall, which leaves it out; gel-covered silicone: 0 to 0.3")

    side_length = parameter(60e-3, "m", "length at the tip that touches walls with its sides, not with nodes alone",
                            display_unit="mm", minimum=0.0, fixed=True,
                            source="chosen: what protrudes and the sheath's straight end; nodes would catch at its mouth")

    count = parameter(38, "", "gratings of the fiber", type=Int32, minimum=4, maximum=GRATINGS, fixed=True, source="as fiber")
    pitch = parameter(10e-3, "m", "distance of gratings; the last is half of it from the tip", display_unit="mm", minimum=1e-3,
                      fixed=True, source="as fiber")
    grating_length = parameter(5e-3, "m", "length that a grating averages over", display_unit="mm", minimum=1e-4,
                               source="as guided_tip")

    bending = terminal("the fiber in it", curvature=fiber_curvature)
    gripper = terminal("gripped end", position=HeldRodPart.gripper_position, force=HeldRodPart.reaction_force)
    heart = terminal("the heart that moves the wall", position=heart_position)

    def step(self, t, h):
        self._move(h, heart=float(self.heart_position))

    def _made(self, environment, rod, segments, name):
        return World(environment, rod, segments, name, float(self.wall_friction), float(self.side_length))

    def _show(self, world):
        super()._show(world)
        forces = [(pad.force(), pad.wall.direction) for pad in world.pads]
        self.wall_force = [sum(force[axis] for force, _ in forces) for axis in (0, 1)]
        self._bend(world)
        self.force = sum(max(x * direction[0] + y * direction[1], 0.0) for (x, y), direction in forces)

    def _bend(self, world):
        # directions change from middle to middle of the segments, evenly
        middles = (np.arange(world.cut.count) + 0.5) * world.cut.length
        positions = world.rod.length - (self.count - 0.5 - np.arange(self.count)) * self.pitch
        ends = [np.interp(positions + side * self.grating_length, middles, world.state[2]) for side in (-0.5, 0.5)]
        self.fiber_curvature[: self.count, 1] = (ends[1] - ends[0]) / self.grating_length
