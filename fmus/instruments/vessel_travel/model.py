"""Travel of an instrument through a vessel, driven by a gripper at the entry."""

from math import exp, floor, pi, sin, sqrt

from fmus.gratings import GRATINGS
from fmus.noisy import Noisy
from twin.component import (
    Float64,
    Int32,
    Int64,
    input,
    local,
    output,
    parameter,
    seed_stream,
    terminal,
    uniform,
)

POINTS = 41  # of the table along the vessel
SPACING = 20e-3  # of these points [m]

# femoral artery to aortic arch: scenarios/vessels/femoral_to_arch.csv through centerline.py
CURVATURE_1 = (
    -0.98, -3.24, -3.88, -3.99, -3.68, -1.77, 2.98, 7.51, 7.74, 3.82, -0.34, -2.03, -2.28, -2.05, -1.12, 0.35, 1.28,
    1.51, 1.41, 0.65, -1.23, -3.11, -3.88, -4.0, -4.0, -4.0, -4.0, -3.9, -3.28, -1.8, -0.17, 0.56, 0.67, 0.63, 0.47,
    0.25, 0.12, 0.09, 0.08, 0.06, 0.0,
)
CURVATURE_2 = (
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.04, -0.31, -0.97, -1.61, -1.88, -1.9, -1.7, -0.93, 0.29, 1.07, 1.26, 1.25,
    1.08, 0.64, 0.22, 0.04, 0.01, 0.01, 0.01, 0.0, -0.65, -4.55, -14.53, -25.59, -29.71, -29.99, -28.76, -21.85,
    -11.53, -5.61, -4.13, -3.89, -3.24, 0.0,
)
LUMEN = (
    0.0060, 0.0060, 0.0060, 0.0060, 0.0062, 0.0064, 0.0067, 0.0069, 0.0074, 0.0081, 0.0088, 0.0095, 0.0100, 0.0102,
    0.0104, 0.0106, 0.0108, 0.0110, 0.0113, 0.0117, 0.0121, 0.0126, 0.0130, 0.0134, 0.0138, 0.0143, 0.0148, 0.0154,
    0.0159, 0.0165, 0.0170, 0.0176, 0.0181, 0.0185, 0.0188, 0.0192, 0.0195, 0.0199, 0.0200, 0.0200, 0.0200,
)


