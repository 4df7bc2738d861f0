"""Tip of a bending instrument on an inclined, viscoelastic wall."""

from math import cos, exp, pi, sin, sqrt

from twin.component import ERROR, OK, Component, Int64, input, local, output, parameter, terminal

LINKS = 24  # of the discrete elastica: its give is that of the continuous one to 0.3 %
TERMS = 2  # of the relaxation
ITERATIONS = 40  # of Newton's method; three are usual
STRIDE = 2e-4  # m of approach that one solution may be away from the last
STRIDES = 2000
HALVINGS = 64.0  # of a stride at whose end nothing agrees, where the tip starts, stops or is lost
STUCK = 1e3  # N/m: weight of a stuck tip's place among the equations
CLOSE = 1e-9  # rest of the equations, as part of EI / L^2
REFERENCE = 1e-3  # m: indentation at which `indentation_force` is given


class TipContact(Component):
    """Contact of the protruding distal section with the wall, bent as far as it likes: stands where `wall` stands.

    Elastica as a chain of links; Hertz on a layer (Dimitriadis et al., Biophys. J. 82, 2002), quasi-linear relaxation (Fung);
    Coulomb friction. The tip alone touches: with `clearance` below zero the section lies on the wall, which is not here.
    """

    former_names = (("kept", "relaxed_force"),)

    tip_position = input("m", "root of the distal section, positive distal", display_unit="mm", nominal=5e-3)
    heart_position = input("m", "wall position, positive away from the instrument", display_unit="mm", nominal=5e-3)

    force = output("N", "contact force along the root's axis; pulls only where friction drags the tip along")
    displacement = output("m", "of the tip by the contact, across the root's axis; negative is away from it, as in wall", display_unit="mm")
    normal_force = output("N", "contact force along the wall's normal, never negative")
    friction_force = output("N", "contact force along the wall, positive against a tip that slides as it gives way")
    indentation = output("m", "of the wall along its normal; negative without contact", display_unit="mm")
    slip = output("m", "place of the tip along the wall, positive the way it gives", display_unit="mm")
    clearance = output("rad", "angle between tip and wall", display_unit="deg")

    instrument = terminal("root of the distal section", position=tip_position, force=force)
    heart = terminal("the heart that moves the wall", position=heart_position)

    bending_stiffness = parameter(4.3e-4, "N*m^2", "EI of the distal section", minimum=1e-9, source="as wall: Khoshnam, thesis")
    free_length = parameter(48e-3, "m", "protruding length", display_unit="mm", minimum=1e-3, source="as wall")
    curvature = parameter(0.5, "1/m", "of the section at rest, towards the side to which the wall pushes it",
                          source="estimate: 0.6 mm over 48 mm; says to which side a head-on column buckles")  # fmt: skip
    contact_angle = parameter(pi / 6, "rad", "between the root's axis and the wall's normal; 0: head on", display_unit="deg",
                              minimum=0.0, maximum=1.4, source="estimate: 30 deg; at 45 deg the section lies down on the wall from 0.21 N on")
    surface_position = parameter(-10.52e-3, "m", "root at which the straight tip touches, heart at zero", display_unit="mm",
                                 source="chosen: 0.2 N at the start")
    tip_radius = parameter(1.33e-3, "m", "radius of the hemispherical tip", display_unit="mm", minimum=0.0, source="8 Fr")
    indentation_force = parameter(
        0.161, "N", "lasting force at 1 mm of indentation of a half-space", minimum=0.0,
        source="Hertz with E* 105 kPa as wall: EcoFlex 00-30 and 00-50; porcine heart 0.12 N (Iijima: 0.11 to 0.14 N/mm)",
    )
    exponent = parameter(1.5, "", "of the force over the indentation", minimum=1.0, maximum=4.0,
                         source="Hertz; porcine heart 1, as linear as one can read (Iijima: 6.9 mm at 80 g)")
    layer_thickness = parameter(2e-3, "m", "thickness of the bonded, incompressible layer", display_unit="mm", minimum=1e-4,
                                source="paper, section V.A: 2 mm of EcoFlex; a large one is a half-space")
    dissipation = parameter(8.0, "s/m", "damping force per elastic force and speed (Hunt and Crossley)", minimum=0.0,
                            source="as wall: estimate, 5 to 20 s/m")
    relaxation = parameter((0.0, 0.0), "", "force just after an indentation beyond the lasting one, as part of it, by term", minimum=0.0,
                           source="stretched before, EcoFlex hardly relaxes (Liao et al., 2020)")
    relaxation_time = parameter((0.5, 30.0), "s", "time constant by term", minimum=1e-3, source="estimate: see README")
    friction = parameter(0.1, "", "friction coefficient at the wall", minimum=0.0, maximum=1.0,
                         source="estimate: gel-covered silicone 0 to 0.3; wet endocardium 0.05")
    slip_drag = parameter(1.0, "s/m", "friction coefficient gained per sliding speed", minimum=1e-2,
                          source="estimate: 0.04 at the 40 mm/s of a heart; must not be 0, a tip that starts would leap")

    # solution of the last step
    tip_angle = local(0.0, "rad", "of the last link against the root's axis", display_unit="deg")
    load_along = local(0.0, "N", "on the tip, along the root's axis, positive distal")
    load_across = local(0.0, "N", "on the tip, across it, to the side to which it gives")
    approach = local(0.0, "m", "of the root since the straight tip touched", display_unit="mm")
    deep = local(0.0, "m", "depth of the tip", display_unit="mm")
    far = local(0.0, "m", "its place along the wall", display_unit="mm")
    elastic = local(0.0, "N", "lasting force of the indentation")
    strained = local(0.0, "N", "what has not relaxed yet, by term", shape=(TERMS,))
    sliding = local(0, "", "1: the tip slides the way it gives, -1: back, 0: it sticks", type=Int64)

    # scratch of one solution: tip and its derivatives by tip angle and load
    row_x = local(0.0, "m", "x of the tip, then its derivatives", shape=(4,))
    row_y = local(0.0, "m", "y of the tip, then its derivatives", shape=(4,))
    row_root = local(0.0, "rad", "angle that is missing at the root, then its derivatives", shape=(4,))
    moment = local(0.0, "", "bending moment over EI / L, then its derivatives", shape=(4,))
    turn = local(0.0, "rad", "angle of a link, then its derivatives", shape=(4,))
    relaxed_force = local(0.0, "N", "of the strain, at the end of the step")
    gain = local(1.0, "", "force per lasting force, of what is added in the step")
    pressed = local(0.0, "N", "force of the tissue")
    stiffness = local(0.0, "N/m", "its slope over the depth")
    matrix = local(0.0, "", "of Newton's equations, the right side last", shape=(3, 4))

    def initialize(self) -> None:
        self.tip_angle = self.curvature * self.free_length
        self.load_along = 0.0
        self.load_across = 0.0
        self.approach = 0.0
        self.elastic = 0.0
        self.sliding = 1
        for i in range(TERMS):
            self.strained[i] = 0.0
        bend(self)
        self.far = tip_along_wall(self, 0.0)
        self.deep = depth(self, 0.0)
        carry(self, 1.0)  # what is left of the way is gone in the first step, which fails if it cannot be

    def step(self, t: float, h: float) -> int:
        return carry(self, h)


