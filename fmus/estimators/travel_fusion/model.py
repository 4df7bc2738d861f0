"""Travel of an instrument from gripper and fiber together."""

from math import cos, isfinite, pi, sin, sqrt

from fmus.kalman import update

from fmus.gratings import DEGRADED, LOST, VALID
from twin.component import Boolean, Component, Int32, input, local, output, parameter, terminal

STATES = 4
LONGEST = 1.0  # [m], longer than any instrument goes: an innovation or an uncertainty beyond is no number to reckon with
OFFSET, REFERENCE, BREATH, QUADRATURE = 0, 1, 2, 3


class TravelFusion(Component):
    """Kalman filter of the difference between gripper and tip: Hall travel predicts, the curvature shift corrects.

    Fusion that Al-Ahmad et al. (RACS), section VI, ask for; slip by Page's cumulative sum (Biometrika 41, 1954).
    Lost play after a reversal and slip look alike until the tip has moved: slip is not told before.
    """

    period = 4e-3
    former_names = (("way", "since_reversal"),)

    measured_travel = input("m", "travel by the Hall sensors, positive distal", display_unit="mm", nominal=0.1)
    hall_age = input("s", "age of that sample", start=4e-3, display_unit="ms", nominal=1e-4)
    shift = input("m", "travel by the shift of the curvature profile, positive distal", display_unit="mm", nominal=0.1)
    tracking_status = input("", "0 valid, 1 degraded, 2 lost", type=Int32, minimum=0, maximum=2)

    shift_uncertainty = input("m", "standard deviation of the shift, estimated by tracking", display_unit="mm", nominal=1e-3)
    tip_lead = input("m", "travel of the tip beyond the shift, by what the profile is stretched", display_unit="mm", nominal=5e-3)

    travel = output("m", "travel of the tip along the vessel at rest", display_unit="mm")
    offset = output("m", "Hall travel less travel of the tip", display_unit="mm")
    uncertainty = output("m", "standard deviation of the travel", display_unit="mm")
    breath = output("m", "by which breath moves the profile now", display_unit="mm")
    slip = output("m", "travel of the gripper that the tip did not follow, beyond the allowed loss", display_unit="mm")
    slipping = output("", "whether the gripper slips", type=Boolean)
    status = output("", "0 valid; 1 degraded: one of both measures is missing, slip, or too uncertain; 2 lost", type=Int32)

    hall = terminal("travel by the Hall sensors", measured_travel=measured_travel, age=hall_age)

    creep = parameter(0.011, "", "part of the gripper's travel that it loses on average", minimum=0.0, maximum=1.0,
                      source="paper, section III.C: half of the 2.2 mm per 100 mm that are the most")
    advance_density = parameter(1e-5, "m", "variance of other losses, per travel forward", minimum=0.0,
                                source="estimate: (1 mm)^2 per 100 mm; creep from stroke to stroke is a fifth of that")
    withdraw_density = parameter(2.5e-4, "m", "the same per travel backward, where bends give play free", minimum=0.0,
                                 source="estimate: (5 mm)^2 per 100 mm, half a lumen")
    reference_density = parameter(3e-6, "m", "variance of the shift's error per travel, as references are renewed", minimum=0.0,
                                  source="tip_tracking: 0.4 mm in 50 mm")
    play_density = parameter(1e-2, "m", "the same where play or slip is likely", minimum=0.0,
                             source="chosen: all of the first 10 mm after a reversal, (10 mm)^2 per 10 mm")
    blind_density = parameter(5e-5, "m", "minimum of these without fiber measurements", minimum=0.0,
                              source="paper, section III.C: (2.2 mm)^2 per 100 mm, the most that a gripper loses")
    blind_maximum = parameter(0.1, "m", "travel without the fiber beyond which the tip may as well have stood still", display_unit="mm",
                              minimum=0.0, source="chosen: two strokes; a free length that buckles takes up all of a gripper's travel")
    speed_maximum = parameter(0.04, "m/s", "of the instrument, if Hall sensors are missing", display_unit="mm/s", minimum=0.0,
                              source="paper, section III.C: 40 mm/s")
    hall_error = parameter(0.15e-3, "m", "standard deviation of the Hall sensors within a stroke", display_unit="mm", minimum=0.0,
                           source="hall_travel: amplitude 0.1 mm within a magnetic pitch, 0.05 mm at a takeover, rounding")
    shift_noise = parameter(0.5e-3, "m", "error of the shift that changes with the place", display_unit="mm", minimum=1e-6,
                            source="tip_tracking: interpolation between gratings, up to 0.45 mm; heart 1 mm")
    shift_correlation = parameter(0.5, "s", "how long such an error lasts", minimum=4e-3,
                                  source="half a pitch at 10 mm/s; a beat of the heart")
    degraded_factor = parameter(3.0, "", "by which that error grows if tracking is degraded", minimum=1.0, source="chosen")
    breath_frequency = parameter(0.2, "Hz", "of the ventilator", minimum=0.0, source="known: set on the ventilator")
    breath_size = parameter(3e-3, "m", "amplitude of breath that is expected", display_unit="mm", minimum=0.0,
                            source="as vessel_travel")
    breath_memory = parameter(200.0, "s", "over which it changes by its own size, as the tip comes to other places", minimum=1.0,
                              source="estimate: 0.75 mm of 3 mm while the tip comes 135 mm farther, at 10 mm/s")
    between_length = parameter(0.12, "m", "from the middle of what is matched to the tip: play in between is unseen by the shift",
                               display_unit="mm", minimum=1e-3,
                               source="tip_tracking: window, free length, half a grating, and half of 150 mm matched")
    ahead_error = parameter(0.5, "", "part of what a reversal adds to the shift that it is wrong by, until the end", minimum=0.0,
                            source="chosen: one number for a stretch that is uneven along a bend")
    tip_motion = parameter(5e-3, "m", "travel of the tip after a reversal that shows that play is taken up", display_unit="mm",
                           minimum=0.0, source="chosen: above what breath may leave")
    play_maximum = parameter(60e-3, "m", "travel of the gripper after a reversal beyond which it is not play",
                             display_unit="mm", minimum=0.0, source="vessel_travel: 52 mm with the tip behind the arch")
    allowance = parameter(0.4, "", "part of the gripper's travel that the tip may lose", minimum=0.0, maximum=1.0,
                          source="chosen: breath moves the profile by up to 0.2 of 10 mm/s")
    slip_limit = parameter(5e-3, "m", "slip above which slipping is reported", display_unit="mm", minimum=0.0,
                           source="chosen: above breath, below a stroke of 50 mm")
    fresh = parameter(20e-3, "s", "age of a Hall sample from which on it is missing", display_unit="ms", minimum=0.0,
                      source="chosen: five samples")
    disagreement_memory = parameter(0.1, "s", "over which the innovation is averaged that counts as uncertainty", minimum=0.0,
                                    source="chosen: 25 samples, a tenth of a heart beat")
    surprise = parameter(3.0, "", "standard deviations of the innovation beyond which the tip is taken to have moved by itself",
                         minimum=1.0, source="chosen: one of 400 normal numbers is larger")
    uncertainty_limit = parameter(5e-3, "m", "uncertainty of the travel beyond which it is degraded", display_unit="mm", minimum=0.0,
                                  source="chosen before results: half of the least lumen and more, a branch could be missed")
    lost_limit = parameter(20e-3, "m", "uncertainty of the travel beyond which it is lost", display_unit="mm", minimum=0.0,
                           source="chosen before results: as the window of tip_tracking")
    gate = parameter(30e-3, "m", "difference from which on a shift is not believed", display_unit="mm", minimum=0.0,
                     source="chosen: above the window of tip_tracking, 20 mm")

    contradiction = local(0.0, "m^2", "sum of squared differences of both measures that were beyond belief")
    blind = local(0.0, "m", "travel of the gripper since the last fiber measurement", display_unit="mm")
    stood = local(0.0, "m", "travel of the gripper that the tip may not have made", display_unit="mm")
    unseen = local(0.0, "m^2", "variance of play that no reversal so far has shown: play is bounded, so the largest counts")
    disagreement = local(0.0, "m", "innovation of late: what both measures differ by and the filter has not explained",
                         display_unit="mm")
    unmeasured = local(0.0, "m", "travel that the gripper may have made while neither measure was there", display_unit="mm")
    x = local(0.0, "m", "offset; what the reference's breath adds; breath and its quadrature", shape=(STATES,))
    p = local(0.0, "m^2", "their covariance", shape=(STATES, STATES))
    turn = local(0.0, "", "turn of breath and quadrature in a step", shape=(STATES, STATES))
    scratch = local(0.0, "m^2", "turn times covariance", shape=(STATES, STATES))
    gain = local(0.0, "", "of the update", shape=(STATES,))
    before = local(0.0, "m", "Hall travel of the last step", display_unit="mm")
    lasting = local(0.0, "m", "part of the innovation that lasts", display_unit="mm")
    beyond = local(0.0, "m", "slip so far", display_unit="mm")
    last_lead = local(0.0, "m", "offset and lasting innovation of the last step", display_unit="mm")
    since_reversal = local(0.0, "m", "travel of the gripper since the last reversal, signed", display_unit="mm")
    extreme = local(0.0, "m", "travel of the gripper at its end or at a reversal", display_unit="mm")
    turned_at = local(0.0, "m", "travel of the tip at the last reversal", display_unit="mm")
    lead_at_turn = local(0.0, "m", "lead of the tip at the last reversal", display_unit="mm")
    ahead_at_turn = local(0.0, "m", "what was added to the shift there", display_unit="mm")
    ahead_full = local(0.0, "m", "what was added when the tip began to move", display_unit="mm")
    ahead = local(0.0, "m", "what is added to the shift: the tip stands while play between it and the match is taken up",
                  display_unit="mm")
    sign = local(1.0, "", "direction of the gripper")
    taken_up = local(True, "", "whether the tip has moved since the last reversal", type=Boolean)
    was_lost = local(False, "", "whether tracking was lost at the last step", type=Boolean)
    was_silent = local(False, "", "whether Hall samples were missing at the last step", type=Boolean)
    ever = local(False, "", "whether tracking has ever been there", type=Boolean)

    def initialize(self) -> None:
        for i in range(STATES):
            self.x[i] = 0.0
            for j in range(STATES):
                self.p[i, j] = 0.0

        # the shift counts from the breath of the first sample: its reference is off by minus that
        variance = 0.5 * self.breath_size * self.breath_size
        self.p[REFERENCE, REFERENCE] = self.p[BREATH, BREATH] = self.p[QUADRATURE, QUADRATURE] = variance
        self.p[REFERENCE, BREATH] = self.p[BREATH, REFERENCE] = -variance
        self.before = self.measured_travel
        self.contradiction = 0.0
        self.unmeasured = 0.0
        self.unseen = 0.0
        self.blind = 0.0
        self.stood = 0.0
        self.disagreement = 0.0
        self.lasting = 0.0
        self.last_lead = 0.0
        self.since_reversal = 0.0
        self.extreme = self.measured_travel
        self.turned_at = self.measured_travel
        self.sign = 1.0
        self.lead_at_turn = self.ahead_at_turn = self.ahead_full = self.ahead = 0.0
        self.taken_up = True
        self.was_lost = False
        self.was_silent = False
        self.ever = False
        self.beyond = 0.0
        self.slip = 0.0
        self.slipping = False
        self.status = LOST
        publish(self)

    def step(self, t: float, h: float) -> None:
        hall = isfinite(self.measured_travel) and self.hall_age <= self.fresh
        move = self.measured_travel - self.before if hall else 0.0
        if hall:
            self.before = self.measured_travel
        if hall and self.was_silent and not self.was_lost:  # the fiber has seen what the gripper did meanwhile
            self.x[OFFSET] += move
            self.last_lead += move
            self.extreme += move
            move = 0.0
        self.was_silent = not hall
        follow_direction(self)
        predict(self, h, move, hall)
        believed = correct(self, h)
        notice_slip(self, move)
        publish(self)
        if (not hall and not believed) or self.uncertainty > self.lost_limit:
            self.status = LOST
        elif (
            hall
            and believed
            and self.tracking_status == VALID
            and not self.slipping
            and self.uncertainty <= self.uncertainty_limit
        ):
            self.status = VALID
        else:
            self.status = DEGRADED


