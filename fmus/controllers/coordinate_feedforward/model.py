"""Feedforward controller of the injection catheter."""

from fmus.injection_feedforward import InjectionFeedforward, extend_needle, publish_slides, steps

from fmus.injection import MILLIMETER, bend, coupling, needle_after
from twin.component import Boolean, Int32, Int64, input, local, output, parameter, terminal

UNMODIFIED, CALIBRATED = 0, 1
ACCEPTED, Y_OUTSIDE, Z_OUTSIDE, NEEDLE_OUTSIDE, NOT_REACHABLE, NO_MODE = 0, 1, 2, 3, 4, 5
HALVINGS = 40  # 9 mm / 2^40: the rounding of the actuators' steps is coarser by far
REACTION = 3  # periods until a slide that was sent away says that it moves
NEAR = 1e-6  # advance [mm] against the last direction up to which the handle stays


class CoordinateFeedforward(InjectionFeedforward):
    """From (y, z, needle length) to positions and step counts of pull wire, handle and needle, without feedback.

    Cheng and Law (paper B), calibration method: the inverse of eqs. (1) to (9) with a memory of directions. A target
    that is refused moves nothing; `refusal` says why. The needle moves when the tip rests. Bisection with a fixed
    number of steps, no heap.
    """

    target_y = input("m", "wanted tip position across", display_unit="mm", minimum=0.0, maximum=15e-3, nominal=10e-3)
    target_z = input("m", "wanted tip position along", display_unit="mm", minimum=0.0, maximum=20e-3, nominal=10e-3)
    target_needle_length = input(
        "m", "wanted needle length", display_unit="mm", minimum=0.0, maximum=6e-3, nominal=4e-3
    )

    handle_moving = input("", "whether the handle's slide moves; the needle waits for it", type=Boolean)
    wire_moving = input("", "whether the wire's slide moves; the needle waits for it", type=Boolean)

    handle_position = output("m", "handle's slide", display_unit="mm")
    wire_position = output("m", "pull wire's slide", display_unit="mm")
    needle_position = output("m", "needle's slide", display_unit="mm")
    handle_steps = output("", "the same in steps of the motor", type=Int64)
    wire_steps = output("", "the same in steps of the motor", type=Int64)
    needle_steps = output("", "the same in steps of the motor", type=Int64)
    refusal = output(
        "", "0: accepted; outside: 1 y, 2 z, 3 needle; 4: not reachable from here; 5: no such mode", type=Int32
    )

    target = terminal("wanted coordinate", rule="bus", y=target_y, z=target_z, needle_length=target_needle_length)

    mode = parameter(CALIBRATED, "", "0: unmodified, eqs. (1), (4), (5) alone; 1: calibrated", type=Int32, fixed=True,
                     source="paper, results")
    release = parameter(False, "", "the wire is released before every pull, so that friction holds it from one side",
                        type=Boolean, fixed=True, source="chosen: the paper does not say")
    y_maximum = parameter(15e-3, "m", "workspace across", display_unit="mm", source="paper, calibration method")

    last_y = local(0.0, "m", "target of the last sample", display_unit="mm")
    last_z = local(0.0, "m", "target of the last sample", display_unit="mm")
    last_needle = local(0.0, "m", "target of the last sample", display_unit="mm")
    tip_advance = local(0.0, "", "advance of the tip [mm] without deflection")
    tension_share = local(0.0, "", "last direction: 0 pushed, 1 pulled")
    releasing = local(0, "", "periods before the wire may pull; 0: it may", type=Int64)
    waiting = local(0, "", "periods before the needle may move; 0: it has", type=Int64)

    def initialize(self) -> None:
        # the bench begins straight, pushed in, with the needle just inside
        self.last_y = 0.0
        self.last_z = 0.0
        self.last_needle = 0.0
        self.pull = 0.0
        self.handle = 0.0
        self.tip_advance = 0.0
        self.tension_share = 0.0
        self.needle_set = 0.0
        self.needle_slide = -self.needle[1] / self.needle[0]
        self.waiting = 0
        self.releasing = 0
        self.refusal = ACCEPTED
        publish(self)

    def step(self, t: float, h: float) -> None:
        changed = self.target_y != self.last_y or self.target_z != self.last_z
        if changed or self.target_needle_length != self.last_needle:
            self.last_y = self.target_y
            self.last_z = self.target_z
            self.last_needle = self.target_needle_length
            self.refusal = outside(self)
            if self.refusal == ACCEPTED:
                self.refusal = move(self)
            if self.refusal == ACCEPTED:
                self.waiting = REACTION
        elif self.releasing > 1:
            self.releasing -= 1
        elif self.releasing == 1:
            if not self.wire_moving:
                self.releasing = 0
        elif self.waiting > 1:
            self.waiting -= 1
        elif self.waiting == 1 and not (self.handle_moving or self.wire_moving):
            self.waiting = 0
            move_needle(self)
        publish(self)


