"""Feedforward controller of the injection catheter with four pull wires."""

from math import hypot

from fmus.injection_feedforward import InjectionFeedforward, extend_needle, publish_slides, steps

from fmus.injection import MILLIMETER, bend, needle_after, needle_limits
from fmus.omnidirectional import WIRES, needle_pull, periodic, pull_for
from twin.component import Boolean, Int32, Int64, input, local, output, parameter, terminal

DIASTOLE, CHOSEN, INTERPOLATED = 0, 1, 2
ACCEPTED, ACROSS_OUTSIDE, Z_OUTSIDE, NEEDLE_OUTSIDE, NOT_REACHABLE, NO_MODEL = 0, 1, 2, 3, 4, 5
PHASES = 16

# contraction at 16 phases of the heartbeat, from 0 at diastole to 1 at systole
CONTRACTION = (
    0.393,
    0.424,
    0.414,
    0.299,
    0.121,
    0.006,
    0.042,
    0.203,
    0.418,
    0.656,
    0.878,
    0.996,
    0.942,
    0.751,
    0.541,
    0.414,
)


class OmnidirectionalFeedforward(InjectionFeedforward):
    """From (x, y, z, needle length) to four pull wires, handle and needle, at every phase of the heartbeat, no feedback.

    Inverse of the coupled model of Cheng and Law (paper B) in the plane of the deflection, with a memory of directions.
    Between the models of diastole and systole the heart's phase decides. What a self-calibration learned is taken
    over with a new target, never under a tip that holds one. While `hold` is true only the needle moves.
    """

    former_names = (("asked", "last_target"), ("needle_asked", "last_needle_length"))

    target_x = input("m", "wanted tip position across, at diastole", display_unit="mm", nominal=8e-3)
    target_y = input("m", "wanted tip position across, at diastole", display_unit="mm", nominal=8e-3)
    target_z = input("m", "wanted tip position along, at diastole", display_unit="mm", minimum=0.0, nominal=10e-3)
    target_needle_length = input("m", "wanted needle length; negative: at home, inside", start=-1e-3, display_unit="mm",
                                 maximum=6e-3, nominal=4e-3)
    hold = input("", "whether handle and wires stay where they are", type=Boolean)
    heart_phase = input("rad", "phase of the heartbeat", nominal=3.0)
    gain_x = input("", "learned: part of a pull that arrives at the tip, plane x", start=1.0, minimum=0.1)
    gain_y = input("", "learned: part of a pull that arrives at the tip, plane y", start=1.0, minimum=0.1)
    offset_x = input("m", "learned: shift of the tip", display_unit="mm")
    offset_y = input("m", "learned: shift of the tip", display_unit="mm")
    offset_z = input("m", "learned: shift of the tip", display_unit="mm")

    handle_position = output("m", "handle's slide", display_unit="mm")
    wire_position = output("m", "slides of the pull wires +x, +y, -x, -y", shape=(WIRES,), display_unit="mm")
    needle_position = output("m", "needle's slide", display_unit="mm")
    handle_steps = output("", "the same in steps of the motor", type=Int64)
    wire_steps = output("", "the same in steps of the motors", type=Int64, shape=(WIRES,))
    needle_steps = output("", "the same in steps of the motor", type=Int64)
    tip_advance = output("m", "advance of the tip without deflection, by the model", display_unit="mm")
    tension_share = output("", "last direction: 0 pushed, 1 pulled")
    wanted_x = output("m", "where the tip is to be now", display_unit="mm")
    wanted_y = output("m", "where the tip is to be now", display_unit="mm")
    wanted_z = output("m", "where the tip is to be now", display_unit="mm")
    refusal = output("", "0: accepted; outside: 1 across, 2 z, 3 needle; 4: not reachable from here; 5: no such model",
                     type=Int32)

    target = terminal(
        "wanted coordinate", rule="bus", x=target_x, y=target_y, z=target_z, needle_length=target_needle_length,
        hold=hold,
    )
    calibration = terminal(
        "what it did, and what was learned from it", wire_position=wire_position, tip_advance=tip_advance,
        tension_share=tension_share, gain_x=gain_x, gain_y=gain_y, offset_x=offset_x, offset_y=offset_y,
        offset_z=offset_z,
    )

    model = parameter(DIASTOLE, "", "0: diastole alone; 1: diastole or systole, the nearer; 2: between them",
                      type=Int32, fixed=True, source="0: the bench stands still; paper, discussion, asks for both")
    across_maximum = parameter(15e-3, "m", "workspace across, in every direction", display_unit="mm", minimum=0.0,
                               source="paper, calibration method")
    reversal_threshold = parameter(0.02, "", "way back [mm] that is not worth a reversal", minimum=0.0,
                                   source="chosen: half a step of the play's model would chatter; what the camera resolves")
    stiffness_ratio = parameter(0.571, "", "bending stiffness over wire stiffness", minimum=0.0,
                                source="2 N/mm and 5.5 N/mm of omnidirectional_catheter: 2 / (5.5 - 2)")
    slack = parameter(0.1, "", "pull [mm] by which an antagonist is paid out further than the tip needs", minimum=0.0,
                      source="chosen: three times the play of a wire")
    needle_home = parameter(-2.0, "", "needle's slide [mm] at home",
                            source="chosen: by eqs. (8), (9) the needle is then inside at every pull, by 0.7 mm or more")
    contraction = parameter(CONTRACTION, "", "part of the way from diastole to systole at 16 phases of the heartbeat",
                            source="identified from: wall motion of paper A, eq. (4), as 16 images of a beat show it")
    systole_deflection = parameter(0.93, "", "deflection at systole per deflection at diastole", minimum=0.1,
                                   source="as omnidirectional_catheter: a calibration at systole")
    systole_shift = parameter((0.0, 0.5, -1.5), "", "way [mm] of the guide's end from diastole to systole: x, y, z",
                              source="as omnidirectional_catheter: a calibration at systole")
    systole_wall = parameter((0.0, 0.0, -3.0), "", "way [mm] of the target from diastole to systole: x, y, z",
                             source="as images show it: the stroke in omnidirectional_catheter")

    last_target = local(0.0, "m", "target of the last sample: x, y, z", shape=(3,))
    gain = local(1.0, "", "gains in use: x, y", shape=(2,))
    offset = local(0.0, "", "shift [mm] in use: x, y, z", shape=(3,))
    wanted = local(0.0, "", "where the tip is to be now [mm]: x, y, z", shape=(3,))
    slides = local(0.0, "", "pull wires' slides [mm]", shape=(WIRES,))
    reached = local(0.0, "", "advance of the tip [mm] without deflection")
    share = local(0.0, "", "last direction: 0 pushed, 1 pulled")
    last_needle_length = local(0.0, "m", "needle length of the last sample")

    def initialize(self) -> None:
        # the bench begins straight, pushed in, the needle inside
        for i in range(3):
            self.last_target[i] = 0.0
            self.offset[i] = 0.0
            self.wanted[i] = 0.0
        for i in range(2):
            self.gain[i] = 1.0
        for i in range(WIRES):
            self.slides[i] = 0.0
        self.handle = 0.0
        self.reached = 0.0
        self.share = 0.0
        self.pull = self.dead_band
        self.needle_slide = 0.0
        self.needle_set = self.needle[1]
        self.last_needle_length = 0.0
        self.refusal = ACCEPTED
        publish(self)

    def step(self, t: float, h: float) -> None:
        refusal = outside(self)
        if refusal == ACCEPTED and not self.hold:
            refusal = move(self)
        if refusal == ACCEPTED and self.target_needle_length != self.last_needle_length:
            self.last_needle_length = self.target_needle_length
            move_needle(self)
        self.refusal = refusal
        publish(self)


