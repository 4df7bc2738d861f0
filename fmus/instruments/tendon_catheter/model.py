"""Injection catheter with friction, slack and thermal effects, independent of the paper's equations."""

from math import cos, exp, sin, sqrt

from fmus.injection_catheter import SingleWireCatheter

from fmus.injection import wander
from fmus.noisy import Noisy, noise_seed
from twin.component import Boolean, local, output, parameter, seed_stream

STRAIGHT = 1e-6  # angle [rad] below which an arc is a line


class TendonCatheter(SingleWireCatheter, Noisy):
    """8 Fr catheter in a PTFE guide with one tendon and a needle: sliding friction, creep, capstan, arcs, warm plastic.

    In place of `pull_wire_catheter`, whose plant is paper B's own fits. Calibrate a controller on it: the paper's forms
    fit it only nearly. Tendon friction as in textbooks is many times what the paper's errors leave room for.
    """

    tip_z = output("m", "tip along the catheter, from its place at the start when cold, positive distal", display_unit="mm")
    deflection = output("rad", "angle of the bent tip", display_unit="deg")
    warmth = output("K", "warmth of the handle above the room's")

    guide_friction = parameter(4.0, "N", "friction of the catheter in its guide, sliding", minimum=0.0,
                               source="estimate: PTFE on a catheter through the aortic arch, 2 to 6 N")
    breakaway = parameter(1.1, "", "friction at rest by that of sliding", minimum=1.0,
                          source="estimate: PTFE hardly sticks, 1.0 to 1.2")
    friction_deviation = parameter(0.1, "", "standard deviation of the friction along the guide, by its mean", minimum=0.0,
                                   source="estimate: a bent tube's contacts, 5 to 20 %")
    advance_stiffness = parameter(
        5.06e3, "N/m", "of catheter and bending guide between handle and tip", display_unit="N/mm", minimum=1.0,
        source="from paper, eq. (2): a reversal costs 1.58 mm at 4 N of friction",
    )
    shaft_stiffness = parameter(25e3, "N/m", "of the shaft alone, which slackens the wire when it is pressed",
                                display_unit="N/mm", minimum=1.0,
                                source="estimate: 1.1 m of a braided 8 Fr shaft, 10 to 40 N/mm")
    guide_stiffness = parameter(80e3, "N/m", "of the guide's hold, which the sticking catheter carries along",
                                display_unit="N/mm", minimum=1.0, source="estimate: 0.05 mm at 4 N, fixed at one end")
    creep = parameter(0.3, "", "part by which the guide yields further in time", minimum=0.0,
                      source="estimate: PTFE under small load within a minute, 20 to 50 % of its elastic strain")
    creep_time = parameter(5.0, "s", "time constant of that", minimum=1e-3, source="estimate: 2 to 20 s")
    correlation_length = parameter(2e-3, "m", "travel over which friction and clearance change", display_unit="mm",
                                   minimum=1e-6, source="estimate: the clearance in the guide, 0.8 mm, by two or three")

    slack = parameter(1e-3, "m", "pull that takes up the wire's slack", display_unit="mm", minimum=0.0,
                      source="paper, eq. (4)")
    snaking = parameter(0.4e-3, "m", "pull over which a slack wire becomes straight", display_unit="mm", minimum=1e-9,
                        source="estimate: a wire of 0.2 mm in a lumen of 0.4 mm")
    wire_stiffness = parameter(2.0e3, "N/m", "tension of the wire per pull: wire, shaft and printed handle in series",
                               display_unit="N/mm", minimum=1.0, source="estimate: as pull_wire_catheter")
    tendon_offset = parameter(0.9e-3, "m", "distance of the wire from the tip's neutral axis", display_unit="mm",
                              minimum=1e-6, source="estimate: 8 Fr is 2.67 mm wide")
    friction_coefficient = parameter(0.1, "", "wire on its PTFE lumen", minimum=0.0,
                                     source="estimate: PTFE-coated wire, 0.08 to 0.15")
    wrap = parameter(3.1415926536, "rad", "bends of the lumen before the tip: the aortic arch", display_unit="deg",
                     minimum=0.0, source="estimate: arch of 180 deg")
    segment = parameter(29.7e-3, "m", "length of the tip that bends", display_unit="mm", minimum=1e-4,
                        source="from paper, eqs. (4), (5) at 9 mm: arc with 15.8 across, 6.4 along")
    bending_stiffness = parameter(
        250e-6, "N*m^2", "of that part", minimum=1e-9,
        source="from paper, eq. (4) at 9 mm: 15.8 mm across; 15.7 with the shaft's part, pushed, at 15 mm of advance",
    )
    shaft_bending_stiffness = parameter(2.5e-3, "N*m^2", "of the shaft out of its guide", minimum=1e-9,
                                        source="from paper, Fig. 8: a shift of about 3 mm at 20 mm of advance")
    outside = parameter(5e-3, "m", "shaft out of the guide at the start", display_unit="mm", minimum=0.0,
                        source="estimate: the advance is up to 20 mm")
    tilt = parameter(0.01, "rad", "of the shaft in the guide's end, pushed; as much to the other side, pulled",
                     display_unit="deg", source="estimate: half of 0.8 mm clearance over 40 mm of contact")
    tilt_deviation = parameter(1.5e-3, "rad", "standard deviation of that tilt along the guide", display_unit="deg",
                               minimum=0.0, source="estimate: 15 % of the clearance")

    needle_gain = parameter(0.4428, "", "of the needle's way by its slide's: the curved needle presses back in its tube",
                            source="paper, eq. (7)")
    needle_begin = parameter(-1.1044e-3, "m", "needle at a slide of zero", display_unit="mm", source="paper, eq. (7)")
    needle_play = parameter(1.5e-3, "m", "way of the slide that the tube's clearance takes", display_unit="mm", minimum=0.0,
                            source="estimate: tube in a wider lumen; eq. (9) loses 1 to 2 mm")
    needle_offset = parameter(0.6e-3, "m", "distance of the needle's tube from the neutral axis, to the outside of the bend",
                              display_unit="mm", source="estimate: within a lumen of 1.5 mm")

    needle_friction = parameter(1.0, "N", "friction of the needle's tube", minimum=0.0,
                                source="estimate: as pull_wire_catheter")

    warm = parameter(25.0, "K", "warmth of the handle after hours", minimum=0.0,
                     source="estimate: motors of 1.5 A become 40 to 60 K warm, printed PLA around them half of it")
    warm_time = parameter(900.0, "s", "time constant of that", minimum=1e-3, source="estimate: 10 to 20 minutes")
    powered = parameter(0.0, "s", "time that the motors have had current at the start", minimum=0.0, fixed=True,
                        source="chosen: cold")
    expansion = parameter(68e-6, "1/K", "of the printed plastic", minimum=0.0, source="PLA, recalled: 68e-6 /K")
    handle_length = parameter(60e-3, "m", "plastic between the handle's slide and the catheter", display_unit="mm",
                              source="estimate: 50 to 80 mm on Fig. 2")
    wire_length = parameter(40e-3, "m", "plastic between catheter and pull wire's slide", display_unit="mm",
                            source="estimate: 30 to 60 mm on Fig. 2")
    seed = noise_seed(13, "friction and tilt")

    heat = local(0.0, "K", "warmth of the handle")
    slip = local(0.0, "m", "place of the catheter on its guide")
    slides = local(False, "", "it slides on its guide", type=Boolean)
    grip = local(0.0, "N", "friction force on the catheter, positive against advance")
    yielded = local(0.0, "m", "creep of the guide")
    angle = local(0.0, "rad", "angle of the bent tip")
    tension = local(0.0, "N", "of the wire at the handle")
    needle_middle = local(0.0, "m", "slide behind the tube's clearance")
    handle_last = local(0.0, "m", "handle of the last step")
    rough = local(0.0, "", "friction's deviation: last, behind a lag", shape=(2,))
    lean = local(0.0, "", "tilt's deviation: last, behind a lag", shape=(2,))

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        for i in range(2):
            self.rough[i] = 0.0
            self.lean[i] = 0.0
        self.heat = self.warm * (1.0 - exp(-self.powered / self.warm_time))

        # the bench begins pushed in, pulled and protruded
        self.grip = self.guide_friction
        self.yielded = self.creep * self.grip / self.guide_stiffness
        self.slip = moved(self) - self.grip / series(self) - self.yielded
        self.handle_last = moved(self)
        self.slides = False
        self.angle = 0.0
        self.needle_middle = self.needle_position
        bend(self)
        publish(self)

    def step(self, t: float, h: float) -> None:
        # hours of current warm the handle, whatever it does
        self.heat += (self.warm - self.heat) * (1.0 - exp(-h / self.warm_time))
        advance(self, h)
        bend(self)
        half = 0.5 * self.needle_play
        self.needle_middle = min(max(self.needle_middle, self.needle_position - half), self.needle_position + half)
        publish(self)


