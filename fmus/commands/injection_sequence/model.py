"""Sequence of injections along the border of an infarct."""

from math import floor, pi

from fmus.injection import length
from twin.component import Boolean, Component, Int32, Int64, input, local, output, parameter, terminal

TARGETS = 8

IDLE, POSITION, APPROACH, CONTACT, PROTRUDE, INJECT, NEEDLE_IN, WITHDRAW, DONE = 0, 1, 2, 3, 4, 5, 6, 7, 8
ABORT_NEEDLE, ABORT_WITHDRAW, ABORTED = 9, 10, 11

NO, YES = 0, 1
STAY, CLEAR, FORWARD = 0, 1, 2
HOME, OUT, BACK = 0, 1, 2

# what each state does; a test holds that nothing but the needle moves unless the needle is at home
ACTIONS = (
    # across along    needle hold inject watched
    (NO,     STAY,    HOME,  NO,  NO,    NO),   # IDLE
    (YES,    CLEAR,   HOME,  NO,  NO,    YES),  # POSITION
    (NO,     FORWARD, HOME,  NO,  NO,    YES),  # APPROACH
    (NO,     STAY,    HOME,  YES, NO,    YES),  # CONTACT
    (NO,     STAY,    OUT,   YES, NO,    YES),  # PROTRUDE
    (NO,     STAY,    BACK,  YES, YES,   YES),  # INJECT
    (NO,     STAY,    HOME,  YES, NO,    YES),  # NEEDLE_IN
    (NO,     CLEAR,   HOME,  NO,  NO,    YES),  # WITHDRAW
    (NO,     STAY,    HOME,  NO,  NO,    NO),   # DONE
    (NO,     STAY,    HOME,  YES, NO,    NO),   # ABORT_NEEDLE
    (NO,     CLEAR,   HOME,  NO,  NO,    NO),   # ABORT_WITHDRAW
    (NO,     STAY,    HOME,  NO,  NO,    NO),   # ABORTED
)


def packed(column: int) -> int:
    """A column of the table as a number, two bits for a state: compiled code has no tables."""
    return sum(row[column] << (2 * state) for state, row in enumerate(ACTIONS))


ACROSS, ALONG, NEEDLE, HOLD, FLOW, WATCHED = (packed(column) for column in range(6))

NONE, ABORT_REQUESTED, FORCE_HIGH, FORCE_LOST, POSITION_LOST, NEEDLE_NOT_HOME, NEEDLE_STUCK = 0, 1, 2, 3, 4, 5, 6


