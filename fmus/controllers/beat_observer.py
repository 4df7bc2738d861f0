"""Phase, rate and harmonics of the motion that the gripper should have made, from force and demand: an extended Kalman filter.

    y(t) = q(t - delay) + (setpoint - force) / stiffness,   q: integral of the velocity demand
    y = o + p + a_1 sin(phi) + sum over i = 2..H of a_i sin(i phi) + b_i cos(i phi)
    d phi / dt = rate,   p turns with its quadrature at the breath's rate; all else stands still, but for noise

Parker and Anderson, Frequency tracking of nonsinusoidal periodic signals in noise, Signal Processing 20(2), 1990, with an offset and a
breath whose rate is a state too. It is what the controllers beside `phase_locked_control` have in common: the same force, delay,
stiffness and rate estimate for all of them.
"""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

from fmus.beat_search import RING, TREND, BeatSearch, fix_direction, forget, refine, remember, scan
from fmus.control import ForceControl, NominalPlant, delayed_value, limit_velocity
from fmus.fourier import begin_harmonics, fill_waves
from fmus.kalman import project, update

from twin.component import Boolean, Int64, local, output, parameter

HARMONICS = 4
OFFSET, BREATH, QUADRATURE, BREATH_RATE, PHASE, RATE, FIRST = 0, 1, 2, 3, 4, 5, 6
N = FIRST + 2 * HARMONICS - 1
LINE = 32  # periods that the demand is remembered
SPACING = 34e-3  # [s] between samples of the search, which looks at 128 of them
CLEAR = 0.25  # part of the motion that the best rate may leave unexplained when the filter begins
SLOWEST, FASTEST = 0.08, 0.5  # [Hz] of the breath
JUDGED = 2.0  # [s] over which the force error is averaged, to give up what is worse than P alone
LARGEST = 100.0  # no force [N] and no velocity [m/s] is larger; what is no number is not smaller either
CHANGE = 0.3  # [N] from one value to the next that is an outlier


class BeatObserver(ForceControl, NominalPlant, BeatSearch):
    """Variables of a force controller that follows the beat in the force."""

    former_names = (
        ("rate_walk", "rate_process_noise"),
        ("phase_walk", "phase_process_noise"),
        ("offset_walk", "offset_process_noise"),
        ("breath_walk", "breath_process_noise"),
        ("breath_rate_walk", "breath_rate_process_noise"),
        ("amplitude_walk", "amplitude_process_noise"),
    )

    buffers = (("delay", LINE - 2),)

    share = output("", "part of the learned motion that is fed forward")
    rate = output("Hz", "heart rate; 0: none yet")
    breath = output("Hz", "rate of the breath; 0: none yet")
    feedforward = output("m/s", "learned part of the demand", display_unit="mm/s")

    blend = parameter(
        1.0,
        "s",
        "time in which the learned motion fades in and out",
        minimum=1e-2,
        source="as phase_locked_control: a beat",
    )
    rate_maximum = parameter(
        2.8, "Hz", "highest heart rate looked for", maximum=3.0, fixed=True, source="chosen: 168 beats a minute"
    )
    play = parameter(
        2.1e-3,
        "m",
        "motion of the gripper to either side that the tip does not follow",
        display_unit="mm",
        minimum=0.0,
        source="as phase_locked_control: half of the 4.4 mm by which gripper and tip differ in beyond_paper",
    )
    noise = parameter(
        0.5e-3,
        "m",
        "standard deviation of a sample of y",
        display_unit="mm",
        minimum=1e-6,
        source="as phase_locked_control: 3 mN over the stiffness, and as much again for friction",
    )
    rate_process_noise = parameter(
        0.06, "Hz", "deviation that the heart rate gains in a second", minimum=0.0, source="as phase_locked_control"
    )
    phase_process_noise = parameter(
        0.05, "rad", "deviation that the phase gains in a second", minimum=0.0, source="as phase_locked_control"
    )
    offset_process_noise = parameter(
        0.3e-3,
        "m",
        "deviation that the offset gains in a second",
        display_unit="mm",
        minimum=0.0,
        source="as phase_locked_control",
    )
    breath_process_noise = parameter(
        0.2e-3,
        "m",
        "deviation that respiration gains in a second",
        display_unit="mm",
        minimum=0.0,
        source="chosen; phase_locked_control has 0.5 mm",
    )
    breath_rate_process_noise = parameter(
        0.01, "Hz", "deviation that its rate gains in a second", minimum=0.0, source="estimate: 4 % of 0.25 Hz"
    )
    amplitude_process_noise = parameter(
        0.02e-3,
        "m",
        "deviation that an amplitude gains in a second",
        display_unit="mm",
        minimum=0.0,
        source="as phase_locked_control",
    )

    is_following = local(False, "", "whether the filter follows a beat", type=Boolean)
    trust = local(0.0, "", "part of the learned motion that is fed forward")
    error = local(0.0, "N", "force error; zero where the force is no number")
    has_new_sample = local(False, "", "whether the force is a new value", type=Boolean)
    sample_interval = local(0.0, "s", "from the last new value to this one")
    sample_age = local(0.0, "s", "since the last new value")
    full_share_time = local(0.0, "s", "time since all of the learned motion is fed forward")
    mean_square = local(0.0, "N^2", "mean square of the force error")
    feedback_mean_square = local(0.0, "N^2", "the same when feedback was last alone")
    line = local(0.0, "m", "its last values, a ring", shape=(LINE,))
    tip_position = local(0.0, "m", "place of the tip, by demand and play", display_unit="mm")
    line_head = local(0, "", "place of the latest", type=Int64)
    last_force = local(0.0, "N", "last value of the sensor")
    mean = local(0.0, "", "offset, breath, quadrature, its rate, phase, rate, amplitudes", shape=(N,))
    covariance = local(0.0, "", "of the same", shape=(N, N))
    slope = local(0.0, "", "of the measurement over each", shape=(N,))
    gain = local(0.0, "", "of the filter", shape=(N,))
    waves = local(0.0, "", "sine and cosine of each harmonic", shape=(2 * HARMONICS,))


