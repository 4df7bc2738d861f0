"""Continuum robot of three segments with nine tendons."""

from math import cos, sin, sqrt

from fmus.curves import advance_frame, set_frame
from fmus.estimators.dense import cholesky, solve
from twin.component import Component, input, local, output, parameter

TENDONS = 9
ANGLES = 6  # two bending angles of each of three segments
ITERATIONS = 12  # of the active set; the recordings need at most six
PIECES = 8  # parts of a segment, each short enough for the series of `advance_frame`

FITTED = "assumed; fitted by twin validate"


class TendonSegments(Component):
    """Quasi-static tip position: three arcs of constant curvature with friction, and nine tendons that only pull.

    Webster and Jones, Int. J. Robotics Research 29(13), 2010 (arcs); Camarillo et al., IEEE Trans. Robotics 24(6), 2008
    (tendons in series with bending stiffness, coupling of segments). Tendons of distal segments pass the proximal ones.
    Friction of each segment as a spring that slides (Prandtl). No gravity.
    """

    displacement = input("m", "displacement of the tendons, positive: pulled", display_unit="mm", shape=(TENDONS,), nominal=5e-3)
    tip_x = output("m", "tip position, x", display_unit="mm")
    tip_y = output("m", "tip position, y", display_unit="mm")
    tip_z = output("m", "tip position, z", display_unit="mm")

    radius = parameter((4.5e-3,) * TENDONS, "m", "distance of each tendon from the backbone", display_unit="mm", source=FITTED)
    direction = parameter(
        (-3.0, -0.92, 1.18, -2.45, -0.43, 1.7, -2.0, 0.1, 2.2), "rad", "direction of each tendon about the backbone",
        display_unit="deg", source=FITTED,
    )
    pretension = parameter((0.0,) * TENDONS, "m", "displacement by which each tendon is taut at rest", display_unit="mm",
                           source=FITTED)
    relative_stiffness = parameter((5e-6, 5e-6, 5e-6), "m^2", "bending stiffness of each segment per stiffness of a tendon", source=FITTED)
    rest_angle = parameter((0.0,) * ANGLES, "rad", "bending angles of the segments without tendons", display_unit="deg",
                           source=FITTED)
    friction = parameter((0.0, 0.0, 0.0), "m^2", "largest friction moment of each segment per stiffness of a tendon", minimum=0.0,
                         source=FITTED)
    friction_angle = parameter(0.02, "rad", "bending angle that the friction yields before a segment slides", minimum=1e-6,
                               display_unit="deg", source=FITTED)
    length = parameter((63e-3, 63e-3, 63e-3), "m", "length of each segment", display_unit="mm", source=FITTED)
    base = parameter((0.0, 0.0, 0.0), "m", "position of the base", display_unit="mm", source=FITTED)

    angle = local(0.0, "rad", "bending angles", display_unit="deg", shape=(ANGLES,))
    routing = local(0.0, "m", "shortening of each tendon per bending angle", shape=(TENDONS, ANGLES))
    stiffness = local(0.0, "m^2", "second derivative of the energy per stiffness of a tendon", shape=(ANGLES, ANGLES))
    lower = local(0.0, "m", "its Cholesky factor", shape=(ANGLES, ANGLES))
    moment = local(0.0, "m^2", "right side of the equilibrium", shape=(ANGLES,))
    held = local(0.0, "rad", "bending angles at which friction holds the segments", display_unit="deg", shape=(ANGLES,))
    friction_share = local(0.0, "", "part of the friction that acts: 0 at the start, where its history is unknown")
    frame = local(0.0, "", "directions and position [m] along the backbone", shape=(4, 3))

    def initialize(self) -> None:
        for i in range(ANGLES):
            self.held[i] = self.rest_angle[i]
        self.friction_share = 0.0
        publish(self)
        self.friction_share = 1.0

    def step(self, t: float, h: float) -> None:
        publish(self)


def publish(self: TendonSegments) -> None:
    """Equilibrium, then the tip along three arcs."""
    for j in range(TENDONS):
        for i in range(ANGLES):
            passes = i // 2 <= j // 3
            part = cos(self.direction[j]) if i % 2 == 0 else sin(self.direction[j])
            self.routing[j, i] = self.radius[j] * part if passes else 0.0
    for i in range(ANGLES):
        self.angle[i] = self.rest_angle[i]
    for _ in range(ITERATIONS):
        bend(self)
    slide(self)

    set_frame(self.frame)
    for k in range(3):
        piece = self.length[k] / PIECES
        for _ in range(PIECES):
            advance_frame(self.frame, self.angle[2 * k] / self.length[k], self.angle[2 * k + 1] / self.length[k], piece)
    self.tip_x = self.base[0] + self.frame[3, 0]
    self.tip_y = self.base[1] + self.frame[3, 1]
    self.tip_z = self.base[2] + self.frame[3, 2]


def bend(self: TendonSegments) -> None:
    """Replace the bending angles by the equilibrium with the tendons that are taut at the present angles."""
    for i in range(ANGLES):
        for k in range(ANGLES):
            self.stiffness[i, k] = 0.0
        self.stiffness[i, i] = self.relative_stiffness[i // 2]
        self.moment[i] = self.relative_stiffness[i // 2] * self.rest_angle[i]
    for k in range(3):
        # friction is a spring to the held angles; beyond friction_angle its moment is constant
        stiffness = self.friction_share * self.friction[k] / max(distance_to_held(self, k), self.friction_angle)
        for i in range(2 * k, 2 * k + 2):
            self.stiffness[i, i] += stiffness
            self.moment[i] += stiffness * self.held[i]
    for j in range(TENDONS):
        pull = self.displacement[j] + self.pretension[j]
        stretch = pull
        for i in range(ANGLES):
            stretch -= self.routing[j, i] * self.angle[i]
        if stretch > 0.0:
            for i in range(ANGLES):
                self.moment[i] += pull * self.routing[j, i]
                for k in range(ANGLES):
                    self.stiffness[i, k] += self.routing[j, i] * self.routing[j, k]
    cholesky(self.stiffness, self.lower, ANGLES)
    solve(self.lower, self.moment, ANGLES)
    for i in range(ANGLES):
        self.angle[i] = self.moment[i]


def distance_to_held(self: TendonSegments, k: int) -> float:
    """Angle [rad] between a segment and where friction holds it."""
    first = self.angle[2 * k] - self.held[2 * k]
    second = self.angle[2 * k + 1] - self.held[2 * k + 1]
    return sqrt(first * first + second * second)


def slide(self: TendonSegments) -> None:
    """Take the held angles along with segments beyond what the friction yields."""
    for k in range(3):
        distance = distance_to_held(self, k)
        allowed = self.friction_share * self.friction_angle
        if distance > allowed:
            for i in range(2 * k, 2 * k + 2):
                self.held[i] = self.angle[i] + (self.held[i] - self.angle[i]) * allowed / distance