def outside(self: CoordinateFeedforward) -> int:
    """Reason to reject a target before the computation; also for NaN."""
    if self.mode != UNMODIFIED and self.mode != CALIBRATED:
        return NO_MODE
    if not 0.0 <= self.target_y <= self.y_maximum:
        return Y_OUTSIDE
    if not 0.0 <= self.target_z <= self.z_maximum:
        return Z_OUTSIDE
    if not 0.0 <= self.target_needle_length <= self.needle_maximum:
        return NEEDLE_OUTSIDE
    return ACCEPTED


def move(self: CoordinateFeedforward) -> int:
    """Set the slides for the target, or leave everything and say why."""
    y = self.target_y / MILLIMETER
    z = self.target_z / MILLIMETER
    if self.mode == UNMODIFIED:
        pull = pull_for(self, y, z, -1.0)
        if pull < 0.0:
            return NOT_REACHABLE
        let_go(self, pull)
        self.pull = pull
        self.tip_advance = z + bend(self.bend_z, self.dead_band, pull)
        self.handle = self.tip_advance
        return ACCEPTED

    # the sideways shift depends on the direction, the direction on the pull: the last direction is tried first
    share = self.tension_share
    pull = pull_for(self, y, z, share)
    advance = z + bend(self.bend_z, self.dead_band, max(pull, 0.0))
    if pull < 0.0 or (advance - self.tip_advance) * (1.0 - 2.0 * share) < -NEAR:
        share = 1.0 - share
        pull = pull_for(self, y, z, share)
        advance = z + bend(self.bend_z, self.dead_band, max(pull, 0.0))
        if pull < 0.0 or (advance - self.tip_advance) * (1.0 - 2.0 * share) < 0.0:
            return NOT_REACHABLE
    let_go(self, pull)
    self.needle_set = needle_after(
        self.needle, self.needle_back, self.needle_turn, self.needle_slide, self.pull, pull, self.needle_set
    )
    self.pull = pull

    # what is not a move must not move the handle: one such target after the other would creep into the play
    if share != self.tension_share or (advance - self.tip_advance) * (1.0 - 2.0 * share) > 0.0:
        self.tip_advance = advance
        self.tension_share = share
        self.handle = (advance - share * self.reversal_offset) / (1.0 + self.slope)
    return ACCEPTED


def let_go(self: CoordinateFeedforward, pull: float) -> None:
    """Slacken the wire before another pull [mm], if enabled."""
    if not self.release or pull == self.pull:
        return
    self.releasing = REACTION
    self.needle_set = needle_after(
        self.needle, self.needle_back, self.needle_turn, self.needle_slide, self.pull, 0.0, self.needle_set
    )
    self.pull = 0.0


def across(self: CoordinateFeedforward, pull: float, z: float, share: float) -> float:
    """Tip position across [mm] with a pull at a wanted position along; a negative share: without coupling."""
    y = bend(self.bend_y, self.dead_band, pull)
    if share >= 0.0:
        advance = z + bend(self.bend_z, self.dead_band, pull)
        y += coupling(self.compression, self.tension, share, self.dead_band, pull, advance)
    return y


def pull_for(self: CoordinateFeedforward, y: float, z: float, share: float) -> float:
    """Pull [mm] that brings the tip to y, by bisection; -1 if there is none."""
    if y <= 0.0:
        return 0.0
    low = self.dead_band
    high = self.pull_maximum
    if across(self, high, z, share) < y:
        return -1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if across(self, middle, z, share) < y:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def move_needle(self: CoordinateFeedforward) -> None:
    """Slide for the wanted length, when the tip is at rest; the play is crossed only where it must be."""
    if self.mode == UNMODIFIED:
        self.needle_slide = (self.last_needle / MILLIMETER - self.needle[1]) / self.needle[0]
    else:
        extend_needle(self, self.last_needle, self.pull)


def publish(self: CoordinateFeedforward) -> None:
    """Outputs from the memory."""
    publish_slides(self)
    pull = 0.0 if self.releasing > 0 else self.pull
    self.wire_position = MILLIMETER * pull
    self.wire_steps = steps(self, pull)