def outside(self: OmnidirectionalFeedforward) -> int:
    """Reason to reject a target before the computation; also for NaN."""
    if self.model < DIASTOLE or self.model > INTERPOLATED:
        return NO_MODEL
    if not hypot(self.target_x, self.target_y) <= self.across_maximum:
        return ACROSS_OUTSIDE
    if not 0.0 <= self.target_z <= self.z_maximum:
        return Z_OUTSIDE
    if not self.target_needle_length <= self.needle_maximum:
        return NEEDLE_OUTSIDE
    return ACCEPTED


def systole(self: OmnidirectionalFeedforward) -> float:
    """Weight of the model of systole now."""
    if self.model == DIASTOLE:
        return 0.0
    weight = periodic(self.contraction, PHASES, self.heart_phase / 6.283185307179586)
    if self.model == CHOSEN:
        return 1.0 if weight > 0.5 else 0.0
    return weight


def take_target(self: OmnidirectionalFeedforward) -> None:
    """Take a new target, with the self-calibration since the last one."""
    if self.target_x != self.last_target[0] or self.target_y != self.last_target[1] or self.target_z != self.last_target[2]:
        self.last_target[0] = self.target_x
        self.last_target[1] = self.target_y
        self.last_target[2] = self.target_z
        self.gain[0] = max(self.gain_x, 0.1)
        self.gain[1] = max(self.gain_y, 0.1)
        self.offset[0] = self.offset_x / MILLIMETER
        self.offset[1] = self.offset_y / MILLIMETER
        self.offset[2] = self.offset_z / MILLIMETER


