"""Braided sleeve of a gripper."""

from math import cos, expm1, pi, sin, sqrt

from fmus.noisy import Noisy
from twin.component import (
    Boolean,
    Int32,
    Int64,
    input,
    local,
    normal,
    output,
    parameter,
    seed_stream,
    terminal,
)


class BraidedSleeve(Noisy):
    """Braided sleeve that closes on an instrument when it is extended, and holds it like a finger trap.

    Yarns of fixed length on a cylinder; capstan law along the contact: a load that extends the sleeve tightens it.
    Both grippers of a rig have one parameter set and differ by `orientation`.
    """

    extension = input("m", "extension of the moving holder", display_unit="mm", nominal=5e-3)
    tension = input("N", "axial tension in the braid at the moving holder", minimum=0.0, nominal=50.0)

    contact_extension = output("m", "extension at which the braid has closed, on the instrument or on itself",
                               display_unit="mm")
    contact_stiffness = output("N/m", "axial stiffness of the closed braid", display_unit="N/mm")
    relaxed_stiffness = output("N/m", "axial stiffness of the open braid", display_unit="N/mm")
    diameter = output("m", "inner diameter", display_unit="mm")
    limit_distal = output("N", "largest distal force of the sleeve on the instrument, holds a proximal load")
    limit_proximal = output("N", "largest proximal force of the sleeve on the instrument, holds a distal load")
    torque_limit = output("N*m", "largest torque of the sleeve on the instrument", display_unit="mN*m")
    grip_stiffness = output("N/m", "axial stiffness between holder and instrument, 0 when open", display_unit="N/mm")
    grip_torsional_stiffness = output("N*m/rad", "torsional stiffness between holder and instrument, 0 when open")
    gripping = output("", "whether the instrument is held", type=Boolean)

    holder = terminal(
        "moving holder, on the piston", extension=extension, tension=tension, contact_extension=contact_extension,
        contact_stiffness=contact_stiffness, relaxed_stiffness=relaxed_stiffness,
    )
    grip = terminal(
        "grip on the instrument", limit_distal=limit_distal, limit_proximal=limit_proximal, torque_limit=torque_limit,
        stiffness=grip_stiffness, torsional_stiffness=grip_torsional_stiffness,
    )

    orientation = parameter(1, "", "+1: a distal load extends the sleeve (gripper 1); -1: it retracts it (gripper 2)",
                            type=Int32, minimum=-1, maximum=1, fixed=True, source="paper, section III.A")
    instrument_diameter = parameter(2.667e-3, "m", "diameter of the instrument", display_unit="mm", minimum=1e-5,
                                    source="8 Fr catheter")
    relaxed_diameter = parameter(3.18e-3, "m", "inner diameter of the relaxed sleeve", display_unit="mm", minimum=1e-4,
                                 source="paper, caption of Fig. 3: Flexo 3.18 mm, taken as the relaxed sleeve")
    relaxed_angle = parameter(0.6109, "rad", "angle of the relaxed yarns from the axis", display_unit="deg",
                              minimum=0.05, maximum=1.5, source="estimate: 30 to 40 deg")
    relaxed_length = parameter(0.06, "m", "length of the relaxed sleeve between the holders", display_unit="mm",
                               minimum=1e-3, source="estimate: the cylinder fits between the holders")
    yarn_count = parameter(48, "", "number of yarns", type=Int32, minimum=2, source="estimate: 16 to 24 carriers of 2")
    yarn_diameter = parameter(0.25e-3, "m", "diameter of a yarn", display_unit="mm", minimum=1e-6,
                              source="estimate: monofilament of 0.010 inch")
    yarn_modulus = parameter(2e9, "Pa", "modulus of a yarn", display_unit="GPa", minimum=0.0,
                             source="estimate: PET 5 GPa and more, less for crimp and the give of the jacket")
    open_stiffness = parameter(500.0, "N/m", "axial stiffness of the open braid", display_unit="N/mm", minimum=0.0,
                               source="estimate: 2 N by hand close it")
    friction_coefficient = parameter(0.25, "", "yarn on instrument; wear lowers it", minimum=0.0, maximum=1.0,
                                     source="estimate: 0.2 to 0.35 on a polymer jacket")
    friction_scatter = parameter(0.03, "", "relative standard deviation of the friction from grip to grip",
                                 minimum=0.0, maximum=0.2,
                                 source="estimate: the paper repeats 4 times and prints no scatter")
    effective_length = parameter(
        5.14e-3, "m", "length over which the piston's tension presses yarns on the instrument", display_unit="mm",
        minimum=0.0, source="identified from: the paper's grip forces, difference of the grippers (section III.A)",
    )
    closing_force = parameter(
        18.6, "N", "normal force that the closed braid has without the piston", minimum=0.0,
        source="identified from: the paper's grip forces, what the tension does not explain (section III.A)",
    )
    torque_factor = parameter(
        1.333, "", "torque limit over radius times force limit", minimum=0.0,
        source="identified from: the paper's grip torque (section III.B)",
    )
    closing_band = parameter(0.3e-3, "m", "extension over which the grip sets in", display_unit="mm", minimum=1e-6,
                             source="estimate: braid and instrument are not quite round and straight")
    closed_stiffness = parameter(4.4e3, "N/m", "axial stiffness between holder and gripped instrument", minimum=0.0,
                                 display_unit="N/mm",
                                 source="estimate: half of the compliance that the sheath's first node has")
    seed = parameter(11, "", "seed of the scatter; give every sleeve its own", type=Int64, fixed=True,
                     source="arbitrary")

    held = local(False, "", "whether the instrument was held in the last step", type=Boolean)
    friction = local(0.0, "", "friction coefficient of this grip over `friction_coefficient`")

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        draw(self)
        grip(self)
        self.held = self.gripping

    def step(self, t: float, h: float) -> None:
        grip(self)
        if self.gripping and not self.held:
            draw(self)
            grip(self)
        self.held = self.gripping