class VesselTravel(Noisy):
    """True travel of an instrument along a vessel: the tip lags the gripper, and the vessel moves.

    Setting of Al-Ahmad et al. (RACS), section VI. A chain of plays along the vessel: friction on an elastic rod is a play, and
    so is the way from the outer wall of a bend to the inner one. It begins pushed forward: the first withdrawal has all play.
    """

    carriage_travel = input("m", "travel of the grippers' carriages while they hold, positive distal", display_unit="mm",
                            nominal=0.1)
    grip = input("", "part of the carriages' motion that the gripper passes on: 1 holds, 0 slides", start=1.0, minimum=0.0,
                 maximum=1.0)
    guide_travel = input("m", "travel of the tip of a catheter around it, if `guide_lumen` is there", display_unit="mm",
                         nominal=0.1)

    travel = output("m", "travel of the tip along its own way, which follows the outer walls of bends", display_unit="mm")
    entry_travel = output("m", "travel of the instrument where it enters", display_unit="mm")
    play = output("m", "all play between gripper and tip", display_unit="mm")
    push_force = output("N", "friction of all that is inside")
    curvature = output("1/m", "curvature along both directions, mean over each grating", shape=(GRATINGS, 2))

    bending = terminal("what lies in it", curvature=curvature)

    curvature_1 = parameter(CURVATURE_1, "1/m", "curvature along the first direction, every 20 mm from the entry",
                            source="estimate: a sketch of a pig of 40 kg, scenarios/vessels/femoral_to_arch.csv")
    curvature_2 = parameter(CURVATURE_2, "1/m", "along the second", source="as curvature_1")
    lumen = parameter(LUMEN, "m", "diameter of the vessel", display_unit="mm", minimum=1e-3,
                      source="estimate: femoral artery 6 mm, thoracic aorta 14 mm, arch 18 mm")
    tip_location = parameter(0.4, "m", "where the tip is at first, from the entry", display_unit="mm", minimum=0.0,
                             maximum=0.8, source="chosen: below the diaphragm")
    diameter = parameter(2.67e-3, "m", "of the instrument", display_unit="mm", minimum=1e-4, source="paper: 8 Fr")
    guide_lumen = parameter(0.0, "m", "diameter of the lumen of a catheter around it; 0: there is none", display_unit="mm",
                            minimum=0.0, source="0: alone in the vessel")
    guide_location = parameter(0.0, "m", "where that catheter's tip is at first, from the entry", display_unit="mm",
                               minimum=0.0, maximum=0.8, source="as tip_location of the catheter")
    axial_stiffness = parameter(920.0, "N", "E A", minimum=1.0, source="sheath: identified from the paper")
    bending_stiffness = parameter(2e-3, "N*m^2", "E I", minimum=1e-9, source="instrument: 1 to 3e-3 for an 8 Fr shaft")
    wall_friction = parameter(0.5, "N", "friction per radian of bend, without thrust", minimum=0.0,
                              source="sheath: 0.8 N in a bend of pi/2")
    friction_coefficient = parameter(0.15, "", "friction per normal force of the thrust", minimum=0.0, source="sheath")
    entry_friction = parameter(0.6, "N", "of the valve at the entry", minimum=0.0, source="sheath: 0.6 N")
    slack = parameter(2.4e-3, "m", "play between gripper and entry", display_unit="mm", minimum=0.0,
                      source="estimate: 8 h^2 / (3 l), buckled sideways by h = 15 mm over l = 250 mm; paper, section VII, buckling")
    creep = parameter(0.022, "", "largest part of a stroke that the gripper loses; the part is drawn for each stroke",
                      minimum=0.0, maximum=1.0, source="paper, section III.C: at most 2.2 mm per 100 mm, catheter")
    stroke = parameter(0.05, "m", "travel between two drawings", display_unit="mm", minimum=1e-3,
                       source="paper, section III.C: regripping every 50 mm")
    respiration = parameter(3e-3, "m", "amplitude by which breath moves the arch along itself", display_unit="mm", minimum=0.0,
                            source="estimate: 2 to 5 mm")
    respiration_frequency = parameter(0.2, "Hz", "of the ventilator", minimum=0.0, source="estimate: 12 breaths a minute")
    heart_motion = parameter(1e-3, "m", "amplitude by which the heart moves the arch along itself", display_unit="mm",
                             minimum=0.0, source="estimate: 1 to 2 mm")
    heart_frequency = parameter(1.5, "Hz", "of the heart", minimum=0.0, source="estimate: 90 beats a minute, pig under anesthesia")
    fixed_length = parameter(0.25, "m", "of the vessel that breath and heart do not move; from there they grow to the end",
                             display_unit="mm", minimum=0.0, maximum=0.7, source="estimate: up to the abdominal aorta")
    count = parameter(38, "", "gratings along the instrument, to its tip", type=Int32, fixed=True, minimum=4, maximum=GRATINGS,
                      source="as fiber")
    pitch = parameter(10e-3, "m", "distance of gratings", display_unit="mm", minimum=1e-3, fixed=True, source="as fiber")
    grating_length = parameter(5e-3, "m", "length that a grating averages over", display_unit="mm", minimum=1e-4,
                               source="as guided_tip")
    seed = parameter(21, "", "seed of creep and of the phases of breath and heart", type=Int64, fixed=True, source="arbitrary")

    before = local(0.0, "m", "travel of the carriages at the last step", display_unit="mm")
    passed = local(0.0, "m", "travel that the grippers passed on", display_unit="mm")
    since = local(0.0, "m", "way since the part of creep was drawn", display_unit="mm")
    part = local(0.0, "", "part of this stroke that is lost")
    phase = local(0.0, "rad", "of breath and heart at time 0", shape=(2,), type=Float64)
    size = local(0.0, "1/m", "size of the curvature at each point of the table", shape=(POINTS,))
    crossing = local(0.0, "m", "way from wall to wall in the piece before each point", shape=(POINTS,))
    squeeze = local(0.0, "m", "by which friction shortens that piece, or lengthens it", shape=(POINTS,))
    tip = local(0.0, "m", "travel of the tip", display_unit="mm")
    carried = local(0.0, "m", "travel of the instrument at each point of the vessel", shape=(POINTS,), display_unit="mm")
    start_offset = local(0.0, "m", "what `carried` was at first", shape=(POINTS,))
    used = local(4, "", "gratings in use", type=Int32)

    def initialize(self) -> None:
        self.used = max(min(self.count, GRATINGS), 4)
        seed_stream(self.stream, self.seed)
        for i in range(2):
            self.phase[i] = 2.0 * pi * uniform(self.stream)
        self.part = self.creep * uniform(self.stream)
        self.since = 0.0
        self.before = self.carriage_travel
        self.passed = 0.0
        self.tip = 0.0
        for j in range(POINTS):
            self.size[j] = sqrt(self.curvature_1[j] * self.curvature_1[j] + self.curvature_2[j] * self.curvature_2[j])
        measure_play(self)

        # pushed forward: each place is behind the one before it by what friction takes
        for j in range(POINTS):
            self.carried[j] = -self.squeeze[j] + (self.carried[j - 1] if j > 0 else 0.0)
            self.start_offset[j] = self.carried[j]
        publish(self, 0.0)

    def step(self, t: float, h: float) -> None:
        move = self.carriage_travel - self.before
        self.before = self.carriage_travel
        self.since += abs(move)
        if self.since >= self.stroke:
            self.since -= self.stroke
            self.part = self.creep * uniform(self.stream)
        self.passed += move * self.grip * (1.0 - self.part)
        measure_play(self)
        follow = self.passed
        for j in range(POINTS):
            pulled = follow + self.squeeze[j] + self.crossing[j]
            self.carried[j] = min(max(self.carried[j], follow - self.squeeze[j]), pulled)
            follow = self.carried[j]
        publish(self, t + h)


