"""Instrument of bodies in its guiding sheath."""

from typing import ClassVar

import numpy as np

from fmus.bodies.part import HeldRodPart
from twin.component import input, local, parameter, terminal

SUPPORTS = 3


class Chain(HeldRodPart):
    """Transmission from gripper to tip: a chain of rigid segments with elastic joints, in contact with the sheath's walls.

    Stands where `sheath` stands: the same inputs and outputs. Hysteresis comes from contact, none is put in.
    The gripper reaches a communication point's position at the end of the step, one step later than `sheath` has it.
    """

    environment: ClassVar[str] = "two_bends"

    contact_force = input("N", "force of the wall on the tip, positive proximal", minimum=0.0, nominal=0.3)

    position = local(0.0, "m", "way of the instrument at its supports, as sheath's nodes have it", shape=(SUPPORTS,),
                     display_unit="mm")

    support_distance = parameter(
        (157e-3, 78.5e-3, 0.0), "m", "from the end of the path back to each support, at the start", display_unit="mm",
        minimum=0.0, fixed=True, source="two_bends: before, between and behind the bends, as sheath",
    )

    gripper = terminal("gripped end", position=HeldRodPart.gripper_position, force=HeldRodPart.reaction_force)
    tip = terminal("end of the sheathed part", position=HeldRodPart.tip_position, force=contact_force)

    def _made(self, environment, rod, segments, name):
        world = super()._made(environment, rod, segments, name)
        self._nodes = segments.count - np.rint(self.support_distance / segments.length).astype(int)
        self._starts = None
        return world

    def _show(self, world):
        super()._show(world)
        lengths = world.path_lengths(world.nodes[:, self._nodes].T)
        if self._starts is None:
            self._starts = lengths
        self.position = lengths - self._starts

    def step(self, t, h):
        self._move(h, tip_force=float(self.contact_force))
