"""Regripping sequencer: endless motion of the instrument with two grippers of finite stroke."""

from fmus.regripping_sequencer.motion import collide, geometry_is_possible, move
from fmus.regripping_sequencer.rules import (
    FAULT,
    GOOD,
    IDLE,
    OPEN,
    RUNNING,
    STANDING,
    decide,
    holds,
    observe,
    step_shown,
    switches_valve,
)

from twin.component import ERROR, OK, Boolean, Component, Int32, input, local, output, parameter, terminal

# bits of `violation`
NOT_HELD = 1
COLLISION = 2
STROKE = 4
DRAGGED = 8


class RegrippingSequencer(Component):
    """Two grippers hand the instrument to each other while it moves, by the nine steps of the paper.

    Al-Ahmad et al. (RACS), section II.C, Fig. 2. Gripper 1 is the proximal (LHS), gripper 2 the distal one (RHS).
    It commands speeds (csv): a drive that runs in csp ignores it. The geometry must leave both strokes reachable,
    else every step ends with ERROR.
    """

    period = 1e-3
    former_names = (
        ("takeover", "load_transfer_gain"),
        ("takeover_maximum", "load_transfer_maximum"),
        ("wish", "slewed_velocity"),
        ("seen_force", "averaged_force"),
    )

    target_velocity = input("m/s", "wanted speed of the instrument, positive distal", display_unit="mm/s", nominal=0.03)
    enable = input("", "hold and move the instrument; false stops and then releases it", start=True, type=Boolean)
    position = input(
        "m", "position of each motor, positive distal", start=(-0.0242, 0.0242), display_unit="mm", nominal=0.01
    )
    extension = input("m", "extension of each gripper's cylinder, from its sensor", shape=(2,), display_unit="mm",
                      nominal=0.01) # a little below 0 on the cushion of the retracted end
    drive_force = input(
        "N", "force of each drive by its current, positive distal; for `load_transfer_gain` alone", shape=(2,), nominal=3.0
    )
    pressure_ok = input("", "air is there", start=True, type=Boolean)
    drive_ok = input("", "each drive follows its target", start=(True, True), type=Boolean)

    gripper_target_velocity = output("m/s", "60FFh of each drive", shape=(2,), display_unit="mm/s")
    valve = output("", "each gripper's valve, true extends the sleeve and grips", shape=(2,), type=Boolean)
    step_number = output("", "step of section II.C, 1 to 9", type=Int32)
    leading = output("", "gripper that carries the instrument, 1 or 2", type=Int32)
    instrument_target_velocity = output("m/s", "what the instrument is really commanded", display_unit="mm/s")
    commanded_position = output("m", "integral of it", display_unit="mm")
    regrip_count = output("", "how often the lead has changed", type=Int32)
    state = output("", "0 idle, 1 running, 2 holding, 3 fault", type=Int32)
    situation = output("", "0 good, 1 a grip is to be proven, 2 a drive is lost, 3 air is lost", type=Int32)
    violation = output("", "bits of broken rules, kept: 1 not held, 2 collision, 4 stroke, 8 dragged", type=Int32)
    distance = output("m", "between the carriages, as seen", display_unit="mm")

    drive = terminal(
        "drives of the grippers, by CiA 402", target_velocity=gripper_target_velocity, position_actual_value=position
    )
    supervisor = terminal(
        "who watches it",
        pressure_ok=pressure_ok,
        drive_ok=drive_ok,
        leading=leading,
        step_number=step_number,
        gripper_target_velocity=gripper_target_velocity,
    )
    cylinder = terminal("cylinders of the grippers", valve=valve, extension=extension)

    stroke = parameter(
        0.05, "m", "stroke of a gripper from its home", display_unit="mm", minimum=1e-3, source="paper, section III.C"
    )
    region_1 = parameter(
        10.5e-3,
        "m",
        "R1, at the home",
        display_unit="mm",
        minimum=0.0,
        source="chosen: the shortest that leaves 40 ms to grip and 40 ms to open at 40 mm/s",
    )
    region_3 = parameter(
        10.5e-3,
        "m",
        "R3, at the far end of the stroke",
        display_unit="mm",
        minimum=0.0,
        source="chosen: as R1, so that both directions are alike",
    )
    home_position = parameter(
        (-0.025, 0.025),
        "m",
        "position of each motor at its home",
        display_unit="mm",
        source="chosen: the strokes in the middle of the motors' 80 mm",
    )
    home_distance = parameter(
        0.18,
        "m",
        "between the carriages' reference points at home",
        display_unit="mm",
        source="estimate: carriage, both strokes and 20 mm",
    )
    carriage_length = parameter(
        0.06,
        "m",
        "length of a carriage on the common rail",
        display_unit="mm",
        source="estimate: sleeve, holders and 10 mm of cylinder stroke",
    )
    distance_minimum = parameter(
        5e-3,
        "m",
        "smallest distance between the carriages",
        display_unit="mm",
        minimum=0.0,
        source="chosen: twice what a drive overshoots, and more",
    )

    alpha = parameter(
        2.0,
        "",
        "speed of the free gripper over that of the instrument",
        minimum=1.0,
        source="paper: above 1; chosen: above stroke / (stroke - 2 R3) = 1.72",
    )
    return_maximum = parameter(
        0.2,
        "m/s",
        "largest speed of the free gripper",
        display_unit="mm/s",
        minimum=0.0,
        source="estimate: guide and cables",
    )
    velocity_maximum = parameter(
        0.1,
        "m/s",
        "largest speed of the instrument",
        display_unit="mm/s",
        minimum=0.0,
        source="chosen: above the paper's 40 mm/s",
    )
    homing_velocity = parameter(
        0.02, "m/s", "speed on the way home", display_unit="mm/s", minimum=0.0, source="chosen: slow"
    )
    acceleration = parameter(
        3.0, "m/s^2", "of a carriage", minimum=1e-3, source="chosen: 2 N of the motor's 9.2 N with 0.65 kg"
    )
    instrument_acceleration = parameter(
        0.5,
        "m/s^2",
        "of the instrument when the wanted speed changes",
        minimum=1e-3,
        source="paper: heart motion needs 0.51 m/s^2",
    )
    drive_delay = parameter(
        10e-3,
        "s",
        "by which a drive follows its target velocity",
        display_unit="ms",
        minimum=1e-3,
        source="estimate: servomotor in csv 6 ms, and a reserve",
    )

    grip_extension = parameter(
        4e-3,
        "m",
        "extension from which a sleeve grips",
        display_unit="mm",
        minimum=0.0,
        source="estimate: the braid closes at 3.7 mm on 8 Fr and gives to 4.6 mm at 6 bar",
    )
    open_extension = parameter(
        2e-3,
        "m",
        "extension up to which it is open",
        display_unit="mm",
        minimum=0.0,
        source="estimate: half of where the braid closes",
    )
    grip_delay = parameter(
        10e-3,
        "s",
        "time beyond that extension until the grip counts",
        display_unit="ms",
        minimum=0.0,
        source="estimate: pressure rises after the braid has closed",
    )
    grip_time = parameter(
        50e-3,
        "s",
        "time that a grip is expected to take, with that delay",
        display_unit="ms",
        minimum=0.0,
        source="estimate: 15 to 40 ms and the delay",
    )
    release_time = parameter(
        40e-3,
        "s",
        "time that a release is expected to take",
        display_unit="ms",
        minimum=1e-3,
        source="estimate: as a grip",
    )
    release_margin = parameter(
        0.1e-3,
        "m",
        "travel left after a release and braking",
        display_unit="mm",
        minimum=0.0,
        source="chosen: small, stroke_margin is there too",
    )
    stroke_margin = parameter(
        0.8e-3,
        "m",
        "not used at either end of the stroke",
        display_unit="mm",
        minimum=0.0,
        source="chosen: a drive in csv gives by 0.5 mm at 5 N, and overshoots",
    )
    reserve = parameter(
        0.0,
        "m",
        "kept beside it at either end for motion to and fro, as on a beating wall; 0: none",
        display_unit="mm",
        minimum=0.0,
        source="0: the paper's strategy, motion in one direction",
    )
    load_transfer_gain = parameter(
        0.0,
        "m/(s*N)",
        "relative speed of two grippers that hold, per force still to be handed over; 0: both go at one speed",
        display_unit="mm/(s*N)",
        minimum=0.0,
        source="0: the paper's strategy; 20 mm/(s N) hand 2 N over in 50 ms on grips of 4.4 N/mm",
    )
    load_transfer_maximum = parameter(
        0.03,
        "m/s",
        "largest such speed",
        display_unit="mm/s",
        minimum=0.0,
        source="chosen: below the instrument's 40 mm/s, so that neither gripper turns back",
    )
    start_tolerance = parameter(
        0.5e-3, "m", "how near a gripper must be to its start", display_unit="mm", minimum=0.0, source="chosen"
    )
    match_tolerance = parameter(
        50e-6,
        "m",
        "relative motion within match_time that counts as none",
        display_unit="mm",
        minimum=0.0,
        source="chosen: six increments of the Hall sensors",
    )
    match_time = parameter(
        20e-3,
        "s",
        "time without relative motion before a grip",
        display_unit="ms",
        minimum=0.0,
        source="chosen: a few time constants of the drive",
    )
    drag_maximum = parameter(
        1e-3,
        "m",
        "relative motion of two closed grippers that counts as dragging",
        display_unit="mm",
        minimum=0.0,
        source="estimate: the sleeves give about that at 5 N",
    )

    slope = local(100.0, "1/s", "of speed over the last of a distance, so that delays cause no overshoot")
    travel = local(0.0, "m", "each gripper's distance from its home, positive distal", shape=(2,), display_unit="mm")
    phase = local(0, "", "of each grip: 0 open, 1 closing, 2 holding, 3 opening", type=Int32, shape=(2,))
    elapsed = local(0.0, "s", "since the phase began", shape=(2,))
    proven = local(0.0, "s", "since the extension sufficed without a break", shape=(2,))
    speed = local(0.0, "m/s", "present command of each carriage", shape=(2,), display_unit="mm/s")
    velocity = local(0.0, "m/s", "present command of the instrument", display_unit="mm/s")
    commanded = local(0.0, "m", "its integral", display_unit="mm")
    count = local(0, "", "changes of the lead", type=Int32)
    broken = local(0, "", "bits of broken rules", type=Int32)
    trouble = local(0, "", "situation", type=Int32)
    slewed_velocity = local(0.0, "m/s", "wanted speed after the acceleration limit", display_unit="mm/s")
    direction = local(
        1, "", "of the motion, but for a way to and fro within the reserves: 1 distal or -1 proximal", type=Int32
    )
    back = local(0.0, "m", "way back from the farthest point in that direction", display_unit="mm")
    engaged = local(False, "", "the instrument has been gripped and must stay so")
    along = local(False, "", "the free gripper moves with the instrument (step 5)")
    regripped = local(False, "", "the free gripper has held before (steps 8 and 9 instead of 3 and 4)")
    shift = local(0.0, "m/s", "relative speed of two that hold, gripper 1 less gripper 2", display_unit="mm/s")
    averaged_force = local(0.0, "N", "force of each drive, averaged over some samples", shape=(2,))
    free_force = local(0.0, "N", "that of the gripper that moves along, before it closes: its guide's friction")
    leader = local(0, "", "index of the gripper that carries", type=Int32)
    anchor = local(0.0, "m", "relative position that steadiness is judged against", display_unit="mm")
    steady = local(0.0, "s", "since the relative position has changed")
    still = local(0.0, "s", "since both carriages are commanded to stand")
    closed_at = local(0.0, "m", "relative position when both were closed", display_unit="mm")
    both_closed = local(False, "", "both sleeves grip")

    def initialize(self) -> None:
        for k in range(2):
            self.travel[k] = self.position[k] - self.home_position[k]
            self.phase[k] = OPEN
            self.elapsed[k] = 0.0
            self.proven[k] = 0.0
            self.speed[k] = 0.0
            self.averaged_force[k] = 0.0
        self.shift = 0.0
        self.free_force = 0.0
        self.slewed_velocity = 0.0
        self.direction = 1
        self.back = 0.0
        self.engaged = False
        self.trouble = GOOD
        self.along = False
        self.regripped = False
        self.leader = 0
        self.anchor = self.travel[0] - self.travel[1]
        self.steady = 0.0
        self.still = 0.0
        self.closed_at = 0.0
        self.both_closed = False
        self.velocity = 0.0
        self.commanded = 0.0
        self.count = 0
        self.broken = 0
        publish(self)

    def step(self, t: float, h: float) -> int:
        if not geometry_is_possible(self):
            return ERROR
        self.slope = 1.0 / (self.drive_delay + 2.5 * h)
        observe(self, h)
        decide(self)
        move(self, h)
        self.commanded += h * self.velocity
        judge(self, h)
        publish(self)
        return OK


