"""Walls of an environment as shapes of a space: rigid walls, and walls on springs.

Lengths in mm, forces in mN: see `world`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log1p

import numpy as np
import pymunk
from numpy.typing import NDArray

from twin.errors import SimulationError
from twin.scene import Environment, Wall

MM = 1e3  # mm in a meter; mN in a newton
FAR = 1e4  # length of the springs that hold a pad: so long that it may move sideways, too [mm]
THIN = 0.01  # half thickness of a wall that is drawn as an outline [mm]
DAMPING = 0.5  # of a wall of which none is given, over stiffness and substep

INSTRUMENT = pymunk.ShapeFilter(categories=1, mask=2)
WALL = pymunk.ShapeFilter(categories=2, mask=1)


def implicit(damping: float, dt: float, mobility: float) -> float:
    """The constant with which Chipmunk's damper brakes as an implicit Euler step of `damping` does.

    Chipmunk multiplies the relative speed by exp(-constant dt mobility); mobility: sum of the inverse masses.
    """
    return log1p(damping * dt * mobility) / (dt * mobility)


@dataclass
class Pad:
    """Compliant wall: a body on springs that are attached to the moving frame."""

    wall: Wall
    carrier: pymunk.Body
    body: pymunk.Body

    def force(self) -> tuple[float, float]:
        """What the instrument does to the wall, by the springs' deflection and its speed [N]."""
        (x, y), (x_0, y_0) = self.body.position, self.carrier.position
        (vx, vy), (vx_0, vy_0) = self.body.velocity, self.carrier.velocity
        k, c = (self.wall.stiffness or 0.0) / MM, (self.wall.damping or 0.0) / MM
        return k * (x - x_0) + c * (vx - vx_0), k * (y - y_0) + c * (vy - vy_0)


def add(
    space: pymunk.Space, environment: Environment, friction: tuple[float, float], mass: float, dt: float
) -> list[Pad]:
    """Add all walls to a space and return the compliant ones.

    `friction`: of rigid walls and of pads that say nothing. `mass` [kg]: that a pad gets. Fixed order, so that runs are alike.
    """
    pads = []
    for wall in environment.walls:
        body = space.static_body
        if wall.stiffness is not None:
            pads.append(suspended(space, wall, mass, dt))
            body = pads[-1].body
        elif wall.moves:
            raise SimulationError(f"{environment.name}: wall `{wall.name}` moves but is rigid. Give it a stiffness.")
        points = (MM * wall.outline).tolist()
        radius = max(0.5 * MM * wall.thickness, THIN)
        last = len(points) - 2
        for i in range(last + 1):
            shape = pymunk.Segment(body, tuple(points[i]), tuple(points[i + 1]), radius)
            before = points[i - 1] if i else points[last if wall.closed else 0]
            behind = points[i + 2] if i < last else points[1 if wall.closed else last + 1]
            shape.set_neighbors(tuple(before), tuple(behind))
            shape.friction = friction[wall.stiffness is not None] if wall.friction is None else wall.friction
            shape.filter = WALL
            space.add(shape)
    return pads


def suspended(space: pymunk.Space, wall: Wall, mass: float, dt: float) -> Pad:
    """A body without rotation on two long springs, at the origin like its carrier."""
    assert wall.stiffness is not None
    carrier = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    body = pymunk.Body(mass, float("inf"))
    space.add(carrier, body)
    damping = wall.stiffness * dt * DAMPING if wall.damping is None else wall.damping
    for anchor in ((-FAR, 0.0), (0.0, -FAR)):
        spring = pymunk.DampedSpring(
            carrier, body, anchor, (0.0, 0.0), FAR, wall.stiffness, implicit(damping, dt, 1.0 / mass)
        )
        space.add(spring)
    return Pad(wall, carrier, body)


def norms(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lengths along the last axis, without BLAS, whose kernels differ from processor to processor in the last bit."""
    return np.asarray(np.sqrt((vectors * vectors).sum(axis=-1)))


def inside(point: NDArray[np.float64], outline: NDArray[np.float64]) -> bool:
    """Whether a point lies within a closed line, by the number of its crossings to one side."""
    (x, y), a, b = point, outline[:-1], outline[1:]
    crosses = (a[:, 1] > y) != (b[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return bool(np.count_nonzero(crosses & (at > x)) % 2)


def distance(points: NDArray[np.float64], outline: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least distance of each point from a line [m]."""
    a, along = outline[:-1], np.diff(outline, axis=0)
    from_a = points[:, None, :] - a
    part = np.clip(np.sum(from_a * along, axis=2) / np.sum(along * along, axis=1), 0.0, 1.0)
    return norms(from_a - part[..., None] * along).min(axis=1)


def refuse_overlap(environment: Environment, nodes: NDArray[np.float64], radius: float, name: str) -> None:
    """An instrument must not begin inside a wall: the solver would shoot it out."""
    for wall in environment.walls:
        room = distance(nodes, wall.outline) - 0.5 * wall.thickness - radius
        if wall.closed:
            room[[inside(node, wall.outline) for node in nodes]] = -radius
        i = int(np.argmin(room))
        if room[i] < -1e-6:
            x, y = 1e3 * nodes[i]
            raise SimulationError(
                f"{name}: the instrument begins {-1e3 * room[i]:.2g} mm inside wall `{wall.name}` of {environment.name}, "
                f"at ({x:.4g}, {y:.4g}) mm. Use a smaller diameter, or draw the path elsewhere."
            )
