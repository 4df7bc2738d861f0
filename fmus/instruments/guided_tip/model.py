"""Curve of an instrument guided by a sheath."""

from math import cos, floor, sin

from fmus.curves import advance_frame, put_node, set_frame
from fmus.gratings import GRATINGS, NODES
from twin.component import Component, Int32, input, local, output, parameter, terminal

SEGMENTS = 6
SUPPORTS = 3  # where the sheath's model knows how far the instrument has come
PARTS = 2  # integration steps per pitch


class GuidedTip(Component):
    """The true curve of an instrument: it takes the shape of the sheath at rest around it, and its free end bends.

    Idea of Al-Ahmad et al. (RACS), section IV.C; path of section II.C. The universal frame is that of the base at travel 0:
    tangent along z. Travel differs along the instrument, by play and compression: its curve is not simply shifted.
    """

    travel = input("m", "how far the instrument has come at each support, positive distal", shape=(SUPPORTS,),
                   display_unit="mm", nominal=5e-3)
    displacement = input("m", "of the tip across the free end, along both directions", shape=(2,), display_unit="mm",
                         nominal=2e-3)

    curvature = output("1/m", "curvature along both directions, mean over each grating", shape=(GRATINGS, 2))
    shape = output("m", "curve in the universal frame: base, then each pitch; behind the tip: the tip", shape=(NODES, 3),
                   display_unit="mm")
    tip_position = output("m", "tip in the universal frame", shape=(3,), display_unit="mm")

    bending = terminal("what lies in it", curvature=curvature)

    count = parameter(38, "", "gratings along it", type=Int32, fixed=True, minimum=4, maximum=GRATINGS,
                      source="as fiber")
    pitch = parameter(10e-3, "m", "distance of gratings; the length is count times this", display_unit="mm",
                      minimum=1e-3, fixed=True, source="as fiber")
    grating_length = parameter(5e-3, "m", "length that a grating averages over", display_unit="mm", minimum=1e-4,
                               source="estimate: draw-tower gratings have 1 to 10 mm")
    segment_length = parameter(
        (203e-3, 78.5e-3, 78.5e-3, 1.0, 1.0, 1.0), "m", "length of each part of the path, from the base at travel 0",
        display_unit="mm", minimum=0.0, source="paper, section II.C: straight, bend, bend back, straight; 38 gratings "
        "reach 203 mm before the first bend and protrude 20 mm",
    )
    segment_curvature = parameter((0.0, 20.0, 20.0, 0.0, 0.0, 0.0), "1/m", "of each part", minimum=0.0,
                                  source="paper, section II.C: bends of radius 50 mm")
    segment_angle = parameter((0.0, 0.0, 3.141592653589793, 0.0, 0.0, 0.0), "rad", "direction of each part's bending",
                              display_unit="deg", source="paper, section II.C: opposite bends in a plane")
    blend_length = parameter(
        15e-3, "m", "over which curvature changes from part to part, linearly", display_unit="mm", minimum=1e-4,
        source="clearance 0.19 mm in a bend of 50 mm lets a stiff body spread a change over sqrt(24 R c), as a road's "
        "transition curve",
    )
    support_location = parameter((0.203, 0.2815, 0.36), "m", "where the supports are at travel 0", display_unit="mm",
                                 source="sheath: nodes before, between and behind the bends")
    free_length = parameter(20e-3, "m", "distal part that is outside of the sheath", display_unit="mm", minimum=1e-3,
                            source="estimate: protrudes slightly, paper, section IV.B")

    across = local(0.0, "1/m", "change of curvature where each part begins", shape=(SEGMENTS, 2))
    begin = local(0.0, "m", "where each part begins on the path", shape=(SEGMENTS,))
    gained = local(0.0, "", "travel that is gained per length before each support", shape=(SUPPORTS,))
    frame = local(0.0, "", "directions, tangent and position [m] along the curve", shape=(4, 3))
    tangent = local(0.0, "", "tangents of the curve", shape=(NODES, 3))
    used = local(4, "", "gratings in use: count, as far as there is room", type=Int32)

    def initialize(self) -> None:
        self.used = max(min(self.count, GRATINGS), 4)
        begin = 0.0
        before_1 = before_2 = 0.0
        for i in range(SEGMENTS):
            self.begin[i] = begin
            begin += self.segment_length[i]
            k1 = self.segment_curvature[i] * cos(self.segment_angle[i])
            k2 = self.segment_curvature[i] * sin(self.segment_angle[i])
            self.across[i, 0] = k1 - before_1
            self.across[i, 1] = k2 - before_2
            before_1 = k1
            before_2 = k2
        follow(self)

    def step(self, t: float, h: float) -> None:
        follow(self)