def initialize_observer(self: BeatObserver) -> None:
    """Reset: no demand yet, no beat found."""
    for i in range(LINE):
        self.line[i] = 0.0
    fix_direction(self)
    self.integral_part = 0.0
    self.demand = 0.0
    self.tip_position = 0.0
    self.line_head = 0
    self.last_force = self.force
    for i in range(N):
        self.mean[i] = 0.0
    self.is_following = False
    self.error = 0.0
    self.has_new_sample = False
    self.sample_interval = self.sample_age = 0.0
    self.mean_square = self.feedback_mean_square = self.full_share_time = 0.0
    self.trust = self.share = self.rate = self.breath = self.feedforward = 0.0
    self.velocity = self.target_velocity = 0.0
    forget(self)


def update_observer(self: BeatObserver, t: float, h: float) -> float:
    """Search the beat in the force, then filter new values of it; return y [m]."""
    delayed = delayed_value(self.line, self.line_head, self.delay / h, LINE)
    y = delayed + (self.setpoint - self.force) / self.stiffness
    self.tip_position = min(max(self.tip_position, delayed - self.play), delayed + self.play)
    wall = y - (delayed - self.tip_position)
    self.sample_age += h
    self.has_new_sample = self.force != self.last_force and abs(self.force - self.last_force) < CHANGE
    self.last_force = self.force
    if self.has_new_sample:
        self.sample_interval = self.sample_age
        self.sample_age = 0.0
    self.error = self.setpoint - self.force if abs(self.force) < LARGEST else 0.0
    self.mean_square += h / JUDGED * (self.error * self.error - self.mean_square)
    if self.has_new_sample and remember(self, SPACING, t, 0.0, 0.0, wall):
        self.along[self.head] = self.ring[self.head, 2]
    if self.is_following:
        predict(self, h)
        if self.has_new_sample:
            correct(self, wall)
        self.is_following = is_plausible(self)
        if not self.is_following:
            forget(self)
    elif self.trust <= 0.0:
        self.feedback_mean_square = self.mean_square
        if self.count >= RING and scan(self, TREND) and self.beat_rest <= CLEAR:
            start_filter(self, refine(self, HARMONICS))
    self.rate = self.mean[RATE] / (2.0 * pi) if self.is_following else 0.0
    self.breath = self.mean[BREATH_RATE] / (2.0 * pi) if self.is_following else 0.0
    step = h / self.blend
    self.trust = min(self.trust + step, 1.0) if self.is_following else max(self.trust - step, 0.0)
    self.share = self.trust
    self.full_share_time = self.full_share_time + h if self.trust >= 1.0 else 0.0
    return y


def is_plausible(self: BeatObserver) -> bool:
    """Return whether the rate is a heart rate, the phase is known, and the force error no worse than under feedback alone."""
    rate = self.mean[RATE] / (2.0 * pi)
    has_beat = 0.8 * self.rate_minimum < rate < 1.2 * self.rate_maximum and self.covariance[PHASE, PHASE] < 1.0
    return has_beat and (self.full_share_time < JUDGED or self.mean_square <= self.feedback_mean_square)


def publish_velocity(self: BeatObserver, velocity: float, h: float) -> None:
    """Limit and publish a velocity [m/s], and integrate it; the feedforward replaces NaN."""
    if not abs(velocity) < LARGEST:
        velocity = self.feedforward
    limit_velocity(self, velocity, h)
    self.line_head = (self.line_head + 1) % LINE
    self.line[self.line_head] = self.demand


