"""PI force control with feedforward of the heart motion."""

from fmus.control import ForceControl, control_velocity

from twin.component import local


class PIFeedforwardControl(ForceControl):
    """PI force controller plus the estimated heart velocity: the paper's second strategy.

    Al-Ahmad et al. (RACS), section V, Fig. 7 with x_h itself fed forward.
    The velocity is a plain difference over one period: a rough estimate becomes a rough command.
    """

    position_last = local(0.0, "m", "estimate of the last sample", display_unit="mm")

    def initialize(self) -> None:
        self.integral_part = 0.0
        self.target_velocity = 0.0
        self.position_last = self.heart_position

    def step(self, t: float, h: float) -> None:
        feedforward = (self.heart_position - self.position_last) / h
        self.position_last = self.heart_position
        self.target_velocity = control_velocity(self, feedforward, h)