def moved(self: TendonCatheter) -> float:
    """Where the catheter is held [m]: the slide, and the plastic that grows."""
    return self.handle_position + self.expansion * self.handle_length * self.heat


def series(self: TendonCatheter) -> float:
    """Stiffness of catheter and guide, between which it sticks [N/m]."""
    return 1.0 / (1.0 / self.advance_stiffness + 1.0 / self.guide_stiffness)


def advance(self: TendonCatheter, h: float) -> None:
    """Friction on a guide that yields: it sticks, and slips back to sliding friction once that at rest is passed."""
    handle = moved(self)
    travel = handle - self.handle_last
    self.handle_last = handle
    wander(self.rough, self.stream, abs(travel), self.correlation_length)
    wander(self.lean, self.stream, abs(travel), self.correlation_length)
    aim = self.creep * self.grip / self.guide_stiffness
    self.yielded += (aim - self.yielded) * (1.0 - exp(-h / self.creep_time))

    force = series(self) * (handle - self.slip - self.yielded)
    sliding = self.guide_friction * max(1.0 + self.friction_deviation * self.rough[1], 0.1)
    if self.slides and force * travel <= 0.0:
        self.slides = False
    if abs(force) > (1.0 if self.slides else self.breakaway) * sliding:
        self.slides = True
        force = sliding if force > 0.0 else -sliding
        self.slip = handle - self.yielded - force / series(self)
    self.grip = force


