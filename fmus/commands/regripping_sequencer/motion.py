"""Speeds of the instrument and of the carriages: acceleration limits, ends of the strokes, pace, distance."""

from math import copysign, sqrt

from fmus.regripping_sequencer.rules import (
    BRAKING,
    CLOSING,
    FORCE_TIME,
    HOLDING,
    OPEN,
    OPENING,
    home_offset,
    is_coupled,
    may_move,
    region,
    remaining,
    runs_out,
    usable,
)


def geometry_is_possible(self) -> bool:
    """Both grippers may stand as near to each other as a regrip needs."""
    near = 2.0 * self.stroke - min(self.region_1, self.region_3)
    return self.home_distance - self.carriage_length - near > self.distance_minimum


def collide(self) -> float:
    """Distance between the carriages [m]."""
    return self.home_distance - self.carriage_length + self.travel[1] - self.travel[0]


def approach(self, left: float) -> float:
    """Speed from which a carriage still stops within a distance [m/s]: square root, linear near the end."""
    if left <= 0.0:
        return 0.0
    brake = BRAKING * self.acceleration
    return brake / self.slope * (sqrt(1.0 + 2.0 * (self.slope * self.slope) * left / brake) - 1.0)


def slewed(present: float, wanted: float, most: float) -> float:
    """One step towards a wanted speed [m/s]."""
    return present + min(max(wanted - present, -most), most)


def move(self, h: float) -> None:
    """Speeds of one period."""
    moving = may_move(self) and self.engaged
    wanted = self.target_velocity if moving and self.enable else 0.0
    wanted = min(max(wanted, -self.velocity_maximum), self.velocity_maximum)
    self.slewed_velocity = slewed(self.slewed_velocity, wanted, h * self.instrument_acceleration) if moving else 0.0
    if turns_back(self, h):
        self.direction = -self.direction
        self.back = 0.0
        self.along = False

    # what the strokes of the grippers that touch the instrument leave
    high, low = self.velocity_maximum, -self.velocity_maximum
    for k in range(2):
        if is_coupled(self, k):
            high = min(high, approach(self, remaining(self, k, 1) - self.stroke_margin))
            low = max(low, -approach(self, remaining(self, k, -1) - self.stroke_margin))
    if moving:
        limit = pace(self)
        if self.direction > 0:
            high = min(high, limit)
        else:
            low = max(low, -limit)
    most = h * self.acceleration
    velocity = slewed(self.velocity, min(max(self.slewed_velocity, low), high), most)
    self.velocity = velocity

    transfer_load(self, h)
    lead = 0.5 * self.shift if is_coupled(self, 0) and is_coupled(self, 1) else 0.0
    for k in range(2):
        both = velocity + (lead if k == 0 else -lead)
        self.speed[k] = both if is_coupled(self, k) else slewed(self.speed[k], free_speed(self, k), most)
    keep_distance(self)
    for k in range(2):
        if not self.drive_ok[k]:
            self.speed[k] = 0.0


def transfer_load(self, h: float) -> None:
    """While both grippers hold, move the incoming one ahead until the other's drive carries only its guide's friction."""
    other = 1 - self.leader
    for k in range(2):
        self.averaged_force[k] += min(h / FORCE_TIME, 1.0) * (self.drive_force[k] - self.averaged_force[k])
    if self.along and self.phase[other] == OPEN:
        self.free_force = self.averaged_force[other]
    wanted = 0.0
    if self.phase[0] == HOLDING and self.phase[1] == HOLDING and may_move(self):
        out = runs_out(self)
        ahead = self.load_transfer_gain * (self.averaged_force[out] - self.free_force)
        ahead = min(max(ahead, -self.load_transfer_maximum), self.load_transfer_maximum)
        wanted = ahead if out == 1 else -ahead
    self.shift = slewed(self.shift, wanted, h * self.acceleration)


def turns_back(self, h: float) -> bool:
    """Return whether the instrument reverses for good: farther than the reserves, or a gripper on it has no stroke left."""
    self.back = max(self.back - self.direction * self.velocity * h, 0.0)
    if self.slewed_velocity * self.direction >= 0.0:
        return False
    short = False
    for k in range(2):
        left = remaining(self, k, -self.direction) - self.stroke_margin
        short = short or (is_coupled(self, k) and left <= self.start_tolerance)
    return short or self.back >= 2.0 * self.reserve


def pace(self) -> float:
    """Speed at which the other gripper can still take over before the leader's stroke ends [m/s]."""
    s = self.direction
    other = 1 - self.leader
    phase = self.phase[other]
    left = remaining(self, self.leader, s) - self.stroke_margin
    to_close = left - self.reserve - 0.5 * region(self, self.leader, s)
    if phase in (HOLDING, OPENING):
        return self.velocity_maximum
    if phase == CLOSING or (self.along and to_close <= 0.0):
        elapsed = self.elapsed[other] if phase == CLOSING else 0.0
        return max(left, 0.0) / (self.release_time + max(self.grip_time - elapsed, 0.0))

    # speed at which the grip can begin, reached by braking gently from the one of now
    half = 0.5 * region(self, self.leader, s) - self.stroke_margin
    begin = half / (self.release_time + self.grip_time)
    limit = sqrt(begin * begin + self.acceleration * max(to_close, 0.0))
    if self.along:
        return limit

    back = returning(self)
    distance = usable(self, other, -s)
    if back <= 0.0:
        return 0.0
    turn = (abs(self.speed[other] + s * back) + 2.0 * back) / (2.0 * self.acceleration)
    return min(limit, max(to_close, 0.0) / (max(distance, 0.0) / back + turn + self.match_time))


def returning(self) -> float:
    """Speed of the free gripper on its return to the start [m/s], the paper's V * alpha."""
    return min(self.alpha * abs(self.slewed_velocity), self.return_maximum)


def free_speed(self, k: int) -> float:
    """Wanted speed of an open gripper [m/s]."""
    if not may_move(self):
        return 0.0
    if not self.engaged:
        distance = home_offset(self, k) if self.phase[0] == OPEN and self.phase[1] == OPEN else 0.0
        return copysign(min(approach(self, abs(distance)), self.homing_velocity), distance)
    s = self.direction
    if self.along:
        backward = approach(self, remaining(self, k, -s) - self.stroke_margin - 0.5 * region(self, k, -s))
        return s * max(s * self.velocity, -backward)
    distance = usable(self, k, -s)
    return -s * copysign(min(approach(self, abs(distance)), returning(self)), distance)


def keep_distance(self) -> None:
    """Keep the carriages apart: the open gripper yields; two open grippers both stop."""
    closing_in = approach(self, collide(self) - self.distance_minimum - self.stroke_margin)
    if self.speed[0] - self.speed[1] <= closing_in:
        return
    if not is_coupled(self, 1) and not is_coupled(self, 0):
        self.speed[0] = min(self.speed[0], 0.5 * closing_in)
        self.speed[1] = max(self.speed[1], -0.5 * closing_in)
    elif not is_coupled(self, 1):
        self.speed[1] = self.speed[0] - closing_in
    elif not is_coupled(self, 0):
        self.speed[0] = self.speed[1] + closing_in