def follow_direction(self: TravelFusion) -> None:
    """Detect reversals: after one, the tip's travel is uncertain until it moves."""
    tip = self.before - self.x[OFFSET]
    self.since_reversal = self.before - self.extreme
    if self.since_reversal * self.sign < -1e-3:  # more than the Hall sensors' noise
        self.sign = -self.sign
        self.taken_up = False
        self.turned_at = tip
        if isfinite(self.tip_lead):
            self.lead_at_turn = self.tip_lead
        self.ahead_at_turn = self.ahead
        self.beyond = 0.0
    elif self.since_reversal * self.sign > 0.0 and self.taken_up:
        self.extreme = self.before
    moved = (tip - self.turned_at) * self.sign

    # the match moves before the tip does, and by as much more as the profile is stretched; that is made up for where the
    # instrument between match and tip is another one
    if self.taken_up:
        self.ahead = self.ahead_full * min(max(1.0 - moved / self.between_length, 0.0), 1.0)
    elif self.tracking_status != LOST and isfinite(self.tip_lead):
        stretched = self.sign * (self.tip_lead - self.lead_at_turn)
        self.ahead = self.ahead_at_turn + self.sign * min(max(stretched, -self.gate), 0.0)
        self.ahead_full = self.ahead
    if not self.taken_up:
        if moved > self.tip_motion or abs(self.since_reversal) > self.play_maximum:
            self.taken_up = True
            self.extreme = self.before
            added = self.ahead_error * (self.ahead_full - self.ahead_at_turn)
            self.unseen = max(self.unseen, added * added + self.tip_motion * self.tip_motion / 3.0)


