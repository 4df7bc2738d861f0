"""Sequence of one contact: approach, force control, retreat."""

from twin.component import Boolean, Component, Int32, input, local, output, parameter

REST, APPROACH, SETTLE, LEARN, HOLD, RETREAT, OVER = 0, 1, 2, 3, 4, 5, 6

# what moves the instrument
NOTHING, COMMAND, FORCE = 0, 1, 2

# phase     what moves it  learns  feeds forward
PHASES = (
    (REST,    NOTHING,       0,      0),
    (APPROACH, COMMAND,      0,      0),
    (SETTLE,  FORCE,         0,      0),
    (LEARN,   FORCE,         1,      0),
    (HOLD,    FORCE,         0,      1),
    (RETREAT, COMMAND,       0,      0),
    (OVER,    NOTHING,       0,      0),
)


class ContactSequence(Component):
    """Speed command of a contact experiment: approach until contact, hand over to a force controller, retract.

    Order of Al-Ahmad et al. (RACS), section V: force alone while the beat is learned from the tip, then with feedforward.
    It knows the measured force and nothing of the wall; one that is too high ends the contact.
    """

    former_names = (("felt", "contact_duration"),)

    force = input("N", "measured contact force", nominal=0.2)
    control_velocity = input("m/s", "speed commanded by the force controller, positive distal", display_unit="mm/s",
                             nominal=0.05)

    target_velocity = output("m/s", "speed of the instrument, positive distal", display_unit="mm/s")
    phase = output("", "0 rest, 1 approach, 2 force settles, 3 learning, 4 holding, 5 retreat, 6 over", type=Int32)
    learn = output("", "whether the beat may be learned from the tip", type=Boolean)
    feed_forward = output("", "whether the learned beat may move the instrument", type=Boolean)
    relieved = output("", "whether a force too high has ended the contact", type=Boolean)

    begin = parameter(1.0, "s", "time of the start", minimum=0.0, source="chosen: the first gripper holds before")
    approach_speed = parameter(0.01, "m/s", "speed towards the wall", display_unit="mm/s", minimum=1e-6,
                               source="chosen: twice the paper's slowest, section III.C; the heart comes at up to 40 mm/s")
    contact_force = parameter(0.03, "N", "measured force that counts as contact", minimum=0.0,
                              source="chosen: ten standard deviations of the sensor's noise")
    contact_time = parameter(20e-3, "s", "for which contact must last", display_unit="ms", minimum=0.0,
                             source="chosen: four samples of the sensor")
    settle_time = parameter(3.0, "s", "of force control before anything is learned", minimum=0.0,
                            source="chosen: five time constants of the paper's gain on this wall, 1.7 rad/s")
    learn_time = parameter(12.0, "s", "for which the beat is learned", minimum=0.0,
                           source="chosen: as the force experiment, 10 s and the start of the search")
    hold_time = parameter(60.0, "s", "of force control with feedforward", minimum=0.0,
                          source="chosen: as long as an ablation of one place, 30 to 60 s, estimate")
    retreat_speed = parameter(0.02, "m/s", "speed away from the wall", display_unit="mm/s", minimum=1e-6,
                              source="paper, section III.C: 5 to 40 mm/s")
    retreat_distance = parameter(0.06, "m", "travel away from the wall", display_unit="mm", minimum=0.0,
                                 source="chosen: more than a stroke")
    force_maximum = parameter(0.5, "N", "measured force that ends the contact", minimum=0.0,
                              source="chosen: above the clinical 0.4 N, paper, section I, by what the sensor may err")

    now = local(REST, "", "phase", type=Int32)
    elapsed = local(0.0, "s", "since it began")
    contact_duration = local(0.0, "s", "duration of uninterrupted contact")
    pressed = local(0.0, "s", "since the force has been too high")
    too_high = local(False, "", "whether it has ended the contact")

    def initialize(self) -> None:
        self.now = REST
        self.elapsed = 0.0
        self.contact_duration = 0.0
        self.pressed = 0.0
        self.too_high = False
        publish(self)

    def step(self, t: float, h: float) -> None:
        self.elapsed += h
        self.contact_duration = self.contact_duration + h if self.force >= self.contact_force else 0.0
        self.pressed = self.pressed + h if self.force >= self.force_maximum else 0.0
        if APPROACH <= self.now <= HOLD and self.pressed > self.contact_time:
            self.too_high = True
            enter(self, RETREAT)
        elif is_over(self):
            enter(self, self.now + 1)
        publish(self)


def is_over(self: ContactSequence) -> bool:
    """Whether the phase has done its work."""
    if self.now == APPROACH:
        return self.contact_duration > self.contact_time
    lasts = 0.0
    if self.now == REST:
        lasts = self.begin
    elif self.now == SETTLE:
        lasts = self.settle_time
    elif self.now == LEARN:
        lasts = self.learn_time
    elif self.now == HOLD:
        lasts = self.hold_time
    elif self.now == RETREAT:
        lasts = self.retreat_distance / self.retreat_speed
    return self.now != OVER and self.elapsed >= lasts


def enter(self: ContactSequence, phase: int) -> None:
    """Begin a phase."""
    self.now = phase
    self.elapsed = 0.0


def publish(self: ContactSequence) -> None:
    """What the table says of the phase."""
    self.phase = self.now
    self.relieved = self.too_high
    self.target_velocity = 0.0
    for phase, mover, learns, feeds in PHASES:
        if phase == self.now:
            self.learn = learns == 1
            self.feed_forward = feeds == 1
            if mover == FORCE:
                self.target_velocity = self.control_velocity
            elif mover == COMMAND:
                self.target_velocity = self.approach_speed if phase == APPROACH else -self.retreat_speed
