"""Force control with adaptive harmonic feedforward: filtered-x LMS over the harmonics of beat and breath."""

from math import atan2, cos, hypot, pi, sin

from fmus.beat_observer import (
    BREATH,
    BREATH_RATE,
    FIRST,
    HARMONICS,
    PHASE,
    QUADRATURE,
    RATE,
    BeatObserver,
    initialize_observer,
    publish_velocity,
    update_observer,
)
from fmus.control import control_velocity

from twin.component import local, parameter

ORDER = 8  # harmonics of the beat
WAVES = ORDER + 1  # the last is the breath


class AdaptiveHarmonicControl(BeatObserver):
    """Force controller that adapts sine and cosine parts of the gripper's motion until the force shows no harmonic of the beat.

    Filtered-x LMS with the loop and its delay in the reference; the same, seen from outside, as a resonant controller at each harmonic
    (Bodson, Sacks and Khosla, IEEE Trans. Autom. Control 39(9), 1994; Messner and Bodson 1995). Equations in the README.
    It diverges where the delay is wrong by a quarter of a harmonic's period.
    """

    proportional = parameter(1.37, "m/(s*N)", "proportional gain", display_unit="mm/(s*N)", minimum=0.0,
                             source="tuned, see the README")
    lead = parameter(23e-3, "s", "by which what was learned is applied ahead, beyond the delay", display_unit="ms", minimum=0.0,
                     maximum=0.05, source="tuned, see the README")
    learning = parameter(0.29, "1/s", "rate at which each amplitude adapts", minimum=0.0, source="tuned, see the README")

    sine_part = local(0.0, "m", "sine parts of the motion", shape=(WAVES,), display_unit="mm")
    cosine_part = local(0.0, "m", "cosine parts", shape=(WAVES,), display_unit="mm")

    def initialize(self) -> None:
        initialize_observer(self)
        initialize_harmonics(self)

    def step(self, t: float, h: float) -> None:
        was_following = self.is_following
        update_observer(self, t, h)
        if self.is_following and not was_following:
            initialize_harmonics(self)
        velocity = 0.0
        for i in range(WAVES):
            rate = self.mean[BREATH_RATE] if i == ORDER else (i + 1) * self.mean[RATE]
            angle = atan2(self.mean[BREATH], self.mean[QUADRATURE]) if i == ORDER else (i + 1) * self.mean[PHASE]
            if self.is_following and self.has_new_sample:
                adapt(self, i, rate, angle, self.sample_interval)
            velocity += rate * (self.sine_part[i] * cos(angle) - self.cosine_part[i] * sin(angle))
        self.feedforward = self.trust * velocity
        publish_velocity(self, control_velocity(self, self.feedforward, h), h)


def initialize_harmonics(self: AdaptiveHarmonicControl) -> None:
    """Initialize the amplitudes from the observer's harmonics of the wall."""
    for i in range(WAVES):
        self.sine_part[i] = 0.0
        self.cosine_part[i] = 0.0
    self.sine_part[0] = self.mean[FIRST]
    for i in range(1, HARMONICS):
        self.sine_part[i] = self.mean[FIRST + 2 * i - 1]
        self.cosine_part[i] = self.mean[FIRST + 2 * i]
    self.sine_part[ORDER] = hypot(self.mean[BREATH], self.mean[QUADRATURE])


def adapt(self: AdaptiveHarmonicControl, i: int, rate: float, angle: float, h: float) -> None:
    """Descend the squared error, with the reference filtered by the loop from feedforward to force, and divided by its size."""
    gain = self.stiffness * self.proportional
    delay_angle = rate * self.delay
    real = gain * cos(delay_angle)
    imaginary = rate - gain * sin(delay_angle)
    size = self.stiffness * rate / hypot(real, imaginary)
    filtered_angle = angle + 0.5 * pi - atan2(imaginary, real) - delay_angle - rate * self.lead
    step = 2.0 * h * self.learning * self.error / size
    self.sine_part[i] += step * sin(filtered_angle)
    self.cosine_part[i] += step * cos(filtered_angle)