def predict(self: TravelFusion, h: float, move: float, hall: bool) -> None:
    """Predict the respiration phase and the offset, whose uncertainty grows with the gripper's travel."""
    angle = 2.0 * pi * self.breath_frequency * h
    for i in range(STATES):
        for j in range(STATES):
            self.turn[i, j] = 1.0 if i == j else 0.0
    self.turn[BREATH, BREATH] = self.turn[QUADRATURE, QUADRATURE] = cos(angle)
    self.turn[BREATH, QUADRATURE] = sin(angle)
    self.turn[QUADRATURE, BREATH] = -sin(angle)
    breath = self.x[BREATH]
    self.x[BREATH] = cos(angle) * breath + sin(angle) * self.x[QUADRATURE]
    self.x[QUADRATURE] = cos(angle) * self.x[QUADRATURE] - sin(angle) * breath
    for i in range(STATES):
        for j in range(STATES):
            self.scratch[i, j] = 0.0
            for k in range(STATES):
                self.scratch[i, j] += self.turn[i, k] * self.p[k, j]
    for i in range(STATES):
        for j in range(STATES):
            self.p[i, j] = 0.0
            for k in range(STATES):
                self.p[i, j] += self.scratch[i, k] * self.turn[j, k]
    unsure = not self.taken_up or self.beyond > 0.5 * self.slip_limit
    density = self.advance_density if self.sign > 0.0 else self.withdraw_density
    if self.was_lost or not self.ever:
        density = max(density, self.blind_density)
        self.blind += abs(move)
        if self.blind > self.blind_maximum:
            self.stood += abs(move)
    else:
        self.blind = 0.0
    if unsure:
        density = self.play_density
    self.x[OFFSET] += self.creep * move
    if hall:
        self.unmeasured = 0.0
        self.p[OFFSET, OFFSET] += density * abs(move)
    elif self.was_lost:  # Hall sensors count on: what the gripper does now is known again when they are back
        self.unmeasured += self.speed_maximum * h
    else:
        self.p[OFFSET, OFFSET] += self.play_density * self.speed_maximum * h
    self.p[REFERENCE, REFERENCE] += self.reference_density * abs(move)
    change = self.breath_size * self.breath_size * h / self.breath_memory
    self.p[BREATH, BREATH] += change
    self.p[QUADRATURE, QUADRATURE] += change


