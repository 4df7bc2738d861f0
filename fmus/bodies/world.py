"""A world in a plane: an instrument of rigid segments between walls, held by a gripper; Chipmunk's bodies and solver.

Inside lengths are in mm, masses in kg, forces in mN: stiffness in N/m and damping in N s/m are then the same numbers, and
Chipmunk's own constants, made for lengths above 1, are small beside a clearance. Outside all is SI.

Segments touch walls with a disc at each node, as beads on a thread do, not with their sides: in a narrow bend the chord
between two nodes would cut through the inner wall. A wall's feature shorter than a segment is not felt, and beads catch at
a sheath's mouth when bent over it: `sides` is the length at the tip that touches with its sides, too.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from math import atan2, cos, sin

import numpy as np
import pymunk
from numpy.typing import NDArray
from pymunk import batch

from fmus.bodies import walls
from fmus.bodies.rod import ITERATIONS, Rod, Segments, rounded_down
from fmus.bodies.walls import INSTRUMENT, MM, implicit
from twin.errors import SimulationError
from twin.scene import Environment

SLOP = 0.005  # by which contacts may overlap for good [mm]; the clearance in a sheath is 0.1 mm
RECOVERY = 1e-6  # of an overlap beyond that is left after a second
FASTEST = 20.0  # speed of a node that no experiment has [m/s]
FIELDS = batch.BodyFields.POSITION | batch.BodyFields.ANGLE | batch.BodyFields.VELOCITY
FIELDS |= batch.BodyFields.ANGULAR_VELOCITY
CONTACT = batch.ArbiterFields.BODY_A_ID | batch.ArbiterFields.BODY_B_ID | batch.ArbiterFields.TOTAL_IMPULSE
ORIGIN = 0.0, 0.0
COLUMNS = 6  # of these fields: x, y, angle, and their speeds


def along(path: NDArray[np.float64], distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of a line at distances from its beginning [m]; beyond its ends straight on."""
    steps = np.diff(path, axis=0)
    lengths = walls.norms(steps)
    s = np.concatenate(([0.0], np.cumsum(lengths)))
    i = np.clip(np.searchsorted(s, distances, side="right") - 1, 0, len(steps) - 1)
    return path[i] + (distances - s[i])[:, None] * (steps / lengths[:, None])[i]


def length(path: NDArray[np.float64]) -> float:
    """Length of a line [m]."""
    return float(walls.norms(np.diff(path, axis=0)).sum())


def drive(
    body: pymunk.Body, home: tuple[float, float], direction: NDArray[np.float64], position: float, h: float
) -> None:
    """Have a kinematic body at a position [m] along a direction from its home [mm] after h [s]."""
    (x, y), travel = body.position, MM * position
    body.velocity = (home[0] + travel * direction[0] - x) / h, (home[1] + travel * direction[1] - y) / h