def start_filter(self: BeatObserver, rate: float) -> None:
    """Initialize the filter from the fit of the search at a rate [Hz]; its trend becomes the offset, the breath begins at 0.25 Hz."""
    for i in range(N):
        self.mean[i] = 0.0
        for j in range(N):
            self.covariance[i, j] = 0.0
        deviation = 0.3e-3
        if i in (OFFSET, BREATH, QUADRATURE):
            deviation = 2e-3
        elif i == BREATH_RATE:
            deviation = 2.0 * pi * 0.1
        elif i == PHASE:
            deviation = 0.2
        elif i == RATE:
            deviation = 2.0 * pi * 0.05
        self.covariance[i, i] = deviation * deviation
    self.mean[PHASE] = begin_harmonics(self.mean, FIRST, self.fitted, TREND, HARMONICS)
    self.mean[RATE] = 2.0 * pi * rate
    self.mean[BREATH_RATE] = 2.0 * pi * 0.25
    for i in range(TREND):
        self.mean[OFFSET] += self.fitted[i]
    self.is_following = True


def predict(self: BeatObserver, h: float) -> None:
    """Predict mean and covariance by h [s]."""
    m = self.mean
    m[PHASE] += h * m[RATE]
    if m[PHASE] > 2.0 * pi:
        m[PHASE] -= 2.0 * pi
    turn_oscillator(m, self.covariance, BREATH, h * m[BREATH_RATE], N)
    for j in range(N):
        third = h * self.covariance[BREATH_RATE, j]
        self.covariance[BREATH, j] += m[QUADRATURE] * third
        self.covariance[QUADRATURE, j] -= m[BREATH] * third
        self.covariance[PHASE, j] += h * self.covariance[RATE, j]
    for i in range(N):
        third = h * self.covariance[i, BREATH_RATE]
        self.covariance[i, BREATH] += m[QUADRATURE] * third
        self.covariance[i, QUADRATURE] -= m[BREATH] * third
        self.covariance[i, PHASE] += h * self.covariance[i, RATE]
        walk = self.amplitude_process_noise
        if i == OFFSET:
            walk = self.offset_process_noise
        elif i in (BREATH, QUADRATURE):
            walk = self.breath_process_noise
        elif i == BREATH_RATE:
            walk = 2.0 * pi * self.breath_rate_process_noise
        elif i == PHASE:
            walk = self.phase_process_noise
        elif i == RATE:
            walk = 2.0 * pi * self.rate_process_noise
        self.covariance[i, i] += walk * walk * h


def turn_oscillator(mean: Any, covariance: Any, first: int, angle: float, n: int) -> None:
    """Turn the pair of states that begins at `first` by an angle [rad], of n states."""
    c = cos(angle)
    s = sin(angle)
    p = mean[first]
    mean[first] = c * p + s * mean[first + 1]
    mean[first + 1] = c * mean[first + 1] - s * p
    for j in range(n):
        p = covariance[first, j]
        covariance[first, j] = c * p + s * covariance[first + 1, j]
        covariance[first + 1, j] = c * covariance[first + 1, j] - s * p
    for i in range(n):
        p = covariance[i, first]
        covariance[i, first] = c * p + s * covariance[i, first + 1]
        covariance[i, first + 1] = c * covariance[i, first + 1] - s * p


def correct(self: BeatObserver, wall: float) -> None:
    """Update the filter by a sample of the wall [m]."""
    fill_waves(self.waves, 0, self.mean[PHASE], HARMONICS)
    expected = self.mean[OFFSET] + self.mean[BREATH] + self.mean[FIRST] * self.waves[0]
    turn = self.mean[FIRST] * self.waves[1]
    self.slope[OFFSET] = 1.0
    self.slope[BREATH] = 1.0
    self.slope[QUADRATURE] = 0.0
    self.slope[BREATH_RATE] = 0.0
    self.slope[RATE] = 0.0
    self.slope[FIRST] = self.waves[0]
    for i in range(1, HARMONICS):
        k = FIRST + 2 * i - 1
        self.slope[k] = self.waves[2 * i]
        self.slope[k + 1] = self.waves[2 * i + 1]
        expected += self.mean[k] * self.waves[2 * i] + self.mean[k + 1] * self.waves[2 * i + 1]
        turn += (i + 1) * (self.mean[k] * self.waves[2 * i + 1] - self.mean[k + 1] * self.waves[2 * i])
    self.slope[PHASE] = turn
    variance = project(self.covariance, self.slope, self.gain, self.noise * self.noise, N)
    update(self.mean, self.covariance, self.gain, wall - expected, variance, N)
    self.mean[BREATH_RATE] = min(max(self.mean[BREATH_RATE], 2.0 * pi * SLOWEST), 2.0 * pi * FASTEST)