def correct(self: TravelFusion, h: float) -> bool:
    """Hall travel less shift is offset + reference + breath, with an error that lasts; whether it was believed."""
    is_usable = isfinite(self.shift) and 0.0 <= self.shift_uncertainty < LONGEST
    if self.tracking_status == LOST or not is_usable:
        self.was_lost = self.ever or abs(self.before) > 1e-3  # the shift counts from where tracking begins
        return False
    noise = self.shift_noise * (self.degraded_factor if self.tracking_status == DEGRADED else 1.0)
    square = noise * noise + self.shift_uncertainty * self.shift_uncertainty
    if self.was_lost:  # a profile that was lost may be found at any other place: the shift counts anew
        self.was_lost = False
        count_anew(self, square)
    self.ever = True
    innovation = self.before - self.shift - self.ahead - self.x[OFFSET] - self.x[REFERENCE] - self.x[BREATH]
    if abs(innovation) > self.gate:  # which of both is wrong cannot be known
        self.was_lost = True
        most = min(abs(innovation), LONGEST)
        self.contradiction += most * most
        return False
    self.lasting += (innovation - self.lasting) * h / (self.shift_correlation + h)
    self.disagreement += (innovation - self.disagreement) * h / (self.disagreement_memory + h)
    expect(self)
    expected = square + self.gain[OFFSET] + self.gain[REFERENCE] + self.gain[BREATH]
    if innovation * innovation > self.surprise * self.surprise * expected:  # breath is slower and smaller: the tip has moved
        self.p[OFFSET, OFFSET] += innovation * innovation
        expect(self)

    # an error that lasts is as bad as white noise larger by the root of the samples it lasts
    total = square * self.shift_correlation / h + self.gain[OFFSET] + self.gain[REFERENCE] + self.gain[BREATH]
    update(self.x, self.p, self.gain, innovation, total, STATES)
    return True