class World:
    """Space, instrument and walls; a gripper holds the first node, unless the instrument is laid from behind it.

    `name` begins its messages; `begin`: where on the path the instrument is laid [m], negative: straight before it.
    """

    def __init__(
        self,
        environment: Environment,
        rod: Rod,
        cut: Segments,
        name: str,
        pad_friction: float = 0.0,
        sides: float = 0.0,
        begin: float = 0.0,
    ) -> None:
        self.rod, self.cut, self.name = rod, cut, name
        self.space = pymunk.Space()
        self.space.iterations = ITERATIONS
        self.space.collision_slop = SLOP
        self.space.collision_bias = RECOVERY
        self.time = 0.0
        nodes = along(environment.path, begin + np.arange(cut.count + 1) * cut.length)
        walls.refuse_overlap(environment, nodes, 0.5 * rod.diameter, name)
        self.pads = walls.add(self.space, environment, (rod.friction, pad_friction), cut.mass, cut.substep)
        self.direction, self.entry, self.path = environment.entry_direction, environment.entry, environment.path
        self.gripper = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        self.gripper.position = tuple(MM * nodes[0])
        self.gripper.angle = atan2(self.direction[1], self.direction[0])
        self.start = self.gripper.position
        self.space.add(self.gripper)
        self.segments = self._laid(nodes, cut.count - round(sides / cut.length))
        self.held = begin >= 0.0
        for i in range(0 if self.held else 1, cut.count):
            self._join(i)
        self._buffer, self._contacts = batch.Buffer(), batch.Buffer()
        self._node_of = {body.id: i + 1 for i, body in enumerate(self.segments)}  # by address
        self._steps = np.diff(self.path, axis=0)
        self._lengths = walls.norms(self._steps)
        self._begins = np.concatenate(([0.0], np.cumsum(self._lengths)[:-1]))
        self._reach = np.zeros_like(self._lengths), self._lengths.copy()
        self._reach[0][0], self._reach[1][-1] = -np.inf, np.inf
        self._nodes_mm: NDArray[np.float64] | None = None
        end = nodes[-1:] - nodes[-2]
        self.end = (end / walls.norms(end)[:, None])[0]
        self.tip_start = nodes[-1]
        self.read()

    def _laid(self, nodes: NDArray[np.float64], beads: int) -> list[pymunk.Body]:
        """Segments between nodes, the first ones with a disc at their far end, the others as capsules."""
        cut, bodies = self.cut, []
        half, radius = 0.5 * MM * cut.length, 0.5 * MM * self.rod.diameter
        for i, (a, b) in enumerate(itertools.pairwise(nodes)):
            body = pymunk.Body(cut.mass, cut.moment * MM * MM)
            body.position = tuple(MM * 0.5 * (a + b))
            body.angle = atan2(b[1] - a[1], b[0] - a[0])
            side = pymunk.Segment(body, (-half, 0.0), (half, 0.0), radius)
            shape = side if i >= beads else pymunk.Circle(body, radius, (half, 0.0))
            shape.friction, shape.filter = 1.0, INSTRUMENT  # a wall's own friction counts
            self.space.add(body, shape)
            bodies.append(body)
        return bodies

    def _join(self, i: int) -> None:
        """Joint before segment i: no shear, a spring along the segment before, a spring in bending."""
        cut = self.cut
        l = MM * cut.length
        before, behind = (self.segments[i - 1] if i else self.gripper), self.segments[i]
        at = 0.5 * l if i else 0.0
        mobility, turning = (2.0 if i else 1.0) / cut.mass, (2.0 if i else 1.0) / (cut.moment * MM * MM)
        groove = pymunk.GrooveJoint(before, behind, (at - 0.9 * l, 0.0), (at + l, 0.0), (-0.5 * l, 0.0))
        damping = implicit(cut.axial * cut.relaxation, cut.substep, mobility)
        spring = pymunk.DampedSpring(before, behind, (at - l, 0.0), (-0.5 * l, 0.0), l, cut.axial, damping)
        stiffness = cut.bending[i] * MM * MM
        damping = implicit(stiffness * cut.relaxation, cut.substep, turning)
        bending = pymunk.DampedRotarySpring(before, behind, -cut.rest[i], stiffness, damping)
        self.space.add(groove, spring, bending)

    def step(self, h: float, gripper: float, heart: float = 0.0, load: Sequence[float] = (0.0, 0.0)) -> None:
        """Move the gripper and the heart's walls to new positions [m] within h [s]; load: on the tip [N]."""
        drive(self.gripper, self.start, self.direction, gripper, h)
        for pad in self.pads:
            if pad.wall.moves:
                drive(pad.carrier, ORIGIN, pad.wall.direction, heart, h)
        self.run(h, load)

    def run(self, h: float, load: Sequence[float] = (0.0, 0.0)) -> None:
        """Go on by h [s], in substeps."""
        last, dt, space = self.segments[-1], self.cut.substep, self.space
        count = round(h / dt)
        if abs(count * dt - h) > 1e-9 * h or not count:
            raise SimulationError(
                f"{self.name}: a step of {1e3 * h:g} ms is no multiple of the substep of {1e3 * dt:g} ms. "
                f"Use substep {1e3 * rounded_down(min(h, dt)):g} ms."
            )
        force = MM * load[0], MM * load[1]
        for _ in range(count):
            if any(force):
                last.apply_force_at_world_point(force, last.local_to_world((0.5 * MM * self.cut.length, 0.0)))
            space.step(dt)
        self.time += h
        self.read()

    def settle(self, duration: float) -> None:
        """Let the instrument come to rest where it was laid, before time counts."""
        for _ in range(round(duration / self.cut.substep)):
            self.space.step(self.cut.substep)
        self.read()
        self.time = 0.0
        self.tip_start = np.array(self.end_of(-1, 1.0))

    def read(self) -> None:
        """Take places and speeds out of the space at once: x, y, angle and their speeds, a column for each segment."""
        self._buffer.clear()
        batch.get_space_bodies(self.space, FIELDS, self._buffer)
        every = np.frombuffer(self._buffer.float_buf()).reshape(-1, COLUMNS)
        first = 2 * len(self.pads) + 1  # bodies come in the order in which they were added: pads, gripper, segments
        self.state = every[first : first + self.cut.count].T.copy()
        self._nodes_mm = None
        if not np.abs(self.state[3:5]).max() < FASTEST * MM:  # also what is no number
            raise SimulationError(
                f"{self.name}: the segments flew apart at t = {self.time:.3f} s. Use substep "
                f"{1e3 * rounded_down(0.5 * self.cut.substep):g} ms, less relaxation, or a gripper that does not jump."
            )

    def end_of(self, segment: int, side: float) -> tuple[float, float]:
        """An end of a segment [m]; side: -1 proximal, 1 distal."""
        x, y, angle = self.state[:3, segment].tolist()
        half = 0.5 * side * self.cut.length
        return x / MM + half * cos(angle), y / MM + half * sin(angle)

    @property
    def axes(self) -> NDArray[np.float64]:
        """Direction of each segment, (2, segments)."""
        return np.array((np.cos(self.state[2]), np.sin(self.state[2])))

    @property
    def nodes(self) -> NDArray[np.float64]:
        """Ends of the segments from the gripper to the tip, (2, segments + 1) [m]."""
        if self._nodes_mm is None:
            self._nodes_mm = np.empty((2, self.cut.count + 1))
            self._nodes_mm[:, 1:] = self.state[:2] / MM + 0.5 * self.cut.length * self.axes
            self._nodes_mm[:, 0] = self.end_of(0, -1.0)
        return self._nodes_mm

    @property
    def reaction(self) -> float:
        """Force of the instrument on the gripper, positive distal [N]."""
        (x, y), (x_0, y_0) = self.end_of(0, -1.0), self.gripper.position
        return float(self.cut.axial * ((x - x_0 / MM) * self.direction[0] + (y - y_0 / MM) * self.direction[1]))

    @property
    def tip_travel(self) -> float:
        """Way of the last node along the end of the path since the start [m]."""
        x, y = self.end_of(-1, 1.0)
        return float((x - self.tip_start[0]) * self.end[0] + (y - self.tip_start[1]) * self.end[1])

    def path_lengths(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the path length [m] at the point of the path nearest to each of `points` (n, 2); straight beyond the ends."""
        from_a = points[:, None, :] - self.path[:-1]
        part = np.clip(np.einsum("ijk,jk->ij", from_a, self._steps) / self._lengths, *self._reach)
        away = from_a - (part / self._lengths)[..., None] * self._steps
        nearest = np.einsum("ijk,ijk->ij", away, away).argmin(axis=1)
        return self._begins[nearest] + part[np.arange(len(points)), nearest]

    @property
    def tip_speed(self) -> float:
        """Speed of the last node along the end of the path [m/s]."""
        _, _, angle, vx, vy, turning = self.state[:, -1].tolist()
        x, y = 0.5 * self.cut.length * cos(angle), 0.5 * self.cut.length * sin(angle)
        return float((vx / MM - turning * y) * self.end[0] + (vy / MM + turning * x) * self.end[1])

    def contact_forces(self) -> NDArray[np.float64]:
        """Force of the walls on each node in the last substep, (2, nodes) [N]."""
        self._contacts.clear()
        batch.get_space_arbiters(self.space, CONTACT, self._contacts)
        ids = memoryview(self._contacts.int_buf()).cast("P").tolist()
        impulses = memoryview(self._contacts.float_buf()).cast("d").tolist()
        contacts = []
        for i in range(0, len(ids), 2):
            for node, sign in ((self._node_of.get(ids[i]), 1.0), (self._node_of.get(ids[i + 1]), -1.0)):
                if node is not None:
                    contacts.append((node, sign * impulses[i], sign * impulses[i + 1]))

        # contacts come in the order of addresses: sums are made in one that is always the same
        forces = np.zeros((2, self.cut.count + 1))
        for node, x, y in sorted(contacts):
            forces[0, node] += x
            forces[1, node] += y
        forces /= MM * self.cut.substep
        return forces

    @property
    def thrust(self) -> NDArray[np.float64]:
        """Compression of each joint, from the gripper on [N]."""
        thrust, axes = np.empty(self.cut.count), self.axes
        thrust[0] = -self.reaction if self.held else 0.0
        gap = self.state[:2, 1:] / MM - 0.5 * self.cut.length * axes[:, 1:] - self.nodes[:, 1:-1]
        thrust[1:] = -self.cut.axial * (gap[0] * axes[0, :-1] + gap[1] * axes[1, :-1])
        return thrust

    @property
    def kinetic_energy(self) -> float:
        """Of the scaled masses [J]."""
        vx, vy, turning = self.state[3:]
        moving = self.cut.mass * (vx * vx + vy * vy).sum() / MM**2
        return 0.5 * float(moving + self.cut.moment * (turning * turning).sum())

    @property
    def elastic_energy(self) -> float:
        """In bending and elongation [J]."""
        angles = np.diff(self.state[2], prepend=self.gripper.angle) - self.cut.rest
        if not self.held:
            angles[0] = 0.0
        thrust = self.thrust
        return 0.5 * float((self.cut.bending * angles * angles).sum() + (thrust * thrust).sum() / self.cut.axial)