def follow(self: GuidedTip) -> None:
    """Curvature at the gratings and the curve, for the travel of now."""
    for i in range(1, SUPPORTS):
        length = self.support_location[i] - self.support_location[i - 1]
        self.gained[i] = (self.travel[i] - self.travel[i - 1]) / length if length > 0.0 else 0.0
    for i in range(self.used):
        k1, k2 = bent(self, (i + 0.5) * self.pitch, self.grating_length)
        self.curvature[i, 0] = k1
        self.curvature[i, 1] = k2
    for i in range(self.used, GRATINGS):
        for c in range(2):
            self.curvature[i, c] = 0.0

    # to the base, which has left the origin
    set_frame(self.frame)
    steps = 1 + floor(abs(self.travel[0]) / self.pitch)
    part = self.travel[0] / steps
    for i in range(steps):
        k1, k2 = path_curvature(self, (i + 0.5) * part, self.pitch)
        advance_frame(self.frame, k1, k2, part)

    put_node(self.frame, self.shape, self.tangent, 0)
    part = self.pitch / PARTS
    for i in range(self.used):
        for k in range(PARTS):
            k1, k2 = bent(self, i * self.pitch + (k + 0.5) * part, part)
            advance_frame(self.frame, k1, k2, part)
        put_node(self.frame, self.shape, self.tangent, i + 1)
    for i in range(self.used + 1, NODES):
        put_node(self.frame, self.shape, self.tangent, i)
    for j in range(3):
        self.tip_position[j] = self.frame[3, j]


def carried(self: GuidedTip, location: float) -> float:
    """How far the instrument has come at a location [m] along it."""
    if location <= self.support_location[0]:
        return self.travel[0]
    for i in range(1, SUPPORTS):
        if location < self.support_location[i]:
            return self.travel[i - 1] + (location - self.support_location[i - 1]) * self.gained[i]
    return self.travel[SUPPORTS - 1]


def bent(self: GuidedTip, location: float, length: float) -> tuple[float, float]:
    """Mean curvature [1/m] over a length about a location along the instrument: the path's there, and the free end's."""
    k1, k2 = path_curvature(self, location + carried(self, location), length)

    left = self.used * self.pitch - location
    if left - 0.5 * length < self.free_length + self.blend_length:
        per_displacement = (
            overhung(self, left + 0.5 * length) - overhung(self, max(left - 0.5 * length, 0.0))
        ) / length
        k1 += per_displacement * self.displacement[0]
        k2 += per_displacement * self.displacement[1]
    return k1, k2


def overhung(self: GuidedTip, left: float) -> float:
    """Angle per displacement [rad/m] between the tip and a point before it: a cantilever with a compliant clamp.

    The curvature rises from the tip, where the load is, to where the sheath ends, and falls to 0 over a blend inside of it.
    """
    free = self.free_length
    blend = self.blend_length
    size = 6.0 / ((2.0 * free + blend) * (free + blend))
    if left <= free:
        return size * left * left / (2.0 * free)
    inside = min(left - free, blend)
    return size * (0.5 * free + inside - inside * inside / (2.0 * blend))


def path_curvature(self: GuidedTip, location: float, length: float) -> tuple[float, float]:
    """Mean curvature [1/m] over a length about a location on the path."""
    k1 = k2 = 0.0
    half = 0.5 * length
    reach = half + 0.5 * self.blend_length
    for i in range(SEGMENTS):
        distance = location - self.begin[i]
        if distance <= -reach:
            break
        share = 1.0
        if distance < reach:
            share = (risen(distance + half, self.blend_length) - risen(distance - half, self.blend_length)) / length
        k1 += share * self.across[i, 0]
        k2 += share * self.across[i, 1]
    return k1, k2


def risen(distance: float, blend: float) -> float:
    """Integral [m] of a ramp from 0 to 1 over the length `blend` about 0."""
    if distance <= -0.5 * blend:
        return 0.0
    if distance >= 0.5 * blend:
        return distance
    over = distance + 0.5 * blend
    return 0.5 * over * over / blend