class InjectionSequence(Component):
    """Injection sequence: approach, contact, needle extension, injection during retraction, withdrawal; then the next target.

    After Cheng and Law (paper B): diagonal injection while the needle retracts, contact by a force threshold. Whatever
    goes wrong, the needle is drawn in before anything else moves; a needle that does not arrive at home keeps all at rest.
    """

    period = 10e-3

    enable = input("", "whether to run; from `done` or `aborted`, false leads back to idle", type=Boolean)
    abort = input("", "whether to abort", type=Boolean)
    measured_force = input("N", "contact force", nominal=0.2)
    force_valid = input("", "whether that is a measurement", start=True, type=Boolean)
    measured_x = input("m", "tip position across", display_unit="mm", nominal=4e-3)
    measured_y = input("m", "tip position across", display_unit="mm", nominal=4e-3)
    position_valid = input("", "whether that is a measurement", start=True, type=Boolean)
    needle_slide = input("m", "measured position of the needle's slide", display_unit="mm", nominal=4e-3)

    gate_phase = input("rad", "phase of the heartbeat at which a needle that is sent out now will enter", nominal=3.0)
    gate = input("", "whether a needle that is sent out now enters while the wall rests, by an estimate", start=True, type=Boolean)
    gate_valid = input("", "whether that is known", start=True, type=Boolean)

    needle_command = input("m", "where the controller sent the needle's slide", display_unit="mm", nominal=4e-3)

    target_x = output("m", "wanted tip position", display_unit="mm")
    target_y = output("m", "wanted tip position", display_unit="mm")
    target_z = output("m", "wanted tip position along", display_unit="mm")
    target_needle_length = output("m", "wanted needle length; negative: at home, inside", display_unit="mm")
    listening = output("", "whether the tip is held on the wall with the needle at home: the force is the wall's alone", type=Boolean)
    hold = output("", "whether nothing but the needle may move", type=Boolean)
    flow = output("m^3/s", "flow of the syringe", display_unit="mL/s")
    volume = output("m^3", "what the syringe has given", display_unit="mL")
    state = output("", "see the state table", type=Int32)
    number = output("", "target, from 1; 0 before the first", type=Int64)
    injected = output("", "targets with a full dose", type=Int64)
    missed = output("", "targets left out: not reached, or no contact", type=Int64)
    reason = output("", "of an abort: 1 requested, 2 force too high, 3 force lost, 4 position lost, 5 needle not at home, "
                        "6 needle does not follow or come home", type=Int32)

    target = terminal(
        "wanted coordinate", x=target_x, y=target_y, z=target_z, needle_length=target_needle_length, hold=hold,
    )
    image = terminal("latest frame", x=measured_x, y=measured_y, valid=position_valid)

    target_count = parameter(5, "", "number of targets, to 8", type=Int64, minimum=0, maximum=TARGETS, source="chosen")
    border_x = parameter((6e-3, 3e-3, -3e-3, -6e-3, -3e-3, 3e-3, 0.0, 0.0), "m", "targets on the border of the infarct",
                         display_unit="mm", source="chosen: a hexagon of 12 mm for an infarct as large")
    border_y = parameter((0.0, 5.2e-3, 5.2e-3, 0.0, -5.2e-3, -5.2e-3, 0.0, 0.0), "m", "targets on the border of the infarct",
                         display_unit="mm", source="chosen: a hexagon of 12 mm for an infarct as large")
    z_clear = parameter(6e-3, "m", "where the tip is clear of the wall", display_unit="mm", minimum=0.0,
                        source="chosen: images before, 4 mm and the stroke of the wall before it")
    z_limit = parameter(16e-3, "m", "where an approach without contact ends", display_unit="mm",
                        source="chosen: beyond the wall by its uncertainty")
    speed_across = parameter(4e-3, "m/s", "speed across", display_unit="mm/s", minimum=1e-6,
                             source="chosen: below what the wires' slides can follow, 9 mm/s of pull")
    speed_approach = parameter(1.5e-3, "m/s", "speed of the approach", display_unit="mm/s", minimum=1e-6,
                               source="chosen: 0.01 N of force in the delay of the contact's detection")
    speed_clear = parameter(6e-3, "m/s", "speed of a withdrawal", display_unit="mm/s", minimum=1e-6, source="chosen")
    settle = parameter(1.2, "s", "time at rest before the next state; longer than the age of a position", minimum=0.0,
                       source="frame and latency of image_position 0.5 s and 0.3 s")
    position_tolerance = parameter(3e-3, "m", "distance from a target that skips it", display_unit="mm", minimum=0.0,
                                   source="chosen: a border zone is about 5 mm wide; four deviations of an image")
    force_contact = parameter(0.1, "N", "contact force that ends the approach", minimum=0.0,
                              source="paper A, section II.A: 0.1 to 0.4 N; paper B asks for a threshold")
    force_maximum = parameter(0.4, "N", "contact force that aborts", source="paper A, section II.A: 0.1 to 0.4 N")
    gate_center = parameter(2.07, "rad", "phase at which the needle is to enter",
                            source="0.33 of a beat of `heart`: the wall rests at the end of its way out, diastole")
    gate_width = parameter(6.3, "rad", "width of the phases in which it may; more than 2 pi: at any time", minimum=0.0,
                           source="chosen: no gate; paper B's bench does not beat")
    gate_time = parameter(12.0, "s", "time in contact without such a phase that leaves the target out", minimum=0.0,
                          source="chosen: an ectopic beat and a few beats until the phase is known again, twice")
    contact_time = parameter(50e-3, "s", "time that the force must stay above", minimum=0.0,
                             source="chosen: ten samples of the sensor")
    force_lost_time = parameter(50e-3, "s", "time without a force that aborts", minimum=0.0,
                                source="chosen: ten samples of the sensor")
    position_lost_time = parameter(2.2, "s", "time without a position that aborts", minimum=0.0,
                                   source="chosen: four frames of image_position in a row")
    needle_length = parameter(4e-3, "m", "needle outside at the deepest", display_unit="mm", maximum=6e-3,
                              source="paper, Table 2: 3 to 5 mm; wall of an infarct's border 6 to 8 mm")
    needle_end = parameter(1e-3, "m", "needle outside where the injection ends", display_unit="mm", minimum=0.0,
                           source="chosen: nearer to the surface it would leak")
    speed_needle = parameter(3e-3, "m/s", "speed of the needle outward", display_unit="mm/s", minimum=1e-6,
                             source="chosen: 6.8 mm/s of its slide")
    speed_inject = parameter(0.5e-3, "m/s", "speed of the needle while it injects", display_unit="mm/s", minimum=1e-6,
                             source="chosen: 0.1 mL in 6 s")
    dose = parameter(1e-7, "m^3", "volume for a target", display_unit="mL", minimum=0.0,
                     source="endomyocardial injections of cells, recalled: 0.1 to 0.2 mL")
    home = parameter(-1.8e-3, "m", "needle's slide at which its switch closes", display_unit="mm",
                     source="needle_home of omnidirectional_feedforward, and 0.2 mm")
    home_time = parameter(3.0, "s", "time in which the needle must come home", minimum=0.0,
                          source="chosen: twice the longest way of its slide, 14 mm at 9.6 mm/s")

    needle_tolerance = parameter(0.5e-3, "m", "distance of the needle's slide from its command", display_unit="mm",
                                 minimum=0.0, source="chosen: ten deviations of a slide")
    follow_time = parameter(1.0, "s", "time that it may be farther away while the needle is out", minimum=0.0,
                            source="chosen: twice the time that the slide needs from home to where the needle comes out, at 19 mm/s")

    elapsed = local(0.0, "s", "time in the state")
    arrived = local(0.0, "s", "time since the state's movement has ended")
    force_over = local(0.0, "s", "time since the force is above the threshold")
    needle_astray = local(0.0, "s", "time since the needle's slide is not where it was sent")
    force_lost = local(0.0, "s", "time without a force")
    position_lost = local(0.0, "s", "time without a position")
    x = local(0.0, "m", "wanted tip position", display_unit="mm")
    y = local(0.0, "m", "wanted tip position", display_unit="mm")
    z = local(0.0, "m", "wanted tip position", display_unit="mm")
    needle = local(0.0, "m", "wanted needle length", display_unit="mm")
    given = local(0.0, "m^3", "what the syringe has given", display_unit="mL")

    def initialize(self) -> None:
        self.x = 0.0
        self.y = 0.0
        self.z = 0.0
        self.needle = -1e-3
        self.hold = False
        self.listening = False
        self.flow = 0.0
        self.given = 0.0
        self.state = IDLE
        self.number = 0
        self.injected = 0
        self.missed = 0
        self.reason = NONE
        self.elapsed = 0.0
        self.arrived = 0.0
        self.force_over = 0.0
        self.needle_astray = 0.0
        self.force_lost = 0.0
        self.position_lost = 0.0
        publish(self)

    def step(self, t: float, h: float) -> None:
        self.force_lost = 0.0 if self.force_valid else self.force_lost + h
        self.position_lost = 0.0 if self.position_valid else self.position_lost + h
        touching = self.force_valid and self.measured_force >= self.force_contact
        self.force_over = self.force_over + h if touching else 0.0
        near = abs(self.needle_slide - self.needle_command) <= self.needle_tolerance
        self.needle_astray = 0.0 if near else self.needle_astray + h

        trouble = detect_fault(self)
        following = self.state
        if does(self.state, WATCHED) == YES and trouble != NONE:
            self.reason = trouble
            following = ABORT_NEEDLE
        elif self.state >= ABORT_NEEDLE:
            following = after_abort(self)
        elif self.state == IDLE or self.state == DONE:
            following = after_rest(self)
        elif self.state == POSITION or self.state == APPROACH or self.state == CONTACT:
            following = after_approach(self)
        else:
            following = after_needle(self)
        if following != self.state:
            self.state = following
            self.elapsed = 0.0
            self.arrived = 0.0
        act(self, h)
        publish(self)
        self.elapsed += h