def bend(self: TendonCatheter) -> None:
    """Angle of the tip: the wire's tension behind the capstan of its lumen; between the two limits it stays."""
    pressed = self.grip / self.shaft_stiffness
    pull = self.wire_position + self.expansion * self.wire_length * self.heat - self.slack - pressed
    pull = 0.5 * (pull + sqrt(pull * pull + self.snaking * self.snaking))
    stiffness = self.bending_stiffness / (self.segment * self.tendon_offset)  # tension of the wire's end per angle [N/rad]
    loss = exp(-self.friction_coefficient * (self.wrap + self.angle))
    give = self.wire_stiffness * self.tendon_offset
    least = self.wire_stiffness * pull / (stiffness / loss + give)
    most = self.wire_stiffness * pull / (stiffness * loss + give)
    self.angle = min(max(self.angle, least), most)
    self.tension = max(self.wire_stiffness * (pull - self.tendon_offset * self.angle), 0.0)


def publish(self: TendonCatheter) -> None:
    """Where two arcs lead from the guide's end: the shaft, bent by the wire's tension, and the tip."""
    out = self.outside + self.handle_last + (self.guide_friction - self.grip) / self.advance_stiffness
    force = self.bending_stiffness / (self.segment * self.tendon_offset) * self.angle
    shaft = max(out, 0.0) * force * self.tendon_offset / self.shaft_bending_stiffness
    share = self.grip / self.guide_friction if self.guide_friction > 0.0 else 0.0
    begin = self.tilt * share + self.tilt_deviation * self.lean[1]
    rest = self.outside + self.segment

    # counted from the straight catheter at the start, pushed
    self.tip_y = across(out, begin, shaft) + across(self.segment, begin + shaft, self.angle) - rest * sin(self.tilt)
    self.tip_z = along(out, begin, shaft) + along(self.segment, begin + shaft, self.angle) - rest * cos(self.tilt)
    self.deflection = self.angle
    self.needle_length = self.needle_begin + self.needle_gain * self.needle_middle + self.needle_offset * self.angle
    self.handle_force = -self.grip
    self.wire_force = -self.tension
    half = max(0.5 * self.needle_play, 1e-9)
    self.needle_force = -self.needle_friction * (self.needle_position - self.needle_middle) / half
    self.warmth = self.heat


def across(length: float, begin: float, turn: float) -> float:
    """Lateral extent [m] of an arc that begins at an angle [rad] and turns by another."""
    if abs(turn) < STRAIGHT:
        return length * sin(begin + 0.5 * turn)
    return length * (cos(begin) - cos(begin + turn)) / turn


def along(length: float, begin: float, turn: float) -> float:
    """Axial extent of that arc [m]."""
    if abs(turn) < STRAIGHT:
        return length * cos(begin + 0.5 * turn)
    return length * (sin(begin + turn) - sin(begin)) / turn