def carry(self: TipContact, h: float) -> int:
    """Bring root and wall to where the inputs are, in strides that Newton's method follows."""
    begin = self.approach
    approach_distance = self.tip_position - self.heart_position - self.surface_position - begin
    if not abs(approach_distance) <= STRIDE * STRIDES:
        return ERROR
    rest, part = 1.0, min(1.0, STRIDE / max(abs(approach_distance), STRIDE))
    smallest = part / HALVINGS
    while rest > 0.0:
        if rest < 1.5 * part:  # no last stride of almost nothing
            part = rest
        self.approach = begin + approach_distance * (1.0 - (rest - part))
        if solve(self, h * part) == OK:
            rest -= part
        elif part > smallest:
            part *= 0.5
        else:
            return ERROR
    self.force = -self.load_along if self.pressed > 0.0 else 0.0
    self.normal_force = self.pressed
    self.friction_force = tangential(self, self.load_along, self.load_across)
    self.indentation = self.deep
    self.slip = self.far
    self.displacement = self.curvature * 0.5 * self.free_length * self.free_length - self.row_y[0]
    self.clearance = 0.5 * pi - self.contact_angle - self.tip_angle
    return OK


def bend(self: TipContact) -> None:
    """Tip of the chain of links under its load and the residual of the clamped root, with all derivatives.

    From the tip to the root, so that nothing is searched for: the moment at a joint is that of the load on what lies before it.
    """
    length = self.free_length
    scale = length * length / self.bending_stiffness
    along, across = scale * self.load_along, scale * self.load_across
    link = 1.0 / LINKS
    for k in range(4):
        self.row_x[k] = 0.0
        self.row_y[k] = 0.0
        self.moment[k] = 0.0
        self.turn[k] = 0.0
    self.turn[0] = self.tip_angle
    self.turn[1] = 1.0
    for i in range(LINKS):
        c, s = cos(self.turn[0]), sin(self.turn[0])
        arm = -link * (s * across + c * along)
        self.row_x[0] += link * length * c
        self.row_y[0] += link * length * s
        self.moment[0] += link * (c * across - s * along)
        for k in range(1, 4):
            self.row_x[k] -= link * length * s * self.turn[k]
            self.row_y[k] += link * length * c * self.turn[k]
            self.moment[k] += arm * self.turn[k]
        self.moment[2] -= link * s * scale
        self.moment[3] += link * c * scale

        # from link to link a whole turn; the first link is half a length from the clamp
        part = link if i < LINKS - 1 else 0.5 * link
        self.turn[0] -= part * (self.moment[0] + length * self.curvature)
        for k in range(1, 4):
            self.turn[k] -= part * self.moment[k]
    for k in range(4):
        self.row_root[k] = self.turn[k]