def publish(self: RegrippingSequencer) -> None:
    """Outputs from the memory."""
    for k in range(2):
        self.valve[k] = switches_valve(self, k)
        self.gripper_target_velocity[k] = self.speed[k]
    self.instrument_target_velocity = self.velocity
    self.commanded_position = self.commanded
    self.regrip_count = self.count
    self.violation = self.broken
    self.situation = self.trouble
    self.leading = self.leader + 1
    self.step_number = step_shown(self)
    self.distance = collide(self)
    self.state = STANDING if self.engaged else IDLE
    if self.slewed_velocity != 0.0 or self.velocity != 0.0:
        self.state = RUNNING
    if self.trouble != GOOD:
        self.state = FAULT


def judge(self: RegrippingSequencer, h: float) -> None:
    """Set the bits of the violated rules, from the sensors instead of the commands."""
    broken = self.broken
    if self.engaged and not holds(self, 0) and not holds(self, 1):
        broken |= NOT_HELD
    if collide(self) < self.distance_minimum:
        broken |= COLLISION
    if min(self.travel[0], -self.travel[1]) < 0.0 or max(self.travel[0], -self.travel[1]) > self.stroke:
        broken |= STROKE

    both = holds(self, 0) and holds(self, 1)
    relative = self.travel[0] - self.travel[1]
    if both and not self.both_closed:
        self.closed_at = relative
    elif both:
        self.closed_at += h * self.shift  # meant
    if both and abs(relative - self.closed_at) > self.drag_maximum:
        broken |= DRAGGED
    self.both_closed = both
    self.broken = broken