def does(state: int, column: int) -> int:
    """Entry of the table."""
    return (column >> (2 * state)) & 3


def at_home(self: InjectionSequence) -> bool:
    """Return whether the needle's home switch is closed; false also for NaN."""
    return self.needle_slide <= self.home


def detect_fault(self: InjectionSequence) -> int:
    """Why to abort."""
    if self.abort:
        return ABORT_REQUESTED
    if self.force_valid and not self.measured_force <= self.force_maximum:
        return FORCE_HIGH
    if self.force_lost > self.force_lost_time:
        return FORCE_LOST
    if self.position_lost > self.position_lost_time:
        return POSITION_LOST
    if does(self.state, HOLD) == NO and not at_home(self):
        return NEEDLE_NOT_HOME
    overdue = self.state == NEEDLE_IN and self.elapsed > self.home_time and not at_home(self)
    astray = (self.state == PROTRUDE or self.state == INJECT) and self.needle_astray > self.follow_time
    if overdue or astray:
        return NEEDLE_STUCK
    return NONE


def after_rest(self: InjectionSequence) -> int:
    """From idle and done."""
    if self.state == DONE:
        return DONE if self.enable else IDLE
    if not self.enable or self.abort or not at_home(self):
        return IDLE
    self.number = 0
    self.injected = 0
    self.missed = 0
    self.reason = NONE
    return following_target(self)