def depth(self: TipContact, approach: float) -> float:
    """How far the tip is in the wall, along its normal [m]."""
    return cos(self.contact_angle) * (approach + self.row_x[0] - self.free_length) - sin(self.contact_angle) * self.row_y[0]


def tip_along_wall(self: TipContact, approach: float) -> float:
    """Where the tip is along the wall [m]."""
    return sin(self.contact_angle) * (approach + self.row_x[0] - self.free_length) + cos(self.contact_angle) * self.row_y[0]


def lasting(self: TipContact, depth: float) -> tuple[float, float]:
    """Force of an indentation that has relaxed [N], and its slope [N/m]."""
    if depth <= 0.0:
        return 0.0, 0.0
    ratio = sqrt(self.tip_radius * depth) / self.layer_thickness
    layer = 1.0 + ratio * (1.133 + ratio * (1.283 + ratio * (0.769 + ratio * 0.0975)))
    rising = ratio * (1.133 + ratio * (2.566 + ratio * (2.307 + ratio * 0.39)))
    force = self.indentation_force * (depth / REFERENCE) ** self.exponent * layer
    return force, force / depth * (self.exponent + 0.5 * rising / layer)


def solve(self: TipContact, h: float) -> int:
    """The state after h: sliding, stuck or sliding back, whichever agrees with itself; the last one is tried first."""
    angle, along, across, last = self.tip_angle, self.load_along, self.load_across, self.sliding
    for i in range(3):
        self.sliding = (last + 1 + i) % 3 - 1
        if newton(self, h) == OK and agrees(self):
            keep(self, h)
            return OK
        self.tip_angle, self.load_along, self.load_across = angle, along, across
    return ERROR


def newton(self: TipContact, h: float) -> int:
    """Tip angle and load for which root, tissue and friction agree after h, if the tip slides as `sliding` says."""
    unit = self.bending_stiffness / (self.free_length * self.free_length)
    relax(self, h)
    for _ in range(ITERATIONS):
        bend(self)
        press(self, h)
        self.matrix[0, 3] = self.row_root[0] * unit
        self.matrix[1, 3] = normal(self, self.load_along, self.load_across) - self.pressed
        self.matrix[2, 3] = held(self, h)
        rest = abs(self.matrix[0, 3]) + abs(self.matrix[1, 3]) + abs(self.matrix[2, 3])
        if rest < CLOSE * unit:
            return OK
        for k in range(3):
            linearize(self, h, k)
        if correct(self) != OK:
            return ERROR
    return ERROR


def normal(self: TipContact, along: float, across: float) -> float:
    """Component of a load on the tip that the wall gives along its normal."""
    return sin(self.contact_angle) * across - cos(self.contact_angle) * along


def tangential(self: TipContact, along: float, across: float) -> float:
    """Tangential component of a load on the tip, against a tip that gives way."""
    return -sin(self.contact_angle) * along - cos(self.contact_angle) * across


def fading(self: TipContact, h: float, i: int) -> tuple[float, float]:
    """Decay factor of a relaxation term's strain over h and its gain from the elastic force; exact for a linear change."""
    decay = exp(-h / self.relaxation_time[i])
    return decay, self.relaxation[i] * self.relaxation_time[i] / h * (1.0 - decay)