def expect(self: TravelFusion) -> None:
    """Covariance of the state with the expected difference of Hall travel and shift."""
    for i in range(STATES):
        self.gain[i] = self.p[i, OFFSET] + self.p[i, REFERENCE] + self.p[i, BREATH]


def count_anew(self: TravelFusion, square: float) -> None:
    """Take the reference from where the estimate is now: all that is wrong with it is wrong with the reference, reversed."""
    self.x[REFERENCE] = self.before - self.shift - self.ahead - self.x[OFFSET] - self.x[BREATH]
    for i in range(STATES):
        if i != REFERENCE:
            self.p[REFERENCE, i] = self.p[i, REFERENCE] = -self.p[OFFSET, i] - self.p[BREATH, i]
    self.p[REFERENCE, REFERENCE] = self.p[OFFSET, OFFSET] + 2.0 * self.p[OFFSET, BREATH] + self.p[BREATH, BREATH] + square
    self.last_lead -= self.lasting
    self.lasting = self.disagreement = 0.0


def notice_slip(self: TravelFusion, move: float) -> None:
    """Accumulate the tip's loss beyond the allowed one (CUSUM, never below 0), including the innovation because the offset lags."""
    lead = self.x[OFFSET] + self.lasting
    lost = (lead - self.last_lead) * self.sign
    self.last_lead = lead
    if self.taken_up:
        self.beyond = max(self.beyond + lost - self.allowance * abs(move), 0.0)
    self.slip = self.beyond
    self.slipping = self.beyond > self.slip_limit


def publish(self: TravelFusion) -> None:
    """The estimate of now."""
    self.offset = self.x[OFFSET]
    self.travel = self.before - self.x[OFFSET]
    self.breath = -self.x[BREATH]
    # besides the filter's own: what it cannot know
    now = 0.0 if self.taken_up else self.ahead_error * (self.ahead - self.ahead_at_turn)
    back = min(self.since_reversal * self.sign, 0.0)  # a reversal that is not noticed yet
    variance = max(self.p[OFFSET, OFFSET], 0.0) + self.hall_error * self.hall_error + self.contradiction + self.unseen
    variance += now * now + back * back + self.disagreement * self.disagreement
    self.uncertainty = sqrt(variance + self.unmeasured * self.unmeasured + self.stood * self.stood)