def draw(self: BraidedSleeve) -> None:
    """Every grip finds other spots of the surface: its own friction, within three standard deviations."""
    self.friction = 1.0 + self.friction_scatter * min(max(normal(self.stream), -3.0), 3.0)


def jamming_sine(self: BraidedSleeve, sine: float) -> float:
    """Sine of the angle at which yarns lie side by side: count * yarn_diameter = 2 pi D cos(angle), D = sin(angle) / sine."""
    # sine of twice the angle
    double = min(self.yarn_count * self.yarn_diameter * sine / pi, 1.0)
    return double / sqrt(2.0 + 2.0 * sqrt((1.0 - double) * (1.0 + double)))


def grip(self: BraidedSleeve) -> None:
    """Compute the geometry, then the holding force of the sleeve from its tension."""
    # at the middle of the two layers of yarn: sine of the angle over the diameter is the same at all extensions [1/m]
    middle = self.relaxed_diameter + 2.0 * self.yarn_diameter
    relaxed = sin(self.relaxed_angle)
    sine = relaxed / middle
    yarn = self.relaxed_length / cos(self.relaxed_angle)
    fits = self.instrument_diameter < self.relaxed_diameter
    jammed = min(jamming_sine(self, sine), relaxed)
    touching = (self.instrument_diameter + 2.0 * self.yarn_diameter) * sine

    # the braid closes on the instrument or, if that is too thin or too thick to be in it, on itself
    closes = fits and touching >= jammed
    across = touching if closes else jammed
    along = sqrt((1.0 - across) * (1.0 + across))
    closed_length = yarn * along
    self.contact_extension = max(closed_length - self.relaxed_length, 0.0)
    section = self.yarn_count * 0.25 * pi * self.yarn_diameter * self.yarn_diameter
    self.contact_stiffness = self.yarn_modulus * section * along * along * along / closed_length
    self.relaxed_stiffness = self.open_stiffness

    # no thinner than closed: what is beyond goes into the yarns
    length = self.relaxed_length + min(max(self.extension, 0.0), self.contact_extension)
    ratio = min(length / yarn, 1.0)
    self.diameter = max(sqrt(1.0 - ratio * ratio) / sine - 2.0 * self.yarn_diameter, 0.0)

    # part of the contact that has closed
    begin = self.contact_extension - self.closing_band
    part = min(max((self.extension - begin) / self.closing_band, 0.0), 1.0) if closes else 0.0

    # what opens the braid does not press on the instrument
    pressing = max(self.tension - self.relaxed_stiffness * max(self.extension, 0.0), 0.0)
    coefficient = self.friction_coefficient * self.friction
    radius = 0.5 * self.instrument_diameter
    tangent = across / along
    wraps = coefficient * self.effective_length * tangent * tangent / radius
    closing = part * coefficient * self.closing_force
    tightening = loosening = closing
    if part > 0.0:
        tightening += part * pressing * expm1(wraps)
        loosening -= part * pressing * expm1(-wraps)

    # a distal load is held by a proximal force
    self.limit_proximal = tightening if self.orientation > 0 else loosening
    self.limit_distal = loosening if self.orientation > 0 else tightening
    self.torque_limit = self.torque_factor * radius * tightening
    self.grip_stiffness = part * self.closed_stiffness

    # both families of yarn, kept taut by the tension; the middle of the sleeve is held from both holders
    lever = across * across * along * radius * radius
    self.grip_torsional_stiffness = part * self.yarn_modulus * section * lever * 4.0 / closed_length
    self.gripping = part > 0.5
