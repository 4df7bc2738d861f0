"""Sleeves that guide an instrument and, closed, hold it: driven along the entry's direction.

Lengths in mm, forces in mN: see `world`.
"""

from __future__ import annotations

import itertools
from math import atan2

import pymunk

from fmus.bodies.walls import FAR, MM, WALL, implicit
from fmus.bodies.world import World, drive

THIN = 0.1  # half thickness of a sleeve [mm]
FLARE = 3.0  # length and width by which its ends open [mm]


class Grip:
    """One sleeve on its carriage. `end`: its distal end on the path at position zero [m]; `room`: beside the instrument."""

    def __init__(self, world: World, end: float, length: float, room: float) -> None:
        self.world, self.length = world, MM * length
        self.body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        self.body.angle = atan2(world.direction[1], world.direction[0])
        self.home = pymunk.Vec2d(*(MM * (world.entry + end * world.direction)))
        self.body.position = self.home
        self.spring: pymunk.DampedSpring | None = None
        self.slipped = 0.0  # of the instrument, positive distal [m]
        world.space.add(self.body)
        half = MM * (0.5 * world.rod.diameter + room) + THIN
        inside, ends = (-self.length, -FLARE), (-self.length - FLARE, 0.0)
        for side in (half, -half):
            wide = side + FLARE * (1.0 if side > 0.0 else -1.0)
            corners = [(ends[0], wide), (inside[0], side), (inside[1], side), (ends[1], wide)]
            for a, b in itertools.pairwise(corners):
                shape = pymunk.Segment(self.body, a, b, THIN)
                shape.friction, shape.filter = 0.0, WALL
                world.space.add(shape)

    def drive(self, position: float, h: float) -> None:
        """Be at a position [m] after h [s]."""
        drive(self.body, self.home, self.world.direction, position, h)

    @property
    def distance(self) -> float:
        """From the spring's far end to the segment that it holds [mm]."""
        assert self.spring is not None
        return float((self.spring.b.position - self.body.local_to_world((-FAR, 0.0))).length)

    @property
    def force(self) -> float:
        """On the instrument, positive distal [N]."""
        if self.spring is None:
            return 0.0
        return float(self.spring.stiffness * (self.spring.rest_length - self.distance)) / MM

    def hold(self, stiffness: float, limits: tuple[float, float]) -> None:
        """Hold with a stiffness [N/m], none: let go; beyond the limits [N], distal and proximal, the instrument slips.

        Update the grips: a stiffening grip keeps its force, a softening one its deflection, so that neither creates energy.
        """
        if stiffness <= 0.0:
            if self.spring is not None:
                self.world.space.remove(self.spring)
                self.spring = None
            return
        if self.spring is None:
            middle = self.body.local_to_world((-0.5 * self.length, 0.0))
            segment = min(self.world.segments, key=lambda part: (part.position - middle).length)
            self.spring = pymunk.DampedSpring(self.body, segment, (-FAR, 0.0), (0.0, 0.0), FAR, stiffness, 0.0)
            self.spring.rest_length = self.distance
            self.world.space.add(self.spring)
            self._stiffen(stiffness)
        elif stiffness != self.spring.stiffness:
            force = self.force * MM
            if stiffness > self.spring.stiffness:
                self.spring.rest_length = self.distance + force / stiffness
            self._stiffen(stiffness)
        distal, proximal = limits
        excess = max(self.force - distal, 0.0) + min(self.force + proximal, 0.0)
        self.spring.rest_length -= excess * MM / stiffness
        self.slipped -= excess / stiffness

    def _stiffen(self, stiffness: float) -> None:
        assert self.spring is not None
        cut = self.world.cut
        self.spring.stiffness = stiffness
        self.spring.damping = implicit(stiffness * cut.relaxation, cut.substep, 1.0 / cut.mass)
