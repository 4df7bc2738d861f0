"""Rules of the grips: sensor evaluation, when a gripper closes and opens, and the number of the step.

Gripper k is 0 (proximal, LHS) or 1 (distal, RHS); a direction s is 1 (distal) or -1 (proximal).
The tables are the implementation; the README repeats them with words.
"""

# part of the acceleration that braking plans with; the rest is for the drive's delay
BRAKING = 0.8

# over which the force of a drive is averaged [s]: some periods of its ripple
FORCE_TIME = 10e-3

# states
IDLE, RUNNING, STANDING, FAULT = 0, 1, 2, 3

# phase of a grip             valve  coupled: may touch the instrument and moves with it
OPEN, CLOSING, HOLDING, OPENING = 0, 1, 2, 3
PHASES = (
    (OPEN, 0, 0),
    (CLOSING, 1, 1),
    (HOLDING, 1, 1),
    (OPENING, 0, 1),
)

# what grips may do:  regrip as the nine steps say; secure: close whatever can; freeze: no valve is switched
REGRIP, SECURE, FREEZE = 0, 1, 2

# situation                   may move  grips
GOOD, UNPROVEN, DRIVE_LOST, AIR_LOST = 0, 1, 2, 3
SITUATIONS = (
    (GOOD, 1, REGRIP),
    (UNPROVEN, 0, SECURE),
    (DRIVE_LOST, 0, SECURE),
    (AIR_LOST, 0, FREEZE),
)

# step while engaged, by what the gripper does that does not lead; -1: either
#   phase    along  at start  has held before   step
STEPS = (
    (OPEN, 0, 0, 0, 3),
    (OPEN, 0, 1, 0, 4),
    (OPEN, 1, -1, -1, 5),
    (CLOSING, -1, -1, -1, 6),
    (HOLDING, -1, -1, -1, 7),
    (OPENING, -1, -1, -1, 8),
    (OPEN, 0, 0, 1, 8),
    (OPEN, 0, 1, 1, 9),
)


def looked_up(table, key: int, column: int) -> int:
    """Entry of a table in the row that begins with key."""
    for row in table:
        if row[0] == key:
            return row[column]
    return 0


def switches_valve(self, k: int) -> bool:
    """The phase of gripper k has the valve on: the sleeve extends."""
    return looked_up(PHASES, self.phase[k], 1) == 1


def is_coupled(self, k: int) -> bool:
    """Gripper k may touch the instrument."""
    return looked_up(PHASES, self.phase[k], 2) == 1


def may_move(self) -> bool:
    """The situation allows motion."""
    return looked_up(SITUATIONS, self.trouble, 1) == 1


def step_shown(self) -> int:
    """Number of the present step, 1 to 9."""
    if not self.engaged:
        return 1 if self.phase[0] == OPEN and self.phase[1] == OPEN else 2
    other = 1 - self.leader
    at_start = is_at_start(self, other)
    for phase, along, start, before, number in STEPS:
        if (
            phase == self.phase[other]
            and along in (-1, int(self.along))
            and start in (-1, int(at_start))
            and before in (-1, int(self.regripped))
        ):
            return number
    return 0


def remaining(self, k: int, s: int) -> float:
    """Travel that gripper k has left in direction s [m]: its stroke begins at home and lies towards the other one."""
    low = 0.0 if k == 0 else -self.stroke
    return low + self.stroke - self.travel[k] if s > 0 else self.travel[k] - low


def usable(self, k: int, s: int) -> float:
    """Part of it that motion in one direction may use [m]: neither the margin nor the reserve."""
    return remaining(self, k, s) - self.stroke_margin - self.reserve


def runs_out(self) -> int:
    """Of two that hold, the one that is nearer to the end of its stroke."""
    return 0 if remaining(self, 0, self.direction) <= remaining(self, 1, self.direction) else 1


def region(self, k: int, s: int) -> float:
    """Length of the region in which gripper k ends its motion in direction s [m]: R3 is the one far from its home."""
    return self.region_3 if (k == 0) == (s > 0) else self.region_1


def is_at_start(self, k: int) -> bool:
    """Gripper k has its whole stroke before it."""
    return usable(self, k, -self.direction) < self.start_tolerance


def holds(self, k: int) -> bool:
    """As the valve and the sensor show at this moment."""
    return switches_valve(self, k) and self.extension[k] >= self.grip_extension


def enter(self, k: int, phase: int) -> None:
    """Begin a phase of gripper k."""
    self.phase[k] = phase
    self.elapsed[k] = 0.0
    self.proven[k] = 0.0


