"""Instrument of bodies between two grippers, in its guiding sheath."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
from fmus.gripped_instrument import GRIPPERS, GrippedInstrument

from fmus.bodies.grips import Grip
from fmus.bodies.part import RodPart
from fmus.bodies.world import World
from twin.component import output, parameter, terminal


class ChainInGrippers(GrippedInstrument, RodPart):
    """Instrument that two sleeves push in turns: stands where `instrument` stands in a rig, but for torsion.

    In a plane nothing turns: the tip's angle is that of the frame; torques, torsion and angular speed are not used. See `chain` for the instrument.
    """

    former_names = (("valve_place", "valve_position"),)

    environment: ClassVar[str] = "two_bends"

    tip_angle = output("rad", "angle of the tip, that of the frame", display_unit="deg")
    insertion_depth = output("m", "length of the instrument beyond the sheath's valve", display_unit="mm")
    slip_distance = output("m", "slip of the instrument in each gripper, positive distal", shape=(GRIPPERS,),
                           display_unit="mm")

    tip = terminal("tip in the sheath", rule="bus", position=insertion_depth, angle=tip_angle)

    length = parameter(0.7, "m", "length of the instrument", display_unit="mm", minimum=0.1, fixed=True,
                       source="chosen: reaches back behind gripper 1 when it is inserted by 350 mm")
    initial_insertion = parameter(5e-3, "m", "insertion depth at the start", display_unit="mm", minimum=0.0, fixed=True,
                                  source="chosen: the tip in the valve")
    valve_position = parameter(70e-3, "m", "where on the path the sheath begins", display_unit="mm", minimum=0.0, fixed=True,
                               source="two_bends")
    entry_distance = parameter(
        (0.17, 0.04), "m", "from the distal end of each sleeve at mid-stroke to the sheath", display_unit="mm", fixed=True,
        source="as instrument, estimate: half a stroke and 15 mm; carriages 130 mm apart",
    )
    sleeve_length = parameter(0.06, "m", "length of a sleeve", display_unit="mm", minimum=0.01, fixed=True,
                              source="estimate: as braided sleeve")
    sleeve_room = parameter(0.25e-3, "m", "between instrument and open sleeve on either side", display_unit="mm",
                            minimum=0.0, fixed=True, source="Flexo sleeve of 3.18 mm on an instrument of 2.67 mm")

    def rod(self, environment):
        return replace(super().rod(environment), length=float(self.length))

    def _made(self, environment, rod, segments, name):
        begin = float(self.valve_position) + float(self.initial_insertion) - rod.length
        world = World(environment, rod, segments, name, rod.friction, begin=begin)
        ends = [float(self.valve_position) - float(distance) for distance in self.entry_distance]
        self._grips = [Grip(world, end, float(self.sleeve_length), float(self.sleeve_room)) for end in ends]
        for grip, position in zip(self._grips, self.gripper_position, strict=True):
            grip.body.position = grip.home + tuple(1e3 * float(position) * world.direction)
        self._tip_start = world.path_lengths(world.nodes[:, -1:].T)[0]
        return world

    def step(self, t, h):
        for i, grip in enumerate(self._grips):
            grip.hold(float(self.grip_stiffness[i]), (float(self.limit_distal[i]), float(self.limit_proximal[i])))
            grip.drive(float(self.gripper_position[i] + h * self.gripper_velocity[i]), h)
        self._world.run(h)
        self._show(self._world)

    def _show(self, world):
        super()._show(world)
        for i, grip in enumerate(self._grips):
            self.gripper_force[i] = -grip.force
            self.slip_distance[i] = grip.slipped
        self.gripper_torque = 0.0
        self.tip_angle = self.gripper_angle
        self.tip_position = world.path_lengths(np.array([world.end_of(-1, 1.0)]))[0] - self._tip_start
        self.insertion_depth = float(self.initial_insertion) + float(self.tip_position)