def following_target(self: InjectionSequence) -> int:
    """The next target, if there is one."""
    if self.number >= min(self.target_count, TARGETS):
        return DONE
    self.number += 1
    return POSITION


def after_approach(self: InjectionSequence) -> int:
    """From position, approach and contact."""
    rests = self.arrived >= self.settle
    if self.state == POSITION:
        if not rests:
            return POSITION
        off = length(self.measured_x - self.x, self.measured_y - self.y)
        if off <= self.position_tolerance:
            return APPROACH
        self.missed += 1
        return WITHDRAW
    touching = self.force_over > self.contact_time
    if self.state == APPROACH:
        if touching:
            return CONTACT
        if self.arrived > 0.0:
            self.missed += 1
            return WITHDRAW
        return APPROACH

    # contact: a wall that beats may leave the tip for a moment, but not when the needle is to go out
    if self.elapsed > self.gate_time:
        self.missed += 1
        return WITHDRAW
    if not rests or not gate_open(self):
        return CONTACT
    return PROTRUDE if touching else APPROACH


def gate_open(self: InjectionSequence) -> bool:
    """Whether the estimate of the wall's rest and the phase allow the needle to enter."""
    if not self.gate:
        return False
    if self.gate_width > 2.0 * pi:
        return True
    turns = (self.gate_phase - self.gate_center) / (2.0 * pi)
    return self.gate_valid and abs(turns - floor(turns + 0.5)) <= self.gate_width / (4.0 * pi)


def after_needle(self: InjectionSequence) -> int:
    """From protrude, inject, needle in and withdraw."""
    if self.state == PROTRUDE:
        return INJECT if self.arrived >= self.settle else PROTRUDE
    if self.state == INJECT:
        if self.arrived <= 0.0:
            return INJECT
        self.injected += 1
        return NEEDLE_IN
    if self.state == NEEDLE_IN:
        return WITHDRAW if at_home(self) else NEEDLE_IN
    return following_target(self) if self.arrived > 0.0 else WITHDRAW


def after_abort(self: InjectionSequence) -> int:
    """From the states of an abort; a needle that is not at home leads back to the first of them."""
    if self.state == ABORTED:
        return ABORTED if self.enable else IDLE
    if not at_home(self):
        if self.elapsed > self.home_time:
            self.reason = NEEDLE_STUCK
        return ABORT_NEEDLE
    if self.state == ABORT_NEEDLE:
        return ABORT_WITHDRAW
    return ABORTED if self.arrived > 0.0 else ABORT_WITHDRAW


def act(self: InjectionSequence, h: float) -> None:
    """What the table says for the state."""
    there = True
    if does(self.state, ACROSS) == YES:
        there = move_across(self, h)
    if does(self.state, ALONG) == CLEAR:
        before = self.z
        self.z = toward(before, self.z_clear, self.speed_clear * h)
        there = there and self.z == self.z_clear
    elif does(self.state, ALONG) == FORWARD:
        self.z = toward(self.z, self.z_limit, self.speed_approach * h)
        there = there and self.z == self.z_limit

    before = self.needle
    if does(self.state, NEEDLE) == HOME:
        self.needle = -1e-3
    elif does(self.state, NEEDLE) == OUT:
        self.needle = toward(max(before, 0.0), self.needle_length, self.speed_needle * h)
        there = there and self.needle == self.needle_length
    else:
        self.needle = toward(before, self.needle_end, self.speed_inject * h)
        there = there and self.needle == self.needle_end

    # as much per depth everywhere: the flow goes with the speed of the needle
    stroke = max(self.needle_length - self.needle_end, 1e-6)
    self.flow = self.dose * (before - self.needle) / (stroke * h) if does(self.state, FLOW) == YES else 0.0
    self.given += self.flow * h
    self.hold = does(self.state, HOLD) == YES
    self.listening = self.state == CONTACT
    self.arrived = self.arrived + h if there else 0.0


def move_across(self: InjectionSequence, h: float) -> bool:
    """A step toward the target on the straight line to it; whether it is reached."""
    x = self.border_x[self.number - 1]
    y = self.border_y[self.number - 1]
    left = length(x - self.x, y - self.y)
    distance = self.speed_across * h
    if left <= distance:
        self.x = x
        self.y = y
        return True
    self.x += (x - self.x) * distance / left
    self.y += (y - self.y) * distance / left
    return False


def toward(value: float, goal: float, step: float) -> float:
    """Move a value toward its goal by at most one step."""
    return min(value + step, goal) if goal >= value else max(value - step, goal)


def publish(self: InjectionSequence) -> None:
    """Outputs from the memory."""
    self.target_x = self.x
    self.target_y = self.y
    self.target_z = self.z
    self.target_needle_length = self.needle
    self.volume = self.given