def move(self: OmnidirectionalFeedforward) -> int:
    """Set the slides for the target at this phase, or leave everything and say why."""
    take_target(self)
    weight = systole(self)
    free = (
        self.last_target[0] / MILLIMETER + weight * (self.systole_wall[0] - self.systole_shift[0]) - self.offset[0],
        self.last_target[1] / MILLIMETER + weight * (self.systole_wall[1] - self.systole_shift[1]) - self.offset[1],
        self.last_target[2] / MILLIMETER + weight * (self.systole_wall[2] - self.systole_shift[2]) - self.offset[2],
    )
    across = hypot(free[0], free[1])
    radius = across / (1.0 + weight * (self.systole_deflection - 1.0))

    # the coupling depends on the direction, the direction on the pull: the last direction is tried first
    share = self.share
    pull = pull_at(self, radius, free[2], share)
    advance = free[2] + bend(self.bend_z, self.dead_band, max(pull, 0.0))
    if pull < 0.0 or (advance - self.reached) * (1.0 - 2.0 * share) < -self.reversal_threshold:
        share = 1.0 - share
        pull = pull_at(self, radius, free[2], share)
        advance = free[2] + bend(self.bend_z, self.dead_band, max(pull, 0.0))
        if pull < 0.0 or (advance - self.reached) * (1.0 - 2.0 * share) < 0.0:
            return NOT_REACHABLE
    if share != self.share or (advance - self.reached) * (1.0 - 2.0 * share) > 0.0:
        self.share = share
        self.reached = advance
        self.handle = (advance - share * self.reversal_offset) / (1.0 + self.slope)

    before = needle_pull(self.dead_band, self.pull)
    self.pull = pull
    size = (pull - self.dead_band) / (1.0 + self.stiffness_ratio)
    for axis in range(2):
        part = 0.0 if across <= 0.0 else size * free[axis] / across
        pull_pair(self, axis, part)
    bent = needle_pull(self.dead_band, pull)
    self.needle_set = needle_after(
        self.needle, self.needle_back, self.needle_turn, self.needle_slide, before, bent, self.needle_set
    )
    for i in range(3):
        self.wanted[i] = self.last_target[i] / MILLIMETER + weight * self.systole_wall[i]
    return ACCEPTED


def pull_at(self: OmnidirectionalFeedforward, radius: float, z: float, share: float) -> float:
    """Pull [mm] of a single wire for a radius at an axial position; -1 if there is none."""
    return pull_for(
        radius, z, self.bend_y, self.bend_z, self.compression, self.tension, self.dead_band, self.pull_maximum, share
    )


def pull_pair(self: OmnidirectionalFeedforward, axis: int, wanted: float) -> None:
    """Slides of a pair for a shortening [mm]: one pulls, the other is paid out by what it gains in length, and a little."""
    pulled = self.dead_band + (1.0 + self.stiffness_ratio) * abs(wanted) / self.gain[axis]
    paid_out = self.dead_band - abs(wanted) / self.gain[axis] - self.slack
    if wanted == 0.0:
        pulled = self.dead_band - self.slack
    self.slides[axis] = pulled if wanted >= 0.0 else paid_out
    self.slides[axis + 2] = paid_out if wanted >= 0.0 else pulled


def move_needle(self: OmnidirectionalFeedforward) -> None:
    """Slide for the wanted length; the play is crossed only where it must be."""
    bent = needle_pull(self.dead_band, self.pull)
    if self.last_needle_length < 0.0:
        self.needle_slide = self.needle_home
        low, high = needle_limits(self.needle, self.needle_back, self.needle_turn, self.needle_slide, bent)
        self.needle_set = min(max(self.needle_set, low), high)
    else:
        extend_needle(self, self.last_needle_length, bent)


def publish(self: OmnidirectionalFeedforward) -> None:
    """Outputs from the memory."""
    publish_slides(self)
    for i in range(WIRES):
        self.wire_position[i] = MILLIMETER * self.slides[i]
        self.wire_steps[i] = steps(self, self.slides[i])
    self.tip_advance = MILLIMETER * self.reached
    self.tension_share = self.share
    self.wanted_x = MILLIMETER * self.wanted[0]
    self.wanted_y = MILLIMETER * self.wanted[1]
    self.wanted_z = MILLIMETER * self.wanted[2]
