"""PI force control."""

from fmus.control import ForceControl, control_velocity


class PIControl(ForceControl):
    """PI force controller over the drive's velocity loop: the paper's first strategy.

    Al-Ahmad et al. (RACS), section V, Fig. 7 without feedforward.
    The wall's stiffness closes the loop: P times stiffness is its bandwidth [rad/s], 1.7 rad/s on the soft tip.
    """

    def initialize(self) -> None:
        self.integral_part = 0.0
        self.target_velocity = 0.0

    def step(self, t: float, h: float) -> None:
        self.target_velocity = control_velocity(self, 0.0, h)