def observe(self, h: float) -> None:
    """Positions, phases as the sensors show them, and the situation."""
    for k in range(2):
        self.travel[k] = self.position[k] - self.home_position[k]
        self.elapsed[k] += h
        self.proven[k] = self.proven[k] + h if holds(self, k) else 0.0
        if self.phase[k] == CLOSING and self.pressure_ok and self.proven[k] >= self.grip_delay:
            enter(self, k, HOLDING)
        elif self.phase[k] == HOLDING and not (self.pressure_ok and holds(self, k)):
            enter(self, k, CLOSING)
        elif self.phase[k] == OPENING and self.extension[k] <= self.open_extension:
            enter(self, k, OPEN)
        if not self.pressure_ok:
            self.elapsed[k] = 0.0
            self.proven[k] = 0.0

    relative = self.travel[0] - self.travel[1]
    self.still = self.still + h if self.speed[0] == 0.0 and self.speed[1] == 0.0 else 0.0
    self.steady += h
    if abs(relative - self.anchor) > self.match_tolerance:
        self.anchor = relative
        self.steady = 0.0

    held = self.phase[0] == HOLDING or self.phase[1] == HOLDING
    closing = self.phase[0] == CLOSING or self.phase[1] == CLOSING
    if not self.pressure_ok:
        self.trouble = AIR_LOST
    elif not (self.drive_ok[0] and self.drive_ok[1]):
        self.trouble = DRIVE_LOST
    elif self.engaged and (not held or (closing and self.trouble != GOOD)):
        self.trouble = UNPROVEN
    else:
        self.trouble = GOOD


def decide(self) -> None:
    """Switch valves, or not."""
    grips = looked_up(SITUATIONS, self.trouble, 2)
    if grips == FREEZE:
        return
    if not self.enable:
        release_all(self)
    elif grips == SECURE:
        secure(self)
    elif not self.engaged:
        grip_first(self)
    else:
        regrip(self)


def release_all(self) -> None:
    """Explicit release, once the instrument stands."""
    if self.velocity != 0.0:
        return
    self.engaged = False
    for k in range(2):
        if switches_valve(self, k):
            enter(self, k, OPENING)


def secure(self) -> None:
    """After a failure of a drive or of the leader's grip: close the grippers of the intact drives once nothing moves."""
    is_overdue = self.elapsed[self.leader] > self.grip_time and self.steady >= self.match_time

    # a load may push the lost carriage on: the other closes even then, to stop it
    if not self.engaged or self.still < self.match_time or not (self.trouble == DRIVE_LOST or is_overdue):
        return
    for k in range(2):
        if self.drive_ok[k] and not switches_valve(self, k):
            enter(self, k, CLOSING)


def grip_first(self) -> None:
    """Steps 1 and 2: the gripper with its stroke before it closes at home."""
    if self.phase[self.leader] == HOLDING:
        self.engaged = True
        self.regripped = False
        self.along = False
    elif self.phase[0] == OPEN and self.phase[1] == OPEN and is_home(self, 0) and is_home(self, 1):
        self.leader = 0 if self.target_velocity >= 0.0 else 1
        enter(self, self.leader, CLOSING)


def home_offset(self, k: int) -> float:
    """Distance to the home, which is a margin inside the stroke [m]."""
    return (self.stroke_margin if k == 0 else -self.stroke_margin) - self.travel[k]


def is_home(self, k: int) -> bool:
    """Gripper k is at home and stands, or nearly."""
    return abs(home_offset(self, k)) < self.start_tolerance and abs(self.speed[k]) < 0.1 * self.homing_velocity


def release_distance(self, velocity: float) -> float:
    """Travel that a gripper needs from its release until it stands [m]: open, brake, and a reserve."""
    braking = velocity / self.slope + velocity * velocity / (2.0 * BRAKING * self.acceleration)
    return velocity * self.release_time + braking + self.release_margin


def regrip(self) -> None:
    """Run steps 3 to 9. The lead matters only while one gripper is open: of two that hold, one runs out first."""
    s = self.direction
    other = 1 - self.leader
    if self.phase[0] == HOLDING and self.phase[1] == HOLDING:
        k = runs_out(self)
        left = usable(self, k, s)
        at_end = left <= release_distance(self, abs(self.velocity))
        if self.slewed_velocity * s > 0.0 and (at_end or self.reserve > 0.0):
            enter(self, k, OPENING)
            self.regripped = True
            self.along = False
            if k == self.leader:
                self.leader = 1 - k
                self.count += 1
    elif self.phase[other] == OPEN:
        left = remaining(self, self.leader, s) - self.reserve
        if left <= region(self, self.leader, s) and is_at_start(self, other):
            self.along = True
        matched = self.along and self.speed[other] == self.velocity
        if matched and self.steady >= self.match_time and left <= 0.5 * region(self, self.leader, s):
            enter(self, other, CLOSING)