def measure_play(self: VesselTravel) -> None:
    """Width of the play of each piece, from the tip, where there is no thrust, to the entry.

    A rod in a bend leans to the outer wall until a pull of E I k^2 / 2 straightens out its elastica; a smaller one
    moves it over a part of the lumen.
    """
    tip = self.tip_location + self.tip
    force = 0.0
    self.play = self.slack
    for back in range(POINTS - 1):
        j = POINTS - 1 - back
        length = min(max(tip - (j - 1) * SPACING, 0.0), SPACING)  # of this piece that the instrument lies in
        bend = 0.5 * (self.size[j] + self.size[j - 1])
        force += self.wall_friction * bend * length
        force *= exp(self.friction_coefficient * bend * length)
        hold = 0.5 * self.bending_stiffness * bend * bend
        crossed = 1.0 if force >= hold else force / hold
        lumen = 0.5 * (self.lumen[j] + self.lumen[j - 1])
        if self.guide_lumen > 0.0 and (j - 0.5) * SPACING < self.guide_location + self.guide_travel:
            lumen = self.guide_lumen
        clearance = max(lumen - self.diameter, 0.0)
        self.crossing[j] = length * crossed * clearance * bend
        self.squeeze[j] = length * force / self.axial_stiffness
        self.play += self.crossing[j] + 2.0 * self.squeeze[j]
    self.push_force = force + self.entry_friction
    self.crossing[0] = self.slack
    self.squeeze[0] = 0.0


def moved(self: VesselTravel, location: float, t: float) -> float:
    """Displacement [m] of a vessel location along the vessel by respiration and heart."""
    end = (POINTS - 1) * SPACING
    share = max(location - self.fixed_length, 0.0) / (end - self.fixed_length)
    breath = self.respiration * sin(2.0 * pi * self.respiration_frequency * t + self.phase[0])
    return share * (breath + self.heart_motion * sin(2.0 * pi * self.heart_frequency * t + self.phase[1]))


def come(self: VesselTravel, location: float) -> float:
    """Travel of the instrument at a location of the vessel [m]."""
    x = min(max(location / SPACING, 0.0), POINTS - 1.0)
    j = min(floor(x), POINTS - 2)
    first = self.carried[j] - self.start_offset[j]
    return first + (x - j) * (self.carried[j + 1] - self.start_offset[j + 1] - first)


def bent(self: VesselTravel, c: int, location: float) -> float:
    """A component of the curvature at a location of the vessel at rest [1/m]; 0 outside of it."""
    x = location / SPACING
    if x < 0.0 or x > POINTS - 1.0:
        return 0.0
    j = min(floor(x), POINTS - 2)
    if c == 0:
        return self.curvature_1[j] + (x - j) * (self.curvature_1[j + 1] - self.curvature_1[j])
    return self.curvature_2[j] + (x - j) * (self.curvature_2[j + 1] - self.curvature_2[j])


def publish(self: VesselTravel, t: float) -> None:
    """Travel of tip and entry, and the curvature at the gratings."""
    self.entry_travel = self.carried[0] - self.start_offset[0]
    self.tip = come(self, self.tip_location + self.tip)
    self.travel = self.tip
    for i in range(GRATINGS):
        for c in range(2):
            self.curvature[i, c] = 0.0
        if i < self.used:
            from_tip = (self.used - i - 0.5) * self.pitch
            location = self.tip_location - from_tip + self.tip
            location = self.tip_location - from_tip + come(self, location)
            location -= moved(self, location, t)
            for c in range(2):
                for k in range(-1, 2):  # three points of the grating
                    self.curvature[i, c] += bent(self, c, location + k * self.grating_length / 3.0) / 3.0
