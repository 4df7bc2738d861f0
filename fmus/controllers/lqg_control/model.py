"""Force control by linear-quadratic-Gaussian design with a harmonic model of the disturbance."""

from math import cos, sin

from fmus.beat_observer import (
    BREATH_RATE,
    PHASE,
    RATE,
    BeatObserver,
    initialize_observer,
    publish_velocity,
    turn_oscillator,
    update_observer,
)
from fmus.control import control_velocity
from fmus.fourier import fill_waves
from fmus.kalman import project, update

from twin.component import Boolean, local, parameter

ORDER = 8  # harmonics of the beat
N = 3 + 2 * ORDER  # offset, breath and its quadrature, sine and cosine parts


class LqgControl(BeatObserver):
    """Force controller with a Kalman filter over oscillators and state feedback on its prediction.

    Separation principle; equations in the README.
    What neither repeats with beat and breath nor moves the offset is not seen: friction that comes and goes leaves an error.
    """

    former_names = (("harmonic_walk", "harmonic_process_noise"), ("level_walk", "level_process_noise"))

    proportional = parameter(1.61, "m/(s*N)", "proportional gain", display_unit="mm/(s*N)", minimum=0.0,
                             source="tuned, see the README")
    lead = parameter(0.4e-3, "s", "by which what was learned is applied ahead, beyond the delay", display_unit="ms", minimum=0.0,
                     maximum=0.05, source="tuned, see the README")
    harmonic_process_noise = parameter(0.16e-3, "m", "deviation that an amplitude of y gains in a second", display_unit="mm", minimum=0.0,
                                       source="tuned, see the README")
    level_process_noise = parameter(3.2e-3, "m", "deviation that the offset of y gains in a second", display_unit="mm", minimum=0.0,
                                    source="tuned, see the README")

    is_started = local(False, "", "whether the filter below has begun", type=Boolean)
    required_mean = local(0.0, "m", "offset, breath, quadrature, sine and cosine parts of y", shape=(N,))
    required_covariance = local(0.0, "", "their covariance", shape=(N, N))
    regressor = local(0.0, "", "of the measurement over each", shape=(N,))
    required_gain = local(0.0, "", "gain of the filter", shape=(N,))

    def initialize(self) -> None:
        self.is_started = False
        initialize_observer(self)

    def step(self, t: float, h: float) -> None:
        y = update_observer(self, t, h)
        if self.is_following and not self.is_started:
            start_required(self)
        self.is_started = self.is_following
        if self.is_started:
            predict_required(self, h)
            if self.has_new_sample:
                correct_required(self, y)
        position, velocity = required_ahead(self, self.delay + self.lead)
        self.feedforward = self.trust * velocity
        regulated = velocity + self.proportional * self.stiffness * (position - self.demand)
        alone = control_velocity(self, 0.0, h)
        publish_velocity(self, self.trust * regulated + (1.0 - self.trust) * alone, h)


def start_required(self: LqgControl) -> None:
    """Initialize the filter from the observer's harmonics of the wall."""
    for i in range(N):
        self.required_mean[i] = 0.0
        for j in range(N):
            self.required_covariance[i, j] = 0.0
        self.required_covariance[i, i] = 4e-6
    for i in range(3):
        self.required_mean[i] = self.mean[i]
    self.required_mean[3] = self.mean[6]
    for k in range(6):
        self.required_mean[5 + k] = self.mean[7 + k]


def predict_required(self: LqgControl, h: float) -> None:
    """Predict by h [s]: the breath turns, all else walks at random."""
    turn_oscillator(self.required_mean, self.required_covariance, 1, h * self.mean[BREATH_RATE], N)
    for i in range(N):
        walk = self.harmonic_process_noise
        if i == 0:
            walk = self.level_process_noise
        elif i < 3:
            walk = self.breath_process_noise
        self.required_covariance[i, i] += walk * walk * h


def correct_required(self: LqgControl, y: float) -> None:
    """Update the filter by a sample of y [m]."""
    self.regressor[0] = 1.0
    self.regressor[1] = 1.0
    self.regressor[2] = 0.0
    fill_waves(self.regressor, 3, self.mean[PHASE], ORDER)
    innovation = y
    for i in range(N):
        innovation -= self.regressor[i] * self.required_mean[i]
    variance = project(self.required_covariance, self.regressor, self.required_gain, self.noise * self.noise, N)
    update(self.required_mean, self.required_covariance, self.required_gain, innovation, variance, N)


def required_ahead(self: LqgControl, tau: float) -> tuple[float, float]:
    """Predict y after tau [s]: position [m] and velocity [m/s]."""
    c = cos(self.mean[BREATH_RATE] * tau)
    s = sin(self.mean[BREATH_RATE] * tau)
    position = self.required_mean[0] + c * self.required_mean[1] + s * self.required_mean[2]
    velocity = self.mean[BREATH_RATE] * (c * self.required_mean[2] - s * self.required_mean[1])
    fill_waves(self.regressor, 3, self.mean[PHASE] + self.mean[RATE] * tau, ORDER)
    for i in range(ORDER):
        k = 3 + 2 * i
        position += self.required_mean[k] * self.regressor[k] + self.required_mean[k + 1] * self.regressor[k + 1]
        velocity += (i + 1) * self.mean[RATE] * (self.required_mean[k] * self.regressor[k + 1] - self.required_mean[k + 1] * self.regressor[k])
    return position, velocity