def relax(self: TipContact, h: float) -> None:
    """Relaxed strain after h and its increase per newton of elastic force."""
    self.relaxed_force = 0.0
    self.gain = 1.0
    for i in range(TERMS):
        decay, share = fading(self, h, i)
        self.relaxed_force += decay * self.strained[i] - share * self.elastic
        self.gain += share


def press(self: TipContact, h: float) -> None:
    """Tissue force at the tip's position and its slope over depth."""
    deep = depth(self, self.approach)
    elastic, slope = lasting(self, deep)
    still = self.gain * elastic + self.relaxed_force
    self.pressed = 0.0
    self.stiffness = 0.0
    if deep > 0.0 and still > 0.0:
        brake, rise = braking(self.dissipation * (deep - self.deep) / h)
        self.pressed = still * brake
        self.stiffness = self.gain * slope * brake + still * rise * self.dissipation / h


def braking(rate: float) -> tuple[float, float]:
    """What dissipation makes of an elastic force, and its slope: 1 + rate, and for a tip that leaves never a pull."""
    if rate >= 0.0:
        return 1.0 + rate, 1.0
    part = 1.0 / (1.0 - rate)
    return part, part * part


def held(self: TipContact, h: float) -> float:
    """What is wrong with the friction: a stuck tip has not moved, a sliding one is held by its friction."""
    moved = tip_along_wall(self, self.approach) - self.far
    if self.sliding == 0:
        return STUCK * moved
    limit = self.sliding * self.friction * self.pressed
    return self.slip_drag / h * self.pressed * moved + limit - tangential(self, self.load_along, self.load_across)


def linearize(self: TipContact, h: float, k: int) -> None:
    """Derivatives of the equations by tip angle (0), load along (1) and across (2)."""
    along, across = float(k == 1), float(k == 2)
    c, s = cos(self.contact_angle), sin(self.contact_angle)
    deeper = c * self.row_x[k + 1] - s * self.row_y[k + 1]
    farther = s * self.row_x[k + 1] + c * self.row_y[k + 1]
    self.matrix[0, k] = self.row_root[k + 1] * self.bending_stiffness / (self.free_length * self.free_length)
    self.matrix[1, k] = normal(self, along, across) - self.stiffness * deeper
    if self.sliding == 0:
        self.matrix[2, k] = STUCK * farther
        return
    firmer = self.stiffness * deeper
    moved = tip_along_wall(self, self.approach) - self.far
    drag = self.slip_drag / h * (self.pressed * farther + firmer * moved)
    self.matrix[2, k] = drag + self.sliding * self.friction * firmer - tangential(self, along, across)


def agrees(self: TipContact) -> bool:
    """Return whether a stuck tip is within its friction limit, and a sliding tip slides in the assumed direction."""
    if self.sliding == 0:
        return self.pressed > 0.0 and abs(tangential(self, self.load_along, self.load_across)) <= self.friction * self.pressed
    return self.pressed == 0.0 or self.sliding * (tip_along_wall(self, self.approach) - self.far) >= 0.0


def correct(self: TipContact) -> int:
    """One step of Newton's method by Cramer's rule, shortened where it would turn the tip by more than 0.3 rad."""
    denominator = determinant(self, 0, 1, 2)
    if denominator == 0.0:
        return ERROR
    turn = determinant(self, 3, 1, 2) / denominator
    part = 1.0
    if abs(turn) > 0.3:
        part = 0.3 / abs(turn)
    self.tip_angle -= part * turn
    self.load_along -= part * determinant(self, 0, 3, 2) / denominator
    self.load_across -= part * determinant(self, 0, 1, 3) / denominator
    return OK


def determinant(self: TipContact, i: int, j: int, k: int) -> float:
    """Of three columns of the equations."""
    m = self.matrix
    return (
        m[0, i] * (m[1, j] * m[2, k] - m[1, k] * m[2, j])
        - m[0, j] * (m[1, i] * m[2, k] - m[1, k] * m[2, i])
        + m[0, k] * (m[1, i] * m[2, j] - m[1, j] * m[2, i])
    )


def keep(self: TipContact, h: float) -> None:
    """Accept this solution as the new state."""
    deep = depth(self, self.approach)
    elastic, _ = lasting(self, deep)
    for i in range(TERMS):
        decay, share = fading(self, h, i)
        self.strained[i] = decay * self.strained[i] + share * (elastic - self.elastic)
    self.deep = deep
    self.far = tip_along_wall(self, self.approach)
    self.elastic = elastic
